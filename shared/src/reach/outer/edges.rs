//! The edges of curves (line segments and arcs), and their intersections.

use super::super::paths::unit;
use super::Point;
use crate::math::PI;

/// The edge of a curve from a corner to the next one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Edge {
    Line,
    /// An arc of at most a quarter of a circle.
    Arc {
        centre: Point,
        /// Whether it is counter-clockwise.
        left: bool,
    },
}

/// A corner of a curve, and the edge to the next one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) point: Point,
    pub(super) edge: Edge,
}

/// A squared length (in s² of travel) that counts as zero.
pub(super) const NOTHING: f64 = 1e-24;

/// Widest arc (rad).
const WIDEST: f64 = 0.5 * PI;

impl Corner {
    pub(super) fn rotated(self, by: Point) -> Self {
        let edge = match self.edge {
            Edge::Line => Edge::Line,
            Edge::Arc { centre, left } => Edge::Arc { centre: centre * by, left },
        };
        Self { point: self.point * by, edge }
    }

    pub(super) fn moved(self, by: Point) -> Self {
        let edge = match self.edge {
            Edge::Line => Edge::Line,
            Edge::Arc { centre, left } => Edge::Arc { centre: centre + by, left },
        };
        Self { point: self.point + by, edge }
    }

    /// Rotates the corner about the origin, then translates it.
    pub(super) fn place(&mut self, turned: Point, moved: Point) {
        self.point = self.point * turned + moved;
        if let Edge::Arc { centre, .. } = &mut self.edge {
            *centre = *centre * turned + moved;
        }
    }
}

pub(super) fn cross(a: Point, b: Point) -> f64 {
    a.re * b.im - a.im * b.re
}

/// Intersections of the circles or lines of two edges, each given with its ends.
pub(super) fn crossings(e: (Edge, Point, Point), f: (Edge, Point, Point)) -> [Option<Point>; 2] {
    let both = |middle: Point, off: Point| [Some(middle + off), Some(middle - off)];
    match (e, f) {
        ((Edge::Arc { centre: c, .. }, a, _), (Edge::Arc { centre: d, .. }, b, _)) => {
            let between = d - c;
            let (r2, s2) = ((a - c).norm_sqr(), (b - d).norm_sqr());
            let length2 = between.norm_sqr();
            if length2 < NOTHING {
                return [None; 2];
            }
            let along = 0.5 * (1.0 + (r2 - s2) / length2);
            let off2 = r2 / length2 - along * along;
            if off2 < 0.0 {
                return [None; 2];
            }
            both(c + between * along, between * Point::new(0.0, off2.sqrt()))
        }
        ((Edge::Line, a, b), (Edge::Arc { centre, .. }, c, _))
        | ((Edge::Arc { centre, .. }, c, _), (Edge::Line, a, b)) => {
            let along = b - a;
            let foot = a + along * (((centre - a) * along.conj()).re / along.norm_sqr());
            let off2 = ((c - centre).norm_sqr() - (foot - centre).norm_sqr()) / along.norm_sqr();
            if off2 < 0.0 {
                return [None; 2];
            }
            both(foot, along * off2.sqrt())
        }
        ((Edge::Line, a, b), (Edge::Line, c, d)) => {
            let (first, second) = (b - a, d - c);
            let share = cross(c - a, second) / cross(first, second);
            [share.is_finite().then(|| a + first * share), None]
        }
    }
}

/// Appends an arc of angle `width` (rad) about the origin, without its end point.
pub(super) fn arc(from: Point, to: Point, width: f64, left: bool, corners: &mut Vec<Corner>) {
    if from.norm_sqr() < NOTHING || width <= 0.0 && from == to {
        return;
    }
    let edge = Edge::Arc { centre: Point::new(0.0, 0.0), left };
    let count = (width / WIDEST).ceil().max(1.0);
    let part = unit(if left { width / count } else { -width / count });
    let mut point = from;
    for _ in 0..count as usize {
        corners.push(Corner { point, edge });
        point *= part;
    }
}
