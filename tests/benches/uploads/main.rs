//! A server under load, and killed under load: `cargo xtask bench uploads`.
//!
//! Starts the server on a new database and drives real trials through its HTTP interface from
//! 64 connections. In the same run and on the same disk, a loop that does nothing but insert
//! such trials with SQLite is the baseline. Then a class enrols at once while others upload;
//! and at last the server is killed in the middle of uploads, again and again, and every trial
//! that it acknowledged is looked up in the database and compared.
//!
//! It uses one thread. `SIDESTEP_BIN` names the build of the server that is measured.
#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

mod baseline;
mod figures;
mod http;
mod kills;
mod load;

use std::process::ExitCode;
use std::rc::Rc;
use std::time::Instant;

use figures::{Usage, at_least, at_most, row};
use load::Load;
use sidestep_tests::{Folder, Process};
use tokio::task::LocalSet;

/// How long and how often.
struct Plan {
    /// Each loop of the baseline, s.
    baseline_s: f64,
    /// The most people who enrol before uploads begin, and the longest time for them, s.
    people: usize,
    enrolling_s: f64,
    /// Uploads, s.
    uploading_s: f64,
    /// People who enrol at once, and the longest time for them, s.
    class: usize,
    class_limit_s: f64,
    kills: u32,
}

const WHOLE: Plan = Plan {
    baseline_s: 3.0,
    people: 600,
    enrolling_s: 8.0,
    uploading_s: 10.0,
    class: 600,
    class_limit_s: 40.0,
    kills: 20,
};

const QUICK: Plan = Plan {
    baseline_s: 1.0,
    people: 200,
    enrolling_s: 3.0,
    uploading_s: 3.0,
    class: 200,
    class_limit_s: 20.0,
    kills: 3,
};

/// Connections that upload, and that enrol.
const UPLOADING: usize = 64;
const ENROLLING: usize = 16;

/// Trials a second that others upload while a class enrols.
const BESIDE_PER_S: usize = 40;

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let plan = if quick { QUICK } else { WHOLE };
    // On a disk: a folder for temporary files may be in memory.
    let folder = Folder::within(env!("CARGO_TARGET_TMPDIR"));
    LocalSet::new().run_until(measure(&plan, &folder)).await
}

async fn measure(plan: &Plan, folder: &Folder) -> ExitCode {
    let baselines = [1, UPLOADING].map(|per_commit| {
        let per_s = baseline::inserts(folder, per_commit, plan.baseline_s);
        row(&format!("SQLite alone, trials a commit: {per_commit}"), format!("{per_s:.0}/s"), "");
        per_s
    });
    let begin = Instant::now();
    let server = Process::start(folder).await;
    let ready_ms = 1e3 * begin.elapsed().as_secs_f64();
    row("server ready, new database", format!("{ready_ms:.0} ms"), "");
    let load = Rc::new(Load::new(&server));
    enrolments(plan, &server, &load).await;
    uploads(plan, &server, &load, baselines).await;
    class(plan, &load).await;
    server.kill().await;
    kills(plan, &load, folder).await
}

/// People enrol, a few at a time.
async fn enrolments(plan: &Plan, server: &Process, load: &Rc<Load>) {
    let before = Usage::of(server.id());
    let (count, seconds) = load.enrol(plan.people, ENROLLING, plan.enrolling_s).await;
    let cpu_ms = 1e3 * (Usage::of(server.id()).cpu_s - before.cpu_s) / count.max(1) as f64;
    let per_s = count as f64 / seconds;
    let verdict = at_least(per_s, 300.0, "/s");
    row(
        &format!("enrolments, {ENROLLING} connections"),
        format!("{per_s:.0}/s"),
        format!("{verdict}; {}; {cpu_ms:.2} ms of CPU each", load.take_latencies()),
    );
}

/// Everybody uploads as fast as the server lets them.
async fn uploads(plan: &Plan, server: &Process, load: &Rc<Load>, baselines: [f64; 2]) {
    let processes = [server.id(), std::process::id()];
    let before = processes.map(Usage::of);
    let (count, seconds) = load.upload(UPLOADING, plan.uploading_s).await;
    let after = processes.map(Usage::of);
    let [cores, own] = [0, 1].map(|i| (after[i].cpu_s - before[i].cpu_s) / seconds);
    let [memory_mb, most_mb] = after[0].memory_mb;
    let per_s = count as f64 / seconds;
    let latencies = load.take_latencies();
    let verdict = format!("{}; {latencies}", at_least(per_s, 3000.0, "/s"));
    row(&format!("uploads, {UPLOADING} connections"), format!("{per_s:.0}/s"), verdict);
    let [single, grouped] = baselines.map(|baseline| format!("{:.2}×", per_s / baseline));
    row("  against SQLite alone", format!("{single}, {grouped}"), "");
    let p99_ms = latencies.p99_ms();
    row("  99 of 100 within", format!("{p99_ms:.1} ms"), at_most(p99_ms, 50.0, " ms"));
    row("  server", format!("{cores:.2} cores, {memory_mb:.0} MB (≤ {most_mb:.0})"), "");
    row("  this program", format!("{own:.2} cores"), "");
    row("  put off by a 503, problems", load.troubles(), "");
}

/// A class enrols at once while others upload.
async fn class(plan: &Plan, load: &Rc<Load>) {
    load.enrol(BESIDE_PER_S, ENROLLING, plan.enrolling_s).await;
    load.take_latencies();
    let (enrolled, seconds) = load.class(plan.class, BESIDE_PER_S, plan.class_limit_s).await;
    let all_s = if enrolled == plan.class { seconds } else { f64::INFINITY };
    row(
        &format!("{} enrol at once", plan.class),
        format!("{enrolled} in {seconds:.1} s"),
        at_most(all_s, 5.0, " s"),
    );
    let beside = load.take_latencies();
    let p99_ms = beside.p99_ms();
    row(
        &format!("  {BESIDE_PER_S} uploads a second beside them"),
        format!("{p99_ms:.1} ms"),
        format!("{}; {beside}", at_most(p99_ms, 100.0, " ms")),
    );
    row("  put off by a 503, problems", load.troubles(), "");
}

/// The server is killed in the middle of uploads; whether it kept its word.
async fn kills(plan: &Plan, load: &Rc<Load>, folder: &Folder) -> ExitCode {
    let (acknowledged, ready) = kills::kill(load, folder, plan.kills, UPLOADING).await;
    let found = kills::compare(load, folder).await;
    row(&format!("{} kills", plan.kills), format!("{acknowledged} acknowledged"), "");
    row("  ready again", ready, "");
    row("  put off by a 503, problems", load.troubles(), "");
    row("acknowledged in all", found.acknowledged, "");
    let wrong = found.missing + found.different;
    let lost = format!("{} missing, {} different", found.missing, found.different);
    row("  of these in the database", lost, at_most(wrong as f64, 0.0, ""));
    row("  stored without an answer", found.unacknowledged, "");
    if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
