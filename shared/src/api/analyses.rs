//! Analyses that the server makes: asked for with a [`Request`], queued, run, kept.

use crate::comparison::{Exclusion, Request};
use crate::safety::SafetyQuality;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What has become of an analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AnalysisState {
    /// It waits for others to end.
    Queued,
    /// It is being made. After a restart of the server it is queued again, and takes up what
    /// was computed before.
    Running,
    /// Its files can be fetched.
    Done,
    /// It could not be made; its message says why.
    Failed,
    /// The experimenter did not want it any more.
    Cancelled,
    /// Its files are deleted: somebody whose data they hold withdrew them.
    Withdrawn,
}

impl AnalysisState {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Queued, Self::Running, Self::Done, Self::Failed, Self::Cancelled, Self::Withdrawn];

    /// As it is stored and sent.
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

    /// The state of that word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.word() == word)
    }

    /// Whether nothing more will happen to it by itself.
    #[must_use]
    pub fn is_over(self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

/// How far an analysis is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalysisProgress {
    /// Pieces of work that are done.
    pub done: u64,
    /// All of them; they take about equally long.
    pub of: u64,
    /// Time left, s, if the rest goes on as so far; absent before
    /// anything is computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_s: Option<f64>,
}

/// What an analysis is about, once it is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalysisResult {
    /// People who were compared.
    pub participants: usize,
    /// Who was left out, and why.
    pub excluded: Vec<Exclusion>,
    /// How many of the trials that are compared have a flag that casts doubt on them, by its word.
    pub flagged: BTreeMap<String, usize>,
    /// Who of those that are compared has the same trials as somebody else.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub same_trials: Vec<String>,
    /// How both safety levels came about, and how much they differ over the steps that are
    /// compared; absent of an analysis that an earlier version made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<SafetyQuality>,
    /// Models that were trained and tested.
    pub cells: usize,
    /// Why the data are known to be synthetic, if they are.
    pub synthetic: Option<String>,
}

/// An analysis in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalysisSummary {
    /// The analysis.
    pub id: String,
    /// The study's name in addresses.
    pub study: String,
    /// What was asked for.
    pub request: Request,
    /// What has become of it.
    pub state: AnalysisState,
    /// How far it is; absent unless it is running.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub progress: Option<AnalysisProgress>,
    /// When it was asked for, ms since 1970.
    pub created_at_ms: i64,
    /// When it began, ms since 1970.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub started_at_ms: Option<i64>,
    /// When it ended, ms since 1970.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ended_at_ms: Option<i64>,
    /// Why it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub message: Option<String>,
    /// What it is about, once it is done.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<AnalysisResult>,
}

/// A page of analyses, newest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalysisPage {
    /// The analyses of this page.
    pub analyses: Vec<AnalysisSummary>,
    /// Pass as `before` for the next page; absent on the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next_before: Option<i64>,
}

/// A file of an analysis, by the name that `sidestep analyze` gives it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AnalysisFile {
    /// Such as `report.html` or `models/lr-1-hrd-1.json`.
    pub name: String,
    /// Its length.
    pub octets: u64,
}

/// An analysis, with its files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalysisDetail {
    /// As in the list.
    #[serde(flatten)]
    pub summary: AnalysisSummary,
    /// By name; empty unless it is done.
    pub files: Vec<AnalysisFile>,
}
