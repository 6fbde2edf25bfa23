//! Shapes of the scene: both vehicles, the goal and the danger zone.

use super::{Shape, Tail};
use crate::chart::{Pen, colours};
use crate::scene::{JointState, Scene};
use crate::vehicle::Pose;

/// Side of the goal's square (m).
const GOAL_SIDE_M: f64 = 0.85;

/// The goal (red square), the robot (red arrow) and the human (blue arrow).
#[must_use]
pub fn vehicles_and_goal(scene: &Scene, state: JointState) -> [Shape; 3] {
    let [robot, human] = vehicles(state);
    [goal(scene.goal), robot, human]
}

/// The goal, a red square.
#[must_use]
pub fn goal(centre: [f64; 2]) -> Shape {
    Shape::Square { centre, side_m: GOAL_SIDE_M, colour: colours::ROBOT }
}

/// The robot (red arrow) and the human (blue arrow).
#[must_use]
pub fn vehicles(state: JointState) -> [Shape; 2] {
    let vehicle = |pose, tail, colour| Shape::Vehicle { tail, pose, colour };
    [
        vehicle(state.robot, Tail::Square, colours::ROBOT),
        vehicle(state.human, Tail::Dot, colours::HUMAN),
    ]
}

/// The disc around the robot that the human must not enter.
#[must_use]
pub fn danger_zone(robot: Pose, radius_m: f64) -> Shape {
    Shape::Disc {
        centre: robot.position(),
        radius_m,
        fill: colours::ROBOT.at(0.07),
        outline: Pen::new(colours::ROBOT, 1.0),
    }
}
