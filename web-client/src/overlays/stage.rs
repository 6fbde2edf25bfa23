//! The scene itself: both vehicles and the goal.

use crate::shape::Shape;
use sidestep::chart::{Pen, colours};
use sidestep::scene::{JointState, Scene};
use sidestep::vehicle::Pose;

/// Side of the goal's square, m.
const GOAL_SIDE_M: f64 = 0.85;

/// The red square, the red arrow and the blue arrow.
#[must_use]
pub fn vehicles_and_goal(scene: &Scene, state: JointState) -> [Shape; 3] {
    [
        Shape::Square { centre: scene.goal, side_m: GOAL_SIDE_M, colour: colours::ROBOT },
        Shape::Vehicle { pose: state.robot, colour: colours::ROBOT },
        Shape::Vehicle { pose: state.human, colour: colours::HUMAN },
    ]
}

/// The disc around the robot that the human must keep out of.
#[must_use]
pub fn danger_zone(robot: Pose, radius_m: f64) -> Shape {
    Shape::Disc {
        centre: robot.position(),
        radius_m,
        fill: colours::ROBOT.at(0.07),
        outline: Pen::new(colours::ROBOT, 1.0),
    }
}
