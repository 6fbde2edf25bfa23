//! The functions of one coordinate that a game needs, tabulated for every node of each axis.

use super::super::game::TERMS;
use super::super::grid::Grid;
use super::layout::{BLOCK, Layout};
use crate::real::Real;

/// The game's terms as tables.
pub(super) struct Tables<T, const D: usize> {
    /// For the loop axes: the terms by axis and node.
    pub(super) nodes: [Vec<[T; TERMS]>; D],
    /// For the run axes: by axis and term, one entry for each cell of a run.
    pub(super) runs: [[Vec<T>; TERMS]; D],
}

impl<T: Real, const D: usize> Tables<T, D> {
    pub(super) fn new(
        terms: &dyn Fn(usize, f64) -> [f64; TERMS],
        grid: &Grid<D>,
        layout: &Layout<D>,
    ) -> Self {
        let terms = |d: usize, i: isize| terms(d, grid.axes[d].node(i)).map(T::from_f64);
        let nodes = core::array::from_fn(|d| {
            (0..layout.nodes[d] as isize).map(|i| terms(d, i)).collect::<Vec<_>>()
        });
        let length = layout.run_length() + BLOCK;
        let runs = core::array::from_fn(|d| {
            if d < Layout::<D>::LOOP_AXES {
                return core::array::from_fn(|_| Vec::new());
            }
            let padded = layout.nodes[d] + 2 * layout.reach;
            let axis: Vec<_> = (0..padded as isize).map(|i| terms(d, i)).collect();
            core::array::from_fn(|k| {
                (0..length).map(|cell| axis[cell / layout.strides[d] % padded][k]).collect()
            })
        });
        Self { nodes, runs }
    }
}
