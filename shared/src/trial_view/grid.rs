//! Grid lines, and a scale bar as long as their spacing.

use crate::chart::{Pen, colours};
use crate::picture::{Picture, Shape, Window};
use std::rc::Rc;

/// Distance between two lines (m).
const EVERY_M: f64 = 5.0;
/// The spacing as text.
pub(super) const WORDS: &str = "5 m";

/// Paints the grid. It also covers the area around the window, because a frame with another aspect
/// ratio shows more than the window.
pub(super) fn paint(picture: &mut Picture, window: Window, words: &Rc<str>) {
    let Window { low, high } = window;
    let reach = (high[0] - low[0]).max(high[1] - low[1]);
    let (from, to) = (low.map(|edge| edge - reach), high.map(|edge| edge + reach));
    let lines = [0, 1].into_iter().flat_map(|axis| {
        let (first, last) = ((from[axis] / EVERY_M).ceil(), (to[axis] / EVERY_M).floor());
        (first as i64..=last as i64).map(move |line| {
            let at = line as f64 * EVERY_M;
            if axis == 0 { [[at, from[1]], [at, to[1]]] } else { [[from[0], at], [to[0], at]] }
        })
    });
    picture.segments(lines, Pen::new(colours::GRID, 1.0));
    // The label is below the bar.
    let left = [low[0] + 0.5, low[1] + 3.0];
    let right = [left[0] + EVERY_M, left[1]];
    picture.polyline([left, right], Pen::new(colours::MUTED, 1.5));
    let at = [left[0] + 0.5 * EVERY_M, left[1]];
    picture.push(Shape::Label { at, text: Rc::clone(words), colour: colours::MUTED });
}
