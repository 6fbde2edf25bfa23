//! The participant's page: consent, instructions, one scene after the other, and
//! the completion code. Safety levels are never shown here.

mod view;
#[cfg(test)]
mod tests;

use crate::drive::{Drive, json_object};
use crate::input::{BLUR, HeldKeys, KeyMap};
use crate::json;
use crate::outbox::{self, Outbox, UploadOutcome};
use crate::overlays::stage;
use crate::runtime::{
    Answer, Command, Commands, Event, Failure, NotKept, Page, PageContext, Request, read,
};
use crate::shape::{Picture, Window};
use crate::view::Node;
use serde::{Deserialize, Serialize};
use sidestep::api::{
    Completed, Enrolled, Enrolment, PlannedScene, Progress, SCHEMA_VERSION, StudyInfo, routes,
};
use sidestep::scene::{JointState, Scene};
use sidestep::trial::Phase;

/// For this long the scene stands still before it starts, ms.
const STILL_MS: f64 = 800.0;

/// Pause before the server is asked again, ms.
const RETRY_MS: f64 = 2000.0;

/// Half the side of the part of the world that is always seen, m.
const WINDOW_HALF_M: f64 = 15.0;

/// The participant's page.
#[derive(Default)]
pub struct Participant {
    context: PageContext,
    slug: String,
    /// Time of the last message, on the page's clock.
    now_ms: f64,
    study: Option<StudyInfo>,
    session: Option<Session>,
    plan: Vec<PlannedTrial>,
    /// Ids of the trials that the server has.
    stored: Vec<String>,
    outbox: Outbox,
    keys: KeyMap,
    held: HeldKeys,
    /// What went wrong last, if it still matters.
    trouble: Option<String>,
    /// Why this browser does not keep what it was given, if so.
    not_kept: Option<NotKept>,
    /// The trial that the server refused last; the participant drives it again.
    refused: Option<String>,
    /// The server has said once that trials are missing, although all seemed stored.
    was_incomplete: bool,
    /// The question to repeat after a pause.
    retry: Option<fn(&Self) -> Command<Msg>>,
    stage: Stage,
}

/// What the participant's page can be told.
#[derive(Clone, Debug)]
pub enum Msg {
    /// Something happened outside of what the page shows.
    Event(Event),
    /// The server described the study.
    Study(Answer),
    /// The participant agreed to take part.
    Consent,
    /// The server answered the enrolment.
    Enrolled(Answer),
    /// The browser keeps the participant's token, or does not.
    SessionKept(Result<(), NotKept>),
    /// The server told which trials it has.
    Progress(Answer),
    /// The instructions were read.
    Continue,
    /// The participant starts the next scene.
    Start,
    /// The scene is over.
    SceneOver,
    /// Something happened to the trials that wait to be sent.
    Outbox(outbox::Msg),
    /// It is time to ask the server again.
    Retry,
    /// The server answered the completion.
    Completed(Answer),
}

/// Who the participant is; kept in the browser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Session {
    participant_id: String,
    token: String,
}

/// A trial of the plan, with what its phase says.
#[derive(Clone, Debug)]
struct PlannedTrial {
    phase: Phase,
    show_danger_zone: bool,
    /// How many scenes its phase has.
    of_phase: usize,
    scene: PlannedScene,
}

impl PlannedTrial {
    fn id(&self) -> &str {
        &self.scene.trial_id
    }
}

/// Where the participant is.
#[derive(Default)]
enum Stage {
    #[default]
    Loading,
    /// Nothing can be done here: heading and reason.
    Stuck(&'static str, String),
    Welcome,
    Enrolling,
    Instructions,
    /// Before a scene.
    Ready,
    /// A scene has been shown without moving since this time, ms.
    Still(Box<PlannedTrial>, f64),
    Driving(Box<PlannedTrial>, Box<Drive>),
    /// All scenes are driven; the last trials are being uploaded.
    Finishing,
    Done(String),
}

impl Participant {
    /// The page as it opens.
    #[must_use]
    pub fn open(context: PageContext) -> (Self, Commands<Msg>) {
        let slug = context.address.path.strip_prefix("/s/").unwrap_or_default();
        let slug = slug.trim_end_matches('/').to_owned();
        let page = Self { context, slug, ..Self::default() };
        let commands = vec![page.ask_study()];
        (page, commands)
    }

    fn session_name(&self) -> String {
        format!("sidestep.session.{}", self.slug)
    }

    fn token(&self) -> Option<String> {
        self.session.as_ref().map(|session| session.token.clone())
    }

    fn ask_study(&self) -> Command<Msg> {
        Command::Send(Request::get("study", routes::study(&self.slug), Msg::Study))
    }

    fn ask_progress(&self) -> Command<Msg> {
        let ask = Request::get("progress", routes::ME, Msg::Progress);
        Command::Send(Request { token: self.token(), ..ask })
    }

    fn ask_code(&self) -> Command<Msg> {
        let ask = Request::get("complete", routes::COMPLETE, Msg::Completed);
        Command::Send(Request { method: "POST", token: self.token(), ..ask })
    }

    fn study_arrived(&mut self, study: StudyInfo) -> Commands<Msg> {
        if study.schema_version != SCHEMA_VERSION {
            let why = "It has changed on the server. Please reload it.";
            self.stage = Stage::Stuck("This page is out of date", why.to_owned());
            return Vec::new();
        }
        self.study = Some(study);
        let name = self.session_name();
        let kept = self.context.kept.iter().find(|(key, _)| *key == name);
        self.session = kept.and_then(|(_, text)| json::read(text.as_bytes()));
        if self.session.is_some() {
            return vec![self.ask_progress()];
        }
        self.stage = Stage::Welcome;
        Vec::new()
    }

    fn enrol(&mut self) -> Commands<Msg> {
        self.stage = Stage::Enrolling;
        let body = Enrolment {
            consent: true,
            external_id: self.context.address.parameter("external_id").map(str::to_owned),
            parameters: std::collections::BTreeMap::new(),
            pilot: false,
            // An enrolment whose answer was lost is asked for again under the same name.
            request_id: self.context.random_name.clone(),
            locale: self.context.languages.first().cloned(),
            screen: Some(json_object(&self.context.screen)),
        };
        let ask = Request::get("enrol", routes::participants(&self.slug), Msg::Enrolled);
        vec![Command::Send(Request { method: "POST", body: Some(json::write(&body)), ..ask })]
    }

    fn enrolled(&mut self, enrolled: Enrolled) -> Commands<Msg> {
        let session = Session { participant_id: enrolled.participant_id, token: enrolled.token };
        let text = json::write(&session);
        self.session = Some(session);
        let then = Box::new(Msg::SessionKept);
        let keep = Command::Keep { name: self.session_name(), text, then };
        // A participant who returns by external id may have stored trials.
        vec![keep, self.ask_progress()]
    }

    fn progress_arrived(&mut self, progress: Progress) -> Commands<Msg> {
        let planned =
            |(phase, scene): (&sidestep::api::PlannedPhase, &PlannedScene)| PlannedTrial {
                phase: phase.phase,
                show_danger_zone: phase.show_danger_zone,
                of_phase: phase.scenes.len(),
                scene: scene.clone(),
            };
        let is_first = self.plan.is_empty();
        self.plan = progress.plan.scenes().map(planned).collect();
        self.stored = progress.stored;
        if let Some(code) = progress.completion_code {
            self.stage = Stage::Done(code);
            return Vec::new();
        }
        let mut commands = Vec::new();
        if is_first && let Some(session) = &self.session {
            let ids: Vec<_> = self.plan.iter().map(|trial| trial.id().to_owned()).collect();
            let (id, token) = (&session.participant_id, &session.token);
            self.outbox = Outbox::restore(id, token, &ids, &self.context.kept);
        }
        for id in &self.stored {
            commands.extend(lifted(self.outbox.drop_stored(id)));
        }
        if !self.wants_frames() {
            let begun = !is_first || !self.stored.is_empty() || !self.outbox.is_empty();
            self.stage = if begun { Stage::Ready } else { Stage::Instructions };
        }
        commands.extend(self.go_on());
        commands
    }

    /// The next trial to drive: the first that is neither stored nor waiting.
    fn next(&self) -> Option<&PlannedTrial> {
        self.plan.iter().find(|trial| !self.is_driven(trial))
    }

    fn is_driven(&self, trial: &PlannedTrial) -> bool {
        self.is_stored(trial) || self.outbox.holds(trial.id())
    }

    fn is_stored(&self, trial: &PlannedTrial) -> bool {
        self.stored.iter().any(|id| id == trial.id())
    }

    /// Sends what waits and, once all is driven and stored, asks for the code.
    fn go_on(&mut self) -> Commands<Msg> {
        let awaited = self.plan.iter().find(|trial| !self.is_stored(trial)).map(PlannedTrial::id);
        let mut commands: Vec<_> = lifted(self.outbox.send(awaited)).collect();
        let over = !self.plan.is_empty() && self.next().is_none() && !self.wants_frames();
        if over && !matches!(self.stage, Stage::Done(_) | Stage::Stuck(..)) {
            self.stage = Stage::Finishing;
            if self.outbox.is_empty() {
                commands.push(self.ask_code());
            }
        }
        commands
    }

    fn scene_over(&mut self, trial: &PlannedTrial, drive: Drive) -> Commands<Msg> {
        self.stage = Stage::Ready;
        let upload = drive.into_upload(&self.context.screen, 1);
        let keep = self.outbox.add(trial.id(), json::write(&upload));
        lifted(Some(keep)).chain(self.go_on()).collect()
    }

    fn key(&mut self, t_ms: f64, key: &str, down: bool) {
        self.held.change(t_ms, key, down);
        if let Stage::Driving(_, drive) = &mut self.stage {
            drive.key(t_ms, key, down);
        }
    }

    fn outbox(&mut self, message: outbox::Msg) -> Commands<Msg> {
        if let outbox::Msg::Kept(_, Err(reason)) = &message {
            self.not_kept = Some(*reason);
        }
        let (outcome, commands) = self.outbox.update(message);
        let mut commands: Vec<_> = lifted(commands).collect();
        match outcome {
            None => {}
            Some(UploadOutcome::Stored(id)) => {
                self.trouble = None;
                self.stored.push(id);
            }
            Some(UploadOutcome::StoredBefore(id)) => {
                self.stored.push(id);
                let words =
                    "You already completed this scene in another tab; that version was kept.";
                self.trouble = Some(words.to_owned());
            }
            Some(UploadOutcome::OutOfOrder) => {
                commands.push(self.ask_progress());
                return commands;
            }
            // It is not stored, so the participant drives it again: without it there is no code.
            Some(UploadOutcome::Refused(id, why)) => {
                if self.refused.replace(id.clone()) == Some(id) {
                    let why = format!(
                        "The server refused the same scene twice. {why} Please tell the \
                         researchers. Your recording is kept in this browser."
                    );
                    self.stage = Stage::Stuck("This scene cannot be stored", why);
                    return commands;
                }
                self.trouble = Some(format!(
                    "The server did not accept this scene. {why} Please drive it again."
                ));
                if matches!(self.stage, Stage::Finishing) {
                    self.stage = Stage::Ready;
                }
            }
            Some(UploadOutcome::Ended(why)) => {
                self.stage = Stage::Stuck("Your participation has ended", why);
                return commands;
            }
        }
        commands.extend(self.go_on());
        commands
    }

    /// Asks again after a pause if that may help; otherwise the participation ends here.
    fn failed(
        &mut self,
        failure: Failure,
        ask: fn(&Self) -> Command<Msg>,
        heading: &'static str,
    ) -> Commands<Msg> {
        if !failure.is_temporary() {
            self.stage = Stage::Stuck(heading, failure.sentence);
            return Vec::new();
        }
        self.trouble = Some(failure.sentence);
        self.retry = Some(ask);
        vec![Command::Wake { timer: "retry", after_ms: RETRY_MS, message: Msg::Retry }]
    }

    fn study_failed(&mut self, failure: Failure) -> Commands<Msg> {
        if failure.status == 404 {
            let why = "Please check the link that you were given.";
            self.stage = Stage::Stuck("Study not found", why.to_owned());
            return Vec::new();
        }
        self.failed(failure, Self::ask_study, "The study cannot be shown")
    }

    /// The participant decides when to try again.
    fn enrolment_failed(&mut self, failure: Failure) -> Commands<Msg> {
        if failure.is_temporary() {
            self.trouble = Some(failure.sentence);
            self.stage = Stage::Welcome;
        } else {
            self.stage = Stage::Stuck("You cannot take part", failure.sentence);
        }
        Vec::new()
    }

    fn progress_failed(&mut self, failure: Failure) -> Commands<Msg> {
        // The server no longer knows this participant: start again.
        if matches!(failure.status, 401 | 404) {
            self.session = None;
            self.stage = Stage::Welcome;
            return vec![Command::Forget(self.session_name())];
        }
        self.failed(failure, Self::ask_progress, "Your participation has ended")
    }

    fn completion_failed(&mut self, failure: Failure) -> Commands<Msg> {
        // The server lacks trials that this page took for stored: it knows which.
        if failure.code == "incomplete" && !std::mem::replace(&mut self.was_incomplete, true) {
            return vec![self.ask_progress()];
        }
        self.failed(failure, Self::ask_code, "There is no completion code yet")
    }

    /// Asks again what failed before.
    fn ask_again(&mut self) -> Commands<Msg> {
        let retry = self.retry.take().map(|ask| ask(self));
        retry.into_iter().collect()
    }

    fn hear_event(&mut self, event: &Event, now_ms: f64) -> Commands<Msg> {
        if let Stage::Driving(_, drive) = &mut self.stage {
            drive.page_event(now_ms, event);
        }
        match event {
            Event::Key { code, down, .. } => self.key(now_ms, code, *down),
            Event::FocusLost { .. } => self.key(now_ms, BLUR, false),
            Event::Online => {
                self.outbox.resume();
                let mut commands = self.ask_again();
                commands.extend(self.go_on());
                return commands;
            }
            _ => {}
        }
        Vec::new()
    }
}

/// The outbox's commands as the page's.
fn lifted(
    commands: impl IntoIterator<Item = Command<outbox::Msg>>,
) -> impl Iterator<Item = Command<Msg>> {
    commands.into_iter().map(|command| command.map(Msg::Outbox))
}

impl Page for Participant {
    type Msg = Msg;

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        // A key may have gone down a little before the last frame; what is shown never goes back.
        self.now_ms = now_ms.max(self.now_ms);
        if matches!(message, Msg::Study(_) | Msg::Enrolled(_) | Msg::Progress(_)) {
            self.trouble = None;
        }
        match message {
            Msg::Event(event) => return self.hear_event(&event, now_ms),
            Msg::Study(answer) => match read(answer) {
                Ok(study) => return self.study_arrived(study),
                Err(failure) => return self.study_failed(failure),
            },
            Msg::Consent => return self.enrol(),
            Msg::Enrolled(answer) => match read(answer) {
                Ok(enrolled) => return self.enrolled(enrolled),
                Err(failure) => return self.enrolment_failed(failure),
            },
            Msg::SessionKept(kept) => self.not_kept = kept.err(),
            Msg::Progress(answer) => match read(answer) {
                Ok(progress) => return self.progress_arrived(progress),
                Err(failure) => return self.progress_failed(failure),
            },
            Msg::Continue => self.stage = Stage::Ready,
            Msg::Start => {
                if let (Stage::Ready, Some(next)) = (&self.stage, self.next()) {
                    self.stage = Stage::Still(Box::new(next.clone()), self.now_ms);
                    self.trouble = None;
                }
            }
            Msg::SceneOver => {
                if let Stage::Driving(trial, drive) = std::mem::take(&mut self.stage) {
                    return self.scene_over(&trial, *drive);
                }
            }
            Msg::Outbox(message) => return self.outbox(message),
            Msg::Retry => return self.ask_again(),
            Msg::Completed(answer) => match read(answer) {
                Ok(Completed { completion_code, .. }) => {
                    self.trouble = None;
                    self.stage = Stage::Done(completion_code);
                }
                Err(failure) => return self.completion_failed(failure),
            },
        }
        Vec::new()
    }

    fn view(&self) -> Node<Msg> {
        view::page(self)
    }

    fn title(&self) -> String {
        self.study.as_ref().map_or_else(|| "Sidestep".to_owned(), |study| study.title.clone())
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        let matters = match event {
            Event::Key { code, .. } => self.keys.turn(code).is_some(),
            Event::Address(_) | Event::TakenOver => false,
            _ => true,
        };
        matters.then(|| Msg::Event(event.clone()))
    }

    fn due_ms(&self) -> Option<f64> {
        match &self.stage {
            Stage::Still(_, since) => Some(since + STILL_MS),
            Stage::Driving(_, drive) => Some(drive.due_ms()),
            _ => None,
        }
    }

    fn tick(&mut self, now_ms: f64) -> Option<Msg> {
        if let Stage::Still(trial, since) = &self.stage
            && now_ms >= since + STILL_MS
        {
            let start_ms = since + STILL_MS;
            let started_at_ms = self.context.time_origin_ms + start_ms;
            let parameters = self.study.as_ref().map(|study| study.parameters).unwrap_or_default();
            let (scene, keys, held) = (trial.scene.scene(), &self.keys, &self.held);
            let drive = Drive::new(parameters, &scene, start_ms, started_at_ms, keys, held);
            self.stage = Stage::Driving(trial.clone(), Box::new(drive));
        }
        match &mut self.stage {
            Stage::Driving(_, drive) => drive.tick(now_ms).then_some(Msg::SceneOver),
            _ => None,
        }
    }

    fn wants_frames(&self) -> bool {
        matches!(self.stage, Stage::Still(..) | Stage::Driving(..))
    }

    fn draw(&self, at_ms: f64, picture: &mut Picture) -> bool {
        let (trial, state, step) = match &self.stage {
            Stage::Still(trial, _) => (trial, trial.scene.scene().start(), 0),
            Stage::Driving(trial, drive) => (trial, drive.state_at(at_ms), drive.step_at(at_ms)),
            _ => return false,
        };
        let scene = trial.scene.scene();
        picture.begin("scene", window(&scene, state));
        picture.tell("data-step", step);
        picture.tell("data-phase", trial.phase.word());
        picture.tell("data-trial", trial.id());
        // What a participant sees of a scene.
        if let (true, Some(study)) = (trial.show_danger_zone, &self.study) {
            let radius_m = study.parameters.danger_radius_m;
            picture.shapes.push(stage::danger_zone(state.robot, radius_m));
        }
        picture.shapes.extend(stage::vehicles_and_goal(&scene, state));
        true
    }

    fn owns_key(&self, code: &str) -> bool {
        self.wants_frames() && (self.keys.turn(code).is_some() || code == "Space")
    }

    fn frame_shown(&mut self, at_ms: f64, work_ms: f64) {
        if let Stage::Driving(_, drive) = &mut self.stage {
            drive.frame_shown(at_ms, work_ms);
        }
    }
}

/// The same view for every scene; it widens only where a vehicle would leave it.
fn window(scene: &Scene, state: JointState) -> Window {
    let human = state.human.position();
    let fixed = [scene.human.position(), scene.robot.position(), scene.goal, human];
    fixed.into_iter().fold(Window::square(WINDOW_HALF_M), |window, p| window.including(p, 2.5))
}
