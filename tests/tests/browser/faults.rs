//! Browser faults. Nothing acknowledged is lost, nothing is stored twice, and the page tells the
//! participant what to expect next.

mod network;
mod returns;
mod storage;
mod sleep;
mod studies;
mod display;

use crate::{REMEMBER, begin, drive, equipped, sent, start, stored, until_saved};
use reqwest::Method;
use sidestep::api::{Progress, StudySummary, TrialDetail, routes};
use sidestep::trial::{Flag, INTERRUPTED_MS};
use sidestep::vehicle::TurnInput;
use sidestep_tests::{Browser, Server, Tab};
use std::collections::BTreeSet;

/// A study with one task.
const ONE_TASK: &str = r#"
slug = "default"
title = "Short"
phases = [{ phase = "task", scenes = 1 }]
[trials]
countdown_s = 1
"#;

/// The study with repetition of interrupted tasks. A stall of the machine also interrupts a task,
/// so only tests of interruptions use this setting.
fn repeating(study: &str) -> String {
    study.replace("[trials]", "[trials]\nrepeat_interrupted = true")
}

/// A study with two scenes of three seconds, and without a comprehension check.
const QUICK: &str = r#"
slug = "default"
title = "Quick"
phases = [{ phase = "task", scenes = 2 }]
[parameters]
steps = 15
[encounters]
min_entry_s = 1.0
max_entry_s = 2.5
[trials]
countdown_s = 1
end_s = 0.0
[comprehension]
standard = false
"#;

/// Opens a study like [`QUICK`] at this address, and goes on to the first scene.
async fn take_part(tab: &Tab, url: &str) {
    tab.go(url).await;
    crate::instructed(tab).await;
    tab.press("continue").await;
    tab.words("start").await;
}

/// Drives a scene without turning, and waits until the page goes on.
async fn glide(tab: &Tab) {
    tab.press("start").await;
    tab.words("scene").await;
    tab.until(&format!("!{}", Tab::at("scene"))).await;
}

/// All text that the page shows.
async fn text(tab: &Tab) -> String {
    tab.eval("document.body.innerText").await
}

/// Checks that the participation has ended with a code, and that as many trials as planned are
/// stored, each once and unchanged. Returns the trials.
async fn complete(tab: &Tab, server: &Server, scenes: usize) -> Vec<TrialDetail> {
    assert!(tab.words("completion-code").await.len() >= 8);
    let trials = stored(server).await;
    let ids: BTreeSet<_> = trials.iter().map(|trial| &trial.summary.trial_id).collect();
    assert_eq!((trials.len(), ids.len()), (scenes, scenes));
    assert!(trials.iter().all(|trial| trial.replay.exact));
    assert_eq!(participants(server).await, 1);
    trials
}

async fn participants(server: &Server) -> u64 {
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    studies[0].participants
}

/// The token of the participant in this tab.
async fn token(tab: &Tab) -> String {
    let record = "new Promise(done => indexedDB.open('sidestep').onsuccess = event => { \
                  const store = event.target.result.transaction('kept').objectStore('kept'); \
                  store.get('sidestep.session.default').onsuccess = event => \
                  done(JSON.parse(event.target.result).token) })";
    tab.eval(record).await
}

async fn progress(server: &Server, token: &str) -> Progress {
    let request = server.request(Method::GET, routes::ME).bearer_auth(token);
    request.send().await.expect("an answer").json().await.expect("the progress")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_reload_in_a_scene_is_counted_and_the_scene_driven_again() {
    let (server, browser, tab) = start(&repeating(ONE_TASK)).await;
    begin(&tab, &server).await;
    tab.press("start").await;
    tab.until_step("scene", 12).await;
    tab.reload().await;
    drive(&tab, "ArrowLeft").await;
    // The trial is flagged, and the task is repeated as a further attempt.
    tab.until_says("start", "Start").await;
    assert!(tab.eval::<String>("document.body.innerText").await.contains("Once more: task 1"));
    drive(&tab, "ArrowLeft").await;
    assert!(tab.words("completion-code").await.len() >= 8);
    let trials = stored(&server).await;
    assert_eq!(trials.len(), 2);
    let flags = &trials[0].summary.flags;
    assert!(flags.contains(&Flag::Interrupted) && flags.contains(&Flag::ShownBefore), "{flags:?}");
    // A stall of the machine also interrupts a scene, but the samples of such a scene are late.
    let again = &trials[1].summary.flags;
    let stalled = again.contains(&Flag::LateSample);
    assert!(stalled || !again.contains(&Flag::Interrupted), "{again:?}");
    assert!(!again.contains(&Flag::ShownBefore), "{again:?}");
    assert_eq!(trials[0].scene, trials[1].scene);
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_later_of_two_tabs_takes_over() {
    let (server, browser, first) = start(ONE_TASK).await;
    begin(&first, &server).await;
    let second = browser.open(&format!("{}/s/default", server.origin)).await;
    second.words("continue").await;
    assert!(first.words("elsewhere").await.contains("another tab"));
    // Go back to the first tab, which notifies the second.
    first.press("here").await;
    first.words("continue").await;
    assert!(second.words("elsewhere").await.contains("another tab"));
    second.is_accessible().await;
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    assert_eq!(studies[0].participants, 1);
    browser.close().await;
}

/// Waits for five more steps of the scene.
async fn five_steps(tab: &Tab) {
    let now: usize = tab.eval(&format!("Number({}.dataset.step)", Tab::at("scene"))).await;
    tab.until_step("scene", now + 5).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn keys_that_repeat_cross_or_lose_the_focus_never_stick() {
    let (server, browser, tab) = start(&repeating(ONE_TASK)).await;
    tab.before_pages(REMEMBER).await;
    begin(&tab, &server).await;
    tab.press("start").await;
    tab.until_step("scene", 5).await;
    tab.key_down("ArrowLeft").await;
    tab.key_down("ArrowLeft").await;
    five_steps(&tab).await;
    tab.key_down("ArrowRight").await;
    five_steps(&tab).await;
    tab.key_up("ArrowRight").await;
    five_steps(&tab).await;
    tab.run("window.dispatchEvent(new FocusEvent('blur'))").await;
    tab.until(&format!("!{}", Tab::at("scene"))).await;
    until_saved(&tab).await;
    let trial = &stored(&server).await[0];
    let turns: Vec<i8> = trial.inputs.iter().map(|input| input.sign()).collect();
    assert_eq!(turns.windows(2).filter(|pair| pair[0] != pair[1]).count(), 4, "{turns:?}");
    let events = &sent(&tab).await[0].key_events;
    let lost_ms = events.iter().find(|event| event.key == "blur").expect("a loss").t_ms;
    let after = turns.iter().enumerate().filter(|(step, _)| 200.0 * *step as f64 >= lost_ms);
    let after: Vec<i8> = after.map(|(_, &turn)| turn).collect();
    assert!(after.len() > 5, "lost at {lost_ms} ms");
    assert!(after.iter().all(|&turn| turn == 0), "{turns:?}, lost at {lost_ms} ms");
    assert!(trial.inputs.contains(&TurnInput::Right));
    assert!(trial.summary.flags.contains(&Flag::FocusLost));
    assert!(tab.words("hint").await.contains("came to the front"));
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_wall_clock_may_jump() {
    let (server, browser, tab) = start(ONE_TASK).await;
    tab.before_pages(REMEMBER).await;
    begin(&tab, &server).await;
    tab.press("start").await;
    tab.until_step("scene", 10).await;
    tab.run("Date.now = () => 0").await;
    tab.until_step("scene", 20).await;
    tab.run("Date.now = () => 4e12").await;
    tab.until(&format!("!{}", Tab::at("scene"))).await;
    assert!(tab.words("completion-code").await.len() >= 8);
    let trial = &stored(&server).await[0];
    assert!(trial.replay.exact);
    // No sample is early or late by as much as the clock jumped. A stall of the machine also
    // interrupts a scene.
    let sampled_at_ms = &sent(&tab).await[0].sampled_at_ms;
    let late = sampled_at_ms.iter().enumerate().map(|(step, at_ms)| at_ms - 200.0 * step as f64);
    let latest_ms = late.clone().fold(0.0, f64::max);
    assert!(late.clone().all(|ms| ms >= 0.0) && latest_ms < 60_000.0, "{sampled_at_ms:?}");
    let flags = &trial.summary.flags;
    assert_eq!(flags.contains(&Flag::Interrupted), latest_ms > INTERRUPTED_MS, "{sampled_at_ms:?}");
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn stopping_deletes_what_was_driven() {
    let (server, browser, tab) = start(ONE_TASK).await;
    begin(&tab, &server).await;
    let token = token(&tab).await;
    assert!(progress(&server, &token).await.may_withdraw);
    tab.press("stop").await;
    tab.press("withdraw-delete").await;
    assert!(tab.words("ended").await.contains("have been deleted"));
    tab.is_accessible().await;
    let gone = server.request(Method::GET, routes::ME).bearer_auth(&token);
    assert_eq!(gone.send().await.expect("an answer").status(), 410);
    tab.reload().await;
    tab.words("consent").await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_personal_link_continues_in_another_browser() {
    let study = ONE_TASK.replace("scenes = 1", "scenes = 2");
    let (server, browser, tab) = start(&study).await;
    begin(&tab, &server).await;
    drive(&tab, "a").await;
    until_saved(&tab).await;
    let link = tab.eval::<String>(&format!("{}.value", Tab::at("personal-link"))).await;
    let elsewhere = Browser::start().await;
    let other = elsewhere.open(&link).await;
    other.until_says("start", "Start").await;
    assert!(other.eval::<String>("document.body.innerText").await.contains("Task 2 of 2"));
    assert!(!other.eval::<String>("location.href").await.contains("continue"));
    drive(&other, "d").await;
    assert!(other.words("completion-code").await.len() >= 8);
    elsewhere.close().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn studies_that_take_nobody_say_so() {
    let full = ONE_TASK.to_owned() + "[recruitment]\nquota = 1\n";
    for (study, words) in [
        (ONE_TASK.replace("title", "status = \"closed\"\ntitle"), "This study is closed"),
        (ONE_TASK.replace("title", "status = \"archived\"\ntitle"), "This study is over"),
        (full, "This study is full"),
    ] {
        let (server, browser, tab) = start(&study).await;
        let url = format!("{}/s/default", server.origin);
        if words.contains("full") {
            begin(&tab, &server).await;
        }
        let late = Browser::start().await;
        let second = late.open(&url).await;
        assert!(second.words("ended").await.contains(words));
        second.is_accessible().await;
        late.close().await;
        browser.close().await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn other_keys_can_be_chosen_with_real_presses() {
    let (server, browser, tab) = start(ONE_TASK).await;
    tab.go(&format!("{}/s/default", server.origin)).await;
    tab.press("consent").await;
    tab.press("choose-keys").await;
    for key in ["a", "d"] {
        tab.key_down(key).await;
        tab.key_up(key).await;
    }
    tab.until(&format!("!{}", Tab::at("choosing"))).await;
    for key in ["a", "d"] {
        tab.key_down(key).await;
        tab.key_up(key).await;
    }
    tab.until(&format!("{}?.disabled === false", Tab::at("continue"))).await;
    tab.press("usual-keys").await;
    equipped(&tab).await;
    browser.close().await;
}
