//! Computes the requested analyses one by one in the background.
//!
//! The row of an analysis in the database is authoritative. A request that cancels or deletes the
//! analysis, or deletes data that it uses, changes the row. The worker notices this when it next
//! records its progress.

use super::limits::Limits;
use super::process::{HowFar, Outcome, compute, study_versions};
use crate::jobs::children::Children;
use crate::store::Store;
use crate::store::analyses::Job;
use crate::store::studies::StoredStudy;
use crate::support::clock::now_ms;
use anyhow::Context;
use sidestep::api::AnalysisResult;
use std::collections::HashSet;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio_util::sync::{CancellationToken, DropGuard};

/// Interval at which progress is recorded and cancellation is checked, so that an analysis stops
/// within 1 s.
const TICK: Duration = Duration::from_millis(250);

/// Interval at which the worker polls for analyses that other servers queued.
const LOOK: Duration = Duration::from_secs(2);

/// Pause after a database error.
const PAUSE: Duration = Duration::from_secs(5);

/// Grace period at a system shutdown. The server receives its termination signal at most this long
/// after its child processes receive theirs.
const SHUTTING_DOWN: Duration = Duration::from_secs(1);

/// The worker, which runs in the background until it is stopped.
#[derive(Debug)]
pub struct AnalysisWorker {
    cancel: DropGuard,
    task: JoinHandle<()>,
}

impl AnalysisWorker {
    /// Starts the worker. It begins with the analyses that an earlier run of the server did not
    /// finish. `asked` notifies the worker that an analysis was queued.
    #[must_use]
    pub fn start(store: Store, asked: Arc<Notify>, children: Children, limits: Limits) -> Self {
        let cancel = CancellationToken::new();
        let name = uuid::Uuid::new_v4().to_string();
        let worker = Worker { name, store, asked, cancel: cancel.clone(), children, limits };
        let task = tokio::spawn(async move { worker.run().await });
        // A worker that is dropped without [`Self::stop`] also ends.
        Self { cancel: cancel.drop_guard(), task }
    }

    /// Interrupts the current analysis. It restarts at the next start of the server.
    pub async fn stop(self) {
        drop(self.cancel);
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the analysis worker failed");
        }
    }
}

struct Worker {
    /// An id of this run of this server, unique among the runs of all servers.
    name: String,
    store: Store,
    asked: Arc<Notify>,
    cancel: CancellationToken,
    children: Children,
    limits: Limits,
}

/// How an attempt at an analysis ended.
enum Ending {
    /// The analysis is over, with a result and the keys of the cells that it needs, or with the
    /// reason for a failure.
    Over(Result<(Box<AnalysisResult>, HashSet<String>), String>),
    /// The analysis is no longer wanted.
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

    /// Completes when it is time to check whether another server queued an analysis or stopped during
    /// an analysis.
    async fn others(&self) {
        match self.store.is_shared() {
            true => tokio::time::sleep(LOOK).await,
            false => std::future::pending().await,
        }
    }

    /// Computes the next analysis, and returns whether there was one. After a database error,
    /// interrupted analyses are requeued first.
    async fn next(&self, recovered: &mut bool) -> anyhow::Result<bool> {
        if !*recovered || self.store.is_shared() {
            // Polling must not write unless there is work, because writes notify open pages.
            if *recovered && !self.store.awaits_worker(now_ms()).await? {
                return Ok(false);
            }
            self.store.recover_analyses(now_ms()).await?;
        }
        let job = self.store.begin_analysis(&self.name, now_ms()).await?;
        *recovered = true;
        let Some(job) = job else { return Ok(false) };
        // If anything fails from here on, the analysis is requeued.
        *recovered = false;
        self.make(&job).await?;
        *recovered = true;
        Ok(true)
    }

    async fn make(&self, job: &Job) -> anyhow::Result<()> {
        tracing::info!(study = job.study, "an analysis begins");
        let found = match self.attempt(job).await? {
            Ending::Over(found) => found,
            Ending::Unwanted => {
                tracing::info!(study = job.study, "an analysis is no longer wanted");
                return Ok(());
            }
            Ending::BrokenOff => {
                return Ok(self.store.give_back_analysis(job).await?);
            }
        };
        let (ending, used) = match found {
            Ok((result, used)) => (Ok(*result), used),
            Err(why) => (Err(why), HashSet::new()),
        };
        let wanted = self.store.end_analysis(job, &ending, used, now_ms()).await?;
        match ending {
            _ if !wanted => tracing::info!(study = job.study, "an analysis came too late"),
            Ok(_) => tracing::info!(study = job.study, "an analysis is done"),
            // The laboratory shows the reason. The reason can name a participant, so the log omits
            // it.
            Err(_) => {
                tracing::warn!(study = job.study, analysis = job.sequence, "an analysis failed")
            }
        }
        Ok(())
    }

    /// Computes an analysis in a child process and records the progress. When the analysis is no
    /// longer wanted or the server stops, the computation is dropped, which kills the process.
    async fn attempt(&self, job: &Job) -> anyhow::Result<Ending> {
        let how_far = HowFar::default();
        let outcome = tokio::select! {
            outcome = self.compute(job, &how_far) => outcome?,
            () = self.until_unwanted(job, &how_far) => Outcome::Unwanted,
            () = self.cancel.cancelled() => return Ok(Ending::BrokenOff),
        };
        Ok(match outcome {
            Outcome::Done { mut result, compared, used } => {
                let study = self.study(job).await?;
                result.study_versions = study_versions(&self.store, &study, &compared).await?;
                Ending::Over(Ok((result, used)))
            }
            Outcome::Failed(why) => Ending::Over(Err(why)),
            Outcome::Unwanted => Ending::Unwanted,
            Outcome::AskedToEnd => {
                // At a shutdown, the system also sends the signal to the server.
                match tokio::time::timeout(SHUTTING_DOWN, self.cancel.cancelled()).await {
                    Ok(()) => Ending::BrokenOff,
                    Err(_) => {
                        Ending::Over(Err("its process was terminated from outside".to_owned()))
                    }
                }
            }
        })
    }

    async fn study(&self, job: &Job) -> anyhow::Result<StoredStudy> {
        self.store.study(&job.study).await?.context("the study of an analysis")
    }

    async fn compute(&self, job: &Job, how_far: &HowFar) -> anyhow::Result<Outcome> {
        let study = self.study(job).await?;
        // More data might have been stored after the analysis was requested.
        match self.limits.check(&self.store, &study, &job.request).await? {
            Ok(_) => compute(&self.store, &study, job, &self.children, how_far).await,
            Err(invalid) => Ok(Outcome::Failed(invalid.to_string())),
        }
    }

    /// Records the progress periodically, until the analysis is no longer wanted.
    async fn until_unwanted(&self, job: &Job, how_far: &HowFar) {
        loop {
            tokio::time::sleep(TICK).await;
            match self.store.note_progress(job, how_far.numbers(), now_ms()).await {
                Ok(true) => {}
                Ok(false) => return,
                // The next attempt might succeed.
                Err(error) => tracing::warn!(%error, "progress was not noted"),
            }
        }
    }
}
