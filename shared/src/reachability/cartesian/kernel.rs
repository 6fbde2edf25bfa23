//! One Runge–Kutta stage on a run of nodes, in lanes. Most of a solve's time is spent here.

use super::super::game::{Game, TERMS};
use super::super::grid::Grid;
use super::super::scheme::Stencil;
use super::layout::{BLOCK, Layout};
use crate::parallel::Kernel;
use crate::real::Real;

/// The game's terms as tables.
pub(super) struct Tables<T, const D: usize> {
    /// For the loop axes: by axis and node.
    pub(super) nodes: [Vec<[T; TERMS]>; D],
    /// For the run axes: by axis and term, one entry for each cell of a run.
    pub(super) runs: [[Vec<T>; TERMS]; D],
}

impl<T: Real, const D: usize> Tables<T, D> {
    pub(super) fn new<G: Game<D>>(game: &G, grid: &Grid<D>, layout: &Layout<D>) -> Self {
        let terms = |d: usize, i: isize| game.terms(d, grid.axes[d].node(i)).map(T::from_f64);
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

/// The values that a stage combines with the moved values.
#[derive(Clone, Copy)]
pub(super) enum Base<'a, T> {
    /// None: dst = moved.
    Nothing,
    /// The values in dst: dst = keep·dst + (1 − keep)·moved.
    Own(T),
    /// Another array: dst = keep·other + (1 − keep)·moved.
    Other(T, &'a [T]),
}

/// One stage on a part of the slices.
pub(super) struct Stage<'a, T, const D: usize, G, S> {
    pub(super) game: &'a G,
    pub(super) layout: &'a Layout<D>,
    pub(super) tables: &'a Tables<T, D>,
    /// Factors of the differences of neighbours, by axis.
    pub(super) units: [T; D],
    /// Half the scale of the data, for the mean of the two derivatives (negative
    /// for forward sets) and for their difference.
    pub(super) half_mean: T,
    pub(super) half_difference: T,
    pub(super) time_step: T,
    pub(super) source: &'a [T],
    pub(super) base: Base<'a, T>,
    pub(super) ceiling: Option<&'a [T]>,
    pub(super) floor: Option<&'a [T]>,
    pub(super) scheme: core::marker::PhantomData<S>,
}

impl<T: Copy, const D: usize, G, S> Clone for Stage<'_, T, D, G, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Copy, const D: usize, G, S> Copy for Stage<'_, T, D, G, S> {}

/// A stage, and where its results go: slices from `first` on.
pub(super) struct Task<'a, 'b, T, const D: usize, G, S> {
    pub(super) stage: Stage<'a, T, D, G, S>,
    pub(super) first: usize,
    pub(super) slices: &'b mut [T],
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
        let Self { stage, first, slices } = self;
        let layout = stage.layout;
        let run_length = layout.run_length();
        for (i, slice) in slices.chunks_mut(layout.slice_length()).enumerate() {
            let slice_start = layout.lead() + (first + i) * layout.slice_length();
            for run in 0..layout.runs_per_slice() {
                let (index, offset) = layout.run(first + i, run);
                let fixed: [[T; TERMS]; D] = core::array::from_fn(|d| {
                    if d < Layout::<D>::LOOP_AXES {
                        stage.tables.nodes[d][index[d]]
                    } else {
                        [T::ZERO; TERMS]
                    }
                });
                let mut cell = 0;
                while cell < run_length {
                    let length = BLOCK.min(run_length - cell);
                    let here = offset + cell;
                    let target = &mut slice[here..here + length];
                    stage.block(&fixed, cell, slice_start + here, target);
                    cell += length;
                }
            }
        }
    }
}

impl<T: Real, const D: usize, G: Game<D>, S: Stencil> Stage<'_, T, D, G, S> {
    /// The block of cells from `cell` of a run, at `at` in the arrays.
    #[inline(always)]
    fn block(&self, fixed: &[[T; TERMS]; D], cell: usize, at: usize, target: &mut [T]) {
        let mut moved = [T::ZERO; BLOCK];
        self.advance(fixed, cell, at, &mut moved);
        match self.base {
            Base::Nothing => {}
            Base::Own(keep) => {
                let share = T::from_f64(1.0) - keep;
                for (moved, own) in moved.iter_mut().zip(target.iter()) {
                    *moved = keep * *own + share * *moved;
                }
            }
            Base::Other(keep, other) => {
                let share = T::from_f64(1.0) - keep;
                let other = block(other, at);
                for i in 0..BLOCK {
                    moved[i] = keep * other[i] + share * moved[i];
                }
            }
        }
        // This order of comparison preserves a NaN from the game.
        if let Some(ceiling) = self.ceiling {
            let ceiling = block(ceiling, at);
            for i in 0..BLOCK {
                moved[i] = ceiling[i].smaller(moved[i]);
            }
        }
        if let Some(floor) = self.floor {
            let floor = block(floor, at);
            for i in 0..BLOCK {
                moved[i] = floor[i].larger(moved[i]);
            }
        }
        target.copy_from_slice(&moved[..target.len()]);
    }

    /// source + time step · H of every cell of the block.
    #[inline(always)]
    fn advance(&self, fixed: &[[T; TERMS]; D], cell: usize, at: usize, moved: &mut [T; BLOCK]) {
        let loops = Layout::<D>::LOOP_AXES;
        let rows: [[&[T; BLOCK]; 7]; D] = core::array::from_fn(|d| {
            core::array::from_fn(|k| {
                let k = k.clamp(3 - S::REACH, 3 + S::REACH);
                block(self.source, at + k * self.layout.strides[d] - 3 * self.layout.strides[d])
            })
        });
        let tables: [[&[T; BLOCK]; TERMS]; D] = core::array::from_fn(|d| {
            core::array::from_fn(|k| block(&self.tables.runs[d.max(loops)][k], cell))
        });
        for i in 0..BLOCK {
            let mut terms = *fixed;
            for d in loops..D {
                for k in 0..TERMS {
                    terms[d][k] = tables[d][k][i];
                }
            }
            let mut gradient = [T::ZERO; D];
            let mut jump = [T::ZERO; D];
            // Written out, because the compiler would not unroll a loop of this size before it vectorises.
            self.slope(&rows, 0, i, &mut gradient, &mut jump);
            if D > 1 {
                self.slope(&rows, 1, i, &mut gradient, &mut jump);
            }
            if D > 2 {
                self.slope(&rows, 2, i, &mut gradient, &mut jump);
            }
            if D > 3 {
                self.slope(&rows, 3, i, &mut gradient, &mut jump);
            }
            let speeds = self.game.speed_bounds(&terms);
            let mut rate = self.game.hamiltonian(&terms, gradient);
            for d in 0..D {
                rate += speeds[d] * jump[d];
            }
            moved[i] = rows[0][3][i] + self.time_step * rate;
        }
    }

    /// Mean and half difference of the two derivatives along axis `d`.
    #[inline(always)]
    fn slope(
        &self,
        rows: &[[&[T; BLOCK]; 7]; D],
        d: usize,
        i: usize,
        gradient: &mut [T; D],
        jump: &mut [T; D],
    ) {
        let (left, right) = S::pair(|k| rows[d][(k + 3) as usize][i], self.units[d]);
        gradient[d] = (left + right) * self.half_mean;
        jump[d] = (right - left) * self.half_difference;
    }
}
