//! Deterministic elementary functions, angles, and the seeded generator.
//!
//! All transcendental functions come from `libm`, which returns the same bits natively and in
//! WebAssembly. The platforms' own functions differ in the last bit for a few per cent of arguments.

pub use core::f64::consts::{PI, TAU};
pub use libm::{acos, asin, atan2, cbrt, cos, exp, hypot, log as ln, log2, pow, sin};

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// (sin, cos) of an angle in radians.
#[must_use]
pub fn sin_cos(angle: f64) -> (f64, f64) {
    (sin(angle), cos(angle))
}

/// The same angle in (−π, π].
#[must_use]
pub fn wrap_angle(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let wrapped = angle - TAU * ((angle - PI) / TAU).ceil();
    // Rounding can put the result one unit in the last place outside the interval.
    if wrapped <= -PI { wrapped + TAU } else { wrapped.min(PI) }
}

/// The same angle in [0, 2π); NaN if `angle` is not finite.
#[must_use]
pub fn wrap_positive(angle: f64) -> f64 {
    if (0.0..TAU).contains(&angle) {
        return angle;
    }
    if (-TAU..0.0).contains(&angle) {
        let wrapped = angle + TAU;
        return if wrapped < TAU { wrapped } else { 0.0 };
    }
    if !angle.is_finite() {
        return f64::NAN;
    }
    let wrapped = angle - TAU * (angle / TAU).floor();
    if !(0.0..TAU).contains(&wrapped) { 0.0 } else { wrapped }
}

/// A power of two near `value` > 0. `value` divided by this power is between 0.7 and 1.5. Division
/// by a power of two has no rounding error.
#[must_use]
pub fn power_of_two_near(value: f64) -> f64 {
    let mut power = 1.0;
    while value > power / 0.7 && power < 1e300 {
        power *= 2.0;
    }
    while value < 0.7 * power && power > 1e-300 {
        power *= 0.5;
    }
    power
}

/// sin(x)/x, smooth at zero.
#[must_use]
pub fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-2 {
        // Taylor series. For |x| < 0.01, the next term is below 3·10⁻²² of the result.
        let x2 = x * x;
        1.0 - x2 / 6.0 * (1.0 - x2 / 20.0 * (1.0 - x2 / 42.0))
    } else {
        sin(x) / x
    }
}

/// A random number generator that returns the same numbers for a seed on every platform (ChaCha
/// with 8 rounds).
#[derive(Clone, Debug)]
pub struct SeededRng(ChaCha8Rng);

impl SeededRng {
    /// The generator for `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in [0, 1), a multiple of 2⁻⁵³.
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0 … n − 1, with a negligible bias of at most n·2⁻⁶⁴.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.0.next_u64()) * n as u128) >> 64) as usize
    }

    /// A random order of 0 … n − 1 (Fisher and Yates).
    pub fn permutation(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn wrapping_keeps_the_direction(angle in -1e4..1e4f64) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((sin(wrapped) - sin(angle)).abs() < 1e-11);
            prop_assert!((cos(wrapped) - cos(angle)).abs() < 1e-11);
            prop_assert!((0.0..TAU).contains(&wrap_positive(angle)));
        }

        #[test]
        fn sinc_series_meets_the_quotient(x in 0.005..0.02f64) {
            prop_assert!((sinc(x) - sin(x) / x).abs() < 3e-16);
        }
    }

    #[test]
    fn wrapping_at_the_seam() {
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
        assert_eq!(wrap_angle(3.0 * PI), PI);
        assert_eq!(wrap_angle(0.0), 0.0);
    }

    #[test]
    fn a_seed_names_its_stream() {
        let mut a = SeededRng::new(7);
        let mut b = SeededRng::new(7);
        let mut c = SeededRng::new(8);
        let (first, again, other) = (a.unit(), b.unit(), c.unit());
        assert_eq!(first.to_bits(), again.to_bits());
        assert_ne!(first.to_bits(), other.to_bits());
        let mut order = a.permutation(100);
        order.sort_unstable();
        assert_eq!(order, (0..100).collect::<Vec<_>>());
    }
}
