//! Moves the participant from one scene to the next.

use super::arena::Arena;
use super::equipment::Steering;
use super::state::{PlannedTrial, Stage, Stay};
use super::{Msg, Participant, STEERING, lifted};
use crate::drive::{Drive, straight};
use crate::input::{BLUR, HeldKeys};
use crate::json;
use crate::runtime::{Command, Commands, Event};
use sidestep::trial::{Flag, Phase, outcome, page_flags};

/// Extra time that the page waits if the browser does not draw the last picture of a scene (ms). A
/// frozen browser might never draw this picture.
const UNDRAWN_MS: f64 = 3000.0;

/// If the page notices the end of a countdown later than this (ms), the participant must start the
/// countdown again.
const ASLEEP_MS: f64 = 1000.0;

impl Participant {
    pub(super) fn exposure_name(&self, trial_id: &str) -> String {
        let id = self.session.as_ref().map_or("", |session| &session.participant_id);
        format!("sidestep.exposures.{id}.{trial_id}")
    }

    pub(super) fn show_instructions(&mut self) {
        let parameters = self.study.as_ref().map(|study| study.parameters).unwrap_or_default();
        self.stage = Stage::Instructions(Box::new(Arena::new(parameters)));
    }

    /// The next trial to drive, which is the first one that is neither stored nor in the outbox.
    pub(super) fn next(&self) -> Option<&PlannedTrial> {
        self.plan.iter().find(|trial| !self.is_driven(trial))
    }

    pub(super) fn is_driven(&self, trial: &PlannedTrial) -> bool {
        self.is_stored(trial) || self.outbox.holds(trial.id())
    }

    /// Whether the scene has begun to move in this browser.
    pub(super) fn has_begun(&self, trial: &PlannedTrial) -> bool {
        self.exposures.iter().any(|(id, _)| id == trial.id())
    }

    pub(super) fn is_stored(&self, trial: &PlannedTrial) -> bool {
        self.stored.iter().any(|id| id == trial.id())
    }

    /// Uploads the queue. When all scenes are driven, asks the questions. When everything is
    /// stored, requests the completion code.
    pub(super) fn go_on(&mut self) -> Commands<Msg> {
        let awaited = self.plan.iter().find(|trial| !self.is_stored(trial)).map(PlannedTrial::id);
        let mut commands: Vec<_> = lifted(self.outbox.send(awaited)).collect();
        if self.next().is_some() && matches!(self.stage, Stage::Finishing) {
            // The server has planned another attempt, or it lacks a trial.
            self.stage = Stage::Ready;
        }
        let between = matches!(self.stage, Stage::Ready | Stage::Rest | Stage::Finishing);
        if self.plan.is_empty() || self.next().is_some() || !between {
            return commands;
        }
        let repeats = self.study.as_ref().is_some_and(|study| study.trials.repeat_interrupted);
        let waits = repeats && (!self.outbox.is_empty() || self.plan_known_at < self.stored.len());
        let answered = self.progress.as_ref().is_none_or(|progress| progress.answered)
            || self.texts.questions.is_empty();
        self.stage = match answered || waits {
            true => Stage::Finishing,
            false => Stage::Questions(Vec::new()),
        };
        if self.outbox.is_empty() {
            if waits {
                // The server may have planned further attempts, so request the plan.
                commands.push(self.ask_progress());
            } else if answered {
                commands.push(self.ask_code());
            }
        }
        commands
    }

    /// Starts the countdown of the next scene, unless a key is held.
    pub(super) fn start(&mut self) -> Commands<Msg> {
        let (Stage::Ready, Some(next)) = (&self.stage, self.next()) else { return Vec::new() };
        if !self.held.is_empty() {
            self.hint = Some("ready.release");
            return Vec::new();
        }
        let trial = Box::new(next.clone());
        let trials = self.study.as_ref().map(|study| study.trials).unwrap_or_default();
        let ends_ms = self.now_ms + f64::from(trials.countdown_s) * 1000.0;
        self.stage = Stage::Countdown(trial, ends_ms, trials.countdown_s);
        (self.trouble, self.hint) = (None, None);
        // Ask only once, because a participant who has left the full screen has declined it.
        if trials.fullscreen && !std::mem::replace(&mut self.was_fullscreen, true) {
            return vec![Command::Fullscreen(true)];
        }
        Vec::new()
    }

    /// Handles whatever is due at the current time, except for mere changes of the picture.
    pub(super) fn clock(&mut self) -> Commands<Msg> {
        match std::mem::take(&mut self.stage) {
            Stage::Countdown(trial, ends_ms, _) if self.now_ms < ends_ms => {
                let left_s = ((ends_ms - self.now_ms) / 1000.0).ceil() as u32;
                self.stage = Stage::Countdown(trial, ends_ms, left_s);
                Vec::new()
            }
            // The computer has slept or the page was frozen, so the participant has not seen the
            // countdown.
            Stage::Countdown(_, start_ms, _) if self.now_ms > start_ms + ASLEEP_MS => {
                self.not_begun();
                Vec::new()
            }
            Stage::Countdown(trial, start_ms, _) => self.moves(trial, start_ms),
            Stage::Driving(trial, drive) => self.scene_over(trial, *drive),
            Stage::Over(trial, ..) => self.after(&trial),
            other => {
                self.stage = other;
                Vec::new()
            }
        }
    }

    /// Stops the countdown. The participant must start the scene again.
    fn not_begun(&mut self) {
        self.stage = Stage::Ready;
        self.hint = Some("ready.not_begun");
    }

    /// Ends the countdown and starts the scene.
    pub(super) fn moves(&mut self, trial: Box<PlannedTrial>, start_ms: f64) -> Commands<Msg> {
        let parameters = self.study.as_ref().map(|study| study.parameters).unwrap_or_default();
        let started_at_ms = self.context.time_origin_ms + start_ms;
        let (scene, keys) = (trial.scene.straight_scene(), &self.steering.keys);
        let robot = self.rules.as_ref().and_then(|rules| rules.robot(trial.id(), parameters));
        let (robot, held) = (robot.unwrap_or_else(straight), &self.held);
        let mut drive = Drive::new(parameters, &scene, robot, start_ms, started_at_ms, keys, held);
        drive.tick(self.now_ms);
        // Store the exposure first, so that it counts even if the page is reloaded.
        let count = match self.exposures.iter_mut().find(|(id, _)| id == trial.id()) {
            Some((_, count)) => {
                *count += 1;
                *count
            }
            None => {
                self.exposures.push((trial.id().to_owned(), 1));
                1
            }
        };
        let text = count.to_string();
        let name = self.exposure_name(trial.id());
        self.stage = Stage::Driving(trial, Box::new(drive));
        vec![Command::Keep { name, text, then: Box::new(|_| Msg::Noted) }]
    }

    pub(super) fn scene_over(&mut self, trial: Box<PlannedTrial>, drive: Drive) -> Commands<Msg> {
        let parameters = self.study.as_ref().map(|study| study.parameters).unwrap_or_default();
        let exposures = self.exposures.iter().find(|(id, _)| id == trial.id());
        let exposures = exposures.map_or(1, |(_, count)| *count);
        let upload = drive.into_upload(&self.context.screen, exposures);
        let flags = page_flags(
            &parameters,
            &upload.sampled_at_ms,
            upload.exposures,
            &upload.page_events,
            None,
        );
        self.hint = if flags.contains(&Flag::FocusLost) {
            Some("ready.interrupted")
        } else if flags.contains(&Flag::Interrupted) && !flags.contains(&Flag::ShownBefore) {
            Some("ready.stalled")
        } else {
            None
        };
        let last =
            upload.states.last().copied().unwrap_or_else(|| trial.scene.straight_scene().start());
        let outcome = outcome(&parameters, &upload.inputs, &upload.states);
        let keep = self.outbox.add(trial.id(), json::write(&upload));
        let trials = self.study.as_ref().map(|study| study.trials).unwrap_or_default();
        let drawn_for_ms = 1000.0 * trials.stays_s(trial.feedback);
        let until_ms = self.now_ms + drawn_for_ms + UNDRAWN_MS;
        let stay = Stay { drawn_for_ms, is_drawn: false, until_ms };
        self.stage = Stage::Over(trial, last, stay, outcome);
        lifted(Some(keep)).chain(self.go_on()).collect()
    }

    /// Continues after the last picture of a scene.
    pub(super) fn after(&mut self, trial: &PlannedTrial) -> Commands<Msg> {
        let rest_after = self.study.as_ref().map_or(0, |study| study.trials.rest_after);
        let is_rest = self.next().is_some_and(|next| {
            let of_tasks = next.phase == Phase::Task && trial.phase == Phase::Task;
            let place = next.scene.index;
            of_tasks
                && next.scene.attempt == 1
                && place > 0
                && rest_after > 0
                && place % rest_after == 0
        });
        self.stage = if is_rest { Stage::Rest } else { Stage::Ready };
        self.go_on()
    }

    pub(super) fn key(&mut self, t_ms: f64, code: &str, key: &str, down: bool) -> Commands<Msg> {
        self.held.change(t_ms, code, down);
        if self.held.is_empty() && self.hint == Some("ready.release") {
            self.hint = None;
        }
        match &mut self.stage {
            Stage::Driving(_, drive) => drive.key(t_ms, code, down),
            // If the keys are released only during the last second, restart the countdown.
            Stage::Countdown(_, ends_ms, left_s)
                if !down && self.held.is_empty() && *ends_ms < t_ms + 1000.0 =>
            {
                let trials = self.study.as_ref().map(|study| study.trials).unwrap_or_default();
                *left_s = trials.countdown_s;
                *ends_ms = t_ms + 1000.0 * f64::from(*left_s);
            }
            Stage::Equipment(equipment) if down => {
                if let Some(steering) = equipment.pressed(&self.steering, code, key) {
                    return self.steer_with(steering);
                }
            }
            _ => {}
        }
        Vec::new()
    }

    pub(super) fn steer_with(&mut self, steering: Steering) -> Commands<Msg> {
        let text = json::write(&steering);
        self.steering = steering;
        self.held = HeldKeys::default();
        vec![Command::Keep { name: STEERING.to_owned(), text, then: Box::new(|_| Msg::Noted) }]
    }

    pub(super) fn page_event(&mut self, t_ms: f64, event: &Event) {
        if let Stage::Driving(_, drive) = &mut self.stage {
            drive.page_event(t_ms, event);
        }
    }

    pub(super) fn focus_lost(&mut self, t_ms: f64) -> Commands<Msg> {
        // The scene has not moved yet, so return to its start.
        if let Stage::Countdown(..) = self.stage {
            self.not_begun();
        }
        self.key(t_ms, BLUR, "", false)
    }
}
