//! Games that exist only for tests.

use super::*;

/// A game for the comparison with the twin. The direction of its velocities varies in space, it has
/// a minimising and a maximising player, and its Hamiltonian is neither convex nor concave.
pub(crate) struct Twisted;

impl<const D: usize> Game<D> for Twisted {
    fn terms(&self, axis: usize, x: f64) -> [f64; TERMS] {
        let phase = 0.7 * axis as f64;
        [sin(x + phase), cos(2.0 * x - phase), 0.5 + 0.3 * sin(x - phase)]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        let mut sum = T::ZERO;
        let mut shared = T::ZERO;
        for (d, slope) in gradient.into_iter().enumerate() {
            let drift = terms[(d + 1) % D][0] + T::HALF * terms[d][1];
            sum += drift * slope - terms[d][2] * slope.abs();
            shared += terms[d][1] * slope;
        }
        sum + T::HALF * shared.abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D] {
        core::array::from_fn(|d| {
            let drift = terms[(d + 1) % D][0] + T::HALF * terms[d][1];
            drift.abs() + terms[d][2] + T::HALF * terms[d][1].abs()
        })
    }
}

/// ẋ_d = drift_d + u_d with |u_d| ≤ speed_d; u minimises.
pub(crate) struct Drift<const D: usize> {
    pub(crate) drift: [f64; D],
    pub(crate) speed: [f64; D],
}

impl<const D: usize> Game<D> for Drift<D> {
    fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        let mut sum = T::ZERO;
        for (d, slope) in gradient.into_iter().enumerate() {
            let [drift, speed] = [self.drift[d], self.speed[d]].map(T::from_f64);
            sum += drift * slope - speed * slope.abs();
        }
        sum
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; D]) -> [T; D] {
        core::array::from_fn(|d| T::from_f64(self.drift[d].abs() + self.speed[d]))
    }
}

/// Two independent double integrators with the state (x, v, y, w) and accelerations up to `.0`.
pub(crate) struct TwoMasses(pub(crate) f64);

impl Game<4> for TwoMasses {
    fn terms(&self, _axis: usize, x: f64) -> [f64; TERMS] {
        [x, 0.0, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 4], p: [T; 4]) -> T {
        let a = T::from_f64(self.0);
        p[0] * terms[1][0] + p[2] * terms[3][0] - a * p[1].abs() - a * p[3].abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 4]) -> [T; 4] {
        let a = T::from_f64(self.0);
        [terms[1][0].abs(), a, terms[3][0].abs(), a]
    }
}

/// A faulty game: the speed that it reports (`bound`) can differ from the true speed (`rate`).
#[derive(Debug)]
pub(crate) struct Broken {
    pub(crate) bound: f64,
    pub(crate) rate: f64,
}

impl Game<1> for Broken {
    fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; 1], [p]: [T; 1]) -> T {
        p * T::from_f64(self.rate)
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; 1]) -> [T; 1] {
        [T::from_f64(self.bound)]
    }
}
