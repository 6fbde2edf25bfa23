//! The sheet Q of a polar value function, which keeps the kink of V sharp.

use super::super::table::Table;

/// Near the surface where left and right turns are equally good for the evader, V = max(Q(α, ψ),
/// Q(−α, −ψ)). Interpolating the two smooth functions keeps the kink sharp between nodes.
/// Interpolating V itself would cut it off.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sheet {
    /// Deficits of Q over a full turn of bearings.
    pub(super) table: Table,
    /// One bit for each cell of the half turn: whether the kink passes through the cell or a
    /// neighbour.
    kinked: Vec<u64>,
}

impl Sheet {
    pub(super) fn new(cells: [usize; 3], table: Table) -> Self {
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
            // The neighbours are marked too. Beyond them, no stencil contains both sides of the
            // kink. On the face between a marked and an unmarked cell, interpolating V and
            // interpolating the two sheets therefore give the same value.
            for i in i.saturating_sub(1)..=(i + 1).min(n0 - 1) {
                for j in -1..=1 {
                    for k in [k + n2 - 1, k, k + 1] {
                        let (j, k) = match j + (cell / n2 % n1) as isize {
                            // Mirrored at bearings 0 and π.
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

    pub(super) fn is_kinked(&self, [_, n1, n2]: [usize; 3], [i, j, k]: [usize; 3]) -> bool {
        let cell = (i * n1 + j) * n2 + k;
        self.kinked[cell / 64] >> (cell % 64) & 1 == 1
    }
}
