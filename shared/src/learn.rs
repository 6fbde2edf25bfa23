//! Training of the models of [`crate::predict`].
//!
//! Nothing here is random, and all of it runs on one thread.

pub mod samples;
pub mod logistic;
pub mod tree;
pub mod boosting;
pub mod svm;
