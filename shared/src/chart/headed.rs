//! A standalone figure: a title and notes, with space for content below.

use super::colours::{MUTED, TEXT};
use super::drawing::{Align, Drawing};
use super::text::width_of;

/// Margin around every figure (px).
pub const MARGIN: f64 = 28.0;

/// A drawing with a title (`heading`) and, below the title, notes. Its height just fits the title
/// and the notes. Between the margins it is `width` px wide, or wider if a note is longer.
#[must_use]
pub fn headed(heading: &str, notes: &[&str], width: f64) -> Drawing {
    const NOTE: f64 = 12.0;
    let widths = notes.iter().map(|note| width_of(note, NOTE, false));
    let width = widths.fold(width, f64::max) + 2.0 * MARGIN;
    let mut drawing = Drawing::new(heading, "", [width, 58.0 + 18.0 * notes.len() as f64]);
    drawing.bold(heading, [MARGIN, 34.0], 20.0, TEXT, Align::Left);
    for (i, note) in notes.iter().enumerate() {
        let at = [MARGIN, 60.0 + 18.0 * i as f64];
        drawing.text(note, at, NOTE, MUTED, Align::Left);
    }
    drawing
}
