//! Control-affine games whose number of inputs is known only at run time.

use crate::invalid::{Invalid, all_finite, finite, length};
use crate::reachability::game::{Game, Inputs, Players, TERMS, least};
use crate::reachability::grid::Grid;
use crate::reachability::progress::{MEMORY_LIMIT_BYTES, check_memory};
use crate::real::Real;

/// ẋ = f(x) + G_u(x) u + G_d(x) d from arrays. This is like
/// [`ControlAffine`](super::ControlAffine), which explains the terms, but the number of inputs need
/// not be known at compile time. Use it in programs that load a game.
///
/// ```
/// use sidestep::reachability::{Axis, AffineArrays, Grid, Players};
///
/// // ẋ = v, v̇ = u on 3 × 3 nodes; |u| ≤ 1 m/s².
/// let grid = Grid { axes: [Axis::bounded(-1.0, 1.0, 3), Axis::bounded(-1.0, 1.0, 3)] };
/// let drift: Vec<f64> = (0..9).flat_map(|node| [grid.node(grid.index(node))[1], 0.0]).collect();
/// let game = AffineArrays::new(grid, &drift)?.minimiser(&[0.0, 1.0].repeat(9), &[[-1.0, 1.0]])?;
/// assert_eq!(game.optimal_inputs([0.3, 0.5], [0.0, 2.0]).minimiser, [-1.0]);
/// # Ok::<(), sidestep::invalid::Invalid>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AffineArrays<const D: usize> {
    grid: Grid<D>,
    /// The range of each input.
    minimiser: Vec<[f64; 2]>,
    maximiser: Vec<[f64; 2]>,
    /// For each node: f + G_u (middle of u) + G_d (middle of d), followed by the columns of G_d and
    /// then of G_u, each times half the width of its input's range.
    rates: Vec<[f64; D]>,
}

/// With more nodes than this on an axis, single precision cannot represent every index.
const MOST_NODES: usize = 1 << 24;
/// A coordinate within this fraction of the spacing from a node counts as the node.
const MISS: f64 = 1e-3;

/// The player to whom inputs belong.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Player {
    Minimiser,
    Maximiser,
}

impl Player {
    fn name(self) -> &'static str {
        match self {
            Self::Minimiser => "minimiser",
            Self::Maximiser => "maximiser",
        }
    }
}

impl<const D: usize> AffineArrays<D> {
    /// ẋ = f(x) without players. `drift` is f at each node of `grid`, row-major over nodes and `D`
    /// components.
    ///
    /// # Errors
    /// [`Invalid`] for an invalid or too large grid, a wrong number of entries, or an f that is not
    /// finite.
    pub fn new(grid: Grid<D>, drift: &[f64]) -> Result<Self, Invalid> {
        check_grid(&grid, 1)?;
        length("drift", grid.len() * D, drift.len())?;
        all_finite("drift", drift)?;
        let (rows, _) = drift.as_chunks::<D>();
        Self::of_nodes(grid, rows.to_vec())
    }

    /// Like [`Self::new`], but for a grid that is already checked. `rates` is f at each node.
    pub(super) fn of_nodes(grid: Grid<D>, rates: Vec<[f64; D]>) -> Result<Self, Invalid> {
        for (node, row) in rates.iter().enumerate() {
            if row.iter().any(|rate| !rate.is_finite()) {
                return Err(not_finite("drift", &grid, node, row));
            }
        }
        Ok(Self { grid, minimiser: Vec::new(), maximiser: Vec::new(), rates })
    }

    /// Adds inputs u of the minimising player. `matrix` is G_u at each node, row-major over nodes,
    /// `D` rows and one column per input. `ranges` are the lowest and highest value of each input.
    ///
    /// # Errors
    /// [`Invalid`] for a wrong number of entries, a range or a matrix that is not finite, a range
    /// whose ends are not in order, or a game that needs too much memory.
    pub fn minimiser(self, matrix: &[f64], ranges: &[[f64; 2]]) -> Result<Self, Invalid> {
        self.array(Player::Minimiser, matrix, ranges)
    }

    /// Adds inputs d of the maximising player; see [`Self::minimiser`].
    ///
    /// # Errors
    /// The errors of [`Self::minimiser`].
    pub fn maximiser(self, matrix: &[f64], ranges: &[[f64; 2]]) -> Result<Self, Invalid> {
        self.array(Player::Maximiser, matrix, ranges)
    }

    fn array(self, player: Player, matrix: &[f64], ranges: &[[f64; 2]]) -> Result<Self, Invalid> {
        self.check_room(ranges.len())?;
        let entries = self.grid.len().saturating_mul(D).saturating_mul(ranges.len());
        length(player.name(), entries, matrix.len())?;
        let n = ranges.len();
        self.with(player, ranges, |node, input, d| matrix[(node * D + d) * n + input])
    }

    /// Checks that the memory suffices for this number of additional inputs.
    pub(super) fn check_room(&self, inputs: usize) -> Result<(), Invalid> {
        check_grid(&self.grid, self.stride().saturating_add(inputs))
    }

    /// Adds inputs. `entry` returns the matrix entry of a node, an input and a coordinate.
    pub(super) fn with(
        self,
        player: Player,
        ranges: &[[f64; 2]],
        entry: impl Fn(usize, usize, usize) -> f64,
    ) -> Result<Self, Invalid> {
        let name = player.name();
        for (n, &[low, high]) in ranges.iter().enumerate() {
            finite(&format!("{name}.range[{n}][0]"), low)?;
            finite(&format!("{name}.range[{n}][1]"), high)?;
            if high < low {
                let expected = format!("{low} or more, the lower end");
                return Err(Invalid::new(format!("{name}.range[{n}][1]"), expected, high));
            }
        }
        let mut rates = Vec::with_capacity(self.grid.len() * (self.stride() + ranges.len()));
        for node in 0..self.grid.len() {
            let (mut centre, maximiser, minimiser) = self.at(node);
            let column = |n: usize| core::array::from_fn(|d| entry(node, n, d));
            let mut is_finite = true;
            let mut further = Vec::with_capacity(ranges.len());
            for (n, &[low, high]) in ranges.iter().enumerate() {
                let column: [f64; D] = column(n);
                (0..D).for_each(|d| centre[d] += column[d] * (0.5 * low + 0.5 * high));
                let scaled = column.map(|rate| rate * (0.5 * high - 0.5 * low));
                is_finite &= scaled.iter().chain(&centre).all(|rate| rate.is_finite());
                further.push(scaled);
            }
            if !is_finite {
                let columns: Vec<_> = (0..ranges.len()).map(column).collect();
                return Err(not_finite(name, &self.grid, node, &columns));
            }
            rates.push(centre);
            rates.extend_from_slice(maximiser);
            if player == Player::Maximiser {
                rates.append(&mut further);
            }
            rates.extend_from_slice(minimiser);
            rates.append(&mut further);
        }
        let Self { grid, mut minimiser, mut maximiser, .. } = self;
        match player {
            Player::Minimiser => minimiser.extend_from_slice(ranges),
            Player::Maximiser => maximiser.extend_from_slice(ranges),
        }
        Ok(Self { grid, minimiser, maximiser, rates })
    }

    /// The stored rates, for [`Self::of_rates`]. For each node, they contain ẋ with all inputs in
    /// the middle of their ranges, followed by the effect of half the range of each input: first
    /// the maximiser's inputs, then the minimiser's.
    #[must_use]
    pub fn rates(&self) -> &[[f64; D]] {
        &self.rates
    }

    /// The game with these input ranges and with the rates of [`Self::rates`], row-major.
    ///
    /// # Errors
    /// [`Invalid`] for an invalid grid, a range whose ends are not finite or not in order, a wrong
    /// number of rates, or a rate that is not finite.
    pub fn of_rates(
        grid: Grid<D>,
        minimiser: Vec<[f64; 2]>,
        maximiser: Vec<[f64; 2]>,
        rates: &[f64],
    ) -> Result<Self, Invalid> {
        let stride = 1 + minimiser.len() + maximiser.len();
        check_grid(&grid, stride)?;
        for (name, ranges) in [("minimiser", &minimiser), ("maximiser", &maximiser)] {
            let ordered =
                |[low, high]: &[f64; 2]| low.is_finite() && high.is_finite() && low <= high;
            if let Some(n) = ranges.iter().position(|range| !ordered(range)) {
                let expected = "two finite numbers, the lower one first";
                let found = format!("{:?}", ranges[n]);
                return Err(Invalid::new(format!("{name}.range[{n}]"), expected, found));
            }
        }
        length("rates", grid.len() * stride * D, rates.len())?;
        all_finite("rates", rates)?;
        Ok(Self { grid, minimiser, maximiser, rates: rates.as_chunks::<D>().0.to_vec() })
    }

    /// The grid of the game.
    #[must_use]
    pub fn grid(&self) -> Grid<D> {
        self.grid
    }

    /// The lowest and highest value of each input of the minimising and of the maximising player.
    #[must_use]
    pub fn ranges(&self) -> Inputs<&[[f64; 2]], &[[f64; 2]]> {
        Inputs { minimiser: &self.minimiser, maximiser: &self.maximiser }
    }

    /// Number of vectors per node.
    #[inline(always)]
    fn stride(&self) -> usize {
        1 + self.maximiser.len() + self.minimiser.len()
    }

    /// The rate at a node with all inputs in the middle of their ranges, and the vectors that the
    /// maximiser's and the minimiser's inputs add to it or subtract from it.
    #[inline(always)]
    fn at(&self, node: usize) -> ([f64; D], &[[f64; D]], &[[f64; D]]) {
        let stride = self.stride();
        let [centre, columns @ ..] = &self.rates[node * stride..(node + 1) * stride] else {
            return ([0.0; D], &[], &[]);
        };
        let (maximiser, minimiser) = columns.split_at(self.maximiser.len());
        (*centre, maximiser, minimiser)
    }

    /// The vector at position `place` of the nodes' rates, interpolated at a state.
    fn blend(&self, state: [f64; D], place: usize) -> [f64; D] {
        let stride = self.stride();
        self.grid.blend(state, |node| self.rates[node * stride + place])
    }

    /// The row-major position of the node to which `terms` belong.
    #[inline(always)]
    fn position<T: Real>(&self, terms: &[[T; TERMS]; D]) -> usize {
        let mut position = 0;
        for (axis, [node, ..]) in self.grid.axes.iter().zip(terms) {
            // NaN becomes 0. The result of a cell with NaN is overwritten later, or the solve was
            // already rejected.
            position = position * axis.nodes + node.to_f64() as usize;
        }
        position.min(self.grid.len() - 1)
    }
}

impl<const D: usize> Game<D> for AffineArrays<D> {
    /// The index of the node; NaN between nodes and outside the grid.
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS] {
        let axis = &self.grid.axes[axis];
        let place = (coordinate - axis.low) / axis.spacing();
        let nodes = axis.nodes as f64;
        let node = place.round();
        let node = if axis.is_periodic() { node.rem_euclid(nodes) } else { node };
        let known = (place - place.round()).abs() <= MISS && (0.0..nodes).contains(&node);
        [if known { node } else { f64::NAN }, 0.0, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        let (centre, maximiser, minimiser) = self.at(self.position(terms));
        let along = |column: &[f64; D]| {
            let mut sum = T::ZERO;
            for d in 0..D {
                sum += T::from_f64(column[d]) * gradient[d];
            }
            sum
        };
        let mut rate = along(&centre);
        for column in maximiser {
            rate += along(column).abs();
        }
        for column in minimiser {
            rate = rate - along(column).abs();
        }
        rate
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D] {
        let (centre, maximiser, minimiser) = self.at(self.position(terms));
        // 0 at a node, otherwise NaN.
        let mut nothing = T::ZERO;
        for [node, ..] in terms {
            nothing += *node * T::ZERO;
        }
        core::array::from_fn(|d| {
            let mut bound = T::from_f64(centre[d]).abs() + nothing;
            for column in minimiser.iter().chain(maximiser) {
                bound += T::from_f64(column[d]).abs();
            }
            bound
        })
    }
}

impl<const D: usize> Players<D> for AffineArrays<D> {
    type Minimiser = Vec<f64>;
    type Maximiser = Vec<f64>;

    fn optimal_inputs(&self, state: [f64; D], gradient: [f64; D]) -> Inputs<Vec<f64>, Vec<f64>> {
        let factor = |place: usize| {
            let column = self.blend(state, place);
            (0..D).map(|d| column[d] * gradient[d]).sum::<f64>()
        };
        let first = 1 + self.maximiser.len();
        let minimiser = self.minimiser.iter().enumerate();
        let maximiser = self.maximiser.iter().enumerate();
        Inputs {
            minimiser: minimiser.map(|(j, range)| least(*range, factor(first + j))).collect(),
            maximiser: maximiser.map(|(k, range)| least(*range, -factor(1 + k))).collect(),
        }
    }

    fn velocity(&self, state: [f64; D], inputs: &Inputs<Vec<f64>, Vec<f64>>) -> [f64; D] {
        let mut velocity = self.blend(state, 0);
        let ranges = self.maximiser.iter().chain(&self.minimiser);
        let inputs = inputs.maximiser.iter().chain(&inputs.minimiser);
        for (place, ([low, high], input)) in ranges.zip(inputs).enumerate() {
            let half = 0.5 * high - 0.5 * low;
            if half > 0.0 {
                let (column, share) =
                    (self.blend(state, 1 + place), (input - (0.5 * low + 0.5 * high)) / half);
                (0..D).for_each(|d| velocity[d] += share * column[d]);
            }
        }
        velocity
    }
}

/// Checks a grid, and that the memory suffices for this number of vectors at each node.
pub(super) fn check_grid<const D: usize>(grid: &Grid<D>, vectors: usize) -> Result<(), Invalid> {
    grid.check(1).map_err(|invalid| invalid.within("grid"))?;
    if let Some(d) = grid.axes.iter().position(|axis| axis.nodes > MOST_NODES) {
        let (field, nodes) = (format!("grid.axes[{d}].nodes"), grid.axes[d].nodes);
        return Err(Invalid::new(field, format!("at most {MOST_NODES}"), nodes));
    }
    check_memory(grid.len(), vectors.saturating_mul(D), size_of::<f64>(), MEMORY_LIMIT_BYTES)
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
