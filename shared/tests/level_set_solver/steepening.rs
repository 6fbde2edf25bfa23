//! A smooth problem that steepens to a kink: V_τ = −(∂V/∂x)²/2 on a circle, starting from cos x.
//! The example `validate` also measures it.

use sidestep::math::{cos, sin};
use sidestep::reachability::{Game, Real, TERMS};

/// H = −p²/2 with slopes up to 1.
pub(crate) struct Steepening;

impl Game<1> for Steepening {
    fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; 1], [p]: [T; 1]) -> T {
        -(T::HALF * p * p)
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; 1]) -> [T; 1] {
        [T::from_f64(1.0)]
    }
}

/// Horizon (s), which is half the time until a kink forms.
pub(crate) const SECONDS: f64 = 0.5;

/// V at [`SECONDS`]. Slopes are constant along characteristics. With p = −sin x₀, x = x₀ + pτ and V
/// = cos x₀ + p²τ/2.
pub(crate) fn exact(x: f64) -> f64 {
    // Solve x₀ − τ sin x₀ = x by bisection. The derivative of the left side is positive for τ < 1.
    let (mut low, mut high) = (x - 1.0, x + 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if middle - SECONDS * sin(middle) < x {
            low = middle;
        } else {
            high = middle;
        }
    }
    cos(low) + 0.5 * sin(low) * sin(low) * SECONDS
}
