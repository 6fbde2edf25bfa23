//! The rear of a planar set: the ends of the paths that stay farthest back.
//!
//! Nothing is gained by driving straight here: the rate jumps between its
//! bounds. One jump is enough where one may always turn both ways; otherwise a
//! path may have to cross the line through its end more often, and the traced
//! extremals with two jumps and more are added.

use super::extremal::{Costate, Instant};
use super::front::end_range;
use super::paths::{Path, Paths, Turn};
use super::sampling::{Curves, Sample, pieces, triangle_height};
use crate::math::{PI, TAU};
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
    // Where straight is always admissible, the set is the limit of sets whose
    // bounds allow turns both ways, and one jump is enough.
    if !paths.straight_always(steps) {
        more_jumps(paths, steps, tolerance, curves);
    }
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
        let piece_s = step_s / count as f64;
        let (turn, other) = (Turn::new(turn.rate, piece_s), Turn::new(other.rate, piece_s));
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

/// Extremals with more jumps than this, and one a step besides, are not looked at.
const MOST_JUMPS: usize = 3;

/// In this many steps the end headings are searched for extremals with two
/// jumps and more.
const SEARCH: usize = 16;

/// A stretch of end headings is halved at most this often. Where ends leap, more would
/// only come closer to the leap.
const MOST_HALVINGS: u32 = 20;

/// Nearer than this, rad, to φ = π at its end no extremal is traced: exactly
/// there, it may tremble without end.
const AT_REST: f64 = 1e-6;

fn more_jumps(paths: &Paths, steps: usize, tolerance: f64, curves: &mut Curves) {
    let trace = |phi: f64| {
        let costate = Costate::end(phi).to_start(paths, Instant::beginning(steps));
        Trace { phi, tame: costate.switches <= MOST_JUMPS + steps, sample: costate.sample() }
    };
    let (left, right) = end_range(paths, steps);
    // Several times what a smooth curve as long as the horizon takes. Where the ends of
    // extremals that tremble run wild, there is no end to it.
    let most = 64 + (2.0 * (steps as f64 * paths.step_s / tolerance).sqrt()) as usize;
    for (from, to) in [(right, PI - AT_REST), (left + TAU, PI + AT_REST)] {
        let mut start = trace(from);
        for i in 1..=SEARCH {
            let end = trace(from + (to - from) * (i as f64 / SEARCH as f64));
            let mut traces = most;
            connect(&trace, start, end, tolerance, (MOST_HALVINGS, &mut traces), curves);
            start = end;
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
/// near a straight one, and its neighbours part. At most `traces` are made.
fn connect(
    trace: &impl Fn(f64) -> Trace,
    start: Trace,
    end: Trace,
    tolerance: f64,
    (halvings, traces): (u32, &mut usize),
    curves: &mut Curves,
) {
    if (!start.tame && !end.tame) || *traces == 0 {
        return;
    }
    *traces -= 1;
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
        if curves.last() != Some(from) {
            curves.begin().push(from);
        }
        curves.points().extend([through, to]);
    } else if halvings > 0 {
        connect(trace, start, middle, tolerance, (halvings - 1, traces), curves);
        connect(trace, middle, end, tolerance, (halvings - 1, traces), curves);
    }
}
