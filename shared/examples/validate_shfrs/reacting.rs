//! Simulated people who turn away from a robot that comes near. Their probabilities are known, and
//! any number of people can be generated.

use rayon::prelude::*;
use sidestep::bounds::{ActionChoice, ActionModel, ActionSpace};
use sidestep::invalid::Invalid;
use sidestep::math::{SeededRng, exp};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::family::Family;
use sidestep::shfrs::scores::ShfrsFamily;
use sidestep::shfrs::window::{Trajectory, Window};
use sidestep::shfrs::window_sets::Prediction;
use sidestep::vehicle::{Pose, dubins};

use crate::{RATE_RADPS, STEP_S};

/// Number of steps of a drive and of its prediction.
pub(crate) const STEPS: usize = 10;

/// The turn rates for right, straight and left (rad/s).
const ACTIONS: [f64; 3] = [-RATE_RADPS, 0.0, RATE_RADPS];

/// A human who starts to react to the robot at this distance (m).
pub(crate) struct Reacting {
    pub(crate) near_m: f64,
}

impl ActionModel for Reacting {
    fn actions(&self) -> ActionSpace<'_> {
        ActionSpace::Levels(&ACTIONS)
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        let Some(state) = history.last() else { return };
        let turns = 0.9 / (1.0 + exp(state.distance_m() - self.near_m));
        let left = state.robot_seen_by_human()[1];
        // Turns are mostly away from the robot.
        let right = 1.0 / (1.0 + exp(-2.0 * left));
        out.copy_from_slice(&[turns * right, 1.0 - turns, turns * (1.0 - right)]);
    }
}

/// The prediction model, in which everyone reacts at 5 m.
pub(crate) const PREDICTED: Reacting = Reacting { near_m: 5.0 };

/// The choice of actions.
pub(crate) fn choice() -> ActionChoice {
    ActionChoice::Adaptive { tau: 0.2, steps: STEPS }
}

/// The drive of a random human near a robot that drives straight on.
fn drive(rng: &mut SeededRng) -> Result<Trajectory, Invalid> {
    let robot = Pose::new(rng.uniform(2.0, 9.0), rng.uniform(-5.0, 5.0), rng.uniform(-3.1, 3.1));
    let mut states = vec![JointState { human: Pose::new(0.0, 0.0, 0.0), robot }];
    let person = Reacting { near_m: rng.uniform(3.0, 7.0) };
    let mut wanted = 0.0;
    let speed = SceneParameters::default().human.speed_mps;
    let mut rates = Vec::with_capacity(STEPS);
    for _ in 0..STEPS {
        let mut probabilities = [0.0; 3];
        person.probabilities(&states, &mut probabilities);
        // People do not make a new decision in every step, and do not steer exactly.
        if rng.unit() < 0.4 {
            let drawn = rng.unit();
            let [right, straight, _] = probabilities;
            let action = usize::from(drawn >= right) + usize::from(drawn >= right + straight);
            wanted = ACTIONS[action];
        }
        let rate = (wanted + rng.uniform(-0.15, 0.15)).clamp(-RATE_RADPS, RATE_RADPS);
        rates.push(rate);
        let JointState { human, robot } = states[states.len() - 1];
        states.push(JointState {
            human: dubins::arc(human, speed, rate, STEP_S),
            robot: dubins::arc(robot, speed, 0.0, STEP_S),
        });
    }
    Trajectory::new(states, rates)
}

/// The whole population: drives, and their scores.
pub(crate) struct Population {
    pub(crate) drives: Vec<Trajectory>,
    pub(crate) scores: Vec<f64>,
}

impl Population {
    /// Draws `count` drives.
    pub(crate) fn new(count: usize, parameters: &SceneParameters) -> Result<Self, Invalid> {
        let mut rng = SeededRng::new(65);
        let drives: Vec<Trajectory> =
            (0..count).map(|_| drive(&mut rng)).collect::<Result<_, _>>()?;
        let score = |drive: &Trajectory| {
            let prediction = Prediction::new(parameters, &PREDICTED);
            let window = window(drive)?;
            ShfrsFamily::new(prediction, &choice())?.score(&window)
        };
        let scores = drives.par_iter().map(score).collect::<Result<_, _>>()?;
        Ok(Self { drives, scores })
    }
}

/// The window that consists of the whole drive.
pub(crate) fn window(drive: &Trajectory) -> Result<Window<'_>, Invalid> {
    let found = format!("{} steps", drive.steps());
    Window::new(drive, 0, STEPS).ok_or_else(|| Invalid::new("drive", "ten steps", found))
}
