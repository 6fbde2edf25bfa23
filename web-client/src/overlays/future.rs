//! Where the vehicles really went.

use super::Moment;
use crate::shape::{ColourToken, Shape, Stroke};

/// A dotted line ahead of the human, a fainter one ahead of the robot.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let ahead = moment.trial.states.get(moment.step + 1..).unwrap_or_default();
    let human = [moment.state].iter().chain(ahead).map(|state| state.human.position()).collect();
    let robot = vec![moment.state.robot.position(), moment.trial.scene.goal];
    vec![
        Shape::Polyline {
            points: robot,
            stroke: Stroke::dashed(ColourToken::Robot, 1.0, (1.0, 4.0)),
        },
        Shape::Polyline {
            points: human,
            stroke: Stroke::dashed(ColourToken::Future, 2.0, (2.0, 3.0)),
        },
    ]
}
