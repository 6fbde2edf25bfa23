//! Outcomes of uploads, and handling of failed requests.

use super::state::Stage;
use super::{Msg, Participant, RETRY_MS, lifted};
use crate::outbox::{self, UploadOutcome};
use crate::runtime::{Command, Commands, Failure};
use crate::texts::Sentences as _;

/// The final page for people who cannot continue, for one of the server's reasons. `url` is the
/// link that they can follow.
pub(super) fn ended(reason: &str, url: Option<String>) -> Stage {
    let (heading, why) = match reason {
        "full" => ("stuck.full", "stuck.full_why"),
        "closed" => ("stuck.closed", "stuck.closed_why"),
        "archived" => ("stuck.archived", "stuck.archived_why"),
        "withdrawn" => ("withdraw.done_heading", "withdraw.thanks"),
        _ => ("stuck.screened_out", "stuck.screened_out_why"),
    };
    Stage::Ended(heading, why, url)
}

impl Participant {
    pub(super) fn outbox(&mut self, message: outbox::Msg) -> Commands<Msg> {
        if let outbox::Msg::Kept(_, Err(reason)) = &message {
            self.not_kept = Some(*reason);
        }
        let (outcome, commands) = self.outbox.update(message);
        let mut commands: Vec<_> = lifted(commands).collect();
        match outcome {
            None => {}
            Some(UploadOutcome::Stored(id)) => {
                self.trouble = None;
                commands.push(Command::Forget(self.exposure_name(&id)));
                self.stored.push(id);
            }
            Some(UploadOutcome::StoredBefore(id)) => {
                self.stored.push(id);
                self.trouble = Some(self.say("trouble.stored_before"));
            }
            Some(UploadOutcome::OutOfOrder) => {
                commands.push(self.ask_progress());
                return commands;
            }
            // The trial is not stored. The participant repeats it, because without it there is no
            // completion code.
            Some(UploadOutcome::Refused(id, why)) => {
                let is_second = self.refused.replace(id.clone()) == Some(id);
                let why = [("why", why.as_str().into())];
                if is_second {
                    let why = self.texts.get("stuck.cannot_store_why", &why);
                    self.stage = Stage::Stuck("stuck.cannot_store", why);
                    return commands;
                }
                self.trouble = Some(self.texts.get("trouble.refused", &why));
                if matches!(self.stage, Stage::Finishing | Stage::Questions(_)) {
                    self.stage = Stage::Ready;
                }
            }
            Some(UploadOutcome::Ended(failure)) => {
                self.end(&failure, "stuck.ended");
                return commands;
            }
        }
        commands.extend(self.go_on());
        commands
    }

    /// The reason why a request failed, in the participant's language.
    pub(super) fn words(&self, failure: &Failure) -> String {
        match failure.status {
            _ if !self.has_texts() => failure.sentence.clone() + " This page keeps trying.",
            0 => self.say("trouble.unreachable"),
            status if failure.is_temporary() && status != 0 => self.say("trouble.busy"),
            _ => self.texts.get("trouble.server", &[("why", failure.sentence.as_str().into())]),
        }
    }

    /// The final page for one of the reasons in the language files.
    pub(super) fn stuck(&self, reason: &'static str) -> Stage {
        let (heading, why) = match reason {
            "no_id" => ("stuck.no_id", "stuck.no_id_why"),
            "not_found" => ("stuck.not_found", "stuck.not_found_why"),
            _ => ("stuck.outdated", "stuck.outdated_why"),
        };
        Stage::Stuck(heading, self.say(why))
    }

    /// Ends the participation for the reason that the server gave.
    pub(super) fn end(&mut self, failure: &Failure, heading: &'static str) {
        let url = failure.return_url.clone();
        self.stage = match failure.code.as_str() {
            code @ ("full" | "closed" | "archived" | "screened_out" | "withdrawn") => {
                ended(code, url)
            }
            _ if failure.code == "invalid" && self.needs_id() => self.stuck("no_id"),
            _ => Stage::Stuck(heading, self.words(failure)),
        };
    }

    /// Whether the server may have refused the person because the link has no external id.
    pub(super) fn needs_id(&self) -> bool {
        self.session.is_none()
            && self.study.as_ref().is_some_and(|study| self.link.external_id(study).is_none())
    }

    /// Retries after a pause if the failure is temporary. Otherwise, ends the participation.
    pub(super) fn failed(
        &mut self,
        failure: &Failure,
        ask: fn(&Self) -> Command<Msg>,
        heading: &'static str,
    ) -> Commands<Msg> {
        if !failure.is_temporary() {
            self.end(failure, heading);
            return Vec::new();
        }
        self.trouble = Some(self.words(failure));
        self.retry.push(ask);
        vec![Command::Wake { timer: "retry", after_ms: RETRY_MS, message: Msg::Retry }]
    }

    pub(super) fn completion_failed(&mut self, failure: &Failure) -> Commands<Msg> {
        // There are two possible causes. Either the server lacks something that this page believed
        // to be stored, and its progress report will show what. Or another tab has completed the
        // participation and received the code.
        let code = failure.code.as_str();
        let is_missing = matches!(code, "incomplete" | "unanswered" | "not_yours");
        if is_missing && !std::mem::replace(&mut self.was_incomplete, true) {
            return vec![self.ask_progress()];
        }
        self.failed(failure, Self::ask_code, "stuck.no_code")
    }

    /// Repeats the failed requests.
    pub(super) fn ask_again(&mut self) -> Commands<Msg> {
        let retry = std::mem::take(&mut self.retry);
        retry.into_iter().map(|ask| ask(self)).collect()
    }
}
