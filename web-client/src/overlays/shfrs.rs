//! The predicted sets, in the paper's colours.

use super::Moment;
use crate::shape::{Ink, Shape, Stroke};

/// F_F … F_1 from the largest to the smallest, so that what stays visible of each
/// is its region S_j.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let sets = moment.shfrs.map(|shfrs| shfrs.sets.as_slice()).unwrap_or_default();
    let regions = sets.iter().enumerate().rev();
    regions
        .map(|(j, set)| Shape::Polygon {
            points: set.tube.clone(),
            fill: Some((Ink::Region(j), 1.0)),
            stroke: Some(Stroke::solid(Ink::Ground, 0.75)),
        })
        .collect()
}
