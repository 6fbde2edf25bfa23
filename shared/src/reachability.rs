//! Pursuit games: who can force a collision, and from where.

mod exact;
mod pursuit;
mod grid;
mod game;
mod scheme;
pub mod cartesian;
pub mod polar;
mod games;
mod table;
mod sampled;
mod level_set;
mod contour;
mod transport;
mod value_function;
mod solve;

pub use crate::parallel::default_threads;
pub use crate::real::Real;
pub use exact::{ExactState, ExactValue};
pub use game::{Game, TERMS};
pub use games::{DoubleIntegrator, DubinsCar, RelativeDubins};
pub use grid::{Axis, Boundary, Grid};
pub use level_set::{CurveSettings, radial_level_curve};
pub use pursuit::PursuitGame;
pub use sampled::{Nodes, SampledState, SampledValue};
pub use scheme::Scheme;
pub use solve::{Accuracy, CartesianGrid, Method, Options, Precision, Solved, solve};
pub use transport::QUANTUM_M;
pub use value_function::{ValueFunction, ValueState, hex};

use crate::invalid::Invalid;

/// How far a solve has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Share of the steps done, 0 … 1 (of the most there can be, when the march
    /// may end earlier).
    pub done: f64,
    /// Largest change of V per second when last looked at.
    pub residual: f64,
}

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The problem cannot be solved as stated.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// The caller stopped the solve.
    #[error("the solve was cancelled")]
    Cancelled,
}

/// What a solve may take unless told otherwise: 8 GiB; in a browser 1 GiB.
pub const MEMORY_LIMIT_BYTES: u64 = if cfg!(target_arch = "wasm32") { 1 << 30 } else { 8 << 30 };
