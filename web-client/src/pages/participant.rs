//! The participant's page: consent, the check of keyboard and screen, instructions, one scene after
//! another, questions, and the completion code. It never shows safety levels.
//!
//! The page is a state machine whose states are `Stage`s. Its sentences come from the server, in
//! the participant's language.

mod link;
mod robots;
mod arena;
mod equipment;
mod state;
mod requests;
mod sending;
mod course;
mod answers;
mod joining;
mod picture;
mod view;
#[cfg(test)]
mod tests;

use self::equipment::Steering;
use self::link::Link;
use self::robots::{ReadRules, Rules, Unread};
use self::state::{PlannedTrial, Session, Stage};
use crate::form::Form;
use crate::input::HeldKeys;
use crate::json;
use crate::outbox::{self, Outbox};
use crate::runtime::{Answer, Command, Commands, Event, NotKept, Page, PageContext, read};
use crate::texts::Sentences as _;
use crate::view::Node;
use sidestep::api::{Completed, Progress, StudyInfo, Texts};
use sidestep::picture::Picture;
use sidestep::study::AfterWrong;
use std::rc::Rc;

/// Pause before a retry (ms).
const RETRY_MS: f64 = 2000.0;

/// Storage names of the chosen language and keys.
const LANGUAGE: &str = "sidestep.language";
const STEERING: &str = "sidestep.keys";

/// The participant's page.
#[derive(Default)]
pub struct Participant {
    /// Reads the rules of robots. `None` in the page of studies whose robots have no rules.
    reads_rules: Option<ReadRules>,
    rules: Option<Box<dyn Rules>>,
    context: PageContext,
    link: Link,
    /// The time of the last message, on the page's clock (ms).
    now_ms: f64,
    study: Option<StudyInfo>,
    /// The chosen language, if any.
    language: Option<String>,
    /// Whether the study was requested together with the external id in the address.
    is_named: bool,
    /// All texts, in the participant's language.
    texts: Texts,
    session: Option<Session>,
    /// The last progress report of the server.
    progress: Option<Progress<Unread>>,
    plan: Vec<PlannedTrial>,
    /// Ids of the trials that the server has.
    stored: Vec<String>,
    outbox: Outbox,
    /// How often each scene has started to move in front of the participant, by trial id.
    exposures: Vec<(String, u32)>,
    steering: Steering,
    held: HeldKeys,
    /// The last error message, while it is relevant.
    trouble: Option<String>,
    /// The study's reaction to a wrong answer in the comprehension check. `Some` while new
    /// questions are being loaded.
    renews: Option<AfterWrong>,
    /// The key of a sentence about the last scene or about the last answers.
    hint: Option<&'static str>,
    /// The reason why this browser could not store a record.
    not_kept: Option<NotKept>,
    /// The id of the trial that the server refused last, so that the participant repeats it.
    refused: Option<String>,
    /// The number of stored trials at the time when the server last sent the whole plan.
    plan_known_at: usize,
    /// Whether the server has already reported missing data at a time when everything seemed to be
    /// stored.
    was_incomplete: bool,
    /// Requests to repeat after a pause.
    retry: Vec<fn(&Self) -> Command<Msg>>,
    /// The body sent last: either the result of the comprehension check, or the answers.
    submitted: String,
    /// Whether the page is in full screen, and whether it has requested full screen before.
    is_fullscreen: bool,
    was_fullscreen: bool,
    /// Whether the browser asks users for confirmation before they leave.
    is_guarded: bool,
    /// Whether the page asks the participant to confirm the withdrawal.
    is_withdrawing: bool,
    /// Whether a withdrawal deletes all data.
    deletes: bool,
    /// The names of the human's vehicle and of the robot.
    names: [Rc<str>; 2],
    stage: Stage,
}

/// Messages to the participant's page.
#[derive(Clone, Debug)]
pub enum Msg {
    /// An event outside the view.
    Event(Event),
    /// The server described the study.
    Study(Answer),
    /// The server sent the texts.
    Texts(Answer),
    /// The participant chose another language.
    Language(String),
    /// Show this part of the study.
    Go(Part),
    /// Start to choose other keys (true), or restore the default keys (false).
    ChooseKeys(bool),
    /// The server answered the enrolment.
    Enrolled(Answer),
    /// The browser has stored the participant's token, or has failed to do so.
    SessionKept(Result<(), NotKept>),
    /// The browser has stored a record that the study does not depend on, or has failed to do so.
    Noted,
    /// The server reported the progress of the participation.
    Progress(Answer),
    /// The participant answered the comprehension check.
    Checked(Form),
    /// The server answered the upload of the check's result.
    Understood(Answer),
    /// The participant starts the next scene.
    Start,
    /// Something is due at the current time.
    Clock,
    /// The participant answered the questions after the last scene.
    Questions(Form),
    /// The server answered the upload of the answers.
    Answered(Answer),
    /// A message to the outbox.
    Outbox(outbox::Msg),
    /// It is time for a retry.
    Retry,
    /// The server answered the completion.
    Completed(Answer),
    /// Enter or leave full screen.
    Fullscreen(bool),
    /// Withdraw. `true` also deletes all data.
    Withdraw(bool),
    /// The server answered the withdrawal.
    Withdrawn(Answer),
    /// Reload the page and continue in this tab.
    Here,
    /// Forget the current pilot's session, and begin a new pilot.
    Afresh,
}

/// A part of the study that a button leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Consent, although the device seems to have no keyboard.
    Welcome,
    /// The check of keyboard and screen after the consent.
    Equipment,
    /// Enrolment.
    Enrolment,
    /// The instructions.
    Instructions,
    /// The part after the instructions.
    Understanding,
    /// The next scene.
    Ready,
    /// The question whether the participant wants to withdraw.
    Withdrawal,
    /// Back to the study from the question about withdrawal.
    Study,
}

impl Participant {
    /// Creates the page and its first commands.
    #[must_use]
    pub fn open(context: PageContext) -> (Self, Commands<Msg>) {
        let link = Link::of(&context.address);
        let not_kept = context.not_kept;
        let mut page = Self { context, link, not_kept, ..Self::default() };
        if let Some(steering) = page.kept(STEERING) {
            page.steering = steering;
        }
        page.language = page.kept_text(LANGUAGE);
        let mut commands = vec![page.ask_study(), page.ask_texts()];
        if page.link.token.is_some() {
            // Remove the personal link's secret from the address bar.
            commands.push(Command::ReplaceAddress(page.link.url()));
        }
        (page, commands)
    }

    /// Like [`Self::open`], for a study whose robots follow rules.
    #[must_use]
    pub fn open_with_robots(context: PageContext) -> (Self, Commands<Msg>) {
        let (page, commands) = Self::open(context);
        (Self { reads_rules: Some(robots::read), ..page }, commands)
    }

    /// Parses the record that was stored under a name when the page opened.
    fn kept<T: serde::de::DeserializeOwned>(&self, name: &str) -> Option<T> {
        self.kept_text(name).and_then(|text| json::read(text.as_bytes()))
    }

    /// Returns the text that was stored under a name when the page opened.
    fn kept_text(&self, name: &str) -> Option<String> {
        let kept = self.context.kept.iter().find(|(known, _)| known == name);
        kept.map(|(_, text)| text.clone())
    }

    /// A sentence that has no placeholders.
    fn say(&self, key: &str) -> String {
        self.texts.get(key, &[])
    }

    /// Joins sentences with the separator of the language. In Chinese, for example, there is no
    /// space between sentences.
    fn join(&self, sentences: &[String]) -> String {
        let between = self.say("page.between");
        let mut joined = String::new();
        for (i, sentence) in sentences.iter().enumerate() {
            if i > 0 {
                joined.push_str(&between);
            }
            joined.push_str(sentence);
        }
        joined
    }

    /// Whether the texts have arrived.
    fn has_texts(&self) -> bool {
        !self.texts.language.is_empty()
    }

    fn session_name(&self) -> String {
        self.study.as_ref().map_or_else(String::new, |study| self.link.session_name(study))
    }

    fn hear_event(&mut self, event: &Event, now_ms: f64) -> Commands<Msg> {
        self.page_event(now_ms, event);
        match event {
            Event::Key { code, key, down } => return self.key(now_ms, code, key, *down),
            Event::FocusLost { .. } => return self.focus_lost(now_ms),
            Event::Fullscreen(on) => self.is_fullscreen = *on,
            Event::Online => {
                self.outbox.resume();
                let mut commands = self.ask_again();
                commands.extend(self.go_on());
                return commands;
            }
            Event::TakenOver => {
                self.stage = Stage::Elsewhere;
                return vec![Command::CancelAll];
            }
            Event::FocusGained | Event::Shown | Event::Resized { .. } | Event::Address(_) => {}
        }
        Vec::new()
    }

    fn updated(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        match message {
            Msg::Event(event) => return self.hear_event(&event, now_ms),
            Msg::Study(answer) => match read(answer) {
                Ok(study) => return self.study_arrived(study),
                Err(failure) => return self.study_failed(&failure, Self::ask_study),
            },
            Msg::Texts(answer) => match read(answer) {
                Ok(texts) => return self.texts_arrived(texts),
                Err(failure) => return self.study_failed(&failure, Self::ask_texts),
            },
            Msg::Language(tag) => {
                self.language = Some(tag.clone());
                let ask = self.ask_texts();
                let name = LANGUAGE.to_owned();
                let keep = Command::Keep { name, text: tag, then: Box::new(|_| Msg::Noted) };
                return vec![ask, keep];
            }
            Msg::Go(part) => return self.go(part),
            Msg::ChooseKeys(own) => {
                let Stage::Equipment(equipment) = &mut self.stage else { return Vec::new() };
                equipment.choosing = own.then_some(None);
                (equipment.left, equipment.right, equipment.refused) = (false, false, false);
                if !own {
                    return self.steer_with(Steering::default());
                }
            }
            Msg::Enrolled(answer) => match read(answer) {
                Ok(enrolled) => return self.enrolled(enrolled),
                Err(failure) => {
                    return self.failed(&failure, Self::ask_enrolment, "stuck.screened_out");
                }
            },
            Msg::SessionKept(kept) => self.not_kept = kept.err(),
            Msg::Noted => {}
            Msg::Progress(answer) => {
                if let (Some(read), Ok(report)) = (self.reads_rules, &answer) {
                    self.rules = read(report);
                }
                return match read(answer) {
                    Ok(progress) => self.progress_arrived(progress),
                    Err(failure) => self.progress_failed(&failure),
                };
            }
            Msg::Checked(form) => return self.checked(&form),
            Msg::Understood(answer) => match read(answer) {
                Ok(stored) => return self.understood(stored),
                Err(failure) => return self.failed(&failure, Self::ask_check, "stuck.ended"),
            },
            Msg::Start => return self.start(),
            Msg::Clock => return self.clock(),
            Msg::Questions(form) => return self.questions(&form),
            Msg::Answered(answer) => return self.answered(answer),
            Msg::Outbox(message) => return self.outbox(message),
            Msg::Retry => return self.ask_again(),
            Msg::Completed(answer) => match read(answer) {
                Ok(Completed { completion_code, return_url }) => {
                    self.trouble = None;
                    self.stage = Stage::Done(Some(completion_code), return_url);
                    return vec![Command::Fullscreen(false)];
                }
                Err(failure) => return self.completion_failed(&failure),
            },
            Msg::Fullscreen(on) => return vec![Command::Fullscreen(on)],
            Msg::Withdraw(delete) => {
                self.deletes = delete;
                return vec![self.ask_withdrawal()];
            }
            Msg::Withdrawn(answer) => return self.withdrawn(answer),
            // An empty text means that there is no session. After the browser has stored it, the
            // page is reloaded.
            Msg::Afresh => {
                let name = self.session_name();
                return vec![Command::Keep {
                    name,
                    text: String::new(),
                    then: Box::new(|_| Msg::Here),
                }];
            }
            Msg::Here => return vec![Command::Leave(self.link.url())],
        }
        Vec::new()
    }
}

/// Converts the outbox's commands to commands of the page.
fn lifted(
    commands: impl IntoIterator<Item = Command<outbox::Msg>>,
) -> impl Iterator<Item = Command<Msg>> {
    commands.into_iter().map(|command| command.map(Msg::Outbox))
}

impl Page for Participant {
    type Msg = Msg;

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        // A key event may be older than the last frame, but the displayed time must never go back.
        self.now_ms = now_ms.max(self.now_ms);
        let is_answer = matches!(
            message,
            Msg::Study(_)
                | Msg::Texts(_)
                | Msg::Enrolled(_)
                | Msg::Progress(_)
                | Msg::Understood(_)
        );
        if is_answer {
            self.trouble = None;
        }
        let mut commands = self.updated(message, now_ms);
        let guards = !self.outbox.is_empty() && !matches!(self.stage, Stage::Elsewhere);
        if std::mem::replace(&mut self.is_guarded, guards) != guards {
            commands.push(Command::GuardLeaving(guards));
        }
        commands
    }

    fn view(&self) -> Node<Msg> {
        view::page(self)
    }

    fn title(&self) -> String {
        self.study.as_ref().map_or_else(|| "Sidestep".to_owned(), |study| study.title.clone())
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        let matters = match event {
            Event::Key { code, .. } => {
                self.steering.keys.turn(code).is_some()
                    || matches!(&self.stage, Stage::Equipment(found) if found.choosing.is_some())
            }
            Event::Address(_) => false,
            _ => true,
        };
        matters.then(|| Msg::Event(event.clone()))
    }

    fn due_ms(&self) -> Option<f64> {
        match &self.stage {
            Stage::Countdown(_, ends_ms, left_s) => {
                Some(ends_ms - 1000.0 * f64::from(left_s.saturating_sub(1)))
            }
            Stage::Driving(_, drive) => Some(drive.due_ms()),
            Stage::Over(_, _, stay, _) => Some(stay.until_ms),
            _ => None,
        }
    }

    fn tick(&mut self, now_ms: f64) -> Option<Msg> {
        let is_calm = self.context.reduced_motion;
        let changes = match &mut self.stage {
            Stage::Countdown(_, ends_ms, left_s) => {
                let is_next = now_ms >= *ends_ms - 1000.0 * f64::from(left_s.saturating_sub(1));
                // A scene does not start while a key is down. Once the keys are released, it starts
                // after one second.
                is_next && (self.held.is_empty() || *left_s > 1)
            }
            Stage::Driving(_, drive) => drive.tick(now_ms),
            Stage::Over(_, _, stay, _) => now_ms >= stay.until_ms,
            Stage::Instructions(arena) => {
                arena.tick(now_ms, &self.steering.keys, &self.held, is_calm);
                false
            }
            Stage::Equipment(equipment) => {
                let was_measuring = equipment.is_measuring();
                equipment.frame(now_ms);
                was_measuring && !equipment.is_measuring()
            }
            _ => false,
        };
        changes.then_some(Msg::Clock)
    }

    fn wants_frames(&self) -> bool {
        match &self.stage {
            Stage::Equipment(equipment) => equipment.is_measuring(),
            Stage::Instructions(_) => !self.is_withdrawing,
            Stage::Countdown(..) | Stage::Driving(..) | Stage::Over(..) => true,
            _ => false,
        }
    }

    fn draw(&self, at_ms: f64, picture: &mut Picture) -> bool {
        self.draw_stage(at_ms, picture)
    }

    fn owns_key(&self, code: &str) -> bool {
        let drives = matches!(self.stage, Stage::Countdown(..) | Stage::Driving(..));
        let steers = self.steering.keys.turn(code).is_some();
        let tries = matches!(self.stage, Stage::Instructions(_) | Stage::Equipment(_));
        (drives || tries) && steers || drives && code == "Space"
    }

    fn frame_shown(&mut self, at_ms: f64, work_ms: f64) {
        match &mut self.stage {
            Stage::Driving(_, drive) => drive.frame_shown(at_ms, work_ms),
            Stage::Over(_, _, stay, _) if !stay.is_drawn => {
                (stay.is_drawn, stay.until_ms) = (true, at_ms + stay.drawn_for_ms);
            }
            _ => {}
        }
    }
}
