//! Training: how the models of [`predict`](crate::predict) come about.

pub mod svm;
