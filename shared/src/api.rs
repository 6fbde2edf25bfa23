//! The interface between client and server: wire types, limits and routes.

pub mod routes;
mod object;
mod study;
mod participation;
mod upload;
mod access;
mod predictors;
mod laboratory;
mod people;
mod drives;
mod configuration;
mod analyses;

pub use access::{Access, Action, AuditEntry, AuditPage, KeyMade, KeySummary, NewKey, Session};
pub use analyses::{
    AnalysisDetail, AnalysisFile, AnalysisPage, AnalysisProgress, AnalysisResult, AnalysisState,
    AnalysisSummary, ExcludedParticipant, MeanAccuracy,
};
pub use configuration::{
    Change, Configuration, ConfigurationVersion, Draft, DraftChecked, FormDraft, NewStatus, Remark,
};
pub use drives::{Drive, Drives, Inputs};
pub use laboratory::{
    Backup, DataCheck, DataCheckState, PilotsDeleted, SelfCheck, SignIn, StudySummary, TrialDetail,
    TrialPage, TrialSummary, scene_words, trial_heading,
};
pub use object::Object;
pub use participation::{
    Answers, Completed, ComprehensionResult, ComprehensionStored, Enrolled, Enrolment, Plan,
    PlannedPhase, PlannedScene, Progress, Withdrawn,
};
pub use people::{
    ExcludedBy, NewExclusion, NewNote, Note, ParticipantDetail, ParticipantPage,
    ParticipantSummary, Quality, Stage, StageCount, TrialPicture,
};
pub use predictors::{
    LearnedSets, PredictorChoices, PredictorPage, PredictorSource, PredictorSummary,
    TrainedPredictor, TrialUse,
};
pub use study::{Admission, CheckForm, Language, QuestionForm, StudyInfo, Texts};
pub use upload::{KeyEvent, TrialStored, TrialUpload};

use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};

/// Version of the interface. A client built for another version must reload.
pub const SCHEMA_VERSION: u32 = 2;

/// Maximum size of a request body (bytes). A trial has about 10,000 bytes.
pub const MAX_BODY_BYTES: usize = 262_144;

/// Maximum number of key events in a trial. Even the fastest typing in ten seconds produces far
/// fewer.
pub const MAX_KEY_EVENTS: usize = 2_000;

/// Minimum length of an enrolment's request id (bytes).
pub const MIN_REQUEST_ID_BYTES: usize = 16;

/// Maximum length (characters) of a keyboard key's name, an external id or a locale.
pub const MAX_NAME_CHARS: usize = 128;

/// Maximum number of URL parameters in an enrolment.
pub const MAX_PARAMETERS: usize = 20;

/// Maximum number of page events in a trial.
pub const MAX_PAGE_EVENTS: usize = 1_000;

/// Maximum size of a free-form object (screen, display) as JSON (bytes).
pub const MAX_OBJECT_BYTES: usize = 8_192;

/// Body of every error response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Problem {
    /// Stable error code, for programs.
    pub code: String,
    /// Error message, for people.
    pub message: String,
    /// The field that caused the error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Return URL for a participant whose participation has ended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

fn check_name(field: &str, text: &str) -> Result<(), Invalid> {
    let count = text.chars().count();
    if !(1..=MAX_NAME_CHARS).contains(&count) {
        let expected = format!("1 to {MAX_NAME_CHARS} characters");
        return Err(Invalid::new(field, expected, format!("{count} characters")));
    }
    if text.trim().is_empty() {
        return Err(Invalid::new(field, "more than white space", "white space only"));
    }
    if text.chars().any(char::is_control) {
        return Err(Invalid::new(field, "no control characters", "a control character"));
    }
    Ok(())
}

fn check_object(field: &str, object: &Object<impl Serialize>) -> Result<(), Invalid> {
    let bytes = serde_json::to_string(object).map_or(usize::MAX, |text| text.len());
    if bytes <= MAX_OBJECT_BYTES {
        Ok(())
    } else {
        let expected = format!("an object of at most {MAX_OBJECT_BYTES} bytes of JSON");
        Err(Invalid::new(field, expected, format!("{bytes} bytes")))
    }
}

fn first() -> u32 {
    1
}

// Serde calls the function named in `skip_serializing_if` with a reference.
#[expect(clippy::trivially_copy_pass_by_ref)]
fn is_first(count: &u32) -> bool {
    *count == 1
}
