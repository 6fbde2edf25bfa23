//! Finds the cell of a position without logarithms and arc tangents.

use super::Nodes;
use crate::math::{PI, sin_cos};
use crate::reachability::polar::RangeAxis;

/// Finds the cell of a range without a logarithm.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RangeFinder {
    knee_m: f64,
    /// The reciprocal of the logarithmic step.
    per_step: f64,
    nodes_m: Vec<f64>,
    /// For each multiple of the smallest spacing, the cell that contains it.
    cells: Vec<u32>,
    per_metre: f64,
}

impl RangeFinder {
    pub(super) fn new(nodes: &Nodes) -> Self {
        let Nodes::Polar { knee_m, range_m, range_nodes, .. } = *nodes else {
            let (nodes_m, cells) = (Vec::new(), Vec::new());
            return Self { knee_m: 1.0, per_step: 1.0, nodes_m, cells, per_metre: 1.0 };
        };
        let axis = RangeAxis::new(knee_m, range_m, range_nodes);
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

    /// The cell that contains a range, the position of the range in the cell (from 0 to 1), whether
    /// the range is on the axis, and the derivative of the position with respect to the range (per
    /// m; 0 from the last node on).
    pub(super) fn cell(&self, range_m: f64) -> (usize, f64, bool, f64) {
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
        // ln((r + c)/(rᵢ + c)) = 2 artanh(z). The ratio is close to 1, so a few terms suffice for
        // an error of 10⁻¹².
        let z = (range_m - self.nodes_m[cell]) / (range_m + self.knee_m + from);
        let z2 = z * z;
        let ln = 2.0 * z * (1.0 + z2 * (1.0 / 3.0 + z2 * (0.2 + z2 * (1.0 / 7.0 + z2 / 9.0))));
        let share = (ln * self.per_step).min(1.0);
        (cell, share, true, self.per_step / (range_m + self.knee_m))
    }
}

/// Finds angles in the upper half plane without an arc tangent.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BearingFinder {
    /// (cos, sin, angle) of rays that are evenly spread over half a turn.
    rays: Vec<[f64; 3]>,
    /// The nearest ray in the first quadrant, tabulated by y/(|x| + y), which increases with the
    /// angle.
    nearest: Vec<u16>,
}

impl BearingFinder {
    const RAYS: usize = 256;
    const ENTRIES: usize = 512;

    pub(super) fn new() -> Self {
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

    /// atan2(y, x) for y ≥ 0, in [0, π], with an error below 10⁻¹¹; 0 at the origin.
    #[inline]
    pub(super) fn angle(&self, x: f64, y: f64) -> f64 {
        let sum = x.abs() + y;
        if sum == 0.0 {
            return 0.0;
        }
        let nearest = self.nearest[(y / sum * Self::ENTRIES as f64) as usize] as usize;
        let [cos, sin, angle] = self.rays[if x < 0.0 { Self::RAYS - nearest } else { nearest }];
        // The angle from the ray is small, so a few terms suffice.
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
