//! Control-affine games from functions or arrays, without a hand-written Hamiltonian.

use super::affine_arrays::{AffineArrays, Player, check_grid};
use crate::invalid::Invalid;
use crate::reachability::game::{Game, Inputs, Players, TERMS};
use crate::reachability::grid::Grid;
use crate::real::Real;

/// ẋ = f(x) + G_u(x) u + G_d(x) d with `D` states. The `M` inputs u minimise V, the `K` inputs d
/// maximise it, each within its own range. If the control steers to the target, then u is the
/// control and d is the disturbance. If the control avoids the target, then d is the control and u
/// is the disturbance.
///
/// f and G are stored at the nodes of a grid, where the Hamiltonian is exact: H = p · f + Σ min
/// over u_j of (pᵀG_u)_j u_j + Σ max over d_k of (pᵀG_d)_k d_k. Between nodes, [`Players`]
/// interpolates f and G linearly along each axis. Problems must be solved on the same grid; on a
/// grid with other nodes, [`cartesian::solve`](super::super::cartesian::solve) reports that the
/// game's speed bounds are not finite.
///
/// # Example
/// A point mass pushed by wind: from where can it be brought into |x| ≤ 0.5 within a second?
/// ```
/// use core::ops::ControlFlow;
/// use sidestep::reachability::cartesian::{Problem, Settings, solve};
/// use sidestep::reachability::{Axis, ControlAffine, Grid, Scheme};
///
/// # fn main() -> Result<(), sidestep::reachability::SolveError> {
/// let grid = Grid { axes: [Axis::bounded(-3.0, 3.0, 61), Axis::bounded(-2.0, 2.0, 41)] };
/// let game = ControlAffine::new(grid, |[_, v]| [v, 0.0])? // ẋ = v, v̇ = u + 0.3 d
///     .minimiser(|_| [[0.0], [1.0]], [[-1.0, 1.0]])? // |u| ≤ 1 m/s²
///     .maximiser(|_| [[0.0], [0.3]], [[-1.0, 1.0]])?; // |d| ≤ 1
/// let target = |[x, _]: [f64; 2]| x.abs() - 0.5;
/// let problem = Problem::reach(&game, grid, &target, 1.0);
/// let solution =
///     solve::<f32, 2, _>(&problem, &Settings::new(Scheme::Weno5), &mut |_| ControlFlow::Continue(()))?;
/// let state = [1.2, -0.6]; // m, m/s
/// assert!(solution.value(state)? < 0.0); // it gets there, whatever the wind does,
/// assert_eq!(solution.inputs(&game, state)?.minimiser, [-1.0]); // if it brakes later, not now
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ControlAffine<const D: usize, const M: usize, const K: usize> {
    arrays: AffineArrays<D>,
}

impl<const D: usize> ControlAffine<D, 0, 0> {
    /// ẋ = f(x) without players, at the nodes of `grid`.
    ///
    /// # Errors
    /// [`Invalid`] for an invalid or too large grid, or an f that is not finite at a node.
    pub fn new(grid: Grid<D>, drift: impl Fn([f64; D]) -> [f64; D]) -> Result<Self, Invalid> {
        check_grid(&grid, 1)?;
        Ok(Self { arrays: AffineArrays::of_nodes(grid, at_nodes(&grid, drift))? })
    }

    /// Like [`Self::new`], but from an array: f at each node, row-major over nodes and `D`
    /// components.
    ///
    /// # Errors
    /// The errors of [`Self::new`], and [`Invalid`] for a wrong number of entries.
    pub fn from_array(grid: Grid<D>, drift: &[f64]) -> Result<Self, Invalid> {
        Ok(Self { arrays: AffineArrays::new(grid, drift)? })
    }
}

impl<const D: usize, const K: usize> ControlAffine<D, 0, K> {
    /// Adds G_u(x) u. Row d of the matrix belongs to coordinate d, and `range` contains the lowest
    /// and highest value of each u_j.
    ///
    /// # Errors
    /// [`Invalid`] for a range or a matrix that is not finite, a range whose ends are not in order,
    /// or a game that needs too much memory.
    pub fn minimiser<const M: usize>(
        self,
        matrix: impl Fn([f64; D]) -> [[f64; M]; D],
        range: [[f64; 2]; M],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        Ok(ControlAffine { arrays: with(self.arrays, Player::Minimiser, matrix, range)? })
    }

    /// Like [`Self::minimiser`], but from an array: G_u at each node, row-major over nodes, `D`
    /// rows and `M` columns.
    ///
    /// # Errors
    /// The errors of [`Self::minimiser`], and [`Invalid`] for a wrong number of entries.
    pub fn minimiser_from_array<const M: usize>(
        self,
        matrix: &[f64],
        range: [[f64; 2]; M],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        Ok(ControlAffine { arrays: self.arrays.minimiser(matrix, &range)? })
    }
}

impl<const D: usize, const M: usize> ControlAffine<D, M, 0> {
    /// Adds G_d(x) d; see [`ControlAffine::minimiser`].
    ///
    /// # Errors
    /// The errors of [`ControlAffine::minimiser`].
    pub fn maximiser<const K: usize>(
        self,
        matrix: impl Fn([f64; D]) -> [[f64; K]; D],
        range: [[f64; 2]; K],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        Ok(ControlAffine { arrays: with(self.arrays, Player::Maximiser, matrix, range)? })
    }

    /// Like [`Self::maximiser`], but from an array; see [`ControlAffine::minimiser_from_array`].
    ///
    /// # Errors
    /// The errors of [`ControlAffine::minimiser_from_array`].
    pub fn maximiser_from_array<const K: usize>(
        self,
        matrix: &[f64],
        range: [[f64; 2]; K],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        Ok(ControlAffine { arrays: self.arrays.maximiser(matrix, &range)? })
    }
}

impl<const D: usize, const M: usize, const K: usize> ControlAffine<D, M, K> {
    /// The grid of the game.
    #[must_use]
    pub fn grid(&self) -> Grid<D> {
        self.arrays.grid()
    }
}

impl<const D: usize, const M: usize, const K: usize> Game<D> for ControlAffine<D, M, K> {
    /// The index of the node; NaN between nodes and outside the grid.
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS] {
        self.arrays.terms(axis, coordinate)
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        self.arrays.hamiltonian(terms, gradient)
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D] {
        self.arrays.speed_bounds(terms)
    }
}

impl<const D: usize, const M: usize, const K: usize> Players<D> for ControlAffine<D, M, K> {
    type Minimiser = [f64; M];
    type Maximiser = [f64; K];

    fn optimal_inputs(&self, state: [f64; D], gradient: [f64; D]) -> Inputs<[f64; M], [f64; K]> {
        let Inputs { minimiser, maximiser } = self.arrays.optimal_inputs(state, gradient);
        Inputs {
            minimiser: core::array::from_fn(|j| minimiser[j]),
            maximiser: core::array::from_fn(|k| maximiser[k]),
        }
    }

    fn velocity(&self, state: [f64; D], inputs: &Inputs<[f64; M], [f64; K]>) -> [f64; D] {
        let (minimiser, maximiser) = (inputs.minimiser.to_vec(), inputs.maximiser.to_vec());
        self.arrays.velocity(state, &Inputs { minimiser, maximiser })
    }
}

fn at_nodes<R, const D: usize>(grid: &Grid<D>, function: impl Fn([f64; D]) -> R) -> Vec<R> {
    (0..grid.len()).map(|node| function(grid.node(grid.index(node)))).collect()
}

/// Adds inputs to `arrays`. `matrix` is their matrix as a function of the state.
fn with<const D: usize, const N: usize>(
    arrays: AffineArrays<D>,
    player: Player,
    matrix: impl Fn([f64; D]) -> [[f64; N]; D],
    range: [[f64; 2]; N],
) -> Result<AffineArrays<D>, Invalid> {
    arrays.check_room(N)?;
    let matrices = at_nodes(&arrays.grid(), matrix);
    arrays.with(player, &range, |node, input, d| matrices[node][d][input])
}
