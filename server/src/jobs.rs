//! Long work in the background: value functions of studies, and analyses.

pub mod safety;
pub mod fit_cache;
pub mod analysis;
pub mod analysis_index;
pub mod analysis_worker;
