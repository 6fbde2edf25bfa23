//! Training: how the models of [`predict`](crate::predict) come about.

pub mod boosting;
pub mod logistic;
pub mod samples;
pub mod tree;
