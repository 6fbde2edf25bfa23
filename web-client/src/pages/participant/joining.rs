//! The way from the link to the first page: the study, its texts, the enrolment, and the page at
//! which a returning participant continues.

use super::robots::Unread;
use super::sending::ended;
use super::state::{PlannedTrial, Quiz, Session, Stage};
use super::{Msg, Part, Participant, lifted};
use crate::drive::facts;
use crate::json;
use crate::outbox::Outbox;
use crate::runtime::{Command, Commands, Failure};
use sidestep::api::{
    self, Admission, Enrolled, Enrolment, PlannedScene, Progress, SCHEMA_VERSION, StudyInfo, routes,
};
use sidestep::trial::Phase;

impl Participant {
    pub(super) fn ask_enrolment(&self) -> Command<Msg> {
        let Some(study) = &self.study else { return self.ask_study() };
        let mut screen = self.context.screen.clone();
        if let Stage::Equipment(equipment) = &self.stage {
            screen.extend(equipment.rate_hz().map(|hz| ("refresh_hz", hz)));
        }
        let body = Enrolment {
            consent: true,
            external_id: self.link.external_id(study).map(str::to_owned),
            parameters: self.link.recorded(study),
            pilot: self.link.is_pilot(),
            // If the response to an enrolment is lost, the enrolment is repeated with the same id.
            request_id: self.context.random_name.clone(),
            locale: Some(self.texts.language.clone()),
            screen: Some(facts(&screen)),
        };
        let url = routes::participants(&self.link.slug);
        self.ask("enrol", "POST", url, Some(json::write(&body)), Msg::Enrolled)
    }

    /// Continues as soon as both the study and its texts have arrived.
    pub(super) fn opened(&mut self) -> Commands<Msg> {
        if self.study.is_none() || !matches!(self.stage, Stage::Loading) {
            return Vec::new();
        }
        // With a session, the study and its texts were requested a second time, and the page waits
        // for the progress report.
        if !self.has_texts() || self.session.is_some() {
            return Vec::new();
        }
        self.session = match &self.link.token {
            Some(token) => Some(Session { participant_id: String::new(), token: token.clone() }),
            None => self.kept(&self.session_name()),
        };
        if self.session.is_some() {
            // Request the study in the version that the participant enrolled in, because it may
            // have changed since.
            self.language = Some(self.texts.language.clone());
            return vec![self.ask_study(), self.ask_texts(), self.ask_progress()];
        }
        self.admit()
    }

    /// Chooses the first page for a person without a session: the welcome page, or the reason why
    /// the person cannot take part.
    fn admit(&mut self) -> Commands<Msg> {
        let Some(study) = &self.study else { return Vec::new() };
        if self.link.is_incomplete(study) {
            self.stage = self.stuck("no_id");
            return Vec::new();
        }
        // A person with an external id may have begun or finished in another browser. Only the
        // server knows this, so ask it.
        let names = !self.link.is_pilot() && self.link.external_id(study).is_some();
        if names && !std::mem::replace(&mut self.is_named, true) {
            return vec![self.ask_study()];
        }
        let url = study.return_url.clone();
        self.stage = match study.admission {
            // A pilot does not count towards the quota.
            Admission::Full | Admission::Closed if self.link.is_pilot() => Stage::Welcome,
            Admission::Open if self.context.touch_only => Stage::Touch,
            Admission::Open => Stage::Welcome,
            Admission::Full => ended("full", url),
            Admission::Closed => ended("closed", url),
            Admission::Archived => ended("archived", url),
            Admission::Finished => Stage::Done(None, url),
            Admission::Withdrawn => ended("withdrawn", url),
            Admission::ScreenedOut => ended("screened_out", url),
        };
        Vec::new()
    }

    pub(super) fn study_arrived(&mut self, study: StudyInfo) -> Commands<Msg> {
        if study.schema_version != SCHEMA_VERSION {
            self.stage = self.stuck("outdated");
            return Vec::new();
        }
        self.study = Some(study);
        self.opened()
    }

    pub(super) fn texts_arrived(&mut self, texts: api::Texts) -> Commands<Msg> {
        self.texts = texts;
        self.names = ["scene.you", "scene.robot"].map(|key| self.say(key).into());
        let mut commands = vec![Command::Language(self.texts.language.clone())];
        if let Some(after_wrong) = self.renews.take() {
            self.renewed(after_wrong);
        }
        commands.extend(self.opened());
        commands
    }

    /// Stores the session and claims it for this tab.
    pub(super) fn begin_session(&mut self, session: Session) -> Commands<Msg> {
        let text = json::write(&session);
        let take_over = Command::TakeOver(format!("sidestep.{}", session.participant_id));
        self.session = Some(session);
        let then = Box::new(Msg::SessionKept);
        vec![Command::Keep { name: self.session_name(), text, then }, take_over]
    }

    /// Enrols the person, but only after the browser has stored the request id. Then a repeated
    /// request after a reload does not enrol the person twice.
    fn enrol(&mut self) -> Commands<Msg> {
        let name = self.enrolment_name();
        if let Some(known) = self.kept_text(&name) {
            self.context.random_name = Some(known);
        }
        let text = self.context.random_name.clone().unwrap_or_default();
        self.retry.push(Self::ask_enrolment);
        vec![Command::Keep { name, text, then: Box::new(|_| Msg::Retry) }]
    }

    fn enrolment_name(&self) -> String {
        self.session_name() + ".request"
    }

    pub(super) fn enrolled(&mut self, enrolled: Enrolled<Unread>) -> Commands<Msg> {
        let session = Session { participant_id: enrolled.participant_id, token: enrolled.token };
        let mut commands = self.begin_session(session);
        commands.push(Command::Forget(self.enrolment_name()));
        if self.study.as_ref().is_some_and(|study| study.draws_check) {
            commands.push(self.ask_texts());
        }
        // A participant who has returned with an external id may already have stored trials.
        commands.push(self.ask_progress());
        commands
    }

    pub(super) fn progress_arrived(&mut self, progress: Progress<Unread>) -> Commands<Msg> {
        let mut commands = Vec::new();
        let is_first = self.plan.is_empty();
        if is_first && let Some(session) = &self.session {
            let mut session = session.clone();
            session.participant_id.clone_from(&progress.participant_id);
            commands.extend(self.begin_session(session));
        }
        let study = self.study.as_ref();
        let feedback = |phase: Phase| {
            study.is_some_and(|study| {
                study.phases.iter().any(|config| config.phase == phase && config.feedback)
            })
        };
        let planned =
            |(phase, scene): (&api::PlannedPhase<Unread>, &PlannedScene<Unread>)| PlannedTrial {
                phase: phase.phase,
                show_danger_zone: phase.show_danger_zone,
                feedback: feedback(phase.phase),
                of_phase: phase.scenes.iter().filter(|scene| scene.attempt == 1).count(),
                scene: scene.clone(),
            };
        // Repeated attempts follow after all first attempts.
        let (first, further): (Vec<_>, Vec<_>) =
            progress.plan.scenes().map(planned).partition(|trial| trial.scene.attempt == 1);
        self.plan = first.into_iter().chain(further).collect();
        // The study got its robots after this page was loaded.
        if self.rules.is_none() && self.plan.iter().any(|trial| trial.scene.policy.is_some()) {
            self.stage = self.stuck("outdated");
            return Vec::new();
        }
        self.stored.clone_from(&progress.stored);
        self.plan_known_at = self.stored.len();
        if is_first && let Some(session) = &self.session {
            let ids: Vec<_> = self.plan.iter().map(|trial| trial.id().to_owned()).collect();
            let (id, token) = (&session.participant_id, &session.token);
            self.outbox = Outbox::restore(id, token, &ids, &self.context.kept);
            let count = |id: &String| {
                let name = self.exposure_name(id);
                let kept = self.context.kept.iter().find(|(known, _)| *known == name)?;
                Some((id.clone(), kept.1.parse().ok()?))
            };
            self.exposures = ids.iter().filter_map(count).collect();
        }
        // If the next scene had already begun, the page was reloaded during that scene.
        if is_first && self.next().is_some_and(|trial| self.has_begun(trial)) {
            self.hint = Some("ready.reloaded");
        }
        let is_over = progress.complete || progress.completion_code.is_some();
        let done = (progress.completion_code.clone(), progress.return_url.clone());
        let understood = progress.understood;
        self.progress = Some(progress);
        if is_over {
            self.stage = Stage::Done(done.0, done.1);
            return commands;
        }
        for id in &self.stored {
            commands.extend(lifted(self.outbox.drop_stored(id)));
        }
        if matches!(self.stage, Stage::Loading | Stage::Equipment(_)) {
            let begun =
                !self.stored.is_empty() || !self.outbox.is_empty() || !self.exposures.is_empty();
            if begun && understood {
                self.stage = Stage::Ready;
            } else {
                self.show_instructions();
            }
        }
        commands.extend(self.go_on());
        commands
    }

    pub(super) fn study_failed(
        &mut self,
        failure: &Failure,
        ask: fn(&Self) -> Command<Msg>,
    ) -> Commands<Msg> {
        // Without the texts, the error message is in English.
        if failure.status == 404 {
            self.stage = self.stuck("not_found");
            return Vec::new();
        }
        self.failed(failure, ask, "stuck.cannot_show")
    }

    pub(super) fn progress_failed(&mut self, failure: &Failure) -> Commands<Msg> {
        if matches!(failure.status, 401 | 404) {
            self.session = None;
            // An invalid personal link says nothing about the user of this browser.
            if self.link.token.take().is_some() {
                self.stage = Stage::Loading;
                // Cancel requests that were made with the link's token, because their answers would
                // replace the error message.
                let mut commands = vec![Command::Cancel("study"), Command::Cancel("texts")];
                commands.extend(self.opened());
                self.trouble = Some(self.say("trouble.link"));
                return commands;
            }
            // The server no longer knows this participant, so start again if possible.
            self.stage = Stage::Loading;
            let mut commands = self.admit();
            commands.push(Command::Forget(self.session_name()));
            return commands;
        }
        self.failed(failure, Self::ask_progress, "stuck.ended")
    }

    pub(super) fn go(&mut self, part: Part) -> Commands<Msg> {
        self.trouble = None;
        match part {
            Part::Welcome => self.stage = Stage::Welcome,
            Part::Equipment => self.stage = Stage::Equipment(Box::default()),
            Part::Enrolment => {
                if let Stage::Equipment(equipment) = &mut self.stage {
                    equipment.is_enrolling = true;
                    return self.enrol();
                }
            }
            Part::Instructions => self.show_instructions(),
            Part::Understanding => {
                self.hint = None;
                let asked = self.progress.as_ref().filter(|progress| !progress.understood);
                self.stage = match asked {
                    // Attempts before a reload count, and so do attempts before the participant
                    // read the instructions again.
                    Some(progress) if !self.texts.check.is_empty() => {
                        let attempts = progress.comprehension_attempts;
                        Stage::Comprehension(Quiz { attempts, ..Quiz::default() })
                    }
                    _ => Stage::Ready,
                };
                return self.go_on();
            }
            Part::Ready => {
                self.stage = Stage::Ready;
                return self.go_on();
            }
            Part::Withdrawal => self.is_withdrawing = true,
            Part::Study => self.is_withdrawing = false,
        }
        Vec::new()
    }
}
