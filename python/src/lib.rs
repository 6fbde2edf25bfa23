//! Native half of the Python package `sidestep`: the library's functions for NumPy arrays.
//!
//! The functions of this crate compute nothing themselves. Each file checks the arguments from Python
//! (`arrays`), releases the interpreter while the library works, and returns arrays and objects that own
//! their memory. An invalid value raises a `ValueError` with the argument's name, the expected and the actual
//! value (`error`).
//!
//! Functions that draw figures or read tables are plain Python, in `python/package/sidestep/`.

mod error;
mod interrupt;
mod scalars;
mod arrays;
mod files;
mod kept;
mod vehicles;
mod value;
mod function;
mod grid;
mod solution;
mod hj;
mod predictor;
mod human;
mod bounds;
mod reach;
mod trajectory;
mod plan;
mod shfrs_settings;
mod shfrs;
mod online;
mod calibration;

use pyo3::prelude::*;

/// The native half of `sidestep`. Import the package `sidestep` instead.
#[pymodule]
#[pyo3(name = "_sidestep")]
mod native {
    use super::Bound;
    use super::PyModule;
    use super::PyModuleMethods;
    use super::PyResult;

    #[pymodule_export]
    use crate::arrays::AngleWarning;
    #[pymodule_export]
    use crate::bounds::bounds;
    #[pymodule_export]
    use crate::calibration::{Calibration, CollisionBound, calibrate};
    #[pymodule_export]
    use crate::function::{SafetyLevels, ValueFunction, solve};
    #[pymodule_export]
    use crate::grid::Grid;
    #[pymodule_export]
    use crate::hj::hj_solve;
    #[pymodule_export]
    use crate::human::ActionModel;
    #[pymodule_export]
    use crate::online::OnlinePredictor;
    #[pymodule_export]
    use crate::plan::{drive_all, largest_clear};
    #[pymodule_export]
    use crate::predictor::{Predictor, features};
    #[pymodule_export]
    use crate::reach::{ReachableSet, reach_all};
    #[pymodule_export]
    use crate::shfrs::{Shfrs, ShfrsPredictor};
    #[pymodule_export]
    use crate::shfrs_settings::ShfrsSettings;
    #[pymodule_export]
    use crate::solution::Solution;
    #[pymodule_export]
    use crate::trajectory::{Trajectory, simulate};
    #[pymodule_export]
    use crate::value::{relative_state, state, value};
    #[pymodule_export]
    use crate::vehicles::{PursuitGame, SceneParameters, VehicleModel};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("FEATURES", crate::predictor::feature_table())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
