//! Level-set solver on rectangular grids: local Lax–Friedrichs in space, TVD
//! Runge–Kutta in time, one to four dimensions.
//!
//! See Mitchell, *A Toolbox of Level Set Methods* (2008), and Osher and Fedkiw (2003). One array
//! contains the values, surrounded by ghost nodes. A stage processes the nodes in runs of cells,
//! block by block. A run extends along the last two axes (in one or two dimensions, along the last
//! axis). A block and its derivatives fit into the L1 cache, so no array of derivatives is needed.
//! A run includes ghost nodes; the values computed there are overwritten when the ghosts are
//! filled. A problem with reflection symmetry, such as two vehicles in the frame of one of them, is
//! computed on half of the nodes.

mod layout;
mod speeds;
mod tables;
mod kernel;
mod solution;
mod mirror;
mod limits;
mod march;

use super::game::Game;
use super::grid::Grid;
use super::progress::{MEMORY_LIMIT_BYTES, Progress, SolveError};
use super::scheme::{Eno2, Eno3, Scheme, Upwind, Weno5};
use crate::parallel::{Lanes, default_threads};
use crate::real::Real;
use core::marker::PhantomData;
use core::ops::ControlFlow;
use kernel::{Moves, Of};
use march::march;
use serde::{Deserialize, Serialize};

pub use solution::{Sample, ShallowObstacle, Snapshot, Solution};

/// Whether a path must be in the target at some time up to the horizon, or exactly at the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// States from which the target is reached at some time up to the horizon.
    Tube,
    /// States from which the target is reached exactly at the horizon.
    Set,
}

/// The direction of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// States that lead to the target. The march begins at the end of the game, so its time τ is
    /// the remaining time.
    Backward,
    /// States that are reached from the target (the initial set). This is the same game with
    /// reversed velocities, H(x, −p).
    Forward,
}

/// A function of the state, or of state and time.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Region<'a, const D: usize> {
    /// Constant in time.
    Static(&'a (dyn Fn([f64; D]) -> f64 + Sync)),
    /// Depends on the forward time t (s) since the beginning of the game or since the initial set.
    /// A backward march then needs a finite horizon.
    OfTime(&'a (dyn Fn([f64; D], f64) -> f64 + Sync)),
    /// Depends on the time τ (s) since the march began. In a backward march, τ is the remaining
    /// time.
    OfMarchTime(&'a (dyn Fn([f64; D], f64) -> f64 + Sync)),
}

impl<const D: usize> Region<'_, D> {
    /// The value at the march time τ and the corresponding forward time t.
    fn at(&self, state: [f64; D], march_time: f64, time: f64) -> f64 {
        match self {
            Self::Static(region) => region(state),
            Self::OfTime(region) => region(state, time),
            Self::OfMarchTime(region) => region(state, march_time),
        }
    }

    fn moves(&self) -> bool {
        !matches!(self, Self::Static(_))
    }
}

/// The obstacle, a region that must not be entered.
#[derive(Clone, Copy)]
struct Avoid<'a, const D: usize> {
    region: Region<'a, D>,
    /// The factor that makes `region` positive inside, so that V ≥ sign · region.
    sign: f64,
}

impl<const D: usize> Avoid<'_, D> {
    /// The name of the setting that defines the obstacle.
    fn name(&self) -> &'static str {
        if self.sign < 0.0 { "avoid" } else { "obstacle" }
    }
}

/// When the march ends.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Horizon {
    /// After this many seconds.
    Finite(f64),
    /// When V changes by at most `tolerance` per second everywhere, or after `longest_s`.
    Converged {
        /// Largest change of V per second.
        tolerance: f64,
        /// Maximum time of the march (s).
        longest_s: f64,
    },
}

/// The problem to solve.
#[non_exhaustive]
pub struct Problem<'a, const D: usize, G> {
    /// The dynamics and the players.
    pub game: &'a G,
    /// The nodes on which V is computed.
    pub grid: Grid<D>,
    /// l(x). The target is {l ≤ 0}, and V starts as l.
    pub target: Region<'a, D>,
    avoid: Option<Avoid<'a, D>>,
    /// Tube or set.
    pub kind: Kind,
    /// Backward or forward.
    pub direction: Direction,
    /// When the march ends.
    pub horizon: Horizon,
}

impl<'a, const D: usize, G> Problem<'a, D, G> {
    /// A backward tube of `target` without an obstacle.
    pub fn new(game: &'a G, grid: Grid<D>, target: Region<'a, D>, horizon: Horizon) -> Self {
        let (kind, direction) = (Kind::Tube, Direction::Backward);
        Self { game, grid, target, avoid: None, kind, direction, horizon }
    }

    /// The states from which the target {l ≤ 0} is reached within `seconds`: a backward tube
    /// without an obstacle.
    pub fn reach(
        game: &'a G,
        grid: Grid<D>,
        target: &'a (dyn Fn([f64; D]) -> f64 + Sync),
        seconds: f64,
    ) -> Self {
        Self::new(game, grid, Region::Static(target), Horizon::Finite(seconds))
    }

    /// Sets the obstacle g(x), whose interior {g < 0} must not be entered; `None` removes it. Like
    /// the target, g is negative inside and should be a signed distance. V is at least −g.
    #[must_use]
    pub fn with_avoid(self, avoid: impl Into<Option<Region<'a, D>>>) -> Self {
        let avoid = avoid.into().map(|region| Avoid { region, sign: -1.0 });
        Self { avoid, ..self }
    }

    /// [`Self::with_avoid`] with the opposite sign: `obstacle` is **positive** inside, and
    /// V ≥ obstacle.
    #[deprecated(note = "use `with_avoid`, whose function is negative inside, like the target")]
    #[must_use]
    pub fn with_obstacle(self, obstacle: impl Into<Option<Region<'a, D>>>) -> Self {
        let avoid = obstacle.into().map(|region| Avoid { region, sign: 1.0 });
        Self { avoid, ..self }
    }

    /// Sets [`Self::kind`], tube or set.
    #[must_use]
    pub fn with_kind(self, kind: Kind) -> Self {
        Self { kind, ..self }
    }

    /// Sets [`Self::direction`], backward or forward.
    #[must_use]
    pub fn with_direction(self, direction: Direction) -> Self {
        Self { direction, ..self }
    }

    /// Sets [`Self::horizon`], when the march ends.
    #[must_use]
    pub fn with_horizon(self, horizon: Horizon) -> Self {
        Self { horizon, ..self }
    }

    /// The forward time t at the march time τ; NaN if forward time has no beginning.
    fn clock(&self, march_time: f64) -> f64 {
        match (self.direction, self.horizon) {
            (Direction::Forward, _) => march_time,
            (Direction::Backward, Horizon::Finite(seconds)) => seconds - march_time,
            (Direction::Backward, Horizon::Converged { .. }) => f64::NAN,
        }
    }
}

/// Settings of the solver.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// The approximation of the spatial derivatives, which also determines the Runge–Kutta order.
    pub scheme: Scheme,
    /// Number of threads; results do not depend on it. 0 counts as 1. The solver uses at most one
    /// thread for each node of the first axis.
    pub threads: usize,
    /// Largest width of the SIMD lanes; results do not depend on it.
    pub lanes: Lanes,
    /// CFL number: the time step as a fraction of the largest stable first-order time step, above 0
    /// and at most 1. ENO can choose stencils that are stable only up to 0.5 (second order) or 0.37
    /// (third order). With a larger CFL number, V stays bounded, but its accuracy can locally be
    /// below this order.
    pub cfl: f64,
    /// Number of instants to store before the end, evenly spaced from the beginning of the march.
    /// This requires a finite horizon. The time steps become slightly shorter, so that each stored
    /// instant is the end of a time step.
    pub slices: usize,
    /// Memory limit (bytes). A solve that needs more is rejected.
    pub memory_limit_bytes: u64,
}

impl Settings {
    /// Settings for `scheme` with its default CFL number, on all threads.
    #[must_use]
    pub fn new(scheme: Scheme) -> Self {
        Self {
            scheme,
            threads: default_threads(),
            lanes: Lanes::widest(),
            cfl: scheme.cfl(),
            slices: 0,
            memory_limit_bytes: MEMORY_LIMIT_BYTES,
        }
    }

    /// Sets [`Self::threads`], the number of threads.
    #[must_use]
    pub fn with_threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// Sets [`Self::lanes`], the largest width of the SIMD lanes.
    #[must_use]
    pub fn with_lanes(self, lanes: Lanes) -> Self {
        Self { lanes, ..self }
    }

    /// Sets [`Self::cfl`], the fraction of the largest stable time step.
    #[must_use]
    pub fn with_cfl(self, cfl: f64) -> Self {
        Self { cfl, ..self }
    }

    /// Sets [`Self::slices`], the number of instants before the end whose values are stored.
    #[must_use]
    pub fn with_slices(self, slices: usize) -> Self {
        Self { slices, ..self }
    }

    /// Sets [`Self::memory_limit_bytes`], the memory limit of a solve (bytes).
    #[must_use]
    pub fn with_memory_limit(self, memory_limit_bytes: u64) -> Self {
        Self { memory_limit_bytes, ..self }
    }
}

/// Solves `problem`.
///
/// # Bounds
/// V of a tube is the smallest value of the target along a path, unless the obstacle raises it. So
/// min l ≤ V ≤ max(l, −g) at every node, where min l is the smallest value of the target at any
/// node so far. Higher-order schemes undershoot beside kinks, so each stage clamps V to these
/// bounds. If V changes by more than any scheme can cause in one stage, the solve fails with an
/// error.
///
/// # Low obstacles
/// The height of an obstacle can be less than the depth of the target, for example if the obstacle
/// is a function that is only −1 or 1, or a distance in a larger unit than the target's. V is then
/// so flat that its sign can be wrong. [`Solution::shallow`] reports this.
///
/// # Ends of the grid
/// [`Boundary`](super::Boundary) determines the values beyond an end. Where the flow leaves the
/// grid, V depends on these values. [`Solution::earliest_exit_s`] is the time before which no path
/// leaves; V of a shorter march does not depend on the values beyond the end. If the values of the
/// obstacle jump between neighbouring nodes, negative V is extrapolated with the smaller of the
/// last two slopes before the end, so that a wall is not mistaken for a slope.
///
/// The solve calls `progress` after every step. `progress` can cancel the solve.
///
/// # Errors
/// [`SolveError::Invalid`] for
/// - a grid that is too small for the scheme or too large for the memory;
/// - a horizon that is not > 0, or a `cfl` outside (0, 1];
/// - a target, an obstacle or speed bounds that are not finite at a node (the error names the
///   node);
/// - an obstacle that covers all of the grid or all of the target;
/// - a game that makes V infinite or NaN, or makes it change faster than the speed bounds allow;
/// - a horizon that is not finite, if instants are to be stored or if a region of a backward march
///   depends on the forward time.
///
/// [`SolveError::Cancelled`] if `progress` cancels the solve.
pub fn solve<T: Real, const D: usize, G: Game<D>>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Solution<T, D>, SolveError> {
    fn of<G, S>(game: &G) -> Of<'_, G, S> {
        Of { game, scheme: PhantomData }
    }
    let &Problem { game, grid, target, avoid, kind, direction, horizon } = problem;
    let problem = Problem { game: &(), grid, target, avoid, kind, direction, horizon };
    let moves: &dyn Moves<T, D> = match settings.scheme {
        Scheme::Upwind => &of::<G, Upwind>(game),
        Scheme::Eno2 => &of::<G, Eno2>(game),
        Scheme::Eno3 => &of::<G, Eno3>(game),
        Scheme::Weno5 => &of::<G, Weno5>(game),
    };
    march(&problem, moves, settings, progress)
}
