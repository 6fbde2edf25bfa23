//! Solves a pursuit game for its value function, by the method that suits it.

use super::cartesian::{self, Horizon, Problem, Region};
use super::games::RelativeDubins;
use super::options::{Accuracy, CartesianGrid, Method, Options, Precision};
use super::polar;
use super::progress::{Progress, SolveError, check_memory};
use super::pursuit::PursuitGame;
use super::sampled::{Nodes, SampledValue};
use super::scheme::Scheme;
use super::value_function::ValueFunction;
use crate::invalid::{Invalid, positive};
use crate::math::{PI, TAU, cbrt};
use crate::real::Real;
use crate::vehicle::VehicleModel;
use core::ops::ControlFlow;
use std::sync::Arc;

/// A value function and details of its solve.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Solved {
    /// The function: the closed form, or interpolated between the nodes of the solver.
    pub function: ValueFunction,
    /// The function on its nodes. The closed form is sampled on the nodes that the other methods
    /// would use.
    pub samples: Arc<SampledValue>,
    /// The method used.
    pub method: Method,
    /// Number of time steps, or of sweeps over the finest grid; 0 for the closed form.
    pub steps: usize,
    /// Number of threads used.
    pub threads: usize,
    /// How much the solution was still changing at the end; 0 for the closed form. With time steps,
    /// this is the largest |∂V/∂τ| (m/s). For a finite horizon, it does not measure the error. For
    /// the converged value of the polar method, it is the drift over [`polar::WINDOW`] sweeps (m).
    pub residual: f64,
    /// Whether the solution had converged when the solve ended; `None` for a finite horizon. If the
    /// pursuer is barely faster, a chase can take more time than the longest solve covers.
    pub converged: Option<bool>,
}

/// Computes the value function of `game`.
///
/// The grid is finite. If the pursuer is faster, it can win chases that lead beyond the grid, but
/// the solver counts these chases as escapes. V is then too large by metres where these chases
/// leave the grid, and at the states on the way there, although the states are `inside` and
/// [`ValueFunction::unsettled_m`] is small. To check this, solve again with twice the range
/// ([`Options::with_range`]). Where V changes, the smaller range was too small.
///
/// # Example
/// ```
/// use core::ops::ControlFlow;
/// use sidestep::reachability::{Accuracy, Method, Options, PursuitGame, solve};
/// use sidestep::vehicle::VehicleModel;
///
/// # fn main() -> Result<(), sidestep::reachability::SolveError> {
/// let person = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
/// let robot = VehicleModel { speed_mps: 1.5, turn_rate_radps: 0.8 };
/// let game = PursuitGame { evader: person, pursuer: robot, radius_m: 3.0 };
/// let options = Options::default().with_accuracy(Accuracy::Draft);
/// let solved = solve(game, &options, &mut |progress| {
///     if progress.done < 2.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
/// })?;
/// assert_eq!(solved.method, Method::Polar); // other vehicles, no horizon
/// assert!(solved.function.value([20.0, 0.0, 0.0]) > 0.0); // m: far ahead, and slower
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`SolveError::Invalid`] for an invalid game, horizon or grid, or a method that does not support
/// them; [`SolveError::Cancelled`] if `progress` cancels the solve.
pub fn solve(
    game: PursuitGame,
    options: &Options,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solved, SolveError> {
    let chosen = options.method_for(&game)?;
    if options.threads == 0 {
        return Err(Invalid::new("threads", "at least 1", 0).into());
    }
    let horizon_s = options.horizon_s;
    match chosen {
        Method::Exact => {
            let exact = game.exact()?;
            let nodes = match options.grid {
                Some(grid) => {
                    let [x, y, psi] = grid.axes().axes;
                    grid.axes().check(grid.scheme.reach())?;
                    Nodes::Cartesian { x, y, psi }
                }
                None => polar_nodes(&game, options)?,
            };
            nodes.check()?;
            check_memory(nodes.count(), 3, size_of::<f32>(), options.memory_limit_bytes)?;
            let samples = Arc::new(SampledValue::sampled(game, nodes, |state| exact.value(state))?);
            let function = ValueFunction::Exact(exact);
            Ok(Solved {
                function,
                samples,
                method: chosen,
                steps: 0,
                threads: 1,
                residual: 0.0,
                converged: Some(true),
            })
        }
        Method::Polar => {
            if options.grid.is_some() {
                let found = "a grid of x, y and ψ with method polar";
                return Err(Invalid::new("grid", "none (see accuracy and range)", found).into());
            }
            let (settings, begun) = polar_settings(&game, options, progress)?;
            let report = &mut |report: Progress| {
                progress(Progress { done: begun + (1.0 - begun) * report.done, ..report })
            };
            let solution = polar::solve::<f32>(&game, &settings, report)?;
            let timed = horizon_s.is_finite();
            let residual = if timed { solution.rate_mps } else { solution.drift_m };
            let samples = Arc::new(SampledValue::from_polar(game, &solution)?);
            Ok(Solved {
                function: ValueFunction::Sampled(samples.clone()),
                samples,
                method: chosen,
                steps: solution.sweeps,
                threads: if timed { options.threads } else { 1 },
                residual,
                converged: (!timed).then_some(solution.converged),
            })
        }
        Method::Cartesian => {
            let (grid, begun) = match options.grid {
                Some(grid) => (grid, 0.0),
                None => (default_grid(game, options, progress)?, DRAFT_SHARE),
            };
            let report = &mut |report: Progress| {
                progress(Progress { done: begun + (1.0 - begun) * report.done, ..report })
            };
            let (samples, steps, residual) = match grid.precision {
                Precision::F32 => march::<f32>(game, &grid, options, report)?,
                Precision::F64 => march::<f64>(game, &grid, options, report)?,
            };
            let converged = horizon_s.is_infinite().then(|| residual <= settled(&game));
            let moved = (converged == Some(false)).then_some(residual);
            let samples = Arc::new(samples.unsettled(moved));
            let function = ValueFunction::Sampled(samples.clone());
            let threads = options.threads;
            Ok(Solved { function, samples, method: chosen, steps, threads, residual, converged })
        }
    }
}

fn march<T: Real>(
    game: PursuitGame,
    grid: &CartesianGrid,
    options: &Options,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(SampledValue, usize, f64), SolveError> {
    let target = |state: [f64; 3]| game.target(state);
    let horizon = if options.horizon_s.is_finite() {
        Horizon::Finite(options.horizon_s)
    } else {
        // Optimal play of equal vehicles ends within half a turn. Chases take longer, so the march
        // is allowed to last several times as long.
        let slowest = game.evader.turn_rate_radps.min(game.pursuer.turn_rate_radps);
        Horizon::Converged { tolerance: settled(&game), longest_s: 8.0 * PI / slowest }
    };
    let relative = RelativeDubins(game);
    let problem = Problem::new(&relative, grid.axes(), Region::Static(&target), horizon);
    let settings = cartesian::Settings {
        threads: options.threads,
        memory_limit_bytes: options.memory_limit_bytes,
        ..cartesian::Settings::new(grid.scheme)
    };
    let solution = cartesian::solve::<T, 3, _>(&problem, &settings, progress)?;
    let samples = SampledValue::from_cartesian(game, options.horizon_s, &solution)?;
    Ok((samples, solution.steps, solution.residual))
}

/// Rate of change of V (m/s) below which a march has converged.
fn settled(game: &PursuitGame) -> f64 {
    2e-3 * (game.evader.speed_mps + game.pursuer.speed_mps)
}

/// The larger turning radius of the two vehicles (m).
fn widest_turn(game: &PursuitGame) -> f64 {
    let radius = |vehicle: VehicleModel| vehicle.speed_mps / vehicle.turn_rate_radps;
    radius(game.evader).max(radius(game.pursuer))
}

/// Finds the settings of the polar method. Also returns the share of the solve's progress that the
/// search for these settings took.
fn polar_settings(
    game: &PursuitGame,
    options: &Options,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(polar::Settings, f64), SolveError> {
    let settings = polar::Settings {
        horizon_s: options.horizon_s,
        threads: options.threads,
        memory_limit_bytes: options.memory_limit_bytes,
        ..polar::Settings::default()
    };
    if options.horizon_s.is_infinite() {
        let Nodes::Polar { range_m, range_nodes, angle_nodes, .. } = polar_nodes(game, options)?
        else {
            unreachable!("polar_nodes are polar");
        };
        // The tolerance is proportional to the discretization error, which decreases with the
        // square of the spacing.
        let tolerance = settings.tolerance
            * match options.accuracy {
                Accuracy::Draft => 4.0,
                Accuracy::Standard => 1.0,
                Accuracy::Fine => 0.25,
            };
        return Ok((
            polar::Settings { range_m, tolerance, range_nodes, angle_nodes, ..settings },
            0.0,
        ));
    }
    let (range_nodes, angle_nodes) = match options.accuracy {
        Accuracy::Draft => (33, 96),
        Accuracy::Standard => (65, 160),
        Accuracy::Fine => (129, 352),
    };
    let nodes = polar::Settings { range_nodes, angle_nodes, ..settings };
    if options.range_m.is_some() {
        return Ok((polar::Settings { range_m: largest_range(game, options)?, ..nodes }, 0.0));
    }
    // Vehicles that are farther apart than this range cannot meet within the horizon.
    let closing = game.evader.speed_mps + game.pursuer.speed_mps;
    let certain = game.radius_m + closing * options.horizon_s;
    let range_m = certain.min(largest_range(game, options)?);
    let draft = polar::Settings { range_m, range_nodes: 33, angle_nodes: 48, ..settings };
    let solution = polar::solve::<f32>(game, &draft, &mut |report| {
        progress(Progress { done: DRAFT_SHARE * report.done, ..report })
    })?;
    let matters = solution.extent(game.radius_m, MARGIN * game.radius_m);
    Ok((polar::Settings { range_m: matters, ..nodes }, DRAFT_SHARE))
}

/// The largest range of the polar method (m).
fn largest_range(game: &PursuitGame, options: &Options) -> Result<f64, Invalid> {
    // Half a turn of both vehicles at full speed shortens the range by at most 2π turning radii.
    // The default adds half as much again for vehicles that differ.
    let range_m = match options.range_m {
        Some(range_m) => positive("range_m", range_m)?,
        None => game.radius_m + 3.0 * PI * widest_turn(game),
    };
    if range_m <= game.radius_m {
        let expected = format!("above the radius {}", game.radius_m);
        return Err(Invalid::new("range_m", expected, range_m));
    }
    Ok(range_m)
}

fn polar_nodes(game: &PursuitGame, options: &Options) -> Result<Nodes, Invalid> {
    let range_m = largest_range(game, options)?;
    let (range_nodes, angle_nodes) = match options.accuracy {
        Accuracy::Draft => (33, 48),
        Accuracy::Standard => (65, 96),
        Accuracy::Fine => (129, 192),
    };
    Ok(Nodes::Polar { knee_m: game.radius_m, range_m, range_nodes, angle_nodes })
}

/// A grid that just contains the states that matter, with the number of nodes of
/// `options.accuracy`.
///
/// A draft solve on a domain that certainly contains {V ≤ 0} shows where V is at most a margin c.
/// Optimal paths from {V ≤ c} stay in this set, so the states outside it do not affect V in the
/// set. The spacing is h along x and y. Along ψ it is h divided by the largest |∂V/∂ψ|, which is
/// twice a turning radius. Over one spacing, V then changes by as much along ψ as along x or y.
fn default_grid(
    game: PursuitGame,
    options: &Options,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<CartesianGrid, SolveError> {
    // The largest range from which the danger zone can be reached within the horizon, or within
    // half a turn if that is shorter.
    let longest = PI / game.evader.turn_rate_radps.min(game.pursuer.turn_rate_radps);
    let closing = game.evader.speed_mps + game.pursuer.speed_mps;
    let far = game.radius_m + closing * options.horizon_s.min(longest);
    let draft = CartesianGrid {
        nodes: DRAFT_NODES,
        domain_m: [-far, far, -far, far],
        scheme: Scheme::Eno2,
        precision: Precision::F32,
    };
    let (samples, ..) = march::<f32>(game, &draft, options, &mut |report| {
        progress(Progress { done: DRAFT_SHARE * report.done, ..report })
    })?;
    let [x0, x1, y1] = samples.extent(MARGIN * game.radius_m);
    let (nodes, scheme) = match options.accuracy {
        Accuracy::Draft => (DRAFT_NODES, Scheme::Eno2),
        Accuracy::Standard => ([81, 81, 64], Scheme::Weno5),
        Accuracy::Fine => ([161, 161, 128], Scheme::Weno5),
    };
    let count: f64 = nodes.iter().map(|n| *n as f64).product();
    let sides = [x1 - x0, 2.0 * y1, TAU * 2.0 * widest_turn(&game)];
    let spacing = cbrt(sides.iter().product::<f64>() / count);
    let along = |side: f64| ((side / spacing).round() as usize).max(LEAST_CELLS);
    // With a multiple of 4, the quarter turns are nodes, and so is the mirror image of every node.
    let headings = along(sides[2]).clamp(nodes[2] / 2, 4 * nodes[2]).next_multiple_of(4);
    let spacing = (sides[0] * sides[1] * headings as f64 / count).sqrt();
    let along = |side: f64| ((side / spacing).round() as usize).max(LEAST_CELLS);
    Ok(CartesianGrid {
        nodes: [along(sides[0]) + 1, along(sides[1]) + 1, headings],
        domain_m: [x0, x1, -y1, y1],
        scheme,
        precision: Precision::F32,
    })
}

/// Number of nodes of a draft solve.
const DRAFT_NODES: [usize; 3] = [41, 41, 32];
/// The domain contains the states where V is at most this fraction of the radius.
const MARGIN: f64 = 0.5;
/// Minimum number of cells of an axis.
const LEAST_CELLS: usize = 24;
/// The share of a solve's progress that its draft takes.
const DRAFT_SHARE: f64 = 0.05;
