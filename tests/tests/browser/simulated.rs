//! A synthetic participant on the real page drives the whole protocol at high speed.

use crate::{REMEMBER, sent, start};
use sidestep::api::{StudySummary, TrialUpload, routes};
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::trial::verify;
use sidestep::vehicle::TurnInput;
use sidestep_tests::behind;
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
        let JointState { human, robot } = trial.states[0];
        let scene = Scene::new(&parameters, human, robot);
        let replay = verify(&parameters, &scene, &trial.inputs, &trial.states);
        assert!(replay.exact, "trial {number}: {replay:?}");
        turned += usize::from(trial.inputs.iter().any(|&input| input != TurnInput::Straight));
    }
    assert!(turned >= 30, "the simulated participant turned in {turned} of 59 scenes");
    tab.is_well().await;
    browser.close().await;
}

/// The page moves robots by their rules exactly as the server replays them.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn robots_that_act_by_rule_are_rehearsed() {
    const STUDY: &str = "phases = [{ phase = \"task\", scenes = 8 }]\n\
        [[robots]]\nname = \"straight\"\n\
        [[robots]]\nname = \"detour\"\nrule = \"way_points\"\n\
        way_points_m = [[6.0, 1.5], [13.0, -1.0]]\n\
        [[robots]]\nname = \"surprise\"\nrule = \"script\"\n\
        turns = [{ until_s = 3.0, turn_rate_radps = 0.0 }, { until_s = 4.0, turn_rate_radps = 0.4 }]\n\
        [[robots]]\nname = \"careful\"\nrule = \"evades\"\nthreshold_m = 1.0\n";
    let (server, browser, tab) = start(STUDY).await;
    tab.before_pages(REMEMBER).await;
    tab.go(&format!("{}/s/default?simulate=7&speed=30", server.origin)).await;
    assert!(tab.words("completion-code").await.starts_with("PILOT-"));
    let sent = sent(&tab).await;
    let turned = |trial: &TrialUpload| {
        trial.states.windows(2).any(|pair| pair[0].robot_turned(&pair[1]) != 0.0)
    };
    let turning = sent.iter().filter(|trial| turned(trial)).count();
    assert!(sent.len() >= 8 && turning >= 5, "{turning} of {} robots turned", sent.len());
    let db = behind(&server.database());
    let mismatches = "SELECT count(*) FROM stored_trial WHERE flags LIKE '%mismatch%'";
    assert_eq!(db.row(mismatches, |row| row.get::<i64>(0)).await.unwrap(), 0);
    let rules = "SELECT count(DISTINCT policy) FROM stored_trial";
    assert_eq!(db.row(rules, |row| row.get::<i64>(0)).await.unwrap(), 4);
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
