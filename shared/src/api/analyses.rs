//! Analyses on the server. A client sends a [`Request`]; the server queues and runs it and stores
//! the results.

use crate::comparison::Request;
use crate::recording::Exclusion;
use crate::safety::SafetyQuality;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The state of an analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum AnalysisState {
    /// It is waiting for other analyses to end.
    Queued,
    /// It is running. After a restart of the server it is queued again and resumes from the work
    /// already done.
    Running,
    /// It is done; its files can be fetched.
    Done,
    /// It failed; its message says why.
    Failed,
    /// The experimenter cancelled it.
    Cancelled,
    /// Its files were deleted because a participant whose data they contain withdrew.
    Withdrawn,
}

impl AnalysisState {
    /// All states.
    pub const ALL: [Self; 6] =
        [Self::Queued, Self::Running, Self::Done, Self::Failed, Self::Cancelled, Self::Withdrawn];

    /// The word in JSON and in the database.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
            Self::Withdrawn => "withdrawn",
        }
    }

    /// The state with this word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.word() == word)
    }

    /// Whether this state is final.
    #[must_use]
    pub fn is_over(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

/// The progress of an analysis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AnalysisProgress {
    /// Number of work items that are done.
    pub done: u64,
    /// Total number of work items. All items take about the same time.
    pub of: u64,
    /// Estimated remaining time (s). Absent until something has been computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_s: Option<f64>,
}

/// Summary of the results of an analysis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AnalysisResult {
    /// Number of compared participants.
    pub participants: usize,
    /// Excluded participants, with reasons.
    pub excluded: Vec<ExcludedParticipant>,
    /// For each flag that casts doubt on a trial, the number of compared trials with this flag. The
    /// keys are the words of the flags.
    pub flagged: BTreeMap<String, usize>,
    /// Compared participants whose trials are identical to the trials of another participant.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub same_trials: Vec<String>,
    /// The quality of both safety levels over the compared steps. Absent in analyses of an earlier
    /// version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<SafetyQuality>,
    /// Number of rows of cells.csv. The rows for the better of two SVMs repeat rows of that SVM.
    pub cells: usize,
    /// Number of models that were trained and tested. Absent in analyses of an earlier version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub models: Option<usize>,
    /// The version of Sidestep that computed the analysis. Absent in analyses of an earlier
    /// version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// Versions of the study under which the compared participants enrolled. Empty in analyses of
    /// an earlier version.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub study_versions: Vec<u32>,
    /// SHA-256 of the trials that were compared. Absent in analyses of an earlier version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data_sha256: Option<String>,
    /// Mean test accuracies, as in the report's first table. Empty in lists of analyses and in
    /// analyses of an earlier version.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub accuracies: Vec<MeanAccuracy>,
    /// Explanation of how the data are known to be synthetic. Null if they are not.
    pub synthetic: Option<String>,
}

/// The mean over participants of the test accuracy of one kind of model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct MeanAccuracy {
    /// The model: `svm`, `dt` or `lr`.
    pub model: String,
    /// The classes: 1 means right, straight or left; 2 means turn or no turn.
    pub experiment: u8,
    /// The name of the feature set.
    pub features: String,
    /// Share of the test steps predicted correctly (per cent).
    pub percent: f64,
}

/// A participant whose trials an analysis does not use.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ExcludedParticipant {
    /// The participant's number in the study.
    pub participant: String,
    /// The reason for the exclusion.
    pub reason: String,
}

impl From<&Exclusion> for ExcludedParticipant {
    fn from(exclusion: &Exclusion) -> Self {
        Self { participant: exclusion.participant.clone(), reason: exclusion.why() }
    }
}

/// An analysis in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AnalysisSummary {
    /// Id of the analysis.
    pub id: String,
    /// The study's name in URLs.
    pub study: String,
    /// The request.
    pub request: Request,
    /// Its state.
    pub state: AnalysisState,
    /// Its progress. Absent unless it is running.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub progress: Option<AnalysisProgress>,
    /// When the analysis was requested (ms since 1970).
    pub created_at_ms: i64,
    /// When the analysis began (ms since 1970).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub started_at_ms: Option<i64>,
    /// When the analysis ended (ms since 1970).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended_at_ms: Option<i64>,
    /// Why the analysis failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// Summary of its results, once it is done.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<AnalysisResult>,
    /// Whether the study's data have changed since the analysis began: trials were added, or
    /// participants were excluded or included. False until the analysis is done.
    #[serde(default)]
    pub stale: bool,
}

/// A page of analyses, newest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AnalysisPage {
    /// The analyses of this page.
    pub analyses: Vec<AnalysisSummary>,
    /// The value of `before` in the request for the next page. Absent on the last page.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next_before: Option<i64>,
}

/// A file of an analysis, with the name that `sidestep analyze` gives it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AnalysisFile {
    /// File name, such as `report.html` or `models/lr-1-hrd-1.json`.
    pub name: String,
    /// Size (bytes).
    pub octets: u64,
}

/// An analysis, with its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct AnalysisDetail {
    /// The fields of its list entry.
    #[serde(flatten)]
    pub summary: AnalysisSummary,
    /// The files, sorted by name. Empty unless the analysis is done.
    pub files: Vec<AnalysisFile>,
}
