//! Evaluates the same windows under changing settings, with cached intermediate results.
//!
//! With `base` roll-outs, Algorithm 1 and its bounds before widening do not depend on ε. The area
//! of a tube depends only on its bounds, which many windows share. So a change of ε requires only
//! membership tests in the changed set, and one area for each distinct list of bounds.

use super::probability::{Judged, first_inside, holds};
use super::widened::{tube_area_m2, widened};
use super::window::Window;
use super::window_sets::Prediction;
use crate::bounds::{ActionChoice, ActionModel, Algorithm1, BoundsSettings, Motion, Rollout};
use crate::invalid::Invalid;
use std::collections::HashMap;

/// Cache for the windows of some trajectories under one [`Prediction`]. Results are bit-identical
/// to the results of [`judge`](super::probability::judge). A different prediction or different
/// trajectories need a new cache.
#[derive(Clone, Debug, Default)]
pub struct Memory {
    /// The roll-out settings for which `windows` was computed.
    rollouts: Option<Rollouts>,
    /// Cached results by trajectory and by the first step of the window.
    windows: Vec<Vec<Option<Known>>>,
    bases: Bases,
    algorithm: Algorithm1,
}

/// Settings that determine the roll-outs: the choice of actions, and the widening (rad/s).
type Rollouts = (ActionChoice, f64);

/// Cached results of a window.
#[derive(Clone, Debug)]
struct Known {
    /// Index of the window's bounds before widening, in [`Bases::all`].
    base: usize,
    /// For each cached widening (rad/s), whether the set contains the window's trajectory.
    held: Recent<bool>,
}

/// Lowest and highest turn rate of each step (rad/s).
type Rates = Vec<(f64, f64)>;

/// Distinct bounds before widening.
#[derive(Clone, Debug, Default)]
struct Bases {
    /// The bounds, and the areas (m²) of their tubes by widening (rad/s).
    all: Vec<(Rates, Recent<f64>)>,
    /// Maps the bits of the rates to an index into `all`.
    places: HashMap<Vec<u64>, usize>,
}

/// Cache of values by widening, with at most [`RECENT`] entries.
#[derive(Clone, Debug)]
struct Recent<T>(Vec<(f64, T)>);

/// Maximum number of cached widenings. It suffices for all sets and some earlier slider positions.
const RECENT: usize = 32;

/// Maximum number of distinct bounds that stay cached when the roll-out settings change.
const BASES: usize = 4096;

impl Memory {
    /// Evaluates windows of the trajectory with index `place`. The windows must have the number of
    /// steps of `settings`.
    ///
    /// # Errors
    /// [`Invalid`] if the prediction fails.
    pub fn judge(
        &mut self,
        place: usize,
        windows: &[Window<'_>],
        prediction: &Prediction<'_, impl ActionModel>,
        settings: &BoundsSettings,
    ) -> Result<Vec<Judged>, Invalid> {
        self.prepare(settings);
        if self.windows.len() <= place {
            self.windows.resize_with(place + 1, Vec::new);
        }
        windows.iter().map(|window| self.judge_one(place, window, prediction, settings)).collect()
    }

    /// If the roll-out settings changed, clears the cached windows. Also clears the cached bounds
    /// if there are more than [`BASES`].
    fn prepare(&mut self, settings: &BoundsSettings) {
        let widening = match settings.rollout() {
            Rollout::Paper => settings.epsilon()[0],
            Rollout::Base => 0.0,
        };
        let is_same =
            |(choice, before): &Rollouts| choice == settings.choice() && *before == widening;
        if self.rollouts.as_ref().is_some_and(is_same) {
            return;
        }
        self.rollouts = Some((settings.choice().clone(), widening));
        self.windows.iter_mut().for_each(Vec::clear);
        if self.bases.all.len() > BASES {
            self.bases = Bases::default();
        }
    }

    fn judge_one(
        &mut self,
        place: usize,
        window: &Window<'_>,
        prediction: &Prediction<'_, impl ActionModel>,
        settings: &BoundsSettings,
    ) -> Result<Judged, Invalid> {
        let begun = &mut self.windows[place];
        if begun.len() <= window.begin() {
            begun.resize(window.begin() + 1, None);
        }
        let known = &mut begun[window.begin()];
        let known = match known {
            Some(known) => known,
            None => {
                let motion = Motion::from(prediction.parameters);
                let robot = prediction.robot_action;
                let (model, history) = (prediction.model, window.history());
                let found = self.algorithm.run(history, &motion, model, robot, settings)?;
                known.insert(Known { base: self.bases.place(&found.raw), held: Recent(Vec::new()) })
            }
        };
        let (base, areas) = &mut self.bases.all[known.base];
        let epsilon = settings.epsilon();
        let bounds = |epsilon| widened(base, epsilon, prediction.turn_rate());
        let area = |&epsilon: &f64| {
            areas.get(epsilon, || tube_area_m2(&bounds(epsilon)?, prediction.parameters))
        };
        let area_m2 = epsilon.iter().map(area).collect::<Result<_, _>>()?;
        let first = first_inside(epsilon.len(), |j| {
            known.held.get(epsilon[j], || holds(&bounds(epsilon[j])?, window, prediction))
        })?;
        Ok(Judged { first, area_m2 })
    }
}

impl Bases {
    fn place(&mut self, raw: &[(f64, f64)]) -> usize {
        let bits = raw.iter().flat_map(|(lo, hi)| [lo.to_bits(), hi.to_bits()]).collect();
        *self.places.entry(bits).or_insert_with(|| {
            self.all.push((raw.to_vec(), Recent(Vec::new())));
            self.all.len() - 1
        })
    }
}

impl<T: Copy> Recent<T> {
    /// The value for `epsilon`, computed unless it is cached.
    fn get(
        &mut self,
        epsilon: f64,
        compute: impl FnOnce() -> Result<T, Invalid>,
    ) -> Result<T, Invalid> {
        if let Some(&(_, value)) = self.0.iter().find(|(known, _)| *known == epsilon) {
            return Ok(value);
        }
        let value = compute()?;
        if self.0.len() == RECENT {
            self.0.remove(0);
        }
        self.0.push((epsilon, value));
        Ok(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::ActionSpace;
    use crate::math::{SeededRng, cos, sin};
    use crate::scene::{JointState, SceneParameters};
    use crate::shfrs::probability::judge;
    use crate::shfrs::testing::drive;
    use crate::shfrs::window::{Trajectory, WindowChoice};

    const RATES: [f64; 3] = [-0.5, 0.0, 0.5];

    /// A human whose actions depend on the positions of the vehicles.
    struct Reacting;

    impl ActionModel for Reacting {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(&RATES)
        }

        fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
            let now = history[history.len() - 1];
            let left = 0.3 + 0.3 * sin(1.7 * now.human.psi + now.human.y);
            let right = 0.2 + 0.2 * cos(now.human.x - now.robot.x);
            out.copy_from_slice(&[right, 1.0 - left - right, left]);
        }
    }

    /// Changes the settings like a user who moves sliders. Each result is bit-identical to the
    /// result without a cache.
    #[test]
    fn what_was_known_before_changes_no_bit() {
        let mut rng = SeededRng::new(7);
        let parameters = SceneParameters::default();
        let prediction = Prediction::new(&parameters, &Reacting);
        let drives: Vec<Trajectory> = (0..6)
            .map(|_| drive(&(0..16).map(|_| RATES[rng.below(3)]).collect::<Vec<_>>()))
            .collect();
        let mut memory = Memory::default();
        let mut epsilon = vec![0.0, 0.2, 0.5, 1.0];
        let (mut steps, mut rollout) = (6, Rollout::Base);
        let mut choice = ActionChoice::TopK(vec![1; 6]);
        let mut found = Vec::new();
        for case in 0..120 {
            match rng.below(6) {
                0 => {
                    steps = 1 + rng.below(12);
                    choice = ActionChoice::TopK((0..steps).map(|_| 1 + rng.below(3)).collect());
                }
                1 => choice = ActionChoice::Adaptive { tau: 0.6 * rng.unit() + 0.01, steps },
                2 => rollout = [Rollout::Base, Rollout::Paper][rng.below(2)],
                _ => {
                    epsilon[rng.below(3)] = (40.0 * rng.unit()).round() / 50.0;
                    epsilon.sort_by(f64::total_cmp);
                }
            }
            let settings = prediction.settings(epsilon.clone(), &choice, rollout).unwrap();
            let windows = WindowChoice::EveryStep.windows(&drives, steps);
            for (place, windows) in windows.iter().enumerate() {
                let kept = memory.judge(place, windows, &prediction, &settings).unwrap();
                assert_eq!(kept, judge(windows, &prediction, &settings).unwrap(), "{case}");
                found.extend(kept.iter().map(|judged| judged.first));
            }
        }
        // Each set was the smallest set around the trajectory of at least one window.
        assert!((0..4).all(|set| found.contains(&set)));
    }

    #[test]
    fn a_slider_that_moves_for_long_fills_no_memory() {
        let parameters = SceneParameters::default();
        let prediction = Prediction::new(&parameters, &Reacting);
        let drives = [drive(&[0.5, -0.5, 0.0, 0.5])];
        let windows = WindowChoice::EveryStep.windows(&drives, 3).concat();
        let mut memory = Memory::default();
        for i in 0..500 {
            let epsilon = vec![f64::from(i) / 1000.0, 1.0];
            let choice = ActionChoice::TopK(vec![1 + usize::from(i % 100 == 0); 3]);
            let settings = prediction.settings(epsilon, &choice, Rollout::Base).unwrap();
            memory.judge(0, &windows, &prediction, &settings).unwrap();
        }
        let known = memory.windows[0].iter().flatten();
        assert!(known.clone().count() == 2 && known.clone().all(|it| it.held.0.len() <= RECENT));
        assert!(memory.bases.all.iter().all(|(_, areas)| areas.0.len() <= RECENT));
    }
}
