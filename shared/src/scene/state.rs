//! The poses of both vehicles at one instant.

use super::parameters::SceneParameters;
use crate::invalid::Invalid;
use crate::math::{hypot, wrap_angle};
use crate::vehicle::dubins::{self, relative_state};
use crate::vehicle::{Pose, TurnInput};
use serde::{Deserialize, Serialize};

/// The poses of both vehicles at one instant. On the wire:
/// `{"human": [x, y, psi], "robot": [x, y, psi]}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct JointState {
    /// The human's vehicle.
    pub human: Pose,
    /// The robot.
    pub robot: Pose,
}

impl JointState {
    /// The state after the human has held `input` and the robot has turned at the rate
    /// `robot_radps` (rad/s) for `seconds` (s).
    #[must_use]
    pub fn advance(
        &self,
        parameters: &SceneParameters,
        input: TurnInput,
        robot_radps: f64,
        seconds: f64,
    ) -> Self {
        Self {
            human: parameters.human.advance(self.human, input, seconds),
            robot: dubins::arc(self.robot, parameters.robot.speed_mps, robot_radps, seconds),
        }
    }

    /// The angle (rad) by which the robot turns from this state to the next.
    #[must_use]
    pub fn robot_turned(&self, next: &Self) -> f64 {
        wrap_angle(next.robot.psi - self.robot.psi)
    }

    /// The state `into_s` (s) after the start of a step that leads to `next`. The robot's turn rate
    /// is the mean rate between the two states.
    #[must_use]
    pub fn within_step(
        &self,
        parameters: &SceneParameters,
        input: TurnInput,
        next: &Self,
        into_s: f64,
    ) -> Self {
        let robot_radps = self.robot_turned(next) / parameters.step_s;
        self.advance(parameters, input, robot_radps, into_s)
    }

    /// Distance between the vehicles (m).
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        hypot(self.human.x - self.robot.x, self.human.y - self.robot.y)
    }

    /// The robot's pose in the human's frame, which is the argument of V_HR (the human evades).
    #[must_use]
    pub fn robot_seen_by_human(&self) -> [f64; 3] {
        relative_state(self.human, self.robot)
    }

    /// The human's pose in the robot's frame, which is the argument of V_RH (the robot evades).
    #[must_use]
    pub fn human_seen_by_robot(&self) -> [f64; 3] {
        relative_state(self.robot, self.human)
    }

    /// Checks both poses with [`Pose::check`].
    ///
    /// # Errors
    /// [`Invalid`] naming the coordinate.
    pub fn check(&self) -> Result<(), Invalid> {
        self.human.check().map_err(|e| e.within("human"))?;
        self.robot.check().map_err(|e| e.within("robot"))
    }
}

/// Number of sampling intervals of the distance within a step.
pub(super) const SAMPLES_PER_STEP: usize = 20;

/// Smallest distance within a step (m).
///
/// The distance is sampled at both ends and at 19 instants in between. For vehicles of a few m/s,
/// the result is within 0.1 mm of the continuous minimum if this minimum is near the danger radius.
#[must_use]
pub fn closest_within_step(
    parameters: &SceneParameters,
    state: JointState,
    input: TurnInput,
    robot_radps: f64,
) -> f64 {
    (0..=SAMPLES_PER_STEP)
        .map(|i| i as f64 / SAMPLES_PER_STEP as f64 * parameters.step_s)
        .map(|s| state.advance(parameters, input, robot_radps, s).distance_m())
        .fold(f64::INFINITY, f64::min)
}
