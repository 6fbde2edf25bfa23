//! Empirical sets: convex hulls of the recorded futures of each mode of behaviour.

use super::simple_bounds::worst_case_area_m2;
use super::swept::{convex_hull, swept_area};
use super::{Areas, LearnedFamily, future_seen_from_now};
use crate::bounds::ActionModel;
use crate::invalid::{Invalid, length};
use crate::reach::polygon::signed_distance;
use crate::scene::SceneParameters;
use crate::shfrs::family::Family;
use crate::shfrs::window::Window;

/// Determines a window's mode of behaviour.
#[non_exhaustive]
pub enum Mode<M> {
    /// The model's most likely action now.
    MostLikely(M),
    /// The input of the last step: right, straight or left. It is straight if there is no last
    /// step.
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
/// As in that paper, each mode of behaviour has its recorded futures, as positions in the human's
/// frame, and the set at each step bounds the most representative share α of these futures. There
/// are two differences. First, the paper selects futures by an integer program that minimises the
/// area. Here, futures are ordered by their root mean square distance over the steps from the
/// mode's median path (the median of each coordinate), so that the sets are nested. Second, the
/// paper bounds the selected futures by their least and greatest lateral positions. Here, the bound
/// is the convex hull at each step.
///
/// The level is the share α = j/(n + 1), where j of a mode's n futures are selected. At level 1,
/// the set is the worst-case set. Membership tests use only positions, with a tolerance of 5 mm.
/// The area is the area of the union of the convex hulls of consecutive steps' sets, starting at
/// the current position.
pub struct PerModeEmpirical<M> {
    mode: Mode<M>,
    modes: Vec<Futures>,
    steps: usize,
    areas: Areas,
    worst_case_area: f64,
}

/// Largest distance (m) from a hull at which a position counts as inside.
const TOLERANCE_M: f64 = 0.005;

/// The recorded futures of one mode.
struct Futures {
    count: usize,
    /// For each step, the distinct hulls of the j most central futures, in ascending order of j.
    /// Each hull is stored with the least j that gives it.
    hulls: Vec<Vec<(usize, Vec<[f64; 2]>)>>,
}

impl<M: ActionModel> PerModeEmpirical<M> {
    /// Learns from `windows`, which must have the same number of steps.
    ///
    /// # Errors
    /// [`Invalid`] if there are no windows or their lengths differ.
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
        let worst_case_area = worst_case_area_m2(parameters, steps)?;
        Ok(Self { mode, modes, steps, areas: Areas::default(), worst_case_area })
    }
}

impl Futures {
    fn new(mut paths: Vec<Vec<[f64; 2]>>, steps: usize) -> Self {
        let centre: Vec<[f64; 2]> = (0..steps)
            .map(|n| [0, 1].map(|d| median(paths.iter().map(|path| path[n][d]).collect())))
            .collect();
        let square = |x: f64| x * x;
        let apart = |path: &Vec<[f64; 2]>| -> f64 {
            path.iter().zip(&centre).map(|(p, c)| square(p[0] - c[0]) + square(p[1] - c[1])).sum()
        };
        paths.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
        let hulls = (0..steps).map(|n| growing_hulls(paths.iter().map(|path| path[n]))).collect();
        Self { count: paths.len(), hulls }
    }

    /// The number of most central futures that a level below 1 selects. Scores are computed with
    /// [`share`] too, so the level `share(j, n)` selects exactly j futures.
    fn kept(&self, level: f64) -> usize {
        (0..=self.count).rev().find(|&j| share(j, self.count) <= level).unwrap_or(0)
    }

    /// The hulls of the `kept` most central futures at each step.
    fn hulls(&self, kept: usize) -> Vec<Vec<[f64; 2]>> {
        let hull = |hulls: &Vec<(usize, Vec<[f64; 2]>)>| {
            let after = hulls.partition_point(|(from, _)| *from <= kept);
            hulls[..after].last().map(|(_, hull)| hull.clone()).unwrap_or_default()
        };
        self.hulls.iter().map(hull).collect()
    }

    /// The least j for which the hull of the j most central futures at a step contains a position.
    /// Returns `None` if no hull contains it.
    fn least(&self, step: usize, position: [f64; 2]) -> Option<usize> {
        let hulls = &self.hulls[step];
        let holds = |hull: &[[f64; 2]]| signed_distance(hull, position) <= TOLERANCE_M;
        let first = hulls.partition_point(|(_, hull)| !holds(hull));
        hulls.get(first).map(|(from, _)| *from)
    }
}

/// The distinct hulls of the first j points, for j = 1, 2, … Each hull is returned with the least j
/// that gives it.
fn growing_hulls(points: impl Iterator<Item = [f64; 2]>) -> Vec<(usize, Vec<[f64; 2]>)> {
    let mut hulls: Vec<(usize, Vec<[f64; 2]>)> = Vec::new();
    for (i, point) in points.enumerate() {
        let mut hull = hulls.last().map(|(_, hull)| hull.clone()).unwrap_or_default();
        if signed_distance(&hull, point) > 0.0 {
            hull.push(point);
            hulls.push((i + 1, convex_hull(&hull)));
        }
    }
    hulls
}

/// The median, or 0 for an empty list.
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
        self.least_level(window)
    }

    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
        length("window", self.steps, window.steps())?;
        let mode = self.mode.of(window);
        let futures = &self.modes[mode];
        if level >= 1.0 {
            return Ok(self.worst_case_area);
        }
        let area = || match futures.kept(level) {
            0 => 0.0,
            kept => swept_area(&futures.hulls(kept)),
        };
        Ok(self.areas.get(level, mode as u64, area))
    }
}

impl<M: ActionModel> LearnedFamily for PerModeEmpirical<M> {
    fn least_level(&self, window: &Window<'_>) -> Result<f64, Invalid> {
        length("window", self.steps, window.steps())?;
        let futures = &self.modes[self.mode.of(window)];
        let least = future_seen_from_now(window)
            .enumerate()
            .map(|(n, pose)| futures.least(n, pose.position()))
            .try_fold(1, |most, least| Some(most.max(least?)));
        Ok(least.map_or(1.0, |least| share(least, futures.count)))
    }

    fn step_sets(&self, window: &Window<'_>, level: f64) -> Option<Vec<Vec<[f64; 2]>>> {
        let futures = &self.modes[self.mode.of(window)];
        (level < 1.0).then(|| futures.hulls(futures.kept(level)))
    }
}

/// The level that selects `kept` of `count` futures.
fn share(kept: usize, count: usize) -> f64 {
    kept as f64 / (count + 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::ActionSpace;
    use crate::scene::JointState;
    use crate::shfrs::window::Trajectory;
    use crate::vehicle::Pose;

    /// A model that is never called.
    struct Unasked;

    impl ActionModel for Unasked {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(&[])
        }

        fn probabilities(&self, _: &[JointState], _: &mut [f64]) {}
    }

    /// A two-step drive through `points`, given in the frame of a pose far from the origin. A step
    /// with the turn rate `held` precedes the drive.
    fn drive(held: f64, points: [[f64; 2]; 2]) -> Trajectory {
        let now = Pose::new(5.0, -3.0, 0.5 * crate::math::PI);
        // Ahead is +y, to the left is −x.
        let at = |[x, y]: [f64; 2]| Pose::new(now.x - y, now.y + x, now.psi);
        let states = [now, now, at(points[0]), at(points[1])];
        let states = states.map(|human| JointState { human, robot: now }).to_vec();
        Trajectory::new(states, vec![held, 0.0, 0.0]).unwrap()
    }

    fn learned(drives: &[Trajectory]) -> PerModeEmpirical<Unasked> {
        let windows: Vec<_> =
            drives.iter().map(|drive| Window::new(drive, 1, 2).unwrap()).collect();
        PerModeEmpirical::learn(Mode::Held, &SceneParameters::default(), &windows).unwrap()
    }

    /// Futures near (1, 0) and (2, 0): the median path, then corners of growing squares.
    fn squares() -> Vec<Trajectory> {
        let mut drives = vec![drive(0.0, [[1.0, 0.0], [2.0, 0.0]])];
        for half in [0.1, 0.2] {
            for (x, y) in [(-half, -half), (half, -half), (half, half), (-half, half)] {
                drives.push(drive(0.0, [[1.0 + x, y], [2.0 + x, y]]));
            }
        }
        drives
    }

    #[test]
    fn scores_are_shares_of_the_futures() {
        let mut family = learned(&squares());
        let mut score = |held, point: [f64; 2]| {
            let drive = drive(held, [[1.0, 0.0], point]);
            family.score(&Window::new(&drive, 1, 2).unwrap()).unwrap()
        };
        // There are nine futures, and each adds a tenth to the level.
        assert_eq!(score(0.0, [2.0, 0.0]), 0.1);
        assert_eq!(score(0.0, [2.0, 0.0049]), 0.1);
        for point in [[2.1, 0.1], [1.9, -0.1], [2.104, 0.0]] {
            assert!((0.2..=0.5).contains(&score(0.0, point)), "{point:?}");
        }
        for point in [[2.2, 0.2], [2.0, 0.15]] {
            assert!((0.6..=0.9).contains(&score(0.0, point)), "{point:?}");
        }
        assert_eq!(score(0.0, [2.21, 0.0]), 1.0);
        // There are no recordings of turning humans.
        assert_eq!(score(-0.5, [2.0, 0.0]), 1.0);
    }

    #[test]
    fn areas_are_those_of_the_swept_hulls() {
        let mut family = learned(&squares());
        let drive = drive(0.0, [[1.0, 0.0], [2.0, 0.0]]);
        let window = Window::new(&drive, 1, 2).unwrap();
        let mut area = |level| family.area_m2(&window, level).unwrap();
        assert_eq!((area(0.0), area(0.1)), (0.0, 0.0));
        // A triangle from the current position to the first square, and a strip.
        assert!((area(0.5) - (0.09 + 0.24)).abs() < 1e-9);
        assert!((area(0.9) - (0.16 + 0.56)).abs() < 1e-9);
        // The worst-case area is (v²/6) · 2ω · T³.
        assert!((area(1.0) - 4.0 / 6.0 * 0.4 * 0.4 * 0.4).abs() < 1e-4);
    }

    #[test]
    fn windows_that_do_not_fit_are_refused() {
        let drives = squares();
        let mut family = learned(&drives);
        let short = Window::new(&drives[0], 1, 1).unwrap();
        assert_eq!(family.score(&short).unwrap_err().field, "window");
        assert_eq!(family.area_m2(&short, 0.5).unwrap_err().field, "window");
        let learn = |windows: &[Window<'_>]| {
            let parameters = SceneParameters::default();
            PerModeEmpirical::<Unasked>::learn(Mode::Held, &parameters, windows).err()
        };
        assert_eq!(learn(&[]).map(|invalid| invalid.field), Some("windows".to_owned()));
        let uneven = [Window::new(&drives[0], 1, 2).unwrap(), short];
        assert_eq!(learn(&uneven).map(|invalid| invalid.field), Some("windows[1]".to_owned()));
    }
}
