//! The predicted sets.

use super::style::{Palette, Sets, Style};
use super::{Playback, PredictedSet, hatch};
use crate::chart::{Colour, LegendItem, Pen, colours, fixed, lowered};
use crate::math::PI;
use crate::picture::Picture;

/// Direction of each region's hatching (rad). The innermost region has none.
const HATCHED: [Option<f64>; 5] =
    [None, Some(0.25 * PI), Some(0.75 * PI), Some(0.0), Some(0.5 * PI)];
/// Spacing of hatching lines (m).
const APART_M: f64 = 0.3;

/// The colour of region `j` (from 0) of `count` regions.
#[must_use]
pub(super) fn colour(palette: Palette, j: usize, count: usize) -> Colour {
    match palette {
        Palette::Paper => colours::region(j, count),
        Palette::Safe => colours::safe_region(j, count),
    }
}

/// Paints F_F … F_1 from the largest to the smallest, so that the visible part of each set is its
/// region S_j. Each set is drawn as one tube, or as one area per step.
pub(super) fn paint(playback: &mut Playback, style: &Style, picture: &mut Picture) {
    let mut crossings = core::mem::take(&mut playback.crossings);
    let count = playback.set_count();
    for (set, j) in playback.sets().rev().zip((0..count).rev()) {
        let colour = colour(style.palette, j, count);
        // A line in the background colour separates tubes. The set at one step is thinner than this
        // line, so an outline in its own colour keeps it visible.
        let (areas, outline) = match style.sets {
            Sets::Tube => (set.tube, Pen::new(colours::SURFACE, 0.75)),
            Sets::EachStep => (set.steps, Pen::new(colour, 1.5)),
            Sets::Step(step) => {
                let last = set.steps.len();
                let step = step.min(last);
                (
                    set.steps.get(step.wrapping_sub(1)..step).unwrap_or_default(),
                    Pen::new(colour, 1.5),
                )
            }
        };
        match (style.sets, areas) {
            (Sets::Tube, [_, _, ..]) => union(areas, colour, picture),
            _ => {
                for area in areas {
                    picture.polygon(area.iter().copied(), Some(colour.into()), Some(outline));
                }
            }
        }
        let angle = HATCHED[j % HATCHED.len()];
        if let (Palette::Safe, Sets::Tube, Some(angle)) = (style.palette, style.sets, angle) {
            let pen = Pen::new(colours::SURFACE.at(0.75), 1.0);
            hatch::paint(picture, areas, angle, APART_M, pen, &mut crossings);
        }
    }
    playback.crossings = crossings;
}

/// Width of the line that hides the seams of a union (px).
const SEAM: f64 = 0.75;

/// Paints the union of polygons. All edges are painted first, so that the areas cover the inner
/// edges and only the edges of the union stay visible.
fn union(areas: &[Vec<[f64; 2]>], colour: Colour, picture: &mut Picture) {
    let edge = Pen::new(colours::SURFACE, 3.0 * SEAM);
    let areas = || areas.iter().filter(|area| !area.is_empty());
    for area in areas() {
        picture.polygon(area.iter().copied(), None, Some(edge));
    }
    for area in areas() {
        let pen = Pen::new(colour, SEAM);
        picture.polygon(area.iter().copied(), Some(colour.into()), Some(pen));
    }
}

pub(super) fn legend(playback: &Playback, style: &Style) -> Vec<LegendItem> {
    let (count, step_s) = (playback.set_count(), playback.recorded.parameters.step_s);
    let when = match style.sets {
        Sets::Tube => format!("within {} s", fixed(playback.seconds_ahead(), 1)),
        Sets::EachStep => "after each step".to_owned(),
        Sets::Step(step) => {
            let step = step.min(playback.steps_ahead());
            format!("after {} s", fixed(step as f64 * step_s, 1))
        }
    };
    let most = playback.empirical().and_then(|it| it.sets().last()).map(|set| set.level);
    let item = |(j, set): (usize, PredictedSet<'_>)| {
        let level = set.level.words();
        let text = match (j, set.level.value()) {
            (0, _) => format!("F₁: where the human may be {when}, {level}"),
            (_, value) if Some(value) == most => {
                format!("F{}: {level}, the worst case", lowered(j + 1))
            }
            _ => format!("F{}: {level}", lowered(j + 1)),
        };
        LegendItem::region(&text, j + 1, colour(style.palette, j, count))
    };
    playback.sets().enumerate().map(item).collect()
}
