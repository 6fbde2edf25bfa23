//! A differential game (or control problem) as the solver sees it.

use crate::real::Real;

/// How many numbers a game may derive from one coordinate.
pub const TERMS: usize = 3;

/// Dynamics with two players, of `D` states: everything the solver asks of them.
///
/// A new game is one file with one implementation of this trait. The solver
/// marches V_τ = H(x, ∇V) in backward time τ, where
/// H(x, p) = max over one player, min over the other, of p · f(x, a, b). The set
/// is {V ≤ 0}: the minimising player wants to reach the target, the maximising
/// one to stay away.
///
/// The Hamiltonian runs inside the innermost loop, for many cells at once, and so
/// must be free of branches with effects and of transcendental functions. A game
/// states what it needs of each single coordinate (the coordinate itself, its
/// sine, …) as [`Game::terms`], which is tabulated once per node of each axis.
pub trait Game<const D: usize>: Sync {
    /// What the dynamics use of `coordinate` on `axis`.
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS];

    /// H(x, p): metres (or the unit of V) per second; `gradient[d]` is ∂V/∂x_d.
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T;

    /// Upper bounds of |∂H/∂p_d| over all gradients: the largest speed along each
    /// axis. They set the Lax–Friedrichs dissipation and the time step.
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D];
}
