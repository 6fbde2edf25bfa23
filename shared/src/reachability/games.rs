//! The games that come with the library, one file each.

mod double_integrator;
mod pursuit;

pub use double_integrator::DoubleIntegrator;
pub use pursuit::RelativeDubins;
