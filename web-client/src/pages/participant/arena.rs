//! The live picture in the instructions: a vehicle to steer, and a robot with its danger zone. A
//! vehicle that leaves the picture reappears on the other side.

use crate::input::{HeldKeys, KeyMap};
use sidestep::math::PI;
use sidestep::picture::stage;
use sidestep::picture::{Picture, Window};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::vehicle::{Pose, TurnInput};

/// Half the width and half the height of the picture (m).
const HALF_M: [f64; 2] = [14.0, 5.5];

/// How far beyond the edge a vehicle must be before it reappears on the other side (m).
const OUTSIDE_M: f64 = 1.5;

/// Maximum time step of the motion (s).
const LONGEST_S: f64 = 0.1;

/// Two vehicles that drive on forever. Collisions have no effect.
#[derive(Clone, Debug)]
pub(super) struct Arena {
    parameters: SceneParameters,
    human: Pose,
    robot: Pose,
    last_ms: Option<f64>,
}

impl Arena {
    pub(super) fn new(parameters: SceneParameters) -> Self {
        let human = Pose::new(-8.0, -2.5, 0.0);
        let robot = Pose::new(9.0, 2.5, PI);
        Self { parameters, human, robot, last_ms: None }
    }

    /// Moves both vehicles to their positions at `now_ms`. If `calm` is set (reduced motion), they
    /// move only while a key is down.
    pub(super) fn tick(&mut self, now_ms: f64, keys: &KeyMap, held: &HeldKeys, calm: bool) {
        let last_ms = self.last_ms.replace(now_ms).unwrap_or(now_ms);
        // The displayed time never goes back, so the difference is not negative.
        let seconds = ((now_ms - last_ms) / 1000.0).min(LONGEST_S);
        if calm && held.is_empty() {
            return;
        }
        let SceneParameters { human, robot, .. } = self.parameters;
        self.human = inside(human.advance(self.human, held.turn(keys), seconds));
        self.robot = inside(robot.advance(self.robot, TurnInput::Straight, seconds));
    }

    pub(super) fn draw(&self, picture: &mut Picture) {
        let [width, height] = HALF_M;
        picture.begin("arena", Window { low: [-width, -height], high: [width, height] });
        let radius_m = self.parameters.danger_radius_m;
        picture.push(stage::goal([0.8 - width, self.robot.y]));
        picture.push(stage::danger_zone(self.robot, radius_m));
        picture.extend(stage::vehicles(self.state()));
    }

    pub(super) fn state(&self) -> JointState {
        JointState { human: self.human, robot: self.robot }
    }
}

/// Wraps a pose to the other side if it has left the picture.
fn inside(mut pose: Pose) -> Pose {
    let wrap = |at: f64, half: f64| {
        let half = half + OUTSIDE_M;
        if at > half {
            at - 2.0 * half
        } else if at < -half {
            at + 2.0 * half
        } else {
            at
        }
    };
    pose.x = wrap(pose.x, HALF_M[0]);
    pose.y = wrap(pose.y, HALF_M[1]);
    pose
}
