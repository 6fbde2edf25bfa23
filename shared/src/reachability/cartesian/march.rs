//! Marches V in time steps from the target to the horizon.

use super::super::grid::Grid;
use super::super::progress::{Progress, SolveError, check_memory};
use super::super::scheme::JUMP_REACH;
use super::kernel::{Base, Moves, Part, Stage};
use super::layout::{BLOCK, Ghosts, Layout, each_interior, fill_ghosts};
use super::limits::{Limits, Nodes, STEEP, joined, range, steepest};
use super::mirror::Mirror;
use super::tables::Tables;
use super::{Direction, Horizon, Kind, Problem, Region, Settings, ShallowObstacle, Solution};
use crate::invalid::Invalid;
use crate::parallel::{Lanes, Workers};
use crate::real::Real;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicUsize, Ordering};

struct Marcher<'a, T, const D: usize> {
    problem: &'a Problem<'a, D, ()>,
    moves: &'a dyn Moves<T, D>,
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
}

impl<T: Real, const D: usize> Marcher<'_, T, D> {
    /// Advances `source` by `time_step`, combines the result with `base` and writes it to
    /// `destination`.
    fn stage(
        &self,
        time_step: f64,
        source: &[T],
        base: Base<'_, T>,
        limits: &Limits<T>,
        destination: &mut [T],
    ) {
        let sign = if self.problem.direction == Direction::Forward { -1.0 } else { 1.0 };
        let stage = Stage {
            layout: &self.layout,
            tables: &self.tables,
            units: self.units,
            steep: (self.moves.reach() > 1 && limits.floor.is_some())
                .then(|| limits.steep(&self.grid).map(T::from_f64)),
            near: limits.hidden(),
            jumps: limits.jumps,
            half_mean: T::from_f64(0.5 * sign * self.scale),
            half_difference: T::from_f64(0.5 * self.scale),
            time_step: T::from_f64(time_step),
            source,
            base,
            ceiling: limits.ceiling.as_deref(),
            floor: limits.floor.as_deref(),
            range: limits.range(self.cfl),
        };
        let layout = &self.layout;
        let ghosts = self.ghosts();
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        self.workers.for_chunks(inside, self.slices_per_chunk * slice, |chunk, slices| {
            let first = chunk * self.slices_per_chunk;
            self.moves.advance(self.lanes, stage, Part { first, slices, ghosts });
        });
        fill_ghosts(destination, layout, 0, ghosts[0], limits.jumps);
    }

    /// The ghosts of each axis.
    fn ghosts(&self) -> [Ghosts<'_>; D] {
        core::array::from_fn(|d| match &self.mirror {
            Some(Mirror { axis, centred, .. }) if *axis == d => {
                Ghosts::Mirrored { centred: *centred, cells: &self.cells }
            }
            _ => Ghosts::Of(self.grid.axes[d].boundary),
        })
    }

    fn every_node(&self) -> Nodes<'_, D> {
        let Self { grid, layout, workers, .. } = self;
        Nodes { grid, layout, ghosts: self.ghosts(), workers }
    }

    /// Updates time-dependent limits to `time`.
    fn move_limits(&self, limits: &mut Limits<T>, time: f64) -> Result<(), Invalid> {
        if let Some(ceiling) = &mut limits.ceiling
            && self.problem.target.moves()
        {
            self.sample("target", &self.problem.target, 1.0, time, ceiling)?;
            limits.seen = joined(limits.seen, range(ceiling, &self.layout));
        }
        if let (Some(floor), Some(avoid)) = (&mut limits.floor, &self.problem.avoid)
            && (avoid.region.moves() || self.problem.target.moves())
        {
            self.sample(avoid.name(), &avoid.region, avoid.sign, time, floor)?;
            limits.cap_floor();
            limits.look_for_jumps(&self.every_node());
        }
        Ok(())
    }

    /// V at the nodes of the whole grid at `time`, row-major. The obstacle has its full height,
    /// even if the march caps it.
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

    /// Calls `f` with each node and its value.
    fn each_node(&self, data: &[T], mut f: impl FnMut([usize; D], f64)) {
        for slice in 0..self.layout.slices() {
            let start = self.layout.lead() + slice * self.layout.slice_length();
            each_interior(&self.layout, slice, |index, offset| {
                f(index, data[start + offset].to_f64());
            });
        }
    }

    /// Returns a [`ShallowObstacle`] if V beside the obstacle is far flatter than the target.
    fn shallow(&self, floor: &[T], limits: &Limits<T>) -> Option<ShallowObstacle> {
        let (target, lowest) = (limits.seen[0], range(floor, &self.layout)[0]);
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

    /// Rejects a fixed obstacle that covers all of the grid, or all of a fixed target.
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

    /// Writes `sign` · `region` at `time` to every interior node.
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

    /// Checks that V after `time` is finite and, for a tube, within the bounds from target and
    /// obstacle. The error names the first node that fails.
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
                    let range = format!("from {low} to {high}, bounded by target and obstacle");
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

    /// Returns an error that names the first node, from slice `first` on, whose value is not
    /// finite.
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

pub(super) fn march<T: Real, const D: usize>(
    problem: &Problem<'_, D, ()>,
    moves: &dyn Moves<T, D>,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T, D>, SolveError> {
    problem.grid.check(moves.reach())?;
    let (longest, tolerance) = match problem.horizon {
        Horizon::Finite(seconds) => (seconds, None),
        Horizon::Converged { tolerance, longest_s } => (longest_s, Some(tolerance)),
    };
    crate::invalid::positive("horizon_s", longest)?;
    if !(settings.cfl > 0.0 && settings.cfl <= 1.0) {
        return Err(Invalid::new("cfl", "above 0 and at most 1", settings.cfl).into());
    }
    check_times(problem, settings)?;
    // A first-order scheme need not search for jumps.
    let looks = problem.avoid.is_some() && moves.reach() > 1;
    let reach = if looks { JUMP_REACH } else { moves.reach() };
    let stages = settings.scheme.stages();
    // The arrays of limits: the target's values, the obstacle's values, and the proximity of the
    // obstacle's jumps.
    let limits = [problem.kind == Kind::Tube, problem.avoid.is_some(), looks].map(usize::from);
    let padded = problem
        .grid
        .axes
        .iter()
        .fold(1_usize, |n, axis| n.saturating_mul(axis.nodes.saturating_add(2 * reach)));
    let arrays = (stages.max(2) + limits.iter().sum::<usize>()).saturating_add(settings.slices);
    check_memory(padded, arrays, size_of::<T>(), settings.memory_limit_bytes)?;
    // This visits every node, so it comes after the check of the number of nodes.
    let mirror = Mirror::of(problem, moves.mirror(), reach);
    let grid = mirror.as_ref().map_or(problem.grid, Mirror::half);

    let layout = Layout::new(&grid, reach);
    let threads = if grid.len() < SMALL { 1 } else { settings.threads.clamp(1, layout.slices()) };
    let mut marcher = Marcher {
        problem,
        moves,
        grid,
        cells: mirror.as_ref().map_or(Vec::new(), |mirror| mirror.cells(&layout)),
        mirror,
        layout,
        tables: moves.tables(&grid, &layout),
        units: [T::ZERO; D],
        scale: 1.0,
        cfl: settings.cfl,
        workers: Workers::new(threads),
        lanes: settings.lanes,
        slices_per_chunk: layout.slices().div_ceil(4 * threads),
    };
    let array = || vec![T::ZERO; layout.length];
    let mut value = array();
    marcher.sample("target", &problem.target, 1.0, 0.0, &mut value)?;
    let ceiling = (problem.kind == Kind::Tube).then(|| value.clone());
    let floor = problem.avoid.as_ref().map(|_| array());
    let near = if looks { array() } else { Vec::new() };
    let mut limits = Limits::new(&value, &layout, &grid, [ceiling, floor], near);
    if let (Some(floor), Some(avoid)) = (&mut limits.floor, &problem.avoid) {
        marcher.sample(avoid.name(), &avoid.region, avoid.sign, 0.0, floor)?;
        marcher.check_room(&value, floor)?;
    }
    let shallow = limits.floor.as_ref().and_then(|floor| marcher.shallow(floor, &limits));
    limits.cap_floor();
    limits.look_for_jumps(&marcher.every_node());
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

    let speeds = moves.speeds(&problem.grid)?;
    let longest_step = settings.cfl / speeds.rate;
    let planned = (longest / longest_step).ceil().max(1.0);
    // Each stored instant must be the end of a time step.
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
                // This stage gives V in the middle of the time step.
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
    // One more Euler stage measures how fast V still changes.
    marcher.stage(time_step, &value, Base::Nothing, &limits, &mut first);
    residual = largest_change(&value, &first, &layout) / time_step;
    let time = steps as f64 * time_step;
    marcher.check_values(&value, &limits, time)?;
    let values = marcher.stored(&value, &limits, time, &mut first)?;
    let Problem { direction, kind, .. } = *problem;
    // If the march reached its end, this is the exact horizon, without rounding error.
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

/// Rejects settings and regions that need a finite horizon, if the problem has none.
fn check_times<const D: usize>(
    problem: &Problem<'_, D, ()>,
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
            return Err(Invalid::new(name, expected, "one that depends on forward time"));
        }
    }
    Ok(())
}

/// More time steps than this would take days on any grid.
const MOST_STEPS: f64 = 1e8;
/// A grid with fewer cells than this uses only one thread.
const SMALL: usize = 50_000;
/// Number of steps between two measurements of the residual.
const RESIDUAL_EVERY: usize = 8;
/// Number of steps between two checks of all values. NaN spreads, so rare checks suffice.
const CHECK_EVERY: usize = 16;

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
