//! The rear of a slice where paths with more than two switches stay farther back.
//!
//! The goal is the path that ends farthest out along a direction, on the line through the queried
//! position. The conditional-gradient method (Frank and Wolfe 1956) starts from the path of a
//! window that ends nearest: each round finds, to first order, how turning in each part of the
//! horizon moves the end, and gives the parts beyond some line the highest rate, as many as the end
//! heading requires, and the others the lowest. The direction of that line is chosen so that the
//! path ends on the line through the position. Because a concave function is minimised, a round
//! gains more than its first-order estimate.
//!
//! All paths between the one found and those of the window on both sides of the nearest one
//! (headings interpolated) are admissible, so the three form a loop of reachable positions.

use super::super::budget::Budget;
use super::super::paths::unit;
use super::buffer::Buffer;
use super::parts::Parts;
use super::search::Arc;
use super::span::Span;
use nalgebra::Complex;

/// A path is improved at most this often.
const MOST_ROUNDS: usize = 6;

/// Rounds end when one gains less than this, s.
const LEAST_GAIN: f64 = 1e-6;

/// If only a given distance matters: assumed upper bound on the gain of all later rounds together,
/// as a multiple of one round's gain.
const MOST_GROWTH: f64 = 30.0;

/// The line is turned at most this far from the direction of interest, rad.
const MOST_TILT: f64 = 1.3;

/// Initial step of the search for the direction, rad.
const TILT_STEP: f64 = 0.35;

/// Directions closer than this, rad, count as equal.
const LEAST_TILT: f64 = 3e-3;

/// Paths on both sides of the line whose ends are this near each other, s, are interpolated,
/// at a loss of less than 10⁻⁵ s.
const SAME_END: f64 = 5e-3;

/// The search for the direction of the line takes at most this many trials.
const MOST_TRIALS: usize = 24;

/// Cost of a trial per part of the path, in units of a [`Budget`].
const TRYING: usize = 8;

/// Ends at most this far, s, to the side of the line count as on it.
const ON_LINE: f64 = 1e-5;

/// The loop of three paths and those between them. The parameter is 0 and 3 for the first, 1 for
/// the second, 2 for the third.
pub(super) struct Loop<'a> {
    parts: Parts<'a>,
    headings: [Buffer<f64>; 3],
}

/// A path of the loop: its place in it, and its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    place: f64,
    point: Complex<f64>,
}

/// A part, and how much turning more in it moves the end.
type Rank = (f64, usize);

impl<'a> Loop<'a> {
    /// The loop of a window's paths at three parameters. The middle one is improved until it ends
    /// `enough`, s, beyond `position`, seen from its original end, or gets no farther.
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

    /// Improves the middle path until it ends `enough` beyond the position.
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

/// The line on which paths are to end, as far out as possible.
struct Line<'a> {
    parts: &'a Parts<'a>,
    position: Complex<f64>,
    outward: Complex<f64>,
    budget: &'a Budget<'a>,
}

impl Line<'_> {
    /// A position relative to that on the line: how far out (real), and how far left.
    fn seen(&self, end: Complex<f64>) -> Complex<f64> {
        (end - self.position) * self.outward.conj()
    }

    /// To first order the farthest path that ends on the line, given the middles of the parts of
    /// a path; `None` if there is none.
    fn farther(&self, middles: &[Complex<f64>]) -> Option<Buffer<f64>> {
        let mut ranks = Buffer::new(self.parts.count);
        // Tilted to the right, paths end more to the right.
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

/// A path, and on which side of the line it ends.
struct Trial {
    tilt: f64,
    /// How far left of the line it ends, s.
    aside: f64,
    path: Buffer<f64>,
}

/// Fills in the headings of the path to the end heading that turns most in the parts whose
/// middles are farthest to the left of `direction`, since turning more there moves the end along it.
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

    /// Between two paths whose headings differ by δ, the second derivative is at most ∫δ².
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        let (first, second, _) = self.knot_between(a.place.min(b.place));
        // Headings are linear in the share: the mean square is at most that of the whole.
        let apart: f64 = first.iter().zip(second).map(|(a, b)| (b - a) * (b - a)).sum();
        0.125 * (b.place - a.place) * (b.place - a.place) * self.parts.seconds * apart
    }
}
