//! Times at which steps are computed and frames are shown during scenes.

use crate::figures::{distribution, quantile};
use serde_json::{Value, json};
use sidestep::api::{TrialDetail, TrialPage, TrialUpload, routes};
use sidestep::trial::{Flag, LATE_SAMPLE_MS};
use sidestep_tests::participant::begin;
use sidestep_tests::{Browser, Server, Tab};
use std::time::Duration;

/// Load on the computer during a measurement.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    /// Extra work in each frame (ms).
    work_ms: f64,
    /// Factor by which the page's programs are slowed down.
    slower: f64,
}

pub(crate) const CASES: [Case; 4] = [
    Case { name: "nothing else", work_ms: 0.0, slower: 1.0 },
    Case { name: "20 ms of other work in each frame", work_ms: 20.0, slower: 1.0 },
    Case { name: "a processor 4 times as slow", work_ms: 0.0, slower: 4.0 },
    Case { name: "a processor 6 times as slow", work_ms: 0.0, slower: 6.0 },
];

/// Number of scenes of each case.
const SCENES: usize = 8;

/// A short protocol that omits everything that the measurements do not need.
pub(crate) const STUDY: &str = r#"
slug = "default"
phases = [{ phase = "task", scenes = 8 }]
[trials]
countdown_s = 1
end_s = 0.5
rest_after = 0
[comprehension]
standard = false
"#;

/// Makes the page record its uploads, and work for `burden_ms` in each frame.
pub(crate) const BEFORE: &str = "window.burden_ms = 0; window.sent = []; \
    const send = window.fetch; window.fetch = (request) => { \
        if (request.method === 'PUT' && request.url.includes('/trials/')) \
            request.clone().text().then(text => window.sent.push(text)); \
        return send(request) }; \
    const work = () => { \
        for (const end = performance.now() + window.burden_ms; performance.now() < end;); \
        requestAnimationFrame(work) }; \
    requestAnimationFrame(work);";

/// Drives scenes and measures their times. The page is not queried while the scenes run.
pub(crate) async fn measured(case: &Case) -> Value {
    let server = Server::with_client(STUDY).await;
    let browser = Browser::start().await;
    let tab = browser.open("about:blank").await;
    tab.before_pages(BEFORE).await;
    begin(&tab, &server).await;
    tab.run(&format!("window.burden_ms = {}", case.work_ms)).await;
    tab.slow_down(case.slower).await;
    for _ in 0..SCENES {
        tab.press("start").await;
        // This includes 1 s of countdown.
        tokio::time::sleep(Duration::from_millis(3000)).await;
        for key in ["ArrowLeft", "ArrowRight"] {
            tab.key_down(key).await;
            tokio::time::sleep(Duration::from_millis(1700)).await;
            tab.key_up(key).await;
        }
        tokio::time::sleep(Duration::from_millis(6000)).await;
    }
    tab.slow_down(1.0).await;
    tab.words("completion-code").await;
    let trials = sent(&tab).await;
    let found = figures(case, &trials, flagged(&server).await);
    browser.close().await;
    found
}

/// The trials that the page has sent.
pub(crate) async fn sent(tab: &Tab) -> Vec<TrialUpload> {
    let texts: Vec<String> = tab.eval("window.sent").await;
    texts.iter().map(|text| serde_json::from_str(text).expect("a trial")).collect()
}

/// Number of stored trials with the flag `LateSample`.
async fn flagged(server: &Server) -> usize {
    let page: TrialPage = server.admin(&routes::admin_trials("default")).await.into(200);
    let mut flagged = 0;
    for summary in page.trials {
        let trial: TrialDetail =
            server.admin(&routes::admin_trial(&summary.trial_id)).await.into(200);
        assert!(trial.replay.exact, "every stored trial replays");
        flagged += usize::from(trial.summary.flags.contains(&Flag::LateSample));
    }
    flagged
}

fn figures(case: &Case, trials: &[TrialUpload], flagged: usize) -> Value {
    // The document that reports the measurements states these numbers.
    assert!(trials.len() == SCENES && trials.iter().all(|trial| trial.inputs.len() == 50));
    let late = |trial: &TrialUpload| -> Vec<f64> {
        let due = (0..).map(|step| 200.0 * f64::from(step));
        trial.sampled_at_ms.iter().zip(due).map(|(real, due)| real - due).collect()
    };
    let by_trial: Vec<Vec<f64>> = trials.iter().map(late).collect();
    let all = by_trial.concat();
    let part = |range: std::ops::Range<usize>| {
        let late: Vec<f64> =
            by_trial.iter().flat_map(|late| late[range.clone()].to_vec()).collect();
        quantile(&late, 0.5)
    };
    let display = |name: &str| -> Vec<f64> {
        trials.iter().map(|t| t.display.get(name).and_then(Value::as_f64).expect(name)).collect()
    };
    let frames: f64 = display("frames").iter().sum();
    json!({
        "name": case.name,
        "trials": trials.len(),
        "late_ms": distribution(&all),
        "first_ten_ms": part(0..10),
        "last_ten_ms": part(40..50),
        "over_flagged_limit": by_trial
            .iter()
            .filter(|late| late.iter().any(|&late| late > LATE_SAMPLE_MS))
            .count(),
        "flagged": flagged,
        "frame_gap_ms": quantile(&display("frame_gap_median_ms"), 0.5),
        "frame_gap_max_ms": quantile(&display("frame_gap_max_ms"), 1.0),
        "frames_dropped": display("frames_dropped").iter().sum::<f64>() / frames,
        "frame_work_ms": quantile(&display("frame_work_p99_ms"), 1.0),
    })
}
