//! Tests of uploads, failures and refusals.

use super::*;

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
    // It is unknown whether the first enrolment was stored, so the second request has the same id.
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
    // The participant repeats the first scene, and then both trials are sent in order.
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
    // The page asks only once. So it does not poll forever if the server always gives this answer.
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
fn leaving_warns_while_something_is_not_sent() {
    let mut session = begun();
    assert!(!session.guarded);
    session.drive();
    assert!(session.guarded);
    session.stored("t0");
    assert!(!session.guarded);
}
