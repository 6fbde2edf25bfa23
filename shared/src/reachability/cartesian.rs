//! Level-set solver on rectangular grids: local Lax–Friedrichs in space, TVD
//! Runge–Kutta in time, one to four dimensions.
//!
//! Mitchell, *A Toolbox of Level Set Methods* (2008) and Osher and Fedkiw (2003).
//! Values live in one array with ghost nodes all around; a stage walks over the
//! last two axes as one run of cells in blocks that stay in the first-level cache,
//! derivatives included, so there are no derivative arrays. The run passes over
//! ghost nodes; what it computes there is replaced when the ghosts are filled.

use super::game::{Game, TERMS};
use super::grid::{Boundary, Grid, check_memory};
use super::parallel::{Kernel, Workers, in_widest_lanes};
use super::real::Real;
use super::scheme::{Eno2, Eno3, Scheme, Stencil, Upwind, Weno5};
use super::{Progress, SolveError};
use crate::invalid::Invalid;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Whether passing through the target counts, or only being there at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// States from which the target is reached at some time up to the horizon.
    Tube,
    /// States from which the target is reached exactly at the horizon.
    Set,
}

/// Which way time runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// States that lead to the target.
    Backward,
    /// States that the target (the initial set) leads to: the same game with the
    /// velocities reversed, H(x, −p).
    Forward,
}

/// A function of the state, possibly of the time gone by as well.
#[derive(Clone, Copy)]
pub enum Region<'a, const D: usize> {
    /// Fixed.
    Static(&'a (dyn Fn([f64; D]) -> f64 + Sync)),
    /// Depends on the time τ since the march began, s.
    Moving(&'a (dyn Fn([f64; D], f64) -> f64 + Sync)),
}

impl<const D: usize> Region<'_, D> {
    fn at(&self, state: [f64; D], time: f64) -> f64 {
        match self {
            Self::Static(region) => region(state),
            Self::Moving(region) => region(state, time),
        }
    }

    fn moves(&self) -> bool {
        matches!(self, Self::Moving(_))
    }
}

/// When the march ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Horizon {
    /// After this many seconds.
    Finite(f64),
    /// When V changes nowhere by more than `tolerance` a second; gives up after
    /// `longest_s`.
    Converged {
        /// Largest change of V, per second.
        tolerance: f64,
        /// March no longer than this, s.
        longest_s: f64,
    },
}

/// What is to be solved.
pub struct Problem<'a, const D: usize, G> {
    /// The dynamics and the players.
    pub game: &'a G,
    /// Where V is wanted.
    pub grid: Grid<D>,
    /// l(x): the target is {l ≤ 0}; V starts as l.
    pub target: Region<'a, D>,
    /// What may not be entered: positive inside, V ≥ obstacle (reach-avoid).
    pub obstacle: Option<Region<'a, D>>,
    /// Tube or set.
    pub kind: Kind,
    /// Backward or forward.
    pub direction: Direction,
    /// When to end.
    pub horizon: Horizon,
}

/// How it is to be solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Spatial derivatives (and the Runge–Kutta order that goes with them).
    pub scheme: Scheme,
    /// Threads; results do not depend on it. 0 counts as 1; a thread beyond the nodes of
    /// the first axis would have nothing to do and is not started.
    pub threads: usize,
    /// Share of the largest stable time step of first order, above 0 and at most 1. ENO
    /// may choose stencils that are stable only up to 0.5 (of second order) or 0.37 (of
    /// third); with longer steps V stays bounded, but not everywhere of that order.
    pub cfl: f64,
    /// Refuse anything that would take more memory.
    pub memory_limit_bytes: u64,
}

impl Settings {
    /// `scheme` with the time step that suits it, on all threads.
    #[must_use]
    pub fn of(scheme: Scheme) -> Self {
        Self {
            scheme,
            threads: super::default_threads(),
            cfl: scheme.cfl(),
            memory_limit_bytes: super::MEMORY_LIMIT_BYTES,
        }
    }
}

/// The solution on the nodes.
#[derive(Clone, Debug)]
pub struct Solution<T, const D: usize> {
    /// The nodes.
    pub grid: Grid<D>,
    /// V, row-major.
    pub values: Vec<T>,
    /// Time steps taken.
    pub steps: usize,
    /// Time marched, s.
    pub horizon_s: f64,
    /// max |∂V/∂τ| at the end, per second: 0 would be a converged value.
    pub residual: f64,
}

/// Cells of a block: a few cache lines of every row that a stencil reads.
const BLOCK: usize = 256;

/// Solves `problem`.
///
/// `progress` is called after every step and may stop the solve.
///
/// # Errors
/// [`SolveError::Invalid`] for a grid that is too small for the scheme or too large
/// for the memory, a horizon that is not > 0, a `cfl` outside (0, 1], a target, an
/// obstacle or speed bounds that are not finite at a node (which is named), or a game
/// that makes V so; [`SolveError::Cancelled`].
pub fn solve<T: Real, const D: usize, G: Game<D>>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T, D>, SolveError> {
    match settings.scheme {
        Scheme::Upwind => march::<T, D, G, Upwind>(problem, settings, progress),
        Scheme::Eno2 => march::<T, D, G, Eno2>(problem, settings, progress),
        Scheme::Eno3 => march::<T, D, G, Eno3>(problem, settings, progress),
        Scheme::Weno5 => march::<T, D, G, Weno5>(problem, settings, progress),
    }
}

/// How the axes lie in memory, ghosts included.
#[derive(Clone, Copy)]
struct Layout<const D: usize> {
    reach: usize,
    nodes: [usize; D],
    strides: [usize; D],
    /// Entries of an array, with room for the last block to run over.
    length: usize,
}

impl<const D: usize> Layout<D> {
    /// Axes that are walked as one run of cells; the others are loops.
    const RUN_AXES: usize = if D >= 3 { 2 } else { 1 };
    const LOOP_AXES: usize = D - Self::RUN_AXES;

    fn new(grid: &Grid<D>, reach: usize) -> Self {
        let nodes = grid.axes.map(|axis| axis.nodes);
        let mut strides = [1; D];
        for d in (0..D - 1).rev() {
            strides[d] = strides[d + 1] * (nodes[d + 1] + 2 * reach);
        }
        let length = strides[0] * (nodes[0] + 2 * reach) + BLOCK;
        Self { reach, nodes, strides, length }
    }

    /// Cells from the first to the last interior node of one run.
    fn run_length(&self) -> usize {
        (Self::LOOP_AXES..D).map(|d| (self.nodes[d] - 1) * self.strides[d]).sum::<usize>() + 1
    }

    /// Runs of one slice of axis 0 (of everything, in one dimension).
    fn runs_per_slice(&self) -> usize {
        (1..Self::LOOP_AXES).map(|d| self.nodes[d]).product()
    }

    /// Slices along axis 0 that threads share.
    fn slices(&self) -> usize {
        if Self::LOOP_AXES == 0 { 1 } else { self.nodes[0] }
    }

    /// Entries between two slices.
    fn slice_length(&self) -> usize {
        if Self::LOOP_AXES == 0 { self.length } else { self.strides[0] }
    }

    /// Entries before the first slice.
    fn lead(&self) -> usize {
        if Self::LOOP_AXES == 0 { 0 } else { self.reach * self.strides[0] }
    }

    /// The loop axes' indices of a run and its first interior cell, counted from
    /// the start of its slice.
    fn run(&self, slice: usize, run: usize) -> ([usize; D], usize) {
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

/// Terms of the game, tabulated.
struct Tables<T, const D: usize> {
    /// Of the loop axes: by axis and node.
    nodes: [Vec<[T; TERMS]>; D],
    /// Of the run axes: by axis and term, one entry for each cell of a run.
    runs: [[Vec<T>; TERMS]; D],
}

impl<T: Real, const D: usize> Tables<T, D> {
    fn new<G: Game<D>>(game: &G, grid: &Grid<D>, layout: &Layout<D>) -> Self {
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

/// What a stage adds the moved values to.
#[derive(Clone, Copy)]
enum Base<'a, T> {
    /// Nothing: dst = moved.
    Nothing,
    /// What is in dst: dst = keep·dst + (1 − keep)·moved.
    Own(T),
    /// Another array: dst = keep·other + (1 − keep)·moved.
    Other(T, &'a [T]),
}

/// One stage on a part of the slices.
struct Stage<'a, T, const D: usize, G, S> {
    game: &'a G,
    layout: &'a Layout<D>,
    tables: &'a Tables<T, D>,
    /// What differences of neighbours are multiplied with, by axis.
    units: [T; D],
    /// Half the scale of the data, for the mean of the two derivatives (negative
    /// for forward sets) and for their difference.
    half_mean: T,
    half_difference: T,
    time_step: T,
    source: &'a [T],
    base: Base<'a, T>,
    ceiling: Option<&'a [T]>,
    floor: Option<&'a [T]>,
    scheme: core::marker::PhantomData<S>,
}

impl<T: Copy, const D: usize, G, S> Clone for Stage<'_, T, D, G, S> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Copy, const D: usize, G, S> Copy for Stage<'_, T, D, G, S> {}

/// A stage, and where its results go: slices from `first` on.
struct Task<'a, 'b, T, const D: usize, G, S> {
    stage: Stage<'a, T, D, G, S>,
    first: usize,
    slices: &'b mut [T],
}

#[inline(always)]
fn block<T>(values: &[T], at: usize) -> &[T; BLOCK] {
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
        // In this order, which keeps a NaN of the game's.
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
            // Written out: a loop of this size would not be unrolled before lanes are made.
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

/// Fills the ghosts of `axis` in `data`, whose entries form whole slices of it.
fn fill_ghosts<T: Real, const D: usize>(
    data: &mut [T],
    layout: &Layout<D>,
    axis: usize,
    boundary: Boundary,
) {
    let (reach, nodes, stride) = (layout.reach, layout.nodes[axis], layout.strides[axis]);
    let padded = (nodes + 2 * reach) * stride;
    for line in data.chunks_exact_mut(padded) {
        let row = |i: usize| i * stride..(i + 1) * stride;
        match boundary {
            Boundary::Periodic => {
                for k in 0..reach {
                    // Modulo, since a short axis wraps more than once.
                    let low = (nodes * reach + k - reach) % nodes;
                    line.copy_within(row(reach + low), row(k).start);
                    line.copy_within(row(reach + k % nodes), row(reach + nodes + k).start);
                }
            }
            Boundary::Extrapolate => {
                for (edge, inner, ghosts) in [
                    (
                        reach,
                        reach + 1,
                        core::array::from_fn::<_, 3, _>(|k| reach.checked_sub(k + 1)),
                    ),
                    (
                        reach + nodes - 1,
                        reach + nodes - 2,
                        core::array::from_fn(|k| (k < reach).then_some(reach + nodes + k)),
                    ),
                ] {
                    for s in 0..stride {
                        let (end, before) = (line[edge * stride + s], line[inner * stride + s]);
                        let slope = (end - before).abs();
                        let slope = if end < T::ZERO { -slope } else { slope };
                        let mut value = end;
                        for ghost in ghosts.into_iter().flatten() {
                            value += slope;
                            line[ghost * stride + s] = value;
                        }
                    }
                }
            }
        }
    }
}

struct Marcher<'a, T, const D: usize, G, S> {
    problem: &'a Problem<'a, D, G>,
    layout: Layout<D>,
    tables: Tables<T, D>,
    units: [T; D],
    scale: f64,
    workers: Workers,
    slices_per_chunk: usize,
    scheme: core::marker::PhantomData<S>,
}

impl<T: Real, const D: usize, G: Game<D>, S: Stencil> Marcher<'_, T, D, G, S> {
    /// dst ← base combined with source moved by `time_step`.
    fn stage(
        &self,
        time_step: f64,
        source: &[T],
        base: Base<'_, T>,
        limits: &Limits<T>,
        destination: &mut [T],
    ) {
        let sign = if self.problem.direction == Direction::Forward { -1.0 } else { 1.0 };
        let stage = Stage::<T, D, G, S> {
            game: self.problem.game,
            layout: &self.layout,
            tables: &self.tables,
            units: self.units,
            half_mean: T::from_f64(0.5 * sign * self.scale),
            half_difference: T::from_f64(0.5 * self.scale),
            time_step: T::from_f64(time_step),
            source,
            base,
            ceiling: limits.ceiling.as_deref(),
            floor: limits.floor.as_deref(),
            scheme: core::marker::PhantomData,
        };
        let layout = &self.layout;
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        self.workers.for_chunks(inside, self.slices_per_chunk * slice, |chunk, slices| {
            in_widest_lanes(Task { stage, first: chunk * self.slices_per_chunk, slices });
            for d in 1..D {
                fill_ghosts(slices, layout, d, self.problem.grid.axes[d].boundary);
            }
        });
        fill_ghosts(destination, layout, 0, self.problem.grid.axes[0].boundary);
    }

    /// Brings the limits that move to `time`.
    fn move_limits(&self, limits: &mut Limits<T>, time: f64) -> Result<(), Invalid> {
        for (name, limit, region) in [
            ("target", &mut limits.ceiling, Some(&self.problem.target)),
            ("obstacle", &mut limits.floor, self.problem.obstacle.as_ref()),
        ] {
            if let (Some(limit), Some(region)) = (limit, region.filter(|region| region.moves())) {
                self.sample(name, region, time, limit)?;
            }
        }
        Ok(())
    }

    /// Writes `region` at `time` to every interior node.
    fn sample(
        &self,
        name: &str,
        region: &Region<'_, D>,
        time: f64,
        destination: &mut [T],
    ) -> Result<(), Invalid> {
        let (layout, grid) = (&self.layout, &self.problem.grid);
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        // The first slice that holds something else than numbers.
        let bad = AtomicUsize::new(usize::MAX);
        self.workers.for_chunks(inside, slice, |i, data| {
            each_interior(layout, i, |index, offset| {
                data[offset] = T::from_f64(region.at(grid.node(index), time));
                if !data[offset].to_f64().is_finite() {
                    bad.fetch_min(i, Ordering::Relaxed);
                }
            });
        });
        let bad = bad.into_inner();
        if bad == usize::MAX {
            return Ok(());
        }
        self.all_finite(name, destination, bad)
    }

    /// Complains about the first node from slice `first` on whose value is no number.
    fn all_finite(&self, name: &str, data: &[T], first: usize) -> Result<(), Invalid> {
        let (layout, mut complaint) = (&self.layout, None);
        for slice in first..layout.slices() {
            let start = layout.lead() + slice * layout.slice_length();
            each_interior(layout, slice, |index, offset| {
                let value = data[start + offset].to_f64();
                if complaint.is_none() && !value.is_finite() {
                    let state = self.problem.grid.node(index);
                    let found = format!("{value} at {state:?}");
                    complaint = Some(Invalid::new(name, "a finite number at every node", found));
                }
            });
        }
        complaint.map_or(Ok(()), Err)
    }
}

/// Calls `f` with the index of every interior node of slice `slice` and its place in it.
fn each_interior<const D: usize>(
    layout: &Layout<D>,
    slice: usize,
    mut f: impl FnMut([usize; D], usize),
) {
    let first_axis = usize::from(Layout::<D>::LOOP_AXES > 0);
    let count: usize = layout.nodes[first_axis..].iter().product();
    for position in 0..count {
        let mut index = [slice; D];
        let (mut rest, mut offset) = (position, 0);
        for d in (first_axis..D).rev() {
            index[d] = rest % layout.nodes[d];
            rest /= layout.nodes[d];
            offset += (index[d] + layout.reach) * layout.strides[d];
        }
        f(index, offset);
    }
}

/// What V may not exceed and what it may not fall below, on the nodes.
struct Limits<T> {
    ceiling: Option<Vec<T>>,
    floor: Option<Vec<T>>,
}

fn march<T: Real, const D: usize, G: Game<D>, S: Stencil>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T, D>, SolveError> {
    let grid = &problem.grid;
    grid.check(S::REACH)?;
    let (longest, tolerance) = match problem.horizon {
        Horizon::Finite(seconds) => (seconds, None),
        Horizon::Converged { tolerance, longest_s } => (longest_s, Some(tolerance)),
    };
    crate::invalid::positive("horizon_s", longest)?;
    if !(settings.cfl > 0.0 && settings.cfl <= 1.0) {
        return Err(Invalid::new("cfl", "above 0 and at most 1", settings.cfl).into());
    }
    let stages = settings.scheme.stages();
    let limits = usize::from(problem.kind == Kind::Tube) + usize::from(problem.obstacle.is_some());
    let padded = grid
        .axes
        .iter()
        .fold(1_usize, |n, axis| n.saturating_mul(axis.nodes.saturating_add(2 * S::REACH)));
    let arrays = stages.max(2) + limits;
    check_memory(padded, arrays, size_of::<T>(), settings.memory_limit_bytes)?;

    let layout = Layout::new(grid, S::REACH);
    let threads = if grid.len() < SMALL { 1 } else { settings.threads.clamp(1, layout.slices()) };
    let mut marcher = Marcher::<T, D, G, S> {
        problem,
        layout,
        tables: Tables::new(problem.game, grid, &layout),
        units: [T::ZERO; D],
        scale: 1.0,
        workers: Workers::new(threads),
        slices_per_chunk: layout.slices().div_ceil(8 * threads),
        scheme: core::marker::PhantomData,
    };
    let array = || vec![T::ZERO; layout.length];
    let mut value = array();
    marcher.sample("target", &problem.target, 0.0, &mut value)?;
    let mut limits = Limits {
        ceiling: (problem.kind == Kind::Tube).then(|| value.clone()),
        floor: problem.obstacle.as_ref().map(|_| array()),
    };
    if let (Some(floor), Some(obstacle)) = (&mut limits.floor, &problem.obstacle) {
        marcher.sample("obstacle", obstacle, 0.0, floor)?;
        for (value, floor) in value.iter_mut().zip(floor) {
            *value = value.larger(*floor);
        }
    }
    for d in (0..D).rev() {
        fill_ghosts(&mut value[..layout.length - BLOCK], &layout, d, grid.axes[d].boundary);
    }
    marcher.scale = steepest(&value, &layout, grid);
    marcher.units =
        core::array::from_fn(|d| T::from_f64(1.0 / (grid.axes[d].spacing() * marcher.scale)));

    let longest_step = settings.cfl / rate_bound(problem.game, grid)?;
    let planned = (longest / longest_step).ceil().max(1.0);
    if planned > MOST_STEPS {
        let expected = format!("at most {MOST_STEPS:e} time steps of this grid");
        return Err(Invalid::new("horizon_s", expected, format!("{planned:e}")).into());
    }
    let time_step = longest / planned;
    let mut first = array();
    let mut second = if stages == 3 { array() } else { Vec::new() };
    let (half, quarters, third) = (T::from_f64(0.5), T::from_f64(0.75), T::from_f64(1.0 / 3.0));
    let mut steps = 0;
    let mut residual = f64::INFINITY;
    while (steps as f64) < planned {
        steps += 1;
        let time = steps as f64 * time_step;
        marcher.move_limits(&mut limits, time)?;
        marcher.stage(time_step, &value, Base::Nothing, &limits, &mut first);
        let last = steps as f64 >= planned;
        let check = tolerance.is_some() && steps % RESIDUAL_EVERY == 0;
        if check {
            residual = largest_change(&value, &first, &layout) / time_step;
        }
        match stages {
            1 => core::mem::swap(&mut value, &mut first),
            2 => marcher.stage(time_step, &first, Base::Own(half), &limits, &mut value),
            _ => {
                let base = Base::Other(quarters, &value[..]);
                // This stage stands for the middle of the step.
                marcher.move_limits(&mut limits, time - 0.5 * time_step)?;
                marcher.stage(time_step, &first, base, &limits, &mut second);
                marcher.move_limits(&mut limits, time)?;
                marcher.stage(time_step, &second, Base::Own(third), &limits, &mut value);
            }
        }
        let report = Progress { done: steps as f64 / planned, residual };
        if progress(report).is_break() {
            return Err(SolveError::Cancelled);
        }
        if last || tolerance.is_some_and(|tolerance| residual <= tolerance) {
            break;
        }
    }
    // One more Euler stage tells how fast V still changes.
    marcher.stage(time_step, &value, Base::Nothing, &limits, &mut first);
    residual = largest_change(&value, &first, &layout) / time_step;
    drop(first);
    marcher.all_finite("value", &value, 0)?;
    let mut values = vec![T::ZERO; grid.len()];
    let mut write = values.iter_mut();
    for slice in 0..layout.slices() {
        let start = layout.lead() + slice * layout.slice_length();
        each_interior(&layout, slice, |_, offset| {
            if let Some(entry) = write.next() {
                *entry = value[start + offset];
            }
        });
    }
    Ok(Solution { grid: *grid, values, steps, horizon_s: steps as f64 * time_step, residual })
}

/// More time steps than this would take days on any grid.
const MOST_STEPS: f64 = 1e8;
/// Fewer cells than this are not worth more than one thread.
const SMALL: usize = 50_000;
/// Steps between two looks at the residual.
const RESIDUAL_EVERY: usize = 8;

/// Largest slope between neighbours along any axis; 1 if there is none.
fn steepest<T: Real, const D: usize>(value: &[T], layout: &Layout<D>, grid: &Grid<D>) -> f64 {
    let mut steepest = 0.0_f64;
    for slice in 0..layout.slices() {
        let start = layout.lead() + slice * layout.slice_length();
        each_interior(layout, slice, |index, offset| {
            for d in 0..D {
                if index[d] + 1 < layout.nodes[d] {
                    let at = start + offset;
                    let rise = value[at + layout.strides[d]].to_f64() - value[at].to_f64();
                    steepest = steepest.max(rise.abs() / grid.axes[d].spacing());
                }
            }
        });
    }
    if steepest > 0.0 && steepest.is_finite() { steepest } else { 1.0 }
}

/// max over the nodes of Σ speed_d/Δx_d: one over the largest stable time step.
fn rate_bound<const D: usize, G: Game<D>>(game: &G, grid: &Grid<D>) -> Result<f64, Invalid> {
    let tables: [Vec<[f64; TERMS]>; D] = core::array::from_fn(|d| {
        grid.axes[d].coordinates().iter().map(|x| game.terms(d, *x)).collect()
    });
    let per_spacing = grid.axes.map(|axis| 1.0 / axis.spacing());
    let mut index = [0; D];
    let mut fastest = 0.0_f64;
    'nodes: loop {
        let terms = core::array::from_fn(|d| tables[d][index[d]]);
        let speeds = game.speed_bounds(&terms);
        let rate: f64 = (0..D).map(|d| speeds[d] * per_spacing[d]).sum();
        if !rate.is_finite() {
            let found = format!("{speeds:?} at {:?}", grid.node(index));
            return Err(Invalid::new("game", "finite speed bounds at every node", found));
        }
        fastest = fastest.max(rate);
        for d in (0..D).rev() {
            index[d] += 1;
            if index[d] < grid.axes[d].nodes {
                continue 'nodes;
            }
            index[d] = 0;
        }
        // A game without motion: any step will do.
        return Ok(fastest.max(1e-12));
    }
}

fn largest_change<T: Real, const D: usize>(from: &[T], to: &[T], layout: &Layout<D>) -> f64 {
    let mut largest = 0.0_f64;
    for slice in 0..layout.slices() {
        let start = layout.lead() + slice * layout.slice_length();
        each_interior(layout, slice, |_, offset| {
            let at = start + offset;
            largest = largest.max((to[at].to_f64() - from[at].to_f64()).abs());
        });
    }
    largest
}
