//! The memory layout of a grid's nodes and their ghosts.

use super::super::grid::{Boundary, Grid};
use crate::real::Real;

/// Number of cells in a block. A stage computes one block after the other. A block takes a few
/// cache lines of every row that a stencil reads.
pub(super) const BLOCK: usize = 256;

/// The memory layout of the axes, including ghosts.
#[derive(Clone, Copy)]
pub(super) struct Layout<const D: usize> {
    pub(super) reach: usize,
    pub(super) nodes: [usize; D],
    pub(super) strides: [usize; D],
    /// Number of entries in an array, including space for the part of the last block that lies
    /// after the last cell.
    pub(super) length: usize,
}

impl<const D: usize> Layout<D> {
    /// The number of axes that form one run of cells. The other axes are the loop axes.
    const RUN_AXES: usize = if D >= 3 { 2 } else { 1 };
    pub(super) const LOOP_AXES: usize = D - Self::RUN_AXES;

    pub(super) fn new(grid: &Grid<D>, reach: usize) -> Self {
        let nodes = grid.axes.map(|axis| axis.nodes);
        let mut strides = [1; D];
        for d in (0..D - 1).rev() {
            strides[d] = strides[d + 1] * (nodes[d + 1] + 2 * reach);
        }
        let length = strides[0] * (nodes[0] + 2 * reach) + BLOCK;
        Self { reach, nodes, strides, length }
    }

    /// Number of cells from the first to the last interior node of one run.
    pub(super) fn run_length(&self) -> usize {
        (Self::LOOP_AXES..D).map(|d| (self.nodes[d] - 1) * self.strides[d]).sum::<usize>() + 1
    }

    /// Number of runs in one slice of axis 0 (in one dimension, in the whole grid).
    pub(super) fn runs_per_slice(&self) -> usize {
        (1..Self::LOOP_AXES).map(|d| self.nodes[d]).product()
    }

    /// Number of slices along axis 0, which are distributed over the threads.
    pub(super) fn slices(&self) -> usize {
        if Self::LOOP_AXES == 0 { 1 } else { self.nodes[0] }
    }

    /// Number of entries from one slice to the next.
    pub(super) fn slice_length(&self) -> usize {
        if Self::LOOP_AXES == 0 { self.length } else { self.strides[0] }
    }

    /// Number of entries before the first slice.
    pub(super) fn lead(&self) -> usize {
        if Self::LOOP_AXES == 0 { 0 } else { self.reach * self.strides[0] }
    }

    /// The indices of a run along the loop axes, and the offset of its first interior cell from the
    /// start of its slice.
    pub(super) fn run(&self, slice: usize, run: usize) -> ([usize; D], usize) {
        let mut index = [0; D];
        let mut offset = 0;
        let mut rest = run;
        for d in (1..Self::LOOP_AXES).rev() {
            index[d] = rest % self.nodes[d];
            rest /= self.nodes[d];
        }
        index[0] = slice;
        for (d, index) in index.iter().enumerate().skip(1) {
            let inside = if d < Self::LOOP_AXES { *index } else { 0 };
            offset += (inside + self.reach) * self.strides[d];
        }
        if Self::LOOP_AXES == 0 {
            offset = self.reach;
        }
        (index, offset)
    }
}

/// How the ghosts of an axis are filled.
#[derive(Clone, Copy)]
pub(super) enum Ghosts<'a> {
    /// Determined by the boundary condition.
    Of(Boundary),
    /// The mirror image at the low end, extrapolated values at the high end.
    Mirrored {
        /// Whether the first node is the middle of the whole axis.
        centred: bool,
        /// The index of each cell in a row, and the index of its mirror image.
        cells: &'a [(usize, usize)],
    },
}

/// Fills the ghosts of `axis` in `data`, which consists of whole slices of this axis. If V can have
/// `jumps`, the ghosts do not continue them; see [`extend`].
#[inline(always)]
pub(super) fn fill_ghosts<T: Real, const D: usize>(
    data: &mut [T],
    layout: &Layout<D>,
    axis: usize,
    ghosts: Ghosts<'_>,
    jumps: bool,
) {
    let (reach, nodes, stride) = (layout.reach, layout.nodes[axis], layout.strides[axis]);
    let padded = (nodes + 2 * reach) * stride;
    for line in data.chunks_exact_mut(padded) {
        match ghosts {
            Ghosts::Of(Boundary::Periodic) if stride == 1 => wrap(line, reach, nodes),
            Ghosts::Of(Boundary::Periodic) => {
                for (from, to) in wrapped(reach, nodes) {
                    line.copy_within(from * stride..(from + 1) * stride, to * stride);
                }
            }
            Ghosts::Of(Boundary::Extrapolate) => {
                let (low, rest) = line.split_at_mut(reach * stride);
                let row = |k: usize| &rest[k * stride..][..stride];
                for (k, ghost) in low.rchunks_mut(stride).enumerate() {
                    extend(ghost, [row(0), row(1), row(2)], k, jumps);
                }
                extend_high(line, reach, nodes, stride, jumps);
            }
            Ghosts::Of(Boundary::Constant) => {
                let (low, high) = (reach * stride, (reach + nodes) * stride);
                for k in 0..reach {
                    line.copy_within(low..low + stride, k * stride);
                    line.copy_within(high - stride..high, high + k * stride);
                }
            }
            Ghosts::Mirrored { centred, cells } => {
                for k in 0..reach {
                    let ghost = (reach - 1 - k) * stride;
                    let image = (reach + k + usize::from(centred)) * stride;
                    for (to, from) in cells {
                        line[ghost + to] = line[image + from];
                    }
                }
                extend_high(line, reach, nodes, stride, jumps);
            }
        }
    }
}

/// Fills the rows of ghosts at the high end.
#[inline(always)]
fn extend_high<T: Real>(line: &mut [T], reach: usize, nodes: usize, stride: usize, jumps: bool) {
    let (inside, high) = line.split_at_mut((reach + nodes) * stride);
    let row = |k: usize| &inside[inside.len() - (k + 1) * stride..][..stride];
    for (k, ghost) in high.chunks_mut(stride).enumerate() {
        extend(ghost, [row(0), row(1), row(2)], k, jumps);
    }
}

/// For each ghost of a periodic axis, the node that it repeats and the ghost itself.
#[inline(always)]
fn wrapped(reach: usize, nodes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..reach).flat_map(move |k| {
        // The modulo is needed because a short axis can wrap more than once.
        let low = (nodes * reach + k - reach) % nodes;
        [(reach + low, k), (reach + k % nodes, reach + nodes + k)]
    })
}

/// Fills the ghosts of a periodic axis with a stride of 1. Copying single entries with
/// `copy_within` would take longer than a stage's arithmetic.
#[inline(always)]
fn wrap<T: Copy>(line: &mut [T], reach: usize, nodes: usize) {
    for (from, to) in wrapped(reach, nodes) {
        line[to] = line[from];
    }
}

/// Fills the `k`-th row of ghosts beyond the row `edge`, whose inner neighbours are `inner` and
/// `deeper`. If V has `jumps`, values below 0 use the smaller of the two slopes at the edge,
/// because beside a wall, the first slope is the jump. With the slope of the jump, values that are
/// far too low would enter from outside.
#[inline(always)]
fn extend<T: Real>(ghosts: &mut [T], [edge, inner, deeper]: [&[T]; 3], k: usize, jumps: bool) {
    for (((ghost, edge), inner), deeper) in ghosts.iter_mut().zip(edge).zip(inner).zip(deeper) {
        let (first, second) = (*edge - *inner, *inner - *deeper);
        let agree = (first > T::ZERO) == (second > T::ZERO);
        let lesser = if agree { first.abs().smaller(second.abs()) } else { T::ZERO };
        let slope =
            if *edge < T::ZERO { -(if jumps { lesser } else { first.abs() }) } else { first.abs() };
        let mut value = *edge;
        for _ in 0..=k {
            value += slope;
        }
        *ghost = value;
    }
}

/// Calls `f` with the index of every interior node of slice `slice` and its position in the slice.
pub(super) fn each_interior<const D: usize>(
    layout: &Layout<D>,
    slice: usize,
    mut f: impl FnMut([usize; D], usize),
) {
    each_line(layout, slice, |mut index, start| {
        for last in 0..layout.nodes[D - 1] {
            index[D - 1] = last;
            f(index, start + last);
        }
    });
}

/// Calls `f` with the index and the position of the first node of every line along the last axis.
pub(super) fn each_line<const D: usize>(
    layout: &Layout<D>,
    slice: usize,
    mut f: impl FnMut([usize; D], usize),
) {
    let first_axis = usize::from(Layout::<D>::LOOP_AXES > 0);
    // This divides once for each line, not for each node.
    let lines: usize = layout.nodes[first_axis..].iter().product::<usize>() / layout.nodes[D - 1];
    for line in 0..lines {
        let mut index = [slice; D];
        let (mut rest, mut start) = (line, layout.reach * layout.strides[D - 1]);
        for d in (first_axis..D - 1).rev() {
            index[d] = rest % layout.nodes[d];
            rest /= layout.nodes[d];
            start += (index[d] + layout.reach) * layout.strides[d];
        }
        index[D - 1] = 0;
        f(index, start);
    }
}
