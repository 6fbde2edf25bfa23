//! The rear of a planar set: the ends of the paths that stay farthest back.
//!
//! Nothing is gained by driving straight here: the rate jumps between its
//! bounds. One jump is enough where straight is always admissible; otherwise a
//! path may have to cross the line through its end more often, and the traced
//! extremals with two jumps and more are added.

use super::envelope::lower_envelope;
use super::extremal::Costate;
use super::front::end_range;
use super::paths::{Path, Paths, unit};
use super::sampling::{MOST_HALVINGS, Sample, sample, triangle_height};
use crate::math::{PI, TAU, atan2};
use nalgebra::Complex;

/// Curves, each from right to left, that contain the rear after `steps` ≥ 1
/// steps. All their points are reachable; the first two curves join the ends of
/// the two outermost paths.
pub(super) fn candidates(
    paths: &Paths,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
) -> Vec<Vec<Complex<f64>>> {
    let (low, high) = (&paths.low, &paths.high);
    let mut curves = vec![
        one_jump(low, high, steps, least_pieces, tolerance),
        one_jump(high, low, steps, least_pieces, tolerance),
    ];
    curves[0].reverse();
    if !paths.straight_always(steps) {
        more_jumps(paths, steps, tolerance, &mut curves);
    }
    curves
}

/// Drive along `first`, then with the rates of `last`, for every instant of the
/// jump: the curve runs from the end of `last` to the end of `first`.
fn one_jump(
    first: &Path,
    last: &Path,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
) -> Vec<Complex<f64>> {
    let step_s = first.step_s();
    let pieces = least_pieces.div_ceil(steps);
    let mut points = vec![last.point(steps)];
    for step in 0..steps {
        let curve = |seconds: f64| {
            let ((from, heading), (left, other)) =
                (first.within(step, seconds), last.within(step, seconds));
            let remaining = unit(heading - other) * (last.point(steps) - left);
            let at_end = step + 1 == steps && seconds == step_s;
            Sample {
                point: from + remaining,
                // The curve crosses the line from the jump to the end.
                angle: if at_end { heading } else { atan2(remaining.im, remaining.re) },
            }
        };
        sample(&curve, (0.0, step_s), pieces, tolerance, &mut points);
    }
    points.pop();
    points.push(first.point(steps));
    points
}

/// Extremals with more jumps than this stay behind those with fewer.
const MOST_JUMPS: usize = 4;

/// In this many steps the end headings are searched for extremals with two
/// jumps and more.
const SEARCH: usize = 96;

fn more_jumps(paths: &Paths, steps: usize, tolerance: f64, curves: &mut Vec<Vec<Complex<f64>>>) {
    let trace = |phi: f64| {
        let costate = Costate::end(phi).back(paths, 0, steps - 1);
        Trace { phi, jumps: costate.switches, sample: costate.sample() }
    };
    let (left, right) = end_range(paths, steps);
    for (from, to) in [(right, PI), (left + TAU, PI)] {
        let traces: Vec<Trace> =
            (0..SEARCH).map(|i| trace(from + (to - from) * (i as f64 / SEARCH as f64))).collect();
        for pair in traces.windows(2) {
            if pair[0].jumps.max(pair[1].jumps) >= 2 {
                connect(&trace, pair[0], pair[1], tolerance, MOST_HALVINGS, curves);
            }
        }
    }
}

/// An extremal traced to the start.
#[derive(Clone, Copy)]
struct Trace {
    /// At the end, rad.
    phi: f64,
    jumps: usize,
    sample: Sample,
}

/// Appends the ends of the extremals between two, without those with too many
/// jumps, and without the places where the ends leap: there an extremal passes
/// near a straight one, and its neighbours part.
fn connect(
    trace: &impl Fn(f64) -> Trace,
    start: Trace,
    end: Trace,
    tolerance: f64,
    halvings: u32,
    curves: &mut Vec<Vec<Complex<f64>>>,
) {
    if start.jumps.min(end.jumps) > MOST_JUMPS {
        return;
    }
    let (from, to) = (start.sample, end.sample);
    if start.jumps.max(end.jumps) <= MOST_JUMPS && triangle_height(from, to) <= tolerance {
        match curves.last_mut() {
            Some(last) if last.last() == Some(&from.point) => last.push(to.point),
            _ => curves.push(vec![from.point, to.point]),
        }
    } else if halvings > 0 {
        let middle = trace(0.5 * (start.phi + end.phi));
        connect(trace, start, middle, tolerance, halvings - 1, curves);
        connect(trace, middle, end, tolerance, halvings - 1, curves);
    }
}

/// The rear as one curve from right to left, seen along direction 0, in which
/// every admissible heading lies within ±π/2.
pub(super) fn rear(curves: &[Vec<Complex<f64>>]) -> Vec<Complex<f64>> {
    curves.iter().fold(Vec::new(), |rear, curve| lower_envelope(rear, curve))
}
