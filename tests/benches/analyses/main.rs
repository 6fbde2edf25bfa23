//! Analyses beside data collection: `cargo xtask bench analyses`.
//!
//! Starts a server with a study of synthetic people, and lets others upload real trials from 16
//! connections: first alone, then beside an analysis of the study. Then the analysis goes on alone, and the time and
//! memory of its process are compared with the estimate by which the server accepts analyses.
//!
//! It uses one thread. `SIDESTEP_BIN` names the build of the server that is measured.
#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

#[path = "../uploads/figures.rs"]
#[allow(dead_code, reason = "the other benchmark uses all of it")]
mod figures;
#[path = "../uploads/http.rs"]
mod http;
#[path = "../uploads/load.rs"]
#[allow(dead_code, reason = "the other benchmark uses all of it")]
mod load;

use figures::{Usage, row};
use load::Load;
use reqwest::Method;
use serde_json::json;
use sidestep::api::{AnalysisDetail, AnalysisState, AnalysisSummary, routes};
use sidestep::comparison::{Cost, Request};
use sidestep_tests::{Answer, Folder, Process, run};
use std::process::ExitCode;
use std::rc::Rc;
use std::time::{Duration, Instant};
use tokio::task::LocalSet;

/// Connections that upload.
const UPLOADING: usize = 16;

/// People and their tasks, of whom the analysis is, and how long others upload, s.
const WHOLE: (usize, usize, f64) = (40, 25, 10.0);
const QUICK: (usize, usize, f64) = (12, 20, 4.0);

/// By how much an estimate may be wrong.
const FACTOR: f64 = 3.0;

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let folder = Folder::within(env!("CARGO_TARGET_TMPDIR"));
    LocalSet::new().run_until(measure(if quick { QUICK } else { WHOLE }, &folder)).await
}

async fn measure((people, tasks, seconds): (usize, usize, f64), folder: &Folder) -> ExitCode {
    let (trials, database) = (folder.name("trials.csv"), folder.database("sidestep.db"));
    let [number, each] = [people, tasks].map(|count| count.to_string());
    let simulated = ["simulate", "--participants", &number, "--tasks", &each, "--seed", "3"];
    run(&[&simulated[..], &["--out", &trials]].concat()).await.json();
    run(&["import", "--study", "default", "--trials", &trials, "--database", &database])
        .await
        .json();
    let server = Process::start(folder).await;
    let said = server.announcement.concat();
    let key = said.split_once("#key=").and_then(|(_, key)| key.split_whitespace().next());
    let key = key.expect("a key").to_owned();
    let load = Rc::new(Load::new(&server));
    let ask = |method, route: &str| {
        Answer::of(server.request(method, route).bearer_auth(&key).json(&json!({})))
    };

    load.enrol(UPLOADING * 20, 4, 20.0).await;
    load.take_latencies();
    uploads("uploads alone", &load, seconds).await;
    let asked = ask(Method::POST, &routes::admin_analyses("default")).await;
    let id = asked.into::<AnalysisSummary>(201).id;
    let shown = || async {
        ask(Method::GET, &routes::admin_analysis(&id)).await.into::<AnalysisDetail>(200).summary
    };
    while !shown().await.progress.is_some_and(|progress| progress.done > 0) {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let process = child(server.id());
    load.enrol(UPLOADING * 20, 4, 20.0).await;
    load.take_latencies();
    uploads("uploads beside an analysis", &load, seconds).await;

    // People who enrolled since drove less than can be compared.
    let mut usage = Usage { cpu_s: f64::NAN, memory_mb: [f64::NAN; 2] };
    let begun = Instant::now();
    let ending = loop {
        let now = shown().await;
        if now.state.is_over() {
            break now;
        }
        let next = process.map(Usage::of).filter(|next| next.cpu_s.is_finite());
        usage = next.unwrap_or(usage);
        assert!(begun.elapsed() < Duration::from_secs(1800), "{now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert_eq!(ending.state, AnalysisState::Done, "{:?}", ending.message);
    let settings = Request::default().settings().expect("the protocol's");
    let threads = std::thread::available_parallelism().map_or(1, |all| (all.get() - 1).max(1));
    let cost = Cost::of(&settings, &vec![tasks; people], 50, threads);
    let memory_mb = cost.memory_bytes / f64::from(1 << 20);
    let close = [
        against("analysis, processor time, s", usage.cpu_s, cost.processor_s),
        against("analysis, most memory, MiB", usage.memory_mb[1], memory_mb),
    ];
    let server = Usage::of(server.id()).memory_mb[1];
    row("server, most memory", format!("{server:.0} MB"), "");
    if close.iter().all(|close| *close) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Everybody uploads as fast as the server lets them.
async fn uploads(name: &str, load: &Rc<Load>, seconds: f64) {
    let (count, took_s) = load.upload(UPLOADING, seconds).await;
    let per_s = format!("{:.0}/s", count as f64 / took_s);
    row(name, per_s, format!("{}; {}", load.take_latencies(), load.troubles()));
}

/// A figure against its estimate, and whether they are close enough. A server that computes in its own process
/// has no figure.
fn against(name: &str, figure: f64, estimate: f64) -> bool {
    let ratio = estimate / figure;
    let close = !ratio.is_finite() || (1.0 / FACTOR..=FACTOR).contains(&ratio);
    let met = if close { "met" } else { "MISSED" };
    row(
        name,
        format!("{figure:.0}"),
        format!("estimated {estimate:.0}, {ratio:.2}×, ≤ {FACTOR}× {met}"),
    );
    close
}

/// The child process of the server, as Linux tells.
fn child(server: u32) -> Option<u32> {
    let threads = std::fs::read_dir(format!("/proc/{server}/task")).ok()?;
    let lists =
        threads.flatten().map(|thread| std::fs::read_to_string(thread.path().join("children")));
    lists.flatten().find_map(|list| list.split_whitespace().next()?.parse().ok())
}
