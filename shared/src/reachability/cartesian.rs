//! Level-set solver on rectangular grids: local Lax–Friedrichs in space, TVD
//! Runge–Kutta in time, one to four dimensions.
//!
//! Mitchell, *A Toolbox of Level Set Methods* (2008) and Osher and Fedkiw (2003).
//! Values live in one array with ghost nodes all around; a stage walks over the
//! last two axes as one run of cells in blocks that stay in the first-level cache,
//! derivatives included, so there are no derivative arrays. The run passes over
//! ghost nodes; what it computes there is replaced when the ghosts are filled.

mod layout;
mod kernel;
mod march;

use super::game::Game;
use super::grid::Grid;
use super::progress::{MEMORY_LIMIT_BYTES, Progress, SolveError};
use super::scheme::{Eno2, Eno3, Scheme, Upwind, Weno5};
use crate::parallel::default_threads;
use crate::real::Real;
use core::ops::ControlFlow;
use march::march;

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
    /// The states that may not be entered: positive inside, V ≥ obstacle (reach-avoid).
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
    /// Refuse to take more memory than this.
    pub memory_limit_bytes: u64,
}

impl Settings {
    /// `scheme` with the time step that suits it, on all threads.
    #[must_use]
    pub fn of(scheme: Scheme) -> Self {
        Self {
            scheme,
            threads: default_threads(),
            cfl: scheme.cfl(),
            memory_limit_bytes: MEMORY_LIMIT_BYTES,
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
