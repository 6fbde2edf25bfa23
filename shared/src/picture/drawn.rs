//! Converts a picture to a drawing, for files.

use super::{Brush, Picture, Points};
use crate::chart::{Align, Colour, Drawing, Ink, Pen};

/// Font size (px).
const LETTERS: f64 = 12.0;

impl Picture {
    /// The picture in a frame of this size (px), with a title and a description. Shapes may extend
    /// beyond the frame; the file clips them.
    #[must_use]
    pub fn drawing(&self, title: &str, description: &str, size_px: [f64; 2]) -> Drawing {
        let mut drawing = Drawing::new(title, description, size_px);
        self.paint(size_px, &mut drawing);
        drawing
    }
}

impl Brush for Drawing {
    fn path(&mut self, points: Points<'_>, closed: bool, fill: Option<Ink>, pen: Option<Pen>) {
        let points: Vec<_> = points.collect();
        let parts = points.split(|point| point[0].is_nan()).filter(|part| part.len() > 1);
        for part in parts {
            match pen {
                Some(pen) if !closed => self.line(part, pen),
                _ => self.polygon(part, fill, pen),
            }
        }
    }

    fn circle(&mut self, centre: [f64; 2], radius: f64, fill: Option<Ink>, outline: Option<Pen>) {
        Self::circle(self, centre, radius, fill, outline);
    }

    fn words(&mut self, text: &str, [x, y]: [f64; 2], colour: Colour) {
        // A drawing anchors text at half the cap height.
        self.text(text, [x, y - 0.365 * LETTERS], LETTERS, colour, Align::Centre);
    }
}
