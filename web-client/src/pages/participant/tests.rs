//! A whole participation without a browser.

mod faults;

use super::{Msg, Participant};
use crate::form::{FieldValue, Form};
use crate::runtime::{Address, Event, NotKept, Page, PageContext};
use crate::testing;
use crate::view::{Child, Node};
use sidestep::api::{
    Answers, CheckForm, Completed, ComprehensionResult, ComprehensionStored, Enrolled, Enrolment,
    Language, Object, Plan, PlannedPhase, PlannedScene, Problem, Progress, QuestionForm, StudyInfo,
    Texts, TrialStored, TrialUpload, Withdrawn, routes,
};
use sidestep::scene::{EncounterRange, SceneParameters, generate};
use sidestep::study::{QuestionKind, Recruitment, Status, StudyConfig};
use sidestep::trial::{PageEventKind, Phase, verify};
use sidestep::vehicle::TurnInput;
use std::collections::BTreeMap;

type Session = testing::Session<Participant>;

/// The sentences of the English file, and nothing of the study's own.
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

/// The page before the server has answered, in a browser that has kept this.
fn opened(kept: BTreeMap<String, String>, link: &str) -> Session {
    let (query, fragment) = link.split_once('#').unwrap_or((link, ""));
    let pairs = query.split('&').filter(|pair| !pair.is_empty());
    let pair = |pair: &str| {
        let (name, value) = pair.split_once('=').unwrap_or((pair, ""));
        (name.to_owned(), value.to_owned())
    };
    let context = PageContext {
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
    };
    Session::new(Participant::open(context), kept)
}

/// The page of a participant in a browser that has kept this, once the study is shown.
fn open(kept: BTreeMap<String, String>, study: &StudyConfig) -> Session {
    open_at(kept, study, "")
}

fn open_at(kept: BTreeMap<String, String>, study: &StudyConfig, link: &str) -> Session {
    let mut session = opened(kept, link);
    // Somebody who has begun asks again, for the study as they began it.
    while session.asked.iter().any(|request| request.name == "study") {
        session.send("study", 200, &StudyInfo::of(study, study.status.into()));
        session.send("texts", 200, &texts());
    }
    session
}

/// The same in a fresh browser.
fn welcomed() -> Session {
    open(BTreeMap::new(), &StudyConfig::default())
}

/// After the instructions.
fn begun() -> Session {
    let mut session = welcomed();
    session.begin();
    session
}

/// The countdown of a scene, ms.
const COUNTDOWN_MS: f64 = 3000.0;

impl Session {
    fn begin(&mut self) {
        self.instructed();
        self.press("continue");
    }

    /// To the instructions.
    fn instructed(&mut self) {
        self.equipped();
        self.press("continue");
        self.send("enrol", 201, &enrolled());
        self.send("progress", 200, &progress(&[]));
    }

    /// Agrees, and shows that keyboard and screen are good.
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

    /// Drives a scene with the left key held from 3 s to 5 s, and waits until its end is shown.
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

    /// Lets time pass with frames.
    fn pass(&mut self, ms: f64) {
        let until = self.now_ms + ms;
        while self.now_ms < until {
            self.at((self.now_ms + 16.0).min(until)).frame();
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
    assert!(session.text().contains("✓ 1 scene stored"));
    session.drive();
    assert!(session.text().contains("Sending your last scenes"));
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
    assert!(session.text().contains("1 scene not sent yet; it is saved on this computer."));
    let mut session = open(session.kept, &StudyConfig::default());
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
    let mut session = open(session.kept, &StudyConfig::default());
    session.send("progress", 401, &refusal("unauthorised"));
    assert!(session.words("consent").is_some());
    assert!(session.kept.is_empty());
}

#[test]
fn a_failing_server_is_asked_again() {
    let mut session = welcomed();
    // Whether the first enrolment was stored is not known: the second has the same name.
    let mut names = Vec::new();
    session.equipped();
    session.press("continue");
    for status in [503, 201] {
        let body = session.asked[0].body.clone().unwrap();
        names.push(serde_json::from_str::<Enrolment>(&body).unwrap().request_id.unwrap());
        match status {
            503 => {
                session.send("enrol", 503, &refusal("storage"));
                assert!(session.page.view().press("continue").is_none(), "the page keeps trying");
                session.wake("retry");
            }
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
    for (status, words) in
        [(Status::Closed, "This study is closed"), (Status::Archived, "This study is over")]
    {
        let session = open(BTreeMap::new(), &StudyConfig { status, ..StudyConfig::default() });
        assert!(session.words("stuck").unwrap().contains(words));
    }
    // Somebody with an external id may have begun in another browser.
    let closed = StudyConfig { status: Status::Closed, ..StudyConfig::default() };
    let known = open_at(BTreeMap::new(), &closed, "external_id=P1");
    assert!(known.words("consent").is_some());
    // It was closed, or became full, while the participant read the consent text.
    for (code, words) in [("closed", "This study is closed"), ("full", "This study is full")] {
        let mut session = welcomed();
        session.equipped();
        session.press("continue");
        session.send("enrol", 403, &refusal(code));
        assert!(session.words("stuck").unwrap().contains(words));
    }
    let mut session = opened(BTreeMap::new(), "");
    session.send("texts", 404, &refusal("not_found"));
    assert!(
        session.words("stuck").unwrap().contains("Check the link")
            || session.words("stuck").unwrap().contains("check the link")
    );
}

#[test]
fn leaving_the_window_releases_the_keys() {
    let mut session = begun();
    session.press("start");
    session.pass(COUNTDOWN_MS);
    let begun = session.now_ms;
    session.at(begun + 1.0).hear(&key("KeyD", true));
    session.at(begun + 2050.0).hear(&Event::FocusLost { hidden: false });
    session.at(begun + 10_001.0).frame();
    let trial = session.uploaded("t0");
    let rights = trial.inputs.iter().filter(|&&input| input == TurnInput::Right).count();
    assert_eq!(rights, 10, "steps 1 to 10 began before the window was left at 2.05 s");
    assert_eq!(trial.key_events.last().unwrap().key, "blur");
    assert_eq!(trial.page_events[0].kind, PageEventKind::FocusLost);
    session.pass(1000.0);
    assert!(session.words("hint").unwrap().contains("another window or tab"));
}

#[test]
fn a_refused_trial_is_driven_again_and_the_code_comes() {
    let mut session = begun();
    session.drive();
    session.stored("t0");
    session.drive();
    session.send("upload", 422, &refusal("invalid"));
    assert!(session.asked.is_empty(), "no code is asked for while a trial is missing");
    assert!(session.text().contains("did not accept this scene: Invalid it is."));
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
    session.pass(COUNTDOWN_MS + 11_000.0);
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
    let words = "You already completed this scene in another tab or on another computer";
    assert!(session.text().contains(words));
    assert!(session.text().contains("Task 2 of 2"));
    session.drive();
    session.stored("t1");
    session.completed();
}

#[test]
fn a_server_that_lacks_trials_says_which() {
    let mut session = welcomed();
    session.equipped();
    session.press("continue");
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
        assert!(told.contains("Keep this page open"));
        session.drive();
        session.unreachable("upload");
        assert!(session.text().contains("1 scene not sent yet; keep this page open."));
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
        let mut session = open(BTreeMap::new(), &study);
        session.instructed();
        session.text()
    };
    let paper = words(StudyConfig::default());
    assert!(paper.contains("A scene takes 10 seconds."), "{paper}");
    assert!(paper.contains("You see it during the warm-up only."), "{paper}");
    let mut study = StudyConfig::default();
    study.parameters.steps = 40;
    study.phases.retain(|phase| phase.phase == Phase::Task);
    let other = words(study);
    assert!(other.contains("A scene takes 8 seconds."), "{other}");
    assert!(other.contains("the scenes do not"), "{other}");
}

#[test]
fn a_key_press_comes_before_the_enrolment() {
    let mut session = welcomed();
    session.press("consent");
    session.pass(2000.0);
    assert!(session.page.view().press("continue").is_none(), "no key was pressed");
    session.hear(&key("ArrowLeft", true));
    session.hear(&key("ArrowRight", true));
    assert!(session.page.view().press("continue").is_some());
    assert!(session.asked.is_empty(), "nobody is enrolled yet");
}

#[test]
fn other_keys_can_steer() {
    let mut session = welcomed();
    session.press("consent");
    session.press("choose-keys");
    let press =
        |code: &str, key: &str| Event::Key { code: code.into(), key: key.into(), down: true };
    for (code, printed) in [("Space", " "), ("KeyJ", "j"), ("KeyJ", "j"), ("KeyL", "l")] {
        session.hear(&press(code, printed));
    }
    assert!(session.text().contains('J') && session.text().contains('L'));
    session.hear(&press("KeyJ", "j"));
    session.hear(&press("KeyL", "l"));
    session.pass(2000.0);
    assert!(session.page.view().press("continue").is_some());
    assert!(session.kept["sidestep.keys"].contains("KeyJ"));
    assert!(session.page.hear(&key("ArrowLeft", true)).is_none(), "the arrows steer no longer");
}

#[test]
fn a_device_without_a_keyboard_is_told_before_consent() {
    let mut session = opened(BTreeMap::new(), "");
    session.page.context.touch_only = true;
    session.send("texts", 200, &texts());
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    assert!(session.words("touch").unwrap().contains("https://lab.example/s/default"));
    session.press("anyway");
    assert!(session.words("consent").is_some());
}

#[test]
fn a_scene_waits_until_the_keys_are_up() {
    let mut session = begun();
    session.hear(&key("KeyA", true));
    session.press("start");
    assert!(session.words("hint").unwrap().contains("Let go of all keys"));
    session.hear(&key("KeyA", false));
    session.press("start");
    session.pass(1000.0);
    session.hear(&key("KeyA", true));
    session.pass(5000.0);
    assert!(session.words("countdown").unwrap().contains("Let go of all keys"));
    session.hear(&key("KeyA", false));
    assert_eq!(session.words("countdown").as_deref(), Some("1"));
    session.pass(999.0);
    assert!(session.words("countdown").is_some());
    session.pass(10.0);
    assert_eq!(session.words("countdown"), None);
    session.pass(10_000.0);
    let trial = session.uploaded("t0");
    assert!(trial.inputs.iter().all(|&input| input == TurnInput::Straight));
}

#[test]
fn the_countdown_counts_and_waits_for_the_window() {
    let mut session = begun();
    session.press("start");
    for second in ["3", "2", "1"] {
        assert_eq!(session.words("countdown").as_deref(), Some(second));
        session.pass(1000.0);
    }
    assert_eq!(session.words("countdown"), None);
    let mut session = begun();
    session.press("start");
    session.pass(500.0);
    session.hear(&Event::FocusLost { hidden: true });
    assert!(session.words("start").is_some());
}

#[test]
fn a_scene_that_is_shown_again_counts_its_exposures() {
    let mut session = begun();
    session.press("start");
    session.pass(COUNTDOWN_MS + 2000.0);
    let mut session = open(session.kept, &StudyConfig::default());
    session.send("progress", 200, &progress(&[]));
    session.drive();
    assert_eq!(session.uploaded("t0").exposures, 2);
    session.stored("t0");
    assert!(!session.kept.keys().any(|name| name.contains("exposures")));
    session.drive();
    assert_eq!(session.uploaded("t1").exposures, 1);
}

#[test]
fn the_later_tab_takes_over() {
    let mut session = begun();
    assert_eq!(session.claims.last().unwrap(), "sidestep.p");
    session.press("start");
    session.pass(COUNTDOWN_MS + 2000.0);
    session.hear(&Event::TakenOver);
    assert!(session.words("elsewhere").unwrap().contains("another tab"));
    session.pass(12_000.0);
    assert!(session.asked.is_empty(), "the later tab drives and sends");
    session.press("here");
    assert_eq!(session.left.as_deref(), Some("/s/default"));
}

#[test]
fn leaving_warns_while_something_is_not_sent() {
    let mut session = begun();
    assert!(!session.guarded);
    session.drive();
    assert!(session.guarded);
    session.stored("t0");
    assert!(!session.guarded);
}

#[test]
fn understanding_is_checked_before_the_scenes() {
    let mut study = StudyConfig::default();
    study.comprehension.attempts = 3;
    let mut session = opened(BTreeMap::new(), "");
    let check = |answer| CheckForm {
        text: "Keep out of {radius} m?".into(),
        options: vec!["Yes".into(), "No".into()],
        answer,
    };
    session.send("study", 200, &StudyInfo::of(&study, Status::Open.into()));
    session.send("texts", 200, &Texts { check: vec![check(0), check(1)], ..texts() });
    session.equipped();
    session.press("continue");
    session.send("enrol", 201, &enrolled());
    session.send("progress", 200, &Progress { understood: false, ..progress(&[]) });
    session.press("continue");
    assert!(session.text().contains("Keep out of 3 m?"));
    let answer = |session: &mut Session, answers: [&str; 2]| {
        let field = |(place, value): (usize, &&str)| {
            (!value.is_empty())
                .then(|| (format!("check-{place}"), FieldValue::Text((*value).into())))
        };
        let fields = answers.iter().enumerate().filter_map(field).collect();
        let message = session.page.view().submit("comprehension", Form::new(fields));
        session.tell(message.unwrap());
    };
    let sent = |session: &Session| {
        let request = session.asked.iter().find(|request| request.name == "check")?;
        serde_json::from_str::<ComprehensionResult>(request.body.as_ref().unwrap()).ok()
    };
    answer(&mut session, ["0", ""]);
    assert!(session.words("missing").is_some() && sent(&session).is_none());
    assert_eq!(marked(&session, "comprehension"), [false, true]);
    let open = ComprehensionStored { screened_out: false, return_url: None };
    answer(&mut session, ["0", "0"]);
    assert_eq!(sent(&session), Some(ComprehensionResult { attempts: 1, passed: false }));
    session.send("check", 200, &open);
    assert!(session.text().contains("Please choose another answer."));
    assert!(session.text().contains("You can try 2 more times."));
    // Another look at the instructions brings no attempt back.
    session.press("again");
    session.press("continue");
    assert!(session.text().contains("You can try 2 more times."));
    assert!(!session.text().contains("Please choose another answer."));
    answer(&mut session, ["0", "1"]);
    assert_eq!(sent(&session), Some(ComprehensionResult { attempts: 2, passed: true }));
    assert!(session.page.view().press("continue").is_none(), "it is not stored yet");
    session.send("check", 200, &open);
    assert!(session.text().starts_with("You can begin"), "{}", session.text());
    session.press("continue");
    assert!(session.words("start").is_some());
}

/// Which questions of a form are marked because they lack an answer.
fn marked(session: &Session, form: &str) -> Vec<bool> {
    let view = session.page.view();
    let questions = view.find(form).unwrap().children.iter().filter_map(|child| match child {
        Child::Node(node) if matches!(node.tag, "fieldset" | "div") => Some(node),
        _ => None,
    });
    let is_marked =
        |question: &Node<Msg>| question.words().contains("Please answer this question.");
    questions.map(is_marked).collect()
}

#[test]
fn somebody_who_is_screened_out_is_sent_back() {
    let mut session = begun();
    let stored = ComprehensionStored { screened_out: true, return_url: Some("https://r/".into()) };
    let answer = serde_json::to_vec(&stored).unwrap();
    session.tell(Msg::Understood(Ok(answer)));
    assert!(session.words("ended").unwrap().contains("You cannot take part"));
    let view = session.page.view();
    assert_eq!(view.find("return").unwrap().attribute("href"), Some("https://r/"));
}

#[test]
fn questions_come_after_the_scenes() {
    let question = |name: &str, kind, required| QuestionForm {
        name: name.into(),
        kind,
        text: name.into(),
        required,
        options: vec![("a".into(), "A".into()), ("b".into(), "B".into())],
        range: (1, 5),
        ends: ("low".into(), "high".into()),
        max_chars: 100,
    };
    let questions = vec![
        question("why", QuestionKind::Text, false),
        question("who", QuestionKind::Text, true),
        question("which", QuestionKind::Choice, false),
        question("hard", QuestionKind::Scale, true),
    ];
    let mut session = opened(BTreeMap::new(), "");
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    session.send("texts", 200, &Texts { questions, ..texts() });
    session.equipped();
    session.press("continue");
    session.send("enrol", 201, &enrolled());
    session.send("progress", 200, &Progress { answered: false, ..progress(&["t0"]) });
    session.press("start");
    session.pass(COUNTDOWN_MS + 11_000.0);
    // The last trial is still on its way.
    let fill = |fields: &[(&str, &str)]| {
        let field =
            |&(name, value): &(&str, &str)| (name.to_owned(), FieldValue::Text(value.into()));
        Form::new(fields.iter().map(field).collect())
    };
    let submit = |session: &mut Session, form| {
        let message = session.page.view().submit("questions", form);
        session.tell(message.unwrap());
    };
    submit(&mut session, fill(&[("why", " because ")]));
    assert!(session.words("missing").is_some());
    assert_eq!(marked(&session, "questions"), [false, true, false, true]);
    let view = session.page.view();
    let who = view.find("answer-who").unwrap();
    assert_eq!(who.attribute("aria-invalid"), Some("true"));
    submit(&mut session, fill(&[("why", " because "), ("who", "I"), ("hard", "4")]));
    let body = session.asked.iter().find(|request| request.name == "answers").unwrap().body.clone();
    let answers: Answers = serde_json::from_str(&body.unwrap()).unwrap();
    assert_eq!(
        serde_json::to_value(answers.answers).unwrap(),
        serde_json::json!({"hard": 4, "who": "I", "why": "because"})
    );
    session.send("answers", 200, &serde_json::json!({}));
    session.stored("t1");
    session.completed();
}

#[test]
fn an_interrupted_scene_is_driven_again_at_the_end() {
    let mut study = StudyConfig::default();
    study.trials.repeat_interrupted = true;
    let mut session = open(BTreeMap::new(), &study);
    session.begin();
    session.drive();
    session.stored("t0");
    session.drive();
    session.stored("t1");
    // Before the code, the page asks whether the server has planned further attempts.
    let mut further = progress(&["t0", "t1"]);
    let mut again = further.plan.phases[0].scenes[0].clone();
    (again.trial_id, again.attempt) = ("t0-2".into(), 2);
    further.plan.phases[0].scenes.push(again);
    session.send("progress", 200, &further);
    assert!(session.text().contains("Once more: task 1"), "{}", session.text());
    session.drive();
    session.stored("t0-2");
    further.stored.push("t0-2".into());
    session.send("progress", 200, &further);
    session.completed();
}

#[test]
fn stopping_keeps_or_deletes() {
    for (button, url, words) in [
        ("withdraw-keep", "/api/v1/participants/me?data=keep", "keeps what you did"),
        ("withdraw-delete", "/api/v1/participants/me?data=delete", "have been deleted"),
    ] {
        let mut session = begun();
        session.drive();
        session.unreachable("upload");
        session.press("stop");
        session.press("back");
        session.press("stop");
        if button == "withdraw-keep" {
            // What is kept is sent first.
            assert!(session.words("saved").unwrap().contains("1 scene not sent yet"));
            assert_eq!(session.page.view().press(button).map(drop), None);
            session.wake("upload-retry");
            session.stored("t0");
        }
        session.press(button);
        let withdrawal = session.asked.iter().find(|request| request.name == "withdraw");
        assert_eq!(withdrawal.unwrap().url, url);
        session.send("withdraw", 200, &Withdrawn { return_url: Some("https://r/".into()) });
        assert!(session.words("ended").unwrap().contains(words));
        assert!(session.kept.is_empty(), "{:?}", session.kept.keys());
        assert!(!session.guarded);
    }
}

#[test]
fn people_who_share_a_browser_are_told_apart() {
    let study = StudyConfig::default();
    let mut first = open_at(BTreeMap::new(), &study, "PROLIFIC_PID=P1&STUDY_ID=s&other=x");
    first.equipped();
    first.press("continue");
    let body = first.asked[0].body.clone().unwrap();
    let enrolment: Enrolment = serde_json::from_str(&body).unwrap();
    assert_eq!(enrolment.external_id.as_deref(), Some("P1"));
    assert_eq!(enrolment.parameters, Object::from_iter([("STUDY_ID".into(), "s".into())]));
    first.send("enrol", 201, &enrolled());
    let again = open_at(first.kept.clone(), &study, "PROLIFIC_PID=p-1");
    assert!(again.words("consent").is_some(), "another text is another id");
    let again = open_at(first.kept.clone(), &study, "PROLIFIC_PID=p1");
    assert_eq!(again.urls(), [routes::ME]);
    let second = open_at(first.kept, &study, "PROLIFIC_PID=P2");
    assert!(second.words("consent").is_some());
    assert_eq!(study.recruitment, Recruitment::default());
}

#[test]
fn a_personal_link_continues_on_another_computer() {
    let mut first = begun();
    first.drive();
    let view = first.page.view();
    let link = view.find("personal-link").unwrap().attribute("value").unwrap().to_owned();
    let fragment = link.strip_prefix("https://lab.example/s/default").unwrap();
    let mut second = open_at(BTreeMap::new(), &StudyConfig::default(), fragment);
    assert_eq!(second.visited, ["/s/default"], "the secret leaves the address bar");
    assert_eq!(second.asked[0].token.as_deref(), Some("secret"));
    second.send("progress", 200, &progress(&["t0"]));
    assert!(second.text().contains("Task 2 of 2"));
    assert!(second.kept["sidestep.session.default"].contains("secret"));
}

#[test]
fn a_pilot_is_kept_apart() {
    let mut session = open_at(BTreeMap::new(), &StudyConfig::default(), "pilot=1");
    assert!(session.words("pilot").unwrap().contains("Test run"));
    session.instructed();
    assert!(session.kept.contains_key("sidestep.session.default.pilot"));
}

#[test]
fn a_browser_rehearses_again_and_again() {
    let study = StudyConfig::default();
    let mut first = open_at(BTreeMap::new(), &study, "simulate=1");
    first.equipped();
    first.press("continue");
    first.send("enrol", 201, &enrolled());
    let goes_on = |link: &str| open_at(first.kept.clone(), &study, link).urls() == [routes::ME];
    assert!(goes_on("simulate=1"), "in the middle, the same test run goes on");
    for other in ["simulate=2", "pilot", ""] {
        assert!(!goes_on(other), "{other} is another run");
    }
    let code = Some("PILOT-1".to_owned());
    let over = Progress { completion_code: code, complete: true, pilot: true, ..progress(&[]) };
    let mut session = open_at(first.kept.clone(), &study, "simulate=1");
    session.send("progress", 200, &over);
    session.press("again");
    assert_eq!(session.left.as_deref(), Some("/s/default"));
    assert!(open_at(session.kept, &study, "simulate=1").words("consent").is_some());
    let mut session = open_at(first.kept.clone(), &study, "simulate=1");
    session.send("progress", 200, &Progress { pilot: false, ..over });
    assert!(session.page.view().find("again").is_none(), "only a test run begins again");
}

#[test]
fn a_link_without_a_proper_id_is_refused_at_once() {
    let mut study = StudyConfig::default();
    let mut refused = |link: &str, is_required: bool| {
        study.recruitment.require_external_id = is_required;
        let session = open_at(BTreeMap::new(), &study, link);
        session.words("stuck").is_some_and(|words| {
            words.contains("Your link is not complete") && words.contains("open the study again")
        })
    };
    let long = format!("external_id={}", "x".repeat(129));
    for link in
        ["PROLIFIC_PID={{%PROLIFIC_PID%}}", "external_id=[PID]", "workerId=${e://Field/id}", &long]
    {
        assert!(refused(link, false), "{link}");
    }
    for link in ["", "external_id=", "other=5f1e"] {
        assert!(refused(link, true) && !refused(link, false), "{link}");
    }
    for link in ["PROLIFIC_PID=5f1e", "pilot"] {
        assert!(!refused(link, true), "{link}");
    }
}

#[test]
fn one_practice_scene_is_no_plural() {
    let words = |scenes: usize| {
        let mut session = begun();
        let mut plan = plan();
        plan.phases[0].phase = Phase::Practice;
        plan.phases[0].scenes.truncate(scenes);
        let first = session.kept["sidestep.session.default"].clone();
        session =
            open([("sidestep.session.default".into(), first)].into(), &StudyConfig::default());
        session.send("progress", 200, &Progress { plan, ..progress(&[]) });
        session.press("continue");
        session.text()
    };
    assert!(words(1).contains("This scene is for practice."), "{}", words(1));
    assert!(words(2).contains("These 2 scenes are for practice."));
}

#[test]
fn another_language_is_asked_for_and_kept() {
    let mut session = welcomed();
    let message = session.page.view().enter("language", FieldValue::Text("de".into()));
    session.tell(message.unwrap());
    assert_eq!(session.urls(), ["/api/v1/studies/default/texts?language=de"]);
    let mut german = texts();
    german.language = "de".into();
    german.sentences.insert("welcome.agree".into(), "Ich bin einverstanden".into());
    session.send("texts", 200, &german);
    assert!(session.text().contains("Ich bin einverstanden"));
    let again = opened(session.kept, "");
    assert!(again.urls().contains(&"/api/v1/studies/default/texts?language=de"));
}

/// Every key that the page's code names is in the English file, and the code names every key of it.
#[test]
fn the_language_file_has_the_sentences_of_the_page() {
    let sources = [
        include_str!("../participant.rs"),
        include_str!("sending.rs"),
        include_str!("course.rs"),
        include_str!("answers.rs"),
        include_str!("joining.rs"),
        include_str!("view.rs"),
        include_str!("view/around.rs"),
        include_str!("view/before.rs"),
        include_str!("view/driving.rs"),
        include_str!("view/after.rs"),
    ];
    let code = sources.concat();
    let sentences = texts().sentences;
    let tables: Vec<_> = sentences.iter().filter_map(|(key, _)| key.split('.').next()).collect();
    for literal in code.split('"').skip(1).step_by(2) {
        let Some((table, rest)) = literal.split_once('.') else { continue };
        if tables.contains(&table)
            && rest.chars().all(|c| c.is_ascii_lowercase() || "_0123456789".contains(c))
        {
            let known = sentences.get(literal).is_some()
                || sentences.get(&format!("{literal}.other")).is_some();
            assert!(known, "the language file lacks {literal}");
        }
    }
    let mut unnamed = Vec::new();
    for (key, _) in sentences.iter() {
        let stem = key.strip_suffix(".one").or(key.strip_suffix(".other")).unwrap_or(key);
        // The server reads the check of understanding and the language's name; facts are named in
        // the study.
        let elsewhere = ["check_robot.", "check_straight.", "check_zone.", "language."];
        let facts = ["investigator", "institution", "contact", "ethics", "retention"];
        let named = elsewhere.iter().any(|table| stem.starts_with(table))
            || facts.iter().any(|fact| stem == format!("welcome.{fact}"));
        if !named && !code.contains(&format!("\"{stem}\"")) {
            unnamed.push(stem);
        }
    }
    assert!(unnamed.is_empty(), "no code names {unnamed:?}");
}
