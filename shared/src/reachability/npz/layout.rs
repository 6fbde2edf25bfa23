//! The nodes of a file, and the order in which it stores their values.

use crate::invalid::{Invalid, length};
use crate::reachability::{Nodes, PursuitGame};

/// The nodes of a file, and the order in which it stores their values.
pub struct Layout {
    nodes: Nodes,
    /// The number of nodes along each axis.
    pub shape: [usize; 3],
    /// The node coordinates along each axis.
    pub axes: [Vec<f64>; 3],
}

impl Layout {
    /// The layout of a file with these nodes.
    #[must_use]
    pub fn new(nodes: Nodes) -> Self {
        let [first, second, third] = nodes.coordinates();
        let second = match nodes {
            // A full turn of bearings has the same nodes as the headings.
            Nodes::Polar { .. } => third.clone(),
            Nodes::Cartesian { .. } => second,
        };
        let axes = [first, second, third];
        Self { nodes, shape: shape(&nodes), axes }
    }

    /// The range margin r − R at a node (m).
    #[must_use]
    pub fn margin(&self, game: &PursuitGame, [i, j, k]: [usize; 3]) -> f64 {
        match self.nodes {
            Nodes::Polar { .. } => self.axes[0][i] - game.radius_m,
            Nodes::Cartesian { .. } => {
                game.target([self.axes[0][i], self.axes[1][j], self.axes[2][k]])
            }
        }
    }

    /// Maps a node to the stored node with the same value. This is the node itself, or its mirror
    /// image if the bearing is above π.
    #[must_use]
    pub fn kept(&self, [i, j, k]: [usize; 3]) -> [usize; 3] {
        match self.nodes {
            Nodes::Polar { angle_nodes: n, .. } if j > n / 2 => [i, n - j, (n - k) % n],
            _ => [i, j, k],
        }
    }

    /// The node at a position in the array.
    #[must_use]
    pub fn index(&self, position: usize) -> [usize; 3] {
        let [_, n1, n2] = self.shape;
        [position / (n1 * n2), position / n2 % n1, position % n2]
    }

    /// The position of a node in the array.
    #[must_use]
    pub fn position(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.shape[1] + j) * self.shape[2] + k
    }
}

/// The number of a file's nodes along each axis. Bearings cover a full turn.
#[must_use]
pub fn shape(nodes: &Nodes) -> [usize; 3] {
    match *nodes {
        Nodes::Polar { range_nodes, angle_nodes, .. } => [range_nodes, angle_nodes, angle_nodes],
        Nodes::Cartesian { .. } => nodes.shape(),
    }
}

/// Checks an array of node coordinates or instants against the values that follow from `meta`.
///
/// # Errors
/// [`Invalid`] if the lengths differ, or if an element differs. The error names the first such
/// element.
pub fn check_axis(name: &str, expected: &[f64], found: &[f64]) -> Result<(), Invalid> {
    length(name, expected.len(), found.len())?;
    let largest = expected.iter().fold(1.0, |most: f64, number| most.max(number.abs()));
    // A comparison with NaN is false, so NaN always differs.
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * largest;
    match expected.iter().zip(found).position(|pair| !close(pair)) {
        None => Ok(()),
        Some(i) => {
            let said = format!("{}, as meta says", expected[i]);
            Err(Invalid::new(format!("{name}[{i}]"), said, found[i]))
        }
    }
}
