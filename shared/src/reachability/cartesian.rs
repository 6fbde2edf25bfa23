//! Level-set solver on rectangular grids: local Lax–Friedrichs in space, TVD
//! Runge–Kutta in time, one to four dimensions.
//!
//! Mitchell, *A Toolbox of Level Set Methods* (2008) and Osher and Fedkiw (2003).
//! One array holds the values, with ghost nodes all around. A stage walks over the last two axes as
//! one run of cells, in blocks that fit into the first-level cache with their derivatives, so there
//! are no arrays of derivatives. The run passes over ghost nodes; filling the ghosts later replaces
//! what it computed there. A problem that is its own mirror image, like that of two vehicles in the frame of
//! one, is computed on half of the nodes.

mod layout;
mod kernel;
mod solution;
mod mirror;
mod speeds;
mod limits;
mod march;

use super::game::Game;
use super::grid::Grid;
use super::progress::{MEMORY_LIMIT_BYTES, Progress, SolveError};
use super::scheme::{Eno2, Eno3, Scheme, Upwind, Weno5};
use crate::parallel::{Lanes, default_threads};
use crate::real::Real;
use core::ops::ControlFlow;
use march::march;
use serde::{Deserialize, Serialize};

pub use solution::{Sample, ShallowObstacle, Snapshot, Solution};

/// Whether a state counts that passes through the target, or only one that ends in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// States from which the target is reached at some time up to the horizon.
    Tube,
    /// States from which the target is reached exactly at the horizon.
    Set,
}

/// Which way time runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// States that lead to the target. The march begins at the end of the game: its time τ is the time
    /// left.
    Backward,
    /// States that are reached from the target (the initial set): the same game with reversed
    /// velocities, H(x, −p).
    Forward,
}

/// A function of the state, or of state and time.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Region<'a, const D: usize> {
    /// Fixed.
    Static(&'a (dyn Fn([f64; D]) -> f64 + Sync)),
    /// Depends on the time t, s, of a clock that runs forward from 0: from the beginning of the game, or
    /// from the initial set. A backward march needs a finite horizon for it.
    OfTime(&'a (dyn Fn([f64; D], f64) -> f64 + Sync)),
    /// Depends on the time τ since the march began, s. Backward, that is the time left.
    OfMarchTime(&'a (dyn Fn([f64; D], f64) -> f64 + Sync)),
}

impl<const D: usize> Region<'_, D> {
    /// At τ, and the time t of a clock then.
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

/// What must not be entered.
struct Avoid<'a, const D: usize> {
    region: Region<'a, D>,
    /// What makes it positive inside: V is at least sign · region.
    sign: f64,
}

impl<const D: usize> Avoid<'_, D> {
    /// The name of what set it.
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
        /// Largest change of V, per second.
        tolerance: f64,
        /// March no longer than this, s.
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
    /// l(x): the target is {l ≤ 0}; V starts as l.
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
    /// A backward tube of `target` without obstacle.
    pub fn new(game: &'a G, grid: Grid<D>, target: Region<'a, D>, horizon: Horizon) -> Self {
        let (kind, direction) = (Kind::Tube, Direction::Backward);
        Self { game, grid, target, avoid: None, kind, direction, horizon }
    }

    /// From which states is the target {l ≤ 0} reached within `seconds`? A backward tube without
    /// obstacle.
    pub fn reach(
        game: &'a G,
        grid: Grid<D>,
        target: &'a (dyn Fn([f64; D]) -> f64 + Sync),
        seconds: f64,
    ) -> Self {
        Self::new(game, grid, Region::Static(target), Horizon::Finite(seconds))
    }

    /// Sets the obstacle g(x), whose inside {g < 0} must not be entered; none for none. As the target it is negative
    /// inside, best a distance: V ≥ −g.
    #[must_use]
    pub fn with_avoid(self, avoid: impl Into<Option<Region<'a, D>>>) -> Self {
        let avoid = avoid.into().map(|region| Avoid { region, sign: -1.0 });
        Self { avoid, ..self }
    }

    /// The same with the other sign: V ≥ obstacle, which is **positive** inside.
    #[deprecated(note = "use `with_avoid`, whose function is negative inside as the target is")]
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

    /// The time t of a clock that runs forward, after τ of the march; not a number if it has no
    /// beginning.
    fn clock(&self, march_time: f64) -> f64 {
        match (self.direction, self.horizon) {
            (Direction::Forward, _) => march_time,
            (Direction::Backward, Horizon::Finite(seconds)) => seconds - march_time,
            (Direction::Backward, Horizon::Converged { .. }) => f64::NAN,
        }
    }
}

/// How to solve it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Settings {
    /// Spatial derivatives (and the Runge–Kutta order that goes with them).
    pub scheme: Scheme,
    /// Number of threads; results do not depend on it. 0 counts as 1; there are at most as many
    /// threads as nodes of the first axis.
    pub threads: usize,
    /// Lanes as wide as the machine has them, but no wider than these; results do not depend on them.
    pub lanes: Lanes,
    /// Share of the largest stable time step of first order, above 0 and at most 1. ENO may choose
    /// stencils that are stable only up to 0.5 (second order) or 0.37 (third order); with longer steps
    /// V stays bounded, but loses that order in places.
    pub cfl: f64,
    /// How many instants to store before the end, evenly spaced from the beginning of the march. Needs a
    /// finite horizon, whose time steps become a little shorter, so that these instants are among them.
    pub slices: usize,
    /// A solve that needs more memory than this is refused.
    pub memory_limit_bytes: u64,
}

impl Settings {
    /// `scheme` with its time step, on all threads.
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

    /// Sets [`Self::lanes`], the widest lanes that may be used.
    #[must_use]
    pub fn with_lanes(self, lanes: Lanes) -> Self {
        Self { lanes, ..self }
    }

    /// Sets [`Self::cfl`], the share of the largest stable time step.
    #[must_use]
    pub fn with_cfl(self, cfl: f64) -> Self {
        Self { cfl, ..self }
    }

    /// Sets [`Self::slices`], the number of instants before the end whose values are stored.
    #[must_use]
    pub fn with_slices(self, slices: usize) -> Self {
        Self { slices, ..self }
    }

    /// Sets [`Self::memory_limit_bytes`], the most memory that a solve may take, bytes.
    #[must_use]
    pub fn with_memory_limit(self, memory_limit_bytes: u64) -> Self {
        Self { memory_limit_bytes, ..self }
    }
}

/// Solves `problem`.
///
/// # Bounds
/// A tube's V is the least value of the target along a path, or what the obstacle adds. So at every node
/// min l ≤ V ≤ max(l, −g), where min l is the least value of the target at any node so far. Schemes of higher order
/// undershoot beside kinks; each stage brings V back to min l, as it does to l and −g. What no scheme does in one
/// stage is no undershoot but an error.
///
/// # Low obstacles
/// An indicator that is lower than the target is deep, or a distance in a larger unit, leaves so flat a V that its sign can be wrong.
/// [`Solution::shallow`] says so.
///
/// # Where the grid ends
/// Beyond an end nothing is known, and [`Boundary`](super::Boundary) says what is taken instead. Where the flow leaves
/// the grid, V depends on that. [`Solution::earliest_exit_s`] has the time before which no path leaves: V of a shorter march
/// does not depend on it. Beside an obstacle that jumps, a V below 0 goes on with the lesser of the two slopes at the end,
/// so that a wall is not taken for a slope.
///
/// The solve calls `progress` after every step; it may cancel the solve.
///
/// # Errors
/// [`SolveError::Invalid`] for a grid that is too small for the scheme or too large
/// for the memory, a horizon that is not > 0, a `cfl` outside (0, 1], a target, an
/// obstacle or speed bounds that are not finite at a node (which is named), an obstacle that covers all of the grid or
/// of the target, a game that makes V infinite, NaN or change faster than its speed bounds say, or stored instants or a
/// clock without a finite horizon;
/// [`SolveError::Cancelled`] if `progress` cancels it.
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
