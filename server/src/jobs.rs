//! Long work in the background: value functions of studies, analyses, checks and backups.

pub mod fit_cache;
pub mod model_index;
pub mod frames;
pub mod children;
pub mod safety;
pub mod keeper;
pub mod analysis;
pub mod child;
