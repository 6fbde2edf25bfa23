//! Tests of the scenes: countdown, keys, interruptions and tabs.

use super::*;
use sidestep::scene::{JointState, RobotPolicy, Rule};
use sidestep::trial::verify;

/// A session whose robots evade, up to the first scene. `session` has just opened the page.
fn with_evading_robots(mut session: Session) -> (Session, Plan) {
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Admission::Open));
    session.send("texts", 200, &texts());
    session.equipped();
    session.press("continue");
    let policy = RobotPolicy {
        name: "careful".into(),
        rule: Rule::Evades,
        threshold_m: Some(1.0),
        ..RobotPolicy::default()
    };
    let mut plan = plan();
    for scene in &mut plan.phases[0].scenes {
        scene.policy = Some(Box::new(policy.clone()));
    }
    session.send("enrol", 201, &Enrolled { plan: plan.clone(), ..enrolled() });
    session.send("progress", 200, &Progress { plan: plan.clone(), ..progress(&[]) });
    (session, plan)
}

#[test]
fn robots_move_by_their_rules() {
    let parameters = StudyConfig::default().parameters;
    let page = Participant::open_with_robots(context(&BTreeMap::new(), ""));
    let (mut session, plan) = with_evading_robots(Session::new(page, BTreeMap::new()));
    session.press("continue");
    session.drive();
    let trial = session.uploaded("t0");
    let scene = plan.phases[0].scenes[0].scene();
    assert!(verify(&parameters, &scene, &trial.inputs, &trial.states).exact);
    let turned = |pair: &[JointState]| pair[0].robot_turned(&pair[1]) != 0.0;
    assert!(trial.states.windows(2).any(turned));
}

#[test]
fn a_page_without_the_rules_of_robots_drives_no_wrong_scene() {
    let (session, _) = with_evading_robots(opened(BTreeMap::new(), ""));
    let said = session.words("stuck").unwrap();
    assert!(said.contains("out of date") && session.words("continue").is_none(), "{said}");
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
    assert_eq!(session.words("countdown").as_deref(), Some("3"), "a new countdown");
    session.pass(2999.0);
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
    assert!(session.words("hint").unwrap().contains("The scene has not begun."));
}

#[test]
fn feedback_stays_as_long_as_the_study_says_from_when_it_is_seen() {
    let stays_ms = |feedback: bool, end_s: f64, stays_unseen_ms: f64| {
        let mut study = StudyConfig::default();
        study.phases.iter_mut().for_each(|phase| phase.feedback = feedback);
        (study.trials.end_s, study.trials.feedback_s) = (end_s, 2.0);
        let mut session = open(BTreeMap::new(), &study);
        session.begin();
        session.press("start");
        session.pass(COUNTDOWN_MS + 9_990.0);
        // No frame is painted when the scene ends, so the participant has not seen the end.
        session.now_ms += 60.0;
        let message = session.page.tick(session.now_ms).unwrap();
        session.tell(message);
        session.now_ms += stays_unseen_ms;
        assert!(session.page.tick(session.now_ms).is_none() && session.words("over").is_some());
        session.frame();
        let seen_ms = session.now_ms;
        while session.words("over").is_some() {
            session.at(session.now_ms + 10.0).frame();
        }
        session.now_ms - seen_ms
    };
    assert_eq!(
        [(false, 0.6, 3590.0), (true, 0.6, 4990.0), (true, 4.0, 0.0)]
            .map(|(feedback, end_s, unseen_ms)| stays_ms(feedback, end_s, unseen_ms)),
        [600.0, 2000.0, 4000.0]
    );
}

/// The page continues even if the browser never draws the end of a scene.
#[test]
fn what_is_never_drawn_ends_too() {
    let mut session = begun();
    session.press("start");
    session.pass(COUNTDOWN_MS + 9990.0);
    session.now_ms += 60.0;
    let message = session.page.tick(session.now_ms).unwrap();
    session.tell(message);
    assert!(session.words("over").is_some());
    let due_ms = session.page.due_ms().unwrap();
    assert!((3000.0..7000.0).contains(&(due_ms - session.now_ms)));
    session.now_ms = due_ms;
    let message = session.page.tick(due_ms).unwrap();
    session.tell(message);
    assert!(session.words("start").is_some());
}

#[test]
fn a_scene_that_is_shown_again_counts_its_exposures() {
    let mut session = begun();
    session.press("start");
    session.pass(COUNTDOWN_MS + 2000.0);
    let mut session = open(session.kept, &StudyConfig::default());
    session.send("progress", 200, &progress(&[]));
    assert!(session.words("hint").unwrap().contains("because this page was reloaded or closed"));
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
fn an_interrupted_scene_is_driven_again_at_the_end() {
    let mut study = StudyConfig::default();
    study.trials.repeat_interrupted = true;
    let mut session = open(BTreeMap::new(), &study);
    session.begin();
    session.drive();
    session.stored("t0");
    session.drive();
    session.stored("t1");
    // Before it requests the completion code, the page asks whether the server has planned further
    // attempts.
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
