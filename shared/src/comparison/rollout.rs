//! Roll-outs: predictors judged several steps ahead, where each prediction builds on those before.
//!
//! Next-step accuracy flatters a predictor that knows the last input: keys are held for many
//! steps, so "the same again" is right nearly always and does not say when the human begins or
//! ends to avoid. Here a predictor sees the trajectory up to some step and then only its own
//! prediction of it: the human drives on with the most likely action, the robot straight on.

use super::metrics::highest;
use crate::bounds::{ActionModel, Motion};
use crate::invalid::Invalid;
use crate::math::{hypot, ln};
use crate::scene::JointState;
use crate::shfrs::window::{Trajectory, Window};
use crate::vehicle::dubins;
use serde::Serialize;

/// How predictions for one number of steps ahead fared, over all windows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Horizon {
    /// Windows.
    pub windows: usize,
    /// In how many of them the most likely action was what the human did.
    pub right: usize,
    /// Sum of −ln of the probability of what the human did, nats; below 10⁻¹⁵ counts as that.
    pub log_loss: f64,
    /// Sum of the distances of the predicted position from the human's after the step, m.
    pub distance_m: f64,
}

impl Horizon {
    /// Share of windows that were right.
    #[must_use]
    pub fn accuracy(&self) -> f64 {
        self.right as f64 / self.windows.max(1) as f64
    }

    /// Mean of the log loss, nats.
    #[must_use]
    pub fn mean_log_loss(&self) -> f64 {
        self.log_loss / self.windows.max(1) as f64
    }

    /// Mean distance of the predicted position, m.
    #[must_use]
    pub fn mean_distance_m(&self) -> f64 {
        self.distance_m / self.windows.max(1) as f64
    }

    fn add(&mut self, other: &Self) {
        self.windows += other.windows;
        self.right += other.right;
        self.log_loss += other.log_loss;
        self.distance_m += other.distance_m;
    }
}

/// What predicts the human's next input.
pub trait Driver {
    /// Given the joint states up to now and the turn rates held so far, rad/s: the turn rate
    /// that the human is most likely to hold next, and how likely `truth` is.
    fn next(&self, history: &[JointState], held: &[f64], truth: f64) -> (f64, f64);
}

/// Turn rates closer than this are the same action, rad/s.
const SAME_ACTION: f64 = 1e-9;

impl<M: ActionModel> Driver for M {
    fn next(&self, history: &[JointState], _held: &[f64], truth: f64) -> (f64, f64) {
        let actions = self.actions();
        let mut p = vec![0.0; actions.len()];
        self.probabilities(history, &mut p);
        let likeliest = highest(&p);
        let same = |rate: &f64| (rate - truth).abs() <= SAME_ACTION;
        let of_truth = actions.iter().position(same).map_or(0.0, |a| p[a]);
        (likeliest.map_or(0.0, |a| actions[a]), of_truth)
    }
}

/// A driver without a model, for comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simple {
    /// Holds the input of the step before; straight at the start.
    Held,
    /// Drives straight on.
    Straight,
}

/// The probability that a simple driver gives to each action that it does not expect.
const DOUBT: f64 = 0.05;

impl Simple {
    /// Its name in tables.
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

/// Roll-outs of `steps` steps from every step of every trajectory that leaves room: the first
/// entry is about the next step, the last about the one `steps` ahead.
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
            let Some(window) = Window::new(trajectory, begin, steps) else { break };
            history.clear();
            history.extend_from_slice(window.history());
            held.clear();
            held.extend_from_slice(window.past_turn_rates());
            for ((horizon, truth), &rate) in
                all.iter_mut().zip(window.future()).zip(window.turn_rates())
            {
                let (predicted, probability) = driver.next(&history, &held, rate);
                let now = history[history.len() - 1];
                let human =
                    dubins::arc(now.human, motion.human_speed_mps, predicted, motion.step_s);
                let robot = dubins::arc(now.robot, motion.robot_speed_mps, 0.0, motion.step_s);
                history.push(JointState { human, robot });
                held.push(predicted);
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
    use crate::scene::SceneParameters;
    use crate::trial::simulate;
    use crate::vehicle::{Pose, TurnInput};

    fn trajectory(inputs: &[TurnInput]) -> Trajectory {
        let parameters = SceneParameters { steps: inputs.len(), ..SceneParameters::default() };
        let start = JointState { human: Pose::new(0.0, 0.0, 0.0), robot: Pose::new(9.0, 1.0, 3.0) };
        let states = simulate(&parameters, start, inputs);
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
        // Held from the second step on; the first one came as a surprise.
        let held = of(&Simple::Held, &[Left; 12], 10);
        assert!(held.iter().all(|h| (h.windows, h.right) == (3, 2)));
        assert!(held[9].mean_distance_m() > 0.1);
        let loss = -(ln(DOUBT) + 2.0 * ln(1.0 - 2.0 * DOUBT)) / 3.0;
        assert!((held[4].mean_log_loss() - loss).abs() < 1e-12);
    }

    /// Turns left once it has driven straight for three steps, by its own account.
    struct Impatient;

    impl ActionModel for Impatient {
        fn actions(&self) -> &[f64] {
            &[-0.5, 0.0, 0.5]
        }

        fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
            let turns = history.len() > 3;
            out.copy_from_slice(if turns { &[0.1, 0.2, 0.7] } else { &[0.1, 0.8, 0.1] });
        }
    }

    /// From the first step of three it must come to the turn on its own.
    #[test]
    fn predictors_are_fed_with_what_they_said() {
        use TurnInput::{Left, Straight};
        let found = of(&Impatient, &[Straight, Straight, Straight, Left, Left], 5);
        assert!(found.iter().all(|h| (h.windows, h.right) == (1, 1) && h.distance_m < 1e-12));
        assert!((found[4].log_loss + ln(0.7)).abs() < 1e-12);
        assert_eq!(together(&[found.clone(), found.clone()])[4].windows, 2);
    }
}
