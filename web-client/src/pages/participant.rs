//! The participant's page: consent, instructions, one scene after the other, and
//! the completion code. Safety levels are never shown here.

mod view;

use crate::drive::{Drive, json_object};
use crate::input::turn_of_key;
use crate::json;
use crate::outbox::{Outbox, Settled};
use crate::overlays::stage;
use crate::runtime::{Answer, App, Command, Event, Failure, Request, Surroundings, Tag};
use crate::shape::{Picture, Shape, Window};
use crate::view::Node;
use serde::{Deserialize, Serialize};
use sidestep::api::{
    Completed, Enrolled, Enrolment, Plan, PlannedScene, Progress, SCHEMA_VERSION, StudyInfo, routes,
};
use sidestep::scene::{JointState, Scene};
use sidestep::trial::Phase;

/// For this long the scene stands still before it starts, ms.
const STILL_MS: f64 = 800.0;

/// Half the side of the part of the world that is always seen, m.
const WINDOW_HALF_M: f64 = 15.0;

/// The participant's page.
#[derive(Default)]
pub struct Participant {
    surroundings: Surroundings,
    slug: String,
    now_ms: f64,
    study: Option<StudyInfo>,
    session: Option<Session>,
    course: Vec<Leg>,
    stored: Vec<String>,
    outbox: Outbox,
    held: Vec<(f64, String)>,
    trouble: Option<String>,
    retry: Option<Request>,
    stage: Stage,
}

/// Who the participant is; kept in the browser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Session {
    participant_id: String,
    token: String,
}

/// One scene of the course.
#[derive(Clone, Debug)]
struct Leg {
    phase: Phase,
    show_danger_zone: bool,
    of_phase: usize,
    planned: PlannedScene,
}

/// Where the participant is.
#[derive(Default)]
enum Stage {
    #[default]
    Loading,
    /// Nothing can be done here; why.
    Stuck(String),
    Welcome,
    Enrolling,
    Instructions,
    /// Before a scene.
    Ready,
    /// The scene is shown but stands still, since this time.
    Still(f64),
    Driving(Box<Drive>),
    /// All is driven; the last trials are on their way.
    Finishing,
    Done(String),
}

impl Participant {
    /// The page before it is opened.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    fn session_name(&self) -> String {
        format!("sidestep.session.{}", self.slug)
    }

    fn open(&mut self, surroundings: Surroundings) -> Vec<Command> {
        let slug = surroundings.path.strip_prefix("/s/").unwrap_or_default();
        self.slug = slug.trim_end_matches('/').to_owned();
        self.surroundings = surroundings;
        vec![Command::Send(Request::get(Tag::Study, routes::study(&self.slug)))]
    }

    fn kept(&self, name: &str) -> Option<&str> {
        let mut kept = self.surroundings.kept.iter();
        kept.find(|(key, _)| key == name).map(|(_, text)| text.as_str())
    }

    fn study_arrived(&mut self, study: StudyInfo) -> Vec<Command> {
        if study.schema_version != SCHEMA_VERSION {
            self.stage = Stage::Stuck("This page is out of date. Please reload it.".to_owned());
            return Vec::new();
        }
        self.study = Some(study);
        let session = self.kept(&self.session_name()).and_then(|text| json::read(text.as_bytes()));
        match session {
            Some(session) => self.ask_where_we_are(session),
            None => {
                self.stage = Stage::Welcome;
                Vec::new()
            }
        }
    }

    fn ask_where_we_are(&mut self, session: Session) -> Vec<Command> {
        let mut request = Request::get(Tag::Me, routes::ME);
        request.token = Some(session.token.clone());
        self.session = Some(session);
        vec![Command::Send(request)]
    }

    fn enrol(&mut self) -> Vec<Command> {
        self.stage = Stage::Enrolling;
        let query = &self.surroundings.query;
        let external_id =
            query.iter().find(|(name, _)| name == "external_id").map(|(_, id)| id.clone());
        let locale = Some(self.surroundings.locale.clone()).filter(|locale| !locale.is_empty());
        let screen = json_object(&self.surroundings.screen);
        let body = Enrolment {
            consent: true,
            external_id,
            request_id: None,
            locale,
            screen: Some(screen),
        };
        vec![Command::Send(Request {
            tag: Tag::Enrol,
            method: "POST",
            url: routes::participants(&self.slug),
            token: None,
            body: Some(json::write(&body)),
        })]
    }

    fn enrolled(&mut self, enrolled: Enrolled) -> Vec<Command> {
        let session = Session { participant_id: enrolled.participant_id, token: enrolled.token };
        let text = json::write(&session);
        let keep = Command::Keep(self.session_name(), text);
        // Somebody who comes back by their external id may have stored trials.
        [keep].into_iter().chain(self.ask_where_we_are(session)).collect()
    }

    fn take_course(&mut self, plan: &Plan) {
        self.course = plan
            .scenes()
            .map(|(phase, planned)| Leg {
                phase: phase.phase,
                show_danger_zone: phase.show_danger_zone,
                of_phase: phase.scenes.len(),
                planned: planned.clone(),
            })
            .collect();
    }

    fn progress_arrived(&mut self, progress: &Progress) -> Vec<Command> {
        self.take_course(&progress.plan);
        self.stored.clone_from(&progress.stored);
        if let Some(code) = &progress.completion_code {
            self.stage = Stage::Done(code.clone());
            return Vec::new();
        }
        let ids: Vec<_> = self.course.iter().map(|leg| leg.planned.trial_id.clone()).collect();
        if let Some(session) = &self.session {
            let (id, token) = (&session.participant_id, &session.token);
            self.outbox = Outbox::restore(id, token, &ids, &self.surroundings.kept);
        }
        let begun = !self.stored.is_empty() || !self.outbox.is_empty();
        self.stage = if begun { Stage::Ready } else { Stage::Instructions };
        let send = self.outbox.send();
        send.into_iter().chain(self.after_the_last()).collect()
    }

    /// The next scene to drive: the first that is neither stored nor waiting.
    fn next(&self) -> Option<&Leg> {
        self.course.iter().find(|leg| {
            let id = &leg.planned.trial_id;
            !self.stored.contains(id) && !self.outbox.holds(id)
        })
    }

    /// When all is driven and stored, asks for the code.
    fn after_the_last(&mut self) -> Vec<Command> {
        if self.course.is_empty() || self.next().is_some() || matches!(self.stage, Stage::Done(_)) {
            return Vec::new();
        }
        self.stage = Stage::Finishing;
        if !self.outbox.is_empty() {
            return Vec::new();
        }
        let token = self.session.as_ref().map(|session| session.token.clone());
        let url = routes::COMPLETE.to_owned();
        vec![Command::Send(Request { tag: Tag::Complete, method: "POST", url, token, body: None })]
    }

    fn scene_over(&mut self) -> Vec<Command> {
        let Stage::Driving(drive) = std::mem::replace(&mut self.stage, Stage::Ready) else {
            return Vec::new();
        };
        let Some(trial_id) = self.next().map(|leg| leg.planned.trial_id.clone()) else {
            return Vec::new();
        };
        let upload = drive.into_upload(&self.surroundings.screen);
        let body = json::write(&upload);
        let mut commands = self.outbox.add(&trial_id, body);
        commands.extend(self.after_the_last());
        commands
    }

    fn frame(&mut self, now_ms: f64) -> Vec<Command> {
        self.now_ms = now_ms;
        match &mut self.stage {
            Stage::Still(since) if now_ms - *since >= STILL_MS => {
                let start_ms = *since + STILL_MS;
                let (Some(study), Some(leg)) = (&self.study, self.next()) else {
                    return Vec::new();
                };
                let origin = self.surroundings.time_origin_ms;
                let held = self.held.clone();
                let scene = leg.planned.scene();
                let mut drive =
                    Drive::new(study.parameters, &scene, start_ms, origin + start_ms, held);
                drive.tick(now_ms);
                self.stage = Stage::Driving(Box::new(drive));
                Vec::new()
            }
            Stage::Driving(drive) => {
                if drive.tick(now_ms) {
                    self.scene_over()
                } else {
                    Vec::new()
                }
            }
            _ => Vec::new(),
        }
    }

    fn key(&mut self, t_ms: f64, key: &str, down: bool) {
        if turn_of_key(key).is_none() {
            return;
        }
        self.held.retain(|(_, held)| held != key);
        if down {
            self.held.push((t_ms, key.to_owned()));
        }
        if let Stage::Driving(drive) = &mut self.stage {
            drive.key(t_ms, key, down);
        }
    }

    fn act(&mut self, word: &str) -> Vec<Command> {
        match (word, &self.stage) {
            ("consent", Stage::Welcome) => self.enrol(),
            ("continue", Stage::Instructions) => {
                self.stage = Stage::Ready;
                Vec::new()
            }
            ("start", Stage::Ready) => {
                self.stage = Stage::Still(self.now_ms);
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    fn answered(&mut self, tag: Tag, answer: &Answer) -> Vec<Command> {
        self.trouble = None;
        let taken = match tag {
            Tag::Study => answer.read().map(|study| self.study_arrived(study)),
            Tag::Enrol => answer.read().map(|enrolled| self.enrolled(enrolled)),
            Tag::Me => answer.read().map(|progress: Progress| self.progress_arrived(&progress)),
            Tag::Complete => answer.read().map(|completed: Completed| {
                self.stage = Stage::Done(completed.completion_code);
                Vec::new()
            }),
            Tag::Upload(id) => {
                let (settled, mut commands) = self.outbox.answered(&id, answer);
                match settled {
                    Settled::Stored => self.stored.push(id),
                    Settled::Later => {}
                    Settled::Refused(why) => {
                        self.stored.push(id);
                        self.trouble = Some(format!("One scene was not accepted: {why}"));
                    }
                }
                commands.extend(self.after_the_last());
                return commands;
            }
            _ => Ok(Vec::new()),
        };
        taken.unwrap_or_else(|failure| self.failed(tag, failure))
    }

    fn failed(&mut self, tag: Tag, failure: Failure) -> Vec<Command> {
        let forgotten = matches!(&failure, Failure::Refused { status: 401 | 404, .. });
        match tag {
            // The server does not know this participant any more: begin afresh.
            Tag::Me if forgotten => {
                self.session = None;
                self.stage = Stage::Welcome;
                vec![Command::Forget(self.session_name())]
            }
            _ if failure.is_passing() => {
                self.trouble = Some(failure.sentence());
                self.retry = Some(match tag {
                    Tag::Study => Request::get(Tag::Study, routes::study(&self.slug)),
                    Tag::Enrol => {
                        self.stage = Stage::Welcome;
                        return Vec::new();
                    }
                    Tag::Complete => Request {
                        method: "POST",
                        token: self.session.as_ref().map(|s| s.token.clone()),
                        ..Request::get(Tag::Complete, routes::COMPLETE)
                    },
                    _ => Request {
                        token: self.session.as_ref().map(|s| s.token.clone()),
                        ..Request::get(Tag::Me, routes::ME)
                    },
                });
                vec![Command::WakeAfter(2000.0)]
            }
            _ => {
                self.stage = Stage::Stuck(failure.sentence());
                Vec::new()
            }
        }
    }

    fn woken(&mut self) -> Vec<Command> {
        let retry = self.retry.take().map(Command::Send);
        retry.into_iter().chain(self.outbox.send()).collect()
    }
}

impl App for Participant {
    fn handle(&mut self, event: Event) -> Vec<Command> {
        match event {
            Event::Opened(surroundings) => self.open(surroundings),
            Event::Frame(now_ms) => self.frame(now_ms),
            Event::Key { t_ms, key, down } => {
                self.now_ms = t_ms.max(self.now_ms);
                self.key(t_ms, &key, down);
                Vec::new()
            }
            Event::Blur(t_ms) => {
                self.held.clear();
                if let Stage::Driving(drive) = &mut self.stage {
                    drive.blur(t_ms);
                }
                Vec::new()
            }
            Event::Action { word, t_ms, .. } => {
                self.now_ms = t_ms.max(self.now_ms);
                self.act(&word)
            }
            Event::Answered(tag, answer) => self.answered(tag, &answer),
            Event::Woken => self.woken(),
            Event::Solving(..) => Vec::new(),
        }
    }

    fn view(&self) -> Node {
        view::page(self)
    }

    fn picture(&self) -> Option<Picture> {
        let study = self.study.as_ref()?;
        let leg = self.next()?;
        let (state, step) = match &self.stage {
            Stage::Still(_) => (leg.planned.scene().start(), 0),
            Stage::Driving(drive) => (drive.state_at(self.now_ms), drive.step_at(self.now_ms)),
            _ => return None,
        };
        let zone = leg.show_danger_zone.then_some(study.parameters.danger_radius_m);
        Some(Picture {
            canvas: "scene",
            window: window(&leg.planned.scene(), state),
            shapes: shapes(&leg.planned.scene(), state, zone),
            attributes: vec![
                ("data-step", step.to_string()),
                ("data-phase", leg.phase.word().to_owned()),
                ("data-trial", leg.planned.trial_id.clone()),
            ],
        })
    }

    fn wants_frames(&self) -> bool {
        matches!(self.stage, Stage::Still(_) | Stage::Driving(_))
    }

    fn owns_key(&self, key: &str) -> bool {
        self.wants_frames() && (turn_of_key(key).is_some() || key == " ")
    }

    fn frame_took(&mut self, ms: f64) {
        if let Stage::Driving(drive) = &mut self.stage {
            drive.frame_took(ms);
        }
    }
}

/// What a participant sees of a scene.
fn shapes(scene: &Scene, state: JointState, danger_radius_m: Option<f64>) -> Vec<Shape> {
    let zone = danger_radius_m.map(|radius| stage::danger_zone(state.robot, radius));
    zone.into_iter().chain(stage::vehicles_and_goal(scene, state)).collect()
}

/// The same view for every scene; it widens only where a vehicle would leave it.
fn window(scene: &Scene, state: JointState) -> Window {
    let human = state.human.position();
    let fixed = [scene.human.position(), scene.robot.position(), scene.goal, human];
    fixed.into_iter().fold(Window::square(WINDOW_HALF_M), |window, p| window.including(p, 2.5))
}

#[cfg(test)]
mod tests;
