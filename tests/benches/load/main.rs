//! A server under load: `cargo xtask bench load`.
//!
//! Starts servers on a new database and uploads real trials over HTTP in three ways: at full speed,
//! while many people enrol at the same time, and from people at their own pace. Afterwards every
//! acknowledged trial is compared with the database. Two baselines run on the same disk: a loop
//! that only inserts such trials with SQLite, and oTree.
//!
//! The benchmark uses one thread. `SIDESTEP_BIN` is the path of the server to measure.
#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

mod attacks;
mod baseline;
mod large;
mod otree;
mod subject;

use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, ValueEnum};
use sidestep_tests::Folder;
use sidestep_tests::load::Usage;
use sidestep_tests::load::crowd::Pace;
use sidestep_tests::load::figures::{at_least, at_most, row};
use sidestep_tests::load::natural::Habits;
use subject::{SUBJECTS, Subject, Under};
use tokio::task::LocalSet;

/// Measures a server under load.
#[derive(Parser)]
#[command(name = "cargo xtask bench load --")]
struct Options {
    /// Use a quarter of the people and of the seconds.
    #[arg(long)]
    quick: bool,
    /// Scenarios to measure [default: all except `attacks` and `start`].
    #[arg(long, value_delimiter = ',', default_values = ["fast", "class", "natural", "otree"])]
    scenarios: Vec<Scenario>,
    /// Databases to measure: every database whose name in the output contains one of these strings.
    #[arg(long, value_delimiter = ',', default_value = "")]
    databases: Vec<String>,
    /// Attacks to run: every attack whose name contains one of these strings.
    #[arg(long, value_delimiter = ',', default_value = "")]
    attacks: Vec<String>,
    /// Connections that upload at full speed.
    #[arg(long, default_value_t = 64)]
    connections: usize,
    /// Duration (s).
    #[arg(long, default_value_t = 10.0)]
    seconds: f64,
    /// Rate of the uploads that follow at a fixed rate, per second, over the same number of
    /// connections.
    #[arg(long, default_value_t = 2_000.0)]
    rate: f64,
    /// Number of people who drive at their own pace, one trial every 12 s each.
    #[arg(long, default_value_t = 3_000)]
    people: usize,
    /// Period in which they join, evenly distributed (s).
    #[arg(long, default_value_t = 12.0)]
    join_s: f64,
    /// How long they take part after the last of them has joined (s).
    #[arg(long, default_value_t = 40.0)]
    natural_s: f64,
    /// Number of trials in the database for the scenario `start`.
    #[arg(long, default_value_t = 500_000)]
    trials: usize,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Ignored; other benchmarks use it.
    #[arg(long, hide = true)]
    discard_baseline: bool,
    #[arg(long, hide = true)]
    bench: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Scenario {
    /// Uploads at full speed, and at a fixed rate.
    Fast,
    /// Many people enrol at the same time while others upload.
    Class,
    /// People at their own pace, who reload, retry, vanish and withdraw.
    Natural,
    /// oTree stores a field of 4 KB from each page.
    Otree,
    /// Honest uploads during an attack, and during an analysis.
    Attacks,
    /// The start of a server on a large database, which the first run creates.
    Start,
}

impl Options {
    /// With `--quick`, shortens all scenarios.
    fn quickly(mut self) -> Self {
        if self.quick {
            self.seconds /= 4.0;
            // At least two trials per person.
            self.natural_s = (self.natural_s / 4.0).max(25.0);
            self.people /= 4;
            self.trials /= 20;
        }
        self
    }

    fn has(&self, scenario: Scenario) -> bool {
        self.scenarios.contains(&scenario)
    }
}

/// Number of connections that enrol.
const ENROLLING: usize = 16;

/// Number of people who enrol at the same time, and the rate at which other people upload trials
/// meanwhile (1/s).
const CLASS: usize = 600;
const BESIDE_PER_S: usize = 40;

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let options = Options::parse().quickly();
    // The folder must be on a disk, because the folder for temporary files can be in memory.
    let folder = Folder::within(env!("CARGO_TARGET_TMPDIR"));
    LocalSet::new().run_until(measure(&options, &folder)).await
}

async fn measure(options: &Options, folder: &Folder) -> ExitCode {
    let mut peer_per_s = None;
    if options.has(Scenario::Otree) {
        peer_per_s = otree::measure(folder, options.connections, options.seconds).await;
    }
    if options.has(Scenario::Fast) {
        for per_commit in [1, options.connections] {
            let per_s = baseline::inserts(folder, per_commit, options.seconds / 4.0).await;
            let name = format!("SQLite alone, trials a commit: {per_commit}");
            row(&name, format!("{per_s:.0}/s"), "");
        }
    }
    let mut broken = 0;
    let is_chosen = |subject: &&Subject| {
        options.databases.iter().any(|name| subject.name.contains(name.as_str()))
    };
    for subject in SUBJECTS.iter().filter(is_chosen) {
        println!("\n{}", subject.name);
        match subject.start(folder).await {
            Ok(under) => broken += on(options, under, peer_per_s).await,
            Err(why) => row("  not measured", "", why),
        }
    }
    if options.has(Scenario::Attacks) {
        for subject in SUBJECTS.iter().filter(is_chosen).filter(|subject| subject.is_alone()) {
            attacks::measure(subject, folder, options.seconds, &options.attacks).await;
        }
    }
    if options.has(Scenario::Start) {
        large::measure(options.trials).await;
    }
    if broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs the chosen scenarios on one database, and returns the number of broken promises.
async fn on(options: &Options, under: Under, peer_per_s: Option<f64>) -> usize {
    if options.has(Scenario::Fast) {
        fast(options, &under, peer_per_s).await;
    }
    if options.has(Scenario::Class) {
        class(&under).await;
    }
    if options.has(Scenario::Natural) {
        natural(options, &under).await;
    }
    let found = under.compared().await;
    row("acknowledged in all", found.acknowledged, "");
    let broken = format!("{} lost, {} different", found.lost, found.different);
    row(
        "  of these in the database",
        broken,
        at_most((found.lost + found.different) as f64, 0.0, ""),
    );
    row("  stored twice", found.twice, at_most(found.twice as f64, 0.0, ""));
    row("  deleted and still there", found.undeleted, at_most(found.undeleted as f64, 0.0, ""));
    row("  stored without an answer", found.unacknowledged, "");
    found.broken()
}

/// Uploads at full speed, and then at a fixed rate.
async fn fast(options: &Options, under: &Under, peer_per_s: Option<f64>) {
    let crowd = &under.crowd;
    // Enough people for 10,000 trials per second.
    let people = (options.seconds * 10_000.0 / 59.0) as usize;
    let begin_cpu_s = under.usage().cpu_s;
    let (count, seconds) = crowd.enrol(people, ENROLLING, 3.0 * options.seconds).await;
    let cpu_ms = 1e3 * (under.usage().cpu_s - begin_cpu_s) / count.max(1) as f64;
    let per_s = count as f64 / seconds;
    let said = format!(
        "{}; {}; {cpu_ms:.2} ms of CPU each",
        at_least(per_s, 300.0, "/s"),
        crowd.take_others()
    );
    row(&format!("enrolments, {ENROLLING} connections"), format!("{per_s:.0}/s"), said);

    crowd.prepare();
    let before = (under.usage(), Usage::of(std::process::id()));
    let (count, seconds) = crowd.upload(options.connections, options.seconds, Pace::Fast).await;
    let after = (under.usage(), Usage::of(std::process::id()));
    let per_s = count as f64 / seconds;
    let latencies = crowd.take_latencies();
    let name = format!("uploads, {} connections", options.connections);
    row(
        &name,
        format!("{per_s:.0}/s"),
        format!("{}; {latencies}", at_least(per_s, under.least_per_s, "/s")),
    );
    let p99_ms = latencies.quantile_ms(0.99);
    row("  99 of 100 within", format!("{p99_ms:.1} ms"), at_most(p99_ms, 50.0, " ms"));
    let cores = |[before, after]: [Usage; 2]| (after.cpu_s - before.cpu_s) / seconds;
    let [memory_mb, most_mb] = after.0.memory_mb;
    let said = format!("{memory_mb:.0} MB (≤ {most_mb:.0})");
    row("  servers", format!("{:.2} cores", cores([before.0, after.0])), said);
    row("  this program", format!("{:.2} cores", cores([before.1, after.1])), "");
    if let Some(peer_per_s) = peer_per_s {
        let ratio = per_s / peer_per_s;
        row("  against oTree", format!("{ratio:.0}×"), at_least(ratio, 20.0, "×"));
    }

    let pace = Pace::PerSecond(options.rate);
    let (count, seconds) = crowd.upload(options.connections, options.seconds, pace).await;
    let per_s = count as f64 / seconds;
    let name = format!("uploads, {:.0} due a second", options.rate);
    row(
        &name,
        format!("{per_s:.0}/s"),
        format!("{}, each from when it was due", crowd.take_latencies()),
    );
    row("  put off by a 503, problems", crowd.troubles(), "");
}

/// Enrols [`CLASS`] people at the same time, while other people upload.
async fn class(under: &Under) {
    let crowd = &under.crowd;
    crowd.enrol(BESIDE_PER_S, ENROLLING, 10.0).await;
    crowd.take_latencies();
    let (enrolled, seconds) = crowd.class(CLASS, BESIDE_PER_S, 40.0).await;
    let all_s = if enrolled == CLASS { seconds } else { f64::INFINITY };
    let name = format!("{CLASS} enrol at once");
    row(&name, format!("{enrolled} in {seconds:.1} s"), at_most(all_s, 5.0, " s"));
    let beside = crowd.take_latencies();
    let p99_ms = beside.quantile_ms(0.99);
    row(
        &format!("  {BESIDE_PER_S} uploads a second beside them"),
        format!("{p99_ms:.1} ms"),
        format!("{}; {beside}", at_most(p99_ms, 100.0, " ms")),
    );
    row("  put off by a 503, problems", crowd.troubles(), "");
    crowd.take_others();
}

/// People upload at their own pace.
async fn natural(options: &Options, under: &Under) {
    let crowd = &under.crowd;
    let habits = Habits { seed: options.seed, ..Habits::default() };
    let (join_s, end_s) = (options.join_s, options.join_s + options.natural_s);
    let watch = async {
        tokio::time::sleep(Duration::from_secs_f64(join_s + habits.period_s)).await;
        let joined = (crowd.take_latencies(), crowd.acknowledged(), under.usage());
        let mut memory_mb = Vec::new();
        let seconds = (options.natural_s - habits.period_s).max(1.0);
        let end = tokio::time::Instant::now() + Duration::from_secs_f64(seconds);
        while tokio::time::Instant::now() < end {
            memory_mb.push(under.usage().memory_mb[0]);
            tokio::time::sleep(Duration::from_secs(1)).await;
        }
        let (_, before, usage) = joined;
        let cores = (under.usage().cpu_s - usage.cpu_s) / seconds;
        let per_s = (crowd.acknowledged() - before) as f64 / seconds;
        (crowd.take_latencies(), per_s, memory_mb, cores)
    };
    let all = crowd.take_part(options.people, habits, join_s, end_s);
    let ((), (latencies, per_s, memory_mb, cores)) = tokio::join!(all, watch);
    let name = format!("{} people, a trial every {:.0} s", options.people, habits.period_s);
    row(&name, format!("{per_s:.0}/s"), format!("{latencies}, each from when it was due"));
    let p99_ms = latencies.quantile_ms(0.99);
    row("  99 of 100 within", format!("{p99_ms:.1} ms"), at_most(p99_ms, 25.0, " ms"));
    row(
        "  all else",
        format!("{} requests", crowd.take_others().count()),
        "joins, reloads, repeats, withdrawals",
    );
    let quarter = memory_mb.len().div_ceil(4);
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let [first, last] =
        [mean(&memory_mb[..quarter]), mean(&memory_mb[memory_mb.len() - quarter..])];
    let most = under.usage().memory_mb[1];
    row("  memory of the servers", format!("{most:.0} MB"), at_most(most, 300.0, " MB"));
    let growth = 100.0 * (last / first - 1.0);
    let name = "  its growth, last quarter to first";
    row(
        name,
        format!("{growth:+.1} %"),
        format!("{first:.0} to {last:.0} MB; {}", at_most(growth, 10.0, " %")),
    );
    row("  servers", format!("{cores:.2} cores"), "");
    row("  put off by a 503, problems", crowd.troubles(), "");
}
