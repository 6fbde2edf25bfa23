//! The queue of trials that wait for a session. One transaction stores a batch of trials, so that
//! they share its overhead and the wait for the disk (group commit).

use super::{COMMIT, QUEUE, Shared, taking};
use crate::store::error::StoreError;
use crate::store::lanes::Lock;
use crate::store::operation::{Operation, run_together};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of trials in a transaction.
const BATCH: usize = 32;

pub(super) struct Waiting {
    /// The locks that the trial needs.
    pub(super) locks: Vec<Lock>,
    /// The operation that stores the trial.
    pub(super) operation: Operation,
}

/// After a trial arrives, more trials are expected for this long.
const COMING: Duration = Duration::from_millis(200);

/// The queue of trials, oldest first.
#[derive(Default)]
pub(super) struct Trials {
    waiting: Mutex<VecDeque<Waiting>>,
    /// Arrival of the newest trial.
    newest: Mutex<Option<Instant>>,
    /// Number of transactions begun.
    turns: AtomicUsize,
}

impl Trials {
    /// Adds a trial, or returns it if too many are waiting.
    pub(super) fn push(&self, trial: Waiting) -> Result<(), Waiting> {
        let mut waiting = self.waiting();
        if waiting.len() >= QUEUE {
            return Err(trial);
        }
        waiting.push_back(trial);
        *self.newest.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        Ok(())
    }

    /// Whether a trial has arrived recently, so that more trials are expected.
    pub(super) fn are_coming(&self) -> bool {
        let newest = self.newest.lock().unwrap_or_else(PoisonError::into_inner);
        newest.is_some_and(|newest| newest.elapsed() < COMING)
    }

    pub(super) fn count(&self) -> usize {
        self.waiting().len()
    }

    /// Takes a batch for one transaction, or an empty one if other transactions have taken all trials.
    fn take(&self) -> Vec<Waiting> {
        let mut waiting = self.waiting();
        waiting.retain(|trial| trial.operation.is_wanted());
        let count = waiting.len().min(BATCH);
        waiting.drain(..count).collect()
    }

    fn waiting(&self) -> MutexGuard<'_, VecDeque<Waiting>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// First key of the advisory locks that limit the number of concurrent transactions with trials.
/// Each transaction takes one lock. See [`Lock::numbers`] for the other locks.
const TURN: i32 = 1_000;

/// Statements that begin a transaction and wait for one of the advisory locks. So all servers
/// together run at most `writers` transactions that store trials at a time. If there were more
/// transactions than PostgreSQL has cores, each transaction would take longer and store fewer
/// trials. The statements try all locks, beginning with lock `first`. If all locks are taken, they
/// wait for lock `first`.
fn begin_in_turn(writers: usize, first: usize) -> String {
    let turns = (0..writers).map(|i| (first + i) % writers);
    let tries: String = turns
        .map(|turn| format!("WHEN pg_try_advisory_xact_lock({TURN}, {turn}) THEN 1 "))
        .collect();
    let first = first % writers;
    format!(
        "BEGIN; SELECT CASE {tries}ELSE (SELECT 1 FROM pg_advisory_xact_lock({TURN}, {first})) END"
    )
}

impl Shared {
    /// Stores queued trials in one transaction. If one trial fails, each trial is stored in its own
    /// transaction. Savepoints would cost two round trips per trial, and a separate lock on the study's
    /// row.
    pub(super) fn write_trials(&self) {
        if self.trials.count() == 0 {
            return;
        }
        let mut batch = Vec::new();
        let committed = self.write_together(|| self.trials.take(), &mut batch);
        if batch.is_empty() && committed.is_err() {
            // The transaction never began, because the database is unavailable.
            batch = self.trials.take();
        }
        match committed {
            Err(error) if batch.len() > 1 && !error.ends_transaction() => {
                for alone in batch {
                    let mut stored = Vec::new();
                    let mut alone = Some(alone);
                    let committed =
                        self.write_together(|| alone.take().into_iter().collect(), &mut stored);
                    // If the transaction never began, the trial was not taken, and is answered, too.
                    stored.extend(alone);
                    self.answer(stored, committed);
                }
            }
            committed => self.answer(batch, committed),
        }
    }

    /// Refuses all queued trials.
    pub(super) fn refuse_trials(&self, error: &StoreError) {
        loop {
            let batch = self.trials.take();
            if batch.is_empty() {
                return;
            }
            self.answer(batch, Err(error.clone()));
        }
    }

    /// Begins a transaction with [`begin_in_turn`], moves trials from `take` into `batch`, and
    /// stores them.
    fn write_together(
        &self,
        take: impl FnOnce() -> Vec<Waiting>,
        batch: &mut Vec<Waiting>,
    ) -> Result<(), StoreError> {
        let turn = self.trials.turns.fetch_add(1, Ordering::Relaxed);
        let begun = Instant::now();
        self.transact([&begin_in_turn(self.sessions.writers(), turn), COMMIT], |db| {
            *batch = take();
            let locks = batch.iter().flat_map(|trial| trial.locks.clone()).collect();
            db.batch(&taking(locks))?;
            run_together(db, batch.iter_mut().map(|trial| &mut trial.operation))
        })?;
        self.observed.note(batch.len(), begun.elapsed());
        Ok(())
    }

    fn answer(&self, batch: impl IntoIterator<Item = Waiting>, committed: Result<(), StoreError>) {
        if committed.is_ok() {
            self.committed.send_modify(|commits| *commits += 1);
        }
        for trial in batch {
            trial.operation.answer(committed.clone());
        }
    }
}
