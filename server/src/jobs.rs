//! Long work off the request path: value functions that a study lacks, and analyses.

pub mod analyst;
pub mod safety;
