//! A whole participation without a browser.

use super::Participant;
use crate::runtime::{Address, Event, NotKept, Page, PageContext};
use crate::testing;
use sidestep::api::{
    Admission, Completed, Enrolled, Enrolment, Plan, PlannedPhase, PlannedScene, Problem, Progress,
    StudyInfo, TrialStored, TrialUpload, routes,
};
use sidestep::scene::{EncounterRange, SceneParameters, generate};
use sidestep::study::StudyConfig;
use sidestep::trial::{Phase, verify};
use sidestep::vehicle::TurnInput;
use std::collections::BTreeMap;

type Session = testing::Session<Participant>;

fn plan() -> Plan {
    let scenes = generate(&SceneParameters::default(), &EncounterRange::default(), 2, 8).unwrap();
    let planned = |(index, (scene, _)): (usize, (sidestep::scene::Scene, _))| PlannedScene {
        trial_id: format!("t{index}"),
        index,
        attempt: 1,
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
        return_url: None,
        complete: false,
        understood: true,
        answered: true,
        pilot: false,
        may_withdraw: true,
    }
}

/// The page of a participant in a browser that has kept this, once the study is shown.
fn open(kept: BTreeMap<String, String>, study: StudyConfig) -> Session {
    let context = PageContext {
        address: Address { path: "/s/default".into(), ..Address::default() },
        kept: kept.clone().into_iter().collect(),
        time_origin_ms: 1.7e12,
        random_name: Some("0123456789abcdef".into()),
        ..PageContext::default()
    };
    let mut session = Session::new(Participant::open(context), kept);
    let info = StudyInfo::of(&study, Admission::Open);
    session.send("study", 200, &info);
    session
}

/// The same in a fresh browser.
fn welcomed() -> Session {
    open(BTreeMap::new(), StudyConfig::default())
}

/// After the instructions.
fn begun() -> Session {
    let mut session = welcomed();
    session.begin();
    session
}

impl Session {
    fn begin(&mut self) {
        self.instructed();
        self.press("continue");
    }

    /// To the instructions.
    fn instructed(&mut self) {
        self.press("consent");
        self.send("enrol", 201, &enrolled());
        self.send("progress", 200, &progress(&[]));
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
                    let frame_ms = std::mem::replace(&mut self.now_ms, begun + at);
                    self.hear(&key("ArrowLeft", down));
                    self.now_ms = frame_ms;
                }
            }
            self.frame();
            assert!(self.now_ms < begun + 20_000.0, "the scene does not end");
        }
    }

    /// The upload that is on its way, which must be that of this trial.
    fn uploaded(&self, id: &str) -> TrialUpload {
        let request = self.asked.iter().find(|request| request.name == "upload").unwrap();
        assert_eq!(request.url, routes::my_trial(id));
        assert_eq!((request.method, request.token.as_deref()), ("PUT", Some("secret")));
        serde_json::from_str(request.body.as_ref().unwrap()).unwrap()
    }

    fn stored(&mut self, id: &str) {
        self.uploaded(id);
        let stored = TrialStored { trial_id: id.into(), next: None };
        self.send("upload", 201, &stored);
    }

    /// The completion code comes.
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
    Problem { code: code.into(), message: format!("{code} it is"), field: None }
}

#[test]
fn from_consent_to_the_code() {
    let mut session = begun();
    session.drive();
    let trial = session.uploaded("t0");
    let parameters = SceneParameters::default();
    trial.check(&parameters).unwrap();
    let start = plan().phases[0].scenes[0].scene().start();
    assert!(verify(&parameters, start, &trial.inputs, &trial.states).exact);
    let lefts: Vec<_> = (0..50).filter(|&i| trial.inputs[i] == TurnInput::Left).collect();
    assert_eq!(lefts, (15..25).collect::<Vec<_>>(), "held from 3 s to 5 s");
    session.stored("t0");
    assert!(session.text().contains("✓ saved"));
    session.drive();
    assert!(session.text().contains("Uploading your last scenes"));
    session.stored("t1");
    session.completed();
    assert_eq!(session.kept.keys().collect::<Vec<_>>(), ["sidestep.session.default"]);
}

#[test]
fn a_reload_sends_what_waits_and_goes_on() {
    let mut session = begun();
    session.drive();
    session.unreachable("upload");
    assert_eq!(session.timers.len(), 1);
    assert!(session.text().contains("1 scene not uploaded yet; it is safe in this browser."));
    let mut session = open(session.kept, StudyConfig::default());
    session.send("progress", 200, &progress(&[]));
    session.stored("t0");
    assert!(session.text().contains("Task 2 of 2"), "{}", session.text());
}

#[test]
fn an_upload_is_tried_again_after_a_pause_or_when_the_network_is_back() {
    let mut session = begun();
    session.drive();
    session.unreachable("upload");
    assert!(session.asked.is_empty());
    session.wake("upload-retry");
    session.unreachable("upload");
    session.hear(&Event::Online);
    session.stored("t0");
}

#[test]
fn a_server_that_forgot_us_lets_us_begin_afresh() {
    let session = begun();
    let mut session = open(session.kept, StudyConfig::default());
    session.send("progress", 401, &refusal("unauthorised"));
    assert!(session.words("consent").is_some());
    assert!(session.kept.is_empty());
}

#[test]
fn a_failing_server_is_asked_again() {
    let mut session = welcomed();
    // Whether the first enrolment was stored is not known: the second has the same name.
    let mut names = Vec::new();
    for status in [503, 201] {
        session.press("consent");
        let body = session.asked[0].body.clone().unwrap();
        names.push(serde_json::from_str::<Enrolment>(&body).unwrap().request_id.unwrap());
        match status {
            503 => session.send("enrol", 503, &refusal("storage")),
            _ => session.send("enrol", 201, &enrolled()),
        }
    }
    assert_eq!(names, ["0123456789abcdef"; 2]);
    session.send("progress", 503, &refusal("storage"));
    session.wake("retry");
    session.send("progress", 200, &progress(&["t0", "t1"]));
    session.unreachable("complete");
    session.wake("retry");
    session.completed();
}

#[test]
fn a_study_that_takes_nobody_says_so() {
    let mut session = welcomed();
    session.press("consent");
    session.send("enrol", 403, &refusal("closed"));
    assert!(session.words("stuck").is_some());
}

#[test]
fn leaving_the_window_releases_the_keys() {
    let mut session = begun();
    session.press("start");
    session.at(100.0).hear(&key("KeyD", true));
    session.at(900.0).frame();
    session.at(2850.0).hear(&Event::FocusLost { hidden: false });
    session.at(11_000.0).frame();
    let trial = session.uploaded("t0");
    let rights = trial.inputs.iter().filter(|&&input| input == TurnInput::Right).count();
    assert_eq!(rights, 11, "steps 0 to 10 began before the window was left at 2.05 s");
    assert_eq!(trial.key_events.last().unwrap().key, "blur");
}

#[test]
fn a_refused_trial_is_driven_again_and_the_code_comes() {
    let mut session = begun();
    session.drive();
    session.stored("t0");
    session.drive();
    session.send("upload", 422, &refusal("invalid"));
    assert!(session.asked.is_empty(), "no code is asked for while a trial is missing");
    assert!(session.text().contains("did not accept this scene. Invalid it is."));
    assert!(session.kept.contains_key("sidestep.refused.p.t1"));
    session.drive();
    session.stored("t1");
    session.completed();
}

#[test]
fn a_trial_that_is_refused_twice_ends_with_its_reason() {
    let mut session = begun();
    for _ in 0..2 {
        session.drive();
        session.send("upload", 422, &refusal("invalid"));
    }
    assert!(session.words("stuck").unwrap().contains("Invalid it is."));
}

#[test]
fn a_refusal_during_the_next_scene_leaves_that_one_alone() {
    let mut session = begun();
    session.drive();
    session.press("start");
    let driven = session.picture().unwrap().attributes;
    session.send("upload", 422, &refusal("invalid"));
    assert_eq!(session.picture().unwrap().attributes, driven);
    session.at(session.now_ms + 900.0).frame();
    session.at(session.now_ms + 11_000.0).frame();
    assert!(session.kept.contains_key("sidestep.outbox.p.t1"));
    // The first is driven again, and both are sent in order.
    session.drive();
    session.stored("t0");
    session.stored("t1");
    session.completed();
}

#[test]
fn a_scene_of_another_tab_counts() {
    let mut session = begun();
    session.drive();
    session.send("upload", 409, &refusal("different_content"));
    let words = "You already completed this scene in another tab; that version was kept.";
    assert!(session.text().contains(words));
    assert!(session.text().contains("Task 2 of 2"));
    session.drive();
    session.stored("t1");
    session.completed();
}

#[test]
fn a_server_that_lacks_trials_says_which() {
    let mut session = welcomed();
    session.press("consent");
    session.send("enrol", 201, &enrolled());
    session.send("progress", 200, &progress(&["t0", "t1"]));
    session.send("complete", 409, &refusal("incomplete"));
    session.send("progress", 200, &progress(&["t0"]));
    assert!(session.text().contains("Task 2 of 2"), "{}", session.text());
    session.drive();
    session.send("upload", 409, &refusal("out_of_order"));
    session.send("progress", 200, &progress(&["t0"]));
    session.wake("upload-retry");
    session.stored("t1");
    // Once is enough: a server that goes on saying so is not asked for ever.
    session.send("complete", 409, &refusal("incomplete"));
    assert!(session.words("stuck").is_some());
}

#[test]
fn a_browser_that_keeps_nothing_says_so_and_goes_on() {
    for reason in [NotKept::Full, NotKept::Denied] {
        let mut session = welcomed();
        session.refuses = Some(reason);
        session.begin();
        let told = session.words("not-kept").unwrap();
        assert!(told.contains(reason.sentence()) && told.contains("Keep this page open"));
        session.drive();
        session.unreachable("upload");
        assert!(session.text().contains("1 scene not uploaded yet; keep this page open."));
        session.wake("upload-retry");
        session.stored("t0");
        session.drive();
        session.stored("t1");
        session.completed();
        assert!(session.words("not-kept").is_none());
    }
}

#[test]
fn the_consent_button_waits_for_a_press_of_its_own() {
    let session = welcomed();
    let view = session.page.view();
    assert!(!view.find("consent").unwrap().takes_focus);
}

#[test]
fn the_instructions_are_those_of_the_study() {
    let words = |study: StudyConfig| {
        let mut session = open(BTreeMap::new(), study);
        session.instructed();
        session.text()
    };
    let paper = words(StudyConfig::default());
    assert!(paper.contains("A scene takes 10 seconds."), "{paper}");
    assert!(paper.contains("The warm-up scenes show it"), "{paper}");
    let mut study = StudyConfig::default();
    study.parameters.steps = 40;
    study.phases.retain(|phase| phase.phase == Phase::Task);
    let other = words(study);
    assert!(other.contains("A scene takes 8 seconds."), "{other}");
    assert!(other.contains("the scenes do not"), "{other}");
}
