//! How fast states move, and how early they can leave the grid.

use super::super::game::TERMS;
use super::super::grid::{Axis, Grid};
use crate::invalid::Invalid;

/// The speed bounds of a game on a grid.
pub(super) struct Speeds<const D: usize> {
    /// max over the nodes of Σ speed_d/Δx_d, the reciprocal of the largest stable time step.
    pub(super) rate: f64,
    /// For each axis d and each of its nodes: the largest speed along d at any node of the grid
    /// with that coordinate.
    along: [Vec<f64>; D],
}

impl<const D: usize> Speeds<D> {
    /// # Errors
    /// [`Invalid`] naming the first node with a bound that is not finite.
    pub(super) fn of(
        terms: &dyn Fn(usize, f64) -> [f64; TERMS],
        speed_bounds: &dyn Fn(&[[f64; TERMS]; D]) -> [f64; D],
        grid: &Grid<D>,
    ) -> Result<Self, Invalid> {
        let tables: [Vec<[f64; TERMS]>; D] = core::array::from_fn(|d| {
            grid.axes[d].coordinates().iter().map(|x| terms(d, *x)).collect()
        });
        let per_spacing = grid.axes.map(|axis| 1.0 / axis.spacing());
        let mut along = grid.axes.map(|axis| vec![0.0_f64; axis.nodes]);
        let mut index = [0; D];
        // The rate is positive even for a game without motion, for which any time step is stable.
        let mut fastest = 1e-12_f64;
        'nodes: loop {
            let speeds = speed_bounds(&core::array::from_fn(|d| tables[d][index[d]]));
            let rate: f64 = (0..D).map(|d| speeds[d] * per_spacing[d]).sum();
            if !rate.is_finite() {
                let found = format!("{speeds:?} at {:?}", grid.node(index));
                return Err(Invalid::new("game", "finite speed bounds at every node", found));
            }
            fastest = fastest.max(rate);
            for d in 0..D {
                let most = &mut along[d][index[d]];
                *most = most.max(speeds[d]);
            }
            for d in (0..D).rev() {
                index[d] += 1;
                if index[d] < grid.axes[d].nodes {
                    continue 'nodes;
                }
                index[d] = 0;
            }
            return Ok(Self { rate: fastest, along });
        }
    }

    /// For each axis d and each of its nodes: the time (s) before which no path from that node
    /// passes an end of d; infinite if no path ever does. A path must cross each cell on its way.
    /// Its speed in a cell is at most the larger speed of the cell's two nodes.
    pub(super) fn exit_s(&self, grid: &Grid<D>) -> [Vec<f64>; D] {
        core::array::from_fn(|d| {
            let (axis, speeds) = (&grid.axes[d], &self.along[d]);
            if axis.is_periodic() {
                return vec![f64::INFINITY; axis.nodes];
            }
            let from_low = times(axis, speeds.iter());
            let from_high = times(axis, speeds.iter().rev());
            from_low.iter().zip(from_high.iter().rev()).map(|(low, high)| low.min(*high)).collect()
        })
    }
}

/// The shortest travel time from the first node to each node. `speeds` are the speeds at the nodes.
fn times<'a>(axis: &Axis, speeds: impl Iterator<Item = &'a f64>) -> Vec<f64> {
    let (mut elapsed, mut before) = (0.0, f64::INFINITY);
    speeds
        .map(|&speed| {
            // The first node adds 0, or infinity if its speed is 0.
            let is_still = before == f64::INFINITY && speed == 0.0;
            elapsed += if is_still { f64::INFINITY } else { axis.spacing() / speed.max(before) };
            before = speed;
            elapsed
        })
        .collect()
}
