//! The rear of a planar set: the ends of the paths that stay farthest back.
//!
//! Nothing is gained by driving straight here: the rate jumps between its
//! bounds. One jump is enough where the bounds are even; otherwise a path may have to cross
//! the line through its end more often, and the traced extremals with two jumps and
//! more are added. Such a path stays back only if it jumps where the bounds are narrow.

use super::paths::{Path, Paths};
use super::sampling::{Curves, pieces};
use super::zigzag;
use nalgebra::Complex;

/// Appends curves, the first from right to left, that contain the rear after
/// `steps` ≥ 1 steps. All their points are reachable; the first two curves join the
/// ends of the two outermost paths.
pub(super) fn candidates(
    paths: &Paths,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
    curves: &mut Curves,
) {
    let (low, high) = (&paths.low, &paths.high);
    let least = least_pieces.div_ceil(steps);
    for (first, last) in [(high, low), (low, high)] {
        let points = curves.begin();
        one_jump(first, last, steps, least, tolerance, points);
        curves.space_last();
    }
    zigzag::more_jumps(paths, steps, tolerance, curves);
}

/// Drive along `first`, then with the rates of `last`, for every instant of the
/// jump: the curve runs from the end of `last` to the end of `first`.
fn one_jump(
    first: &Path,
    last: &Path,
    steps: usize,
    least: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let (step_s, end) = (first.step_s(), last.point(steps));
    points.push(end);
    for step in 0..steps {
        let (turn, other) = (first.turn(step), last.turn(step));
        let width = (turn.rate - other.rate).abs();
        if width == 0.0 {
            continue;
        }
        let remaining = end - last.point(step);
        let length = remaining.norm_sqr().sqrt();
        // x″ is −width²·remaining across the curve, and width·(the heading of `last`),
        // of which only the part across counts.
        let ahead = last.facing(step).conj() * remaining;
        let slant = (ahead.im / length).abs() + (width + other.rate.abs()) * step_s;
        let bend = width * (width * (length + step_s) + slant);
        let count = pieces(step_s, bend, tolerance, least);
        let (turn, other) = (first.piece(step, count), last.piece(step, count));
        // What comes after the jump is turned by how far the headings differ.
        let back = other.turned.conj();
        let (mut point, mut facing) = (first.point(step), first.facing(step));
        let mut seen = ahead;
        for _ in 0..count {
            points.push(point + facing * seen);
            point += facing * turn.moved;
            facing *= turn.turned;
            seen = (seen - other.moved) * back;
        }
    }
    points.push(first.point(steps));
}
