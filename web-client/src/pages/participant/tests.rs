//! A whole participation without a browser: events in, commands out.

use super::Participant;
use crate::runtime::{Answer, App, Command, Event, Request, Surroundings, Tag};
use sidestep::api::{
    Completed, Enrolled, Plan, PlannedPhase, PlannedScene, Problem, Progress, SCHEMA_VERSION,
    StudyInfo, TrialUpload,
};
use sidestep::scene::{EncounterRange, SceneParameters, generate};
use sidestep::study::StudyConfig;
use sidestep::trial::{Phase, verify};
use sidestep::vehicle::TurnInput;
use std::collections::BTreeMap;

/// A participant's browser with a server of few lines.
struct Session {
    page: Participant,
    kept: BTreeMap<String, String>,
    asked: Vec<Request>,
    woken: usize,
    now_ms: f64,
}

fn plan() -> Plan {
    let scenes = generate(&SceneParameters::default(), &EncounterRange::default(), 2, 8).unwrap();
    let planned = |(index, (scene, _)): (usize, (sidestep::scene::Scene, _))| PlannedScene {
        trial_id: format!("t{index}"),
        index,
        human: scene.human,
        robot: scene.robot,
        goal: scene.goal,
    };
    let scenes = scenes.into_iter().enumerate().map(planned).collect();
    Plan { phases: vec![PlannedPhase { phase: Phase::Task, show_danger_zone: false, scenes }] }
}

fn progress(stored: &[&str]) -> Progress {
    Progress {
        participant_id: "p".into(),
        study: "default".into(),
        plan: plan(),
        stored: stored.iter().map(|id| (*id).to_owned()).collect(),
        next: None,
        completion_code: None,
    }
}

impl Session {
    fn open(kept: BTreeMap<String, String>) -> Self {
        let page = Participant::new();
        let mut session = Self { page, kept, asked: Vec::new(), woken: 0, now_ms: 0.0 };
        let surroundings = Surroundings {
            path: "/s/default".into(),
            kept: session.kept.clone().into_iter().collect(),
            time_origin_ms: 1.7e12,
            ..Surroundings::default()
        };
        session.tell(Event::Opened(surroundings));
        let study = StudyConfig::default();
        let info = StudyInfo {
            schema_version: SCHEMA_VERSION,
            slug: study.slug,
            title: study.title,
            parameters: study.parameters,
            phases: study.phases,
        };
        session.answer(Tag::Study, 200, &info);
        session
    }

    fn tell(&mut self, event: Event) {
        for command in self.page.handle(event) {
            match command {
                Command::Send(request) => self.asked.push(request),
                Command::Keep(name, text) => drop(self.kept.insert(name, text)),
                Command::Forget(name) => drop(self.kept.remove(&name)),
                Command::WakeAfter(_) => self.woken += 1,
                Command::ReplaceAddress(_) | Command::GoTo(_) => panic!("a participant stays"),
                Command::Solve { .. } | Command::StopSolving => panic!("no safety levels here"),
            }
        }
    }

    fn asked_for(&mut self, tag: &Tag) -> Request {
        let at = self.asked.iter().position(|request| request.tag == *tag);
        let at = at.unwrap_or_else(|| panic!("{tag:?} was not asked for: {:?}", self.asked));
        self.asked.remove(at)
    }

    fn answer(&mut self, tag: Tag, status: u16, body: &impl serde::Serialize) {
        self.asked_for(&tag);
        let body = serde_json::to_vec(body).unwrap();
        self.tell(Event::Answered(tag, Answer::Received { status, body }));
    }

    fn press(&mut self, word: &str) {
        assert!(self.page.view().find(word).is_some(), "no {word} in: {}", self.words());
        let t_ms = self.now_ms;
        self.tell(Event::Action { word: word.into(), value: String::new(), t_ms });
    }

    fn words(&self) -> String {
        self.page.view().words()
    }

    fn begin(&mut self) {
        self.press("consent");
        let enrolled =
            Enrolled { participant_id: "p".into(), token: "secret".into(), plan: plan() };
        self.answer(Tag::Enrol, 201, &enrolled);
        self.answer(Tag::Me, 200, &progress(&[]));
        self.press("continue");
    }

    /// Drives a scene with the left key held from 3 s to 5 s.
    fn drive(&mut self) {
        self.press("start");
        let begun = self.now_ms;
        while self.page.wants_frames() {
            let before = self.now_ms;
            self.now_ms += 16.0;
            for (at, down) in [(3800.0, true), (5800.0, false)] {
                if (before..self.now_ms).contains(&(begun + at)) {
                    let t_ms = begun + at;
                    self.tell(Event::Key { t_ms, key: "ArrowLeft".into(), down });
                }
            }
            self.tell(Event::Frame(self.now_ms));
            assert!(self.now_ms < begun + 20_000.0, "the scene does not end");
        }
    }

    fn uploaded(&mut self, id: &str) -> TrialUpload {
        let request = self.asked_for(&Tag::Upload(id.into()));
        assert_eq!((request.method, request.token.as_deref()), ("PUT", Some("secret")));
        serde_json::from_str(&request.body.unwrap()).unwrap()
    }

    fn stored(&mut self, id: &str) {
        let body = br#"{"trial_id":"x","next":null}"#.to_vec();
        self.tell(Event::Answered(Tag::Upload(id.into()), Answer::Received { status: 201, body }));
    }
}

fn refusal(code: &str) -> Problem {
    Problem { code: code.into(), message: format!("{code} it is"), field: None }
}

#[test]
fn from_consent_to_the_code() {
    let mut session = Session::open(BTreeMap::new());
    session.begin();
    session.drive();
    let trial = session.uploaded("t0");
    let parameters = SceneParameters::default();
    trial.check(&parameters).unwrap();
    let start = plan().phases[0].scenes[0].scene().start();
    assert!(verify(&parameters, start, &trial.inputs, &trial.states).exact);
    let lefts: Vec<_> = (0..50).filter(|&i| trial.inputs[i] == TurnInput::Left).collect();
    assert_eq!(lefts, (15..25).collect::<Vec<_>>(), "held from 3 s to 5 s");
    session.stored("t0");
    assert!(session.words().contains("✓ saved"));
    session.drive();
    session.uploaded("t1");
    assert!(session.words().contains("Sending your last scenes"));
    session.stored("t1");
    session.answer(Tag::Complete, 200, &Completed { completion_code: "ABC".into() });
    assert!(session.words().contains("ABC"));
    assert_eq!(session.kept.keys().collect::<Vec<_>>(), ["sidestep.session.default"]);
}

#[test]
fn a_reload_sends_what_waits_and_goes_on() {
    let mut session = Session::open(BTreeMap::new());
    session.begin();
    session.drive();
    session.uploaded("t0");
    session.tell(Event::Answered(Tag::Upload("t0".into()), Answer::Unreachable));
    assert_eq!(session.woken, 1);
    assert!(session.words().contains("1 scene waits"));
    let mut session = Session::open(session.kept);
    session.answer(Tag::Me, 200, &progress(&[]));
    session.uploaded("t0");
    session.stored("t0");
    assert!(session.words().contains("Task 2 of 2"), "{}", session.words());
}

#[test]
fn a_server_that_forgot_us_lets_us_begin_afresh() {
    let mut session = Session::open(BTreeMap::new());
    session.begin();
    let mut session = Session::open(session.kept);
    session.answer(Tag::Me, 401, &refusal("unauthorised"));
    assert!(session.page.view().find("consent").is_some());
    assert!(session.kept.is_empty());
}

#[test]
fn a_failing_server_is_asked_again() {
    let mut session = Session::open(BTreeMap::new());
    session.press("consent");
    session.answer(Tag::Enrol, 503, &refusal("storage"));
    assert!(session.words().contains("storage it is"));
    session.press("consent");
    session.answer(Tag::Enrol, 403, &refusal("closed"));
    assert!(session.page.view().find("stuck").is_some());
}

#[test]
fn leaving_the_window_releases_the_keys() {
    let mut session = Session::open(BTreeMap::new());
    session.begin();
    session.press("start");
    session.tell(Event::Key { t_ms: 100.0, key: "d".into(), down: true });
    session.tell(Event::Frame(900.0));
    session.tell(Event::Blur(2850.0));
    session.tell(Event::Frame(11_000.0));
    let trial = session.uploaded("t0");
    let rights = trial.inputs.iter().filter(|&&input| input == TurnInput::Right).count();
    assert_eq!(rights, 11, "steps 0 to 10 began before the window was left at 2.05 s");
    assert_eq!(trial.key_events.last().unwrap().key, "blur");
}
