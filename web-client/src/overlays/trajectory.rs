//! Where both vehicles have come from.

use super::Moment;
use crate::shape::{ColourToken, Shape, Stroke};

/// A line behind each vehicle.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let past = &moment.trial.states[..=moment.step.min(moment.trial.states.len() - 1)];
    let line = |colour, points: Vec<[f64; 2]>| Shape::Polyline {
        points,
        stroke: Stroke::solid(colour, 2.0),
    };
    let robot =
        past.iter().map(|state| state.robot.position()).chain([moment.state.robot.position()]);
    let human =
        past.iter().map(|state| state.human.position()).chain([moment.state.human.position()]);
    vec![line(ColourToken::Robot, robot.collect()), line(ColourToken::Human, human.collect())]
}
