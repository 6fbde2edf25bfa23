//! Convex polygons that enclose a set, computed fast for all bounds.
//!
//! How far can a path get in direction φ? The coordinate of its position along φ is ∫ v(t) cos(θ(t) − φ) dt.
//! Its heading θ(t) is between the headings of the two outermost paths, λ(t) ≤ θ(t) ≤ η(t), and its speed
//! v(t) is in an interval. So the path gets no farther than
//!
//!   h(φ) = ∫ max { v cos(θ − φ) : λ(t) ≤ θ ≤ η(t), v₋(t) ≤ v ≤ v₊(t) } dt,
//!
//! and for any number of directions, the intersection of the half-planes {x : x·e_φ ≤ h(φ)}
//! contains the set. In each step λ and η are linear in time. The integral therefore has a closed form
//! between the instants at which the best heading switches. For the tube, h is replaced by its maximum
//! over all instants; h is monotonic in time between the instants at which the best heading is
//! perpendicular to φ.
//!
//! h is the support function of a convex set, so every half-plane touches the polygon. The corners of
//! the polygon are the intersections of the boundary lines of neighbouring directions.

use super::paths::{Path, Paths, arc, unit};
use crate::math::TAU;
use core::f64::consts::{FRAC_PI_2, PI};
use nalgebra::Complex;

/// Number of directions. The polygon's corners are farther out than the convex set by at most a factor
/// of 1/cos(π/128) = 1.0003.
const DIRECTIONS: usize = 128;

/// Upper bound on rounding errors (s) per second of travel.
const ROUNDING: f64 = 1e-9;

/// Replaces `boundary` by a convex polygon around the set after `steps` steps, or around the tube up
/// to that step. Start headings deviate by up to `heading` (rad) to either side. For a direction (a
/// unit vector), `more` returns the distance that uncertain start positions add. `instants` is
/// overwritten.
pub(super) fn surround(
    paths: &Paths,
    (steps, tube): (usize, bool),
    heading: f64,
    more: impl Fn(Complex<f64>) -> f64,
    instants: &mut Vec<f64>,
    boundary: &mut Vec<Complex<f64>>,
) {
    let part = TAU / DIRECTIONS as f64;
    let rounding = ROUNDING * steps as f64 * paths.step_s;
    let mut support = |k: usize| {
        let phi = part * k as f64;
        let facing = unit(phi);
        let range = Headings { paths, heading, phi };
        (facing, range.farthest(steps, tube, instants) + more(facing) + rounding)
    };
    let turned = unit(part);
    let first = support(0);
    let mut here = first;
    boundary.clear();
    boundary.extend((1..=DIRECTIONS).map(|k| {
        let next = if k < DIRECTIONS { support(k) } else { first };
        let across = (next.1 - here.1 * turned.re) / turned.im;
        let corner = here.0 * Complex::new(here.1, across);
        here = next;
        corner
    }));
}

/// Twice the area of a counter-clockwise polygon.
pub(super) fn twice_area(polygon: &[Complex<f64>]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| a.re * b.im - a.im * b.re).sum()
}

/// The admissible headings, relative to a direction.
struct Headings<'a> {
    paths: &'a Paths,
    /// Largest deviation of the start heading (rad).
    heading: f64,
    /// The direction (rad).
    phi: f64,
}

impl Headings<'_> {
    /// h(φ) after `steps` steps or, for a tube, its maximum up to that step.
    fn farthest(&self, steps: usize, tube: bool, instants: &mut Vec<f64>) -> f64 {
        let (mut along, mut most) = (0.0, 0.0_f64);
        for step in 0..steps {
            let low = Extreme::of(&self.paths.low, step, -self.heading - self.phi);
            let high = Extreme::of(&self.paths.high, step, self.heading - self.phi);
            let middle =
                Extreme { from: 0.5 * (low.from + high.from), rate: 0.5 * (low.rate + high.rate) };
            let seconds = self.paths.step_s;
            instants.clear();
            instants.extend([0.0, seconds]);
            low.multiples(FRAC_PI_2, seconds, instants);
            high.multiples(FRAC_PI_2, seconds, instants);
            middle.multiples(PI, seconds, instants);
            instants.sort_unstable_by(f64::total_cmp);
            let [slow, fast] = self.paths.speeds[step];
            for pair in instants.windows(2) {
                // The best heading does not pass a quarter turn between two instants, so the cosine keeps
                // its sign.
                let straight = best(low, high, (pair[0], pair[1]));
                along += straight * if straight > 0.0 { fast } else { slow };
                most = most.max(along);
            }
        }
        if tube { most } else { along }
    }
}

/// The lowest or the highest heading during a step (rad, relative to the direction). It is linear in
/// time.
#[derive(Clone, Copy)]
struct Extreme {
    from: f64,
    rate: f64,
}

impl Extreme {
    fn of(path: &Path, step: usize, shift: f64) -> Self {
        Self { from: path.heading(step) + shift, rate: path.turn(step).rate }
    }

    fn at(self, seconds: f64) -> f64 {
        self.from + self.rate * seconds
    }

    /// Appends the instants up to `seconds` at which the heading is a multiple of `angle`.
    fn multiples(self, angle: f64, seconds: f64, instants: &mut Vec<f64>) {
        let (a, b) = (self.from, self.at(seconds));
        let (first, last) = ((a.min(b) / angle).ceil(), (a.max(b) / angle).floor());
        if self.rate == 0.0 || first > last {
            return;
        }
        let count = (last - first) as usize;
        instants.extend((0..=count).map(|i| {
            let multiple = (first + i as f64) * angle;
            ((multiple - a) / self.rate).clamp(0.0, seconds)
        }));
    }
}

/// The integral of the cosine of the best heading between two instants, if the best heading does not
/// switch in between.
fn best(low: Extreme, high: Extreme, (begin, end): (f64, f64)) -> f64 {
    let middle = 0.5 * (begin + end);
    let (below, above) = (low.at(middle) / TAU, high.at(middle) / TAU);
    if below.ceil() <= above {
        return end - begin;
    }
    let nearest = if below - below.floor() <= above.ceil() - above { low } else { high };
    arc(nearest.at(begin), nearest.rate, end - begin).re
}
