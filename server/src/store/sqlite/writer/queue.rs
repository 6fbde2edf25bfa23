//! The queues of the writer: which operations run next.

use crate::store::error::StoreError;
use crate::store::lanes::Lane;
use crate::store::operation::{Batch, Operation};
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum length of a lane's queue. Further operations are refused.
const QUEUE: usize = 1_024;

/// Maximum number of trials in a batch.
const BATCH: usize = 64;

/// Maximum number of other requests in a batch.
const OTHERS: usize = 64;

/// Pause between two background operations while requests wait.
const BACKGROUND_PAUSE: Duration = Duration::from_millis(50);

#[derive(Default)]
pub(super) struct Lanes {
    pub(super) trials: VecDeque<Operation>,
    pub(super) requests: VecDeque<Operation>,
    pub(super) background: VecDeque<Operation>,
    /// When to try to empty the log. `None` unless emptying the log was requested.
    pub(super) empty_log_at: Option<Instant>,
    /// Whether a rescue was requested, because another process has changed the file.
    pub(super) rescue: bool,
    /// Whether the last write failed because of the disk.
    pub(super) has_failed: bool,
    pub(super) closed: bool,
}

pub(super) struct Queue {
    pub(super) lanes: Mutex<Lanes>,
    pub(super) changed: Condvar,
}

/// The writer thread's next action.
pub(super) enum Next {
    /// Writes a batch whose first `trials` operations store trials.
    Write {
        batch: Batch,
        trials: usize,
    },
    Background(Batch),
    EmptyLog,
    /// Rescues the data into another file, because another process has changed the database.
    Rescue,
    Stop,
}

impl Queue {
    pub(super) fn lanes(&self) -> MutexGuard<'_, Lanes> {
        self.lanes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn push(&self, lane: Lane, operation: Operation) {
        let mut lanes = self.lanes();
        if lanes.closed {
            return operation.answer(Err(StoreError::closed()));
        }
        let queue = match lane {
            Lane::Trial => &mut lanes.trials,
            Lane::Request | Lane::Enrolment => &mut lanes.requests,
            Lane::Background => &mut lanes.background,
        };
        if queue.len() >= QUEUE {
            return operation.answer(Err(StoreError::Busy));
        }
        queue.push_back(operation);
        self.changed.notify_one();
    }

    /// Whether a trial or another request waits.
    pub(super) fn has_requests(&self) -> bool {
        let lanes = self.lanes();
        !lanes.trials.is_empty() || !lanes.requests.is_empty()
    }

    /// Waits for the next action. Operations that were queued before the writer was closed still run.
    pub(super) fn next(&self, last_background: Instant) -> Next {
        let mut lanes = self.lanes();
        loop {
            let now = Instant::now();
            if std::mem::take(&mut lanes.rescue) {
                return Next::Rescue;
            }
            if lanes.empty_log_at.is_some_and(|at| at <= now) {
                lanes.empty_log_at = None;
                return Next::EmptyLog;
            }
            let requested = !lanes.trials.is_empty() || !lanes.requests.is_empty();
            let background_turn =
                !requested || now.duration_since(last_background) >= BACKGROUND_PAUSE;
            if background_turn && let Some(operation) = lanes.background.pop_front() {
                return Next::Background(vec![operation]);
            }
            if requested {
                let Lanes { trials, requests, .. } = &mut *lanes;
                let trials = trials.drain(..trials.len().min(BATCH));
                let count = trials.len();
                let others = requests.drain(..requests.len().min(OTHERS));
                return Next::Write { batch: trials.chain(others).collect(), trials: count };
            }
            if lanes.closed {
                return Next::Stop;
            }
            lanes = match lanes.empty_log_at {
                Some(at) => {
                    let waited = self.changed.wait_timeout(lanes, at.duration_since(now));
                    waited.unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.changed.wait(lanes).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    /// Puts requests back at the front of their queue.
    pub(super) fn put_back(&self, others: Batch) {
        let mut lanes = self.lanes();
        for other in others.into_iter().rev() {
            lanes.requests.push_front(other);
        }
    }

    /// Takes all waiting operations.
    pub(super) fn drain(&self) -> Batch {
        let mut lanes = self.lanes();
        let Lanes { trials, requests, background, .. } = &mut *lanes;
        trials.drain(..).chain(requests.drain(..)).chain(background.drain(..)).collect()
    }
}
