//! Tests of the library from outside, in one program: each program more would link the library once more.
//! What counts the memory of its process, or takes long, is a program of its own beside this folder.

mod algorithm1;
mod baselines;
mod comparison_cache;
mod exact_value;
mod learn_any_driver;
mod learn_boosting;
mod learn_logistic;
mod learn_ranks;
mod learn_svm;
mod learn_tree;
mod learning;
mod recipes;
mod recorded;
mod synthetic;
mod tuning;
