//! The paths that the vehicles took up to this moment.

use super::Moment;
use crate::shape::Shape;
use sidestep::chart::{Colour, Pen, colours};
use sidestep::scene::JointState;

/// A line behind each vehicle.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let past = moment.trial.states.iter().take(moment.step + 1).chain([&moment.state]);
    let line = |colour: Colour, position: fn(&JointState) -> [f64; 2]| Shape::Polyline {
        points: past.clone().map(position).collect(),
        pen: Pen::new(colour, 2.0),
    };
    vec![
        line(colours::ROBOT, |state| state.robot.position()),
        line(colours::HUMAN, |state| state.human.position()),
    ]
}
