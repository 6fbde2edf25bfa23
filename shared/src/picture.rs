//! Pictures of the world: shapes in metres, and the camera that maps metres to pixels. A browser
//! paints them on a canvas; [`Picture::drawing`] converts them to a drawing for files. Colours and
//! pens are the same as in charts.

pub mod stage;
mod painting;
mod drawn;

pub use painting::{Brush, Points};

use crate::chart::{Colour, Ink, Pen};
use crate::vehicle::Pose;
use core::fmt::{Display, Write as _};
use core::ops::Range;
use std::rc::Rc;

/// A shape to draw. Positions are world coordinates (m); widths and dashes of pens are in CSS
/// pixels. The picture stores the points of paths in a reused buffer; see [`Picture::points`].
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through points. A NaN point lifts the pen.
    Path {
        /// The range of its points.
        points: Range<usize>,
        /// Whether the last point is joined to the first one.
        closed: bool,
        /// Fill colour, if any.
        fill: Option<Ink>,
        /// Style of the line, if any.
        pen: Option<Pen>,
    },
    /// A disc.
    Disc {
        /// Its centre.
        centre: [f64; 2],
        /// Its radius (m).
        radius_m: f64,
        /// Fill colour.
        fill: Ink,
        /// Style of the edge.
        outline: Pen,
    },
    /// A vehicle: an arrow whose tail marks the exact position.
    Vehicle {
        /// Mark at its exact position. Vehicles differ in this mark and not only in colour.
        tail: Tail,
        /// Its position and heading.
        pose: Pose,
        /// Its colour.
        colour: Colour,
    },
    /// Text below a position.
    Label {
        /// The position.
        at: [f64; 2],
        /// The text.
        text: Rc<str>,
        /// Colour.
        colour: Colour,
    },
    /// A filled square.
    Square {
        /// Its centre.
        centre: [f64; 2],
        /// Its side (m).
        side_m: f64,
        /// Its colour.
        colour: Colour,
    },
}

/// The mark at a vehicle's exact position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tail {
    /// A dot, for the human.
    Dot,
    /// A square, for the robot.
    Square,
}

/// Length of a vehicle's arrow (m).
pub const VEHICLE_LENGTH_M: f64 = 1.9;

/// A rectangle of the world that must be visible.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// Lower left corner (m).
    pub low: [f64; 2],
    /// Upper right corner (m).
    pub high: [f64; 2],
}

impl Window {
    /// The square around the origin that extends `half_m` in each direction.
    #[must_use]
    pub fn square(half_m: f64) -> Self {
        Self { low: [-half_m; 2], high: [half_m; 2] }
    }

    /// The smallest window that also shows `point` with `margin_m` around it.
    #[must_use]
    pub fn including(self, [x, y]: [f64; 2], margin_m: f64) -> Self {
        Self {
            low: [self.low[0].min(x - margin_m), self.low[1].min(y - margin_m)],
            high: [self.high[0].max(x + margin_m), self.high[1].max(y + margin_m)],
        }
    }
}

/// Maps metres to CSS pixels, with y upwards and the same scale along both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pixels per metre.
    pub scale: f64,
    origin_px: [f64; 2],
    /// Width and height of the canvas (CSS pixels).
    pub size_px: [f64; 2],
}

impl Camera {
    /// The camera that shows all of `window`, centred, at the largest scale.
    #[must_use]
    pub fn showing(window: Window, size_px: [f64; 2]) -> Self {
        let extent = [window.high[0] - window.low[0], window.high[1] - window.low[1]];
        let scale = (size_px[0] / extent[0]).min(size_px[1] / extent[1]).max(1e-3);
        let centre =
            [0.5 * (window.low[0] + window.high[0]), 0.5 * (window.low[1] + window.high[1])];
        let origin_px =
            [0.5 * size_px[0] - scale * centre[0], 0.5 * size_px[1] + scale * centre[1]];
        Self { scale, origin_px, size_px }
    }

    /// Converts a point of the world (m) to a position on the canvas (px).
    #[must_use]
    pub fn to_px(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.origin_px[0] + self.scale * x, self.origin_px[1] - self.scale * y]
    }

    /// Converts a position on the canvas (px) to a point of the world (m).
    #[must_use]
    pub fn to_world(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.origin_px[0]) / self.scale, (self.origin_px[1] - y) / self.scale]
    }
}

/// A canvas and its shapes. All frames use the same picture, which reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// The canvas element's id.
    pub canvas: &'static str,
    /// The part of the world that must be visible.
    pub window: Window,
    /// The shapes, in order of painting.
    shapes: Vec<Shape>,
    /// The points of all shapes, concatenated.
    points: Vec<[f64; 2]>,
    /// Attributes of the canvas element that describe the picture to programs.
    pub attributes: Vec<(&'static str, String)>,
}

/// Compares points bit by bit, so that NaN points, which lift the pen, compare equal.
impl PartialEq for Picture {
    fn eq(&self, other: &Self) -> bool {
        let same_points = self.points.len() == other.points.len()
            && self
                .points
                .iter()
                .zip(&other.points)
                .all(|(a, b)| a.map(f64::to_bits) == b.map(f64::to_bits));
        self.canvas == other.canvas
            && self.window == other.window
            && self.shapes == other.shapes
            && same_points
            && self.attributes == other.attributes
    }
}

impl Picture {
    /// Clears the picture for a canvas that shows at least `window`. Attributes remain if the
    /// canvas is the same.
    pub fn begin(&mut self, canvas: &'static str, window: Window) {
        if self.canvas != canvas {
            self.attributes.clear();
        }
        self.canvas = canvas;
        self.window = window;
        self.shapes.clear();
        self.points.clear();
    }

    /// The shapes, in order of painting.
    #[must_use]
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The points of a path (m).
    #[must_use]
    pub fn points(&self, of: &Range<usize>) -> &[[f64; 2]] {
        self.points.get(of.clone()).unwrap_or_default()
    }

    /// Adds a shape on top.
    pub fn push(&mut self, shape: Shape) {
        self.shapes.push(shape);
    }

    /// Adds several shapes on top.
    pub fn extend(&mut self, shapes: impl IntoIterator<Item = Shape>) {
        self.shapes.extend(shapes);
    }

    /// Adds a closed polygon.
    pub fn polygon(
        &mut self,
        corners: impl IntoIterator<Item = [f64; 2]>,
        fill: Option<Ink>,
        pen: Option<Pen>,
    ) {
        self.path(corners, true, fill, pen);
    }

    /// Adds an open polyline.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        self.path(points, false, None, Some(pen));
    }

    /// Adds separate line segments.
    pub fn segments(&mut self, segments: impl IntoIterator<Item = [[f64; 2]; 2]>, pen: Pen) {
        let lifted = segments.into_iter().flat_map(|[from, to]| [from, to, [f64::NAN; 2]]);
        self.path(lifted, false, None, Some(pen));
    }

    fn path(
        &mut self,
        points: impl IntoIterator<Item = [f64; 2]>,
        closed: bool,
        fill: Option<Ink>,
        pen: Option<Pen>,
    ) {
        let begin = self.points.len();
        self.points.extend(points);
        let points = begin..self.points.len();
        self.shapes.push(Shape::Path { points, closed, fill, pen });
    }

    /// Copies another picture into the existing buffers.
    pub fn copy(&mut self, other: &Self) {
        self.begin(other.canvas, other.window);
        self.shapes.clone_from(&other.shapes);
        self.points.clone_from(&other.points);
        for (name, value) in &other.attributes {
            self.tell(name, value);
        }
    }

    /// Sets an attribute of the canvas element, for programs.
    pub fn tell(&mut self, name: &'static str, value: impl Display) {
        self.set_attribute(name, &value);
    }

    /// Not generic, so that a program contains this code once.
    #[inline(never)]
    fn set_attribute(&mut self, name: &'static str, value: &dyn Display) {
        let known = self.attributes.iter().position(|(known, _)| *known == name);
        let place = known.unwrap_or_else(|| {
            self.attributes.push((name, String::new()));
            self.attributes.len() - 1
        });
        let text = &mut self.attributes[place].1;
        text.clear();
        // Writing to a string cannot fail.
        let _ = write!(text, "{value}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_shows_all_of_its_window() {
        let window = Window { low: [-10.0, -2.0], high: [30.0, 8.0] };
        for size in [[1280.0, 800.0], [390.0, 844.0]] {
            let camera = Camera::showing(window, size);
            for corner in [window.low, window.high] {
                let [x, y] = camera.to_px(corner);
                assert!((-1e-9..=size[0] + 1e-9).contains(&x));
                assert!((-1e-9..=size[1] + 1e-9).contains(&y));
                let back = camera.to_world([x, y]);
                assert!((back[0] - corner[0]).abs() < 1e-9 && (back[1] - corner[1]).abs() < 1e-9);
            }
            let (low, high) = (camera.to_px([0.0, 0.0]), camera.to_px([0.0, 1.0]));
            assert!(high[1] < low[1], "y points up");
        }
    }

    #[test]
    fn a_window_grows_around_points() {
        let window = Window::square(5.0).including([9.0, 0.0], 1.0);
        assert_eq!(window, Window { low: [-5.0, -5.0], high: [10.0, 5.0] });
    }
}
