//! The interface between client and server: wire types, limits and routes.

mod analyses;

pub use analyses::{
    AnalysisDetail, AnalysisFile, AnalysisPage, AnalysisProgress, AnalysisResult, AnalysisState,
    AnalysisSummary, ExcludedParticipant,
};

use crate::invalid::{Invalid, finite, length};
use crate::predict::PredictorFile;
use crate::scene::{Evader, JointState, Scene, SceneParameters};
use crate::study::{PhaseConfig, QuestionKind, Status, StudyConfig, TrialSettings, normalised_id};
use crate::trial::{Flag, Outcome, PageEvent, Phase, Replay};
use crate::vehicle::{Pose, TurnInput};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Version of everything in this module; a client that was built for another version
/// must be reloaded.
pub const SCHEMA_VERSION: u32 = 2;

/// Largest request body, bytes. A trial is about 10,000.
pub const MAX_BODY_BYTES: usize = 262_144;

/// Most key events of a trial: ten seconds of the fastest hammering, many times over.
pub const MAX_KEY_EVENTS: usize = 2_000;

/// Shortest name of an enrolment's request, bytes.
pub const MIN_REQUEST_ID_BYTES: usize = 16;

/// Longest name of a key, external id or locale, characters.
pub const MAX_NAME_CHARS: usize = 128;

/// Most parameters of the address that an enrolment brings.
pub const MAX_PARAMETERS: usize = 20;

/// Most page events of a trial.
pub const MAX_PAGE_EVENTS: usize = 1_000;

/// Largest free-form object (screen, display) as JSON, bytes.
pub const MAX_OBJECT_BYTES: usize = 8_192;

/// Every route, relative to the server's origin.
pub mod routes {
    /// What a participant needs to know.
    #[must_use]
    pub fn study(slug: &str) -> String {
        format!("/api/v1/studies/{slug}")
    }
    /// The sentences of the participant's page, and the study's own texts.
    #[must_use]
    pub fn texts(slug: &str) -> String {
        format!("/api/v1/studies/{slug}/texts")
    }
    /// Enrolment.
    #[must_use]
    pub fn participants(slug: &str) -> String {
        format!("/api/v1/studies/{slug}/participants")
    }
    /// The progress of the participant.
    pub const ME: &str = "/api/v1/participants/me";
    /// The result of the check of understanding.
    pub const COMPREHENSION: &str = "/api/v1/participants/me/comprehension";
    /// The answers to the questions after the last scene.
    pub const ANSWERS: &str = "/api/v1/participants/me/answers";
    /// The end of a participation.
    pub const COMPLETE: &str = "/api/v1/participants/me/complete";
    /// A trial's upload.
    #[must_use]
    pub fn my_trial(trial_id: &str) -> String {
        format!("/api/v1/participants/me/trials/{trial_id}")
    }
    /// The bytes of a value function.
    #[must_use]
    pub fn value_function(id: &str) -> String {
        format!("/api/v1/value-functions/{id}")
    }
    /// Signing in and out of the laboratory.
    pub const SESSION: &str = "/api/v1/admin/session";
    /// All studies.
    pub const ADMIN_STUDIES: &str = "/api/v1/admin/studies";
    /// The participants of a study, without the query that names the format.
    #[must_use]
    pub fn admin_participants(slug: &str) -> String {
        format!("/api/v1/admin/studies/{slug}/participants")
    }
    /// The pilots of a study; a DELETE deletes them.
    #[must_use]
    pub fn admin_pilots(slug: &str) -> String {
        format!("/api/v1/admin/studies/{slug}/pilots")
    }
    /// The stored trials of a study, newest first.
    #[must_use]
    pub fn admin_trials(slug: &str) -> String {
        format!("/api/v1/admin/studies/{slug}/trials")
    }
    /// One stored trial, whole.
    #[must_use]
    pub fn admin_trial(trial_id: &str) -> String {
        format!("/api/v1/admin/trials/{trial_id}")
    }
    /// The predictor trained on this participant's trials before this one.
    #[must_use]
    pub fn admin_predictor(trial_id: &str) -> String {
        format!("/api/v1/admin/trials/{trial_id}/predictor")
    }
    /// The analyses of a study, newest first; a POST requests a new one.
    #[must_use]
    pub fn admin_analyses(slug: &str) -> String {
        format!("/api/v1/admin/studies/{slug}/analyses")
    }
    /// One analysis.
    #[must_use]
    pub fn admin_analysis(id: &str) -> String {
        format!("/api/v1/admin/analyses/{id}")
    }
    /// Cancels an analysis.
    #[must_use]
    pub fn cancel_analysis(id: &str) -> String {
        format!("/api/v1/admin/analyses/{id}/cancel")
    }
    /// One file of an analysis.
    #[must_use]
    pub fn analysis_file(id: &str, name: &str) -> String {
        format!("/api/v1/admin/analyses/{id}/files/{name}")
    }
    /// The server's own simulation fingerprint.
    pub const SELF_CHECK: &str = "/api/v1/admin/self-check";
    /// A study's trials as a file, without the query that names the format.
    #[must_use]
    pub fn exports(slug: &str) -> String {
        format!("/api/v1/admin/studies/{slug}/export")
    }
    /// A study's trials as a CSV file.
    #[must_use]
    pub fn export(slug: &str) -> String {
        format!("{}?format=csv", exports(slug))
    }
}

/// Body of every error answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    /// A stable word for programs.
    pub code: String,
    /// A sentence for people.
    pub message: String,
    /// The field that the complaint is about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
}

/// What a participant needs to know of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StudyInfo {
    /// See [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name in addresses.
    pub slug: String,
    /// Name shown to people.
    pub title: String,
    /// Vehicles, danger radius and clock.
    pub parameters: SceneParameters,
    /// What will be driven.
    pub phases: Vec<PhaseConfig>,
    /// Whether somebody new can take part.
    pub admission: Admission,
    /// The course of every trial.
    pub trials: TrialSettings,
    /// After this many attempts at the check of understanding with a wrong answer, the participation
    /// ends; 0: never.
    pub comprehension_attempts: usize,
    /// Parameters of the address that may hold the person's external id.
    pub external_id_parameters: Vec<String>,
    /// Parameters of the address that are stored with the participant.
    pub recorded_parameters: Vec<String>,
}

impl StudyInfo {
    /// What a participant needs to know of a study.
    #[must_use]
    pub fn of(study: &StudyConfig, admission: Admission) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            slug: study.slug.clone(),
            title: study.title.clone(),
            parameters: study.parameters,
            phases: study.phases.clone(),
            admission,
            trials: study.trials,
            comprehension_attempts: study.comprehension.attempts,
            external_id_parameters: study.recruitment.external_id.clone(),
            recorded_parameters: study.recruitment.record.clone(),
        }
    }
}

/// Whether somebody new can take part in a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Admission {
    /// Yes.
    Open,
    /// No: as many people take part as were wanted.
    Full,
    /// No: the study is closed; participants who have begun can finish.
    Closed,
    /// No: the study is over for everybody.
    Archived,
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

/// All that a participant reads, in one language.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Texts {
    /// Tag of the language, such as `de`.
    pub language: String,
    /// The languages to choose from.
    pub offered: Vec<Language>,
    /// The sentences of the page by key, such as `welcome.lead`. `{name}` is filled in by the page.
    pub sentences: BTreeMap<String, String>,
    /// The researcher's consent text, as HTML without scripts; absent if the study has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub consent: Option<String>,
    /// Facts about the study by key (`investigator`, `institution`, `contact`, `ethics`, `retention`);
    /// only those that the researcher gave.
    pub facts: Vec<(String, String)>,
    /// The check of understanding; empty: there is none.
    pub check: Vec<CheckForm>,
    /// The questions after the last scene.
    pub questions: Vec<QuestionForm>,
    /// What the study was about, as HTML without scripts; absent if the study has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub debrief: Option<String>,
}

/// A language to choose.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Language {
    /// Its tag, such as `de`.
    pub tag: String,
    /// Its own name, such as `Deutsch`.
    pub name: String,
}

/// A question with one right answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CheckForm {
    /// The question; `{name}` is filled in by the page as in sentences.
    pub text: String,
    /// The answers.
    pub options: Vec<String>,
    /// Place of the right answer, from 0.
    pub answer: usize,
}

/// A question after the last scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QuestionForm {
    /// Name of the answer.
    pub name: String,
    /// What an answer is.
    pub kind: QuestionKind,
    /// The question.
    pub text: String,
    /// Whether it must be answered.
    pub required: bool,
    /// Values and texts of a choice's options.
    pub options: Vec<(String, String)>,
    /// Lowest and highest number of a scale.
    pub range: (i64, i64),
    /// What the lowest and highest number mean.
    pub ends: (String, String),
    /// Longest text, characters.
    pub max_chars: usize,
}

/// Body of the result of the check of understanding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComprehensionResult {
    /// How often the participant answered all questions.
    pub attempts: usize,
    /// Whether all answers of the last attempt were right.
    pub passed: bool,
}

/// Answer to the result of the check of understanding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ComprehensionStored {
    /// The participation has ended: the answers were wrong too often.
    pub screened_out: bool,
    /// Where to go, if it has ended and the study names an address.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

/// Body of the answers to the questions after the last scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answers {
    /// By the question's name: a string for a text, an option's value for a choice, a whole number for
    /// a scale. Questions that were not answered are absent.
    pub answers: BTreeMap<String, serde_json::Value>,
}

/// Answer to a withdrawal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Withdrawn {
    /// Where to go, if the study names an address.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

/// Body of an enrolment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Enrolment {
    /// The participant agreed to take part; must be true.
    pub consent: bool,
    /// Who this is at the recruiting service; the same id resumes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub external_id: Option<String>,
    /// A secret name that the client draws for this enrolment, such as a random UUID: sent again
    /// after a lost answer, it is the same participant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request_id: Option<String>,
    /// Parameters of the address that the study stores, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, String>,
    /// A pilot: kept apart from the data, without completion code and return link.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub pilot: bool,
    /// Language in which the participant read the consent text, such as `en` or `zh-CN`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub locale: Option<String>,
    /// Facts about the screen: any small object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub screen: Option<serde_json::Map<String, serde_json::Value>>,
}

impl Enrolment {
    /// Accepts an enrolment with consent and sensible texts.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        if !self.consent {
            return Err(Invalid::new("consent", "true", "false"));
        }
        if let Some(id) = &self.external_id {
            normalised_id("external_id", id)?;
        }
        if let Some(locale) = &self.locale {
            check_name("locale", locale)?;
        }
        if self.parameters.len() > MAX_PARAMETERS {
            let expected = format!("at most {MAX_PARAMETERS} parameters");
            return Err(Invalid::new("parameters", expected, self.parameters.len()));
        }
        for (name, value) in &self.parameters {
            check_name("parameters", name)?;
            check_name(&format!("parameters.{name}"), value)?;
        }
        if let Some(id) = &self.request_id {
            check_name("request_id", id)?;
            if id.len() < MIN_REQUEST_ID_BYTES {
                let expected = format!("{MIN_REQUEST_ID_BYTES} bytes or more that nobody guesses");
                return Err(Invalid::new("request_id", expected, format!("{} bytes", id.len())));
            }
        }
        self.screen.as_ref().map_or(Ok(()), |screen| check_object("screen", screen))
    }
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

fn check_object(
    field: &str,
    object: &serde_json::Map<String, serde_json::Value>,
) -> Result<(), Invalid> {
    let bytes = serde_json::to_string(object).map_or(usize::MAX, |text| text.len());
    if bytes <= MAX_OBJECT_BYTES {
        Ok(())
    } else {
        let expected = format!("an object of at most {MAX_OBJECT_BYTES} bytes of JSON");
        Err(Invalid::new(field, expected, format!("{bytes} bytes")))
    }
}

/// Answer to an enrolment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Enrolled {
    /// Who the participant is here.
    pub participant_id: String,
    /// Bearer token for everything that follows.
    pub token: String,
    /// What to drive.
    pub plan: Plan,
}

/// What a participant drives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// In order.
    pub phases: Vec<PlannedPhase>,
}

impl Plan {
    /// Every scene in the order of driving, with its phase.
    pub fn scenes(&self) -> impl Iterator<Item = (&PlannedPhase, &PlannedScene)> {
        self.phases.iter().flat_map(|phase| phase.scenes.iter().map(move |scene| (phase, scene)))
    }
}

/// One phase of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedPhase {
    /// Which phase.
    pub phase: Phase,
    /// Whether the danger zone is drawn around the robot.
    pub show_danger_zone: bool,
    /// In order.
    pub scenes: Vec<PlannedScene>,
}

/// One scene of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlannedScene {
    /// The id under which its trial is stored.
    pub trial_id: String,
    /// Place within its phase, from 0.
    pub index: usize,
    /// 1; 2 if the scene is driven again because its first trial was interrupted.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    pub attempt: u32,
    /// The human's vehicle at the start.
    pub human: Pose,
    /// The robot at the start.
    pub robot: Pose,
    /// The robot's goal, m.
    pub goal: [f64; 2],
}

fn first() -> u32 {
    1
}

// serde passes a reference.
#[expect(clippy::trivially_copy_pass_by_ref)]
fn is_first(count: &u32) -> bool {
    *count == 1
}

impl PlannedScene {
    /// Both vehicles and the goal.
    #[must_use]
    pub fn scene(&self) -> Scene {
        Scene { human: self.human, robot: self.robot, goal: self.goal }
    }
}

/// The progress of a participant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Who the participant is here.
    pub participant_id: String,
    /// The study's name in addresses.
    pub study: String,
    /// What to drive.
    pub plan: Plan,
    /// Ids of the trials that are safely stored, in the plan's order.
    pub stored: Vec<String>,
    /// The trial that comes next; absent when all are stored.
    pub next: Option<String>,
    /// The code, once the participation is complete.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completion_code: Option<String>,
    /// Where to go with the code, if the study names an address.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
    /// Whether the participation is complete. The code is absent although it is if this token was given
    /// to somebody who knew only the external id.
    #[serde(default)]
    pub complete: bool,
    /// Whether the check of understanding was passed.
    #[serde(default)]
    pub understood: bool,
    /// How often the check of understanding was answered.
    #[serde(default)]
    pub comprehension_attempts: usize,
    /// Whether the questions after the last scene were answered.
    #[serde(default)]
    pub answered: bool,
    /// Whether this is a pilot.
    #[serde(default)]
    pub pilot: bool,
    /// Whether this token may withdraw the participation: one that was given to somebody who knew only
    /// the external id may not.
    #[serde(default)]
    pub may_withdraw: bool,
}

/// A key that went down or up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyEvent {
    /// Time after the scene's start, ms; negative for keys that were already held.
    pub t_ms: f64,
    /// The key's name, such as `ArrowLeft`; `blur` when the window lost its keys.
    pub key: String,
    /// Down or up.
    pub down: bool,
}

/// Body of a trial's upload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialUpload {
    /// Start of the scene by the participant's clock, ms since 1970.
    pub started_at_ms: f64,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// The states as shown: before each step, and after the last.
    pub states: Vec<JointState>,
    /// When each input was actually sampled, ms after the scene's start.
    pub sampled_at_ms: Vec<f64>,
    /// Key events, in order of time.
    pub key_events: Vec<KeyEvent>,
    /// What happened to the page during the scene, in order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub page_events: Vec<PageEvent>,
    /// How often the scene was shown to the participant, this time included.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    pub exposures: u32,
    /// Facts about the display: any small object.
    pub display: serde_json::Map<String, serde_json::Value>,
}

impl TrialUpload {
    /// Accepts a body that can be a trial of this study. [`flags`](crate::trial::flags) says
    /// whether it replays.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self, parameters: &SceneParameters) -> Result<(), Invalid> {
        const LAST_MS: f64 = 4_102_444_800_000.0; // the year 2100
        if !(0.0..=LAST_MS).contains(&self.started_at_ms) {
            let expected = "milliseconds since 1970, before 2100";
            return Err(Invalid::new("started_at_ms", expected, self.started_at_ms));
        }
        length("inputs", parameters.steps, self.inputs.len())?;
        length("states", parameters.steps + 1, self.states.len())?;
        for (i, state) in self.states.iter().enumerate() {
            state.check().map_err(|e| e.within(&format!("states[{i}]")))?;
        }
        length("sampled_at_ms", parameters.steps, self.sampled_at_ms.len())?;
        check_rising("sampled_at_ms", self.sampled_at_ms.iter().copied())?;
        if self.key_events.len() > MAX_KEY_EVENTS {
            let expected = format!("at most {MAX_KEY_EVENTS} entries");
            return Err(Invalid::new("key_events", expected, self.key_events.len()));
        }
        check_rising("key_events.t_ms", self.key_events.iter().map(|event| event.t_ms))?;
        for (i, event) in self.key_events.iter().enumerate() {
            check_name(&format!("key_events[{i}].key"), &event.key)?;
        }
        if self.page_events.len() > MAX_PAGE_EVENTS {
            let expected = format!("at most {MAX_PAGE_EVENTS} entries");
            return Err(Invalid::new("page_events", expected, self.page_events.len()));
        }
        check_rising("page_events.t_ms", self.page_events.iter().map(|event| event.t_ms))?;
        if !(1..=10_000).contains(&self.exposures) {
            let expected = "a whole number from 1 to 10000";
            return Err(Invalid::new("exposures", expected, self.exposures));
        }
        check_object("display", &self.display)
    }
}

/// Accepts finite times that never decrease.
fn check_rising(field: &str, times: impl Iterator<Item = f64>) -> Result<(), Invalid> {
    let mut last = f64::NEG_INFINITY;
    for (i, time) in times.enumerate() {
        finite(&format!("{field}[{i}]"), time)?;
        if time < last {
            return Err(Invalid::new(format!("{field}[{i}]"), format!("a time ≥ {last}"), time));
        }
        last = time;
    }
    Ok(())
}

/// Answer to a trial's upload.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialStored {
    /// The trial.
    pub trial_id: String,
    /// The trial that comes next; absent after the last.
    pub next: Option<String>,
}

/// Answer to a completion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Completed {
    /// Proof that every trial is stored.
    pub completion_code: String,
    /// Where to go with the code, if the study names an address.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

/// Body of a sign-in to the laboratory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SignIn {
    /// The experimenter's key.
    pub key: String,
}

/// Answer to a sign-in, and to a check of the session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Session {
    /// Always true: without a session the answer is 401.
    pub signed_in: bool,
}

/// A study in the laboratory's list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StudySummary {
    /// Name in addresses.
    pub slug: String,
    /// Name shown to people.
    pub title: String,
    /// People who enrolled.
    pub participants: u64,
    /// Trials stored.
    pub trials: u64,
}

/// Answer to the deletion of a study's pilots.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PilotsDeleted {
    /// How many there were.
    pub deleted: usize,
}

/// A page of stored trials, newest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialPage {
    /// The trials of this page.
    pub trials: Vec<TrialSummary>,
    /// Pass as `before` for the next page; absent on the last.
    pub next_before: Option<i64>,
}

/// A stored trial in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialSummary {
    /// The trial.
    pub trial_id: String,
    /// Who drove it.
    pub participant_id: String,
    /// The participant's number within the study, from 1.
    pub participant_number: i64,
    /// Its phase.
    pub phase: Phase,
    /// Place within its phase, from 0.
    pub index: usize,
    /// When the server stored it, ms since 1970.
    pub received_at_ms: i64,
    /// Its outcome.
    pub outcome: Outcome,
    /// What an analyst should know.
    pub flags: Vec<Flag>,
}

/// A stored trial, whole.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrialDetail {
    /// As in the list.
    #[serde(flatten)]
    pub summary: TrialSummary,
    /// The study's name in addresses.
    pub study: String,
    /// Vehicles, danger radius and clock of the trial. They define the two games
    /// ([`SceneParameters::game`]) that a browser solves if the server has no id below.
    pub parameters: SceneParameters,
    /// The scene that was driven.
    pub scene: Scene,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// Before each step, and after the last.
    pub states: Vec<JointState>,
    /// The differences between the states and the replay of the inputs.
    pub replay: Replay,
    /// Id of the value function V_HR; null while the server has none.
    pub value_function_hr: Option<String>,
    /// Id of the value function V_RH; null while the server has none.
    pub value_function_rh: Option<String>,
}

impl TrialDetail {
    /// Id of the value function of `evader`; none while the server has none.
    #[must_use]
    pub fn value_function(&self, evader: Evader) -> Option<&str> {
        match evader {
            Evader::Human => self.value_function_hr.as_deref(),
            Evader::Robot => self.value_function_rh.as_deref(),
        }
    }
}

/// A predictor and how it was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainedPredictor {
    /// The predictor, as in a `predictor.json`.
    pub predictor: PredictorFile,
    /// The number of trials that it was trained on.
    pub trials: usize,
    /// Why it is not the learned model; none if it is.
    pub fallback: Option<String>,
}

/// The fingerprint of a computer's simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SelfCheck {
    /// Seed of the random trials.
    pub seed: u64,
    /// How many.
    pub trials: usize,
    /// SHA-256 of all their states.
    pub fingerprint: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_external_id_is_more_than_white_space() {
        let check = |id: &str| {
            let body = serde_json::json!({ "consent": true, "external_id": id });
            serde_json::from_value::<Enrolment>(body).unwrap().check()
        };
        for id in ["   ", "\u{a0}", "\u{3000}\u{2003}"] {
            let said = check(id).unwrap_err().to_string();
            assert!(said.starts_with("external_id: expected 1 to 128 characters"), "{said}");
        }
        assert_eq!(check(" P 17 "), Ok(()));
    }
}
