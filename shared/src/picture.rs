//! Pictures of the world: shapes in metres, and the camera that brings metres to pixels. A browser paints
//! them on a canvas; [`Picture::drawing`] makes the same picture a drawing for files. Colours and pens are
//! those of charts.

pub mod stage;
mod painting;
mod drawn;

pub use painting::{Brush, Points};

use crate::chart::{Colour, Ink, Pen};
use crate::vehicle::Pose;
use core::fmt::{Display, Write as _};
use core::ops::Range;
use std::rc::Rc;

/// Something to draw. Positions are world coordinates, m; widths and dashes of pens are CSS pixels. Corners
/// and ends of lines are in the picture, which keeps their memory; see [`Picture::points`].
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line through points. A point that is not a number lifts the pen.
    Path {
        /// Its points.
        points: Range<usize>,
        /// Whether the last point is joined to the first one.
        closed: bool,
        /// What fills it, if something does.
        fill: Option<Ink>,
        /// How it is drawn, if it is.
        pen: Option<Pen>,
    },
    /// A disc.
    Disc {
        /// Its centre.
        centre: [f64; 2],
        /// Its radius, m.
        radius_m: f64,
        /// What fills it.
        fill: Ink,
        /// How its edge is drawn.
        outline: Pen,
    },
    /// A vehicle: an arrow whose tail marks the exact position.
    Vehicle {
        /// What marks its exact position, so that vehicles differ by more than their colours.
        tail: Tail,
        /// Its position and heading.
        pose: Pose,
        /// Its colour.
        colour: Colour,
    },
    /// Words beside a position.
    Label {
        /// The position.
        at: [f64; 2],
        /// The words.
        text: Rc<str>,
        /// Colour.
        colour: Colour,
    },
    /// A filled square.
    Square {
        /// Its centre.
        centre: [f64; 2],
        /// Its side, m.
        side_m: f64,
        /// Its colour.
        colour: Colour,
    },
}

/// What marks the exact position of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tail {
    /// A dot: the human.
    Dot,
    /// A square: the robot.
    Square,
}

/// Length of a vehicle's arrow, m.
pub const VEHICLE_LENGTH_M: f64 = 1.9;

/// A rectangle of the world that must be visible.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Window {
    /// Lower left corner, m.
    pub low: [f64; 2],
    /// Upper right corner, m.
    pub high: [f64; 2],
}

impl Window {
    /// The square around the origin that reaches `half_m` each way.
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

/// From metres to CSS pixels: the same scale both ways, y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Pixels per metre.
    pub scale: f64,
    origin_px: [f64; 2],
    /// Width and height of the canvas, CSS pixels.
    pub size_px: [f64; 2],
}

impl Camera {
    /// The camera that shows all of `window`, centred, as large as it can.
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

    /// The place on the canvas, px, of a point of the world, m.
    #[must_use]
    pub fn to_px(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.origin_px[0] + self.scale * x, self.origin_px[1] - self.scale * y]
    }

    /// The point of the world, m, at a place on the canvas, px.
    #[must_use]
    pub fn to_world(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.origin_px[0]) / self.scale, (self.origin_px[1] - y) / self.scale]
    }
}

/// A canvas and what is on it. One picture serves every frame, and keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// The canvas element's id.
    pub canvas: &'static str,
    /// What must be visible.
    pub window: Window,
    /// In order of painting.
    shapes: Vec<Shape>,
    /// The points of all shapes, one after the other.
    points: Vec<[f64; 2]>,
    /// Attributes of the canvas element that tell programs what is shown.
    pub attributes: Vec<(&'static str, String)>,
}

/// Points are compared by their bits: one that lifts the pen is not a number, yet equal to another one.
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
    /// Begins anew: nothing is on this canvas, which shows at least `window`. The attributes of
    /// the same canvas stay.
    pub fn begin(&mut self, canvas: &'static str, window: Window) {
        if self.canvas != canvas {
            self.attributes.clear();
        }
        self.canvas = canvas;
        self.window = window;
        self.shapes.clear();
        self.points.clear();
    }

    /// What is drawn, in order of painting.
    #[must_use]
    pub fn shapes(&self) -> &[Shape] {
        &self.shapes
    }

    /// The corners or ends of one of its shapes, m.
    #[must_use]
    pub fn points(&self, of: &Range<usize>) -> &[[f64; 2]] {
        self.points.get(of.clone()).unwrap_or_default()
    }

    /// Paints something over the rest.
    pub fn push(&mut self, shape: Shape) {
        self.shapes.push(shape);
    }

    /// Paints several things over the rest.
    pub fn extend(&mut self, shapes: impl IntoIterator<Item = Shape>) {
        self.shapes.extend(shapes);
    }

    /// Paints a closed polygon.
    pub fn polygon(
        &mut self,
        corners: impl IntoIterator<Item = [f64; 2]>,
        fill: Option<Ink>,
        pen: Option<Pen>,
    ) {
        self.path(corners, true, fill, pen);
    }

    /// Paints an open line.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        self.path(points, false, None, Some(pen));
    }

    /// Paints lines that are not joined.
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

    /// Becomes a copy of another picture, in the memory that it has.
    pub fn copy(&mut self, other: &Self) {
        self.begin(other.canvas, other.window);
        self.shapes.clone_from(&other.shapes);
        self.points.clone_from(&other.points);
        for (name, value) in &other.attributes {
            self.tell(name, value);
        }
    }

    /// Tells programs something: sets an attribute of the canvas element.
    pub fn tell(&mut self, name: &'static str, value: impl Display) {
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
