//! A computer that sleeps or is busy during a scene.

use super::{QUICK, complete, glide, repeating, take_part, text};
use crate::{start, stored};
use sidestep::trial::Flag;
use sidestep_tests::Tab;
use std::time::Duration;

/// A clock of the page that can be set forward, as if the computer had slept.
const SLEEPS: &str = "const now = performance.now.bind(performance); window.slept_ms = 0; \
    performance.now = () => now() + window.slept_ms;";

const SLEEP: &str = "window.slept_ms += 300_000";

#[derive(Clone, Copy, Debug)]
enum Pause {
    /// Scripts do not run for a while.
    Busy,
    /// The browser freezes the page.
    Frozen,
    /// The clock jumps forward by five minutes.
    Asleep,
}

async fn pause(tab: &Tab, pause: Pause) {
    match pause {
        Pause::Busy => {
            tab.run("(() => { const end = Date.now() + 1500; while (Date.now() < end); })()").await;
        }
        Pause::Frozen => tab.freeze(Duration::from_millis(1500)).await,
        Pause::Asleep => tab.run(SLEEP).await,
    }
}

async fn paused_in_a_scene(kind: Pause) {
    let study = repeating(&QUICK.replace("scenes = 2", "scenes = 1"));
    let (server, browser, tab) = start(&study).await;
    tab.before_pages(SLEEPS).await;
    take_part(&tab, &format!("{}/s/default", server.origin)).await;
    tab.press("start").await;
    tab.until_step("scene", 4).await;
    pause(&tab, kind).await;
    // The page tells the participant, who repeats the scene.
    tab.until_says("start", "Start").await;
    let said = text(&tab).await;
    assert!(said.contains("Once more: task 1"), "{kind:?}: {said}");
    assert!(said.contains("was interrupted"), "{kind:?}: {said}");
    let trials = stored(&server).await;
    assert_eq!(trials.len(), 1, "{kind:?}");
    let (trial, flags) = (&trials[0], &trials[0].summary.flags);
    assert_eq!((trial.inputs.len(), trial.states.len()), (15, 16));
    assert!(trial.replay.exact, "{kind:?}");
    assert!(flags.contains(&Flag::Interrupted), "{kind:?}: {flags:?}");
    assert!(flags.contains(&Flag::LateSample), "{kind:?}: {flags:?}");
    glide(&tab).await;
    complete(&tab, &server, 2).await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_pause_in_a_scene_is_flagged_and_the_scene_driven_again() {
    let [busy, frozen, asleep] = [Pause::Busy, Pause::Frozen, Pause::Asleep].map(paused_in_a_scene);
    tokio::join!(busy, frozen, asleep);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_computer_that_sleeps_in_the_countdown_loses_no_scene() {
    let study = QUICK.replace("countdown_s = 1", "countdown_s = 5");
    let (server, browser, tab) = start(&study).await;
    tab.before_pages(SLEEPS).await;
    take_part(&tab, &format!("{}/s/default", server.origin)).await;
    tab.press("start").await;
    tab.words("countdown").await;
    tab.run(SLEEP).await;
    tab.until(&format!("!{}", Tab::at("countdown"))).await;
    // The scene has not started to move. Participants start it when they are back.
    assert!(tab.words("start").await.contains("Start"));
    assert!(text(&tab).await.contains("Task 1 of 2"));
    glide(&tab).await;
    glide(&tab).await;
    let trials = complete(&tab, &server, 2).await;
    assert!(trials.iter().all(|trial| !trial.summary.flags.contains(&Flag::ShownBefore)));
    browser.close().await;
}
