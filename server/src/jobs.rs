//! Long work in the background: value functions of studies, and analyses.

pub mod fit_cache;
pub mod analysis;
pub mod analysis_index;
pub mod frames;
pub mod child;
pub mod children;
pub mod safety;
pub mod keeper;
pub mod analysis_limits;
pub mod analysis_process;
pub mod analysis_worker;
