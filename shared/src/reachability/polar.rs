//! Solves for the value of a pursuit game in polar relative coordinates.
//!
//! The state is the range r, the pursuer's bearing α from the evader's heading, and the relative
//! heading ψ. With β = ψ − α, the angle from the line of sight to the pursuer's heading,
//!
//! ṙ = v_p cos β − v_e cos α, α̇ = q/r − a, ψ̇ = b − a, q = v_e sin α + v_p sin β.
//!
//! The range changes by pure advection, and the turn rates only shift the two angles. Each axis can
//! therefore use exact upwind differences, without Lax–Friedrichs dissipation. The unknown is the
//! deficit W = V − (r − R) in [−r, 0]. It is 0 at r = 0 and at every state from which the range
//! only increases. The range axis is r = c (eˢ − 1) with uniformly spaced s. It is linear near the
//! danger zone and logarithmic far away, so a long range needs few nodes. By the mirror symmetry
//! (α, ψ) → (−α, −ψ), only α in [0, π] is solved.
//!
//! The evader's turn rate affects both angles. At equal headings (ψ = 0), V has a ridge. The evader
//! stays on the ridge by copying the pursuer's turn. The discrete Hamiltonian is therefore the
//! minimum over b of the maximum over a, so that the evader reacts to the pursuer. Any other order,
//! or the coordinate β instead of ψ, lowers the ridge by some tenths of a metre.
//!
//! The converged value is computed by Gauss–Seidel sweeps in alternating directions. Every cell
//! takes its own largest stable time step, and rows that no longer change are skipped. The initial
//! guess comes from coarser grids. For a finite horizon, all cells take the same time steps.

mod range;
mod level;
mod upwind;
mod sweep;
mod kink;
mod march;

use super::progress::{MEMORY_LIMIT_BYTES, Progress, SolveError, check_memory};
use super::pursuit::PursuitGame;
use crate::invalid::{Invalid, positive};
use crate::math::power_of_two_near;
use crate::parallel::{Workers, default_threads};
use crate::real::Real;
use crate::vehicle::VehicleModel;
use core::ops::ControlFlow;
use level::{Evader, Level};

pub use range::RangeAxis;
pub use sweep::WINDOW;

/// Settings of the polar solver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// The horizon (s); infinite for the converged value.
    pub horizon_s: f64,
    /// Largest range (m).
    pub range_m: f64,
    /// Number of nodes of the range axis, including the node at 0.
    pub range_nodes: usize,
    /// Number of nodes in a full turn of bearing and of heading; a multiple of 4.
    pub angle_nodes: usize,
    /// The solve has converged when the mean drift of the rows over [`WINDOW`] sweeps is at most
    /// this fraction of the radius. The limit is lower if the vehicles turn so fast that a sweep
    /// covers little time.
    pub tolerance: f64,
    /// Maximum number of sweeps over each grid, at least 1.
    pub most_sweeps: usize,
    /// Number of threads; used only for a finite horizon.
    pub threads: usize,
    /// Memory limit (bytes). A solve that needs more is rejected.
    pub memory_limit_bytes: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            horizon_s: f64::INFINITY,
            range_m: 40.0,
            range_nodes: 65,
            angle_nodes: 96,
            tolerance: 1e-4,
            most_sweeps: 2000,
            threads: default_threads(),
            memory_limit_bytes: MEMORY_LIMIT_BYTES,
        }
    }
}

impl Settings {
    /// Sets [`Self::horizon_s`], the horizon (s); infinite for the converged value.
    #[must_use]
    pub fn with_horizon(self, horizon_s: f64) -> Self {
        Self { horizon_s, ..self }
    }

    /// Sets [`Self::range_m`], the largest range (m).
    #[must_use]
    pub fn with_range(self, range_m: f64) -> Self {
        Self { range_m, ..self }
    }

    /// Sets [`Self::range_nodes`], the number of nodes of the range axis.
    #[must_use]
    pub fn with_range_nodes(self, range_nodes: usize) -> Self {
        Self { range_nodes, ..self }
    }

    /// Sets [`Self::angle_nodes`], the number of nodes in a full turn.
    #[must_use]
    pub fn with_angle_nodes(self, angle_nodes: usize) -> Self {
        Self { angle_nodes, ..self }
    }

    /// Sets [`Self::tolerance`], the drift below which V has converged, as a fraction of the
    /// radius.
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// Sets [`Self::most_sweeps`], the maximum number of sweeps over each grid.
    #[must_use]
    pub fn with_most_sweeps(self, most_sweeps: usize) -> Self {
        Self { most_sweeps, ..self }
    }

    /// Sets [`Self::threads`], the number of threads for a finite horizon.
    #[must_use]
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Sets [`Self::memory_limit_bytes`], the memory limit of a solve (bytes).
    #[must_use]
    pub fn with_memory_limit(self, memory_limit_bytes: u64) -> Self {
        Self { memory_limit_bytes, ..self }
    }
}

/// The deficit W on the nodes.
#[derive(Clone, Debug)]
pub struct Solution<T> {
    /// Range axis.
    pub range: RangeAxis,
    /// Range of the last node (m).
    pub range_m: f64,
    /// The horizon (s); infinite for the converged value.
    pub horizon_s: f64,
    /// Number of nodes in a full turn.
    pub angle_nodes: usize,
    /// W(range, bearing in [0, π], heading in [0, 2π)) in metres, row-major. Bearing has
    /// `angle_nodes / 2 + 1` nodes, heading has `angle_nodes`.
    pub deficit: Vec<T>,
    /// Q(range, bearing in [0, 2π), heading in [0, 2π)), with W(α, ψ) = max(Q(α, ψ), Q(−α, −ψ)).
    /// Near the surface where left and right turns are equally good for the evader, Q continues W
    /// smoothly from one of the two sides. Elsewhere Q = W.
    pub sheet: Vec<T>,
    /// Number of sweeps over the finest grid. For a finite horizon, the number of time steps.
    pub sweeps: usize,
    /// The largest |∂V/∂τ| at the end of a finite horizon (m/s); 0 for the converged value.
    pub rate_mps: f64,
    /// The mean drift of the rows over [`WINDOW`] sweeps (m); 0 for a finite horizon. The drift of
    /// a row is the magnitude of the mean signed change of its cells. Cells that oscillate between
    /// the two sides of a kink therefore cancel out.
    pub drift_m: f64,
    /// Whether [`Self::drift_m`] was within the tolerance.
    ///
    /// If a faster pursuer with wider turns can attack repeatedly, each sweep lowers V slightly
    /// everywhere. For example, for an evader with 1.5 m/s and 0.8 rad/s, a pursuer with 2 m/s and
    /// 0.5 rad/s, and R = 3 m, the median of V on the grid of 65 × 96 × 96 nodes is −2.4 m after
    /// 2,000 sweeps, −2.6 m after 5,000 and −3.0 m after 24,000. After that, V no longer changes,
    /// because the range that the evader can keep is smaller than a cell. More sweeps therefore do
    /// not give the correct value.
    pub converged: bool,
}

impl<T: Real> Solution<T> {
    /// A range (m) beyond which no node has both V ≤ `level_m` and V < r − R.
    pub(super) fn extent(&self, radius_m: f64, level_m: f64) -> f64 {
        let slab = (self.angle_nodes / 2 + 1) * self.angle_nodes;
        let matters = |i: &usize| {
            let margin = self.range.node(*i) - radius_m;
            let closing = |w: &T| w.to_f64() < 0.0 && margin + w.to_f64() <= level_m;
            self.deficit[i * slab..(i + 1) * slab].iter().any(closing)
        };
        let last = (0..self.range.nodes).rev().find(matters).unwrap_or(0);
        let next = self.range.node((last + 1).min(self.range.nodes - 1));
        next.min(self.range_m)
    }
}

/// Computes the value for a finite horizon, or the converged value.
///
/// # Errors
/// [`SolveError::Invalid`] naming the invalid parameter; [`SolveError::Cancelled`] if `progress`
/// cancels the solve.
pub fn solve<T: Real>(
    game: &PursuitGame,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T>, SolveError> {
    game.check()?;
    if settings.horizon_s.is_nan() || settings.horizon_s <= 0.0 {
        return Err(Invalid::new("horizon_s", "a number > 0, or inf", settings.horizon_s).into());
    }
    positive("range_m", settings.range_m)?;
    positive("tolerance", settings.tolerance)?;
    if settings.range_m <= game.radius_m {
        let expected = format!("above the radius {}", game.radius_m);
        return Err(Invalid::new("range_m", expected, settings.range_m).into());
    }
    if settings.range_nodes < 9 {
        return Err(Invalid::new("range_nodes", "at least 9", settings.range_nodes).into());
    }
    if settings.angle_nodes < 12 || !settings.angle_nodes.is_multiple_of(4) {
        let expected = "a multiple of 4, at least 12";
        return Err(Invalid::new("angle_nodes", expected, settings.angle_nodes).into());
    }
    if settings.most_sweeps == 0 {
        return Err(Invalid::new("most_sweeps", "at least 1", 0).into());
    }
    if settings.threads == 0 {
        return Err(Invalid::new("threads", "at least 1", 0).into());
    }
    let half = settings.angle_nodes / 2 + 1;
    let nodes = settings.range_nodes.saturating_mul(half).saturating_mul(settings.angle_nodes);
    // The solve and its solution need at most 6 arrays that each cover half a turn of bearings: 2
    // for W and its copy, and 4 for the sheet and its copy, which cover a full turn.
    check_memory(nodes, 6, size_of::<T>(), settings.memory_limit_bytes)?;

    // Lengths are in units of about R/3, and times are scaled so that the faster player's speed is
    // between 0.7 and 1.5. Fixed constants then suit any vehicles. Scaling by powers of two causes
    // no rounding errors.
    let unit = game.length_unit_m();
    let fastest = game.evader.speed_mps.max(game.pursuer.speed_mps) / unit;
    let rate = power_of_two_near(fastest);
    let scaled = |vehicle: VehicleModel| VehicleModel {
        speed_mps: vehicle.speed_mps / unit / rate,
        turn_rate_radps: vehicle.turn_rate_radps / rate,
    };
    let small = PursuitGame {
        evader: scaled(game.evader),
        pursuer: scaled(game.pursuer),
        radius_m: game.radius_m / unit,
    };
    for (name, player) in [("evader", small.evader), ("pursuer", small.pursuer)] {
        let smallest = f64::from(f32::MIN_POSITIVE);
        if player.speed_mps < smallest || player.turn_rate_radps < smallest {
            let expected = "a speed and a turn rate that single precision can distinguish from \
                            zero beside those of the other vehicle";
            let found = format!(
                "{} m/s, {} rad/s",
                player.speed_mps * unit * rate,
                player.turn_rate_radps * rate
            );
            return Err(Invalid::new(name, expected, found).into());
        }
    }
    let scale = Scale { unit, rate };
    if settings.horizon_s.is_finite() {
        return timed(game, &small, scale, settings, progress);
    }
    let pace = pace(&small);
    if pace < SLOWEST_PACE {
        let turns = |evader: f64, pursuer: f64| 2.0 * evader + pursuer;
        // Both limits follow from fastest/R/(turns + closing/R) ≥ SLOWEST_PACE·PAPERS_PACE.
        let fastest = game.evader.speed_mps.max(game.pursuer.speed_mps);
        let closing = game.evader.speed_mps + game.pursuer.speed_mps;
        let found = turns(game.evader.turn_rate_radps, game.pursuer.turn_rate_radps);
        let least = SLOWEST_PACE * PAPERS_PACE;
        let most = (fastest / least - closing) / game.radius_m;
        let radius = (fastest / least - closing) / found;
        let expected = format!(
            "turn rates that the polar grid can follow at a radius of {} m: twice the evader's \
             plus the pursuer's at most {most:.3} rad/s (or a radius of at most {radius:.3} m, or \
             method cartesian)",
            game.radius_m
        );
        return Err(Invalid::new("turn_rate_radps", expected, format!("{found} rad/s")).into());
    }

    let levels = levels(settings);
    let count = levels.len();
    let mut solved: Option<Level<T>> = None;
    for (i, (range_nodes, angle_nodes)) in levels.into_iter().enumerate() {
        let mut level =
            Level::new(&small, settings.range_m / unit, range_nodes, angle_nodes, Evader::Free);
        if let Some(coarser) = &solved {
            level.start_from(coarser);
        }
        // The initial guess need not be more accurate than the discretization error, which is
        // proportional to the square of the spacing.
        let finer = (settings.angle_nodes / angle_nodes) as f64;
        let tolerance = settings.tolerance * small.radius_m * pace * finer * finer;
        let mut report = |drift: f64, sweep: usize| {
            let within = 1.0 - 1.0 / (1.0 + sweep as f64 / 50.0);
            progress(Progress { done: (i as f64 + within) / count as f64, residual: drift * unit })
        };
        if level.converge(tolerance, settings.most_sweeps, &mut report).is_break() {
            return Err(SolveError::Cancelled);
        }
        solved = Some(level);
    }
    match solved {
        Some(full) => {
            let sheet = full.right_sheet();
            let drift_m = full.drift_m * unit;
            Ok(Solution { drift_m, ..scale.undo(full.finish(sheet), game, settings) })
        }
        None => unreachable!("there is always the grid asked for"),
    }
}

/// Maximum number of time steps; more would never finish.
const MOST_STEPS: f64 = 1e8;

/// Computes the value for a finite horizon.
fn timed<T: Real>(
    game: &PursuitGame,
    small: &PursuitGame,
    scale: Scale,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T>, SolveError> {
    let Settings { range_m, range_nodes, angle_nodes, .. } = *settings;
    let Scale { unit, rate } = scale;
    let mut level = Level::new(small, range_m / unit, range_nodes, angle_nodes, Evader::Free);
    let planned = level.steps_of(settings.horizon_s * rate);
    if planned > MOST_STEPS {
        let longest_s = settings.horizon_s / planned * MOST_STEPS;
        let expected = format!("at most {longest_s:.3e} s, {MOST_STEPS:e} time steps of this grid");
        return Err(Invalid::new("horizon_s", expected, settings.horizon_s).into());
    }
    let workers = Workers::new(settings.threads.min(range_nodes - 1));
    let mut report =
        |change: f64, done: f64| progress(Progress { done, residual: change * unit * rate });
    match level.march(settings.horizon_s * rate, &workers, &mut report) {
        ControlFlow::Continue(sheet) => {
            let rate_mps = level.drift_m * unit * rate;
            Ok(Solution { rate_mps, ..scale.undo(level.finish(sheet), game, settings) })
        }
        ControlFlow::Break(()) => Err(SolveError::Cancelled),
    }
}

/// The units in which a game is solved: a length unit is `unit` metres, and a second is `rate` time
/// units.
#[derive(Clone, Copy)]
struct Scale {
    unit: f64,
    rate: f64,
}

impl Scale {
    /// Converts a solution to metres and seconds.
    fn undo<T: Real>(
        self,
        mut solution: Solution<T>,
        game: &PursuitGame,
        settings: &Settings,
    ) -> Solution<T> {
        let metres = T::from_f64(self.unit);
        for w in solution.deficit.iter_mut().chain(&mut solution.sheet) {
            *w = *w * metres;
        }
        Solution {
            range: RangeAxis::new(game.radius_m, settings.range_m, settings.range_nodes),
            range_m: settings.range_m,
            horizon_s: settings.horizon_s,
            ..solution
        }
    }
}

/// The time in the game that [`WINDOW`] sweeps cover, divided by the time that they cover in the
/// paper's game; at most 1. A cell's time step is short if an angle can change quickly.
fn pace(game: &PursuitGame) -> f64 {
    let PursuitGame { evader, pursuer, radius_m } = *game;
    let closing = (evader.speed_mps + pursuer.speed_mps) / radius_m;
    let turns = 2.0 * evader.turn_rate_radps + pursuer.turn_rate_radps + closing;
    let radians = evader.speed_mps.max(pursuer.speed_mps) / radius_m / turns;
    (radians / PAPERS_PACE).min(1.0)
}

/// In the time in which the state's angles can change by 1 rad, the faster vehicle travels this arc
/// (rad) of a circle with the danger radius. This constant is slightly below the value in the
/// paper's game (0.235).
const PAPERS_PACE: f64 = 0.22;
/// Below this pace, single precision no longer resolves the changes of a sweep.
const SLOWEST_PACE: f64 = 0.02;

/// The numbers of nodes of the range axis and of a full turn, from the coarsest grid to the finest.
fn levels(settings: &Settings) -> Vec<(usize, usize)> {
    let mut levels = vec![(settings.range_nodes, settings.angle_nodes)];
    let (mut range, mut angle) = levels[0];
    while angle.is_multiple_of(8) && angle >= 48 && range >= 33 {
        (range, angle) = (range.div_ceil(2), angle / 2);
        levels.push((range, angle));
    }
    levels.reverse();
    levels
}
