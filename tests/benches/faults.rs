//! Repeated kills of servers and power cuts: `cargo xtask bench faults`.
//!
//! The seed determines all random choices. The tests `faults` do the same with fewer repetitions.
#![allow(clippy::print_stdout, reason = "a benchmark answers on standard output")]

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use sidestep_tests::load::figures::{at_most, row};
use sidestep_tests::load::kills::{Kills, kill};
use sidestep_tests::load::{Crowd, Latencies, compare};
use sidestep_tests::postgres::{Cluster, Fsync};
use sidestep_tests::power::Disk;
use sidestep_tests::power::cuts::Session;
use sidestep_tests::{Database, Folder, Process};
use tokio::task::LocalSet;

/// Kills servers and cuts their power.
#[derive(Parser)]
#[command(name = "cargo xtask bench faults --")]
struct Options {
    /// Number of times that a server is killed (SIGKILL) during uploads, for each database.
    #[arg(long, default_value_t = 20)]
    kills: u32,
    /// Number of power cuts.
    #[arg(long, default_value_t = 100)]
    cuts: u32,
    /// People whose uploads are recorded for the power cuts. Every second person deletes their
    /// data.
    #[arg(long, default_value_t = 12)]
    people: usize,
    /// Connections that upload while servers are killed.
    #[arg(long, default_value_t = 32)]
    connections: usize,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Do a fifth of the kills and cuts.
    #[arg(long)]
    quick: bool,
    /// Ignored; other benchmarks use it.
    #[arg(long, hide = true)]
    discard_baseline: bool,
    #[arg(long, hide = true)]
    bench: bool,
}

#[derive(Clone, Copy)]
enum Kind {
    Sqlite,
    Postgres,
}

/// Configurations whose servers are killed: name, database, and number of servers that run at the
/// same time.
const SUBJECTS: &[(&str, Kind, usize)] = &[
    ("sqlite", Kind::Sqlite, 1),
    ("postgres, 1 server", Kind::Postgres, 1),
    ("postgres, 2 servers, one of them killed", Kind::Postgres, 2),
];

#[tokio::main(flavor = "current_thread")]
async fn main() -> ExitCode {
    let mut options = Options::parse();
    if options.quick {
        options.kills /= 5;
        options.cuts /= 5;
    }
    let mut broken = 0;
    for (name, kind, servers) in SUBJECTS {
        println!("\n{name}");
        broken += LocalSet::new().run_until(kills(&options, *kind, *servers)).await;
    }
    println!("\nsqlite, power cuts");
    broken += cuts(&options).await;
    if broken == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Kills servers, and returns the number of broken promises.
async fn kills(options: &Options, kind: Kind, servers: usize) -> usize {
    // The folder must be on a disk, because the folder for temporary files can be in memory.
    let folder = Folder::within(env!("CARGO_TARGET_TMPDIR"));
    let cluster = matches!(kind, Kind::Postgres).then(|| Cluster::start(Fsync::On));
    let database = match &cluster {
        Some(cluster) => cluster.create(),
        None => Database::file(folder.root(), "killed.db"),
    };
    if let Err(log) = Process::try_start_on(&folder, &database).await {
        row("not tested", "", log.lines().last().unwrap_or_default());
        return 0;
    }
    let crowd = Crowd::of(&[]);
    let folders: Vec<Folder> = (0..servers).map(|_| Folder::default()).collect();
    let kills = Kills {
        count: options.kills,
        most_between: 500,
        connections: options.connections,
        seed: options.seed,
    };
    let begin = Instant::now();
    let ready = kill(&crowd, &folders, &database, kills).await;
    let seconds = begin.elapsed().as_secs_f64();
    row("kills", options.kills, format!("{seconds:.0} s, seed {}", options.seed));
    row("  put off by a 503, problems", crowd.troubles(), "");
    let found = compare(&crowd.everybody(), &database).await;
    row("  acknowledged", found.acknowledged, "");
    row("  lost", found.lost, at_most(found.lost as f64, 0.0, ""));
    row("  different", found.different, at_most(found.different as f64, 0.0, ""));
    row("  stored twice", found.twice, at_most(found.twice as f64, 0.0, ""));
    row("  stored without an answer", found.unacknowledged, "");
    let last_s = ready.quantile_ms(1.0) / 1e3;
    row(
        "  ready again",
        format!("{last_s:.2} s"),
        format!("{}; {ready}", at_most(last_s, 2.0, " s")),
    );
    found.broken() + usize::from(last_s > 2.0)
}

/// Records one session and cuts the power at random points of it. Returns the number of broken
/// promises.
async fn cuts(options: &Options) -> usize {
    let session = Session { people: options.people, trials: 59, seed: options.seed };
    let mut recorded = session.record().await;
    let (first, last) = recorded.moments();
    row(
        "what SQLite did to its files",
        last,
        format!("moments; people were owed trials from {first} on"),
    );
    let (mut lost, mut damaged, mut ready) = (0, 0, Latencies::default());
    for _ in 0..options.cuts {
        let moment = recorded.any_moment();
        match recorded.cut(moment, Disk::Honest).await {
            Ok((found, folder)) => {
                lost += found.broken();
                let begin = Instant::now();
                let database = Database::file(folder.root(), "sidestep.db");
                Process::start_on(&folder, &database).await.kill().await;
                ready.note(begin.elapsed());
            }
            Err(error) => {
                println!("at moment {moment}: {error}");
                damaged += 1;
            }
        }
    }
    row("power cuts", options.cuts, format!("seed {}", options.seed));
    row("  acknowledged and lost", lost, at_most(lost as f64, 0.0, ""));
    row("  damaged databases", damaged, at_most(damaged as f64, 0.0, ""));
    let last_s = ready.quantile_ms(1.0) / 1e3;
    row(
        "  ready again",
        format!("{last_s:.2} s"),
        format!("{}; {ready}", at_most(last_s, 2.0, " s")),
    );
    let mut noticed = 0;
    for _ in 0..options.cuts {
        let moment = recorded.any_moment();
        let honest = recorded.cut(moment, Disk::Lying).await;
        noticed += usize::from(!honest.is_ok_and(|(found, _)| found.broken() == 0));
    }
    let said =
        format!("of {}: cuts that a disk which ignores syncs does not survive", options.cuts);
    row("  counterproof", noticed, said);
    lost + damaged + usize::from(last_s > 2.0 || noticed == 0)
}
