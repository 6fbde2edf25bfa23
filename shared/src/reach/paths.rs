//! The two outermost paths: the lowest and the highest rate all the way.
//!
//! Inside `reach`, lengths are in seconds of travel (the speed is one) and the
//! human starts at the origin with heading 0; points are complex numbers.

use crate::bounds::InputBounds;
use crate::math::{sin_cos, sinc};
use nalgebra::Complex;

/// e^{i·angle}.
pub(super) fn unit(angle: f64) -> Complex<f64> {
    let (sin, cos) = sin_cos(angle);
    Complex::new(cos, sin)
}

/// Displacement along an arc that starts in direction `heading`, rad, and turns
/// at `rate`, rad/s, for `seconds`.
pub(super) fn arc(heading: f64, rate: f64, seconds: f64) -> Complex<f64> {
    let half_turn = 0.5 * rate * seconds;
    unit(heading + half_turn) * (seconds * sinc(half_turn))
}

/// A path whose rate is constant in each step.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Path {
    step_s: f64,
    rates: Vec<f64>,
    /// At the start and after each step.
    headings: Vec<f64>,
    points: Vec<Complex<f64>>,
}

impl Path {
    fn new(rates: &[f64], step_s: f64) -> Self {
        let (mut heading, mut point) = (0.0, Complex::new(0.0, 0.0));
        let (mut headings, mut points) = (vec![heading], vec![point]);
        for &rate in rates {
            point += arc(heading, rate, step_s);
            heading += rate * step_s;
            headings.push(heading);
            points.push(point);
        }
        Self { step_s, rates: rates.to_vec(), headings, points }
    }

    /// Length of a step, s.
    pub(super) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// Heading, rad (not wrapped), after `step` steps.
    pub(super) fn heading(&self, step: usize) -> f64 {
        self.headings[step]
    }

    /// Position after `step` steps.
    pub(super) fn point(&self, step: usize) -> Complex<f64> {
        self.points[step]
    }

    /// Position and heading `seconds` after the beginning of step `step`.
    pub(super) fn within(&self, step: usize, seconds: f64) -> (Complex<f64>, f64) {
        let (rate, heading) = (self.rates[step], self.headings[step]);
        (self.points[step] + arc(heading, rate, seconds), heading + rate * seconds)
    }
}

/// The bounds and their two outermost paths.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Paths {
    pub(super) step_s: f64,
    pub(super) lo: Vec<f64>,
    pub(super) hi: Vec<f64>,
    /// Under the lowest rates: the right-hand edge.
    pub(super) low: Path,
    /// Under the highest rates: the left-hand edge.
    pub(super) high: Path,
}

impl Paths {
    pub(super) fn new(bounds: &InputBounds, step_s: f64) -> Self {
        Self {
            step_s,
            lo: bounds.lo().to_vec(),
            hi: bounds.hi().to_vec(),
            low: Path::new(bounds.lo(), step_s),
            high: Path::new(bounds.hi(), step_s),
        }
    }

    pub(super) fn steps(&self) -> usize {
        self.lo.len()
    }

    /// May one drive straight in step `step`?
    pub(super) fn straight_admissible(&self, step: usize) -> bool {
        self.lo[step] <= 0.0 && 0.0 <= self.hi[step]
    }

    /// May one drive straight in each of the first `steps` steps?
    pub(super) fn straight_always(&self, steps: usize) -> bool {
        (0..steps).all(|step| self.straight_admissible(step))
    }

    /// Lowest and highest heading, rad, that occurs in the first `steps` steps.
    pub(super) fn heading_range(&self, steps: usize) -> (f64, f64) {
        (0..=steps).fold((0.0, 0.0), |(low, high): (f64, f64), step| {
            (low.min(self.low.heading(step)), high.max(self.high.heading(step)))
        })
    }
}
