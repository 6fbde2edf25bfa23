//! A point mass that is steered towards a target.

use crate::reachability::game::{Game, Inputs, Players, TERMS, least};
use crate::real::Real;

/// ẋ = v, v̇ = u with |u| ≤ `acceleration_mps2`. The state is (x, v) in (m, m/s). The input
/// minimises V, so {V ≤ 0} contains the states that can be steered to the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubleIntegrator {
    /// Largest acceleration (m/s²).
    pub acceleration_mps2: f64,
}

impl Game<2> for DoubleIntegrator {
    fn terms(&self, _axis: usize, coordinate: f64) -> [f64; TERMS] {
        [coordinate, 0.0, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 2], [p1, p2]: [T; 2]) -> T {
        p1 * terms[1][0] - T::from_f64(self.acceleration_mps2) * p2.abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 2]) -> [T; 2] {
        [terms[1][0].abs(), T::from_f64(self.acceleration_mps2)]
    }
}

impl Players<2> for DoubleIntegrator {
    /// The acceleration u (m/s²).
    type Minimiser = [f64; 1];
    type Maximiser = [f64; 0];

    fn optimal_inputs(&self, _: [f64; 2], [_, p2]: [f64; 2]) -> Inputs<[f64; 1], [f64; 0]> {
        let most = self.acceleration_mps2;
        Inputs { minimiser: [least([-most, most], p2)], maximiser: [] }
    }

    fn velocity(&self, [_, v]: [f64; 2], inputs: &Inputs<[f64; 1], [f64; 0]>) -> [f64; 2] {
        let [u] = inputs.minimiser;
        [v, u]
    }
}
