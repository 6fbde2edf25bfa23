//! A server under load, and killed under load: `cargo xtask bench uploads`.
//!
//! Starts the server on a new database and drives real trials through its HTTP interface from
//! 64 connections. In the same run and on the same disk, a loop that does nothing but insert
//! such trials with SQLite is the baseline. Then a class enrols at once while others upload;
//! and at last the server is killed in the middle of uploads, again and again, and every trial
//! that it acknowledged is looked up in the database and compared.
//!
//! It uses one thread. `SIDESTEP_BIN` names another build of the server to measure.
#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

mod baseline;
mod figures;
mod http;
mod kills;
mod load;
mod participant;
mod server;

use std::path::Path;
use std::process::ExitCode;
use std::rc::Rc;
use std::time::Duration;

use anyhow::Context;
use figures::{Verdict, row, versus};
use load::Load;
use server::{Server, Usage};
use tokio::task::LocalSet;

/// How long and how often.
struct Plan {
    /// Each loop of the baseline.
    baseline: Duration,
    /// The most people who enrol before uploads begin, and the longest time for them.
    people: usize,
    enrolling: Duration,
    /// Uploads.
    uploading: Duration,
    /// People who enrol at once, and the longest time for them.
    class: usize,
    class_limit: Duration,
    kills: u32,
}

const WHOLE: Plan = Plan {
    baseline: Duration::from_secs(3),
    people: 600,
    enrolling: Duration::from_secs(8),
    uploading: Duration::from_secs(10),
    class: 600,
    class_limit: Duration::from_secs(40),
    kills: 20,
};

const QUICK: Plan = Plan {
    baseline: Duration::from_secs(1),
    people: 200,
    enrolling: Duration::from_secs(3),
    uploading: Duration::from_secs(3),
    class: 200,
    class_limit: Duration::from_secs(20),
    kills: 3,
};

/// Connections that upload, and that enrol.
const UPLOADING: usize = 64;
const ENROLLING: usize = 16;

/// Trials a second that others upload while a class enrols.
const BESIDE_PER_S: usize = 40;

#[tokio::main(flavor = "current_thread")]
async fn main() -> anyhow::Result<ExitCode> {
    let quick = std::env::args().any(|argument| argument == "--quick");
    let plan = if quick { QUICK } else { WHOLE };
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).context("a folder")?;
    LocalSet::new().run_until(measure(&plan, folder.path())).await
}

async fn measure(plan: &Plan, folder: &Path) -> anyhow::Result<ExitCode> {
    let single = baseline::inserts(folder, 1, plan.baseline)?;
    let grouped = baseline::inserts(folder, UPLOADING, plan.baseline)?;
    row("SQLite alone, a trial a commit", format!("{single:.0}/s"), "");
    row(&format!("SQLite alone, {UPLOADING} trials a commit"), format!("{grouped:.0}/s"), "");

    let server = Server::start(folder).await?;
    let load = Rc::new(Load::new(server.address));
    row("server ready, new database", format!("{:.0} ms", server.ready_ms), "");
    enrolments(plan, &server, &load).await?;
    uploads(plan, &server, &load, [single, grouped]).await?;
    class(plan, &load).await;
    server.kill().await?;
    kills(plan, &load, folder).await
}

/// People enrol, a few at a time.
async fn enrolments(plan: &Plan, server: &Server, load: &Rc<Load>) -> anyhow::Result<()> {
    let before = Usage::of(server.id)?;
    let (count, took) = load.enrol(plan.people, ENROLLING, plan.enrolling).await;
    let used = Usage::of(server.id)?.since(&before);
    let per_s = count as f64 / took.as_secs_f64();
    let cpu = format!("{:.2} ms of CPU each", 1e3 * used.cpu_s / count.max(1) as f64);
    row(
        &format!("enrolments, {ENROLLING} connections"),
        format!("{per_s:.0}/s"),
        Verdict::at_least(per_s, 300.0, "/s").and(&load.take_latencies().shown()).and(&cpu),
    );
    Ok(())
}

/// Everybody uploads as fast as the server lets them.
async fn uploads(
    plan: &Plan,
    server: &Server,
    load: &Rc<Load>,
    [single, grouped]: [f64; 2],
) -> anyhow::Result<()> {
    let (before, own) = (Usage::of(server.id)?, Usage::of(std::process::id())?);
    let (count, took) = load.upload(UPLOADING, plan.uploading).await;
    let seconds = took.as_secs_f64();
    let used = Usage::of(server.id)?.since(&before);
    let own = Usage::of(std::process::id())?.since(&own).cpu_s / seconds;
    let per_s = count as f64 / seconds;
    let latencies = load.take_latencies();
    let verdict = Verdict::at_least(per_s, 3000.0, "/s").and(&latencies.shown());
    row(&format!("uploads, {UPLOADING} connections"), format!("{per_s:.0}/s"), verdict);
    let ratios = format!("{}, {}", versus(per_s, single), versus(per_s, grouped));
    row("  against SQLite alone", ratios, "");
    row("  99 of 100 within", latencies.p99(), Verdict::at_most(latencies.p99_ms(), 50.0, " ms"));
    row("  server", used.shown(seconds), "");
    row("  this program", format!("{own:.2} cores"), "");
    row("  put off by a 503, problems", load.troubles(), "");
    Ok(())
}

/// A class enrols at once while others upload.
async fn class(plan: &Plan, load: &Rc<Load>) {
    load.enrol(BESIDE_PER_S, ENROLLING, plan.enrolling).await;
    load.take_latencies();
    let class = load.class(plan.class, BESIDE_PER_S, plan.class_limit).await;
    let all = if class.enrolled == plan.class { class.seconds } else { f64::INFINITY };
    row(
        &format!("{} enrol at once", plan.class),
        format!("{} in {:.1} s", class.enrolled, class.seconds),
        Verdict::at_most(all, 5.0, " s"),
    );
    let beside = load.take_latencies();
    row(
        &format!("  {BESIDE_PER_S} uploads a second beside them"),
        beside.p99(),
        Verdict::at_most(beside.p99_ms(), 100.0, " ms").and(&beside.shown()),
    );
    row("  put off by a 503, problems", load.troubles(), "");
}

/// The server is killed in the middle of uploads; whether it kept its word.
async fn kills(plan: &Plan, load: &Rc<Load>, folder: &Path) -> anyhow::Result<ExitCode> {
    let kills = kills::kill(load, folder, plan.kills, UPLOADING).await?;
    let found = kills::compare(load, folder)?;
    row(&format!("{} kills", plan.kills), format!("{} acknowledged", kills.acknowledged), "");
    row("  ready again", kills.ready.shown(), "");
    row("  put off by a 503, problems", load.troubles(), "");
    row("acknowledged in all", found.acknowledged, "");
    let wrong = found.missing + found.different;
    let lost = format!("{} missing, {} different", found.missing, found.different);
    row("  of these in the database", lost, Verdict::at_most(wrong as f64, 0.0, ""));
    row("  stored without an answer", found.unacknowledged, "");
    Ok(if wrong == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
