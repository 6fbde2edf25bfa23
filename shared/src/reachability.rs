//! Value functions of pursuit games: from which states can the pursuer force a collision?

mod progress;
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
mod contour;
mod value_function;
mod slice_curves;
mod checksum;
mod transport;
mod options;
mod solve;
pub mod npz;
mod surface;

pub use crate::parallel::{Lanes, default_threads};
pub use crate::real::Real;
pub use exact::{ExactState, ExactValue};
pub use game::{Game, Inputs, Players, TERMS};
pub use games::{AffineArrays, ControlAffine, DoubleIntegrator, DubinsCar, RelativeDubins};
pub use grid::{Axis, Boundary, Grid};
pub use options::{ACCURACIES, Accuracy, CartesianGrid, METHODS, Method, Options, Precision};
pub use progress::{MEMORY_LIMIT_BYTES, Progress, SolveError};
pub use pursuit::PursuitGame;
pub use sampled::{Nodes, SampledState, SampledValue};
pub use scheme::Scheme;
pub use slice_curves::CurveSettings;
pub use solve::{Solved, solve};
pub use surface::{Sampling, Surface};
pub use transport::QUANTUM_M;
pub use value_function::{ValueFunction, ValueState};
