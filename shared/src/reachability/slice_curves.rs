//! Level curves of a value function at one heading, for drawing.

use super::contour::{Lattice, closed_curves};
use super::exact::{check_fineness, check_slice};
use super::sampled::{SampledState, SampledValue, Slice};
use super::value_function::ValueFunction;
use crate::invalid::Invalid;
use crate::math::{TAU, hypot, sin_cos};

/// How finely a curve is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct CurveSettings {
    /// For closed forms: largest distance between the curve and an edge of the polygon (m).
    pub flatness_m: f64,
    /// For solved grids: largest distance between neighbouring points (m).
    pub spacing_m: f64,
}

impl Default for CurveSettings {
    fn default() -> Self {
        Self { flatness_m: 0.01, spacing_m: 0.15 }
    }
}

impl CurveSettings {
    /// Sets [`Self::flatness_m`], for closed forms: the largest distance between the curve and an
    /// edge (m).
    #[must_use]
    pub fn with_flatness(self, flatness_m: f64) -> Self {
        Self { flatness_m, ..self }
    }

    /// Sets [`Self::spacing_m`], the largest distance between neighbouring points on a solved grid
    /// (m).
    #[must_use]
    pub fn with_spacing(self, spacing_m: f64) -> Self {
        Self { spacing_m, ..self }
    }
}

impl ValueFunction {
    /// The level set {V = `level`} at relative heading `psi` (rad): closed polygons in the evader's
    /// frame (m), with {V ≤ level} on their left. A set that leaves the grid is closed along the
    /// grid's edge. The result is empty if no state of this heading has V ≤ level.
    ///
    /// # Errors
    /// [`Invalid`] for a `psi` that is not finite, a `level` that no state can have (not finite, or
    /// ≤ −R, where the set is at most the point r = 0), or settings that are not > 0.
    pub fn level_curves(
        &self,
        psi: f64,
        level: f64,
        settings: CurveSettings,
    ) -> Result<Vec<Vec<[f64; 2]>>, Invalid> {
        let mut curves = Vec::new();
        self.level_curves_into(psi, level, settings, &mut curves)?;
        Ok(curves)
    }

    /// Like [`Self::level_curves`], but replaces the contents of `curves`. For a closed form, the
    /// buffers of `curves` are reused.
    ///
    /// # Errors
    /// The errors of [`Self::level_curves`]; `curves` is then empty.
    pub fn level_curves_into(
        &self,
        psi: f64,
        level: f64,
        settings: CurveSettings,
        curves: &mut Vec<Vec<[f64; 2]>>,
    ) -> Result<(), Invalid> {
        if let Err(invalid) = self.check_curve(psi, level, settings) {
            curves.clear();
            return Err(invalid);
        }
        match self {
            Self::Exact(exact) => {
                curves.resize_with(1, Vec::new);
                let drawn = exact.level_curve_into(psi, level, settings.flatness_m, &mut curves[0]);
                if drawn.is_err() {
                    curves.clear();
                }
                drawn
            }
            Self::Sampled(sampled) => {
                let lattice = SliceLattice::new(sampled, psi, level);
                *curves = closed_curves(&lattice);
                if curves.is_empty() {
                    *curves = between_nodes(&lattice);
                }
                for curve in curves {
                    *curve = smoothed(curve, sampled, psi, level, settings);
                }
                Ok(())
            }
        }
    }

    fn check_curve(&self, psi: f64, level: f64, settings: CurveSettings) -> Result<(), Invalid> {
        check_slice(psi, level, self.game().radius_m)?;
        check_fineness("flatness_m", settings.flatness_m)?;
        check_fineness("spacing_m", settings.spacing_m)
    }
}

/// The nodes of one heading, surrounded by a ring of nodes that count as outside the set.
struct SliceLattice<'a> {
    function: &'a SampledValue,
    slice: Slice<'a>,
    psi: f64,
    level: f64,
    /// Coordinates of the nodes along both indices: ranges and bearings, or x and y.
    axes: [Vec<f64>; 2],
    polar: bool,
    values: Vec<f64>,
}

impl<'a> SliceLattice<'a> {
    fn new(function: &'a SampledValue, psi: f64, level: f64) -> Self {
        let slice = function.slice(psi);
        let [rows, columns] = slice.size();
        let [first, second, _] = function.nodes().coordinates();
        let polar = slice.is_polar();
        let second = if polar {
            (0..columns).map(|j| TAU * j as f64 / columns as f64).collect()
        } else {
            second
        };
        let mut lattice =
            Self { function, slice, psi, level, axes: [first, second], polar, values: Vec::new() };
        lattice.values = (0..rows * columns)
            .map(|n| {
                let node = [n / columns, n % columns];
                let [x, y] = lattice.point(node);
                let range = if polar { lattice.axes[0][node[0]] } else { hypot(x, y) };
                lattice.slice.value(node, range)
            })
            .collect();
        lattice
    }

    /// Number of ring nodes before the first grid node along each index.
    fn ring(&self) -> [usize; 2] {
        if self.polar { [0, 0] } else { [1, 1] }
    }

    /// The grid node nearest to a lattice node, and whether the lattice node is itself a grid node.
    fn node(&self, lattice: [usize; 2]) -> ([usize; 2], bool) {
        let size = self.slice.size();
        let ring = self.ring();
        let node = core::array::from_fn(|d| lattice[d].saturating_sub(ring[d]).min(size[d] - 1));
        let real = (0..2).all(|d| node[d] + ring[d] == lattice[d]);
        (node, real)
    }

    fn point(&self, [i, j]: [usize; 2]) -> [f64; 2] {
        let (first, second) = (self.axes[0][i], self.axes[1][j]);
        if self.polar {
            let (sin, cos) = sin_cos(second);
            [first * cos, first * sin]
        } else {
            [first, second]
        }
    }

    fn excess_at(&self, [x, y]: [f64; 2]) -> f64 {
        self.function.state([x, y, self.psi]).value - self.level
    }
}

impl Lattice for SliceLattice<'_> {
    fn size(&self) -> [usize; 2] {
        let [rows, columns] = self.slice.size();
        if self.polar { [rows + 1, columns] } else { [rows + 2, columns + 2] }
    }

    fn wraps(&self) -> bool {
        self.polar
    }

    fn inside(&self, lattice: [usize; 2]) -> bool {
        let ([i, j], real) = self.node(lattice);
        real && self.values[i * self.slice.size()[1] + j] <= self.level
    }

    fn joins(&self, [i, j]: [usize; 2]) -> bool {
        let columns = self.size()[1];
        let corners = [[i, j], [i + 1, (j + 1) % columns]].map(|n| self.point(self.node(n).0));
        let middle = [0, 1].map(|d| 0.5 * (corners[0][d] + corners[1][d]));
        self.excess_at(middle) <= 0.0
    }

    fn crossing(&self, inside: [usize; 2], outside: [usize; 2]) -> [f64; 2] {
        let ((from, _), (to, real)) = (self.node(inside), self.node(outside));
        let columns = self.slice.size()[1];
        let [a, b] = [from, to].map(|node| self.point(node));
        if !real {
            return a;
        }
        let [mut low, mut high] =
            [from, to].map(|[i, j]| self.values[i * columns + j] - self.level);
        let (mut s, mut t) = (0.0, 1.0);
        let mut point = a;
        // Regula falsi converges fast, because the function is nearly linear between two nodes.
        for _ in 0..3 {
            let share = if high > low { s - low * (t - s) / (high - low) } else { s };
            point = [0, 1].map(|d| a[d] + share * (b[d] - a[d]));
            let excess = self.excess_at(point);
            if excess.abs() < 1e-4 * self.function.game().length_unit_m() {
                break;
            }
            if excess <= 0.0 {
                (s, low) = (share, excess);
            } else {
                (t, high) = (share, excess);
            }
        }
        point
    }
}

/// The curves of a set that contains no node of the grid. The set surrounds range zero, where V is
/// smallest.
fn between_nodes(slice: &SliceLattice<'_>) -> Vec<Vec<[f64; 2]>> {
    let is_in = |point| slice.excess_at(point) <= 0.0;
    if slice.polar || !is_in([0.0; 2]) {
        return Vec::new();
    }
    let spacings = slice.axes.iter().map(|axis| axis[1] - axis[0]);
    let mut spacing_m = spacings.fold(0.0, f64::max) / SPOT_NODES as f64;
    // If the set contains only a few of the fine nodes, it is sampled again with a smaller spacing.
    for _ in 0..MOST_LOOKS {
        let spot = Spot { slice, spacing_m };
        let nodes = (0..SPOT_SIDE * SPOT_SIDE).map(|n| [n / SPOT_SIDE, n % SPOT_SIDE]);
        if nodes.filter(|&node| spot.inside(node)).count() > SPOT_SIDE {
            return closed_curves(&spot);
        }
        spacing_m *= 0.25;
    }
    Vec::new()
}

/// Number of nodes of a [`Spot`] per spacing of the grid, before any refinement.
const SPOT_NODES: usize = 16;
/// Number of nodes along each side of a [`Spot`]. It extends by two grid spacings in each
/// direction, plus a ring of nodes.
const SPOT_SIDE: usize = 2 * (2 * SPOT_NODES + 1) + 1;
/// Maximum number of times that the set is sampled. They suffice to find a set as small as a
/// millionth of a spacing.
const MOST_LOOKS: usize = 10;

/// A fine lattice around range zero, surrounded by a ring of nodes that count as outside the set.
struct Spot<'a> {
    slice: &'a SliceLattice<'a>,
    spacing_m: f64,
}

impl Spot<'_> {
    fn point(&self, node: [usize; 2]) -> [f64; 2] {
        node.map(|i| (i as f64 - (SPOT_SIDE / 2) as f64) * self.spacing_m)
    }
}

impl Lattice for Spot<'_> {
    fn size(&self) -> [usize; 2] {
        [SPOT_SIDE; 2]
    }

    fn wraps(&self) -> bool {
        false
    }

    fn inside(&self, node: [usize; 2]) -> bool {
        let is_inner = node.iter().all(|i| (1..SPOT_SIDE - 1).contains(i));
        is_inner && self.slice.excess_at(self.point(node)) <= 0.0
    }

    fn joins(&self, node: [usize; 2]) -> bool {
        let middle = self.point(node).map(|corner| corner + 0.5 * self.spacing_m);
        self.slice.excess_at(middle) <= 0.0
    }

    fn crossing(&self, inside: [usize; 2], outside: [usize; 2]) -> [f64; 2] {
        let (mut a, mut b) = (self.point(inside), self.point(outside));
        for _ in 0..30 {
            let middle = [0, 1].map(|d| 0.5 * (a[d] + b[d]));
            if self.slice.excess_at(middle) <= 0.0 { a = middle } else { b = middle }
        }
        a
    }
}

/// Refines a curve. Adds points between its points and moves them onto the level along the
/// gradient. Also adds the sharp corners between nodes.
fn smoothed(
    curve: &[[f64; 2]],
    function: &SampledValue,
    psi: f64,
    level: f64,
    settings: CurveSettings,
) -> Vec<[f64; 2]> {
    let on_level_m = ON_LEVEL_M * function.game().length_unit_m();
    let state = |[x, y]: [f64; 2]| function.state([x, y, psi]);
    let states: Vec<_> = curve.iter().map(|point| state(*point)).collect();
    let mut smooth = Vec::with_capacity(3 * curve.len());
    for i in 0..curve.len() {
        let next = (i + 1) % curve.len();
        smooth.push(curve[i]);
        // Where the grid ends inside the set, the curve follows the grid's edge.
        let on_level = |state: &SampledState| (state.value - level).abs() < on_level_m;
        let pieces = Pieces { spacing_m: settings.spacing_m, level };
        if !on_level(&states[i]) || !on_level(&states[next]) {
            pieces.add(&mut smooth, curve[i], curve[next], |_| None);
            continue;
        }
        let tip = tip([curve[i], curve[next]], [&states[i], &states[next]]);
        // The tangents meet near the corner, but not exactly at it. So the tip is moved onto the
        // level along the line from the chord's middle. The tip is a corner if V there is much
        // closer to the level than V at the chord's middle.
        let miss = |point: [f64; 2]| state(point).value - level;
        let middle = [0, 1].map(|d| 0.5 * (curve[i][d] + curve[next][d]));
        let from = miss(middle);
        let tip = tip.map(|tip| {
            let change = miss(tip) - from;
            let share = if change == 0.0 { 1.0 } else { (-from / change).clamp(0.0, 1.5) };
            [0, 1].map(|d| middle[d] + share * (tip[d] - middle[d]))
        });
        match tip.filter(|tip| miss(*tip).abs() < 0.5 * from.abs()) {
            Some(tip) => {
                pieces.add(&mut smooth, curve[i], tip, |point| Some(state(point)));
                smooth.push(tip);
                pieces.add(&mut smooth, tip, curve[next], |point| Some(state(point)));
            }
            None => pieces.add(&mut smooth, curve[i], curve[next], |point| Some(state(point))),
        }
    }
    smooth
}

/// At the points of a curve, V differs from the level by less than this (m, for a radius of about
/// 3 m), unless the point is on the grid's edge.
const ON_LEVEL_M: f64 = 0.02;

/// The point where the tangents at both ends of a chord meet, if the chord cuts off a corner of the
/// curve. This is the case if the tangents differ by more than a sixth of a right angle and meet
/// near the chord.
fn tip(ends: [[f64; 2]; 2], states: [&SampledState; 2]) -> Option<[f64; 2]> {
    let [[ax, ay, _], [bx, by, _]] = states.map(|state| state.gradient);
    let (turn, along) = (ax * by - ay * bx, ax * bx + ay * by);
    if turn.abs() < 0.26 * along.abs() {
        return None;
    }
    // gᵢ · (p − pᵢ) = 0 at both ends.
    let (a, b) = (ax * ends[0][0] + ay * ends[0][1], bx * ends[1][0] + by * ends[1][1]);
    let tip = [(a * by - b * ay) / turn, (ax * b - bx * a) / turn];
    let chord = hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
    let near = ends.iter().all(|end| hypot(tip[0] - end[0], tip[1] - end[1]) < 1.5 * chord);
    near.then_some(tip)
}

/// How a chord is divided.
struct Pieces {
    spacing_m: f64,
    level: f64,
}

impl Pieces {
    /// Adds points between `from` and `to`. If `state` returns a state, a point is moved onto the
    /// level along the gradient.
    fn add(
        &self,
        curve: &mut Vec<[f64; 2]>,
        from: [f64; 2],
        to: [f64; 2],
        state: impl Fn([f64; 2]) -> Option<SampledState>,
    ) {
        let length = hypot(to[0] - from[0], to[1] - from[1]);
        let pieces = ((length / self.spacing_m).ceil() as usize).clamp(1, 4);
        for piece in 1..pieces {
            let share = piece as f64 / pieces as f64;
            let mut point = [0, 1].map(|d| from[d] + share * (to[d] - from[d]));
            if let Some(state) = state(point) {
                let [gx, gy, _] = state.gradient;
                let excess = state.value - self.level;
                let steepness = gx * gx + gy * gy;
                // A longer step occurs only at a kink, where the chord is the best approximation.
                if excess.abs() < 0.5 * length * steepness.sqrt() {
                    let step = excess / steepness;
                    point = [point[0] - step * gx, point[1] - step * gy];
                }
            }
            curve.push(point);
        }
    }
}
