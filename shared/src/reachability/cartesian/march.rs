//! Steps in time, from the target to the horizon.

use super::super::game::{Game, TERMS};
use super::super::grid::Grid;
use super::super::progress::{Progress, SolveError, check_memory};
use super::super::scheme::Stencil;
use super::kernel::{Base, Stage, Tables, Task};
use super::layout::{BLOCK, Ghosts, Layout, each_interior, fill_ghosts};
use super::mirror::Mirror;
use super::{Direction, Horizon, Kind, Problem, Region, Settings, Solution};
use crate::invalid::Invalid;
use crate::parallel::{Lanes, Workers, in_lanes};
use crate::real::Real;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicUsize, Ordering};

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
        let ghosts = self.ghosts();
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        self.workers.for_chunks(inside, self.slices_per_chunk * slice, |chunk, slices| {
            let first = chunk * self.slices_per_chunk;
            in_lanes(self.lanes, Task { stage, first, slices, ghosts });
        });
        fill_ghosts(destination, layout, 0, ghosts[0]);
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
        let (layout, grid) = (&self.layout, &self.grid);
        let (lead, slice) = (layout.lead(), layout.slice_length());
        let inside = &mut destination[lead..lead + layout.slices() * slice];
        let clock = self.problem.clock(time);
        // The first slice with a value that is not finite.
        let bad = AtomicUsize::new(usize::MAX);
        self.workers.for_chunks(inside, slice, |i, data| {
            each_interior(layout, i, |index, offset| {
                data[offset] = T::from_f64(region.at(grid.node(index), time, clock));
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

    /// Names the first node from slice `first` on whose value is not finite.
    fn all_finite(&self, name: &str, data: &[T], first: usize) -> Result<(), Invalid> {
        let (layout, mut complaint) = (&self.layout, None);
        for slice in first..layout.slices() {
            let start = layout.lead() + slice * layout.slice_length();
            each_interior(layout, slice, |index, offset| {
                let value = data[start + offset].to_f64();
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
    let stages = settings.scheme.stages();
    let limits = usize::from(problem.kind == Kind::Tube) + usize::from(problem.obstacle.is_some());
    let padded = problem
        .grid
        .axes
        .iter()
        .fold(1_usize, |n, axis| n.saturating_mul(axis.nodes.saturating_add(2 * S::REACH)));
    let arrays = (stages.max(2) + limits).saturating_add(settings.slices);
    check_memory(padded, arrays, size_of::<T>(), settings.memory_limit_bytes)?;
    // It looks at every node: after the check that there are not too many.
    let mirror = Mirror::of(problem, S::REACH);
    let grid = mirror.as_ref().map_or(problem.grid, Mirror::half);

    let layout = Layout::new(&grid, S::REACH);
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
        workers: Workers::new(threads),
        lanes: settings.lanes,
        slices_per_chunk: layout.slices().div_ceil(4 * threads),
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
        fill_ghosts(&mut value[..layout.length - BLOCK], &layout, d, marcher.ghosts()[d]);
    }
    marcher.scale = steepest(&value, &layout, &grid);
    marcher.units =
        core::array::from_fn(|d| T::from_f64(1.0 / (grid.axes[d].spacing() * marcher.scale)));

    let longest_step = settings.cfl / rate_bound(problem.game, &grid)?;
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
            earlier.push(marcher.nodes(&value));
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
    let (values, Problem { direction, kind, .. }) = (marcher.nodes(&value), problem);
    let (direction, kind) = (*direction, *kind);
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
    for (name, region) in
        [("target", Some(&problem.target)), ("obstacle", problem.obstacle.as_ref())]
    {
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
