//! Interpolation in a three-dimensional table.

/// Number of ghost entries before the first cell and after the last cell of each axis, so that
/// every stencil is within the table.
const BEFORE: usize = 1;
const BEHIND: usize = 2;

/// One number for each of a cell's four edges that are parallel to one axis.
type Four = [f32; 4];

/// The entries along a cell's four edges that are parallel to one axis: before the edges, at their
/// two ends, and after them. The last argument contains the strides of the other axes.
#[inline(always)]
fn edges(values: &[f32], cell: usize, stride: usize, [slow, fast]: [usize; 2]) -> [Four; 4] {
    let mut edges = [[0.0; 4]; 4];
    for (step, edge) in edges.iter_mut().enumerate() {
        let at = cell + step * stride - stride;
        *edge = [values[at], values[at + fast], values[at + slow], values[at + slow + fast]];
    }
    edges
}

/// The curvature along each edge: the minmod of the second differences at its ends.
#[inline(always)]
fn bends([before, from, to, behind]: [Four; 4]) -> Four {
    let mut bends = [0.0; 4];
    for e in 0..4 {
        let rise = to[e] - from[e];
        let low = rise - (from[e] - before[e]);
        let high = (behind[e] - to[e]) - rise;
        let smaller = if low.abs() < high.abs() { low } else { high };
        bends[e] = if low * high > 0.0 { smaller } else { 0.0 };
    }
    bends
}

/// Values on a box of nodes, with ghosts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    /// Number of cells of each axis: one less than the number of nodes, or equal to it if the axis
    /// is periodic.
    cells: [usize; 3],
    strides: [usize; 3],
    values: Vec<f32>,
}

impl Table {
    /// A table with `cells` cells on each axis. `value` gives the entry at any node from −1 to
    /// `cells + 1` on each axis, ghosts included.
    pub(super) fn new(cells: [usize; 3], value: impl Fn([isize; 3]) -> f32) -> Self {
        let padded = cells.map(|n| n + BEFORE + BEHIND);
        let strides = [padded[1] * padded[2], padded[2], 1];
        let mut values = Vec::with_capacity(padded[0] * strides[0]);
        let node = |i: usize| i as isize - BEFORE as isize;
        for i in 0..padded[0] {
            for j in 0..padded[1] {
                for k in 0..padded[2] {
                    values.push(value([node(i), node(j), node(k)]));
                }
            }
        }
        Self { cells, strides, values }
    }

    /// Number of cells of each axis.
    pub(super) fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// The entry at a node, with indices from 0 to `cells`.
    pub(super) fn node(&self, index: [usize; 3]) -> f32 {
        self.values[self.offset(index)]
    }

    fn offset(&self, index: [usize; 3]) -> usize {
        (0..3).map(|d| (index[d] + BEFORE) * self.strides[d]).sum()
    }

    /// The value at position `share` of the edge along axis 2 that begins at `index`. Up to
    /// rounding, it equals [`Table::interpolate`] there.
    pub(super) fn on_edge(&self, index: [usize; 3], share: f64) -> f64 {
        let at = self.offset(index);
        let line = |k: usize| [self.values[at - 1 + k]; 4];
        let edge = [line(0), line(1), line(2), line(3)];
        let (t, bend) = (share as f32, bends(edge)[0]);
        let (from, to) = (edge[1][0], edge[2][0]);
        f64::from((1.0 - t) * from + t * to - 0.5 * t * (1.0 - t) * bend)
    }

    /// The value and its derivatives (per cell) at position `share` (from 0 to 1 along each axis)
    /// of cell `index`.
    ///
    /// Trilinear interpolation, plus a parabola along each axis. The curvature of the parabola is
    /// the smaller of the second differences at both ends of a cell's edge. The interpolant is
    /// third-order accurate where the data are smooth, and it does not overshoot at a single kink.
    /// (It would overshoot between two walls that are one cell apart, but no game of this table has
    /// walls.) The interpolant is continuous, because its values on a face depend only on entries
    /// in the face's plane.
    #[inline(always)]
    pub(super) fn interpolate(&self, index: [usize; 3], share: [f64; 3]) -> (f64, [f64; 3]) {
        let origin = self.offset(index);
        let [s0, s1, s2] = self.strides;
        // One slice for the whole stencil, so that bounds are checked once.
        let values = &self.values[origin - s0..][..3 * s0 + s1 + s2 + 1];
        let here = s0;
        let [t0, t1, t2] = [share[0] as f32, share[1] as f32, share[2] as f32];
        let [u0, u1, u2] = [1.0 - t0, 1.0 - t1, 1.0 - t2];
        let along0 = edges(values, here, s0, [s1, s2]);
        let along1 = edges(values, here, s1, [s0, s2]);
        let along2 = edges(values, here, s2, [s0, s1]);
        let (b0, b1, b2) = (bends(along0), bends(along1), bends(along2));
        // Values at the corners of the cell's two faces perpendicular to axis 0, with the index along
        // axis 2 varying fastest.
        let [_, near, far, _] = along0;
        // Linear along axis 2, then 1, then 0.
        let line = |c: Four| (u2 * c[0] + t2 * c[1], u2 * c[2] + t2 * c[3]);
        let ((l00, l01), (l10, l11)) = (line(near), line(far));
        let (l0, l1) = (u1 * l00 + t1 * l01, u1 * l10 + t1 * l11);
        let linear = u0 * l0 + t0 * l1;
        let d0 = l1 - l0;
        let d1 = u0 * (l01 - l00) + t0 * (l11 - l10);
        let rise = |c: Four| u1 * (c[1] - c[0]) + t1 * (c[3] - c[2]);
        let d2 = u0 * rise(near) + t0 * rise(far);
        // The curvatures, blended over the other two axes, the slower axis first.
        let blend = |b: Four, [us, ts]: [f32; 2], [uf, tf]: [f32; 2]| {
            let (low, high) = (uf * b[0] + tf * b[1], uf * b[2] + tf * b[3]);
            (us * low + ts * high, high - low, us * (b[1] - b[0]) + ts * (b[3] - b[2]))
        };
        let (m0, m0_1, m0_2) = blend(b0, [u1, t1], [u2, t2]);
        let (m1, m1_0, m1_2) = blend(b1, [u0, t0], [u2, t2]);
        let (m2, m2_0, m2_1) = blend(b2, [u0, t0], [u1, t1]);
        let (q0, q1, q2) = (-0.5 * t0 * u0, -0.5 * t1 * u1, -0.5 * t2 * u2);
        (
            f64::from(linear + (q0 * m0 + q1 * m1 + q2 * m2)),
            [
                f64::from(d0 + (t0 - 0.5) * m0 + q1 * m1_0 + q2 * m2_0),
                f64::from(d1 + (t1 - 0.5) * m1 + q0 * m0_1 + q2 * m2_1),
                f64::from(d2 + (t2 - 0.5) * m2 + q0 * m0_2 + q1 * m1_2),
            ],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{SeededRng, sin};

    fn smooth(x: f64, y: f64, z: f64) -> f64 {
        sin(0.3 * x + 0.2) + sin(0.2 * y * x * 0.1 + 0.1 * z) + 0.5 * sin(0.25 * z)
    }

    #[test]
    fn exact_at_nodes_and_for_parabolas() {
        let f = |[i, j, k]: [isize; 3]| (i * i - 2 * j * j + 3 * k * k + i * j * k) as f32;
        let table = Table::new([5, 4, 3], f);
        assert_eq!(table.node([5, 4, 3]), f([5, 4, 3]));
        let mut rng = SeededRng::new(1);
        for _ in 0..200 {
            let index = [rng.below(5), rng.below(4), rng.below(3)];
            let share = [rng.unit(), rng.unit(), rng.unit()];
            let [x, y, z]: [f64; 3] = core::array::from_fn(|d| index[d] as f64 + share[d]);
            let (value, slope) = table.interpolate(index, share);
            assert!((value - (x * x - 2.0 * y * y + 3.0 * z * z + x * y * z)).abs() < 1e-4);
            assert!((slope[0] - (2.0 * x + y * z)).abs() < 1e-4);
            assert!((slope[1] - (-4.0 * y + x * z)).abs() < 1e-4);
            assert!((slope[2] - (6.0 * z + x * y)).abs() < 1e-4);
        }
    }

    #[test]
    fn slopes_are_those_of_the_interpolant_and_faces_join() {
        let table = Table::new([6, 6, 6], |[i, j, k]| smooth(i as f64, j as f64, k as f64) as f32);
        let mut rng = SeededRng::new(2);
        let at = |x: [f64; 3]| {
            let index = x.map(|x| (x as usize).min(5));
            table.interpolate(index, core::array::from_fn(|d| x[d] - index[d] as f64))
        };
        for _ in 0..500 {
            let x: [f64; 3] = core::array::from_fn(|_| rng.uniform(0.01, 5.99));
            let (_, slope) = at(x);
            for d in 0..3 {
                let step = |h: f64| {
                    let mut y = x;
                    y[d] += h;
                    at(y).0
                };
                // The interpolant is a parabola along each axis, so the central difference is its
                // slope, up to f32 rounding.
                if (x[d] - x[d].round()).abs() > 0.1 {
                    assert!(((step(0.1) - step(-0.1)) / 0.2 - slope[d]).abs() < 1e-5);
                }
            }
            let face = [x[0].round().clamp(1.0, 5.0), x[1], x[2]];
            let before = at([face[0] - 1e-9, face[1], face[2]]).0;
            assert!((before - at(face).0).abs() < 1e-6);
        }
    }

    #[test]
    fn an_edge_has_the_values_of_the_cells_around_it() {
        let table = Table::new([6, 6, 6], |[i, j, k]| smooth(i as f64, j as f64, k as f64) as f32);
        for share in [0.0, 0.3, 1.0] {
            let expected = table.interpolate([2, 3, 4], [0.0, 0.0, share]).0;
            assert!((table.on_edge([2, 3, 4], share) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn never_overshoots_a_kink() {
        let table = Table::new([8, 2, 2], |[i, ..]| (i as f32 - 4.0).abs());
        for i in 0..=800 {
            let x = f64::from(i) * 0.01;
            let index = (x as usize).min(7);
            let (value, _) = table.interpolate([index, 0, 0], [x - index as f64, 0.3, 0.7]);
            assert!((value - (x - 4.0).abs()).abs() < 1e-6, "{x}: {value}");
        }
    }
}
