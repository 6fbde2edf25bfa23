//! Training of the models of [`crate::predict`].
//!
//! Training is deterministic and runs on one thread.

pub mod samples;
pub mod logistic;
pub mod tree;
pub mod boosting;
pub mod svm;
pub mod participant;
