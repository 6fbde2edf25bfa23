//! Where a participant is, and what the page knows of the plan.

use super::arena::Arena;
use super::equipment::Equipment;
use crate::drive::Drive;
use serde::{Deserialize, Serialize};
use sidestep::api::PlannedScene;
use sidestep::scene::JointState;
use sidestep::trial::{Outcome, Phase};

/// Who the participant is; kept in the browser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Session {
    pub(super) participant_id: String,
    pub(super) token: String,
}

/// A trial of the plan, with what its phase says.
#[derive(Clone, Debug)]
pub(super) struct PlannedTrial {
    pub(super) phase: Phase,
    pub(super) show_danger_zone: bool,
    pub(super) feedback: bool,
    /// How many scenes its phase has.
    pub(super) of_phase: usize,
    pub(super) scene: PlannedScene,
}

impl PlannedTrial {
    pub(super) fn id(&self) -> &str {
        &self.scene.trial_id
    }
}

/// A check of understanding that was answered.
#[derive(Clone, Debug, Default)]
pub(super) struct Quiz {
    pub(super) attempts: usize,
    /// The chosen answers.
    pub(super) chosen: Vec<Option<usize>>,
    pub(super) is_incomplete: bool,
    /// The number of attempts when these questions came.
    pub(super) drawn_at: usize,
    /// Whether all answers of the last attempt were right.
    pub(super) is_passed: bool,
    /// Whether right and wrong answers are marked as such.
    pub(super) is_marked: bool,
}

/// How long the last picture of a scene stays.
#[derive(Clone, Copy)]
pub(super) struct Stay {
    /// How long it stays from when the browser draws it, ms.
    pub(super) drawn_for_ms: f64,
    /// Whether the browser has drawn it.
    pub(super) is_drawn: bool,
    /// When the page goes on, ms.
    pub(super) until_ms: f64,
}

/// Where the participant is.
#[derive(Default)]
pub(super) enum Stage {
    #[default]
    Loading,
    /// Nothing can be done here: the key of the heading, and the reason.
    Stuck(&'static str, String),
    /// A device that seems to have no keyboard.
    Touch,
    Welcome,
    Equipment(Box<Equipment>),
    Instructions(Box<Arena>),
    Comprehension(Quiz),
    /// Before a scene.
    Ready,
    /// Between scenes.
    Rest,
    /// A scene stands still until this time, ms. The keys must be up before it moves.
    Countdown(Box<PlannedTrial>, f64, u32),
    Driving(Box<PlannedTrial>, Box<Drive>),
    /// The last picture of a scene stays.
    Over(Box<PlannedTrial>, JointState, Stay, Outcome),
    /// The questions after the last scene; the places of those whose required answer is missing.
    Questions(Vec<usize>),
    /// All scenes are driven; the last trials are being uploaded.
    Finishing,
    Done(Option<String>, Option<String>),
    /// The participation has ended before its end: keys of heading and reason, and where to go.
    Ended(&'static str, &'static str, Option<String>),
    /// Another tab has taken over.
    Elsewhere,
}
