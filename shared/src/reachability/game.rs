//! The trait of a differential game (or control problem) that the solver solves.

use crate::real::Real;

/// The number of values that a game may derive from one coordinate.
pub const TERMS: usize = 3;

/// The dynamics of a game with `D` states and two players.
///
/// A new game is one file with one implementation of this trait. The solver
/// marches V_τ = H(x, ∇V) in backward time τ, where
/// H(x, p) = max over one player, min over the other, of p · f(x, a, b). The set
/// is {V ≤ 0}: the minimising player wants to reach the target, the maximising player wants to stay
/// away from it.
///
/// The Hamiltonian is evaluated in the innermost loop, for many cells at once. It must therefore
/// contain neither branches with effects nor transcendental functions. [`Game::terms`] gives the
/// functions of a single coordinate that it needs (the coordinate itself, its sine, …); the solver
/// tabulates them once for each node of each axis.
pub trait Game<const D: usize>: Sync {
    /// The functions of `coordinate` on `axis` that the dynamics use.
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS];

    /// H(x, p), in metres (or the unit of V) per second; `gradient[d]` is ∂V/∂x_d.
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T;

    /// Upper bounds of |∂H/∂p_d| over all gradients: the largest speed along each
    /// axis. They set the Lax–Friedrichs dissipation and the time step.
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D];
}
