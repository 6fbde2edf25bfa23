//! Playback of a trial, and filming of the playback.

use super::{CANVAS, Msg, Replay};
use crate::runtime::{Command, Commands, Offer};
use std::rc::Rc;

/// Times of playback, on the page's clock.
#[derive(Clone, Copy)]
pub(super) struct Playing {
    /// The time up to which the playback has advanced (ms).
    pub(super) until_ms: f64,
    /// The time of the last update of the numbers (ms).
    pub(super) shown_ms: f64,
}

/// Interval between two updates of the numbers (ms). Faster changes would be unreadable.
const NUMBERS_EVERY_MS: f64 = 60.0;

/// The name of the film.
pub(super) const FILM: &str = "film";

impl Replay {
    pub(super) fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    pub(super) fn play_or_pause(&mut self, now_ms: f64) {
        if self.playing.take().is_none() {
            if self.view.time_s >= self.playback.duration_s() {
                self.view.time_s = 0.0;
            }
            self.playing = Some(Playing { until_ms: now_ms, shown_ms: now_ms });
        }
    }

    /// Moves by this many steps. From a time within a step, the first step back leads to the start
    /// of that step.
    pub(super) fn step(&mut self, by: i32) {
        let (step_s, now) = (self.trial.parameters.step_s, self.playback.now());
        let is_between = now.time_s > (now.step as f64 + 1e-6) * step_s;
        let from = now.step as i32 + i32::from(is_between && by < 0);
        let last = self.trial.inputs.len() as i32;
        self.view.time_s = f64::from((from + by).clamp(0, last)) * step_s;
    }

    /// Continues playback to `now_ms`. Returns a message when the numbers must be updated.
    pub(super) fn play_to(&mut self, now_ms: f64) -> Option<Msg> {
        let playing = self.playing.as_mut()?;
        let seconds = (now_ms - playing.until_ms).max(0.0) / 1000.0;
        playing.until_ms = now_ms;
        let is_due = now_ms - playing.shown_ms >= NUMBERS_EVERY_MS;
        if is_due {
            playing.shown_ms = now_ms;
        }
        let end_s = self.playback.duration_s();
        self.view.time_s = (self.view.time_s + self.view.speed * seconds).min(end_s);
        if self.view.time_s >= end_s {
            self.playing = None;
            return Some(Msg::Frame);
        }
        if is_due {
            return Some(Msg::Frame);
        }
        self.show();
        None
    }

    /// Films the playback from the current time to the end or to the next pause.
    pub(super) fn film(&mut self, now_ms: f64) -> Commands<Msg> {
        self.playing = None;
        self.play_or_pause(now_ms);
        (self.filming, self.unfilmed) = (true, None);
        let file = self.file_name("webm");
        vec![Command::offer(Offer::Film {
            name: FILM,
            canvas: CANVAS,
            file,
            then: Rc::new(Msg::Filmed),
        })]
    }
}
