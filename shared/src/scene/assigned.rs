//! A scene as it is assigned to a participant.

use super::parameters::SceneParameters;
use super::robot::RobotPolicy;
use super::state::JointState;
use crate::math::sin_cos;
use crate::vehicle::Pose;
use serde::{Deserialize, Serialize};

/// The start of a trial, the robot's goal, and the rule that moves the robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Scene {
    /// The human's vehicle at the start.
    pub human: Pose,
    /// The robot at the start, heading straight to its goal.
    pub robot: Pose,
    /// The robot's goal (m). A robot that drives straight reaches it at the end of the trial.
    pub goal: [f64; 2],
    /// The rule that moves the robot. `None` drives straight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub policy: Option<Box<RobotPolicy>>,
}

impl Scene {
    /// A scene whose robot drives straight, and whose goal is the robot's position at the end of
    /// the trial.
    #[must_use]
    pub fn new(parameters: &SceneParameters, human: Pose, robot: Pose) -> Self {
        let (sin, cos) = sin_cos(robot.psi);
        let ahead = parameters.goal_distance_m();
        let goal = [robot.x + ahead * cos, robot.y + ahead * sin];
        Self { human, robot, goal, policy: None }
    }

    /// The state before the first step.
    #[must_use]
    pub fn start(&self) -> JointState {
        JointState { human: self.human, robot: self.robot }
    }

    /// The same scene with another start.
    #[must_use]
    pub fn starting_at(&self, JointState { human, robot }: JointState) -> Self {
        Self { human, robot, ..self.clone() }
    }

    /// The robot's name in the study's configuration. `straight` if the study names no robots.
    #[must_use]
    pub fn robot_name(&self) -> &str {
        self.policy.as_ref().map_or("straight", |policy| &policy.name)
    }

    /// The robot's turn rate (rad/s) in the step that begins in the last of `states`, the states
    /// from the start on.
    #[must_use]
    pub fn robot_turn_rate(&self, parameters: &SceneParameters, states: &[JointState]) -> f64 {
        self.policy
            .as_ref()
            .map_or(0.0, |policy| policy.turn_rate(parameters, self.robot, self.goal, states))
    }
}
