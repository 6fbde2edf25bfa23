//! Training: how the models of [`crate::predict`] come about.
//!
//! Nothing here is random, and all of it runs on one thread.

pub mod boosting;
pub mod logistic;
pub mod samples;
pub mod svm;
pub mod tree;
