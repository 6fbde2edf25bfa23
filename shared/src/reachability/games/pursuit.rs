//! Pursuit and evasion of two Dubins vehicles in the evader's frame.

use crate::math::sin_cos;
use crate::reachability::game::{Game, Inputs, Players, TERMS};
use crate::reachability::pursuit::PursuitGame;
use crate::real::Real;

/// The relative motion of two Dubins vehicles in Cartesian coordinates. The state is the pursuer's
/// pose (x, y, ψ) in the evader's frame, in (m, m, rad).
///
/// ẋ = −v_e + v_p cos ψ + a y, ẏ = v_p sin ψ − a x, ψ̇ = b − a. The evader's turn rate |a| ≤ ω_e
/// maximises V; the pursuer's turn rate |b| ≤ ω_p minimises V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeDubins(pub PursuitGame);

impl Game<3> for RelativeDubins {
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS] {
        if axis < 2 {
            return [coordinate, 0.0, 0.0];
        }
        let PursuitGame { evader, pursuer, .. } = self.0;
        let (sin, cos) = sin_cos(coordinate);
        [pursuer.speed_mps * cos - evader.speed_mps, pursuer.speed_mps * sin, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 3], [p1, p2, p3]: [T; 3]) -> T {
        let [[x, ..], [y, ..], [drift_x, drift_y, _]] = *terms;
        let evader = T::from_f64(self.0.evader.turn_rate_radps);
        let pursuer = T::from_f64(self.0.pursuer.turn_rate_radps);
        p1 * drift_x + p2 * drift_y + evader * (p1 * y - p2 * x - p3).abs() - pursuer * p3.abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 3]) -> [T; 3] {
        let [[x, ..], [y, ..], [drift_x, drift_y, _]] = *terms;
        let evader = T::from_f64(self.0.evader.turn_rate_radps);
        let pursuer = T::from_f64(self.0.pursuer.turn_rate_radps);
        [drift_x.abs() + evader * y.abs(), drift_y.abs() + evader * x.abs(), evader + pursuer]
    }

    /// Left and right are interchangeable.
    fn mirror(&self) -> [bool; 3] {
        [false, true, true]
    }
}

impl Players<3> for RelativeDubins {
    /// The pursuer's turn rate b (rad/s).
    type Minimiser = [f64; 1];
    /// The evader's turn rate a (rad/s).
    type Maximiser = [f64; 1];

    fn optimal_inputs(&self, state: [f64; 3], gradient: [f64; 3]) -> Inputs<[f64; 1], [f64; 1]> {
        let [evader, pursuer] = self.0.optimal_turns(state, gradient);
        Inputs { minimiser: [pursuer], maximiser: [evader] }
    }

    fn velocity(&self, state: [f64; 3], inputs: &Inputs<[f64; 1], [f64; 1]>) -> [f64; 3] {
        let ([pursuer], [evader]) = (inputs.minimiser, inputs.maximiser);
        self.0.velocity(state, evader, pursuer)
    }
}
