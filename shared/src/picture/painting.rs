//! Paints a picture with any brush, in pixels, from bottom to top.

use super::{Camera, Picture, Shape, Tail, VEHICLE_LENGTH_M};
use crate::chart::{Colour, Ink, Pen};
use crate::math::sin_cos;
use crate::vehicle::Pose;

/// Points for a brush. A trait object keeps the client small, because each method of [`Brush`] is
/// then compiled only once.
pub type Points<'a> = &'a mut dyn Iterator<Item = [f64; 2]>;

/// A painting backend. Positions are [right, down] from the top left corner (px).
pub trait Brush {
    /// Paints a polyline or a filled polygon. A NaN point lifts the pen.
    fn path(&mut self, points: Points<'_>, closed: bool, fill: Option<Ink>, pen: Option<Pen>);

    /// Paints a circle with this radius (px).
    fn circle(&mut self, centre: [f64; 2], radius: f64, fill: Option<Ink>, outline: Option<Pen>);

    /// Paints text whose baseline is centred at `middle`.
    fn words(&mut self, text: &str, middle: [f64; 2], colour: Colour);
}

/// Outline of a vehicle's arrow: points (along the heading, to the left), in units of the arrow's
/// length.
const ARROW: [(f64, f64); 7] = [
    (0.0, 0.036),
    (0.72, 0.036),
    (0.72, 0.15),
    (1.0, 0.0),
    (0.72, -0.15),
    (0.72, -0.036),
    (0.0, -0.036),
];

/// Radius of the dot, and half the side of the square, at the tail, in units of the arrow's length.
const TAIL: f64 = 0.085;

/// Minimum length of an arrow and minimum side of a goal (px).
const LEAST_ARROW: f64 = 26.0;
const LEAST_GOAL: f64 = 9.0;

/// Distance of a label's text below its position (px).
const LABEL_BELOW: f64 = 24.0;

impl Picture {
    /// Paints the picture in a frame of this size (px).
    pub fn paint(&self, size_px: [f64; 2], brush: &mut impl Brush) {
        let camera = Camera::showing(self.window, size_px);
        let placed = |range| self.points(range).iter().map(|&point| camera.to_px(point));
        for shape in &self.shapes {
            match shape {
                Shape::Path { points, closed, fill, pen } => {
                    brush.path(&mut placed(points), *closed, *fill, *pen);
                }
                Shape::Disc { centre, radius_m, fill, outline } => {
                    let radius = radius_m * camera.scale;
                    brush.circle(camera.to_px(*centre), radius, Some(*fill), Some(*outline));
                }
                Shape::Vehicle { tail, pose, colour } => {
                    vehicle(&camera, brush, *tail, *pose, *colour);
                }
                Shape::Label { at, text, colour } => {
                    let [x, y] = camera.to_px(*at);
                    brush.words(text, [x, y + LABEL_BELOW], *colour);
                }
                Shape::Square { centre, side_m, colour } => {
                    let half = 0.5 * (side_m * camera.scale).max(LEAST_GOAL);
                    let [x, y] = camera.to_px(*centre);
                    let corners = [(-half, -half), (half, -half), (half, half), (-half, half)];
                    let mut corners =
                        corners.into_iter().map(|(right, down)| [x + right, y + down]);
                    brush.path(&mut corners, true, Some((*colour).into()), None);
                }
            }
        }
    }
}

/// Paints tail, shaft and head of a vehicle.
fn vehicle(camera: &Camera, brush: &mut impl Brush, tail: Tail, pose: Pose, colour: Colour) {
    const SQUARE: [(f64, f64); 4] = [(TAIL, TAIL), (TAIL, -TAIL), (-TAIL, -TAIL), (-TAIL, TAIL)];
    let length = (VEHICLE_LENGTH_M * camera.scale).max(LEAST_ARROW);
    let [x, y] = camera.to_px(pose.position());
    let (sin, cos) = sin_cos(pose.psi);
    let place = |&(along, left): &(f64, f64)| {
        [x + length * (along * cos - left * sin), y - length * (along * sin + left * cos)]
    };
    let ink = Some(colour.into());
    match tail {
        Tail::Dot => brush.circle([x, y], TAIL * length, ink, None),
        Tail::Square => brush.path(&mut SQUARE.iter().map(place), true, ink, None),
    }
    brush.path(&mut ARROW.iter().map(place), true, ink, None);
}
