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
    /// Whether it accepts participants.
    pub status: Status,
    /// Whether its participants are synthetic.
    #[serde(default)]
    pub synthetic: bool,
    /// People who enrolled or were imported, without pilots.
    pub participants: u64,
    /// Of these, those with a completion code.
    pub complete: u64,
    /// Of these, those under way for whom the server stored something in the last ten minutes.
    pub active: u64,
    /// Of these, those whose data should be checked: they steered in no task or in every step of each,
    /// or their key times repeat those of an earlier trial, as if a program had driven. Without those
    /// already excluded.
    pub doubtful: u64,
    /// Their stored trials.
    pub trials: u64,
    /// Pilots.
    pub pilots: u64,
    /// When data of a participant were last stored, ms since 1970; absent if never.
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
    /// Pass as `before` for the next page; absent on the last.
    pub next_before: Option<i64>,
}

/// A stored trial in a list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialSummary {
    /// The trial.
    pub trial_id: String,
    /// The participant who drove it.
    pub participant_id: String,
    /// The participant's number within the study, from 1.
    pub participant_number: i64,
    /// Its phase.
    pub phase: Phase,
    /// Index within its phase, from 0.
    pub index: usize,
    /// 1; 2 if the scene was driven again because its first trial was interrupted.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    pub attempt: u32,
    /// When the server stored it, ms since 1970.
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

/// Display name of a scene: its phase, its number in the phase from 1, and the attempt, if it is not the
/// first. `index` counts from 0.
#[must_use]
pub fn scene_words(phase: Phase, index: usize, attempt: u32) -> String {
    let scene = format!("{} {}", phase.word(), index + 1);
    match attempt {
        1 => scene,
        attempt => format!("{scene} (attempt {attempt})"),
    }
}

/// Heading of a trial on pages and in figures: its study, the participant's number, the scene in words, and
/// whether a program drove.
#[must_use]
pub fn trial_heading(study: &str, number: i64, scene: &str, synthetic: bool) -> String {
    let mark = if synthetic { " (synthetic)" } else { "" };
    format!("{study} / participant {number} / {scene}{mark}")
}

/// A stored trial in full.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct TrialDetail {
    /// As in the list.
    #[serde(flatten)]
    pub summary: TrialSummary,
    /// The study's name in URLs.
    pub study: String,
    /// Whether a program drove.
    #[serde(default)]
    pub synthetic: bool,
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
    /// The previous stored trial: of the same participant, otherwise the last one of the participant with
    /// the next lower number; null for the first. Pilots have their own sequence.
    #[serde(default)]
    pub previous: Option<String>,
    /// The next stored trial, likewise; null for the last.
    #[serde(default)]
    pub next: Option<String>,
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

/// The fingerprint of a computer's simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct SelfCheck {
    /// Seed of the random trials.
    pub seed: u64,
    /// Number of random trials.
    pub trials: usize,
    /// SHA-256 of all their states.
    pub fingerprint: String,
}

/// State of the check of the stored data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum DataCheckState {
    /// Not yet run since the server started.
    #[default]
    Waiting,
    /// It is running; the previous findings remain.
    Running,
    /// It is done.
    Done,
    /// It failed, or its backup could not be written.
    Failed,
}

/// Findings of the server's last data check: of the database file, and of every stored trial by replaying it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct DataCheck {
    /// State of the check.
    pub state: DataCheckState,
    /// When it ended, ms since 1970; null before the first.
    pub at_ms: Option<i64>,
    /// The number of trials that were replayed; null before the first check.
    pub trials: Option<u64>,
    /// The number of faults that were found.
    pub fault_count: u64,
    /// Descriptions of the first faults.
    pub faults: Vec<String>,
    /// Why it failed, if it did.
    pub message: Option<String>,
    /// The newest backup in the folder of this server.
    pub backup: Option<Backup>,
}

/// A backup that a server has written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Backup {
    /// The name of its file, in the folder of `serve --backups`.
    pub name: String,
    /// When it was completed, ms since 1970.
    pub at_ms: i64,
    /// Size, bytes.
    pub bytes: u64,
}
