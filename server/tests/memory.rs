//! Import and export take no more memory for a longer study. It counts what the whole process allocates (all
//! but SQLite, whose cache has a limit), so it runs without the test harness and its threads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use peak_alloc::PeakAlloc;
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep_server::commands::import::{self, ImportArgs};
use sidestep_server::formats::exports::{self, Filter, Format};
use sidestep_server::store::{Missing, Store};
use std::fmt::Write as _;
use std::future::Future;
use tokio_util::sync::CancellationToken;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

const MB: f64 = 1e6;

/// An import has up to four batches of 256 trials between its threads, of about 1 MB each, fewer or more as the
/// threads happen to run. A hundred people more, held whole, would take 14 MB.
const QUEUES_MB: f64 = 5.0;

#[tokio::main]
async fn main() {
    // Several batches each. The rows of the longer study fill seven row groups of a Parquet file.
    let short = peaks(20).await;
    let long = peaks(120).await;
    eprintln!("peaks, MB: {short:.2?} for 20 people, {long:.2?} for 120");
    for (name, (short, long)) in
        ["import", "csv", "jsonl"].into_iter().zip(short.into_iter().zip(long))
    {
        assert!(short > 0.2, "{name}: {short:.2}: is anything counted?");
        assert!(long <= short + QUEUES_MB, "{name}: {short:.2} MB, then {long:.2} MB");
    }
    // One row group is in memory, however many there are.
    assert!(long[3] <= 40.0, "parquet: {:.1} MB", long[3]);
}

/// The most memory, MB, of an import and of an export in each format.
async fn peaks(people: u64) -> [f64; 4] {
    let folder = tempfile::tempdir().unwrap();
    let trials = folder.path().join("trials.csv");
    std::fs::write(&trials, file(people)).unwrap();
    let database = format!("sqlite:{}", folder.path().join("study.db").display());
    let args = ImportArgs { database: database.clone(), study: "default".to_owned(), trials };
    let import = peak(async { import::run(args).await.unwrap() }).await;
    let store = Store::open(&database, Missing::Refuse).await.unwrap();
    let study = store.study("default").await.unwrap().unwrap();
    let mut peaks = [import, 0.0, 0.0, 0.0];
    for (at, format) in [Format::Csv, Format::Jsonl, Format::Parquet].into_iter().enumerate() {
        let (filter, stop) = (Filter::default(), CancellationToken::new());
        let out = folder.path().join(format.ending());
        peaks[at + 1] = peak(async {
            exports::write(&store, &study, format, &filter, &out, &stop).await.unwrap();
        })
        .await;
    }
    store.close().await;
    peaks
}

async fn peak(work: impl Future<Output = ()>) -> f64 {
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    work.await;
    (MEMORY.peak_usage() - before) as f64 / MB
}

/// Forty trials of each of these people.
fn file(people: u64) -> String {
    let mut text = "participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega,synthetic\n".to_owned();
    for number in 0..people {
        let person = SyntheticParticipant::new(1, number).recorded(40, Keys::Clock);
        for trial in person.trials {
            for (step, (input, state)) in trial.inputs.iter().zip(&trial.states).enumerate() {
                let ([hx, hy, hpsi], [rx, ry, rpsi]) = (state.human.into(), state.robot.into());
                let (t, omega) = (step as f64 * 0.2, 0.5 * f64::from(input.sign()));
                let (name, trial) = (&person.name, trial.number);
                let states = format!("{hx:?},{hy:?},{hpsi:?},{rx:?},{ry:?},{rpsi:?}");
                writeln!(text, "{name},{trial},{step},{t},{states},{omega},1").unwrap();
            }
        }
    }
    text
}
