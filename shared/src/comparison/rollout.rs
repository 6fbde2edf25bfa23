//! Roll-outs: predictions several steps ahead, where each step builds on the earlier predictions.
//!
//! Next-step accuracy overrates a predictor that knows the last input. Keys are held for many
//! steps, so repeating the last input is nearly always correct, but it does not predict when the
//! human starts or stops avoiding. In a roll-out, a predictor sees the true trajectory up to some
//! step. After this step, it sees only its own predictions: the human takes the most likely action,
//! and the robot drives straight on.

use super::metrics::highest;
use crate::bounds::{ActionModel, Motion};
use crate::invalid::Invalid;
use crate::math::{hypot, ln};
use crate::scene::JointState;
use crate::shfrs::window::{Trajectory, Window};
use crate::vehicle::dubins;
use serde::Serialize;

/// The accuracy of predictions a fixed number of steps ahead, over the windows of all target steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Horizon {
    /// Number of windows.
    pub windows: usize,
    /// Number of windows in which the most likely action was the human's action.
    pub right: usize,
    /// Sum over windows of −ln P (nats), where P is the probability of the human's action, raised
    /// to at least 10⁻¹⁵. P is the probability at the end of the driver's likeliest path. It is not
    /// the marginal probability `h` steps ahead, which would be a mean over all paths.
    pub log_loss: f64,
    /// Sum over windows of the distance (m) between the predicted and the true position after the
    /// step.
    pub distance_m: f64,
}

impl Horizon {
    /// Share of correct windows.
    #[must_use]
    pub fn accuracy(&self) -> f64 {
        self.right as f64 / self.windows.max(1) as f64
    }

    /// Mean log loss (nats).
    #[must_use]
    pub fn mean_log_loss(&self) -> f64 {
        self.log_loss / self.windows.max(1) as f64
    }

    /// Mean error of the predicted position (m).
    #[must_use]
    pub fn mean_distance_m(&self) -> f64 {
        self.distance_m / self.windows.max(1) as f64
    }

    /// The skill relative to `other`, which must be evaluated on the same windows.
    #[must_use]
    pub fn over(&self, other: &Self) -> Skill {
        Skill {
            accuracy_points: 100.0 * (self.accuracy() - other.accuracy()),
            distance_share: (other.distance_m > 0.0).then(|| self.distance_m / other.distance_m),
        }
    }

    fn add(&mut self, other: &Self) {
        self.windows += other.windows;
        self.right += other.right;
        self.log_loss += other.log_loss;
        self.distance_m += other.distance_m;
    }
}

/// How much better one driver is than another on the same target steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Skill {
    /// Gain in accuracy (percentage points). It is 0 if both drivers are equally accurate.
    pub accuracy_points: f64,
    /// The mean distance divided by the other driver's mean distance. It is 1 if both are equal.
    /// `None` if the other driver makes no error.
    pub distance_share: Option<f64>,
}

/// A predictor of the human's next input.
pub trait Driver {
    /// Returns the most likely next turn rate and the probability of the turn rate `truth`.
    /// `history` has the joint states so far, and `held` the turn rates so far. Turn rates are in
    /// rad/s.
    fn next(&self, history: &[JointState], held: &[f64], truth: f64) -> (f64, f64);
}

/// Turn rates that differ by at most this are the same action (rad/s).
const SAME_ACTION: f64 = 1e-9;

impl<M: ActionModel> Driver for M {
    fn next(&self, history: &[JointState], _held: &[f64], truth: f64) -> (f64, f64) {
        let actions = self.actions();
        let mut p = vec![0.0; actions.len()];
        self.probabilities(history, &mut p);
        let likeliest = highest(&p);
        let of_truth = actions.find(truth, SAME_ACTION).map_or(0.0, |a| p[a]);
        (likeliest.map_or(0.0, |a| actions.middle(a)), of_truth)
    }
}

/// A driver without a model, as a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simple {
    /// Holds the input of the previous step. Without a previous step, drives straight on.
    Held,
    /// Drives straight on.
    Straight,
}

/// The probability that a simple driver assigns to each action other than the expected one.
pub const DOUBT: f64 = 0.05;

impl Simple {
    /// The driver's name in tables.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Held => "held_input",
            Self::Straight => "straight",
        }
    }
}

impl Driver for Simple {
    fn next(&self, _history: &[JointState], held: &[f64], truth: f64) -> (f64, f64) {
        let expected = match self {
            Self::Held => held.last().copied().unwrap_or(0.0),
            Self::Straight => 0.0,
        };
        let right = (expected - truth).abs() <= SAME_ACTION;
        (expected, if right { 1.0 - 2.0 * DOUBT } else { DOUBT })
    }
}

/// Roll-outs of `steps` steps. The first entry is for the next step, and the last entry is for the
/// step `steps` ahead.
///
/// All entries cover the same *target steps*, which are the steps after the first `steps` − 1
/// steps. For horizon h, the roll-out starts h − 1 steps before the target step. People turn more
/// often early in a trial than late. If each horizon had its own target steps, this change over
/// time would look like an effect of the horizon.
///
/// # Errors
/// [`Invalid`] if there is no step to predict.
pub fn rollouts(
    driver: &impl Driver,
    trajectories: &[Trajectory],
    motion: &Motion,
    steps: usize,
) -> Result<Vec<Horizon>, Invalid> {
    if steps == 0 {
        return Err(Invalid::new("steps", "at least 1", steps));
    }
    let mut all = vec![Horizon::default(); steps];
    let (mut history, mut held) = (Vec::new(), Vec::new());
    for trajectory in trajectories {
        for begin in 0..trajectory.steps() {
            let left = trajectory.steps() - begin;
            let Some(window) = Window::new(trajectory, begin, steps.min(left)) else { break };
            history.clear();
            history.extend_from_slice(window.history());
            held.clear();
            held.extend_from_slice(window.past_turn_rates());
            let targets = (begin..).zip(window.future()).zip(window.turn_rates());
            for (horizon, ((target, truth), &rate)) in all.iter_mut().zip(targets) {
                let (predicted, probability) = driver.next(&history, &held, rate);
                let now = history[history.len() - 1];
                let human =
                    dubins::arc(now.human, motion.human_speed_mps, predicted, motion.step_s);
                let robot = dubins::arc(now.robot, motion.robot_speed_mps, 0.0, motion.step_s);
                history.push(JointState { human, robot });
                held.push(predicted);
                if target + 1 < steps {
                    continue;
                }
                horizon.add(&Horizon {
                    windows: 1,
                    right: usize::from((predicted - rate).abs() <= SAME_ACTION),
                    log_loss: -ln(probability.max(1e-15)),
                    distance_m: hypot(human.x - truth.human.x, human.y - truth.human.y),
                });
            }
        }
    }
    Ok(all)
}

/// The sum of the roll-outs of several people.
#[must_use]
pub fn together(parts: &[Vec<Horizon>]) -> Vec<Horizon> {
    let mut all = vec![Horizon::default(); parts.iter().map(Vec::len).max().unwrap_or(0)];
    for part in parts {
        all.iter_mut().zip(part).for_each(|(sum, horizon)| sum.add(horizon));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::ActionSpace;
    use crate::scene::{Scene, SceneParameters};
    use crate::trial::simulate;
    use crate::vehicle::{Pose, TurnInput};

    fn trajectory(inputs: &[TurnInput]) -> Trajectory {
        let parameters = SceneParameters { steps: inputs.len(), ..SceneParameters::default() };
        let [human, robot] = [Pose::new(0.0, 0.0, 0.0), Pose::new(9.0, 1.0, 3.0)];
        let states = simulate(&parameters, &Scene::new(&parameters, human, robot), inputs);
        let rates = inputs.iter().map(|&input| parameters.human.turn_rate(input)).collect();
        Trajectory::new(states, rates).unwrap()
    }

    fn of(driver: &impl Driver, inputs: &[TurnInput], steps: usize) -> Vec<Horizon> {
        let motion = Motion::from(&SceneParameters::default());
        rollouts(driver, &[trajectory(inputs)], &motion, steps).unwrap()
    }

    #[test]
    fn who_is_right_is_where_the_human_is() {
        use TurnInput::{Left, Straight};
        let straight = of(&Simple::Straight, &[Straight; 12], 10);
        assert_eq!((straight.len(), straight[9].windows), (10, 3));
        assert!(straight.iter().all(|h| h.accuracy() == 1.0 && h.mean_distance_m() < 1e-12));
        // The targets are the last three steps. Only the roll-out that starts at the very first
        // step has no held input.
        let held = of(&Simple::Held, &[Left; 12], 10);
        assert!(held[..9].iter().all(|h| (h.windows, h.right) == (3, 3)));
        assert_eq!((held[9].windows, held[9].right), (3, 2));
        assert!(held[9].mean_distance_m() > 0.1 && held[8].mean_distance_m() < 1e-12);
        let loss = -(ln(DOUBT) + 2.0 * ln(1.0 - 2.0 * DOUBT)) / 3.0;
        assert!((held[9].mean_log_loss() - loss).abs() < 1e-12);
    }

    /// The human turns in the first steps and then drives straight on, as people do. At a given
    /// target step, a driver that never turns is equally accurate for every horizon, so all
    /// horizons must agree.
    #[test]
    fn a_driver_who_looks_at_nothing_fares_the_same_at_every_horizon() {
        use TurnInput::{Left, Straight};
        let inputs: Vec<TurnInput> =
            (0..50).map(|i| if i < 20 { Left } else { Straight }).collect();
        let found = of(&Simple::Straight, &inputs, 10);
        // Targets are the steps 9 to 49. The human drives straight in 30 of them.
        assert!(found.iter().all(|h| (h.windows, h.right) == (41, 30)));
        let log_loss = -(30.0 * ln(1.0 - 2.0 * DOUBT) + 11.0 * ln(DOUBT)) / 41.0;
        assert!(found.iter().all(|h| (h.mean_log_loss() - log_loss).abs() < 1e-12));
    }

    /// The inputs alternate in runs of four steps. The input from h steps earlier is right if it
    /// belongs to the same run. This is true for 4 − h of the four targets of a run. For h = 4, the
    /// earlier input always belongs to the previous run, so no target is right.
    #[test]
    fn what_is_ever_harder_to_foresee_is_less_often_right() {
        use TurnInput::{Left, Straight};
        let inputs: Vec<TurnInput> =
            (0..40).map(|i| if i / 4 % 2 == 0 { Left } else { Straight }).collect();
        let found = of(&Simple::Held, &inputs, 4);
        // The 37 targets are steps 3 to 39: the last step of the first run, then nine whole runs.
        let right = |ahead: usize| {
            (3..40)
                .filter(|target| ahead <= *target && inputs[target - ahead] == inputs[*target])
                .count()
        };
        let expected = [1 + 9 * 3, 1 + 9 * 2, 1 + 9, 0];
        for (ahead, h) in (1..).zip(&found) {
            assert_eq!((h.windows, h.right), (37, expected[ahead - 1]), "{ahead}");
            assert_eq!(h.right, right(ahead), "{ahead}");
        }
        let straight = of(&Simple::Straight, &inputs, 4);
        let skills: Vec<f64> =
            found.iter().zip(&straight).map(|(h, s)| h.over(s).accuracy_points).collect();
        assert!(skills.is_sorted_by(|a, b| a > b), "{skills:?}");
        assert_eq!(straight[2].over(&straight[2]).distance_share, Some(1.0));
        assert_eq!(
            of(&Simple::Straight, &[Straight; 4], 2)[0].over(&found[0]).distance_share,
            Some(0.0)
        );
    }

    /// A model of a human who turns left from the fourth step on.
    struct Impatient;

    impl ActionModel for Impatient {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(&[-0.5, 0.0, 0.5])
        }

        fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
            let turns = history.len() > 3;
            out.copy_from_slice(if turns { &[0.1, 0.2, 0.7] } else { &[0.1, 0.8, 0.1] });
        }
    }

    /// In a roll-out from the first step, the model sees only its own predictions, and must predict
    /// the turn from them.
    #[test]
    fn predictors_are_fed_with_what_they_said() {
        use TurnInput::{Left, Straight};
        let found = of(&Impatient, &[Straight, Straight, Straight, Left, Left], 5);
        assert!(found.iter().all(|h| (h.windows, h.right) == (1, 1) && h.distance_m < 1e-12));
        assert!((found[4].log_loss + ln(0.7)).abs() < 1e-12);
        assert_eq!(together(&[found.clone(), found.clone()])[4].windows, 2);
    }
}
