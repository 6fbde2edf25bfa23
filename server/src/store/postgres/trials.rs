//! Trials that wait for a session: one transaction stores all that wait, so that many share the work of a
//! transaction and the wait for the disk.

use super::{COMMIT, QUEUE, Shared, begin};
use crate::store::error::StoreError;
use crate::store::lanes::Lock;
use crate::store::operation::{Batch, Operation};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most trials of a transaction.
const BATCH: usize = 16;

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
    fn take(&self) -> (Vec<Lock>, Batch) {
        let mut waiting = self.waiting();
        let count = waiting.len().min(BATCH);
        let (locks, batch): (Vec<_>, Batch) =
            waiting.drain(..count).filter(|(_, operation)| operation.is_wanted()).unzip();
        (locks.concat(), batch)
    }

    fn waiting(&self) -> MutexGuard<'_, VecDeque<Waiting>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    /// Stores trials that wait, each in a savepoint, so that one that fails is undone and the others remain.
    pub(super) fn write_trials(&self) {
        let (locks, mut batch) = self.trials.take();
        if batch.is_empty() {
            return;
        }
        let is_alone = batch.len() == 1;
        let committed = self.transact([&begin(locks), COMMIT], batch.len(), |db| {
            for operation in &mut batch {
                if is_alone {
                    return operation.run(db);
                }
                db.batch("SAVEPOINT operation")?;
                match operation.run(db) {
                    Ok(()) => db.batch("RELEASE operation")?,
                    Err(error) if error.ends_transaction() => return Err(error),
                    Err(_) => db.batch("ROLLBACK TO operation")?,
                }
            }
            Ok(())
        });
        if committed.is_ok() {
            self.committed.send_modify(|commits| *commits += 1);
        }
        for operation in batch {
            operation.answer(committed.clone());
        }
    }
}
