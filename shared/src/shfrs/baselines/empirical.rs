//! Sets of recorded futures, for each mode of behaviour.

use super::swept::{convex_hull, swept_area};
use super::widened::worst_case_area;
use super::{Areas, future_seen_from_now};
use crate::bounds::ActionModel;
use crate::invalid::{Invalid, length};
use crate::math::hypot;
use crate::reach::polygon::signed_distance;
use crate::scene::SceneParameters;
use crate::shfrs::family::Family;
use crate::shfrs::window::Window;

/// What a window's mode of behaviour is read from.
pub enum Mode<M> {
    /// The action that the model finds most likely now.
    MostLikely(M),
    /// The input of the last step before now: right, straight (also if there is none), left.
    Held,
}

impl<M: ActionModel> Mode<M> {
    fn count(&self) -> usize {
        match self {
            Self::MostLikely(model) => model.actions().len(),
            Self::Held => 3,
        }
    }

    fn of(&self, window: &Window<'_>) -> usize {
        match self {
            Self::MostLikely(model) => {
                let mut probabilities = vec![0.0; model.actions().len()];
                model.probabilities(window.history(), &mut probabilities);
                let most = probabilities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                probabilities.iter().position(|&p| p == most).unwrap_or(0)
            }
            Self::Held => match window.past_turn_rates().last() {
                Some(&rate) if rate < 0.0 => 0,
                Some(&rate) if rate > 0.0 => 2,
                _ => 1,
            },
        }
    }
}

/// Empirical reachable sets, after Driggs-Campbell, Dong and Bajcsy, *Robust, informative
/// human-in-the-loop predictions via empirical reachable sets* (IEEE Transactions on
/// Intelligent Vehicles, 2018).
///
/// Taken from there: modes of behaviour; for each mode the recorded futures, as positions in
/// the human's frame; the set is what bounds the most representative share α of them, at each
/// step.
/// Not taken: which futures are kept is decided there by an integer program that minimises
/// the area. Here they are ordered by how central they are (the root mean square distance over
/// the steps from the mode's median path, the median taken of each coordinate), so that sets
/// of all shares are nested; and their bound is the convex hull at each step, where they take
/// the least and the greatest lateral position.
///
/// The level is the share α of a mode's n futures, counted as j/(n + 1). Level 1 is thus
/// beyond all of them: the worst-case set. Only positions are tested, within 5 mm of the hull.
/// The area is that of the union of the convex hulls of neighbouring steps' sets, from the
/// present position on.
pub struct PerModeEmpirical<M> {
    mode: Mode<M>,
    modes: Vec<Futures>,
    steps: usize,
    areas: Areas,
    worst_case_area: f64,
}

/// How far outside of a hull a position still counts as inside, m.
const TOLERANCE_M: f64 = 0.005;

/// The recorded futures of one mode.
struct Futures {
    count: usize,
    /// For each step: hulls of the most central futures, each with the number of futures from
    /// which on it is the hull, rising.
    hulls: Vec<Vec<(usize, Vec<[f64; 2]>)>>,
}

impl<M: ActionModel> PerModeEmpirical<M> {
    /// Learns from `windows`, which are equally long.
    ///
    /// # Errors
    /// [`Invalid`] if there is no window or their lengths differ.
    pub fn learn(
        mode: Mode<M>,
        parameters: &SceneParameters,
        windows: &[Window<'_>],
    ) -> Result<Self, Invalid> {
        let Some(first) = windows.first() else {
            return Err(Invalid::new("windows", "at least 1", "none"));
        };
        let steps = first.steps();
        let mut paths = vec![Vec::new(); mode.count()];
        for (i, window) in windows.iter().enumerate() {
            length(&format!("windows[{i}]"), steps, window.steps())?;
            let path: Vec<_> = future_seen_from_now(window).map(|pose| pose.position()).collect();
            paths[mode.of(window)].push(path);
        }
        let modes = paths.into_iter().map(|paths| Futures::new(paths, steps)).collect();
        let worst_case_area = worst_case_area(parameters, steps)?;
        Ok(Self { mode, modes, steps, areas: Areas::default(), worst_case_area })
    }
}

impl Futures {
    fn new(mut paths: Vec<Vec<[f64; 2]>>, steps: usize) -> Self {
        let centre: Vec<[f64; 2]> = (0..steps)
            .map(|n| [0, 1].map(|d| median(paths.iter().map(|path| path[n][d]).collect())))
            .collect();
        let apart = |path: &Vec<[f64; 2]>| -> f64 {
            path.iter().zip(&centre).map(|(p, c)| hypot(p[0] - c[0], p[1] - c[1]).powi(2)).sum()
        };
        paths.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
        let hulls = (0..steps).map(|n| growing_hulls(paths.iter().map(|path| path[n]))).collect();
        Self { count: paths.len(), hulls }
    }

    /// The hulls at each step of the `kept` ≥ 1 most central futures.
    fn hulls(&self, kept: usize) -> impl Iterator<Item = &Vec<[f64; 2]>> {
        self.hulls.iter().map(move |hulls| {
            let after = hulls.partition_point(|(from, _)| *from <= kept);
            &hulls[after - 1].1
        })
    }

    /// The least number of futures whose hull at a step holds a position.
    fn least(&self, step: usize, position: [f64; 2]) -> Option<usize> {
        let hulls = &self.hulls[step];
        let holds = |hull: &[[f64; 2]]| signed_distance(hull, position) >= -TOLERANCE_M;
        let first = hulls.partition_point(|(_, hull)| !holds(hull));
        hulls.get(first).map(|(from, _)| *from)
    }
}

/// Every hull of the first 1, 2, … points that differs from the one before.
fn growing_hulls(points: impl Iterator<Item = [f64; 2]>) -> Vec<(usize, Vec<[f64; 2]>)> {
    let mut hulls: Vec<(usize, Vec<[f64; 2]>)> = Vec::new();
    for (i, point) in points.enumerate() {
        let mut hull = hulls.last().map(|(_, hull)| hull.clone()).unwrap_or_default();
        if signed_distance(&hull, point) < 0.0 {
            hull.push(point);
            hulls.push((i + 1, convex_hull(&hull)));
        }
    }
    hulls
}

/// The middle one, or the mean of the middle two; 0 of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

impl<M: ActionModel> Family for PerModeEmpirical<M> {
    fn name(&self) -> String {
        match self.mode {
            Mode::MostLikely(_) => "empirical, likely action".to_owned(),
            Mode::Held => "empirical, held input".to_owned(),
        }
    }

    fn level_name(&self) -> &'static str {
        "share of the mode’s futures"
    }

    fn most(&self) -> f64 {
        1.0
    }

    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid> {
        length("window", self.steps, window.steps())?;
        let futures = &self.modes[self.mode.of(window)];
        let least = future_seen_from_now(window)
            .enumerate()
            .map(|(n, pose)| futures.least(n, pose.position()))
            .try_fold(1, |most, least| Some(most.max(least?)));
        Ok(least.map_or(1.0, |least| share(least, futures.count)))
    }

    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
        length("window", self.steps, window.steps())?;
        let mode = self.mode.of(window);
        let futures = &self.modes[mode];
        if level >= 1.0 {
            return Ok(self.worst_case_area);
        }
        // Counted as scores are, so that a score as the level keeps what it stands for.
        let kept = (0..=futures.count).rev().find(|&j| share(j, futures.count) <= level);
        let Some(kept) = kept.filter(|&kept| kept > 0) else {
            return Ok(0.0);
        };
        Ok(self.areas.get(level, mode as u64, || {
            let mut sets = vec![vec![[0.0, 0.0]]];
            sets.extend(futures.hulls(kept).cloned());
            swept_area(&sets)
        }))
    }
}

/// The level at which `kept` of `count` futures are kept.
fn share(kept: usize, count: usize) -> f64 {
    kept as f64 / (count + 1) as f64
}
