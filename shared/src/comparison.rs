//! The paper's comparison: does what is known of the danger help to predict a person?
//!
//! For every person, feature set, model and experiment a model is trained, with hyper-parameters
//! chosen by cross-validation over whole trials, and tested on the person's last tasks
//! ([`run()`]). From these cells come the paper's tables, tests of the differences
//! ([`tables`]), the ablation, calibration and roll-outs. All of it is the same to the last bit
//! whatever the order of rows and people and the number of threads.

pub mod ablation;
pub mod avoidance;
pub mod baseline;
pub mod cell;
mod fingerprint;
pub mod fit;
pub mod metrics;
mod request;
pub mod rollout;
mod run;
pub mod split;
pub mod tables;

pub use fingerprint::learning_fingerprints;
pub use request::Request;
pub use run::{
    Cache, Exclusion, Leakage, Person, Progress, Results, RolloutsOf, RunError, Settings, run,
};
