//! The participants of a study, as experimenters see them.

use super::{Inputs, TrialSummary};
use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Stage of a participation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Has enrolled and reads the instructions before the first scene.
    Joined,
    /// The next scene is a familiarisation scene.
    Familiarisation,
    /// The next scene is a practice scene.
    Practice,
    /// The next scene is a task.
    Task,
    /// All scenes are stored, but the participation is not complete; the participant answers the
    /// questions.
    Closing,
    /// Has a completion code.
    Complete,
    /// The check of understanding ended the participation.
    ScreenedOut,
    /// Withdrew; the data are kept or deleted.
    Withdrawn,
    /// The trials were read from a file.
    Imported,
}

impl Stage {
    /// All stages, in the order of a participation.
    pub const ALL: [Self; 9] = [
        Self::Joined,
        Self::Familiarisation,
        Self::Practice,
        Self::Task,
        Self::Closing,
        Self::Complete,
        Self::ScreenedOut,
        Self::Withdrawn,
        Self::Imported,
    ];

    /// The word in JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Joined => "joined",
            Self::Familiarisation => "familiarisation",
            Self::Practice => "practice",
            Self::Task => "task",
            Self::Closing => "closing",
            Self::Complete => "complete",
            Self::ScreenedOut => "screened_out",
            Self::Withdrawn => "withdrawn",
            Self::Imported => "imported",
        }
    }
}

/// Data quality: how many of the participant's stored tasks (including repeated attempts) have each
/// property, and the number of failed checks of understanding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Quality {
    /// Tasks with a late sample.
    pub late_sample: u32,
    /// Tasks in which the page lost focus or was hidden.
    pub focus_lost: u32,
    /// Tasks that were interrupted.
    pub interrupted: u32,
    /// Tasks without a turn.
    pub never_steered: u32,
    /// Tasks with a turn in every step.
    pub always_steered: u32,
    /// Tasks in which the human entered the danger zone.
    pub danger_entered: u32,
    /// Tasks whose key events have exactly the same times as an earlier trial of the study, which
    /// suggests that a program drove.
    pub same_timing: u32,
    /// Failed attempts at the check of understanding.
    #[serde(default)]
    pub failed_checks: u32,
}

/// A participant in the list.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ParticipantSummary {
    /// Id of the participant.
    pub participant_id: String,
    /// Their number within the study, from 1; pilots are numbered separately.
    pub number: i64,
    /// Whether this is a pilot.
    pub pilot: bool,
    /// The participant's id at the recruiting service, unchanged. Only for keys with export access.
    pub external_id: Option<String>,
    /// Their stage.
    pub stage: Stage,
    /// The completion code, if the participation is complete. Only for keys with export access.
    pub completion_code: Option<String>,
    /// Number of their attempts at the check of understanding.
    pub comprehension_attempts: u32,
    /// Whether they passed the check.
    pub understood: bool,
    /// Number of stored trials.
    pub stored: u32,
    /// Number of planned scenes, including repeated attempts.
    pub planned: u32,
    /// Number of driven trials that were still queued in the participant's browser when the server
    /// last stored a trial.
    #[serde(default)]
    pub waiting: u32,
    /// When they enrolled (ms since 1970).
    pub enrolled_at_ms: i64,
    /// When the server last stored data of this participant (ms since 1970).
    pub last_seen_at_ms: i64,
    /// Data quality.
    pub quality: Quality,
    /// Whether they are excluded from analyses.
    pub excluded: bool,
}

/// Why a participant is excluded from analyses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ExcludedBy {
    /// The reason, in the experimenter's words.
    pub reason: String,
    /// When they were excluded (ms since 1970).
    pub at_ms: i64,
    /// The name of the key that excluded them.
    pub who: String,
}

/// An experimenter's note about a participant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Note {
    /// Id in URLs.
    pub id: i64,
    /// The text.
    pub text: String,
    /// When it was written (ms since 1970).
    pub at_ms: i64,
    /// The name of the key that wrote it.
    pub who: String,
}

/// The request for a note.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NewNote {
    /// 1 to 2000 characters on any number of lines.
    #[cfg_attr(feature = "openapi", schemars(length(min = 1, max = 2_000)))]
    pub text: String,
}

/// The request to exclude a participant from analyses.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NewExclusion {
    /// 1 to 200 characters on one line.
    #[cfg_attr(feature = "openapi", schemars(length(min = 1, max = 200)))]
    pub reason: String,
}

impl NewNote {
    /// Checks that the text has a valid length and no control characters except newlines.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        check_text("text", &self.text, 2_000, |c| c == '\n')
    }
}

impl NewExclusion {
    /// Checks that the reason has a valid length and no control characters.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        check_text("reason", &self.reason, 200, |_| false)
    }
}

fn check_text(field: &str, text: &str, most: usize, also: fn(char) -> bool) -> Result<(), Invalid> {
    let count = text.chars().count();
    if text.trim().is_empty() || count > most {
        let expected = format!("1 to {most} characters, not only spaces");
        return Err(Invalid::new(field, expected, format!("{count} characters")));
    }
    if text.chars().any(|c| c.is_control() && !also(c)) {
        return Err(Invalid::new(field, "no control characters", "one"));
    }
    Ok(())
}

/// A trial as a small picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialPicture {
    /// The fields of its list entry.
    #[serde(flatten)]
    pub summary: TrialSummary,
    /// Positions of the human's vehicle at every second step, including the first and the last: x
    /// and y (m) in the scene's frame, rounded to centimetres.
    pub human: Vec<[f64; 2]>,
    /// Positions of the robot at the same times.
    pub robot: Vec<[f64; 2]>,
    /// The input of each step.
    pub inputs: Inputs,
}

/// A participant in full.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ParticipantDetail {
    /// The fields of the list entry.
    #[serde(flatten)]
    pub summary: ParticipantSummary,
    /// The study's name in URLs.
    pub study: String,
    /// SHA-256 of the configuration under which they enrolled.
    pub configuration: String,
    /// Whether this is a program and not a person. It is a program if the study has only synthetic
    /// participants or if a trial reports that a program drove.
    #[serde(default)]
    pub synthetic: bool,
    /// Version number, within the study, of the configuration under which they enrolled. Absent if
    /// the study never used it.
    #[serde(default)]
    pub configuration_number: Option<u32>,
    /// The experimenter's label of this configuration.
    #[serde(default)]
    pub configuration_label: String,
    /// Radius of the danger zone (m).
    pub danger_radius_m: f64,
    /// When they withdrew (ms since 1970).
    pub withdrawn_at_ms: Option<i64>,
    /// Whether their data were deleted.
    pub data_deleted: bool,
    /// Their answers by question name. Only for keys with export access.
    pub answers: BTreeMap<String, Value>,
    /// The recorded URL parameters of their link. Only for keys with export access.
    pub parameters: BTreeMap<String, String>,
    /// Why they are excluded from analyses, if they are.
    pub exclusion: Option<ExcludedBy>,
    /// The notes, oldest first.
    pub notes: Vec<Note>,
    /// The stored trials in the order of the plan.
    pub trials: Vec<TrialPicture>,
}

/// The number of participants at a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct StageCount {
    /// The stage.
    pub stage: Stage,
    /// The number of participants, regardless of the page's filter.
    pub participants: u64,
}

/// A page of participants.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ParticipantPage {
    /// The participants of this page.
    pub participants: Vec<ParticipantSummary>,
    /// Number of participants that match the filter, on all pages.
    pub total: u64,
    /// The stages with at least one participant.
    pub stages: Vec<StageCount>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_those_of_json() {
        for stage in Stage::ALL {
            assert_eq!(serde_json::to_value(stage).unwrap(), stage.word());
        }
    }
}
