//! The paths that the vehicles took from this moment on.

use super::Moment;
use crate::shape::Shape;
use sidestep::chart::{Pen, colours};

/// A dotted line ahead of the human, and a fainter one ahead of the robot.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let ahead = moment.trial.states.get(moment.step + 1..).unwrap_or_default();
    let human = [moment.state].iter().chain(ahead).map(|state| state.human.position()).collect();
    let robot = vec![moment.state.robot.position(), moment.trial.scene.goal];
    vec![
        Shape::Polyline { points: robot, pen: Pen::new(colours::ROBOT, 1.0).dashed(1.0, 4.0) },
        Shape::Polyline { points: human, pen: Pen::new(colours::TEXT, 2.0).dashed(2.0, 3.0) },
    ]
}
