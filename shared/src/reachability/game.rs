//! The trait of a differential game (or control problem) that the solver solves.

use crate::real::Real;

/// The number of values that a game can derive from one coordinate.
pub const TERMS: usize = 3;

/// The dynamics of a game with `D` states and two players.
///
/// To add a game, write one file with one implementation of this trait. The solver marches
/// V_τ = H(x, ∇V) in backward time τ. H(x, p) is p · f(x, a, b), maximised over one player's input
/// and minimised over the other player's. The set is {V ≤ 0}. The minimising player wants to reach
/// the target, and the maximising player wants to stay away from it.
///
/// The Hamiltonian is evaluated in the innermost loop, for many cells at the same time. It must
/// therefore contain neither branches with side effects nor transcendental functions.
/// [`Game::terms`] returns the functions of a single coordinate that the Hamiltonian needs (the
/// coordinate itself, its sine, …). The solver tabulates them once for each node of each axis.
pub trait Game<const D: usize>: Sync {
    /// The functions of `coordinate` on `axis` that the dynamics use.
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS];

    /// H(x, p), in metres (or the unit of V) per second; `gradient[d]` is ∂V/∂x_d.
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T;

    /// Upper bounds of |∂H/∂p_d| over all gradients: the largest speed along each
    /// axis. They set the Lax–Friedrichs dissipation and the time step.
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D];

    /// The coordinates whose signs can all be reversed at the same time without changing the game.
    /// If grid, target and obstacle have the same symmetry, the solver computes only half of the
    /// nodes.
    fn mirror(&self) -> [bool; D] {
        [false; D]
    }
}

/// The inputs of both players at one state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs<A, B> {
    /// Inputs of the player that wants to reach the target.
    pub minimiser: A,
    /// Inputs of the player that wants to stay away from the target.
    pub maximiser: B,
}

/// A game that also computes its players' optimal inputs, so that a solution can return them at any
/// state.
pub trait Players<const D: usize>: Game<D> {
    /// The input type of the minimising player, for example `[f64; 1]`; `[f64; 0]` if the game has
    /// no such player.
    type Minimiser;
    /// The input type of the maximising player.
    type Maximiser;

    /// The inputs for which p · f(x, a, b) = H(x, p), with p = `gradient`. Each player's input is
    /// optimal regardless of the other player's input. If p · f does not depend on an input, that
    /// input is the middle of its range.
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

/// The input in [low, high] that minimises `factor` · input; the middle if `factor` is 0.
pub(super) fn least([low, high]: [f64; 2], factor: f64) -> f64 {
    if factor > 0.0 {
        low
    } else if factor < 0.0 {
        high
    } else {
        // Halved before the addition, so that the sum of large ends does not overflow.
        0.5 * low + 0.5 * high
    }
}
