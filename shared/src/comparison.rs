//! The paper's comparison: do safety levels help to predict people?
//!
//! For every participant, feature set, model and experiment, [`run()`] trains a model and tests it
//! on the participant's last tasks. Hyper-parameters are chosen by cross-validation that holds out
//! whole trials. From the resulting cells, [`analyse`] computes every number that a report prints:
//! the paper's tables, the tests of differences, the ablation, calibration, roll-outs and findings.
//! All results are bit-identical for every order of rows and participants and every number of
//! threads.

pub mod metrics;
pub mod split;
pub mod sets;
pub mod models;
pub mod cell;
pub mod fit;
mod settings;
pub mod rollout;
pub mod tables;
mod plan;
mod cost;
pub mod importance;
mod run;
mod power;
pub mod gains;
pub mod generalisation;
pub mod decision_map;
pub mod findings;
mod copies;
mod numbers;
mod fingerprint;

pub use copies::CopiedTrials;
pub use cost::Cost;
pub use fingerprint::learning_fingerprints;
pub use numbers::{Analysis, Counts, DataSummary, analyse};
pub use plan::{DataError, ParticipantData};
pub use run::{AnalysisError, Cache, FewTasks, Leakage, Progress, Results, RolloutsOf, run};
pub use settings::{Request, Settings};
