//! Converts curves of arcs to polygons that enclose them.

use super::super::paths::unit;
use super::super::sampling::to_segment;
use super::edges::{Corner, Edge, cross};
use super::{MOST_CORNERS, Point};
use crate::math::{PI, atan2};

/// [`coarsen`] doubles its tolerance at most this many times.
const MOST_DOUBLINGS: u32 = 6;

/// Replaces `boundary` by a polygon that encloses the curve and exceeds it by at most `tolerance`. Its
/// edges lie outside arcs that turn left, and are chords of arcs that turn right.
pub(super) fn polyline(corners: &[Corner], tolerance: f64, boundary: &mut Vec<Point>) {
    boundary.clear();
    for (i, corner) in corners.iter().enumerate() {
        boundary.push(corner.point);
        let Edge::Arc { centre, left } = corner.edge else { continue };
        let next = corners[(i + 1) % corners.len()].point;
        let (from, to) = (corner.point - centre, next - centre);
        let between = if left { to * from.conj() } else { from * to.conj() };
        let width = atan2(between.im, between.re);
        if width <= 0.0 {
            continue;
        }
        // Each edge covers an angle δ with r·δ²/8 ≤ tolerance, and at most a sixth of a turn.
        let radius = from.norm_sqr().sqrt();
        let count = (width * (radius / (8.0 * tolerance)).sqrt()).ceil();
        let count = count.clamp((width * 3.0 / PI).ceil().max(1.0), MOST_EDGES);
        let part = width / count;
        if left {
            let (mut corner, turned) = (from * unit(0.5 * part), unit(part));
            let outward = 1.0 / unit(0.5 * part).re;
            for _ in 0..count as usize {
                boundary.push(centre + corner * outward);
                corner *= turned;
            }
        } else {
            let (mut corner, turned) = (from, unit(-part));
            for _ in 1..count as usize {
                corner *= turned;
                boundary.push(centre + corner);
            }
        }
    }
}

/// Largest number of edges for one arc.
const MOST_EDGES: f64 = 100.0;

/// [Loosens](loosen) a polygon until it has few vertices.
pub(super) fn coarsen(boundary: &mut Vec<Point>, scratch: &mut Vec<Point>, tolerance: f64) {
    let mut allowed = tolerance;
    for _ in 0..MOST_DOUBLINGS {
        loosen(boundary, scratch, allowed);
        if boundary.len() <= MOST_CORNERS / 4 {
            return;
        }
        allowed *= 2.0;
    }
}

/// Removes vertices so that the polygon only grows, and nowhere by more than `tolerance`. A vertex with
/// a right turn is omitted. Two neighbouring vertices with left turns are replaced by the intersection
/// of their outer edges.
pub(super) fn loosen(boundary: &mut Vec<Point>, scratch: &mut Vec<Point>, tolerance: f64) {
    for _ in 0..4 {
        let n = boundary.len();
        if n < 8 {
            return;
        }
        scratch.clear();
        let at = |i: usize| boundary[i % n];
        let mut i = 0;
        while i < n {
            let (a, b, c) = (at(i + n - 1), at(i), at(i + 1));
            if i + 1 < n {
                let (ab, bc) = (b - a, c - b);
                let turn = cross(ab, bc);
                let chord = c - a;
                let forward = |edge: Point| (edge * chord.conj()).re > 0.0;
                // The height of b over the chord from a to c must be within the tolerance. The tip of a
                // spike stays.
                if turn <= 0.0
                    && forward(ab)
                    && forward(bc)
                    && -turn <= tolerance * chord.norm_sqr().sqrt()
                {
                    scratch.extend([c]);
                    i += 2;
                    continue;
                }
                let d = at(i + 2);
                let cd = d - c;
                let (first, second, both) = (turn, cross(bc, cd), cross(ab, cd));
                // If all three edges have similar directions, this is not the tip of a spike.
                let alike = |a: Point, b: Point| (a * b.conj()).re > 0.0;
                let onward = alike(ab, bc) && alike(bc, cd) && alike(ab, cd);
                if i + 2 < n && onward && first > 0.0 && second > 0.0 && both > 0.0 {
                    let corner = b + ab * (second / both);
                    let height = cross(bc, corner - b) / bc.norm_sqr().sqrt();
                    if height.abs() <= tolerance {
                        scratch.extend([corner, d]);
                        i += 3;
                        continue;
                    }
                }
            }
            scratch.push(b);
            i += 1;
        }
        core::mem::swap(boundary, scratch);
        if 10 * boundary.len() > 9 * n {
            return;
        }
    }
}

/// Distance of a line segment from the interior of a polygon (s of travel); 0 if they touch.
pub(super) fn outside_by(polygon: &[Point], [from, to]: [Point; 2]) -> f64 {
    let (mut winding, mut nearest) = (0, f64::INFINITY);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let left = cross(b - a, from - a);
        if a.im <= from.im && from.im < b.im && left > 0.0 {
            winding += 1;
        } else if b.im <= from.im && from.im < a.im && left < 0.0 {
            winding -= 1;
        }
        let across = cross(to - from, a - from) * cross(to - from, b - from) <= 0.0
            && left * cross(b - a, to - a) <= 0.0;
        if across && from != to && a != b {
            return 0.0;
        }
        for (point, start, end) in [(from, a, b), (to, a, b), (a, from, to)] {
            nearest = nearest.min(to_segment(point, start, end).0);
        }
    }
    if winding == 0 { nearest } else { 0.0 }
}
