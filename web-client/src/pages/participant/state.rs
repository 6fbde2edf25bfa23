//! The stage that a participant has reached, and the plan of trials.

use super::arena::Arena;
use super::equipment::Equipment;
use super::robots::Unread;
use crate::drive::Drive;
use serde::{Deserialize, Serialize};
use sidestep::api::PlannedScene;
use sidestep::scene::JointState;
use sidestep::trial::{Outcome, Phase};

/// The participant's identity, stored in the browser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Session {
    pub(super) participant_id: String,
    pub(super) token: String,
}

/// A trial of the plan, with the settings of its phase.
#[derive(Clone, Debug)]
pub(super) struct PlannedTrial {
    pub(super) phase: Phase,
    pub(super) show_danger_zone: bool,
    pub(super) feedback: bool,
    /// Number of scenes in the phase, not counting repeated attempts.
    pub(super) of_phase: usize,
    pub(super) scene: PlannedScene<Unread>,
}

impl PlannedTrial {
    pub(super) fn id(&self) -> &str {
        &self.scene.trial_id
    }
}

/// The state of the comprehension check.
#[derive(Clone, Debug, Default)]
pub(super) struct Quiz {
    pub(super) attempts: usize,
    /// The chosen answer to each question.
    pub(super) chosen: Vec<Option<usize>>,
    pub(super) is_incomplete: bool,
    /// Number of attempts made before these questions were drawn.
    pub(super) drawn_at: usize,
    /// Whether all answers of the last attempt were correct.
    pub(super) is_passed: bool,
    /// Whether answers are marked as right or wrong.
    pub(super) is_marked: bool,
}

/// How long the last picture of a scene is shown.
#[derive(Clone, Copy)]
pub(super) struct Stay {
    /// How long the picture is shown (ms), counted from when the browser draws it.
    pub(super) drawn_for_ms: f64,
    /// Whether the browser has drawn the picture.
    pub(super) is_drawn: bool,
    /// The time at which the page continues (ms).
    pub(super) until_ms: f64,
}

/// The stage that a participant has reached.
#[derive(Default)]
pub(super) enum Stage {
    #[default]
    Loading,
    /// The participant cannot continue. Contains the key of the title, and the reason.
    Stuck(&'static str, String),
    /// The device seems to have no keyboard.
    Touch,
    Welcome,
    Equipment(Box<Equipment>),
    Instructions(Box<Arena>),
    Comprehension(Quiz),
    /// Waiting for the participant to start a scene.
    Ready,
    /// A rest between two scenes.
    Rest,
    /// The scene stands still until this time (ms). The last field is the number of seconds left.
    /// The keys must be released before the scene starts.
    Countdown(Box<PlannedTrial>, f64, u32),
    Driving(Box<PlannedTrial>, Box<Drive>),
    /// The last picture of a scene is shown.
    Over(Box<PlannedTrial>, JointState, Stay, Outcome),
    /// The questions after the last scene, with the indices of the required questions that are
    /// still unanswered.
    Questions(Vec<usize>),
    /// All scenes are driven, and the last trials are being uploaded.
    Finishing,
    Done(Option<String>, Option<String>),
    /// The participation has ended early. Contains the keys of the title and of the reason, and a
    /// link to follow.
    Ended(&'static str, &'static str, Option<String>),
    /// Another tab has taken over the participation.
    Elsewhere,
}
