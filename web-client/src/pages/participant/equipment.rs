//! The check of keyboard and screen before enrolment.

use crate::input::{KeyMap, can_steer};
use serde::{Deserialize, Serialize};
use sidestep::vehicle::TurnInput;

/// The steering keys, and the labels printed on them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Steering {
    pub(super) keys: KeyMap,
    pub(super) left: String,
    pub(super) right: String,
}

impl Default for Steering {
    fn default() -> Self {
        Self { keys: KeyMap::default(), left: "←".to_owned(), right: "→".to_owned() }
    }
}

/// Results of the check so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Equipment {
    /// Whether the left key and the right key have been pressed.
    pub(super) left: bool,
    pub(super) right: bool,
    /// `Some` while the participant chooses keys. It contains the code and label of the left key as
    /// soon as that key is chosen.
    pub(super) choosing: Option<Option<(String, String)>>,
    /// Whether the last key pressed cannot steer.
    pub(super) refused: bool,
    /// Whether the enrolment was requested.
    pub(super) is_enrolling: bool,
    /// Times of frames on the page's clock (ms).
    frames_ms: Vec<f64>,
}

/// Number of frames to record. The first `LEFT_OUT` of them are ignored, because the page has just
/// changed.
const FRAMES: usize = 70;
const LEFT_OUT: usize = 10;

/// In a window smaller than this (CSS pixels), the vehicles appear too small.
const SMALL_PX: [f64; 2] = [600.0, 480.0];

impl Equipment {
    pub(super) fn frame(&mut self, now_ms: f64) {
        if self.is_measuring() {
            self.frames_ms.push(now_ms);
        }
    }

    pub(super) fn is_measuring(&self) -> bool {
        self.frames_ms.len() < FRAMES
    }

    /// The frame rate (Hz). `None` while it is being measured.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        if self.is_measuring() {
            return None;
        }
        let seconds = (self.frames_ms[FRAMES - 1] - self.frames_ms[LEFT_OUT]) / 1000.0;
        Some(((FRAMES - 1 - LEFT_OUT) as f64 / seconds).round())
    }

    /// Whether the window is too small to show the scenes well.
    pub(super) fn is_small(screen: &[(&'static str, f64)]) -> bool {
        let side = |name: &str| screen.iter().find(|(known, _)| *known == name).map(|(_, px)| *px);
        let names = ["window_width_px", "window_height_px"];
        names.iter().zip(SMALL_PX).any(|(name, least)| side(name).is_some_and(|px| px < least))
    }

    /// Handles a key press. When both keys are chosen, returns the new steering keys.
    pub(super) fn pressed(
        &mut self,
        steering: &Steering,
        code: &str,
        key: &str,
    ) -> Option<Steering> {
        let Some(first) = self.choosing.take() else {
            match steering.keys.turn(code) {
                Some(TurnInput::Left) => self.left = true,
                Some(TurnInput::Right) => self.right = true,
                _ => {}
            }
            return None;
        };
        let printed =
            if key.chars().count() == 1 { key.to_ascii_uppercase() } else { short(code, key) };
        let Some((left, left_printed)) = first else {
            self.refused = !can_steer(code);
            self.choosing = Some((!self.refused).then(|| (code.to_owned(), printed)));
            return None;
        };
        let Some(keys) = KeyMap::chosen(&left, code) else {
            self.refused = true;
            self.choosing = Some(Some((left, left_printed)));
            return None;
        };
        (self.left, self.right, self.refused) = (false, false, false);
        Some(Steering { keys, left: left_printed, right: printed })
    }
}

/// The label of a key that produces no single character.
fn short(code: &str, key: &str) -> String {
    let arrow = match code {
        "ArrowLeft" => "←",
        "ArrowRight" => "→",
        "ArrowUp" => "↑",
        "ArrowDown" => "↓",
        _ => key,
    };
    arrow.to_owned()
}
