//! Control-affine games from functions or arrays, without a Hamiltonian by hand.

use crate::invalid::{Invalid, all_finite, finite, length};
use crate::reachability::game::{Game, Inputs, Players, TERMS, least};
use crate::reachability::grid::{Boundary, Grid};
use crate::reachability::progress::{MEMORY_LIMIT_BYTES, check_memory};
use crate::real::Real;

/// ẋ = f(x) + G_u(x) u + G_d(x) d with `D` states. The `M` inputs u minimise V, the `K` inputs d
/// maximise it, each within a range of its own: a control that steers to the target is u and a
/// disturbance d; for a control that avoids it, the other way round.
///
/// f and G are kept at the nodes of a grid, where the Hamiltonian is exact:
/// H = p · f + Σ min over u_j of (pᵀG_u)_j u_j + Σ max over d_k of (pᵀG_d)_k d_k. Between nodes,
/// [`Players`] interpolates them linearly along each axis. Problems must be solved on the same grid;
/// on another one with nodes elsewhere, [`cartesian::solve`](super::super::cartesian::solve) complains
/// that the game's speed bounds are not finite.
///
/// # Example
/// A point mass that is pushed by a wind: from where can it be brought into |x| ≤ 0.5 within a second?
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
///     solve::<f32, 2, _>(&problem, &Settings::of(Scheme::Weno5), &mut |_| ControlFlow::Continue(()))?;
/// let state = [1.2, -0.6]; // m, m/s
/// assert!(solution.value(state)? < 0.0); // it gets there, whatever the wind does,
/// assert_eq!(solution.inputs(&game, state)?.minimiser, [-1.0]); // if it brakes later, not now
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ControlAffine<const D: usize, const M: usize, const K: usize> {
    grid: Grid<D>,
    /// f + G_u (middle of u) + G_d (middle of d) at each node.
    centre: Vec<[f64; D]>,
    minimiser: Player<D, M>,
    maximiser: Player<D, K>,
}

/// The inputs of one player.
#[derive(Clone, Debug, PartialEq)]
struct Player<const D: usize, const N: usize> {
    range: [[f64; 2]; N],
    /// At each node, the columns of G, each times half the width of its input's range.
    columns: Vec<[[f64; D]; N]>,
}

/// More nodes of an axis than this have no number in single precision.
const MOST_NODES: usize = 1 << 24;
/// A coordinate is that of a node if it misses it by at most this share of the spacing.
const MISS: f64 = 1e-3;

impl<const D: usize> ControlAffine<D, 0, 0> {
    /// ẋ = f(x) without players, at the nodes of `grid`.
    ///
    /// # Errors
    /// [`Invalid`] for a bad grid, one that needs too much memory, or an f that is not finite at a node.
    pub fn new(grid: Grid<D>, drift: impl Fn([f64; D]) -> [f64; D]) -> Result<Self, Invalid> {
        check_grid(&grid, 1)?;
        Self::of_nodes(grid, at_nodes(&grid, drift))
    }

    /// [`Self::new`] from an array: f at each node, row-major over nodes and `D` components.
    ///
    /// # Errors
    /// As [`Self::new`], or for another number of entries.
    pub fn from_array(grid: Grid<D>, drift: &[f64]) -> Result<Self, Invalid> {
        check_grid(&grid, 1)?;
        length("drift", grid.len() * D, drift.len())?;
        all_finite("drift", drift)?;
        let (rows, _) = drift.as_chunks::<D>();
        Self::of_nodes(grid, rows.to_vec())
    }

    fn of_nodes(grid: Grid<D>, centre: Vec<[f64; D]>) -> Result<Self, Invalid> {
        for (node, row) in centre.iter().enumerate() {
            if row.iter().any(|rate| !rate.is_finite()) {
                return Err(not_finite("drift", &grid, node, row));
            }
        }
        let nobody = || Player { range: [], columns: vec![[]; grid.len()] };
        Ok(Self { grid, centre, minimiser: nobody(), maximiser: nobody() })
    }
}

impl<const D: usize, const K: usize> ControlAffine<D, 0, K> {
    /// With G_u(x) u: row d of the matrix belongs to coordinate d, and `range` has the lowest and
    /// highest value of each u_j.
    ///
    /// # Errors
    /// [`Invalid`] for a range or a matrix that is not finite, an end below the other, or too much
    /// memory.
    pub fn minimiser<const M: usize>(
        self,
        matrix: impl Fn([f64; D]) -> [[f64; M]; D],
        range: [[f64; 2]; M],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        check_grid(&self.grid, 1 + M + K)?;
        let matrices = at_nodes(&self.grid, matrix);
        self.with_minimiser(matrices.into_iter(), range)
    }

    /// [`Self::minimiser`] from an array: G_u at each node, row-major over nodes, `D` rows and `M` columns.
    ///
    /// # Errors
    /// As [`Self::minimiser`], or for another number of entries.
    pub fn minimiser_from_array<const M: usize>(
        self,
        matrix: &[f64],
        range: [[f64; 2]; M],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        check_grid(&self.grid, 1 + M + K)?;
        length("minimiser", self.grid.len() * D * M, matrix.len())?;
        self.with_minimiser(matrices(matrix), range)
    }

    fn with_minimiser<const M: usize>(
        mut self,
        matrices: impl Iterator<Item = [[f64; M]; D]>,
        range: [[f64; 2]; M],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        let minimiser = player("minimiser", &self.grid, &mut self.centre, matrices, range)?;
        let Self { grid, centre, maximiser, .. } = self;
        Ok(ControlAffine { grid, centre, minimiser, maximiser })
    }
}

impl<const D: usize, const M: usize> ControlAffine<D, M, 0> {
    /// With G_d(x) d; see [`ControlAffine::minimiser`].
    ///
    /// # Errors
    /// As [`ControlAffine::minimiser`].
    pub fn maximiser<const K: usize>(
        self,
        matrix: impl Fn([f64; D]) -> [[f64; K]; D],
        range: [[f64; 2]; K],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        check_grid(&self.grid, 1 + M + K)?;
        let matrices = at_nodes(&self.grid, matrix);
        self.with_maximiser(matrices.into_iter(), range)
    }

    /// [`Self::maximiser`] from an array; see [`ControlAffine::minimiser_from_array`].
    ///
    /// # Errors
    /// As [`ControlAffine::minimiser_from_array`].
    pub fn maximiser_from_array<const K: usize>(
        self,
        matrix: &[f64],
        range: [[f64; 2]; K],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        check_grid(&self.grid, 1 + M + K)?;
        length("maximiser", self.grid.len() * D * K, matrix.len())?;
        self.with_maximiser(matrices(matrix), range)
    }

    fn with_maximiser<const K: usize>(
        mut self,
        matrices: impl Iterator<Item = [[f64; K]; D]>,
        range: [[f64; 2]; K],
    ) -> Result<ControlAffine<D, M, K>, Invalid> {
        let maximiser = player("maximiser", &self.grid, &mut self.centre, matrices, range)?;
        let Self { grid, centre, minimiser, .. } = self;
        Ok(ControlAffine { grid, centre, minimiser, maximiser })
    }
}

impl<const D: usize, const M: usize, const K: usize> ControlAffine<D, M, K> {
    /// The grid whose nodes it knows.
    #[must_use]
    pub fn grid(&self) -> Grid<D> {
        self.grid
    }

    /// The position, row-major, of the node that `terms` belong to.
    #[inline(always)]
    fn position<T: Real>(&self, terms: &[[T; TERMS]; D]) -> usize {
        let mut position = 0;
        for (axis, [node, ..]) in self.grid.axes.iter().zip(terms) {
            // Not a number counts as 0: what becomes of such a cell is replaced, or was refused.
            position = position * axis.nodes + node.to_f64() as usize;
        }
        position.min(self.centre.len() - 1)
    }
}

impl<const D: usize, const M: usize, const K: usize> Game<D> for ControlAffine<D, M, K> {
    /// The number of the node, not a number elsewhere.
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS] {
        let axis = &self.grid.axes[axis];
        let place = (coordinate - axis.low) / axis.spacing();
        let nodes = axis.nodes as f64;
        let node = match axis.boundary {
            Boundary::Periodic => place.round().rem_euclid(nodes),
            Boundary::Extrapolate => place.round(),
        };
        let known = (place - place.round()).abs() <= MISS && (0.0..nodes).contains(&node);
        [if known { node } else { f64::NAN }, 0.0, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        let position = self.position(terms);
        let along = |column: &[f64; D]| {
            let mut sum = T::ZERO;
            for d in 0..D {
                sum += T::from_f64(column[d]) * gradient[d];
            }
            sum
        };
        let mut rate = along(&self.centre[position]);
        for column in &self.maximiser.columns[position] {
            rate += along(column).abs();
        }
        for column in &self.minimiser.columns[position] {
            rate = rate - along(column).abs();
        }
        rate
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D] {
        let position = self.position(terms);
        let (minimiser, maximiser) =
            (&self.minimiser.columns[position], &self.maximiser.columns[position]);
        // Not a number at what is no node.
        let mut nothing = T::ZERO;
        for [node, ..] in terms {
            nothing += *node * T::ZERO;
        }
        core::array::from_fn(|d| {
            let mut bound = T::from_f64(self.centre[position][d]).abs() + nothing;
            for column in minimiser.iter().chain(maximiser) {
                bound += T::from_f64(column[d]).abs();
            }
            bound
        })
    }
}

impl<const D: usize, const M: usize, const K: usize> Players<D> for ControlAffine<D, M, K> {
    type Minimiser = [f64; M];
    type Maximiser = [f64; K];

    fn optimal_inputs(&self, state: [f64; D], gradient: [f64; D]) -> Inputs<[f64; M], [f64; K]> {
        let factors = |column: [f64; D]| (0..D).map(|d| column[d] * gradient[d]).sum::<f64>();
        let minimiser = self.minimiser.at(&self.grid, state).map(factors);
        let maximiser = self.maximiser.at(&self.grid, state).map(factors);
        Inputs {
            minimiser: core::array::from_fn(|j| least(self.minimiser.range[j], minimiser[j])),
            maximiser: core::array::from_fn(|k| least(self.maximiser.range[k], -maximiser[k])),
        }
    }

    fn velocity(&self, state: [f64; D], inputs: &Inputs<[f64; M], [f64; K]>) -> [f64; D] {
        let mut velocity = self.grid.blend(state, |node| self.centre[node]);
        self.minimiser.push(&self.grid, state, &inputs.minimiser, &mut velocity);
        self.maximiser.push(&self.grid, state, &inputs.maximiser, &mut velocity);
        velocity
    }
}

impl<const D: usize, const N: usize> Player<D, N> {
    /// The columns at a state.
    fn at(&self, grid: &Grid<D>, state: [f64; D]) -> [[f64; D]; N] {
        core::array::from_fn(|n| grid.blend(state, |node| self.columns[node][n]))
    }

    /// Adds to `velocity` what `inputs` do beyond the middles of their ranges.
    fn push(&self, grid: &Grid<D>, state: [f64; D], inputs: &[f64; N], velocity: &mut [f64; D]) {
        for ((column, [low, high]), input) in
            self.at(grid, state).iter().zip(self.range).zip(inputs)
        {
            let half = 0.5 * high - 0.5 * low;
            if half > 0.0 {
                let share = (input - (0.5 * low + 0.5 * high)) / half;
                (0..D).for_each(|d| velocity[d] += share * column[d]);
            }
        }
    }
}

/// Checks a grid, and whether memory suffices for this number of vectors at each node.
fn check_grid<const D: usize>(grid: &Grid<D>, vectors: usize) -> Result<(), Invalid> {
    grid.check(1).map_err(|invalid| invalid.within("grid"))?;
    if let Some(d) = grid.axes.iter().position(|axis| axis.nodes > MOST_NODES) {
        let (field, nodes) = (format!("grid.axes[{d}].nodes"), grid.axes[d].nodes);
        return Err(Invalid::new(field, format!("at most {MOST_NODES}"), nodes));
    }
    check_memory(grid.len(), vectors * D, size_of::<f64>(), MEMORY_LIMIT_BYTES)
}

fn at_nodes<R, const D: usize>(grid: &Grid<D>, function: impl Fn([f64; D]) -> R) -> Vec<R> {
    (0..grid.len()).map(|node| function(grid.node(grid.index(node)))).collect()
}

fn matrices<const D: usize, const N: usize>(
    entries: &[f64],
) -> impl Iterator<Item = [[f64; N]; D]> + '_ {
    (0..entries.len() / (D * N).max(1)).map(move |node| {
        core::array::from_fn(|d| core::array::from_fn(|n| entries[(node * D + d) * N + n]))
    })
}

/// A player, from its matrices at all nodes; `centre` takes what the middles of its ranges do.
fn player<const D: usize, const N: usize>(
    name: &str,
    grid: &Grid<D>,
    centre: &mut [[f64; D]],
    matrices: impl Iterator<Item = [[f64; N]; D]>,
    range: [[f64; 2]; N],
) -> Result<Player<D, N>, Invalid> {
    for (n, [low, high]) in range.into_iter().enumerate() {
        finite(&format!("{name}.range[{n}][0]"), low)?;
        finite(&format!("{name}.range[{n}][1]"), high)?;
        if high < low {
            let expected = format!("{low} or more, the lower end");
            return Err(Invalid::new(format!("{name}.range[{n}][1]"), expected, high));
        }
    }
    let mut columns = Vec::with_capacity(centre.len());
    for (node, (matrix, centre)) in matrices.zip(centre.iter_mut()).enumerate() {
        let mut scaled = [[0.0; D]; N];
        for (n, [low, high]) in range.into_iter().enumerate() {
            for d in 0..D {
                scaled[n][d] = matrix[d][n] * (0.5 * high - 0.5 * low);
                centre[d] += matrix[d][n] * (0.5 * low + 0.5 * high);
            }
        }
        let is_finite = scaled.iter().flatten().chain(centre.iter()).all(|rate| rate.is_finite());
        if !is_finite {
            return Err(not_finite(name, grid, node, &matrix));
        }
        columns.push(scaled);
    }
    // A matrix without columns has no entries to iterate over.
    columns.resize(centre.len(), [[0.0; D]; N]);
    Ok(Player { range, columns })
}

fn not_finite<const D: usize>(
    name: &str,
    grid: &Grid<D>,
    node: usize,
    found: &impl core::fmt::Debug,
) -> Invalid {
    let state = grid.node(grid.index(node));
    Invalid::new(name, "finite rates at every node", format!("{found:?} at {state:?}"))
}
