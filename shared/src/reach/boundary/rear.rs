//! The rear of a planar set: the ends of the paths that stay farthest back.
//!
//! Driving straight gains nothing at the rear, so the rate of these paths switches between its bounds
//! (bang-bang). One switch is enough if the bounds are the same in every step. Otherwise, some paths
//! have to cross the line through their end more often, so extremals with two or more switches are
//! added.

use super::super::budget::Budget;
use super::super::paths::{Path, Paths};
use super::super::sampling::{Curves, pieces};
use super::multi_switch;
use nalgebra::Complex;

/// Appends curves that contain the rear after `steps` ≥ 1 steps. All their points are reachable. The
/// first two curves join the ends of the two outermost paths; the first one runs from right to left.
pub(super) fn candidates(
    paths: &Paths,
    steps: usize,
    (least_pieces, tolerance): (usize, f64),
    curves: &mut Curves,
    budget: &Budget<'_>,
) {
    let (low, high) = (&paths.low, &paths.high);
    let least = least_pieces.div_ceil(steps);
    for (first, last) in [(high, low), (low, high)] {
        let points = curves.begin();
        one_switch(first, last, steps, (least, tolerance), points, budget);
        curves.space_last();
    }
    multi_switch::append(paths, steps, tolerance, curves, budget);
}

/// Appends the ends of the paths that follow `first` and then take the rates of `last`, for all
/// switching times. The curve runs from the end of `last` to the end of `first`.
fn one_switch(
    first: &Path,
    last: &Path,
    steps: usize,
    (least, tolerance): (usize, f64),
    points: &mut Vec<Complex<f64>>,
    budget: &Budget<'_>,
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
        // The second derivative is the sum of −width²·remaining, which is perpendicular to the curve,
        // and −i·width·(direction of `last`), of which only the perpendicular component counts.
        let ahead = last.facing(step).conj() * remaining;
        let slant = (ahead.im / length).abs() + (width + other.rate.abs()) * step_s;
        let bend = width * (width * (length + step_s) + slant);
        let count = pieces(step_s, bend, tolerance, least);
        budget.spend(count);
        if budget.is_spent() {
            return;
        }
        let (turn, other) = (first.piece(step, count), last.piece(step, count));
        // After the switch, the path is the rest of `last`, rotated by the difference of the headings.
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
