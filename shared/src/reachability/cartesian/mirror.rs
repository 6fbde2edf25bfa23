//! Reflection symmetry. If the game, the grid, the target and the obstacle have the same symmetry,
//! one half of the grid determines the other half.

use super::super::grid::{Axis, Boundary, Grid};
use super::layout::Layout;
use super::{Problem, Region};

/// A symmetry of a problem: V does not change if some coordinates are reversed. The march computes
/// only the nodes from the middle of one axis onwards.
pub(super) struct Mirror<const D: usize> {
    whole: Grid<D>,
    /// The axis that is halved: the first reversed axis.
    pub(super) axis: usize,
    reversed: [bool; D],
    /// Whether the first node of the half is the middle of the axis.
    pub(super) centred: bool,
}

impl<const D: usize> Mirror<D> {
    /// The symmetry of `problem`. Returns `None` if it has none, or if half of the grid has too few
    /// nodes for a stencil of `reach`.
    pub(super) fn of(
        problem: &Problem<'_, D, ()>,
        reversed: [bool; D],
        reach: usize,
    ) -> Option<Self> {
        let (axis, whole) = (reversed.iter().position(|reversed| *reversed)?, problem.grid);
        let (nodes, boundary) = (whole.axes[axis].nodes, whole.axes[axis].boundary);
        let fits = boundary == Boundary::Extrapolate && nodes - nodes / 2 > reach.max(2);
        let symmetric = |d: usize| !reversed[d] || is_symmetric(&whole.axes[d]);
        let mirror = Self { whole, axis, reversed, centred: nodes % 2 == 1 };
        let regions = [Some(&problem.target), problem.avoid.as_ref().map(|avoid| &avoid.region)];
        let same =
            |region: Option<&Region<'_, D>>| region.is_none_or(|region| mirror.keeps(region));
        (fits && (0..D).all(symmetric) && regions.into_iter().all(same)).then_some(mirror)
    }

    /// The grid of the half.
    pub(super) fn half(&self) -> Grid<D> {
        let mut grid = self.whole;
        let Axis { high, nodes, .. } = grid.axes[self.axis];
        let middle = nodes / 2;
        let low = grid.axes[self.axis].node(middle as isize);
        grid.axes[self.axis] = Axis::bounded(low, high, nodes - middle);
        grid
    }

    /// The values of the whole grid from the values of the half, row-major.
    pub(super) fn whole<T: Copy>(&self, half: &[T]) -> Vec<T> {
        let shape = self.half().axes.map(|axis| axis.nodes);
        let middle = self.whole.axes[self.axis].nodes / 2;
        let node = |position: usize| {
            let mut index = self.whole.index(position);
            if index[self.axis] < middle {
                index = self.image(index);
            }
            index[self.axis] -= middle;
            half[index.iter().zip(shape).fold(0, |position, (i, nodes)| position * nodes + i)]
        };
        (0..self.whole.len()).map(node).collect()
    }

    /// The nodes that differ only along the axes after the halved axis form a row. For each node of
    /// a row, returns its position in the row (in `layout`) and the position of its mirror image.
    pub(super) fn cells(&self, layout: &Layout<D>) -> Vec<(usize, usize)> {
        let count: usize = layout.nodes[self.axis + 1..].iter().product();
        let place = |index: [usize; D]| {
            let places = (self.axis + 1..D).map(|d| (index[d] + layout.reach) * layout.strides[d]);
            places.sum::<usize>()
        };
        // In row-major order, the first `count` nodes form such a row.
        let index = |position: usize| self.whole.index(position);
        (0..count)
            .map(|position| (place(index(position)), place(self.image(index(position)))))
            .collect()
    }

    /// The mirror image of a node.
    fn image(&self, index: [usize; D]) -> [usize; D] {
        core::array::from_fn(|d| {
            let Axis { nodes, boundary, .. } = self.whole.axes[d];
            match boundary {
                _ if !self.reversed[d] => index[d],
                Boundary::Periodic => (nodes - index[d]) % nodes,
                Boundary::Extrapolate | Boundary::Constant => nodes - 1 - index[d],
            }
        })
    }

    /// Whether a region is static and has the same value at each node and its mirror image, up to
    /// rounding.
    fn keeps(&self, region: &Region<'_, D>) -> bool {
        let Region::Static(region) = region else {
            return false;
        };
        let at = |index: [usize; D]| region(self.whole.node(index));
        let indices = || (0..self.whole.len()).map(|position| self.whole.index(position));
        let largest = indices().map(|index| at(index).abs()).fold(0.0, f64::max);
        indices().all(|index| (at(index) - at(self.image(index))).abs() <= ROUNDING * largest)
    }
}

/// Whether the nodes of `axis` are symmetric about 0 or, on a periodic axis, about half a period.
fn is_symmetric(axis: &Axis) -> bool {
    let Axis { low, high, boundary, .. } = *axis;
    let zero = |x: f64| x.abs() <= ROUNDING * (high - low);
    match boundary {
        Boundary::Periodic => zero(low) || zero(low + high),
        Boundary::Extrapolate | Boundary::Constant => zero(low + high),
    }
}

/// Relative tolerance for the rounding errors of node coordinates and of values computed from them.
const ROUNDING: f64 = 1e-13;
