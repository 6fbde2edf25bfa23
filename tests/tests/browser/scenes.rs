//! Participants, from a key press to a predicted set, and data that survive failures.

use crate::{
    HUMAN, REMEMBER, ROBOT, begin, draws_level_sets, drive, instructed, kept, sent, sign_in, start,
    stored, understood, until_predicted, until_saved, until_waiting,
};
use sidestep::api::{StudySummary, routes};
use sidestep::chart::colours;
use sidestep::vehicle::TurnInput;
use sidestep_tests::browser::count_pixels;
use sidestep_tests::server::SHORT_STUDY;

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_scene_from_key_press_to_predicted_set() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    tab.before_pages(REMEMBER).await;
    begin(&tab, &server).await;

    // Drive the scene, and inspect the canvas during the drive.
    tab.press("start").await;
    tab.until_step("scene", 5).await;
    tab.key_down("ArrowLeft").await;
    tab.until_step("scene", 20).await;
    let picture = tab.picture("scene-driving").await;
    assert!(count_pixels(&picture, HUMAN) > 100, "the blue vehicle is drawn");
    assert!(count_pixels(&picture, ROBOT) > 300, "the robot and its goal are drawn");
    assert_eq!(tab.attribute("scene", "data-phase").await.as_deref(), Some("familiarisation"));
    let trial_id = tab.attribute("scene", "data-trial").await.expect("a trial");
    tab.until_step("scene", 40).await;
    tab.key_up("ArrowLeft").await;
    until_saved(&tab).await;
    tab.is_well().await;

    // The trial is in the database, complete and exact.
    let trials = stored(&server).await;
    assert_eq!(trials.len(), 1);
    let trial = &trials[0];
    assert_eq!(trial.summary.trial_id, trial_id);
    assert_eq!((trial.inputs.len(), trial.states.len()), (50, 51));
    assert!(trial.replay.exact, "{:?}", trial.replay);
    assert_eq!(trial.replay.max_position_error_m, 0.0);
    let lefts: Vec<_> = (0..50).filter(|&i| trial.inputs[i] == TurnInput::Left).collect();
    // The input is a left turn in every step that was due while the key was down. This takes about
    // 35 steps; the exact number depends on the machine.
    let events = sent(&tab).await.swap_remove(0).key_events;
    let times: Vec<_> =
        events.iter().map(|event| (&event.key[..], event.down, event.t_ms)).collect();
    let [("ArrowLeft", true, down_ms), ("ArrowLeft", false, up_ms)] = times[..] else {
        panic!("a press: {times:?}");
    };
    let held: Vec<_> =
        (0..50).filter(|&i| (down_ms..up_ms).contains(&(200.0 * i as f64))).collect();
    assert_eq!(lefts, held, "{times:?}");
    assert!(held.len() > 10, "{times:?}");
    assert!(trial.inputs.iter().all(|&input| input != TurnInput::Right));

    // The trial is in the export.
    let export = server.export("default").await;
    let mut reader = csv::Reader::from_reader(export.as_bytes());
    let headers = reader.headers().expect("a header").clone();
    let column = |name: &str| headers.iter().position(|h| h == name).expect("a column");
    let (hx, omega) = (column("hx"), column("omega"));
    let rows: Vec<_> = reader.records().map(|row| row.expect("a row")).collect();
    assert_eq!(rows.len(), 50);
    for (i, row) in rows.iter().enumerate() {
        let number = |at: usize| row[at].parse::<f64>().expect("a number");
        assert_eq!(number(hx).to_bits(), trial.states[i].human.x.to_bits());
        assert_eq!(number(omega), 0.5 * f64::from(trial.inputs[i].sign()));
    }

    // The trial is replayed, and all layers are drawn.
    sign_in(&tab, &server).await;
    tab.press("study-default").await;
    tab.press("tab-trials").await;
    assert!(tab.words("trials").await.contains("familiarisation 1"));
    tab.press("replay-link").await;
    until_predicted(&tab).await;
    assert_eq!(tab.attribute("replay", "data-trial").await, Some(trial_id));
    // The keys work wherever the focus is.
    for _ in 0..10 {
        tab.key_down("ArrowRight").await;
        tab.key_up("ArrowRight").await;
    }
    tab.until_step("replay", 10).await;
    let picture = tab.picture("replay").await;
    for (j, region) in colours::REGIONS.iter().enumerate() {
        assert!(count_pixels(&picture, region.light) >= 5, "region {} is drawn", j + 1);
    }
    draws_level_sets(&tab).await;
    tab.key_down(" ").await;
    tab.key_up(" ").await;
    tab.until_step("replay", 50).await;
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_is_down_loses_nothing() {
    let (server, browser, tab) = start(SHORT_STUDY).await;
    begin(&tab, &server).await;

    // The server is down when the scene ends; the page uploads it when the server is back.
    tab.press("start").await;
    tab.until_step("scene", 10).await;
    let stopped = server.stop().await;
    until_waiting(&tab).await;
    let server = stopped.start().await;
    until_saved(&tab).await;
    assert_eq!(stored(&server).await.len(), 1);

    // The server is down again, and the page is closed before the server is back.
    tab.press("start").await;
    tab.until_step("scene", 10).await;
    let stopped = server.stop().await;
    until_waiting(&tab).await;
    tab.go("about:blank").await;
    assert_eq!(tab.warnings(), 1, "a page with something unsent asks before it is left");
    let server = stopped.start().await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    until_saved(&tab).await;
    let trials = stored(&server).await;
    assert_eq!(trials.len(), 2);
    assert!(trials.iter().all(|trial| trial.replay.exact));
    let kept = kept(&tab).await;
    assert!(kept.iter().any(|name| name == "sidestep.session.default"), "{kept:?}");
    assert!(!kept.iter().any(|name| name.contains("outbox")), "{kept:?} should be forgotten");
    // The next scene is the third.
    drive(&tab, "d").await;
    until_saved(&tab).await;
    assert_eq!(stored(&server).await.len(), 3);
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_whole_participation_ends_with_a_code() {
    let (server, browser, tab) = start(r#"phases = [{ phase = "task", scenes = 2 }]"#).await;
    begin(&tab, &server).await;
    drive(&tab, "a").await;
    drive(&tab, "ArrowRight").await;
    let code = tab.words("completion-code").await;
    assert!(code.len() >= 8, "{code}");
    // Coming back shows the same code, without another enrolment.
    tab.reload().await;
    assert_eq!(tab.words("completion-code").await, code);
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    assert_eq!((studies[0].participants, studies[0].trials), (1, 2));
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_browser_that_stores_nothing_still_completes() {
    let (server, browser, tab) = start(r#"phases = [{ phase = "task", scenes = 1 }]"#).await;
    tab.before_pages(
        "IDBObjectStore.prototype.put = () => { \
         throw new DOMException('no room', 'QuotaExceededError') };",
    )
    .await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    instructed(&tab).await;
    assert!(tab.words("not-kept").await.contains("no storage left"));
    understood(&tab, &server, "en").await;
    drive(&tab, "a").await;
    assert!(tab.words("completion-code").await.len() >= 8);
    assert_eq!(stored(&server).await.len(), 1);
    tab.is_well().await;
    browser.close().await;
}
