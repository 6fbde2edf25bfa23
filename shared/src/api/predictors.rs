//! Predictors: the models that analyses trained, and the models that replays use.

use crate::predict::PredictorFile;
use crate::shfrs::baselines::EmpiricalSets;
use crate::shfrs::probability::Probabilities;
use serde::{Deserialize, Serialize};

/// A model of an analysis in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorSummary {
    /// Name of its file in the analysis. The file is a `predictor.json`.
    pub file: String,
    /// The number of the participant whose tasks trained it.
    pub participant: i64,
    /// The kind of model, such as `svm_rbf`, `dt` or `lr`; `svm` is the better of two SVMs.
    pub model: String,
    /// The classes: 1 means right, straight or left; 2 means turn or no turn.
    pub experiment: u8,
    /// The name of the feature set.
    pub features: String,
    /// The names of the features in this set.
    pub columns: Vec<String>,
    /// Cross-validation accuracy: the mean over folds of the share of steps predicted correctly,
    /// from 0 to 1.
    pub cv_accuracy: f64,
    /// Test accuracy: the share of the test tasks' steps predicted correctly, from 0 to 1.
    pub test_accuracy: f64,
    /// Id of the participant's last stored task, for a replay with this model. Absent if no task is
    /// stored.
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

/// A page of the models of an analysis, grouped by participant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorPage {
    /// The models of this page.
    pub predictors: Vec<PredictorSummary>,
    /// Number of models that match the filter, on all pages.
    pub total: u64,
    /// All filter options of the analysis, regardless of the current filter. Empty unless the
    /// analysis is done.
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
    /// Why the learned model could not be used. Absent if it was used.
    pub fallback: Option<String>,
    /// The ids of the trials that it was trained on. On these trials, its accuracy is
    /// overestimated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trained_on: Vec<String>,
    /// The analysis that trained the predictor. Absent if it was trained on the participant's
    /// earlier trials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<PredictorSource>,
}

/// Sets learned from a participant's earlier trials.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct LearnedSets {
    /// The sets.
    pub sets: EmpiricalSets,
    /// The number of trials from which the sets were learned.
    pub trials: usize,
    /// The coverage of the sets on the participant's other tasks. Null if there are no other tasks.
    pub held: Option<Probabilities>,
}

/// The analysis and model that a predictor comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PredictorSource {
    /// Id of the analysis.
    pub analysis: String,
    /// Its study's name in URLs.
    pub study: String,
    /// The model's entry in the analysis's list of models.
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
    /// The model was trained on the trial.
    Trained,
    /// The trial was held out to test the model.
    HeldOut,
    /// The model belongs to the participant who drove, but the analysis did not use the trial.
    Unused,
    /// The model belongs to another participant of the study.
    OtherParticipant,
    /// The analysis belongs to another study.
    OtherStudy,
}
