//! A synthetic participant on the real page drives the whole protocol at high speed.

use crate::{REMEMBER, sent, start};
use sidestep::api::{StudySummary, routes};
use sidestep::scene::SceneParameters;
use sidestep::trial::verify;
use sidestep::vehicle::TurnInput;
use std::time::{Duration, Instant};

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_whole_protocol_is_rehearsed_in_a_minute() {
    let (server, browser, tab) = start("").await;
    tab.before_pages(REMEMBER).await;
    tab.go(&format!("{}/s/default?simulate=7&speed=30", server.origin)).await;
    let code = tab.words("completion-code").await;
    // The participation is a pilot, so it is not part of the data.
    assert!(code.starts_with("PILOT-"), "{code}");
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    assert_eq!((studies[0].participants, studies[0].trials), (0, 0));

    // Every scene was driven with keys, and replays exactly. (At this speed, a millisecond of the
    // machine is 30 ms of the page, so a key press can fall in another step than intended.)
    let sent = sent(&tab).await;
    assert!(sent.len() >= 59, "{} trials", sent.len());
    let parameters = SceneParameters::default();
    let mut turned = 0;
    for (number, trial) in sent.iter().enumerate() {
        trial.check(&parameters).expect("a valid trial");
        let replay = verify(&parameters, trial.states[0], &trial.inputs, &trial.states);
        assert!(replay.exact, "trial {number}: {replay:?}");
        turned += usize::from(trial.inputs.iter().any(|&input| input != TurnInput::Straight));
    }
    assert!(turned >= 30, "the simulated participant turned in {turned} of 59 scenes");
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_participant_has_no_simulator_and_no_other_clock() {
    let (server, browser, tab) = start(r#"phases = [{ phase = "task", scenes = 1 }]"#).await;
    tab.go(&format!("{}/s/default?speed=50", server.origin)).await;
    super::instructed(&tab).await;
    super::understood(&tab, &server, "en").await;
    // The measurement starts before the scene, so a busy machine can only make the time longer.
    let before = Instant::now();
    tab.press("start").await;
    tab.until_step("scene", 11).await;
    assert!(before.elapsed() > Duration::from_millis(2200), "{:?}", before.elapsed());
    let scripts: usize = tab.eval("document.scripts.length").await;
    assert_eq!(scripts, 1);
    assert!(tab.eval::<bool>("document.querySelector('[data-scene]') === null").await);
    browser.close().await;
}
