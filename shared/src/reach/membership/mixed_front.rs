//! The front of a slice where straight is admissible in some steps only.
//!
//! For each direction α this finds the path with the largest ∫cos(θ − α) among those that turn at
//! one rate in each part of a step. The integrand is concave, so dynamic programming needs no
//! table: the gain still possible from part k on (the value function) has its maximum at one
//! heading, and the best path turns as far as it may toward the maximum of the next part. For the
//! integrand −w(θ − α)²/2 the slope of the value function is linear between a few knots; from part
//! to part those below the maximum move by the highest turn, those above it by the lowest, so
//! that each part costs a few operations. With w = sin φ/φ of the path found last, φ = θ − α,
//! this parabola touches the cosine from below: each round gains, and the rounds converge to the
//! best path.

use super::buffer::Buffer;
use super::parts::Parts;
use super::search::{Arc, deviation_of_turn};
use super::span::Span;
use crate::math::PI;
use core::cell::RefCell;
use nalgebra::Complex;

/// Largest number of rounds in which parabolas are fitted.
const MOST_ROUNDS: usize = 6;

/// Rounds end when no weight changes by more than this.
const SAME_WEIGHT: f64 = 5e-3;

/// The front of a slice, in order of the direction α.
pub(super) struct MixedFront<'a> {
    parts: Parts<'a>,
    scratch: RefCell<Scratch>,
}

/// A range of headings in which the slope of the value function is linear.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    /// Width of the range, rad.
    length: f64,
    /// How fast the slope falls with the heading, minus the sum of the weights before.
    fall: f64,
}

struct Scratch {
    /// The best heading after each part: the maximum of its value function.
    best: Buffer<f64>,
    headings: Buffer<f64>,
    weights: Buffer<f64>,
    /// Ranges below and above the maximum, the nearest last.
    below: Buffer<Stretch>,
    above: Buffer<Stretch>,
}

/// A point of the front and the direction it belongs to.
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

    /// The directions of the lowest and of the highest path.
    pub(super) fn directions(&self) -> (f64, f64) {
        let parts = &self.parts;
        // The range of headings after each part that the start reaches and that still leads to the end heading.
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
    /// Fills in the best headings for the parabolas with these weights.
    fn find_best(&mut self, parts: &Parts<'_>, direction: f64) {
        let Self { best, weights, below, above, .. } = self;
        let last = parts.count - 1;
        let (mut count_below, mut count_above) = (0, 0);
        let mut maximum = parts.end_heading;
        let mut sum = 0.0;
        best[last] = maximum;
        for part in (1..=last).rev() {
            let (lo, hi) = parts.turns(part);
            // Between these two the value function is constant.
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
            // Toward the zero of the slope, or the last heading that still leads to the end.
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

    /// Fills in the headings of the path that turns toward the best headings.
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

    /// The curve turns one way, as its direction does.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        deviation_of_turn(a.point, b.point, b.direction - a.direction)
    }
}

/// Lower bound on weights: beyond π the cosine has no such parabola.
const LEAST_WEIGHT: f64 = 1e-3;

/// sin φ/φ to within 0.003 up to π.
fn weight_at(phi: f64) -> f64 {
    let x = (phi * phi).min(PI * PI);
    let series = 1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0));
    (1.0 - x / 6.0 * series).max(LEAST_WEIGHT)
}
