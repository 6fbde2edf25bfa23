//! A study as the participant's page needs it, and all texts of that page.

use super::{Object, SCHEMA_VERSION};
use crate::scene::SceneParameters;
use crate::study::{PhaseConfig, QuestionKind, Status, StudyConfig, TrialSettings};
use serde::{Deserialize, Serialize};

/// A study as the participant's page needs it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct StudyInfo {
    /// See [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name in URLs.
    pub slug: String,
    /// Name shown to people.
    pub title: String,
    /// Vehicles, danger radius and clock.
    pub parameters: SceneParameters,
    /// The phases and their scenes.
    pub phases: Vec<PhaseConfig>,
    /// Whether the requesting person can take part. If the request has no external id, this field
    /// says whether a new person can take part.
    pub admission: Admission,
    /// URL for people who cannot take part, if the study sets one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
    /// The course of every trial.
    pub trials: TrialSettings,
    /// Number of failed attempts at the check of understanding after which the participation ends.
    /// 0 means that there is no limit.
    pub comprehension_attempts: usize,
    /// Whether the questions of the check of understanding are drawn for each participant. If so,
    /// the client fetches the texts again after enrolment.
    #[serde(default)]
    pub draws_check: bool,
    /// URL parameters that may hold the person's external id.
    pub external_id_parameters: Vec<String>,
    /// URL parameters that are stored with the participant.
    pub recorded_parameters: Vec<String>,
    /// Whether a new participant needs an external id.
    pub requires_external_id: bool,
}

impl StudyInfo {
    /// A study as the participant's page needs it.
    #[must_use]
    pub fn of(study: &StudyConfig, admission: Admission) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            slug: study.slug.clone(),
            title: study.title.clone(),
            parameters: study.parameters,
            phases: study.phases.clone(),
            admission,
            return_url: None,
            trials: study.trials,
            comprehension_attempts: study.comprehension.attempts,
            draws_check: study.comprehension.is_drawn(),
            external_id_parameters: study.recruitment.external_id.clone(),
            recorded_parameters: study.recruitment.record.clone(),
            requires_external_id: study.recruitment.require_external_id,
        }
    }
}

/// Whether a person can take part in a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Admission {
    /// Yes.
    Open,
    /// No: the study has reached its target number of participants.
    Full,
    /// No: the study is closed; participants who have begun can finish.
    Closed,
    /// No: the study is over for everybody.
    Archived,
    /// No: this person has finished.
    Finished,
    /// No: this person has withdrawn.
    Withdrawn,
    /// No: the check of understanding ended this person's participation.
    ScreenedOut,
}

impl From<Status> for Admission {
    /// The admission to a study that is not full.
    fn from(status: Status) -> Self {
        match status {
            Status::Open => Self::Open,
            Status::Closed => Self::Closed,
            Status::Archived => Self::Archived,
        }
    }
}

/// All texts that a participant reads, in one language.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Texts {
    /// Tag of the language, such as `de`.
    pub language: String,
    /// The languages to choose from.
    pub offered: Vec<Language>,
    /// The sentences of the page by key, such as `welcome.lead`. The page fills in placeholders
    /// such as `{name}`.
    pub sentences: Object<String>,
    /// The researcher's consent text, as HTML without scripts. Absent if the study has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub consent: Option<String>,
    /// Facts about the study by key (`investigator`, `institution`, `contact`, `ethics`,
    /// `retention`). Facts that the researcher did not give are missing.
    pub facts: Vec<(String, String)>,
    /// The check of understanding. Empty if the study has none.
    pub check: Vec<CheckForm>,
    /// The questions after the last scene.
    pub questions: Vec<QuestionForm>,
    /// The debriefing (what the study was about), as HTML without scripts. Absent if the study has
    /// none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub debrief: Option<String>,
}

/// A language that the participant can choose.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Language {
    /// Its tag, such as `de`.
    pub tag: String,
    /// Its own name, such as `Deutsch`.
    pub name: String,
}

/// A question with one right answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct CheckForm {
    /// The question. The page fills in placeholders such as `{name}`, as in sentences.
    pub text: String,
    /// The answers.
    pub options: Vec<String>,
    /// Index of the right answer, from 0.
    pub answer: usize,
}

/// A question after the last scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct QuestionForm {
    /// Name of the answer.
    pub name: String,
    /// Type of the answer.
    pub kind: QuestionKind,
    /// The question.
    pub text: String,
    /// Whether it must be answered.
    pub required: bool,
    /// The value and the text of each option of a choice.
    pub options: Vec<(String, String)>,
    /// Lowest and highest number of a scale.
    pub range: (i64, i64),
    /// Labels of the lowest and of the highest number.
    pub ends: (String, String),
    /// Maximum length of a text (characters).
    pub max_chars: usize,
}
