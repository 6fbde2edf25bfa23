//! Tests of a whole participation without a browser.

mod answers;
mod driving;
mod faults;
mod joining;
mod sending;

use super::{Msg, Participant};
use crate::form::{FieldValue, Form};
use crate::runtime::{Address, Event, NotKept, Page, PageContext};
use crate::testing;
use crate::view::{Child, Node};
use sidestep::api::{
    Admission, Answers, CheckForm, Completed, ComprehensionResult, ComprehensionStored, Enrolled,
    Enrolment, Language, Object, Plan, PlannedPhase, PlannedScene, Problem, Progress, QuestionForm,
    StudyInfo, Texts, TrialStored, TrialUpload, Withdrawn, routes,
};
use sidestep::scene::{EncounterRange, SceneParameters, generate};
use sidestep::study::{AfterWrong, QuestionKind, Recruitment, Status, StudyConfig};
use sidestep::trial::{PageEventKind, Phase, verify};
use sidestep::vehicle::TurnInput;
use std::collections::BTreeMap;

type Session = testing::Session<Participant>;

/// The texts of the English language file, without any texts that belong to a study.
fn texts() -> Texts {
    let file = include_str!("../../../../static/languages/en.toml");
    let tables: BTreeMap<String, toml::Table> = toml::from_str(file).unwrap();
    let mut sentences = Object::default();
    for (table, entries) in tables {
        let mut waiting: Vec<_> =
            entries.into_iter().map(|(key, value)| (format!("{table}.{key}"), value)).collect();
        while let Some((key, value)) = waiting.pop() {
            match value {
                toml::Value::Table(forms) => {
                    let form = |(form, value)| (format!("{key}.{form}"), value);
                    waiting.extend(forms.into_iter().map(form));
                }
                value => sentences.insert(key, value.as_str().unwrap().to_owned()),
            }
        }
    }
    let language = |tag: &str, name: &str| Language { tag: tag.into(), name: name.into() };
    let offered = vec![language("en", "English"), language("de", "Deutsch")];
    Texts { language: "en".into(), offered, sentences, ..Texts::default() }
}

fn plan() -> Plan {
    let scenes = generate(&SceneParameters::default(), &EncounterRange::default(), 2, 8).unwrap();
    let planned = |(index, (scene, _)): (usize, (sidestep::scene::Scene, _))| PlannedScene {
        trial_id: format!("t{index}"),
        index,
        attempt: 1,
        human: scene.human,
        robot: scene.robot,
        goal: scene.goal,
        policy: scene.policy,
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
        return_url: None,
        complete: false,
        understood: true,
        comprehension_attempts: 0,
        answered: true,
        pilot: false,
        may_withdraw: true,
    }
}

/// The browser in which the page opens.
fn context(kept: &BTreeMap<String, String>, link: &str) -> PageContext {
    let (query, fragment) = link.split_once('#').unwrap_or((link, ""));
    let pairs = query.split('&').filter(|pair| !pair.is_empty());
    let pair = |pair: &str| {
        let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
        (name.to_owned(), value.to_owned())
    };
    PageContext {
        address: Address {
            origin: "https://lab.example".into(),
            path: "/s/default".into(),
            query: pairs.map(pair).collect(),
            fragment: fragment.to_owned(),
            ..Address::default()
        },
        kept: kept.clone().into_iter().collect(),
        time_origin_ms: 1.7e12,
        random_name: Some("0123456789abcdef".into()),
        ..PageContext::default()
    }
}

/// Opens the page in a browser that has stored `kept`. The server has not answered yet.
fn opened(kept: BTreeMap<String, String>, link: &str) -> Session {
    Session::new(Participant::open(context(&kept, link)), kept)
}

/// Opens the page in a browser that has stored `kept`, and loads the study and the texts.
fn open(kept: BTreeMap<String, String>, study: &StudyConfig) -> Session {
    open_at(kept, study, "")
}

fn open_at(kept: BTreeMap<String, String>, study: &StudyConfig, link: &str) -> Session {
    let mut session = opened(kept, link);
    // The study can be requested twice: a participant who has begun requests the version in which
    // they enrolled, and a person with an external id asks whether they can take part.
    while session.asked.iter().any(|request| request.name == "study") {
        session.send("study", 200, &StudyInfo::of(study, study.status.into()));
        if session.asked.iter().any(|request| request.name == "texts") {
            session.send("texts", 200, &texts());
        }
    }
    session
}

/// Opens the page in a browser that has stored nothing.
fn welcomed() -> Session {
    open(BTreeMap::new(), &StudyConfig::default())
}

/// A session in which the instructions are completed.
fn begun() -> Session {
    let mut session = welcomed();
    session.begin();
    session
}

/// Duration of the countdown of a scene (ms).
const COUNTDOWN_MS: f64 = 3000.0;

impl Session {
    fn begin(&mut self) {
        self.instructed();
        self.press("continue");
    }

    /// Continues to the instructions.
    fn instructed(&mut self) {
        self.equipped();
        self.press("continue");
        self.send("enrol", 201, &enrolled());
        self.send("progress", 200, &progress(&[]));
    }

    /// Consents, and completes the check of keyboard and screen.
    fn equipped(&mut self) {
        self.press("consent");
        for code in ["ArrowLeft", "KeyD"] {
            self.hear(&key(code, true));
            self.hear(&key(code, false));
        }
        for _ in 0..70 {
            self.at(self.now_ms + 16.0).frame();
        }
    }

    /// Drives a scene with the left key down from 3 s to 5 s, and waits until the end of the scene
    /// was shown.
    fn drive(&mut self) {
        self.press("start");
        let begun = self.now_ms + COUNTDOWN_MS;
        let mut events = vec![(begun + 5000.0, false), (begun + 3000.0, true)];
        while self.page.wants_frames() {
            let now_ms = self.now_ms + 16.0;
            while let Some((at_ms, down)) = events.pop_if(|(at_ms, _)| *at_ms <= now_ms) {
                self.at(at_ms).hear(&key("ArrowLeft", down));
            }
            self.at(now_ms).frame();
            assert!(self.now_ms < begun + 20_000.0, "the scene does not end");
        }
    }

    /// Advances the clock by this duration while frames are shown.
    fn pass(&mut self, ms: f64) {
        let until = self.now_ms + ms;
        while self.now_ms < until {
            self.at((self.now_ms + 16.0).min(until)).frame();
        }
    }

    /// The pending upload, which must contain this trial.
    fn uploaded(&self, id: &str) -> TrialUpload {
        let request = self.asked.iter().find(|request| request.name == "upload").unwrap();
        assert_eq!(request.url.split('?').next(), Some(&*routes::my_trial(id)));
        assert_eq!((request.method, request.token.as_deref()), ("PUT", Some("secret")));
        serde_json::from_str(request.body.as_ref().unwrap()).unwrap()
    }

    fn stored(&mut self, id: &str) {
        self.uploaded(id);
        let stored = TrialStored { trial_id: id.into(), next: None };
        self.send("upload", 201, &stored);
    }

    /// Makes the server send the completion code.
    fn completed(&mut self) {
        self.send("complete", 200, &Completed { completion_code: "ABC".into(), return_url: None });
        assert!(self.text().contains("ABC"));
    }
}

fn key(code: &str, down: bool) -> Event {
    Event::Key { code: code.into(), key: String::new(), down }
}

fn enrolled() -> Enrolled {
    Enrolled { participant_id: "p".into(), token: "secret".into(), plan: plan() }
}

fn refusal(code: &str) -> Problem {
    Problem { code: code.into(), message: format!("{code} it is"), field: None, return_url: None }
}
