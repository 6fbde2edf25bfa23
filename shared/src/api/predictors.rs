//! Predictors: the models of analyses, and those of replays.

use crate::predict::PredictorFile;
use crate::shfrs::baselines::EmpiricalSets;
use crate::shfrs::probability::Probabilities;
use serde::{Deserialize, Serialize};

/// A model of an analysis in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorSummary {
    /// Its file in the analysis: a `predictor.json`.
    pub file: String,
    /// The number of the participant whose tasks trained it.
    pub participant: i64,
    /// The kind of model, such as `svm_rbf`, `dt` or `lr`; `svm` is the better of two SVMs.
    pub model: String,
    /// 1: right, straight or left; 2: turn or not.
    pub experiment: u8,
    /// The name of the feature set.
    pub features: String,
    /// The names of the features in it.
    pub columns: Vec<String>,
    /// Share of steps predicted right, mean over the folds of cross-validation, from 0 to 1.
    pub cv_accuracy: f64,
    /// Share of the steps of the test tasks predicted right, from 0 to 1.
    pub test_accuracy: f64,
    /// The participant's last stored task, for a replay with this model; absent if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub newest_task: Option<String>,
}

/// Filter options for the models of an analysis.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorChoices {
    /// The numbers of all participants with models, ascending.
    pub participants: Vec<i64>,
    /// The kinds of model.
    pub models: Vec<String>,
    /// The experiments.
    pub experiments: Vec<u8>,
    /// The names of the feature sets.
    pub features: Vec<String>,
}

/// A page of the models of an analysis, participant by participant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorPage {
    /// The models of this page.
    pub predictors: Vec<PredictorSummary>,
    /// Number of models that match the filter, on all pages.
    pub total: u64,
    /// All options of the analysis, regardless of the filter; empty unless it is done.
    pub choices: PredictorChoices,
}

/// A predictor and how it was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrainedPredictor {
    /// The predictor, as in a `predictor.json`.
    pub predictor: PredictorFile,
    /// The number of trials that it was trained on.
    pub trials: usize,
    /// Why the learned model could not be used; absent if it was.
    pub fallback: Option<String>,
    /// The ids of these trials: on them, accuracy is overestimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trained_on: Vec<String>,
    /// The analysis that trained it; absent if it was trained on the participant's earlier trials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<PredictorSource>,
}

/// Sets that are learned from a participant's earlier trials.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct LearnedSets {
    /// The sets.
    pub sets: EmpiricalSets,
    /// The number of trials that they are learned from.
    pub trials: usize,
    /// Their coverage on the participant's other tasks; null if there are none.
    pub held: Option<Probabilities>,
}

/// The analysis and model that a predictor comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorSource {
    /// The analysis.
    pub analysis: String,
    /// Its study's name in URLs.
    pub study: String,
    /// As in the list of the analysis.
    #[serde(flatten)]
    pub summary: PredictorSummary,
    /// How the training used the trial.
    pub trial: TrialUse,
}

/// How the training of a model used a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum TrialUse {
    /// The trial is one of those that trained it.
    Trained,
    /// The trial was held back to test it.
    HeldOut,
    /// The model is of the participant who drove, but the analysis did not use the trial.
    Unused,
    /// The model is of another participant of the study.
    OtherParticipant,
    /// The analysis is of another study.
    OtherStudy,
}
