//! Trials that wait for a session: one transaction stores all that wait, so that many share the work of a
//! transaction and the wait for the disk.

use super::{COMMIT, QUEUE, Shared, begin};
use crate::store::error::StoreError;
use crate::store::lanes::Lock;
use crate::store::operation::Operation;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most trials of a transaction.
const BATCH: usize = 32;

type Waiting = (Vec<Lock>, Box<dyn Operation>);

/// The trials that wait, the oldest first.
#[derive(Default)]
pub(super) struct Trials(Mutex<VecDeque<Waiting>>);

impl Trials {
    pub(super) fn push(
        &self,
        locks: Vec<Lock>,
        operation: Box<dyn Operation>,
    ) -> Result<(), StoreError> {
        let mut waiting = self.waiting();
        if waiting.len() >= QUEUE {
            return Err(StoreError::Busy);
        }
        waiting.push_back((locks, operation));
        Ok(())
    }

    /// How many wait.
    pub(super) fn count(&self) -> usize {
        self.waiting().len()
    }

    /// Takes as many as one transaction stores; none if others have taken them.
    fn take(&self) -> Vec<Waiting> {
        let mut waiting = self.waiting();
        let count = waiting.len().min(BATCH);
        waiting.drain(..count).filter(|(_, operation)| operation.is_wanted()).collect()
    }

    fn waiting(&self) -> MutexGuard<'_, VecDeque<Waiting>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    /// Stores trials that wait, in one transaction. If one of them fails, each is stored in its own: savepoints
    /// would cost every trial two messages, and each a lock of its own on the row of the study.
    pub(super) fn write_trials(&self) {
        let mut batch = self.trials.take();
        if batch.is_empty() {
            return;
        }
        match self.write_together(&mut batch) {
            Err(error) if batch.len() > 1 && !error.ends_transaction() => {
                for alone in batch {
                    let mut alone = [alone];
                    let committed = self.write_together(&mut alone);
                    self.answer(alone, committed);
                }
            }
            committed => self.answer(batch, committed),
        }
    }

    fn write_together(&self, batch: &mut [Waiting]) -> Result<(), StoreError> {
        let locks = batch.iter().flat_map(|(locks, _)| locks.clone()).collect();
        self.transact([&begin(locks), COMMIT], batch.len(), |db| {
            batch.iter_mut().try_for_each(|(_, operation)| operation.run(db))
        })
    }

    fn answer(&self, batch: impl IntoIterator<Item = Waiting>, committed: Result<(), StoreError>) {
        if committed.is_ok() {
            self.committed.send_modify(|commits| *commits += 1);
        }
        for (_, operation) in batch {
            operation.answer(committed.clone());
        }
    }
}
