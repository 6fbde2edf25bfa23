//! Import and export need no more memory for a longer study. The test counts the allocations of the
//! whole process (except SQLite's, because SQLite's cache is limited). Therefore it runs without
//! the test harness and its threads.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use peak_alloc::PeakAlloc;
use sidestep::synthetic::{Keys, SyntheticParticipant};
use sidestep_server::commands::import::{self, ImportArgs};
use sidestep_server::formats::exports::{self, Dataset, Filter, Format};
use sidestep_server::store::{Purpose, Store};
use std::fmt::Write as _;
use std::future::Future;
use tokio_util::sync::CancellationToken;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

const MB: f64 = 1e6;

/// An import buffers up to four batches of 256 trials between its threads, about 1 MB each. The
/// number of buffered batches depends on timing. A hundred more people in memory would take 14 MB.
const QUEUES_MB: f64 = 5.0;

#[tokio::main]
async fn main() {
    // Both studies have several batches. The rows of the longer study fill seven row groups of a
    // Parquet file.
    let short = peaks(20).await;
    let long = peaks(120).await;
    eprintln!("peaks, MB: {short:.2?} for 20 people, {long:.2?} for 120");
    for ((name, short), (_, long)) in short.iter().zip(&long) {
        assert!(*short > 0.2, "{name}: {short:.2}: is anything counted?");
        // At most one row group is in memory, regardless of the number of row groups.
        let most = if name.contains("parquet") { 40.0 } else { short + QUEUES_MB };
        assert!(*long <= most, "{name}: {short:.2} MB, then {long:.2} MB");
    }
}

/// Peak memory (MB) of an import, and of exports in each format, as a folder and as an archive.
async fn peaks(people: u64) -> Vec<(String, f64)> {
    let folder = tempfile::tempdir().unwrap();
    let trials = folder.path().join("trials.csv");
    std::fs::write(&trials, file(people)).unwrap();
    let database = format!("sqlite:{}", folder.path().join("study.db").display());
    let args = ImportArgs { database: database.clone(), study: "default".to_owned(), trials };
    let import = peak(async { import::run(args).await.unwrap() }).await;
    let store = Store::open(&database, Purpose::Read).await.unwrap();
    let study = store.study("default").await.unwrap().unwrap();
    let mut peaks = vec![("import".to_owned(), import)];
    let formats = [Format::Csv, Format::Jsonl, Format::Parquet, Format::PsychDs, Format::Sqlite];
    for format in formats {
        let word = format.word();
        let dataset = Dataset::read(&store, &study, &Filter::default()).await.unwrap();
        let (copy, stop) = (dataset.clone(), CancellationToken::new());
        let out = folder.path().join(word);
        let written = peak(async {
            exports::write(&store, copy, format, &out, &stop).await.unwrap();
        });
        peaks.push((word.to_owned(), written.await));
        let (store, scratch) = (store.clone(), folder.path().to_owned());
        let sent = peak(async move {
            let runtime = tokio::runtime::Handle::current();
            let write = move || {
                exports::archive(&store, &dataset, format, &runtime, &scratch, std::io::sink())
            };
            tokio::task::spawn_blocking(write).await.unwrap().unwrap();
        });
        peaks.push((format!("archive of {word}"), sent.await));
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

/// The trials of this many people as CSV, forty trials each.
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
