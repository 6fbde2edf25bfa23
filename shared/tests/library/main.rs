//! Tests of the library's public interface. They are one program, because each further program
//! would link the library again. Tests that count memory or take long are separate programs next to
//! this folder.

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
