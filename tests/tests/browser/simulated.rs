//! A synthetic participant at the real page: the whole protocol at high speed.

use super::start;
use sidestep::api::{StudySummary, TrialUpload, routes};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::synthetic::{Keys, SyntheticParticipant};
use std::time::{Duration, Instant};

/// Longest time that the paper's protocol may take at this speed.
const LIMIT: Duration = Duration::from_secs(120);

/// Has the page remember the trials that it sends.
const REMEMBER: &str = "const send = window.fetch; window.sent = []; window.fetch = (request) => { \
    if (request.method === 'PUT' && request.url.includes('/trials/')) \
        request.clone().text().then(text => window.sent.push(text)); \
    return send(request) };";

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_whole_protocol_is_rehearsed_in_a_minute() {
    let (server, browser, tab) = start("").await;
    tab.before_pages(REMEMBER).await;
    let begun = Instant::now();
    tab.go(&format!("{}/s/default?simulate=7&speed=30", server.origin)).await;
    let code = tab.words("completion-code").await;
    assert!(begun.elapsed() < LIMIT, "{:?}", begun.elapsed());
    // It is a pilot: nothing of it is among the data.
    assert!(code.starts_with("PILOT-"), "{code}");
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    assert_eq!((studies[0].participants, studies[0].trials), (0, 0));

    // It pressed the keys that the library's person presses, and nothing came late.
    let sent: Vec<String> = tab.eval("window.sent").await;
    assert!(sent.len() >= 50, "{} trials", sent.len());
    let (parameters, person) = (SceneParameters::default(), SyntheticParticipant::new(7, 0));
    for (number, text) in (0..).zip(&sent) {
        let trial: TrialUpload = serde_json::from_str(text).expect("a trial");
        let start = trial.states[0];
        let scene = Scene { human: start.human, robot: start.robot, goal: [0.0; 2] };
        let drive = person.drive(number, &parameters, &scene, Keys::Clock);
        assert_eq!(trial.inputs, drive.inputs, "trial {number}");
        let late = |(at, step): (&f64, u32)| at - f64::from(step) * 200.0;
        let latest = trial.sampled_at_ms.iter().zip(0..).map(late).fold(0.0, f64::max);
        assert!(latest < 1.0, "trial {number}: {latest} ms late");
        assert_eq!(trial.page_events, []);
    }
    tab.is_well().await;
    browser.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_participant_has_no_simulator_and_no_other_clock() {
    let (server, browser, tab) = start(r#"phases = [{ phase = "task", scenes = 1 }]"#).await;
    tab.go(&format!("{}/s/default?speed=50", server.origin)).await;
    super::instructed(&tab).await;
    super::understood(&tab, &server, "en").await;
    tab.press("start").await;
    tab.until_step("scene", 1).await;
    let before = Instant::now();
    tab.until_step("scene", 11).await;
    assert!(before.elapsed() > Duration::from_millis(1700), "{:?}", before.elapsed());
    let scripts: usize = tab.eval("document.scripts.length").await;
    assert_eq!(scripts, 1);
    assert!(tab.eval::<bool>("document.querySelector('[data-scene]') === null").await);
    browser.close().await;
}
