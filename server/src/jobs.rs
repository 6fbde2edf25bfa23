//! Long work off the request path: value functions that a study lacks, and analyses.

pub mod safety;
pub mod fit_cache;
pub mod analysis;
pub mod analysis_worker;
