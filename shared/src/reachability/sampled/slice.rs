//! The nodes of one heading, for drawing.

use super::{Nodes, SampledValue, split};
use crate::math::{TAU, wrap_positive};

impl SampledValue {
    /// The slice at heading `psi`, for drawing. The cell that contains the heading is found only
    /// once for all nodes.
    pub(in super::super) fn slice(&self, psi: f64) -> Slice<'_> {
        let n = self.nodes.shape()[2];
        let (k, share) = split(wrap_positive(psi) * n as f64 / TAU, n);
        let (mirrored, mirrored_share) = split(wrap_positive(-psi) * n as f64 / TAU, n);
        Slice { function: self, heading: [(k, share), (mirrored, mirrored_share)] }
    }
}

/// All nodes of one heading.
pub(in super::super) struct Slice<'a> {
    function: &'a SampledValue,
    /// Cell and fractional position of ψ and of −ψ. Nodes with bearings above π use −ψ.
    heading: [(usize, f64); 2],
}

impl Slice<'_> {
    /// The number of nodes along the two axes in the plane. In polar coordinates, the second axis
    /// is a full turn of bearings.
    pub(in super::super) fn size(&self) -> [usize; 2] {
        match self.function.nodes {
            Nodes::Polar { range_nodes, angle_nodes, .. } => [range_nodes, angle_nodes],
            Nodes::Cartesian { x, y, .. } => [x.nodes, y.nodes],
        }
    }

    /// Whether the nodes are ranges and bearings.
    pub(in super::super) fn is_polar(&self) -> bool {
        matches!(self.function.nodes, Nodes::Polar { .. })
    }

    /// V at a node of the slice whose range is `range_m`.
    pub(in super::super) fn value(&self, [i, j]: [usize; 2], range_m: f64) -> f64 {
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
