//! Computes the requested analyses one after the other, off the request path.
//!
//! The row of an analysis is the truth: a request that cancels or deletes it, or deletes data that
//! it uses, changes the row, and the worker notices when it next records its progress.

use crate::clock::now_ms;
use crate::jobs::analysis::{AnalysisTask, TaskError};
use crate::jobs::analysis_index::{AnalysisIndex, TrialIds};
use crate::jobs::safety;
use crate::store::Store;
use crate::store::analyses::Job;
use crate::threads::ThreadError;
use crate::{recordings, report};
use anyhow::Context;
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use sidestep::api::{AnalysisResult, MeanAccuracy};
use sidestep::comparison::cell::{Cell, Experiment, ModelName};
use sidestep::comparison::{Analysis, AnalysisError, Cache, Progress};
use sidestep::reachability::SolveError;
use std::collections::HashSet;
use std::io::{self, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::runtime::Handle;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio_util::sync::{CancellationToken, DropGuard};

/// How often progress is recorded.
const TICK: Duration = Duration::from_millis(500);

/// How often the worker looks for analyses of other servers.
const LOOK: Duration = Duration::from_secs(2);

/// How long the worker waits after an error of the database.
const PAUSE: Duration = Duration::from_secs(5);

/// Most files that wait to be written.
const FILES_AHEAD: usize = 4;

/// Rows that are written in one transaction, so that no upload waits for all of them.
const ROWS_AT_ONCE: usize = 1_000;

/// The worker, which runs in the background until it is stopped.
#[derive(Debug)]
pub struct AnalysisWorker {
    cancel: DropGuard,
    task: JoinHandle<()>,
}

impl AnalysisWorker {
    /// Starts the worker, with the analyses that an earlier run of the server did not finish. `asked`
    /// tells it that an analysis was queued.
    #[must_use]
    pub fn start(store: Store, asked: Arc<Notify>, threads: Option<u16>) -> Self {
        let cancel = CancellationToken::new();
        let name = uuid::Uuid::new_v4().to_string();
        let worker = Worker { name, store, asked, cancel: cancel.clone(), threads };
        let task = tokio::spawn(async move { worker.run().await });
        // A worker that is dropped without a stop ends too.
        Self { cancel: cancel.drop_guard(), task }
    }

    /// Interrupts the current analysis, which continues at the next start.
    pub async fn stop(self) {
        drop(self.cancel);
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the worker ended badly");
        }
    }
}

/// The outcome of an analysis in brief.
fn result(analysis: &Analysis) -> AnalysisResult {
    let (data, comparison) = (&analysis.data, &analysis.comparison);
    let sets = comparison.sets();
    let mut accuracies = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let means = comparison.accuracies(model, experiment, &sets);
            accuracies.extend(sets.iter().zip(means).map(|(set, percent)| MeanAccuracy {
                model: model.word().to_owned(),
                experiment: experiment.number(),
                features: (*set).to_owned(),
                percent,
            }));
        }
    }
    AnalysisResult {
        participants: comparison.participants.len(),
        excluded: data.exclusions.iter().map(Into::into).collect(),
        flagged: data.flagged.clone(),
        same_trials: data.same_trials.clone(),
        safety: data.safety,
        cells: comparison.cells.len(),
        models: Some(analysis.counts().models),
        version: Some(env!("CARGO_PKG_VERSION").to_owned()),
        study_versions: Vec::new(),
        data_sha256: Some(data.sha256.clone()),
        accuracies,
        synthetic: data.synthetic.clone(),
    }
}

struct Worker {
    /// Tells the runs of all servers apart.
    name: String,
    store: Store,
    asked: Arc<Notify>,
    cancel: CancellationToken,
    threads: Option<u16>,
}

/// What was computed.
struct Computed {
    analysis: Box<Analysis>,
    /// Of the trials that were compared.
    ids: TrialIds,
}

/// How the computation of an analysis ended.
enum Ending {
    /// With a result, or the reason why there is none.
    Over(Result<Computed, String>),
    /// The analysis is not wanted any more.
    Unwanted,
    /// The server is stopping.
    BrokenOff,
}

impl Worker {
    async fn run(&self) {
        let mut recovered = false;
        while !self.cancel.is_cancelled() {
            match self.next(&mut recovered).await {
                Ok(true) => {}
                Ok(false) => {
                    tokio::select! {
                        () = self.asked.notified() => {}
                        () = self.others() => {}
                        () = self.cancel.cancelled() => {}
                    }
                }
                Err(error) => {
                    tracing::error!(error = format!("{error:#}"), "making an analysis");
                    tokio::select! {
                        () = tokio::time::sleep(PAUSE) => {}
                        () = self.cancel.cancelled() => {}
                    }
                }
            }
        }
    }

    /// Ends when another server may have queued an analysis, or stopped in the middle of one.
    async fn others(&self) {
        match self.store.is_shared() {
            true => tokio::time::sleep(LOOK).await,
            false => std::future::pending().await,
        }
    }

    /// Computes the next analysis, and returns whether there was one. After an error of the
    /// database, interrupted analyses are put back into the queue first.
    async fn next(&self, recovered: &mut bool) -> anyhow::Result<bool> {
        if !*recovered || self.store.is_shared() {
            self.store.recover_analyses(now_ms()).await?;
        }
        let job = self.store.begin_analysis(&self.name, now_ms()).await?;
        *recovered = true;
        let Some(job) = job else { return Ok(false) };
        // If anything fails from here on, the analysis is queued again.
        *recovered = false;
        self.make(&job).await?;
        *recovered = true;
        Ok(true)
    }

    async fn make(&self, job: &Job) -> anyhow::Result<()> {
        tracing::info!(study = job.study, "an analysis begins");
        let kept = Arc::new(StoredCells {
            store: self.store.clone(),
            job: job.clone(),
            runtime: Handle::current(),
            used: Mutex::default(),
            fresh: AtomicUsize::new(0),
        });
        let found = match self.compared(job, &kept).await? {
            Ending::Over(found) => found,
            Ending::Unwanted => {
                tracing::info!(study = job.study, "an analysis is not wanted any more");
                return Ok(());
            }
            Ending::BrokenOff => {
                return Ok(self.store.give_back_analysis(job).await?);
            }
        };
        let ending = match found {
            Ok(Computed { analysis, ids }) => {
                let study_versions = self.study_versions(job, &analysis).await?;
                let result = AnalysisResult { study_versions, ..result(&analysis) };
                let index = AnalysisIndex::of(&analysis, &ids);
                if self.keep(job, analysis).await? {
                    self.list(job, index).await?;
                }
                Ok(result)
            }
            Err(message) => Err(message),
        };
        let used = kept.used.lock().unwrap_or_else(|broken| broken.into_inner()).clone();
        let wanted = self.store.end_analysis(job, &ending, used, now_ms()).await?;
        match ending {
            _ if !wanted => tracing::info!(study = job.study, "an analysis came too late"),
            Ok(_) => tracing::info!(study = job.study, "an analysis is done"),
            Err(reason) => tracing::warn!(study = job.study, reason, "an analysis failed"),
        }
        Ok(())
    }

    /// The versions of the study under which the compared participants enrolled.
    async fn study_versions(&self, job: &Job, analysis: &Analysis) -> anyhow::Result<Vec<u32>> {
        let Some(study) = self.store.study(&job.study).await? else { return Ok(Vec::new()) };
        let compared = &analysis.comparison.participants;
        let hashes: HashSet<String> = self
            .store
            .roster(study.id, false)
            .await?
            .into_iter()
            .filter(|entry| compared.iter().any(|of| of.name == entry.number.to_string()))
            .map(|entry| entry.config_hash)
            .collect();
        let versions = self.store.study_versions(study.id).await?;
        let used = versions.iter().filter(|version| hashes.contains(&version.hash));
        Ok(used.map(|version| version.number).collect())
    }

    /// Reads the data, computes on threads of its own, and records the progress in the database.
    async fn compared(&self, job: &Job, kept: &Arc<StoredCells>) -> anyhow::Result<Ending> {
        // Cancelled with the worker, or alone if the job is no longer valid.
        let cancel = self.cancel.child_token();
        let progress = Arc::new([AtomicUsize::new(0), AtomicUsize::new(0)]);
        let work = self.work(job, Arc::clone(kept), cancel.clone(), Arc::clone(&progress));
        let mut work = std::pin::pin!(work);
        let mut unwanted = false;
        let found = loop {
            tokio::select! {
                found = &mut work => break found?,
                () = tokio::time::sleep(TICK), if !unwanted => {
                    let [done, of] = [0, 1].map(|i: usize| progress[i].load(Ordering::Relaxed));
                    let fresh = kept.fresh.load(Ordering::Relaxed);
                    match self.store.note_progress(job, [done, of, fresh], now_ms()).await {
                        Ok(wanted) => unwanted = !wanted,
                        // The next report may succeed.
                        Err(error) => tracing::warn!(%error, "progress was not noted"),
                    }
                    if unwanted {
                        cancel.cancel();
                    }
                }
            }
        };
        Ok(match found {
            Some(found) => Ending::Over(found),
            None if unwanted => Ending::Unwanted,
            None => Ending::BrokenOff,
        })
    }

    /// The analysis, or the reason why there is none; nothing once `cancel` is cancelled.
    async fn work(
        &self,
        job: &Job,
        cache: Arc<StoredCells>,
        cancel: CancellationToken,
        progress: Arc<[AtomicUsize; 2]>,
    ) -> anyhow::Result<Option<Result<Computed, String>>> {
        let study = self.store.study(&job.study).await?;
        let study = study.context("the study of an analysis")?;
        let recording = recordings::of_study(&self.store, &study).await?;
        let ids = TrialIds::of(&recording);
        let safety = match safety::ensure(&self.store, &study, &cancel).await? {
            Ok(safety) => safety,
            Err(SolveError::Cancelled) => return Ok(None),
            Err(SolveError::Invalid(invalid)) => return Ok(Some(Err(invalid.to_string()))),
        };
        // One processor remains for requests.
        let spare = || std::thread::available_parallelism().map_or(1, |all| (all.get() - 1).max(1));
        let threads = Some(self.threads.map_or_else(spare, usize::from));
        let request = job.request.clone();
        let task = AnalysisTask { recording, given: None, safety, request, cache, threads, cancel };
        let step = move |now: Progress| {
            progress[0].fetch_max(now.done, Ordering::Relaxed);
            progress[1].store(now.of, Ordering::Relaxed);
        };
        Ok(match task.run(step).await {
            Ok(analysis) => Some(Ok(Computed { analysis: Box::new(analysis), ids })),
            Err(TaskError::Analysis(AnalysisError::Stopped)) => None,
            Err(TaskError::Thread(ThreadError::Panicked)) => {
                Some(Err("the comparison failed; see the server's log".to_owned()))
            }
            Err(TaskError::Thread(error)) => return Err(error.into()),
            Err(error) => Some(Err(error.to_string())),
        })
    }

    /// Stores the files, compressed, one by one. Returns whether the job is still valid.
    async fn keep(&self, job: &Job, analysis: Box<Analysis>) -> anyhow::Result<bool> {
        let (files, mut packed) =
            tokio::sync::mpsc::channel::<(String, usize, Vec<u8>)>(FILES_AHEAD);
        let packing = tokio::task::spawn_blocking(move || {
            report::each_file(&analysis, &mut |name, write| {
                let mut out = Counted { out: gzip(), bytes: 0 };
                write(&mut out)?;
                let file = (name.to_owned(), out.bytes, out.out.finish()?);
                files.blocking_send(file).map_err(|_| io::Error::other("nobody takes the files"))
            })
        });
        while let Some((name, size, bytes)) = packed.recv().await {
            if !self.store.put_analysis_file(job, &name, size, bytes, now_ms()).await? {
                // The other files are not needed.
                return Ok(false);
            }
        }
        packing.await.context("packing the files")??;
        Ok(true)
    }

    /// Stores what lists and replays say of the models, whose files are stored.
    async fn list(&self, job: &Job, index: AnalysisIndex) -> anyhow::Result<()> {
        for rows in index.predictors.chunks(ROWS_AT_ONCE) {
            if !self.store.put_predictors(job, rows.to_vec()).await? {
                return Ok(());
            }
        }
        for rows in index.tasks.chunks(ROWS_AT_ONCE) {
            if !self.store.put_used_tasks(job, rows.to_vec()).await? {
                return Ok(());
            }
        }
        Ok(())
    }
}

fn gzip() -> GzEncoder<Vec<u8>> {
    GzEncoder::new(Vec::new(), Compression::fast())
}

/// A writer that counts its bytes.
struct Counted<W> {
    out: W,
    bytes: usize,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.bytes += written;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// The study's cells in the database, as a cache for the computing threads.
struct StoredCells {
    store: Store,
    job: Job,
    runtime: Handle,
    used: Mutex<HashSet<String>>,
    /// How many pieces were computed and not reused.
    fresh: AtomicUsize,
}

impl StoredCells {
    fn note(&self, key: &str) {
        // A thread that panicked leaves the set valid.
        self.used.lock().unwrap_or_else(|broken| broken.into_inner()).insert(key.to_owned());
    }
}

impl Cache for StoredCells {
    fn get(&self, key: &str) -> Option<Vec<Cell>> {
        let kept = self.runtime.block_on(self.store.cells(self.job.study_id, key));
        let bytes = kept.ok()??;
        let cells = serde_json::from_reader(io::BufReader::new(GzDecoder::new(&bytes[..]))).ok()?;
        self.note(key);
        Some(cells)
    }

    fn put(&self, key: &str, cells: &[Cell]) {
        self.note(key);
        self.fresh.fetch_add(1, Ordering::Relaxed);
        let mut out = gzip();
        let packed = serde_json::to_writer(&mut out, cells).map_err(io::Error::from);
        let kept =
            packed.and_then(|()| out.finish()).map_err(anyhow::Error::from).and_then(|bytes| {
                Ok(self.runtime.block_on(self.store.put_cells(&self.job, key, bytes))?)
            });
        if let Err(error) = kept {
            // Only time is lost.
            tracing::warn!(%error, "cells of an analysis were not kept");
        }
    }
}
