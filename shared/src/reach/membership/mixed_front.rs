//! The front of a slice if driving straight is admissible only in some steps.
//!
//! For each direction α, dynamic programming finds the path with the largest ∫cos(θ − α), among the
//! paths with a constant turn rate in each part of a step. It needs no table if the integrand is
//! concave, because the value function (the gain that is still possible from part k on) then has its
//! maximum at one heading. The best path turns as far as possible toward the maximum of the next part.
//!
//! The cosine is replaced by the parabola −w(θ − α)²/2, up to a constant. The slope of the value
//! function is then linear between a few knots. From part to part, the knots below the maximum move by
//! the highest turn and the knots above it by the lowest turn, so each part costs only a few
//! operations. The weight is w = sin φ/φ for φ = θ − α on the path of the previous round. With this
//! weight, the parabola touches the cosine from below. So each round improves the path, and the rounds
//! converge to the best path.

use super::buffer::Buffer;
use super::parts::Parts;
use super::search::{Arc, deviation_of_turn};
use super::span::Span;
use crate::math::PI;
use core::cell::RefCell;
use nalgebra::Complex;

/// Largest number of rounds in which parabolas are fitted.
const MOST_ROUNDS: usize = 6;

/// The rounds end when all weights change by less than this.
const SAME_WEIGHT: f64 = 5e-3;

/// The front of a slice, parametrised by the direction α.
pub(super) struct MixedFront<'a> {
    parts: Parts<'a>,
    scratch: RefCell<Scratch>,
}

/// A range of headings in which the slope of the value function is linear.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    /// Width of the range (rad).
    length: f64,
    /// As the heading rises, the slope falls at a rate of `fall` plus the sum of all weights added so
    /// far.
    fall: f64,
}

struct Scratch {
    /// The best heading after each part: the maximum of the value function there.
    best: Buffer<f64>,
    headings: Buffer<f64>,
    weights: Buffer<f64>,
    /// Ranges below and above the maximum. The range nearest to the maximum is the last one.
    below: Buffer<Stretch>,
    above: Buffer<Stretch>,
}

/// A point of the front and its direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    direction: f64,
    point: Complex<f64>,
}

impl<'a> MixedFront<'a> {
    pub(super) fn new(span: Span<'a>) -> Self {
        let parts = Parts::new(span);
        let count = parts.count;
        let scratch = Scratch {
            best: Buffer::new(count),
            headings: Buffer::new(count),
            weights: Buffer::new(count),
            below: Buffer::new(2 * count),
            above: Buffer::new(2 * count),
        };
        Self { parts, scratch: RefCell::new(scratch) }
    }

    /// The directions α that belong to the lowest and the highest path.
    pub(super) fn directions(&self) -> (f64, f64) {
        let parts = &self.parts;
        // `low` and `high` bound the headings after each part that are reachable from the start and
        // still lead to the end heading.
        let (mut low, mut high) = (parts.end_heading, parts.end_heading);
        let (mut under, mut over) = (parts.heading, parts.heading);
        for part in 0..parts.count {
            let (lo, hi) = parts.turns(part);
            (under, over) = (under + lo, over + hi);
        }
        let (above_low, below_high) = (parts.end_heading - under, over - parts.end_heading);
        let (mut lowest, mut highest) = (parts.heading, parts.heading);
        (under, over) = (parts.heading, parts.heading);
        for part in 0..parts.count {
            let (lo, hi) = parts.turns(part);
            (under, over) = (under + lo, over + hi);
            low = under.max(over - below_high);
            high = over.min(under + above_low);
            lowest = lowest.min(low);
            highest = highest.max(high);
        }
        (lowest.min(low), highest.max(high))
    }
}

impl Scratch {
    /// Fills in the best headings for parabolas with the current weights.
    fn find_best(&mut self, parts: &Parts<'_>, direction: f64) {
        let Self { best, weights, below, above, .. } = self;
        let last = parts.count - 1;
        let (mut count_below, mut count_above) = (0, 0);
        let mut maximum = parts.end_heading;
        let mut sum = 0.0;
        best[last] = maximum;
        for part in (1..=last).rev() {
            let (lo, hi) = parts.turns(part);
            // Between these two headings the value function is constant.
            let (from, to) = (maximum - hi, maximum - lo);
            let weight = weights[part - 1];
            let flat = Stretch { length: to - from, fall: -sum };
            sum += weight;
            let (mut slope, stack, other, count, others, sign);
            if direction <= from {
                (maximum, slope, sign) = (from, weight * (from - direction), -1.0);
                (stack, other) = (&mut *below, &mut *above);
                (count, others) = (&mut count_below, &mut count_above);
                other[*others] = flat;
                *others += 1;
            } else if direction >= to {
                (maximum, slope, sign) = (to, weight * (direction - to), 1.0);
                (stack, other) = (&mut *above, &mut *below);
                (count, others) = (&mut count_above, &mut count_below);
                other[*others] = flat;
                *others += 1;
            } else {
                maximum = direction;
                below[count_below] = Stretch { length: direction - from, ..flat };
                above[count_above] = Stretch { length: to - direction, ..flat };
                count_below += 1;
                count_above += 1;
                best[part - 1] = maximum;
                continue;
            }
            // Moves toward the zero of the slope, or to the last heading that still leads to the end.
            while slope > 0.0 && *count > 0 {
                let Stretch { length, fall } = stack[*count - 1];
                let way = slope / (fall + sum);
                let passed = Stretch { length: length.min(way), fall };
                other[*others] = passed;
                *others += 1;
                maximum += sign * passed.length;
                if way < length {
                    stack[*count - 1].length -= way;
                    break;
                }
                slope -= length * (fall + sum);
                *count -= 1;
            }
            best[part - 1] = maximum;
        }
    }

    /// Fills in the headings of the path that always turns toward the best headings.
    fn follow(&mut self, parts: &Parts<'_>) {
        let mut heading = parts.heading;
        for part in 0..parts.count {
            let (lo, hi) = parts.turns(part);
            heading += (self.best[part] - heading).clamp(lo, hi);
            self.headings[part] = heading;
        }
    }
}

impl Arc for MixedFront<'_> {
    type Knot = Knot;

    fn knot(&self, direction: f64) -> Knot {
        let mut scratch = self.scratch.borrow_mut();
        scratch.weights.fill(1.0);
        for _ in 0..MOST_ROUNDS {
            scratch.find_best(&self.parts, direction);
            scratch.follow(&self.parts);
            let Scratch { headings, weights, .. } = &mut *scratch;
            let mut changed = 0.0_f64;
            for (weight, heading) in weights.iter_mut().zip(headings.iter()) {
                let fitting = weight_at(heading - direction);
                changed = changed.max((fitting - *weight).abs());
                *weight = fitting;
            }
            if changed < SAME_WEIGHT {
                break;
            }
        }
        let point = self.parts.drive(scratch.headings.iter().copied(), |_| {});
        Knot { direction, point }
    }

    fn work(&self) -> usize {
        16 * self.parts.count
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.direction, knot.point)
    }

    /// The curve turns in one direction only, by as much as its direction α changes.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        deviation_of_turn(a.point, b.point, b.direction - a.direction)
    }
}

/// Lower bound on weights. For |φ| ≥ π, no parabola of this kind is concave.
const LEAST_WEIGHT: f64 = 1e-3;

/// sin φ/φ, with an error of at most 0.003 for |φ| up to π.
fn weight_at(phi: f64) -> f64 {
    let x = (phi * phi).min(PI * PI);
    let series = 1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0));
    (1.0 - x / 6.0 * series).max(LEAST_WEIGHT)
}
