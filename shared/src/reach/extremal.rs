//! Extremal paths, traced backward from where they end (Pontryagin's principle).
//!
//! A path whose end is the farthest in some direction θ turns at the highest
//! rate while it is left of the line through its end in that direction, and at
//! the lowest while it is right of it: turning a piece of the path moves its end
//! across the line of sight. With φ = ψ − θ and `rest`, what remains to be
//! driven, seen along θ, the costate of the heading is p = −Im(rest): p > 0 asks
//! for the highest rate, p < 0 for the lowest. At the end p = 0, and going back
//! along an arc both φ and rest have a closed form, so each extremal is exact;
//! one number (φ at the end) names it. An arc with p = 0 throughout is straight,
//! with φ = 0.

use super::paths::{Paths, arc, unit};
use super::sampling::Sample;
use crate::math::{acos, cos, sin, wrap_positive};
use nalgebra::Complex;

/// An extremal at some instant, seen from its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Costate {
    /// Heading less the direction θ, rad.
    pub(super) phi: f64,
    /// What remains to be driven, in the frame turned by θ, seconds of travel.
    pub(super) rest: Complex<f64>,
    /// How often the rate jumps between the bounds from here to the end.
    pub(super) switches: usize,
    /// Which bound holds just after this instant; at the end, and after a
    /// straight arc, `Side::Straight`.
    side: Side,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Low,
    Straight,
    High,
}

/// Costates closer to zero than this, s, are rounding errors of zero.
const ZERO_COSTATE: f64 = 1e-13;

/// More jumps a step than this are not traced further: only a path that trembles
/// about φ = π has so many.
const MOST_SWITCHES: usize = 8;

impl Costate {
    /// The end of the extremal that arrives with heading θ + `phi`.
    pub(super) fn end(phi: f64) -> Self {
        Self { phi, rest: Complex::new(0.0, 0.0), switches: 0, side: Side::Straight }
    }

    /// `seconds` earlier, having turned at `rate`.
    pub(super) fn before(self, rate: f64, seconds: f64) -> Self {
        let phi = self.phi - rate * seconds;
        Self { phi, rest: self.rest + arc(phi, rate, seconds), ..self }
    }

    /// The same extremal at the beginning of step `first`, if this is the end of
    /// step `last` (counted from 0).
    pub(super) fn back(self, paths: &Paths, first: usize, last: usize) -> Self {
        self.back_from(paths, first, last, paths.step_s)
    }

    /// The same extremal at the beginning of step `first`, if this is `seconds`
    /// after the beginning of step `last`.
    pub(super) fn back_from(
        mut self,
        paths: &Paths,
        first: usize,
        last: usize,
        seconds: f64,
    ) -> Self {
        for step in (first..=last).rev() {
            let mut left = if step == last { seconds } else { paths.step_s };
            loop {
                if self.rest.im.abs() < ZERO_COSTATE {
                    self.rest.im = 0.0;
                }
                let side = self.side_before(paths.lo[step], paths.hi[step]);
                let jumps = side != self.side && self.side != Side::Straight;
                self.switches += usize::from(jumps);
                if self.switches > MOST_SWITCHES * (last + 1) {
                    return self;
                }
                self.side = side;
                let rate = match side {
                    Side::Low => paths.lo[step],
                    Side::Straight => 0.0,
                    Side::High => paths.hi[step],
                };
                let Some(seconds) = self.switch(rate, left) else {
                    self = self.before(rate, left);
                    break;
                };
                self = self.before(rate, seconds);
                self.rest.im = 0.0;
                left -= seconds;
            }
        }
        self
    }

    /// Where the extremal ends, seen from its start, if this is its start. Its
    /// normal there is the direction θ = −φ.
    pub(super) fn sample(self) -> Sample {
        Sample { point: unit(-self.phi) * self.rest, angle: -self.phi }
    }

    /// Which bound holds just before this instant.
    fn side_before(&self, lo: f64, hi: f64) -> Side {
        let p = -self.rest.im;
        if p > 0.0 {
            return Side::High;
        }
        if p < 0.0 {
            return Side::Low;
        }
        // p vanishes here, and grows by sin φ: before, it had the other sign.
        let growth = sin(self.phi);
        if growth > 0.0 || (growth == 0.0 && hi < 0.0) {
            Side::Low
        } else if growth < 0.0 || lo > 0.0 {
            Side::High
        } else {
            Side::Straight
        }
    }

    /// Turning at `rate`, how many seconds before this instant, if fewer than
    /// `left`, p passes zero.
    fn switch(&self, rate: f64, left: f64) -> Option<f64> {
        let im = self.rest.im;
        if im.abs() >= left {
            return None;
        }
        let straight = (rate * left).abs() < 1e-6;
        let mut seconds = if straight {
            -im / sin(self.phi)
        } else {
            // Im(rest) + (cos φ' − cos φ)/rate = 0, for φ' = φ − rate·seconds.
            let turned = |target: f64| wrap_positive(rate.signum() * (self.phi - target));
            if im == 0.0 {
                turned(-self.phi) / rate.abs()
            } else {
                let level = cos(self.phi) - rate * im;
                if level.abs() > 1.0 {
                    return None;
                }
                let target = acos(level);
                turned(target).min(turned(-target)) / rate.abs()
            }
        };
        // The arc cosine loses digits near 0 and π; Newton's method regains them.
        if im != 0.0 && seconds < left {
            for _ in 0..2 {
                let slope = sin(self.phi - rate * seconds);
                if slope.abs() > 1e-9 {
                    seconds -= self.before(rate, seconds).rest.im / slope;
                }
            }
        }
        (seconds > 0.0 && seconds < left).then_some(seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::InputBounds;
    use crate::math::SeededRng;

    /// The highest value of Re(e^{−iθ}·end) over random sequences of rates.
    fn best_of_many(paths: &Paths, theta: f64, rng: &mut SeededRng) -> f64 {
        let mut best = f64::NEG_INFINITY;
        for _ in 0..3000 {
            let (mut end, mut heading) = (Complex::new(0.0, 0.0), 0.0);
            for step in 0..paths.steps() {
                let rate = rng.uniform(paths.lo[step], paths.hi[step]);
                end += arc(heading, rate, paths.step_s);
                heading += rate * paths.step_s;
            }
            best = best.max((end * unit(-theta)).re);
        }
        best
    }

    #[test]
    fn no_random_path_gets_farther_along_the_normal() {
        let mut rng = SeededRng::new(11);
        for _ in 0..40 {
            let mut lo: Vec<f64> = (0..6).map(|_| rng.uniform(-0.5, 0.5)).collect();
            let mut hi: Vec<f64> = (0..6).map(|_| rng.uniform(-0.5, 0.5)).collect();
            for (a, b) in lo.iter_mut().zip(&mut hi) {
                if *a > *b {
                    core::mem::swap(a, b);
                }
            }
            let bounds = InputBounds::new(lo, hi, (-0.5, 0.5)).unwrap();
            let paths = Paths::new(&bounds, 0.2);
            for phi in [-0.2, -0.05, 0.02, 0.1, 0.3] {
                let start = Costate::end(phi).back(&paths, 0, 5);
                let Sample { point, angle } = start.sample();
                let reached = (point * unit(-angle)).re;
                assert!(reached >= best_of_many(&paths, angle, &mut rng) - 1e-12);
            }
        }
    }
}
