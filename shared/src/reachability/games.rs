//! The games that come with the library, one file each.

mod affine_arrays;
mod control_affine;
mod double_integrator;
mod dubins_car;
mod pursuit;

pub use affine_arrays::AffineArrays;
pub use control_affine::ControlAffine;
pub use double_integrator::DoubleIntegrator;
pub use dubins_car::DubinsCar;
pub use pursuit::RelativeDubins;
