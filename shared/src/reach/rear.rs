//! The rear of a planar set: the ends of the paths that stay farthest back.
//!
//! Nothing is gained by driving straight here: the rate jumps between its
//! bounds. One jump is enough where one may always turn both ways; otherwise a
//! path may have to cross the line through its end more often, and the traced
//! extremals with two jumps and more are added.

use super::envelope::lower_envelope;
use super::extremal::Costate;
use super::front::end_range;
use super::paths::{Path, Paths, unit};
use super::sampling::{MOST_HALVINGS, Sample, sample, spaced, triangle_height};
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
    let both_ways = (0..steps).all(|step| paths.lo[step] < 0.0 && 0.0 < paths.hi[step]);
    if !both_ways {
        more_jumps(paths, steps, tolerance, &mut curves);
    }
    curves.into_iter().map(spaced).collect()
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

/// Extremals with more jumps than this, and one a step besides, are not looked at.
const MOST_JUMPS: usize = 3;

/// In this many steps the end headings are searched for extremals with two
/// jumps and more.
const SEARCH: usize = 48;

/// Nearer than this, rad, to φ = π at its end no extremal is traced: exactly
/// there, it may tremble without end.
const AT_REST: f64 = 1e-6;

fn more_jumps(paths: &Paths, steps: usize, tolerance: f64, curves: &mut Vec<Vec<Complex<f64>>>) {
    let trace = |phi: f64| {
        let costate = Costate::end(phi).back(paths, 0, steps - 1);
        Trace { phi, tame: costate.switches <= MOST_JUMPS + steps, sample: costate.sample() }
    };
    let (left, right) = end_range(paths, steps);
    for (from, to) in [(right, PI - AT_REST), (left + TAU, PI + AT_REST)] {
        let traces: Vec<Trace> =
            (0..=SEARCH).map(|i| trace(from + (to - from) * (i as f64 / SEARCH as f64))).collect();
        for pair in traces.windows(2) {
            connect(&trace, pair[0], pair[1], tolerance, MOST_HALVINGS, curves);
        }
    }
}

/// An extremal traced to the start.
#[derive(Clone, Copy)]
struct Trace {
    /// At the end, rad.
    phi: f64,
    /// Whether it has few enough jumps.
    tame: bool,
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
    if !start.tame && !end.tame {
        return;
    }
    let middle = trace(0.5 * (start.phi + end.phi));
    let three = [start, middle, end];
    let close = |a: Trace, b: Trace| triangle_height(a.sample, b.sample) <= tolerance;
    // The ends of the extremals may run away and come back: the middle tells.
    if three.iter().all(|trace| trace.tame)
        && close(start, end)
        && close(start, middle)
        && close(middle, end)
    {
        let [from, through, to] = three.map(|trace| trace.sample.point);
        match curves.last_mut() {
            Some(last) if last.last() == Some(&from) => last.extend([through, to]),
            _ => curves.push(vec![from, through, to]),
        }
    } else if halvings > 0 {
        connect(trace, start, middle, tolerance, halvings - 1, curves);
        connect(trace, middle, end, tolerance, halvings - 1, curves);
    }
}

/// The rear as one curve from right to left, seen along direction 0, in which
/// every admissible heading lies within ±π/2.
pub(super) fn rear(curves: &[Vec<Complex<f64>>]) -> Vec<Complex<f64>> {
    curves.iter().fold(Vec::new(), |rear, curve| lower_envelope(rear, curve))
}
