//! One Runge–Kutta stage on a run of nodes, in SIMD lanes. Most of a solve's time is spent here.

use super::super::game::{Game, TERMS};
use super::super::grid::Grid;
use super::super::scheme::{Stencil, Upwind, has_jump};
use super::layout::{BLOCK, Ghosts, Layout, fill_ghosts};
use super::speeds::Speeds;
use super::tables::Tables;
use crate::invalid::Invalid;
use crate::parallel::{Kernel, Lanes, in_lanes};
use crate::real::Real;
use core::marker::PhantomData;
use core::ops::Deref;

/// The values that a stage combines with the moved values, which are the values after its time
/// step.
#[derive(Clone, Copy)]
pub(super) enum Base<'a, T> {
    /// None: dst = moved.
    Nothing,
    /// The values in dst: dst = keep·dst + (1 − keep)·moved.
    Own(T),
    /// Another array: dst = keep·other + (1 − keep)·moved.
    Other(T, &'a [T]),
}

/// The range of a tube's values.
#[derive(Clone, Copy)]
pub(super) struct Range<T> {
    /// The smallest value of the target so far. V of a tube is never below it, since a path's value
    /// is the target's value at a point of the path, or a larger obstacle value. Higher-order
    /// schemes undershoot it slightly.
    pub(super) lowest: T,
    /// Bounds that no scheme exceeds in one stage. If a value is beyond them, the game is wrong or
    /// the number type overflows.
    pub(super) possible: [T; 2],
}

/// One Runge–Kutta stage.
pub(super) struct Stage<'a, T, const D: usize> {
    pub(super) layout: &'a Layout<D>,
    pub(super) tables: &'a Tables<T, D>,
    /// For each axis, the factor that converts differences between neighbours to scaled
    /// derivatives.
    pub(super) units: [T; D],
    /// If there is an obstacle: for each axis, the difference between neighbours above which V
    /// counts as having a jump.
    pub(super) steep: Option<[T; D]>,
    /// Positive near those jumps of the obstacle that are lower than `steep`. `None` if there are
    /// no such jumps.
    pub(super) near: Option<&'a [T]>,
    /// Whether V can have jumps, because the obstacle has them.
    pub(super) jumps: bool,
    /// Half the factor that converts scaled derivatives back to derivatives. `half_mean` multiplies
    /// the sum of the two derivatives and is negative in a forward march; `half_difference`
    /// multiplies their difference.
    pub(super) half_mean: T,
    pub(super) half_difference: T,
    pub(super) time_step: T,
    pub(super) source: &'a [T],
    pub(super) base: Base<'a, T>,
    pub(super) ceiling: Option<&'a [T]>,
    pub(super) floor: Option<&'a [T]>,
    pub(super) range: Range<T>,
}

impl<T: Real> Range<T> {
    /// Raises a moved value to at least `lowest`. Returns NaN if the value is not possible.
    #[inline(always)]
    fn keep(&self, moved: T) -> T {
        let [least, most] = self.possible;
        if (moved >= least) & (moved <= most) {
            self.lowest.larger(moved)
        } else {
            T::from_f64(f64::NAN)
        }
    }
}

impl<T: Copy, const D: usize> Clone for Stage<'_, T, D> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Copy, const D: usize> Copy for Stage<'_, T, D> {}

/// The slices that a task writes, beginning with slice `first`.
pub(super) struct Part<'a, 'b, T, const D: usize> {
    pub(super) first: usize,
    pub(super) slices: &'b mut [T],
    /// The ghosts of each axis.
    pub(super) ghosts: [Ghosts<'a>; D],
}

/// The operations of a game and a scheme that the march needs. Only the kernels behind this trait
/// are compiled for each game and scheme; the rest of the solver is compiled once for each number
/// type and dimension.
pub(super) trait Moves<T, const D: usize>: Sync {
    /// See [`Stencil::REACH`].
    fn reach(&self) -> usize;
    /// See [`Game::mirror`].
    fn mirror(&self) -> [bool; D];
    fn tables(&self, grid: &Grid<D>, layout: &Layout<D>) -> Tables<T, D>;
    /// # Errors
    /// [`Invalid`] for the first node with a speed bound that is not finite.
    fn speeds(&self, grid: &Grid<D>) -> Result<Speeds<D>, Invalid>;
    /// Computes a part of a stage, in lanes of at most this width.
    fn advance(&self, lanes: Lanes, stage: Stage<'_, T, D>, part: Part<'_, '_, T, D>);
}

/// The moves of a game under a scheme.
pub(super) struct Of<'a, G, S> {
    pub(super) game: &'a G,
    pub(super) scheme: PhantomData<S>,
}

impl<T: Real, const D: usize, G: Game<D>, S: Stencil> Moves<T, D> for Of<'_, G, S> {
    fn reach(&self) -> usize {
        S::REACH
    }

    fn mirror(&self) -> [bool; D] {
        self.game.mirror()
    }

    fn tables(&self, grid: &Grid<D>, layout: &Layout<D>) -> Tables<T, D> {
        Tables::new(&|axis, coordinate| self.game.terms(axis, coordinate), grid, layout)
    }

    fn speeds(&self, grid: &Grid<D>) -> Result<Speeds<D>, Invalid> {
        Speeds::of(
            &|axis, coordinate| self.game.terms(axis, coordinate),
            &|terms| self.game.speed_bounds(terms),
            grid,
        )
    }

    fn advance(&self, lanes: Lanes, stage: Stage<'_, T, D>, part: Part<'_, '_, T, D>) {
        let step = Step { stage, game: self.game, scheme: PhantomData::<S> };
        in_lanes(lanes, Task { step, part });
    }
}

/// A stage of a game under a scheme.
struct Step<'a, T, const D: usize, G, S> {
    stage: Stage<'a, T, D>,
    game: &'a G,
    scheme: PhantomData<S>,
}

impl<'a, T, const D: usize, G, S> Deref for Step<'a, T, D, G, S> {
    type Target = Stage<'a, T, D>;

    #[inline(always)]
    fn deref(&self) -> &Stage<'a, T, D> {
        &self.stage
    }
}

struct Task<'a, 'b, T, const D: usize, G, S> {
    step: Step<'a, T, D, G, S>,
    part: Part<'a, 'b, T, D>,
}

/// moved ← keep·other + (1 − keep)·moved.
#[inline(always)]
fn combine<T: Real>(keep: T, other: &[T; BLOCK], moved: &mut [T; BLOCK]) {
    let share = T::from_f64(1.0) - keep;
    for i in 0..BLOCK {
        moved[i] = keep * other[i] + share * moved[i];
    }
}

#[inline(always)]
fn block_mut<T>(values: &mut [T], at: usize) -> &mut [T; BLOCK] {
    match values[at..].first_chunk_mut() {
        Some(block) => block,
        None => panic!("arrays have room for a whole block behind the last cell"),
    }
}

#[inline(always)]
pub(super) fn block<T>(values: &[T], at: usize) -> &[T; BLOCK] {
    match values[at..].first_chunk() {
        Some(block) => block,
        None => panic!("arrays have room for a whole block behind the last cell"),
    }
}

impl<T: Real, const D: usize, G: Game<D>, S: Stencil> Kernel for Task<'_, '_, T, D, G, S> {
    #[inline(always)]
    fn run(self) {
        let Self { step, part: Part { first, slices, ghosts } } = self;
        let layout = step.layout;
        let mut carried = Carried::new(layout);
        let mut scratch = Scratch { rights: [[T::ZERO; BLOCK]; D], moved: [T::ZERO; BLOCK] };
        for (i, slice) in slices.chunks_mut(layout.slice_length()).enumerate() {
            for run in 0..layout.runs_per_slice() {
                let run = Run::new(&step, first + i, run);
                step.enter(i == 0, &run, &mut carried, &mut scratch);
                let end = run.offset + layout.run_length();
                for here in (run.offset..end).step_by(BLOCK) {
                    let target = &mut slice[here..end.min(here + BLOCK)];
                    step.block(&run, here, &mut carried, &mut scratch, target);
                }
            }
            for (d, ghosts) in ghosts.into_iter().enumerate().skip(1) {
                fill_ghosts(slice, layout, d, ghosts, step.jumps);
            }
            carried.next_slice();
        }
    }
}

/// A run of cells along the last axes.
struct Run<T, const D: usize> {
    /// The indices along the loop axes.
    index: [usize; D],
    /// The terms of the loop axes.
    fixed: [[T; TERMS]; D],
    /// The start of the run's slice in the arrays.
    slice_start: usize,
    /// The offset of the run's first cell in the slice.
    offset: usize,
}

impl<T: Real, const D: usize> Run<T, D> {
    #[inline(always)]
    fn new(stage: &Stage<'_, T, D>, slice: usize, run: usize) -> Self {
        let layout = stage.layout;
        let (index, offset) = layout.run(slice, run);
        let fixed = core::array::from_fn(|d| {
            let loops = d < Layout::<D>::LOOP_AXES;
            if loops { stage.tables.nodes[d][index[d]] } else { [T::ZERO; TERMS] }
        });
        Self { index, fixed, slice_start: layout.lead() + slice * layout.slice_length(), offset }
    }
}

/// The data of one block, in the L1 cache.
struct Scratch<T, const D: usize> {
    /// The right derivatives, by axis.
    rights: [[T; BLOCK]; D],
    /// The new values.
    moved: [T; BLOCK],
}

/// Left derivatives at nodes that are computed later. A face gives the left derivative at the node
/// after it together with the right derivative at the node before it.
struct Carried<T, const D: usize> {
    /// For each axis, the left derivatives, ordered by the position of their nodes in the slice.
    lefts: [Vec<T>; D],
    /// The left derivatives of the next slice along axis 0. Empty if there are no loop axes, since
    /// there is then only one slice.
    next: Vec<T>,
}

impl<T: Real, const D: usize> Carried<T, D> {
    #[inline(always)]
    fn new(layout: &Layout<D>) -> Self {
        // Includes space for a whole block after the last cell, and for the faces after the block.
        let array = |stride: usize| vec![T::ZERO; layout.slice_length() + stride + BLOCK];
        let next = if Layout::<D>::LOOP_AXES > 0 { array(0) } else { Vec::new() };
        Self { lefts: layout.strides.map(|stride| array(stride.min(layout.slice_length()))), next }
    }

    /// The storage for left derivatives, for a block that starts at `here`. The derivatives belong
    /// to the nodes that are one node further along axis `d` than the nodes of the block.
    #[inline(always)]
    fn behind(&mut self, d: usize, here: usize, layout: &Layout<D>) -> &mut [T; BLOCK] {
        if d == 0 && Layout::<D>::LOOP_AXES > 0 {
            return block_mut(&mut self.next, here);
        }
        block_mut(&mut self.lefts[d], here + layout.strides[d])
    }

    #[inline(always)]
    fn next_slice(&mut self) {
        if Layout::<D>::LOOP_AXES > 0 {
            core::mem::swap(&mut self.lefts[0], &mut self.next);
        }
    }
}

/// The values at the nodes around the `i`-th face of a block. The nodes are numbered from −2 to 3.
#[inline(always)]
fn node<T: Real>(rows: [&[T; BLOCK]; 6], i: usize) -> impl Fn(isize) -> T {
    move |k| rows[(k + 2) as usize][i]
}

/// Whether a difference between neighbours in the scheme's stencil exceeds `most` in magnitude.
#[inline(always)]
fn is_steeper<T: Real, S: Stencil>(value: impl Fn(isize) -> T, most: T) -> bool {
    let faces = 1 - S::REACH as isize..S::REACH as isize;
    faces.fold(T::ZERO, |largest, k| largest.larger((value(k + 1) - value(k)).abs())) > most
}

impl<T: Real, const D: usize, G: Game<D>, S: Stencil> Step<'_, T, D, G, S> {
    /// Computes the left derivatives at a run's first cells, along each axis on which these cells
    /// are the first nodes. Along axis 0, only the first slice of a task needs this.
    #[inline(always)]
    fn enter(
        &self,
        first: bool,
        run: &Run<T, D>,
        carried: &mut Carried<T, D>,
        scratch: &mut Scratch<T, D>,
    ) {
        let layout = self.layout;
        for (d, node) in run.index.into_iter().enumerate() {
            let stride = layout.strides[d];
            let count = if d >= Layout::<D>::LOOP_AXES {
                stride
            } else if if d == 0 { first } else { node == 0 } {
                layout.run_length()
            } else {
                0
            };
            let (offset, at) = (run.offset, run.slice_start + run.offset - stride);
            if count == 1 {
                let value = |k: isize| self.source[at.wrapping_add_signed(k * stride as isize)];
                let left = S::face(value, self.units[d]).1;
                let plain = Upwind::face(value, self.units[d]).1;
                let near = |near: &[T]| near[at].larger(near[at + stride]) > T::ZERO;
                let is_plain = self.steep.is_some_and(|steep| is_steeper::<T, S>(value, steep[d]))
                    || self.near.is_some_and(|of| has_jump(value, near(of)));
                carried.lefts[d][offset] = if is_plain { plain } else { left };
                continue;
            }
            // The last block extends beyond `count`. The entries there are recomputed before they
            // are read.
            for start in (0..count).step_by(BLOCK) {
                let lefts = block_mut(&mut carried.lefts[d], offset + start);
                self.faces(d, at + start, &mut scratch.rights[d], lefts);
            }
        }
    }

    /// Computes a block of derivatives along axis `d`: the right derivatives at the nodes from `at`
    /// on, and the left derivatives at the nodes that come one node later along the axis.
    #[inline(always)]
    fn faces(&self, d: usize, at: usize, rights: &mut [T; BLOCK], lefts: &mut [T; BLOCK]) {
        let stride = self.layout.strides[d];
        let row = |k: usize| block(self.source, at + k * stride - 2 * stride);
        let rows: [&[T; BLOCK]; 6] =
            core::array::from_fn(|k| row(k.clamp(3 - S::REACH, 2 + S::REACH)));
        for i in 0..BLOCK {
            let (right, left) = S::face(node(rows, i), self.units[d]);
            rights[i] = right;
            lefts[i] = left;
        }
        if let Some(steep) = self.steep {
            self.flatten(d, at, steep[d], [rights, lefts]);
        }
    }

    /// At each face across a jump, replaces the derivatives by the slope between the face's two
    /// nodes.
    #[inline(always)]
    fn flatten(&self, d: usize, at: usize, steep: T, [rights, lefts]: [&mut [T; BLOCK]; 2]) {
        let stride = self.layout.strides[d];
        let row = |k: usize| block(self.source, at + k * stride - 2 * stride);
        let mut keep = |i: usize, rows, is_plain: bool| {
            let (right, left) = Upwind::face(node(rows, i), self.units[d]);
            rights[i] = if is_plain { right } else { rights[i] };
            lefts[i] = if is_plain { left } else { lefts[i] };
        };
        if let Some(near) = self.near {
            let rows = core::array::from_fn(row);
            let (before, behind) = (block(near, at), block(near, at + stride));
            for i in 0..BLOCK {
                let is_near = before[i].larger(behind[i]) > T::ZERO;
                let is_steep = is_steeper::<T, S>(node(rows, i), steep);
                keep(i, rows, is_steep | has_jump(node(rows, i), is_near));
            }
        } else {
            let rows = core::array::from_fn(|k| row(k.clamp(3 - S::REACH, 2 + S::REACH)));
            for i in 0..BLOCK {
                keep(i, rows, is_steeper::<T, S>(node(rows, i), steep));
            }
        }
    }

    /// Computes the block of a run that starts at position `here` of its slice.
    #[inline(always)]
    fn block(
        &self,
        run: &Run<T, D>,
        here: usize,
        carried: &mut Carried<T, D>,
        scratch: &mut Scratch<T, D>,
        target: &mut [T],
    ) {
        let at = run.slice_start + here;
        let Scratch { rights, moved } = scratch;
        for (d, rights) in rights.iter_mut().enumerate() {
            self.faces(d, at, rights, carried.behind(d, here, self.layout));
        }
        let lefts = core::array::from_fn(|d| block(&carried.lefts[d], here));
        self.advance(run, here, lefts, rights, moved);
        if let Some(target) = target.first_chunk_mut() {
            self.settle(at, moved, target);
        } else {
            let mut padded = [T::ZERO; BLOCK];
            padded[..target.len()].copy_from_slice(target);
            self.settle(at, moved, &mut padded);
            target.copy_from_slice(&padded[..target.len()]);
        }
    }

    /// Combines the moved values with the base and applies the limits.
    #[inline(always)]
    fn settle(&self, at: usize, moved: &mut [T; BLOCK], target: &mut [T; BLOCK]) {
        match self.base {
            Base::Nothing => {}
            Base::Own(keep) => combine(keep, target, moved),
            Base::Other(keep, other) => combine(keep, block(other, at), moved),
        }
        // The result goes to a different array than the one that is read. Otherwise the compiler
        // would make the stores conditional, which is slow. The operands of the comparisons are in
        // the order that preserves a NaN from the game.
        match (self.ceiling, self.floor) {
            (None, None) => *target = *moved,
            (Some(ceiling), None) => {
                let ceiling = block(ceiling, at);
                for i in 0..BLOCK {
                    target[i] = ceiling[i].smaller(self.range.keep(moved[i]));
                }
            }
            (None, Some(floor)) => {
                let floor = block(floor, at);
                for i in 0..BLOCK {
                    target[i] = floor[i].larger(moved[i]);
                }
            }
            (Some(ceiling), Some(floor)) => {
                let (ceiling, floor) = (block(ceiling, at), block(floor, at));
                for i in 0..BLOCK {
                    target[i] = floor[i].larger(ceiling[i].smaller(self.range.keep(moved[i])));
                }
            }
        }
    }

    /// moved ← source + time step · H, for every cell of the block.
    #[inline(always)]
    fn advance(
        &self,
        run: &Run<T, D>,
        here: usize,
        lefts: [&[T; BLOCK]; D],
        rights: &[[T; BLOCK]; D],
        moved: &mut [T; BLOCK],
    ) {
        let (loops, cell) = (Layout::<D>::LOOP_AXES, here - run.offset);
        let source = block(self.source, run.slice_start + here);
        let tables: [[&[T; BLOCK]; TERMS]; D] = core::array::from_fn(|d| {
            core::array::from_fn(|k| block(&self.tables.runs[d.max(loops)][k], cell))
        });
        for i in 0..BLOCK {
            let mut terms = run.fixed;
            for d in loops..D {
                for k in 0..TERMS {
                    terms[d][k] = tables[d][k][i];
                }
            }
            let mut gradient = [T::ZERO; D];
            let mut jump = [T::ZERO; D];
            for d in 0..D {
                let (left, right) = (lefts[d][i], rights[d][i]);
                gradient[d] = (left + right) * self.half_mean;
                jump[d] = (right - left) * self.half_difference;
            }
            let speeds = self.game.speed_bounds(&terms);
            let mut rate = self.game.hamiltonian(&terms, gradient);
            for d in 0..D {
                rate += speeds[d] * jump[d];
            }
            moved[i] = source[i] + self.time_step * rate;
        }
    }
}
