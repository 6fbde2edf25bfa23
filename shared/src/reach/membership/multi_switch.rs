//! The rear of a slice where paths with more than two switches end farther back than paths with two.
//!
//! The goal is to find the path that ends on a line through the queried position, as far out along the
//! line as possible. The conditional-gradient method (Frank and Wolfe 1956) starts from a path of a
//! *window* (a curve of paths with two switches, see `slice`): the path that ends nearest to the
//! position. Each round computes, to first order, how turning in each part of the horizon moves the
//! end. The parts beyond a switching line get the highest rate, as many as the end heading requires.
//! The other parts get the lowest rate. The direction of the switching line is chosen so that the path
//! ends on the line through the position. Because a concave function is minimised, a round gains more
//! than its first-order estimate.
//!
//! The improved path and the window's paths on both sides of the nearest path form a loop. All paths
//! that interpolate the headings of two of these paths are admissible, so the loop consists of
//! reachable positions.

use super::super::budget::Budget;
use super::super::paths::unit;
use super::buffer::Buffer;
use super::parts::Parts;
use super::search::Arc;
use super::span::Span;
use nalgebra::Complex;

/// Maximum number of rounds that improve a path.
const MOST_ROUNDS: usize = 6;

/// The improvement ends when a round gains at most this (s).
const LEAST_GAIN: f64 = 1e-6;

/// Assumed upper bound on the total gain of all later rounds, as a multiple of the present round's
/// gain. It is used only if the search has a target distance.
const MOST_GROWTH: f64 = 30.0;

/// If the tilt from the direction of interest exceeds this (rad), the switching line is not tilted
/// further.
const MOST_TILT: f64 = 1.3;

/// Initial step of the search for the tilt (rad).
const TILT_STEP: f64 = 0.35;

/// Tilts that differ by at most this (rad) count as equal.
const LEAST_TILT: f64 = 3e-3;

/// Two paths on opposite sides of the line are interpolated if their ends are at most this far apart
/// (s). This interpolation loses less than 10⁻⁵ s.
const SAME_END: f64 = 5e-3;

/// Maximum number of trials in the search for the tilt.
const MOST_TRIALS: usize = 24;

/// Cost of a trial per part of the path, in units of a [`Budget`].
const TRYING: usize = 8;

/// Ends less than this (s) to the side of the line count as on the line.
const ON_LINE: f64 = 1e-5;

/// The loop of three paths and the paths interpolated between them. The parameter is 0 or 3 for the
/// first path, 1 for the second and 2 for the third.
pub(super) struct Loop<'a> {
    parts: Parts<'a>,
    headings: [Buffer<f64>; 3],
}

/// A path of the loop: its parameter and its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    place: f64,
    point: Complex<f64>,
}

/// The distance by which turning more in a part moves the end outward (up to a constant), and the
/// index of the part.
type Rank = (f64, usize);

impl<'a> Loop<'a> {
    /// The loop of a window's paths at three parameters. The middle path is improved until it ends
    /// `enough` (s) beyond `position`, as seen from its original end, or until it gets no farther.
    pub(super) fn new(
        span: Span<'a>,
        headings: impl Fn(f64, &mut [f64]),
        parameters: [f64; 3],
        (position, enough): (Complex<f64>, f64),
        budget: &Budget<'_>,
    ) -> Self {
        let parts = Parts::new(span);
        let mut found =
            Self { parts, headings: core::array::from_fn(|_| Buffer::new(parts.count)) };
        for (parameter, path) in parameters.into_iter().zip(&mut found.headings) {
            headings(parameter, path);
        }
        found.improve(position, enough, budget);
        found
    }

    /// Improves the middle path until it ends `enough` beyond the position, if possible.
    fn improve(&mut self, position: Complex<f64>, enough: f64, budget: &Budget<'_>) {
        let Self { parts, headings: [_, best, _] } = self;
        let mut middles = Buffer::new(parts.count);
        let end = parts.drive_between(best.iter().copied(), &mut middles);
        let distance = (position - end).norm_sqr().sqrt();
        if distance < LEAST_GAIN {
            return;
        }
        let line = Line { parts, position, outward: (position - end) / distance, budget };
        let mut reached = -distance;
        for _ in 0..MOST_ROUNDS {
            let Some(path) = line.farther(&middles) else { return };
            let along = line.seen(parts.drive_between(path.iter().copied(), &mut middles)).re;
            if along <= reached + LEAST_GAIN {
                return;
            }
            let hopeless = enough.is_finite() && along + MOST_GROWTH * (along - reached) < enough;
            reached = along;
            *best = path;
            if hopeless || reached >= enough {
                return;
            }
        }
    }

    fn knot_between(&self, place: f64) -> (&[f64], &[f64], f64) {
        let first = (place as usize).min(2);
        let share = place - first as f64;
        (&self.headings[first], &self.headings[(first + 1) % 3], share)
    }
}

/// The line on which paths should end, as far out as possible.
struct Line<'a> {
    parts: &'a Parts<'a>,
    position: Complex<f64>,
    outward: Complex<f64>,
    budget: &'a Budget<'a>,
}

impl Line<'_> {
    /// An end relative to the queried position: how far out (real part) and how far left (imaginary
    /// part) it is.
    fn seen(&self, end: Complex<f64>) -> Complex<f64> {
        (end - self.position) * self.outward.conj()
    }

    /// The path that ends on the line and, to first order, farthest out. `middles` are the middles of the
    /// parts of the present path. Returns `None` if no path was found.
    fn farther(&self, middles: &[Complex<f64>]) -> Option<Buffer<f64>> {
        let mut ranks = Buffer::new(self.parts.count);
        // The more the direction is tilted to the right, the farther right a path ends.
        let (mut right, mut left): (Option<Trial>, Option<Trial>) = (None, None);
        let mut tilt = 0.0;
        for _ in 0..MOST_TRIALS {
            self.budget.spend(TRYING * self.parts.count);
            if self.budget.is_spent() {
                return None;
            }
            let mut path = Buffer::new(self.parts.count);
            turn_most(self.parts, middles, self.outward * unit(tilt), &mut ranks, &mut path);
            let aside = self.seen(self.parts.drive(path.iter().copied(), |_| {})).im;
            let trial = Trial { tilt, aside, path };
            if aside.abs() < ON_LINE {
                return Some(trial.path);
            }
            *(if aside < 0.0 { &mut right } else { &mut left }) = Some(trial);
            tilt = match (&right, &left) {
                (Some(right), None) if right.tilt < MOST_TILT => right.tilt + TILT_STEP,
                (None, Some(left)) if left.tilt > -MOST_TILT => left.tilt - TILT_STEP,
                (Some(right), Some(left))
                    if left.tilt - right.tilt > LEAST_TILT
                        && left.aside - right.aside > SAME_END =>
                {
                    0.5 * (left.tilt + right.tilt)
                }
                _ => break,
            };
        }
        let (right, left) = (right?, left?);
        let share = right.aside / (right.aside - left.aside);
        let mut path = right.path;
        for (heading, other) in path.iter_mut().zip(left.path.iter()) {
            *heading += share * (other - *heading);
        }
        Some(path)
    }
}

/// A path, and its end relative to the line.
struct Trial {
    tilt: f64,
    /// How far to the left of the line the path ends (s).
    aside: f64,
    path: Buffer<f64>,
}

/// Fills in the headings of the path that turns most in the parts whose middles are farthest to the left
/// of `direction`, because turning more there moves the end along `direction`. The path ends with the
/// end heading.
fn turn_most(
    parts: &Parts<'_>,
    middles: &[Complex<f64>],
    direction: Complex<f64>,
    ranks: &mut [Rank],
    path: &mut [f64],
) {
    let mut left = parts.end_heading - parts.heading;
    for (part, (rank, middle)) in ranks.iter_mut().zip(middles).enumerate() {
        *rank = ((middle * direction.conj()).im, part);
        path[part] = parts.turns(part).0;
        left -= path[part];
    }
    ranks.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
    for &(_, part) in &*ranks {
        let (lo, hi) = parts.turns(part);
        let more = left.clamp(0.0, hi - lo);
        path[part] += more;
        left -= more;
        if left <= 0.0 {
            break;
        }
    }
    let mut heading = parts.heading;
    for turn in path {
        heading += *turn;
        *turn = heading;
    }
}

impl Arc for Loop<'_> {
    type Knot = Knot;

    fn knot(&self, place: f64) -> Knot {
        let (first, second, share) = self.knot_between(place);
        let headings = first.iter().zip(second).map(|(a, b)| a + share * (b - a));
        Knot { place, point: self.parts.drive(headings, |_| {}) }
    }

    fn work(&self) -> usize {
        4 * self.parts.count
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.place, knot.point)
    }

    /// Between two paths whose headings differ by δ, the second derivative of the curve is at most ∫δ².
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        let (first, second, _) = self.knot_between(a.place.min(b.place));
        // δ is linear in time within each part. So ∫δ² is at most the sum of δ² at the ends of the
        // parts, times the length of a part.
        let apart: f64 = first.iter().zip(second).map(|(a, b)| (b - a) * (b - a)).sum();
        0.125 * (b.place - a.place) * (b.place - a.place) * self.parts.seconds * apart
    }
}
