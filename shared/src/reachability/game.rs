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

    /// The coordinates that may all change sign at once without changing the game. If grid, target
    /// and obstacle have the same symmetry, the solver computes half of the nodes.
    fn mirror(&self) -> [bool; D] {
        [false; D]
    }
}

/// The inputs of both players at one state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs<A, B> {
    /// Of the player that wants to reach the target.
    pub minimiser: A,
    /// Of the player that wants to stay away from it.
    pub maximiser: B,
}

/// A game that also computes its players' inputs, so that a solution gives their optimal inputs at any state.
pub trait Players<const D: usize>: Game<D> {
    /// An input of the minimising player, such as `[f64; 1]`; `[f64; 0]` if there is none.
    type Minimiser;
    /// An input of the maximising player.
    type Maximiser;

    /// The inputs whose p · f(x, a, b) is H(x, p), for p = `gradient`: each player's input is optimal whatever
    /// the other player does. An input on which p · f does not depend is the middle of its range.
    fn optimal_inputs(
        &self,
        state: [f64; D],
        gradient: [f64; D],
    ) -> Inputs<Self::Minimiser, Self::Maximiser>;

    /// ẋ = f(x, a, b), in the unit of each coordinate per second.
    fn velocity(
        &self,
        state: [f64; D],
        inputs: &Inputs<Self::Minimiser, Self::Maximiser>,
    ) -> [f64; D];
}

/// The input in [low, high] for which `factor` · input is least; the middle if `factor` is 0.
pub(super) fn least([low, high]: [f64; 2], factor: f64) -> f64 {
    if factor > 0.0 {
        low
    } else if factor < 0.0 {
        high
    } else {
        // Halved first, so that the sum of large ends stays finite.
        0.5 * low + 0.5 * high
    }
}
