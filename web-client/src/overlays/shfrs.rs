//! The predicted sets, in the paper's colours.

use super::Moment;
use crate::shape::{Ink, Shape, Stroke};

/// F_F … F_1 from the largest to the smallest, so that what stays visible of each
/// is its region S_j. One tube each, or one area a step from the first on.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let sets = moment.shfrs.map(|shfrs| shfrs.sets.as_slice()).unwrap_or_default();
    let regions = sets.iter().enumerate().rev();
    regions
        .flat_map(|(j, set)| {
            let polygons = if moment.by_step {
                set.steps.as_slice()
            } else {
                core::slice::from_ref(&set.tube)
            };
            polygons.iter().map(move |points| Shape::Polygon {
                points: points.clone(),
                fill: Some((Ink::Region(j), 1.0)),
                stroke: Some(Stroke::solid(Ink::Ground, 0.75)),
            })
        })
        .collect()
}
