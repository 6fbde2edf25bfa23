//! Axes and rectangular grids of one to four dimensions.

use crate::invalid::{Invalid, finite};
use serde::{Deserialize, Serialize};

/// The boundary condition of an axis: how values continue beyond its ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Boundary {
    /// The axis wraps around; the upper end is not a node.
    Periodic,
    /// Values are extrapolated linearly with the magnitude of the slope at the edge. The sign is
    /// chosen so that the extrapolated values move away from zero. No false target can then enter
    /// from outside.
    Extrapolate,
    /// Values beyond the edge equal the value at the edge, so a path that leaves the grid keeps the
    /// value of the point where it leaves.
    Constant,
}

/// A uniform axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// First node.
    pub low: f64,
    /// Last node. On a periodic axis, it coincides with the first node and is not stored.
    pub high: f64,
    /// Number of nodes.
    pub nodes: usize,
    /// How values continue beyond the ends.
    pub boundary: Boundary,
}

impl Axis {
    /// An axis with nodes from `low` to `high`, both included. Values are extrapolated beyond the
    /// ends.
    #[must_use]
    pub fn bounded(low: f64, high: f64, nodes: usize) -> Self {
        Self { low, high, nodes, boundary: Boundary::Extrapolate }
    }

    /// Sets [`Self::boundary`], how values continue beyond the ends.
    #[must_use]
    pub fn with_boundary(self, boundary: Boundary) -> Self {
        Self { boundary, ..self }
    }

    /// Whether the axis wraps around, so that it has no ends.
    #[must_use]
    pub fn is_periodic(&self) -> bool {
        self.boundary == Boundary::Periodic
    }

    /// A periodic axis of `nodes` nodes from `low`, without the repeated end point.
    #[must_use]
    pub fn periodic(low: f64, high: f64, nodes: usize) -> Self {
        Self { low, high, nodes, boundary: Boundary::Periodic }
    }

    /// Distance between neighbouring nodes.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        let gaps = if self.is_periodic() { self.nodes } else { self.nodes - 1 };
        (self.high - self.low) / gaps as f64
    }

    /// Coordinate of node `index`; ghost nodes have indices below 0, or `nodes` and above.
    #[must_use]
    pub fn node(&self, index: isize) -> f64 {
        self.low + index as f64 * self.spacing()
    }

    /// Coordinates of all nodes, in order.
    #[must_use]
    pub fn coordinates(&self) -> Vec<f64> {
        (0..self.nodes as isize).map(|i| self.node(i)).collect()
    }

    /// Whether a coordinate is on the axis. Every finite number is on a periodic axis.
    #[must_use]
    pub fn contains(&self, coordinate: f64) -> bool {
        let within = || (self.low..=self.high).contains(&coordinate);
        if self.is_periodic() { coordinate.is_finite() } else { within() }
    }

    fn check(&self, name: &str, reach: usize) -> Result<(), Invalid> {
        finite(&format!("{name}.low"), self.low)?;
        finite(&format!("{name}.high"), self.high)?;
        if self.high <= self.low {
            let expected = format!("above the lower end {}", self.low);
            return Err(Invalid::new(format!("{name}.high"), expected, self.high));
        }
        finite(&format!("{name}.high - {name}.low"), self.high - self.low)?;
        let least = (reach + 1).max(3);
        if self.nodes < least {
            let expected = format!("at least {least} nodes for this scheme");
            return Err(Invalid::new(format!("{name}.nodes"), expected, self.nodes));
        }
        Ok(())
    }
}

/// The product of `D` axes; the last one varies fastest in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid<const D: usize> {
    /// The axes, slowest first.
    pub axes: [Axis; D],
}

impl<const D: usize> Grid<D> {
    /// Number of nodes, or `usize::MAX` if the number overflows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.axes.iter().fold(1, |n, axis| n.saturating_mul(axis.nodes))
    }

    /// Whether there are no nodes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Coordinates of the node at multi-index `index`.
    #[must_use]
    pub fn node(&self, index: [usize; D]) -> [f64; D] {
        core::array::from_fn(|d| self.axes[d].node(index[d] as isize))
    }

    /// The multi-index of the node at `position` in row-major order.
    #[must_use]
    pub fn index(&self, mut position: usize) -> [usize; D] {
        let mut index = [0; D];
        for d in (0..D).rev() {
            index[d] = position % self.axes[d].nodes;
            position /= self.axes[d].nodes;
        }
        index
    }

    /// Checks the ends and the number of nodes of every axis, for a stencil of `reach` nodes to
    /// each side.
    ///
    /// # Errors
    /// [`Invalid`] naming the axis.
    pub fn check(&self, reach: usize) -> Result<(), Invalid> {
        for (d, axis) in self.axes.iter().enumerate() {
            axis.check(&format!("axes[{d}]"), reach)?;
        }
        Ok(())
    }

    /// Whether a state is on the grid.
    #[must_use]
    pub fn contains(&self, state: [f64; D]) -> bool {
        self.axes.iter().zip(state).all(|(axis, coordinate)| axis.contains(coordinate))
    }

    /// Rejects a state that is not on the grid. The error names the coordinate.
    pub(super) fn check_state(&self, state: [f64; D]) -> Result<(), Invalid> {
        for (d, (axis, coordinate)) in self.axes.iter().zip(state).enumerate() {
            if !axis.contains(coordinate) {
                let expected = if axis.is_periodic() {
                    "a finite number".to_owned()
                } else {
                    format!("a number from {} to {}, the ends of the grid", axis.low, axis.high)
                };
                return Err(Invalid::new(format!("state[{d}]"), expected, coordinate));
            }
        }
        Ok(())
    }

    /// The cell that contains a state, as the multi-index of its lowest corner, and the position in
    /// the cell, from 0 to 1 along each axis. A state beyond an end is moved to the end.
    pub(super) fn cell(&self, state: [f64; D]) -> ([usize; D], [f64; D]) {
        let (mut cell, mut share) = ([0; D], [0.0; D]);
        for (d, axis) in self.axes.iter().enumerate() {
            let place = (state[d] - axis.low) / axis.spacing();
            let (place, cells) = if axis.is_periodic() {
                (place.rem_euclid(axis.nodes as f64), axis.nodes)
            } else {
                (place.clamp(0.0, (axis.nodes - 1) as f64), axis.nodes - 1)
            };
            // Rounding can make `place` equal to a whole period.
            cell[d] = (place as usize).min(cells - 1);
            share[d] = place - cell[d] as f64;
        }
        (cell, share)
    }

    /// The row-major position of the node `steps` nodes away from `cell`; `None` beyond an end.
    pub(super) fn neighbour(&self, cell: [usize; D], steps: [isize; D]) -> Option<usize> {
        let mut position = 0;
        for (d, axis) in self.axes.iter().enumerate() {
            let node = cell[d] as isize + steps[d];
            let nodes = axis.nodes as isize;
            let node = if axis.is_periodic() {
                node.rem_euclid(nodes)
            } else {
                Some(node).filter(|node| (0..nodes).contains(node))?
            };
            position = position * axis.nodes + node as usize;
        }
        Some(position)
    }

    /// Interpolates `at_node`, a function of a node's row-major position, multilinearly at a state.
    pub(super) fn blend<const N: usize>(
        &self,
        state: [f64; D],
        at_node: impl Fn(usize) -> [f64; N],
    ) -> [f64; N] {
        let (cell, share) = self.cell(state);
        let mut sum = [0.0; N];
        for corner in 0..1_usize << D {
            let up: [usize; D] = core::array::from_fn(|d| corner >> d & 1);
            let weight: f64 =
                (0..D).map(|d| if up[d] == 1 { share[d] } else { 1.0 - share[d] }).product();
            if let Some(position) = self.neighbour(cell, up.map(|up| up as isize)) {
                let entries = at_node(position);
                (0..N).for_each(|n| sum[n] += weight * entries[n]);
            }
        }
        sum
    }
}
