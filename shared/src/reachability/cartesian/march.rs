//! Steps in time, from the target to the horizon.

use super::super::game::Game;
use super::super::grid::Grid;
use super::super::progress::{Progress, SolveError, check_memory};
use super::super::scheme::{JUMP_REACH, Stencil};
use super::kernel::{Base, Range, Stage, Tables, Task};
use super::layout::{BLOCK, Ghosts, Layout, each_interior, fill_ghosts};
use super::mirror::Mirror;
use super::speeds::Speeds;
use super::{Direction, Horizon, Kind, Problem, Region, Settings, ShallowObstacle, Solution};
use crate::invalid::Invalid;
use crate::parallel::{Lanes, Workers, in_lanes};
use crate::real::Real;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

struct Marcher<'a, T, const D: usize, G, S> {
    problem: &'a Problem<'a, D, G>,
    /// The nodes that are computed: all, or half of them.
    grid: Grid<D>,
    mirror: Option<Mirror<D>>,
    /// See [`Mirror::cells`].
    cells: Vec<(usize, usize)>,
    layout: Layout<D>,
    tables: Tables<T, D>,
    units: [T; D],
    scale: f64,
    cfl: f64,
    workers: Workers,
    lanes: Lanes,
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
            steep: (S::REACH > 1 && limits.floor.is_some())
                .then(|| self.steep(limits.slope).map(T::from_f64)),
            near: (S::REACH > 1 && limits.hides_jumps).then_some(&limits.near),
            jumps: limits.jumps,
            half_mean: T::from_f64(0.5 * sign * self.scale),
            half_difference: T::from_f64(0.5 * self.scale),
            time_step: T::from_f64(time_step),
            source,
            base,
            ceiling: limits.ceiling.as_deref(),
            floor: limits.floor.as_deref(),
            range: limits.range(self.cfl),
            scheme: core::marker::PhantomData,
        };
        let layout = &self.layout;
        let ghosts = self.ghosts();
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        self.workers.for_chunks(inside, self.slices_per_chunk * slice, |chunk, slices| {
            let first = chunk * self.slices_per_chunk;
            in_lanes(self.lanes, Task { stage, first, slices, ghosts });
        });
        fill_ghosts(destination, layout, 0, ghosts[0], limits.jumps);
    }

    /// Differences of neighbours, by axis, that are far steeper than `slope`.
    fn steep(&self, slope: f64) -> [f64; D] {
        self.grid.axes.map(|axis| STEEP * slope * axis.spacing())
    }

    /// What the ghosts of each axis are.
    fn ghosts(&self) -> [Ghosts<'_>; D] {
        core::array::from_fn(|d| match &self.mirror {
            Some(Mirror { axis, centred, .. }) if *axis == d => {
                Ghosts::Mirrored { centred: *centred, cells: &self.cells }
            }
            _ => Ghosts::Of(self.grid.axes[d].boundary),
        })
    }

    /// Brings the limits that move to `time`.
    fn move_limits(&self, limits: &mut Limits<T>, time: f64) -> Result<(), Invalid> {
        if let Some(ceiling) = &mut limits.ceiling
            && self.problem.target.moves()
        {
            self.sample("target", &self.problem.target, 1.0, time, ceiling)?;
            limits.seen = joined(limits.seen, self.range(ceiling));
        }
        if let (Some(floor), Some(avoid)) = (&mut limits.floor, &self.problem.avoid)
            && (avoid.region.moves() || self.problem.target.moves())
        {
            self.sample(avoid.name(), &avoid.region, avoid.sign, time, floor)?;
            limits.cap_floor();
            self.look_for_jumps(limits);
        }
        Ok(())
    }

    /// Notes whether the obstacle jumps: whether, within the target's values, the difference of two neighbours is more than
    /// a quarter of the obstacle's range and than four times those beside it that have its sign, as no slope's is. Where it
    /// is too low there to be far steeper than the target's steepest slope, that slope hides the jumps of V. This matters in
    /// passages: elsewhere first order would cost more than jumps do.
    fn look_for_jumps(&self, limits: &mut Limits<T>) {
        let Some(floor) = &limits.floor else { return };
        let (layout, lowest) = (&self.layout, limits.seen[0]);
        let (lead, length) = (layout.lead(), layout.slice_length());
        let [low, high] = self.range(floor).map(|value| value.max(lowest));
        let (share, hidden) = (0.25 * (high - low), T::from_f64(NEAR));
        let (steep, jumps) = (self.steep(limits.slope), AtomicBool::new(limits.jumps));
        let inside = &mut limits.near[lead..lead + layout.slices() * length];
        self.workers.for_chunks(inside, length, |i, near| {
            each_interior(layout, i, |index, offset| {
                let value = |at: usize| floor[at].to_f64().max(lowest);
                let place = lead + i * length + offset;
                let here = value(place);
                for (d, axis) in self.grid.axes.iter().enumerate() {
                    let (nodes, stride) = (axis.nodes as isize, layout.strides[d]);
                    let first = place - index[d] * stride;
                    // Nearly everywhere there is none, and that is soon seen.
                    let is_end = index[d] == 0 || index[d] + 1 == axis.nodes;
                    let is_flat = |at: usize| (value(at) - here).abs() <= share;
                    if !is_end && is_flat(place - stride) && is_flat(place + stride) {
                        continue;
                    }
                    let at = |k: isize| {
                        let k = if axis.is_periodic() { k.rem_euclid(nodes) } else { k };
                        (0..nodes).contains(&k).then(|| value(first + k as usize * stride))
                    };
                    // From the k-th node of the axis to the next; 0 beyond an end.
                    let rise = |k: isize| match (at(k), at(k + 1)) {
                        (Some(this), Some(next)) => next - this,
                        _ => 0.0,
                    };
                    let is_jump = |k: isize| {
                        let this = rise(k);
                        let beside = |k: isize| rise(k) * this.signum();
                        let size = this.abs();
                        size > share && size > STEEP * beside(k - 1).max(beside(k + 1))
                    };
                    // From the foot of a wall on: whether another one, or the end, is near.
                    let is_passage = |k: isize| {
                        let way = -rise(k).signum() as isize;
                        (1..=PASSAGE).map(|nodes| k + way * nodes).any(|k| {
                            at(k).is_none()
                                || at(k + 1).is_none()
                                || way as f64 * rise(k) > 0.0 && is_jump(k)
                        })
                    };
                    let node = index[d] as isize;
                    for k in [node - 1, node].into_iter().filter(|k| is_jump(*k)) {
                        jumps.store(true, Ordering::Relaxed);
                        let height = at(k).into_iter().chain(at(k + 1)).fold(low, f64::max);
                        if height <= steep[d] && is_passage(k) {
                            near[offset] = hidden;
                        }
                    }
                }
            });
        });
        limits.jumps = jumps.into_inner();
        limits.hides_jumps |= inside.contains(&hidden);
        if limits.hides_jumps {
            let near = &mut limits.near[..layout.length - BLOCK];
            for d in 0..D {
                spread(near, layout, d, self.grid.axes[d].is_periodic());
            }
            for d in (0..D).rev() {
                fill_ghosts(near, layout, d, self.ghosts()[d], false);
            }
        }
    }

    /// The values of the whole grid's nodes at `time`, row-major, an obstacle's at its own height.
    fn stored(
        &self,
        value: &[T],
        limits: &Limits<T>,
        time: f64,
        scratch: &mut [T],
    ) -> Result<Vec<T>, Invalid> {
        let Some(avoid) = self.problem.avoid.as_ref().filter(|_| limits.is_capped) else {
            return Ok(self.nodes(value));
        };
        self.sample(avoid.name(), &avoid.region, avoid.sign, time, scratch)?;
        for (floor, value) in scratch.iter_mut().zip(value) {
            *floor = floor.larger(*value);
        }
        Ok(self.nodes(scratch))
    }

    /// The least and the largest value at a node.
    fn range(&self, data: &[T]) -> [f64; 2] {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        self.each_node(data, |_, value| range = joined(range, [value; 2]));
        range
    }

    /// Calls `f` with each node and its value.
    fn each_node(&self, data: &[T], mut f: impl FnMut([usize; D], f64)) {
        for slice in 0..self.layout.slices() {
            let start = self.layout.lead() + slice * self.layout.slice_length();
            each_interior(&self.layout, slice, |index, offset| {
                f(index, data[start + offset].to_f64());
            });
        }
    }

    /// What to tell of an obstacle beside which V is far flatter than the target.
    fn shallow(&self, floor: &[T], limits: &Limits<T>) -> Option<ShallowObstacle> {
        let (target, lowest) = (limits.seen[0], self.range(floor)[0]);
        if lowest <= target {
            return None;
        }
        let [mut free, mut lowest_ones] = [0, 0];
        self.each_node(floor, |_, value| {
            free += usize::from(value <= 0.0);
            lowest_ones += usize::from(value <= 0.99 * lowest.min(0.0));
        });
        let is_flat = 2 * lowest_ones > free
            || STEEP * steepest(floor, &self.layout, &self.grid) < limits.slope;
        (free > 0 && is_flat).then_some(ShallowObstacle { lowest, target })
    }

    /// Refuses a fixed obstacle outside of which there is nothing, or nothing of a fixed target.
    fn check_room(&self, target: &[T], floor: &[T]) -> Result<(), Invalid> {
        let Some(avoid) = self.problem.avoid.as_ref().filter(|avoid| !avoid.region.moves()) else {
            return Ok(());
        };
        let (mut is_free, mut has_target, mut is_reachable) = (false, false, false);
        for slice in 0..self.layout.slices() {
            let start = self.layout.lead() + slice * self.layout.slice_length();
            each_interior(&self.layout, slice, |_, offset| {
                let free = floor[start + offset] <= T::ZERO;
                let reached = target[start + offset] <= T::ZERO;
                is_free |= free;
                has_target |= reached;
                is_reachable |= free && reached;
            });
        }
        let found = if !is_free {
            "one that covers all of the grid"
        } else if has_target && !is_reachable && !self.problem.target.moves() {
            "one that covers all of the target"
        } else {
            return Ok(());
        };
        let inside = if avoid.sign < 0.0 { "negative" } else { "positive" };
        let expected = format!(
            "a function that is {inside} in the obstacle (the target's is negative inside), \
             and an obstacle that leaves some of the target free"
        );
        Err(Invalid::new(avoid.name(), expected, found))
    }

    /// Writes `region` at `time` to every interior node.
    fn sample(
        &self,
        name: &str,
        region: &Region<'_, D>,
        sign: f64,
        time: f64,
        destination: &mut [T],
    ) -> Result<(), Invalid> {
        let (layout, grid) = (&self.layout, &self.grid);
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        let clock = self.problem.clock(time);
        // The first slice with a value that is not finite.
        let bad = AtomicUsize::new(usize::MAX);
        self.workers.for_chunks(inside, slice, |i, data| {
            each_interior(layout, i, |index, offset| {
                data[offset] = T::from_f64(sign * region.at(grid.node(index), time, clock));
                if !data[offset].to_f64().is_finite() {
                    bad.fetch_min(i, Ordering::Relaxed);
                }
            });
        });
        let bad = bad.into_inner();
        if bad == usize::MAX {
            return Ok(());
        }
        self.all_finite(name, sign, destination, bad)
    }

    /// The values of the whole grid's nodes, row-major.
    fn nodes(&self, value: &[T]) -> Vec<T> {
        let (layout, grid) = (&self.layout, &self.grid);
        let mut nodes = Vec::with_capacity(grid.len());
        for slice in 0..layout.slices() {
            let start = layout.lead() + slice * layout.slice_length();
            each_interior(layout, slice, |_, offset| nodes.push(value[start + offset]));
        }
        match &self.mirror {
            Some(mirror) => mirror.whole(&nodes),
            None => nodes,
        }
    }

    /// Checks V after `time`: finite, and a tube's between the bounds that target and obstacle give. The first node
    /// where it is not is named.
    fn check_values(&self, data: &[T], limits: &Limits<T>, time: f64) -> Result<(), Invalid> {
        let mut complaint = None;
        for slice in 0..self.layout.slices() {
            let start = self.layout.lead() + slice * self.layout.slice_length();
            each_interior(&self.layout, slice, |index, offset| {
                let at = start + offset;
                let value = data[at].to_f64();
                let floor =
                    limits.floor.as_ref().map_or(f64::NEG_INFINITY, |floor| floor[at].to_f64());
                let bounds = limits
                    .ceiling
                    .as_ref()
                    .map(|ceiling| [limits.seen[0].max(floor), ceiling[at].to_f64().max(floor)]);
                let is_right = value.is_finite()
                    && bounds.is_none_or(|[low, high]| low <= value && value <= high);
                if complaint.is_none() && !is_right {
                    let place = format!("{value} at {:?} after {time} s", self.grid.node(index));
                    let [low, high] = bounds.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                    let range = format!("from {low} to {high}, as the target and the obstacle say");
                    let range = if bounds.is_some() { &range } else { "finite" };
                    let expected = format!(
                        "{range}; the game moves V further in one step than its speed bounds allow, or a number is too large for {}: correct the bounds, or take smaller units or f64",
                        core::any::type_name::<T>()
                    );
                    complaint = Some(Invalid::new("value", expected, place));
                }
            });
        }
        complaint.map_or(Ok(()), Err)
    }

    /// Names the first node from slice `first` on whose value is not finite.
    fn all_finite(&self, name: &str, sign: f64, data: &[T], first: usize) -> Result<(), Invalid> {
        let (layout, mut complaint) = (&self.layout, None);
        for slice in first..layout.slices() {
            let start = layout.lead() + slice * layout.slice_length();
            each_interior(layout, slice, |index, offset| {
                let value = sign * data[start + offset].to_f64();
                if complaint.is_none() && !value.is_finite() {
                    let state = self.grid.node(index);
                    let found = format!("{value} at {state:?}");
                    complaint = Some(Invalid::new(name, "a finite number at every node", found));
                }
            });
        }
        complaint.map_or(Ok(()), Err)
    }
}

/// What V may not exceed and what it may not fall below, on the nodes.
struct Limits<T> {
    ceiling: Option<Vec<T>>,
    floor: Option<Vec<T>>,
    /// Whether the obstacle has been higher somewhere than it is in `floor`.
    is_capped: bool,
    /// Whether the obstacle has had jumps, and V may still have them.
    jumps: bool,
    /// Whether the target's slope has hidden some.
    hides_jumps: bool,
    /// [`NEAR`] at the nodes where it has, and one less for each cell away from there. Empty without an obstacle.
    near: Vec<T>,
    /// The target's steepest slope at the beginning.
    slope: f64,
    /// The least and the largest value of the target so far.
    seen: [f64; 2],
}

impl<T: Real> Limits<T> {
    /// Lowers an obstacle to M, the largest magnitude of the target. A path's value is
    /// max(target at its end, highest obstacle on it), and max(l, g) is at most M exactly where max(l, min(g, M)) is, so
    /// that this changes V to min(V, M) and no sign. Numbers that are far above the target's, as those that stand for
    /// "never", would round the target's away beside them, and bring their error into V.
    fn cap_floor(&mut self) {
        let cap = T::from_f64(self.largest());
        for floor in self.floor.iter_mut().flatten() {
            self.is_capped |= *floor > cap;
            *floor = floor.smaller(cap);
        }
    }

    /// The largest magnitude of the target so far; infinite for one that is 0 everywhere.
    fn largest(&self) -> f64 {
        let largest = self.seen[0].abs().max(self.seen[1].abs());
        if largest > 0.0 { largest } else { f64::INFINITY }
    }

    /// Where the values of a tube are, and where one stage can bring them. Neighbours, ghosts too, differ by at most
    /// the range R of the data, and second differences by at most 2 R, so that no one-sided derivative exceeds
    /// (1 + 14/6) R over the spacing: ENO3's and WENO's coefficients. A stage moves V by at most
    /// Δt Σ speed (|mean of two| + |half of their difference|), and Δt Σ speed/Δx is at most the share `cfl`.
    fn range(&self, cfl: f64) -> Range<T> {
        let lowest = self.seen[0];
        let highest = if self.floor.is_some() { self.largest() } else { self.seen[1] };
        let most = 2.0 * cfl * (10.0 / 3.0) * (highest - lowest);
        // Rounding of the sums, in the narrower type.
        let rounding = 1e-4 * (most + lowest.abs().max(highest.abs()));
        let possible = [lowest - most - rounding, highest + most + rounding].map(T::from_f64);
        Range { lowest: T::from_f64(lowest), possible }
    }
}

/// Spreads along `axis` how near a jump is.
fn spread<T: Real, const D: usize>(
    near: &mut [T],
    layout: &Layout<D>,
    axis: usize,
    is_periodic: bool,
) {
    let (reach, nodes, stride) = (layout.reach, layout.nodes[axis], layout.strides[axis]);
    // Twice around where there is no end.
    let steps = if is_periodic { 2 * nodes } else { nodes };
    for line in near.chunks_exact_mut((nodes + 2 * reach) * stride) {
        let mut pass = |to: usize, from: usize| {
            for k in 0..stride {
                let there = line[(reach + from) * stride + k] - T::from_f64(1.0);
                let here = &mut line[(reach + to) * stride + k];
                *here = here.larger(there);
            }
        };
        for k in 1..steps {
            let (this, last) = (k % nodes, (k - 1) % nodes);
            pass(this, last);
        }
        for k in (1..steps).rev() {
            let (this, last) = (k % nodes, (k - 1) % nodes);
            pass(last, this);
        }
    }
}

/// The range of both.
fn joined([low, high]: [f64; 2], [other_low, other_high]: [f64; 2]) -> [f64; 2] {
    [low.min(other_low), high.max(other_high)]
}

pub(super) fn march<T: Real, const D: usize, G: Game<D>, S: Stencil>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T, D>, SolveError> {
    problem.grid.check(S::REACH)?;
    let (longest, tolerance) = match problem.horizon {
        Horizon::Finite(seconds) => (seconds, None),
        Horizon::Converged { tolerance, longest_s } => (longest_s, Some(tolerance)),
    };
    crate::invalid::positive("horizon_s", longest)?;
    if !(settings.cfl > 0.0 && settings.cfl <= 1.0) {
        return Err(Invalid::new("cfl", "above 0 and at most 1", settings.cfl).into());
    }
    check_times(problem, settings)?;
    // First order needs to look for no jumps.
    let looks = problem.avoid.is_some() && S::REACH > 1;
    let reach = if looks { JUMP_REACH } else { S::REACH };
    let stages = settings.scheme.stages();
    // The target's values; the obstacle's, and how near its jumps are.
    let limits = usize::from(problem.kind == Kind::Tube) + 2 * usize::from(problem.avoid.is_some());
    let padded = problem
        .grid
        .axes
        .iter()
        .fold(1_usize, |n, axis| n.saturating_mul(axis.nodes.saturating_add(2 * reach)));
    let arrays = (stages.max(2) + limits).saturating_add(settings.slices);
    check_memory(padded, arrays, size_of::<T>(), settings.memory_limit_bytes)?;
    // It looks at every node: after the check that there are not too many.
    let mirror = Mirror::of(problem, reach);
    let grid = mirror.as_ref().map_or(problem.grid, Mirror::half);

    let layout = Layout::new(&grid, reach);
    let threads = if grid.len() < SMALL { 1 } else { settings.threads.clamp(1, layout.slices()) };
    let mut marcher = Marcher::<T, D, G, S> {
        problem,
        grid,
        cells: mirror.as_ref().map_or(Vec::new(), |mirror| mirror.cells(&layout)),
        mirror,
        layout,
        tables: Tables::new(problem.game, &grid, &layout),
        units: [T::ZERO; D],
        scale: 1.0,
        cfl: settings.cfl,
        workers: Workers::new(threads),
        lanes: settings.lanes,
        slices_per_chunk: layout.slices().div_ceil(4 * threads),
        scheme: core::marker::PhantomData,
    };
    let array = || vec![T::ZERO; layout.length];
    let mut value = array();
    marcher.sample("target", &problem.target, 1.0, 0.0, &mut value)?;
    let mut limits = Limits {
        ceiling: (problem.kind == Kind::Tube).then(|| value.clone()),
        floor: problem.avoid.as_ref().map(|_| array()),
        is_capped: false,
        jumps: false,
        hides_jumps: false,
        near: if problem.avoid.is_some() { array() } else { Vec::new() },
        slope: steepest(&value, &layout, &grid),
        seen: marcher.range(&value),
    };
    if let (Some(floor), Some(avoid)) = (&mut limits.floor, &problem.avoid) {
        marcher.sample(avoid.name(), &avoid.region, avoid.sign, 0.0, floor)?;
        marcher.check_room(&value, floor)?;
    }
    let shallow = limits.floor.as_ref().and_then(|floor| marcher.shallow(floor, &limits));
    limits.cap_floor();
    marcher.look_for_jumps(&mut limits);
    for (value, floor) in value.iter_mut().zip(limits.floor.iter().flatten()) {
        *value = value.larger(*floor);
    }
    for d in (0..D).rev() {
        let inside = &mut value[..layout.length - BLOCK];
        fill_ghosts(inside, &layout, d, marcher.ghosts()[d], limits.jumps);
    }
    marcher.scale = steepest(&value, &layout, &grid);
    marcher.units =
        core::array::from_fn(|d| T::from_f64(1.0 / (grid.axes[d].spacing() * marcher.scale)));

    let speeds = Speeds::of(problem.game, &problem.grid)?;
    let longest_step = settings.cfl / speeds.rate;
    let planned = (longest / longest_step).ceil().max(1.0);
    // Stored instants are ends of time steps.
    let parts = settings.slices.max(1) as f64;
    let planned = (planned / parts).ceil() * parts;
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
    let mut earlier = Vec::new();
    while (steps as f64) < planned {
        if settings.slices > 0 && steps % (planned / parts) as usize == 0 {
            let time = steps as f64 * time_step;
            earlier.push(marcher.stored(&value, &limits, time, &mut first)?);
        }
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
        if steps % CHECK_EVERY == 0 {
            marcher.check_values(&value, &limits, time)?;
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
    let time = steps as f64 * time_step;
    marcher.check_values(&value, &limits, time)?;
    let values = marcher.stored(&value, &limits, time, &mut first)?;
    let Problem { direction, kind, .. } = *problem;
    // Without rounding where the march went to its end.
    let horizon_s = if steps as f64 >= planned { longest } else { steps as f64 * time_step };
    Ok(Solution {
        grid: problem.grid,
        values,
        earlier,
        direction,
        kind,
        steps,
        horizon_s,
        residual,
        exit_s: Some(speeds.exit_s(&problem.grid)),
        shallow,
    })
}

/// Refuses what needs to know when the march ends, if nobody knows.
fn check_times<const D: usize, G>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
) -> Result<(), Invalid> {
    let Horizon::Converged { .. } = problem.horizon else {
        return Ok(());
    };
    if settings.slices > 0 {
        return Err(Invalid::new("slices", "0, unless the horizon is finite", settings.slices));
    }
    for (name, region) in [
        ("target", Some(&problem.target)),
        ("avoid", problem.avoid.as_ref().map(|avoid| &avoid.region)),
    ] {
        if matches!(region, Some(Region::OfTime(_))) && problem.direction == Direction::Backward {
            let expected = "a region that is static or of march time, unless the horizon is finite";
            return Err(Invalid::new(name, expected, "one of a clock that has no beginning"));
        }
    }
    Ok(())
}

/// More time steps than this would take days on any grid.
const MOST_STEPS: f64 = 1e8;
/// Fewer cells than this are not worth more than one thread.
const SMALL: usize = 50_000;
/// How many times as steep as others is a jump, where there is an obstacle.
const STEEP: f64 = 4.0;
/// At most this many nodes between walls, or a wall and the grid's end, are a passage.
const PASSAGE: isize = 6;
/// How many cells away from jumps faces may be of first order although nothing in them jumps.
const NEAR: f64 = 8.0;
/// Steps between two looks at the residual.
const RESIDUAL_EVERY: usize = 8;
/// Steps between two looks at all values: what is no number spreads.
const CHECK_EVERY: usize = 16;

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
