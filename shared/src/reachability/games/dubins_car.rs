//! A vehicle with constant speed that chooses its turn rate.

use crate::math::sin_cos;
use crate::reachability::game::{Game, Inputs, Players, TERMS, least};
use crate::real::Real;

/// ẋ = v cos ψ, ẏ = v sin ψ, ψ̇ = u with `turn_rate_radps.0` ≤ u ≤ `turn_rate_radps.1`. The state
/// is (x, y, ψ) in (m, m, rad). The input minimises V, so {V ≤ 0} contains the states that can be
/// steered to the target or, forward in time, the states that can be reached from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DubinsCar {
    /// Speed v (m/s).
    pub speed_mps: f64,
    /// Lowest and highest turn rate (rad/s).
    pub turn_rate_radps: (f64, f64),
}

impl Game<3> for DubinsCar {
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS] {
        if axis < 2 {
            return [0.0; TERMS];
        }
        let (sin, cos) = sin_cos(coordinate);
        [self.speed_mps * cos, self.speed_mps * sin, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 3], [p1, p2, p3]: [T; 3]) -> T {
        let (low, high) = self.turn_rate_radps;
        let (middle, half) = (T::from_f64(0.5 * (low + high)), T::from_f64(0.5 * (high - low)));
        let [drift_x, drift_y, _] = terms[2];
        p1 * drift_x + p2 * drift_y + middle * p3 - half * p3.abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 3]) -> [T; 3] {
        let (low, high) = self.turn_rate_radps;
        let [drift_x, drift_y, _] = terms[2];
        [drift_x.abs(), drift_y.abs(), T::from_f64(low.abs().max(high.abs()))]
    }
}

impl Players<3> for DubinsCar {
    /// The turn rate u (rad/s).
    type Minimiser = [f64; 1];
    type Maximiser = [f64; 0];

    fn optimal_inputs(&self, _: [f64; 3], [.., p3]: [f64; 3]) -> Inputs<[f64; 1], [f64; 0]> {
        let (low, high) = self.turn_rate_radps;
        Inputs { minimiser: [least([low, high], p3)], maximiser: [] }
    }

    fn velocity(&self, [.., psi]: [f64; 3], inputs: &Inputs<[f64; 1], [f64; 0]>) -> [f64; 3] {
        let ((sin, cos), [u]) = (sin_cos(psi), inputs.minimiser);
        [self.speed_mps * cos, self.speed_mps * sin, u]
    }
}
