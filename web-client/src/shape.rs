//! What is drawn on a canvas: shapes in world coordinates, and the camera that brings metres to
//! pixels. Colours and pens are those of charts.

use sidestep::chart::{Colour, Ink, Pen};
use sidestep::vehicle::Pose;
use std::fmt::{Display, Write as _};
use std::rc::Rc;

/// Something to draw. Positions are world coordinates, m; widths and dashes of pens are CSS pixels.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A closed polygon.
    Polygon {
        /// Its corners.
        points: Vec<[f64; 2]>,
        /// What fills it.
        fill: Ink,
        /// How its edge is drawn.
        outline: Pen,
    },
    /// An open line.
    Polyline {
        /// Its points.
        points: Vec<[f64; 2]>,
        /// How it is drawn.
        pen: Pen,
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
    /// Grid lines over the whole view, and a scale bar.
    Grid {
        /// Distance between lines, m.
        every_m: u32,
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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// The canvas element's id.
    pub canvas: &'static str,
    /// What must be visible.
    pub window: Window,
    /// In order of painting.
    pub shapes: Vec<Shape>,
    /// Attributes of the canvas element that tell programs what is shown.
    pub attributes: Vec<(&'static str, String)>,
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
