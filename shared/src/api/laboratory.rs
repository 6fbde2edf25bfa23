//! Wire types of the laboratory.

use super::{first, is_first};
use crate::scene::{Evader, JointState, Scene, SceneParameters};
use crate::study::Status;
use crate::trial::{Flag, Outcome, Phase, Replay};
use crate::vehicle::TurnInput;
use serde::{Deserialize, Serialize};

/// Body of a sign-in to the laboratory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SignIn {
    /// The experimenter's key.
    pub key: String,
}

/// A study in the laboratory's list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct StudySummary {
    /// Name in URLs.
    pub slug: String,
    /// Name shown to people.
    pub title: String,
    /// Whether the study is open, closed or archived.
    pub status: Status,
    /// Whether its participants are synthetic.
    #[serde(default)]
    pub synthetic: bool,
    /// Number of people who enrolled or were imported, without pilots.
    pub participants: u64,
    /// Number of these people who have a completion code.
    pub complete: u64,
    /// Number of these people who are still taking part and for whom the server stored data in the
    /// last ten minutes.
    pub active: u64,
    /// Number of these people whose data should be checked. They steered in no task, steered in
    /// every step of every task, or have the same key times as an earlier trial, which suggests
    /// that a program drove. People who are already excluded do not count.
    pub doubtful: u64,
    /// Number of stored trials of these people.
    pub trials: u64,
    /// Number of pilots.
    pub pilots: u64,
    /// When the server last stored data of a participant (ms since 1970). Absent if it never did.
    pub last_seen_at_ms: Option<i64>,
}

/// Response to the deletion of a study's pilots.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct PilotsDeleted {
    /// Number of deleted pilots.
    pub deleted: usize,
}

/// A page of stored trials, newest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialPage {
    /// The trials of this page.
    pub trials: Vec<TrialSummary>,
    /// The value of `before` in the request for the next page. Absent on the last page.
    pub next_before: Option<i64>,
}

/// A stored trial in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialSummary {
    /// Id of the trial.
    pub trial_id: String,
    /// Id of the participant who drove it.
    pub participant_id: String,
    /// The participant's number within the study, from 1.
    pub participant_number: i64,
    /// Its phase.
    pub phase: Phase,
    /// Index within its phase, from 0.
    pub index: usize,
    /// Attempt number: 1, or 2 if the scene was driven again because its first trial was
    /// interrupted.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    pub attempt: u32,
    /// When the server stored the trial (ms since 1970).
    pub received_at_ms: i64,
    /// Its outcome.
    pub outcome: Outcome,
    /// Flags for the analyst.
    pub flags: Vec<Flag>,
}

impl TrialSummary {
    /// The scene in words, such as `task 3`, or `task 3 (attempt 2)` if it was driven again.
    #[must_use]
    pub fn scene_words(&self) -> String {
        scene_words(self.phase, self.index, self.attempt)
    }
}

/// Display name of a scene: its phase, its number in the phase (from 1) and, if it is not the first
/// attempt, the attempt. `index` counts from 0.
#[must_use]
pub fn scene_words(phase: Phase, index: usize, attempt: u32) -> String {
    let scene = format!("{} {}", phase.word(), index + 1);
    match attempt {
        1 => scene,
        attempt => format!("{scene} (attempt {attempt})"),
    }
}

/// Title of a trial on pages and in figures: the study, the participant's number, the scene in
/// words, and a mark if a program drove.
#[must_use]
pub fn trial_heading(study: &str, number: i64, scene: &str, synthetic: bool) -> String {
    let mark = if synthetic { " (synthetic)" } else { "" };
    format!("{study} / participant {number} / {scene}{mark}")
}

/// A stored trial in full.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialDetail {
    /// The fields of its list entry.
    #[serde(flatten)]
    pub summary: TrialSummary,
    /// The study's name in URLs.
    pub study: String,
    /// Whether a program drove.
    #[serde(default)]
    pub synthetic: bool,
    /// Vehicles, danger radius and clock of the trial. They define the two games
    /// ([`SceneParameters::game`]). A browser solves a game if the id of its value function is
    /// null.
    pub parameters: SceneParameters,
    /// The scene that was driven.
    pub scene: Scene,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// The states before each step and after the last step.
    pub states: Vec<JointState>,
    /// The differences between the uploaded states and a replay of the inputs.
    pub replay: Replay,
    /// Id of the value function V_HR. Null while the server has none.
    pub value_function_hr: Option<String>,
    /// Id of the value function V_RH. Null while the server has none.
    pub value_function_rh: Option<String>,
    /// Id of the participant's previous stored trial. If there is none, id of the last trial of the
    /// participant with the next lower number. Null for the first trial. Pilots have their own
    /// sequence.
    #[serde(default)]
    pub previous: Option<String>,
    /// Id of the next stored trial, chosen by the corresponding rule. Null for the last trial.
    #[serde(default)]
    pub next: Option<String>,
}

impl TrialDetail {
    /// Id of the value function of the game in which `evader` evades. `None` while the server has
    /// none.
    #[must_use]
    pub fn value_function(&self, evader: Evader) -> Option<&str> {
        match evader {
            Evader::Human => self.value_function_hr.as_deref(),
            Evader::Robot => self.value_function_rh.as_deref(),
        }
    }
}

/// The fingerprint of the simulation on one computer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct SelfCheck {
    /// Seed of the random trials.
    pub seed: u64,
    /// Number of random trials.
    pub trials: usize,
    /// SHA-256 of the states of all these trials.
    pub fingerprint: String,
}

/// State of the check of the stored data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum DataCheckState {
    /// The check has not run since the server started.
    #[default]
    Waiting,
    /// The check is running. The findings are still from the previous check.
    Running,
    /// The check is done.
    Done,
    /// The check failed, or its backup could not be written.
    Failed,
}

/// Findings of the server's last data check. The check examines the database file and replays every
/// stored trial.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct DataCheck {
    /// State of the check.
    pub state: DataCheckState,
    /// When the check ended (ms since 1970). Null before the first check.
    pub at_ms: Option<i64>,
    /// The number of trials that were replayed. Null before the first check.
    pub trials: Option<u64>,
    /// The number of faults that were found.
    pub fault_count: u64,
    /// Descriptions of the first faults.
    pub faults: Vec<String>,
    /// Why the check failed, if it did.
    pub message: Option<String>,
    /// The newest backup in the backup folder of this server.
    pub backup: Option<Backup>,
}

/// A backup that a server has written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Backup {
    /// File name, within the folder of `serve --backups`.
    pub name: String,
    /// When the backup was completed (ms since 1970).
    pub at_ms: i64,
    /// Size (bytes).
    pub bytes: u64,
}
