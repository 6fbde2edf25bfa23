//! Lookups that wait for their session: it asks all of them at once, so that many share its way to the database and
//! back, and each its wake-ups.

use super::{QUEUE, Shared};
use crate::store::error::StoreError;
use crate::store::operation::Operation;
use crate::store::sql::{Connection, Question};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most lookups that are asked at once.
const BATCH: usize = 32;

/// What a request asks the database before anything else.
pub(super) struct Lookup {
    /// What it asks.
    pub(super) question: Question,
    /// Reads the answer, and nothing but that.
    pub(super) operation: Box<dyn Operation>,
}

/// The lookups that wait, the oldest first.
#[derive(Default)]
pub(super) struct Lookups(Mutex<VecDeque<Lookup>>);

impl Lookups {
    pub(super) fn push(&self, lookup: Lookup) -> Result<(), StoreError> {
        let mut waiting = self.waiting();
        if waiting.len() >= QUEUE {
            return Err(StoreError::Busy);
        }
        waiting.push_back(lookup);
        Ok(())
    }

    /// Takes as many as are asked at once; none if another turn has taken them.
    fn take(&self) -> Vec<Lookup> {
        let mut waiting = self.waiting();
        let count = waiting.len().min(BATCH);
        waiting.drain(..count).filter(|lookup| lookup.operation.is_wanted()).collect()
    }

    fn waiting(&self) -> MutexGuard<'_, VecDeque<Lookup>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Shared {
    /// Answers lookups that wait.
    pub(super) fn look_up(&self) {
        let mut batch = self.lookups.take();
        if batch.is_empty() {
            return;
        }
        let done = self.pool.with(|db| {
            let questions: Vec<_> = batch.iter().map(|lookup| &lookup.question).collect();
            db.ask_ahead(&questions)?;
            let read = batch.iter_mut().try_for_each(|lookup| answered(lookup, db));
            db.forget_answers();
            read
        });
        for lookup in batch {
            lookup.operation.answer(done.clone());
        }
    }
}

/// Reads an answer. What is wrong with it concerns its own request alone, unless the database is away.
fn answered(lookup: &mut Lookup, db: &Connection) -> Result<(), StoreError> {
    match lookup.operation.run(db) {
        Err(error) if error.ends_transaction() => Err(error),
        _ => Ok(()),
    }
}
