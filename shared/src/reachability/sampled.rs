//! A value function on the nodes of a solved grid.

mod finders;
mod nodes;
mod sheet;
mod slice;
mod volume;

pub use nodes::Nodes;
pub(super) use slice::Slice;

use super::cartesian;
use super::grid::Axis;
use super::polar;
use super::pursuit::PursuitGame;
use super::table::Table;
use crate::invalid::Invalid;
use crate::math::{TAU, hypot, sin_cos, wrap_positive};
use crate::real::Real;
use finders::{BearingFinder, RangeFinder};
use sheet::Sheet;

/// A value function on a grid, interpolated between its nodes and extended beyond them.
///
/// The table stores the deficit W = V − (r − R); r − R is added exactly. Outside the grid, the
/// deficit equals the deficit at the nearest point of the grid's boundary (in polar coordinates, at
/// the same bearing and heading), so that V increases with the range.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledValue {
    game: PursuitGame,
    nodes: Nodes,
    /// The horizon (s); infinite for the converged value.
    horizon_s: f64,
    /// See [`SampledValue::unsettled_m`].
    unsettled_m: Option<f64>,
    table: Table,
    sheet: Option<Sheet>,
    /// Finds the cell of a range, for polar nodes.
    finder: RangeFinder,
    bearings: BearingFinder,
}

/// Value, gradient, and whether the state is within the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SampledState {
    /// V (m).
    pub value: f64,
    /// (∂V/∂x, ∂V/∂y, ∂V/∂ψ) of the interpolant, in (m/m, m/m, m/rad); one-sided on the faces of
    /// cells.
    pub gradient: [f64; 3],
    /// Whether the state is within the grid.
    pub inside: bool,
}

impl SampledValue {
    /// Creates a value function from its deficit, row-major over [`Nodes::shape`]. For polar nodes,
    /// `sheet` can be Q of [`polar::Solution::sheet`]. It must be `None` for Cartesian nodes.
    ///
    /// # Errors
    /// [`Invalid`] for an invalid game, nodes or horizon, a wrong number of values, a value that is
    /// not finite, or a sheet with Cartesian nodes.
    pub fn new(
        game: PursuitGame,
        nodes: Nodes,
        horizon_s: f64,
        deficit: &[f32],
        sheet: Option<&[f32]>,
    ) -> Result<Self, Invalid> {
        game.check()?;
        nodes.check()?;
        if horizon_s.is_nan() || horizon_s <= 0.0 {
            return Err(Invalid::new("horizon_s", "a number > 0, or inf", horizon_s));
        }
        crate::invalid::length("value", nodes.count(), deficit.len())?;
        if let Some((i, bad)) = deficit.iter().enumerate().find(|(_, w)| !w.is_finite()) {
            return Err(Invalid::new(format!("value[{i}]"), "a finite number", bad));
        }
        let [n0, n1, n2] = nodes.shape();
        let stored = |i: usize, j: usize, k: usize| deficit[(i * n1 + j) * n2 + k];
        let turn = |k: isize, n: usize| k.rem_euclid(n as isize) as usize;
        let table = match nodes {
            Nodes::Polar { angle_nodes: n, .. } => {
                Table::new([n0 - 1, n / 2, n], |[i, j, k]| {
                    // W is mirrored at bearings 0 and π, constant beyond the last range, and odd
                    // about r = 0, where it is 0.
                    let mirrored = j < 0 || j > n as isize / 2;
                    let (j, k) = if mirrored {
                        (turn(-j, n), turn(-k, n))
                    } else {
                        (j as usize, turn(k, n))
                    };
                    if i < 0 {
                        -stored(-i as usize, j, k)
                    } else {
                        stored((i as usize).min(n0 - 1), j, k)
                    }
                })
            }
            Nodes::Cartesian { .. } => Table::new([n0 - 1, n1 - 1, n2], |[i, j, k]| {
                let k = turn(k, n2);
                // W continues linearly beyond the ends, so there is no curvature in the last cells.
                let along = |i: isize, n: usize| {
                    let last = n as isize - 1;
                    let inner = i.clamp(0, last);
                    (inner as usize, (inner - (i - inner).signum()) as usize, (i - inner).abs())
                };
                let (i0, i1, gi) = along(i, n0);
                let (j0, j1, gj) = along(j, n1);
                let base = stored(i0, j0, k);
                base + (base - stored(i1, j0, k)) * if gi > 0 { gi as f32 } else { 0.0 }
                    + (base - stored(i0, j1, k)) * if gj > 0 { gj as f32 } else { 0.0 }
            }),
        };
        let sheet = match (nodes, sheet) {
            (_, None) => None,
            (Nodes::Cartesian { .. }, Some(_)) => {
                return Err(Invalid::new("sheet", "none with cartesian nodes", "one"));
            }
            (Nodes::Polar { angle_nodes: n, .. }, Some(sheet)) => {
                crate::invalid::length("sheet", n0 * n * n, sheet.len())?;
                if let Some((i, bad)) = sheet.iter().enumerate().find(|(_, w)| !w.is_finite()) {
                    return Err(Invalid::new(format!("sheet[{i}]"), "a finite number", bad));
                }
                let full = Table::new([n0 - 1, n, n], |[i, j, k]| {
                    let at = |i: usize| sheet[(i * n + turn(j, n)) * n + turn(k, n)];
                    if i < 0 { -at(-i as usize) } else { at((i as usize).min(n0 - 1)) }
                });
                Some(Sheet::new(table.cells(), full))
            }
        };
        let finder = RangeFinder::new(&nodes);
        let bearings = BearingFinder::new();
        Ok(Self { game, nodes, horizon_s, unsettled_m: None, table, sheet, finder, bearings })
    }

    /// Creates a value function from samples of `value` on the nodes. The value of a game is at
    /// most r − R. Larger samples are stored, but [`Self::state`] returns r − R for them.
    ///
    /// # Errors
    /// The errors of [`SampledValue::new`].
    pub fn sampled(
        game: PursuitGame,
        nodes: Nodes,
        value: impl Fn([f64; 3]) -> f64,
    ) -> Result<Self, Invalid> {
        nodes.check()?;
        let [first, second, third] = nodes.coordinates();
        let mut deficit = Vec::with_capacity(nodes.count());
        for a in &first {
            for b in &second {
                for c in &third {
                    let state = match nodes {
                        Nodes::Polar { .. } => {
                            let (sin, cos) = sin_cos(*b);
                            [a * cos, a * sin, *c]
                        }
                        Nodes::Cartesian { .. } => [*a, *b, *c],
                    };
                    deficit.push((value(state) - game.target(state)) as f32);
                }
            }
        }
        Self::new(game, nodes, f64::INFINITY, &deficit, None)
    }

    /// The value function of a polar solution.
    ///
    /// # Errors
    /// [`Invalid`] if a value is not finite.
    pub fn from_polar(game: PursuitGame, solution: &polar::Solution<f32>) -> Result<Self, Invalid> {
        let range = solution.range;
        let nodes = Nodes::Polar {
            knee_m: range.knee_m,
            range_m: solution.range_m,
            range_nodes: range.nodes,
            angle_nodes: solution.angle_nodes,
        };
        let sheet = Some(&solution.sheet[..]);
        let function = Self::new(game, nodes, solution.horizon_s, &solution.deficit, sheet)?;
        Ok(function.unsettled((!solution.converged).then_some(solution.drift_m)))
    }

    /// How much the function was still changing (m) when the solver stopped without converging;
    /// `None` if it converged or the horizon is finite. This is not a bound on the error
    /// ([`ValueFunction::unsettled_m`](super::ValueFunction::unsettled_m)). For the polar method,
    /// it is the change over [`polar::WINDOW`] sweeps, averaged over the rows. For the Cartesian
    /// method, it is the largest change in a second of the game.
    #[must_use]
    pub fn unsettled_m(&self) -> Option<f64> {
        self.unsettled_m
    }

    /// Sets [`Self::unsettled_m`] (m). JSON has no infinity, so the largest finite number replaces
    /// infinity.
    #[must_use]
    pub fn unsettled(self, unsettled_m: Option<f64>) -> Self {
        Self { unsettled_m: unsettled_m.map(|moved| moved.min(f64::MAX)), ..self }
    }

    /// The value function of a Cartesian solution on a grid of x, y, ψ.
    ///
    /// # Errors
    /// [`Invalid`] if a value is not finite, or the axes of the grid are not x, y and ψ.
    pub fn from_cartesian<T: Real>(
        game: PursuitGame,
        horizon_s: f64,
        solution: &cartesian::Solution<T, 3>,
    ) -> Result<Self, Invalid> {
        let [x, y, psi] = solution.grid.axes;
        let deficit: Vec<f32> = solution
            .values
            .iter()
            .enumerate()
            .map(|(i, v)| {
                let state = solution.grid.node(solution.grid.index(i));
                (v.to_f64() - game.target(state)) as f32
            })
            .collect();
        Self::new(game, Nodes::Cartesian { x, y, psi }, horizon_s, &deficit, None)
    }

    /// The game.
    #[must_use]
    pub fn game(&self) -> PursuitGame {
        self.game
    }

    /// The nodes.
    #[must_use]
    pub fn nodes(&self) -> Nodes {
        self.nodes
    }

    /// The horizon (s); infinite for the converged value.
    #[must_use]
    pub fn horizon_s(&self) -> f64 {
        self.horizon_s
    }

    /// The stored deficits, row-major over [`Nodes::shape`].
    pub fn deficit(&self) -> impl Iterator<Item = f32> + '_ {
        let [n0, n1, n2] = self.nodes.shape();
        (0..n0 * n1 * n2).map(move |p| self.table.node([p / (n1 * n2), p / n2 % n1, p % n2]))
    }

    /// A box that contains every node with V ≤ `level`, as the lowest x, the highest x and the
    /// largest |y| (m). The box is widened by one cell, but does not extend beyond the grid. For
    /// Cartesian nodes only.
    pub(super) fn extent(&self, level: f64) -> [f64; 3] {
        let Nodes::Cartesian { x, y, .. } = self.nodes else {
            unreachable!("a draft has Cartesian nodes");
        };
        let [rows, columns, headings] = self.nodes.shape();
        let mut found = [0.0, 0.0, 0.0_f64];
        for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
            let [at_x, at_y] = [x.node(i as isize), y.node(j as isize)];
            let margin = self.game.target([at_x, at_y, 0.0]);
            let low = |k: usize| margin + f64::from(self.table.node([i, j, k])) <= level;
            if (0..headings).any(low) {
                let [low, high, side] = found;
                found = [low.min(at_x), high.max(at_x), side.max(at_y.abs())];
            }
        }
        let [low, high, side] = found;
        [
            (low - x.spacing()).max(x.low),
            (high + x.spacing()).min(x.high),
            (side + y.spacing()).min(y.high),
        ]
    }

    /// The stored sheet, row-major over range, bearing (a full turn) and heading.
    pub fn sheet(&self) -> Option<impl Iterator<Item = f32> + '_> {
        let [n0, _, n] = self.nodes.shape();
        let table = &self.sheet.as_ref()?.table;
        Some((0..n0 * n * n).map(move |p| table.node([p / (n * n), p / n % n, p % n])))
    }

    /// The deficit and its derivatives (per cell) at position `share` of cell `index`.
    #[inline]
    fn deficit_at(&self, index: [usize; 3], share: [f64; 3]) -> (f64, [f64; 3]) {
        let cells = self.table.cells();
        match &self.sheet {
            Some(sheet) if sheet.is_kinked(cells, index) => {
                let right = sheet.table.interpolate(index, share);
                let [i, j, k] = index;
                let mirror = [i, 2 * cells[1] - 1 - j, cells[2] - 1 - k];
                let [t0, t1, t2] = share;
                let left = sheet.table.interpolate(mirror, [t0, 1.0 - t1, 1.0 - t2]);
                if right.0 >= left.0 {
                    right
                } else {
                    let [s0, s1, s2] = left.1;
                    (left.0, [s0, -s1, -s2])
                }
            }
            _ => self.table.interpolate(index, share),
        }
    }

    /// V, its gradient, and whether the grid contains the state. The state is the pursuer's pose in
    /// the evader's frame.
    #[must_use]
    pub fn state(&self, [x, y, psi]: [f64; 3]) -> SampledState {
        let range = hypot(x, y);
        let (index, share, inside, scale) = match self.nodes {
            Nodes::Polar { angle_nodes, .. } => {
                let per_angle = angle_nodes as f64 / TAU;
                let bearing = self.bearings.angle(x, y.abs());
                let heading = wrap_positive(if y < 0.0 { -psi } else { psi });
                let (i, t0, inside, s0) = self.finder.cell(range);
                let (j, t1) = split(bearing * per_angle, angle_nodes / 2);
                let (k, t2) = split(heading * per_angle, angle_nodes);
                ([i, j, k], [t0, t1, t2], inside, [s0, per_angle, per_angle])
            }
            Nodes::Cartesian { x: ax, y: ay, psi: ap } => {
                let along = |axis: Axis, at: f64| {
                    let inside = at >= axis.low && at <= axis.high;
                    let per = 1.0 / axis.spacing();
                    let (i, t) =
                        split((at.clamp(axis.low, axis.high) - axis.low) * per, axis.nodes - 1);
                    (i, t, inside, if inside { per } else { 0.0 })
                };
                let (i, t0, in_x, s0) = along(ax, x);
                let (j, t1, in_y, s1) = along(ay, y);
                let per_angle = ap.nodes as f64 / TAU;
                let (k, t2) = split(wrap_positive(psi) * per_angle, ap.nodes);
                ([i, j, k], [t0, t1, t2], in_x && in_y, [s0, s1, per_angle])
            }
        };
        let (deficit, slope) = self.deficit_at(index, share);
        let [w0, w1, w2]: [f64; 3] = core::array::from_fn(|d| slope[d] * scale[d]);
        let radius_m = self.game.radius_m;
        // Between nodes, the interpolation error along the range axis can make V < −R. At a kink,
        // where a sheet continues one side, the deficit can be positive. Both values are clamped,
        // and NaN is preserved.
        let value = range - radius_m + if deficit > 0.0 { 0.0 } else { deficit };
        let value = if value < -radius_m { -radius_m } else { value };
        // Unit vector of the line of sight; straight ahead at range zero.
        let (cos, sin) = if range > 0.0 { (x / range, y / range) } else { (1.0, 0.0) };
        let gradient = match self.nodes {
            Nodes::Polar { .. } => {
                let mirror = if y < 0.0 { -1.0 } else { 1.0 };
                let radial = 1.0 + w0;
                let around = if range > 0.0 { mirror * w1 / range } else { 0.0 };
                [cos * radial - sin * around, sin * radial + cos * around, mirror * w2]
            }
            Nodes::Cartesian { .. } => [cos + w0, sin + w1, w2],
        };
        SampledState { value, gradient, inside }
    }
}

/// The cell of a position and the fractional position in it. Positions are in cells, from 0 to
/// `cells`.
fn split(position: f64, cells: usize) -> (usize, f64) {
    let cell = (position as usize).min(cells - 1);
    (cell, position - cell as f64)
}
