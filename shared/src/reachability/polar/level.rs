//! One grid of a polar solve: its rows with their ghosts, and its initial values from a coarser
//! grid.

use super::super::pursuit::PursuitGame;
use super::range::RangeAxis;
use crate::math::{TAU, sin_cos};
use crate::real::Real;

/// Number of ghost entries at each end of a row, so that shifted reads stay within the row.
pub(super) const PAD: usize = 2;

/// The turns that the evader can choose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Evader {
    /// All turns. The value is symmetric, so only half a turn of bearings is solved.
    Free,
    /// Only turn rates a ≥ 0, until the evader can keep the range from decreasing. There is no
    /// symmetry, so a full turn of bearings is solved.
    Right,
}

/// The memory layout of a grid's values. A *slab* contains all rows of one range, and a row
/// contains all headings of one bearing.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub(super) evader: Evader,
    pub(super) angle_nodes: usize,
    /// Number of rows in a slab, including `PAD` mirrored or repeated rows at each end.
    rows: usize,
    /// Number of entries in a row: one turn, and `PAD` repeated entries at each end.
    pub(super) row: usize,
}

impl Shape {
    fn new(evader: Evader, angle_nodes: usize) -> Self {
        let bearings = match evader {
            Evader::Free => angle_nodes / 2 + 1,
            Evader::Right => angle_nodes,
        };
        Self { evader, angle_nodes, rows: bearings + 2 * PAD, row: angle_nodes + 2 * PAD }
    }

    pub(super) fn bearings(self) -> usize {
        self.rows - 2 * PAD
    }

    /// Number of entries in a slab.
    pub(super) fn slab(self) -> usize {
        self.rows * self.row
    }

    /// Start of the slab of range node `i`.
    pub(super) fn at_range(self, i: usize) -> usize {
        (i + PAD) * self.slab()
    }

    /// Start of the row of bearing node `k` in its slab.
    pub(super) fn at_bearing(self, k: usize) -> usize {
        (k + PAD) * self.row
    }

    /// Copies row `k` of a slab to its ghosts. They are periodic in heading. In bearing, they are
    /// mirrored, or periodic for [`Evader::Right`].
    #[inline(always)]
    pub(super) fn spread<T: Real>(self, slab: &mut [T], k: usize) {
        let (n, last) = (self.angle_nodes, self.bearings() - 1);
        let at = self.at_bearing(k);
        let row = &mut slab[at..at + self.row];
        row.copy_within(n..n + PAD, 0);
        row.copy_within(PAD..2 * PAD, n + PAD);
        if self.evader == Evader::Right {
            let turn = self.bearings() * self.row;
            if k < PAD {
                slab.copy_within(at..at + self.row, at + turn);
            } else if k > last - PAD {
                slab.copy_within(at..at + self.row, at - turn);
            }
        }
        let mirrored = if self.evader == Evader::Right {
            None
        } else if (1..=PAD).contains(&k) {
            Some(at - 2 * k * self.row)
        } else if k < last && last - k <= PAD {
            Some(at + 2 * (last - k) * self.row)
        } else {
            None
        };
        if let Some(ghost) = mirrored {
            for j in 0..self.row {
                // The mirror image has the opposite heading.
                let source = at + PAD + (2 * n + PAD - j) % n;
                slab[ghost + j] = slab[source];
            }
        }
    }
}

/// One grid being solved.
pub(super) struct Level<T> {
    pub(super) game: PursuitGame,
    pub(super) shape: Shape,
    pub(super) range: RangeAxis,
    pub(super) range_m: f64,
    pub(super) values: Vec<T>,
    /// Largest change of each row at its last update.
    pub(super) activity: Vec<T>,
    /// Signed change of each row since the last measurement, summed over its cells.
    pub(super) drift: Vec<T>,
    /// Sines of the angles j·2π/`angle_nodes`. The next field contains their cosines.
    pub(super) sin: Vec<T>,
    pub(super) cos: Vec<T>,
    /// The ranges of the nodes (m).
    pub(super) ranges: Vec<f64>,
    pub(super) sweeps: usize,
    pub(super) drift_m: f64,
    pub(super) converged: bool,
}

impl<T: Real> Level<T> {
    pub(super) fn new(
        game: &PursuitGame,
        range_m: f64,
        range_nodes: usize,
        angle_nodes: usize,
        evader: Evader,
    ) -> Self {
        let shape = Shape::new(evader, angle_nodes);
        let bearings = shape.bearings();
        let trig = |f: fn((f64, f64)) -> f64| -> Vec<T> {
            let angle = |j: usize| TAU * j as f64 / angle_nodes as f64;
            (0..angle_nodes).map(|j| T::from_f64(f(sin_cos(angle(j))))).collect()
        };
        let range = RangeAxis::new(game.radius_m, range_m, range_nodes);
        Self {
            game: *game,
            shape,
            range,
            range_m,
            ranges: (0..range_nodes).map(|i| range.node(i)).collect(),
            drift: vec![T::ZERO; range_nodes * bearings],
            // Two ghost ranges beyond each end.
            values: vec![T::ZERO; (range_nodes + 2 * PAD) * shape.slab()],
            activity: vec![T::from_f64(f64::MAX); range_nodes * bearings],
            sin: trig(|(sin, _)| sin),
            cos: trig(|(_, cos)| cos),
            sweeps: 0,
            drift_m: f64::INFINITY,
            converged: false,
        }
    }

    /// Start of the row of range node `i` and bearing node `k`.
    pub(super) fn at(&self, i: usize, k: usize) -> usize {
        self.shape.at_range(i) + self.shape.at_bearing(k)
    }

    pub(super) fn bearings(&self) -> usize {
        self.shape.bearings()
    }

    /// The rows of range node `i`.
    pub(super) fn slab(&self, i: usize) -> &[T] {
        &self.values[self.shape.at_range(i)..][..self.shape.slab()]
    }

    /// Interpolates the initial values linearly from a grid with about half as many nodes on each
    /// axis.
    pub(super) fn start_from(&mut self, coarse: &Self) {
        let angles = self.shape.angle_nodes;
        for i in 1..self.range.nodes {
            let position = coarse.range.position(self.ranges[i]);
            let low = (position as usize).min(coarse.range.nodes - 2);
            let share = T::from_f64((position - low as f64).clamp(0.0, 1.0));
            for k in 0..self.bearings() {
                let to = self.at(i, k);
                for j in 0..angles {
                    let mut sum = T::ZERO;
                    for (range, weight) in [(low, T::from_f64(1.0) - share), (low + 1, share)] {
                        for bearing in [k / 2, k.div_ceil(2)] {
                            for heading in [j / 2, j.div_ceil(2) % coarse.shape.angle_nodes] {
                                let from = coarse.at(range, bearing) + PAD + heading;
                                sum += weight * coarse.values[from];
                            }
                        }
                    }
                    self.values[to + PAD + j] = sum * T::from_f64(0.25);
                }
            }
        }
        for i in 0..self.range.nodes {
            for k in 0..self.bearings() {
                self.spread(i, k);
            }
        }
    }

    /// Copies a row to its periodic and mirrored ghosts, and to its ghosts beyond the last range.
    pub(super) fn spread(&mut self, i: usize, k: usize) {
        let (shape, start) = (self.shape, self.shape.at_range(i));
        shape.spread(&mut self.values[start..start + shape.slab()], k);
        if i == self.range.nodes - 1 {
            // Beyond the last range the deficit is constant.
            let at = self.at(i, k);
            for ghost in 1..=PAD {
                self.values.copy_within(at..at + shape.row, at + ghost * shape.slab());
            }
        }
    }

    /// Writes W at bearing node `k` to `row`. For the full game, only half a turn of bearings is
    /// stored.
    #[inline(always)]
    pub(super) fn copy_row(&self, i: usize, k: usize, row: &mut [T]) {
        let n = self.shape.angle_nodes;
        if k <= n / 2 {
            row.copy_from_slice(&self.values[self.at(i, k) + PAD..][..n]);
        } else {
            // Heading j is heading n − j of the mirror image. The mirrored row is therefore read
            // backwards, starting with the ghost that repeats its first entry.
            let mirrored = &self.values[self.at(i, n - k) + PAD + 1..][..n];
            for (to, from) in row.iter_mut().zip(mirrored.iter().rev()) {
                *to = *from;
            }
        }
    }

    /// A copy of the entries without the ghosts.
    pub(super) fn inside(&self) -> Vec<T> {
        let mut values =
            Vec::with_capacity(self.range.nodes * self.bearings() * self.shape.angle_nodes);
        for i in 0..self.range.nodes {
            for k in 0..self.bearings() {
                let at = self.at(i, k) + PAD;
                values.extend_from_slice(&self.values[at..at + self.shape.angle_nodes]);
            }
        }
        values
    }
}
