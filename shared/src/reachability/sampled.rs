//! A value function that a solver left on a grid.

use super::grid::{Axis, Boundary, Grid};
use super::polar::{self, RangeAxis};
use super::pursuit::PursuitGame;
use super::table::Table;
use crate::invalid::Invalid;
use crate::math::{PI, TAU, hypot, sin_cos, wrap_positive};
use serde::{Deserialize, Serialize};

/// The nodes of a sampled value function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "coordinates", rename_all = "lowercase", deny_unknown_fields)]
pub enum Nodes {
    /// Range r = c (eˢ − 1), bearing, relative heading; both angles have the same
    /// nodes, from 0 over a full turn.
    Polar {
        /// c, m.
        knee_m: f64,
        /// Last range, m.
        range_m: f64,
        /// Nodes of the range axis, r = 0 included.
        range_nodes: usize,
        /// Nodes of a full turn.
        angle_nodes: usize,
    },
    /// x, y, ψ of the pursuer in the evader's frame.
    Cartesian {
        /// x, m.
        x: Axis,
        /// y, m.
        y: Axis,
        /// ψ, rad: one turn from 0, periodic.
        psi: Axis,
    },
}

impl Nodes {
    fn range_axis(knee_m: f64, range_m: f64, range_nodes: usize) -> RangeAxis {
        RangeAxis::new(knee_m, range_m, range_nodes)
    }

    /// How many values are stored.
    #[must_use]
    pub fn count(&self) -> usize {
        self.shape().iter().fold(1, |n, m| n.saturating_mul(*m))
    }

    /// Stored nodes by axis: of the bearings only those in [0, π].
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        match *self {
            Self::Polar { range_nodes, angle_nodes, .. } => {
                [range_nodes, angle_nodes / 2 + 1, angle_nodes]
            }
            Self::Cartesian { x, y, psi } => [x.nodes, y.nodes, psi.nodes],
        }
    }

    /// Coordinates of all stored nodes by axis.
    #[must_use]
    pub fn coordinates(&self) -> [Vec<f64>; 3] {
        match *self {
            Self::Polar { knee_m, range_m, range_nodes, angle_nodes } => {
                let range = Self::range_axis(knee_m, range_m, range_nodes);
                let angle = |j: usize| TAU * j as f64 / angle_nodes as f64;
                [
                    (0..range_nodes).map(|i| range.node(i)).collect(),
                    (0..=angle_nodes / 2).map(angle).collect(),
                    (0..angle_nodes).map(angle).collect(),
                ]
            }
            Self::Cartesian { x, y, psi } => [x, y, psi].map(|axis| axis.coordinates()),
        }
    }

    /// Checks that these can be nodes.
    ///
    /// # Errors
    /// [`Invalid`] naming the parameter.
    pub fn check(&self) -> Result<(), Invalid> {
        match *self {
            Self::Polar { knee_m, range_m, range_nodes, angle_nodes } => {
                crate::invalid::positive("knee_m", knee_m)?;
                crate::invalid::positive("range_m", range_m)?;
                // Beyond, no number of nodes would do, and their logarithms lose digits.
                let ratio = range_m / knee_m;
                if !(1e-3..=1e6).contains(&ratio) {
                    let expected = format!("between 0.001 and 10⁶ times {knee_m} m");
                    return Err(Invalid::new("range_m", expected, range_m));
                }
                if !(9..=1 << 16).contains(&range_nodes) {
                    return Err(Invalid::new("range_nodes", "9 to 65536", range_nodes));
                }
                if !(4..=1 << 16).contains(&angle_nodes) || !angle_nodes.is_multiple_of(2) {
                    let expected = "an even number, 4 to 65536";
                    return Err(Invalid::new("angle_nodes", expected, angle_nodes));
                }
            }
            Self::Cartesian { x, y, psi } => {
                for (name, axis, boundary) in [
                    ("x", x, Boundary::Extrapolate),
                    ("y", y, Boundary::Extrapolate),
                    ("psi", psi, Boundary::Periodic),
                ] {
                    Grid { axes: [axis] }.check(2).map_err(|e| {
                        let field = e.field.replace("axes[0]", name);
                        Invalid { field, ..e }
                    })?;
                    if axis.boundary != boundary || axis.nodes > 1 << 16 {
                        let expected = format!("{boundary:?}, at most 65536 nodes");
                        return Err(Invalid::new(name, expected, format!("{axis:?}")));
                    }
                }
                if psi.low != 0.0 || (psi.high - TAU).abs() > 1e-9 {
                    return Err(Invalid::new("psi", "from 0 to 2π", format!("{psi:?}")));
                }
            }
        }
        Ok(())
    }
}

/// A value function on a grid, and between and beyond its nodes.
///
/// What is stored is the deficit W = V − (r − R), and the range part is added
/// exactly. Outside the grid the deficit is that of the nearest point of its boundary
/// (in polar coordinates: at the same bearing and heading), so that V grows with the
/// range as it must.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledValue {
    game: PursuitGame,
    nodes: Nodes,
    /// Seconds of the game that are solved; infinite for the converged value.
    horizon_s: f64,
    table: Table,
    sheet: Option<Sheet>,
    /// For polar nodes, to find the cell of a range.
    finder: RangeFinder,
    bearings: BearingFinder,
}

/// V = max(Q(α, ψ), Q(−α, −ψ)) near the surface where the evader may turn either way:
/// between nodes the two smooth sides keep the kink sharp that one table would cut off.
#[derive(Clone, Debug, PartialEq)]
struct Sheet {
    /// Deficits of Q; the bearings are a full turn.
    table: Table,
    /// A bit for each cell of the half turn: whether the kink runs through it or a
    /// neighbour.
    kinked: Vec<u64>,
}

impl Sheet {
    fn new(cells: [usize; 3], table: Table) -> Self {
        let [n0, n1, n2] = cells;
        let crosses = |[i, j, k]: [usize; 3]| {
            let (mut right, mut left) = (false, false);
            for corner in 0..8 {
                let [i, j, k] = [i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1)];
                let a = table.node([i, j, k]);
                let b = table.node([i, 2 * n1 - j, n2 - k]);
                right |= a > b;
                left |= b > a;
            }
            right && left
        };
        let mut kinked = vec![0; (n0 * n1 * n2).div_ceil(64)];
        for cell in 0..n0 * n1 * n2 {
            let [i, j, k] = [cell / (n1 * n2), cell / n2 % n1, cell % n2];
            if !crosses([i, j, k]) {
                continue;
            }
            // The neighbours too: beyond them no stencil sees both sides, and one table
            // and two give the same value on the face between.
            for i in i.saturating_sub(1)..=(i + 1).min(n0 - 1) {
                for j in -1..=1 {
                    for k in [k + n2 - 1, k, k + 1] {
                        let (j, k) = match j + (cell / n2 % n1) as isize {
                            // Through the mirror at bearings 0 and π.
                            j if j < 0 || j == n1 as isize => {
                                (j.clamp(0, n1 as isize - 1) as usize, 2 * n2 - 1 - k % n2)
                            }
                            j => (j as usize, k),
                        };
                        let bit = (i * n1 + j) * n2 + k % n2;
                        kinked[bit / 64] |= 1 << (bit % 64);
                    }
                }
            }
        }
        Self { table, kinked }
    }

    fn is_kinked(&self, [_, n1, n2]: [usize; 3], [i, j, k]: [usize; 3]) -> bool {
        let cell = (i * n1 + j) * n2 + k;
        self.kinked[cell / 64] >> (cell % 64) & 1 == 1
    }
}

/// Value, gradient, and whether the state lies on the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledState {
    /// V, m.
    pub value: f64,
    /// (∂V/∂x, ∂V/∂y, ∂V/∂ψ), m/m, m/m, m/rad: of the interpolant, so one-sided on
    /// the faces of cells.
    pub gradient: [f64; 3],
    /// Whether the state is within the nodes.
    pub inside: bool,
}

impl SampledValue {
    /// A value function from its deficit, row-major over [`Nodes::shape`], and, of
    /// polar nodes, the sheet Q of [`polar::Solution::sheet`] if there is one.
    ///
    /// # Errors
    /// [`Invalid`] for bad nodes, another number of values, or one that is not finite.
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
                    // Mirror at bearings 0 and π; flat beyond the last range; odd
                    // about r = 0, where W is 0.
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
                // Linear beyond the ends: no bend in the last cells.
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
        Ok(Self { game, nodes, horizon_s, table, sheet, finder, bearings })
    }

    /// A function sampled on nodes.
    ///
    /// # Errors
    /// As [`SampledValue::new`].
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

    /// What the polar solver found.
    ///
    /// # Errors
    /// [`Invalid`] if it is not finite.
    pub fn from_polar(game: PursuitGame, solution: &polar::Solution<f32>) -> Result<Self, Invalid> {
        let range = solution.range;
        let nodes = Nodes::Polar {
            knee_m: range.knee_m,
            range_m: solution.range_m,
            range_nodes: range.nodes,
            angle_nodes: solution.angle_nodes,
        };
        Self::new(game, nodes, f64::INFINITY, &solution.deficit, Some(&solution.sheet))
    }

    /// What the Cartesian solver found on a grid of x, y, ψ.
    ///
    /// # Errors
    /// [`Invalid`] if it is not finite, or the grid is none of x, y, ψ.
    pub fn from_cartesian<T: super::Real>(
        game: PursuitGame,
        horizon_s: f64,
        solution: &super::cartesian::Solution<T, 3>,
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

    /// Seconds of the game that are solved; infinite for the converged value.
    #[must_use]
    pub fn horizon_s(&self) -> f64 {
        self.horizon_s
    }

    /// The stored deficits, row-major over [`Nodes::shape`].
    pub fn deficit(&self) -> impl Iterator<Item = f32> + '_ {
        let [n0, n1, n2] = self.nodes.shape();
        (0..n0 * n1 * n2).map(move |p| self.table.node([p / (n1 * n2), p / n2 % n1, p % n2]))
    }

    /// The stored sheet, row-major over range, bearing (a full turn) and heading.
    pub fn sheet(&self) -> Option<impl Iterator<Item = f32> + '_> {
        let [n0, _, n] = self.nodes.shape();
        let table = &self.sheet.as_ref()?.table;
        Some((0..n0 * n * n).map(move |p| table.node([p / (n * n), p / n % n, p % n])))
    }

    /// Deficit and its slopes, per cell, at a place of the table.
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

    /// V, gradient and coverage at the pursuer's pose in the evader's frame.
    #[must_use]
    pub fn state(&self, [x, y, psi]: [f64; 3]) -> SampledState {
        let range = (x * x + y * y).sqrt();
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
        let value = range - self.game.radius_m + deficit;
        // Unit vector of the line of sight; ahead where there is none.
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

    /// Volume of {V ≤ 0} over the nodes' domain, m²·rad.
    ///
    /// Along the first axis the ends of the set are found between the nodes; the
    /// other two are summed, which is accurate for sets that end inside the domain.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let [n0, n1, n2] = self.nodes.shape();
        let [first, second, third] = self.nodes.coordinates();
        let mut volume = 0.0;
        for (j, b) in second.iter().enumerate() {
            for k in 0..n2 {
                let range = |a: f64| match self.nodes {
                    Nodes::Polar { .. } => a,
                    Nodes::Cartesian { .. } => hypot(a, *b),
                };
                let (cell, share) =
                    if j == self.table.cells()[1] { (j - 1, 1.0) } else { (j, 0.0) };
                let value = |i: usize, t: f64| {
                    let at = first[i] + t * (first[i + 1] - first[i]);
                    let (deficit, _) = self.deficit_at([i, cell, k], [t, share, 0.0]);
                    (at, range(at) - self.game.radius_m + deficit)
                };
                // ∫ da, or ∫ r dr, over the parts where V ≤ 0.
                let upto = |a: f64| match self.nodes {
                    Nodes::Polar { .. } => 0.5 * a * a,
                    Nodes::Cartesian { .. } => a,
                };
                let mut line = 0.0;
                for i in 0..n0 - 1 {
                    let (low, high) = (value(i, 0.0), value(i, 1.0));
                    if low.1 > 0.0 && high.1 > 0.0 {
                        continue;
                    }
                    let pieces = if low.1 <= 0.0 && high.1 <= 0.0 { 1 } else { PIECES };
                    let mut from = low;
                    for piece in 1..=pieces {
                        let to = value(i, f64::from(piece) / f64::from(pieces));
                        let end = || from.0 + (to.0 - from.0) * from.1 / (from.1 - to.1);
                        line += match (from.1 <= 0.0, to.1 <= 0.0) {
                            (true, true) => upto(to.0) - upto(from.0),
                            (true, false) => upto(end()) - upto(from.0),
                            (false, true) => upto(to.0) - upto(end()),
                            (false, false) => 0.0,
                        };
                        from = to;
                    }
                }
                // Bearings strictly between 0 and π stand for their mirror images too.
                let weight = match self.nodes {
                    Nodes::Polar { .. } if j > 0 && j + 1 < n1 => 2.0,
                    _ => 1.0,
                };
                volume += weight * line;
            }
        }
        let angle = third[1] - third[0];
        volume * angle * (second[1] - second[0])
    }

    /// V at a node of the heading axis of the table and of the two others; for
    /// drawing slices without looking anything up.
    pub(super) fn slice(&self, psi: f64) -> Slice<'_> {
        let n = self.nodes.shape()[2];
        let (k, share) = split(wrap_positive(psi) * n as f64 / TAU, n);
        let (mirrored, mirrored_share) = split(wrap_positive(-psi) * n as f64 / TAU, n);
        Slice { function: self, heading: [(k, share), (mirrored, mirrored_share)] }
    }
}

/// All nodes of one heading.
pub(super) struct Slice<'a> {
    function: &'a SampledValue,
    /// Cell and share of ψ, and of −ψ for bearings below 0.
    heading: [(usize, f64); 2],
}

impl Slice<'_> {
    /// Nodes of the two axes in the plane; the second one is a full turn of
    /// bearings in polar coordinates.
    pub(super) fn size(&self) -> [usize; 2] {
        match self.function.nodes {
            Nodes::Polar { range_nodes, angle_nodes, .. } => [range_nodes, angle_nodes],
            Nodes::Cartesian { x, y, .. } => [x.nodes, y.nodes],
        }
    }

    /// Whether the nodes are ranges and bearings.
    pub(super) fn is_polar(&self) -> bool {
        matches!(self.function.nodes, Nodes::Polar { .. })
    }

    /// V at a node of the slice whose range is `range_m`.
    pub(super) fn value(&self, [i, j]: [usize; 2], range_m: f64) -> f64 {
        let f = self.function;
        let (j, (k, share)) = match f.nodes {
            Nodes::Polar { angle_nodes, .. } if j > angle_nodes / 2 => {
                (angle_nodes - j, self.heading[1])
            }
            _ => (j, self.heading[0]),
        };
        let cells = f.table.cells();
        let [cell_i, cell_j] = [i.min(cells[0] - 1), j.min(cells[1] - 1)];
        let deficit = match &f.sheet {
            Some(sheet) if sheet.is_kinked(cells, [cell_i, cell_j, k]) => {
                let mirror = [i, 2 * cells[1] - j, cells[2] - 1 - k];
                let right = sheet.table.on_edge([i, j, k], share);
                right.max(sheet.table.on_edge(mirror, 1.0 - share))
            }
            _ => f.table.on_edge([i, j, k], share),
        };
        deficit + range_m - f.game.radius_m
    }
}

/// Cell and share of a position in units of cells, 0 … `cells`.
fn split(position: f64, cells: usize) -> (usize, f64) {
    let cell = (position as usize).min(cells - 1);
    (cell, position - cell as f64)
}

/// Pieces of a cell in which an end of the set is looked for.
const PIECES: u32 = 8;

/// From a range to its cell without a logarithm.
#[derive(Clone, Debug, PartialEq)]
struct RangeFinder {
    knee_m: f64,
    /// One over the logarithmic step.
    per_step: f64,
    nodes_m: Vec<f64>,
    /// Cell of every multiple of the smallest spacing.
    cells: Vec<u32>,
    per_metre: f64,
}

impl RangeFinder {
    fn new(nodes: &Nodes) -> Self {
        let Nodes::Polar { knee_m, range_m, range_nodes, .. } = *nodes else {
            let (nodes_m, cells) = (Vec::new(), Vec::new());
            return Self { knee_m: 1.0, per_step: 1.0, nodes_m, cells, per_metre: 1.0 };
        };
        let axis = Nodes::range_axis(knee_m, range_m, range_nodes);
        let nodes_m: Vec<f64> = (0..range_nodes).map(|i| axis.node(i)).collect();
        let per_metre = 1.0 / nodes_m[1];
        let last = nodes_m[range_nodes - 1];
        let count = ((last * per_metre) as usize + 2).min(1 << 20);
        let mut cells = Vec::with_capacity(count);
        let mut cell = 0;
        for i in 0..count {
            while cell + 2 < range_nodes && nodes_m[cell + 1] <= i as f64 / per_metre {
                cell += 1;
            }
            cells.push(cell as u32);
        }
        Self { knee_m, per_step: 1.0 / axis.step, nodes_m, cells, per_metre }
    }

    /// Cell, share, whether it is inside, and d(position)/d(range).
    fn cell(&self, range_m: f64) -> (usize, f64, bool, f64) {
        let last = self.nodes_m.len() - 1;
        if range_m >= self.nodes_m[last] {
            let inside = range_m <= self.nodes_m[last];
            return (last - 1, 1.0, inside, 0.0);
        }
        let guess = ((range_m * self.per_metre) as usize).min(self.cells.len() - 1);
        let mut cell = self.cells[guess] as usize;
        while cell + 1 < last && self.nodes_m[cell + 1] <= range_m {
            cell += 1;
        }
        let from = self.nodes_m[cell] + self.knee_m;
        // ln((r + c)/(rᵢ + c)) as 2 artanh(z): the ratio is close to 1, so a few
        // terms reach 10⁻¹².
        let z = (range_m - self.nodes_m[cell]) / (range_m + self.knee_m + from);
        let z2 = z * z;
        let ln = 2.0 * z * (1.0 + z2 * (1.0 / 3.0 + z2 * (0.2 + z2 * (1.0 / 7.0 + z2 / 9.0))));
        let share = (ln * self.per_step).min(1.0);
        (cell, share, true, self.per_step / (range_m + self.knee_m))
    }
}

/// Angles of the upper half plane without an arc tangent.
#[derive(Clone, Debug, PartialEq)]
struct BearingFinder {
    /// (cos, sin, angle) of rays half a turn round.
    rays: Vec<[f64; 3]>,
    /// By y/(|x| + y), which grows with the angle in each quadrant: the nearest ray in the
    /// first quadrant.
    nearest: Vec<u16>,
}

impl BearingFinder {
    const RAYS: usize = 256;
    const ENTRIES: usize = 512;

    fn new() -> Self {
        let ray = |i: usize| {
            let angle = PI * i as f64 / Self::RAYS as f64;
            let (sin, cos) = sin_cos(angle);
            [cos, sin, angle]
        };
        let nearest = |i: usize| {
            let share = (i as f64 + 0.5) / Self::ENTRIES as f64;
            let angle = crate::math::atan2(share, 1.0 - share);
            (angle * Self::RAYS as f64 / PI).round() as u16
        };
        Self {
            rays: (0..=Self::RAYS).map(ray).collect(),
            nearest: (0..=Self::ENTRIES).map(|i| nearest(i.min(Self::ENTRIES - 1))).collect(),
        }
    }

    /// atan2(y, x) for y ≥ 0, in [0, π], to 10⁻¹¹; 0 at the origin.
    #[inline]
    fn angle(&self, x: f64, y: f64) -> f64 {
        let sum = x.abs() + y;
        if sum == 0.0 {
            return 0.0;
        }
        let nearest = self.nearest[(y / sum * Self::ENTRIES as f64) as usize] as usize;
        let [cos, sin, angle] = self.rays[if x < 0.0 { Self::RAYS - nearest } else { nearest }];
        // Turned onto the ray, what is left is small.
        let t = (y * cos - x * sin) / (x * cos + y * sin);
        let t2 = t * t;
        (angle + t * (1.0 - t2 * (1.0 / 3.0 - 0.2 * t2))).clamp(0.0, PI)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{SeededRng, atan2};

    #[test]
    fn angles_are_those_of_the_arc_tangent() {
        let finder = BearingFinder::new();
        let mut rng = SeededRng::new(9);
        let mut worst = 0.0_f64;
        for _ in 0..100_000 {
            let (x, y) = (rng.uniform(-1.0, 1.0), rng.unit());
            worst = worst.max((finder.angle(x, y) - atan2(y, x)).abs());
        }
        assert!(worst < 1e-11, "{worst:e}");
        assert_eq!(finder.angle(0.0, 0.0), 0.0);
        assert_eq!(finder.angle(-1.0, 0.0), PI);
    }
}
