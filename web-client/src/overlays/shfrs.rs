//! The predicted sets, in the paper's colours.

use super::Moment;
use crate::shape::{ColourToken, Shape, Stroke};

/// F_F … F_1 from the largest to the smallest, so that what stays visible of each
/// is its region S_j. One tube each, or one area a step from the first on.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let sets = moment.shfrs.map(|shfrs| shfrs.sets.as_slice()).unwrap_or_default();
    let regions = sets.iter().enumerate().rev();
    regions
        .flat_map(|(j, set)| {
            let colour = ColourToken::Region(j);
            // A tube is parted from the next by the ground. The set at a step is thinner than
            // such a line would be; its own colour about it keeps it in sight.
            let (polygons, stroke) = if moment.by_step {
                (set.steps.as_slice(), Stroke::solid(colour, 1.5))
            } else {
                (core::slice::from_ref(&set.tube), Stroke::solid(ColourToken::Ground, 0.75))
            };
            polygons.iter().map(move |points| Shape::Polygon {
                points: points.clone(),
                fill: Some((colour, 1.0)),
                stroke: Some(stroke),
            })
        })
        .collect()
}
