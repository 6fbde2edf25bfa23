//! The nodes of a sampled value function.

use super::super::grid::{Axis, Boundary, Grid};
use super::super::polar::RangeAxis;
use crate::invalid::Invalid;
use crate::math::TAU;
use serde::{Deserialize, Serialize};

/// The nodes of a sampled value function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "coordinates", rename_all = "lowercase", deny_unknown_fields)]
pub enum Nodes {
    /// Range r = c (eˢ − 1), bearing and relative heading. Both angles have the same nodes, which
    /// cover a full turn from 0.
    Polar {
        /// c (m).
        knee_m: f64,
        /// Range of the last node (m).
        range_m: f64,
        /// Number of nodes of the range axis, including r = 0.
        range_nodes: usize,
        /// Number of nodes in a full turn.
        angle_nodes: usize,
    },
    /// x, y, ψ of the pursuer in the evader's frame.
    Cartesian {
        /// x (m).
        x: Axis,
        /// y (m).
        y: Axis,
        /// ψ (rad): one turn from 0, periodic.
        psi: Axis,
    },
}

impl Nodes {
    /// The number of stored values.
    #[must_use]
    pub fn count(&self) -> usize {
        self.shape().iter().fold(1, |n, m| n.saturating_mul(*m))
    }

    /// The number of stored nodes along each axis. Only bearings in [0, π] are stored.
    #[must_use]
    pub fn shape(&self) -> [usize; 3] {
        match *self {
            Self::Polar { range_nodes, angle_nodes, .. } => {
                [range_nodes, angle_nodes / 2 + 1, angle_nodes]
            }
            Self::Cartesian { x, y, psi } => [x.nodes, y.nodes, psi.nodes],
        }
    }

    /// Coordinates of all stored nodes along each axis.
    #[must_use]
    pub fn coordinates(&self) -> [Vec<f64>; 3] {
        match *self {
            Self::Polar { knee_m, range_m, range_nodes, angle_nodes } => {
                let range = RangeAxis::new(knee_m, range_m, range_nodes);
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

    /// Checks the parameters.
    ///
    /// # Errors
    /// [`Invalid`] naming the parameter.
    pub fn check(&self) -> Result<(), Invalid> {
        match *self {
            Self::Polar { knee_m, range_m, range_nodes, angle_nodes } => {
                crate::invalid::positive("knee_m", knee_m)?;
                crate::invalid::positive("range_m", range_m)?;
                // Outside these limits, no number of nodes suffices, and logarithms lose digits.
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
