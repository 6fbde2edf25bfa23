//! Level-set solver on rectangular grids: local Lax–Friedrichs in space, TVD
//! Runge–Kutta in time, one to four dimensions.
//!
//! Mitchell, *A Toolbox of Level Set Methods* (2008) and Osher and Fedkiw (2003).
//! One array holds the values, with ghost nodes all around. A stage walks over the last two axes as
//! one run of cells, in blocks that fit into the first-level cache with their derivatives, so there
//! are no arrays of derivatives. The run passes over ghost nodes; filling the ghosts later replaces
//! what it computed there.

mod layout;
mod kernel;
mod solution;
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

pub use solution::{Sample, Snapshot, Solution};

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

/// When the march ends.
#[derive(Clone, Copy, Debug, PartialEq)]
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
pub struct Problem<'a, const D: usize, G> {
    /// The dynamics and the players.
    pub game: &'a G,
    /// The nodes on which V is computed.
    pub grid: Grid<D>,
    /// l(x): the target is {l ≤ 0}; V starts as l.
    pub target: Region<'a, D>,
    /// The states that must not be entered: positive inside, V ≥ obstacle (reach-avoid).
    pub obstacle: Option<Region<'a, D>>,
    /// Tube or set.
    pub kind: Kind,
    /// Backward or forward.
    pub direction: Direction,
    /// When the march ends.
    pub horizon: Horizon,
}

impl<'a, const D: usize, G> Problem<'a, D, G> {
    /// From which states is the target {l ≤ 0} reached within `seconds`? A backward tube without
    /// obstacle; change a field to ask otherwise.
    pub fn reach(
        game: &'a G,
        grid: Grid<D>,
        target: &'a (dyn Fn([f64; D]) -> f64 + Sync),
        seconds: f64,
    ) -> Self {
        Self {
            game,
            grid,
            target: Region::Static(target),
            obstacle: None,
            kind: Kind::Tube,
            direction: Direction::Backward,
            horizon: Horizon::Finite(seconds),
        }
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
    pub fn of(scheme: Scheme) -> Self {
        Self {
            scheme,
            threads: default_threads(),
            lanes: Lanes::widest(),
            cfl: scheme.cfl(),
            slices: 0,
            memory_limit_bytes: MEMORY_LIMIT_BYTES,
        }
    }

    /// Sets [`Settings::slices`], the number of instants before the end whose values are stored.
    #[must_use]
    pub fn slices(self, slices: usize) -> Self {
        Self { slices, ..self }
    }

    /// Sets [`Settings::threads`], the number of threads.
    #[must_use]
    pub fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }
}

/// Solves `problem`.
///
/// The solve calls `progress` after every step; it may cancel the solve.
///
/// # Errors
/// [`SolveError::Invalid`] for a grid that is too small for the scheme or too large
/// for the memory, a horizon that is not > 0, a `cfl` outside (0, 1], a target, an
/// obstacle or speed bounds that are not finite at a node (which is named), a game that makes V
/// infinite or NaN, or stored instants or a clock without a finite horizon;
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
