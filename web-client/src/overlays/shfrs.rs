//! The predicted sets, in the paper's colours.

use super::Moment;
use crate::shape::Shape;
use sidestep::chart::{Pen, colours};

/// F_F … F_1 from the largest to the smallest, so that the visible part of each is its region
/// S_j. Each is one tube, or one area for each step.
#[must_use]
pub fn shapes(moment: &Moment<'_>) -> Vec<Shape> {
    let sets = moment.shfrs.map(|shfrs| shfrs.sets.as_slice()).unwrap_or_default();
    let areas = sets.iter().enumerate().rev().flat_map(|(j, set)| {
        let colour = colours::region(j, sets.len());
        // A line in the colour of the surface separates tubes. The set at a step is thinner than
        // that line; an outline in its own colour keeps it visible.
        let (areas, outline) = if moment.by_step {
            (set.steps.as_slice(), Pen::new(colour, 1.5))
        } else {
            (core::slice::from_ref(&set.tube), Pen::new(colours::SURFACE, 0.75))
        };
        areas.iter().map(move |points| Shape::Polygon {
            points: points.clone(),
            fill: colour.into(),
            outline,
        })
    });
    areas.collect()
}
