//! The danger zone.

use super::{Moment, stage};
use crate::shape::Shape;

/// The disc of radius R_c around the robot.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    vec![stage::danger_zone(moment.state.robot, moment.trial.parameters.danger_radius_m)]
}
