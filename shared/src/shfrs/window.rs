//! Windows: the parts of recorded trajectories on which sets are evaluated.
//!
//! A window begins at step T_c of a trajectory and looks T steps ahead. Windows of one trajectory
//! depend on each other; trajectories are assumed to be independent. Therefore every result states
//! its [`WindowChoice`], and every guarantee needs a choice with at most one window per trajectory.

use crate::invalid::{Invalid, length};
use crate::math::SeededRng;
use crate::plausibility;
#[cfg(feature = "learn")]
use crate::recording::{Fault, RecordedTrial};
use crate::scene::{JointState, SceneParameters};
use crate::vehicle::TurnInput;

/// The joint states of a recorded trial, and the human's turn rates between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    states: Vec<JointState>,
    turn_rates: Vec<f64>,
}

impl Trajectory {
    /// `states[i]` is the joint state before step i, and the last entry is the state after the last
    /// step. `turn_rates[i]` is the human's turn rate in step i (rad/s).
    ///
    /// # Errors
    /// [`Invalid`] if there are no steps, lengths do not match, or a number is not finite.
    pub fn new(states: Vec<JointState>, turn_rates: Vec<f64>) -> Result<Self, Invalid> {
        if turn_rates.is_empty() {
            return Err(Invalid::new("turn_rates", "at least one step", "none"));
        }
        length("states", turn_rates.len() + 1, states.len())?;
        for (i, state) in states.iter().enumerate() {
            state.check().map_err(|invalid| invalid.within(&format!("states[{i}]")))?;
        }
        if let Some(i) = turn_rates.iter().position(|rate| !rate.is_finite()) {
            return Err(Invalid::new(format!("turn_rates[{i}]"), "a finite number", turn_rates[i]));
        }
        Ok(Self { states, turn_rates })
    }

    /// The trajectory of a human who held `inputs[i]` in step i, with the vehicles of `scene`.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn driven(
        states: Vec<JointState>,
        inputs: &[TurnInput],
        scene: &SceneParameters,
    ) -> Result<Self, Invalid> {
        Self::new(states, inputs.iter().map(|&input| scene.human.turn_rate(input)).collect())
    }

    /// The trajectory of a recorded trial with the vehicles of `scene`.
    ///
    /// # Errors
    /// [`Fault`] for a trial that [`Self::new`] rejects.
    #[cfg(feature = "learn")]
    pub fn of(trial: &RecordedTrial, scene: &SceneParameters) -> Result<Self, Fault> {
        Self::driven(trial.states.clone(), &trial.inputs, scene)
            .map_err(|what| Fault { line: trial.line, what })
    }

    /// Checks that the human's vehicle of `scene` could have driven the trajectory with these turn
    /// rates. A calibration guarantees nothing about trajectories that this vehicle cannot drive.
    /// The robot's path can be arbitrary.
    ///
    /// # Errors
    /// The errors of [`plausibility::check_drive`].
    pub fn check(&self, scene: &SceneParameters) -> Result<(), Invalid> {
        plausibility::check_drive(scene, &self.states, &self.turn_rates)
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.turn_rates.len()
    }

    /// The joint states. There is one more state than steps.
    #[must_use]
    pub fn states(&self) -> &[JointState] {
        &self.states
    }

    /// The human's turn rate in each step (rad/s).
    #[must_use]
    pub fn turn_rates(&self) -> &[f64] {
        &self.turn_rates
    }

    /// A seed that depends on `seed` and on every bit of the trajectory. Equal trajectories give
    /// equal seeds, and any difference gives an effectively random seed.
    fn mixed_with(&self, seed: u64) -> u64 {
        let poses = self.states.iter().flat_map(|state| [state.human, state.robot]);
        let numbers = poses.flat_map(<[f64; 3]>::from).chain(self.turn_rates.iter().copied());
        numbers.fold(mixed(seed), |sum, number| mixed(sum ^ number.to_bits()))
    }

    /// The first step in which the human turned, if any.
    #[must_use]
    pub fn onset(&self) -> Option<usize> {
        self.turn_rates.iter().position(|&rate| rate != 0.0)
    }
}

/// The output function of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): every output bit depends
/// on every input bit.
fn mixed(bits: u64) -> u64 {
    let bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// A window: `steps` steps of a trajectory, from step `begin` on.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    trajectory: &'a Trajectory,
    begin: usize,
    steps: usize,
}

impl<'a> Window<'a> {
    /// The window from step `begin` on. Returns `None` if `steps` is 0 or too few steps are left.
    #[must_use]
    pub fn new(trajectory: &'a Trajectory, begin: usize, steps: usize) -> Option<Self> {
        let fits = steps > 0 && begin + steps <= trajectory.steps();
        fits.then_some(Self { trajectory, begin, steps })
    }

    /// Number of steps, T ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// The first step of the window, T_c.
    #[must_use]
    pub fn begin(&self) -> usize {
        self.begin
    }

    /// The joint states up to and including the current one. A prediction must use only these
    /// states.
    #[must_use]
    pub fn history(&self) -> &'a [JointState] {
        &self.trajectory.states[..=self.begin]
    }

    /// The human's turn rates up to now (rad/s).
    #[must_use]
    pub fn past_turn_rates(&self) -> &'a [f64] {
        &self.trajectory.turn_rates[..self.begin]
    }

    /// The current joint state.
    #[must_use]
    pub fn now(&self) -> JointState {
        self.trajectory.states[self.begin]
    }

    /// The future: the joint state after each step of the window.
    #[must_use]
    pub fn future(&self) -> &'a [JointState] {
        &self.trajectory.states[self.begin + 1..=self.begin + self.steps]
    }

    /// The human's turn rate in each step of the window (rad/s).
    #[must_use]
    pub fn turn_rates(&self) -> &'a [f64] {
        &self.trajectory.turn_rates[self.begin..self.begin + self.steps]
    }
}

/// The rule that selects the windows of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WindowChoice {
    /// A window from every step that has enough steps left. A trajectory can have several windows.
    EveryStep,
    /// One window per trajectory, from a random step.
    RandomOne {
        /// Seed of the random steps.
        seed: u64,
    },
    /// One window per trajectory, from the first step in which the human turns. A trajectory has no
    /// window if the human never turns, or if too few steps are left from the first turn.
    AvoidanceOnset,
}

impl WindowChoice {
    /// The name of this choice in results.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::EveryStep => "every_step",
            Self::RandomOne { .. } => "random_one",
            Self::AvoidanceOnset => "avoidance_onset",
        }
    }

    /// Whether there is at most one window per trajectory, so that windows are independent.
    #[must_use]
    pub fn is_single(self) -> bool {
        self != Self::EveryStep
    }

    /// The windows of `steps` ≥ 1 steps, one list per trajectory. A random window depends only on
    /// the seed and on the bits of its trajectory. It does not depend on the trajectory's index in
    /// its list. Otherwise, calibration and test trajectories with equal indices would start their
    /// windows at the same step.
    #[must_use]
    pub fn windows(self, trajectories: &[Trajectory], steps: usize) -> Vec<Vec<Window<'_>>> {
        let of = |trajectory| {
            let Some(last) = Trajectory::steps(trajectory).checked_sub(steps) else {
                return Vec::new();
            };
            let begins = match self {
                Self::EveryStep => 0..last + 1,
                Self::RandomOne { seed } => {
                    let begin =
                        SeededRng::new(Trajectory::mixed_with(trajectory, seed)).below(last + 1);
                    begin..begin + 1
                }
                Self::AvoidanceOnset => trajectory.onset().map_or(0..0, |begin| begin..begin + 1),
            };
            begins.filter_map(|begin| Window::new(trajectory, begin, steps)).collect()
        };
        trajectories.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::Pose;

    fn trajectory(turn_rates: &[f64]) -> Trajectory {
        let at = |i: usize| JointState {
            human: Pose::new(i as f64, 0.0, 0.0),
            robot: Pose::new(9.0, 0.0, 3.0),
        };
        Trajectory::new((0..=turn_rates.len()).map(at).collect(), turn_rates.to_vec()).unwrap()
    }

    #[test]
    fn each_choice_takes_the_windows_it_names() {
        let drives = [trajectory(&[0.0, 0.0, 0.5, 0.0]), trajectory(&[0.0; 4]), trajectory(&[0.5])];
        let begins = |choice: WindowChoice, steps| -> Vec<Vec<usize>> {
            let windows = choice.windows(&drives, steps);
            windows.iter().map(|list| list.iter().map(Window::begin).collect()).collect()
        };
        assert_eq!(begins(WindowChoice::EveryStep, 2), [vec![0, 1, 2], vec![0, 1, 2], vec![]]);
        assert_eq!(begins(WindowChoice::AvoidanceOnset, 2), [vec![2], vec![], vec![]]);
        assert_eq!(begins(WindowChoice::AvoidanceOnset, 3), [vec![], vec![], vec![0; 0]]);
        for seed in 0..20 {
            let one = begins(WindowChoice::RandomOne { seed }, 2);
            assert!(one[..2].iter().all(|list| list.len() == 1 && list[0] <= 2));
            assert_eq!(one, begins(WindowChoice::RandomOne { seed }, 2));
        }
    }

    /// Trajectories in different parts of a split start their windows at different steps. A given
    /// trajectory starts its window at the same step in any list.
    #[test]
    fn random_steps_belong_to_trajectories_and_not_to_places() {
        let drives: Vec<Trajectory> = (0..400)
            .map(|i| trajectory(&[&[0.001 * f64::from(i)][..], &[0.0; 49]].concat()))
            .collect();
        let one = WindowChoice::RandomOne { seed: 5 };
        let begins = |of: &[Trajectory]| -> Vec<usize> {
            one.windows(of, 10).iter().map(|list| list[0].begin()).collect()
        };
        let (all, later) = (begins(&drives), begins(&drives[200..]));
        assert_eq!(all[200..], later);
        // With 41 possible steps, about 5 of 200 pairs agree by chance. If the index selected the
        // step, all 200 pairs would agree.
        let same = all.iter().zip(&later).filter(|(a, b)| a == b).count();
        assert!(same < 15, "{same}");
        // The steps are uniformly distributed. The χ² statistic of 41 steps and 400 drives has mean
        // 40 and standard deviation 9.
        let expected = 400.0 / 41.0;
        let counts = (0..41).map(|step| all.iter().filter(|begin| **begin == step).count());
        let chi: f64 =
            counts.map(|n| (n as f64 - expected) * (n as f64 - expected) / expected).sum();
        assert!((15.0..70.0).contains(&chi), "{chi}");
        let other = WindowChoice::RandomOne { seed: 6 }.windows(&drives, 10);
        assert!(
            other.iter().zip(&all).filter(|(list, begin)| list[0].begin() == **begin).count() < 25
        );
    }

    #[test]
    fn a_window_parts_past_and_future() {
        let drive = trajectory(&[0.0, 0.1, 0.2, 0.3]);
        let window = Window::new(&drive, 1, 2).unwrap();
        assert_eq!((window.history().len(), window.now().human.x), (2, 1.0));
        assert_eq!(window.past_turn_rates(), [0.0]);
        assert_eq!(window.turn_rates(), [0.1, 0.2]);
        assert_eq!(window.future().iter().map(|s| s.human.x).collect::<Vec<_>>(), [2.0, 3.0]);
        assert!(Window::new(&drive, 3, 2).is_none());
        assert!(Window::new(&drive, 0, 0).is_none());
    }

    #[test]
    fn complaints_name_the_field() {
        let drive = trajectory(&[0.0, 0.1]);
        let field = |states: &[JointState], rates: &[f64]| {
            Trajectory::new(states.to_vec(), rates.to_vec()).unwrap_err().field
        };
        assert_eq!(field(drive.states(), &[]), "turn_rates");
        assert_eq!(field(drive.states(), &[0.0]), "states");
        assert_eq!(field(drive.states(), &[0.0, f64::NAN]), "turn_rates[1]");
        let mut states = drive.states().to_vec();
        states[1].human.x = f64::INFINITY;
        assert_eq!(field(&states, &[0.0, 0.0]), "states[1].human.x");
    }
}
