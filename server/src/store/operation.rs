//! Queued operations, which run together in one transaction and are answered after its commit.

use super::error::StoreError;
use super::sql::{Connection, Question};
use std::panic::{AssertUnwindSafe, catch_unwind};
use tokio::sync::oneshot;

/// A queued operation.
pub(super) trait Operation: Send {
    /// Whether a caller still waits for the answer.
    fn is_wanted(&self) -> bool;
    /// The operation's first [query](Connection::query_ahead), if it can be prefetched.
    fn question(&self) -> Option<&Question>;
    /// Does the work in a transaction. After an error, the work is rolled back, and may run again.
    fn run(&mut self, db: &Connection) -> Result<(), StoreError>;
    /// Records that a deferred statement of the work failed.
    fn fail(&mut self, error: &StoreError);
    /// Sends the result, after the commit has succeeded or failed.
    fn answer(self: Box<Self>, committed: Result<(), StoreError>);
}

/// Operations that run in one transaction.
pub(super) type Batch = Vec<Box<dyn Operation>>;

/// Receives the result of an operation.
pub(super) type Answered<T> = oneshot::Receiver<Result<T, StoreError>>;

/// Runs operations and their deferred statements. The first queries of the operations are
/// prefetched as a batch.
pub(super) fn run_together<'a>(
    db: &Connection,
    operations: impl Iterator<Item = &'a mut Box<dyn Operation>>,
) -> Result<(), StoreError> {
    let operations: Vec<_> = operations.collect();
    let questions = operations.iter().filter_map(|operation| operation.question().cloned());
    db.ask_ahead(questions.collect())?;
    let done = operations.into_iter().try_for_each(|operation| operation.run(db));
    let done = done.and_then(|()| Ok(db.settle()?));
    db.forget_asked();
    done
}

/// An operation that does this work, and the receiver of its result. `question` is the first query
/// of the work, if it can be prefetched.
pub(super) fn operation<T: Send + 'static>(
    question: Option<Question>,
    work: impl FnMut(&Connection) -> Result<T, StoreError> + Send + 'static,
) -> (Box<dyn Operation>, Answered<T>) {
    let (answer, answered) = oneshot::channel();
    (Box::new(Waiting { question, work, found: None, answer }), answered)
}

struct Waiting<T, W> {
    question: Option<Question>,
    work: W,
    found: Option<Result<T, StoreError>>,
    answer: oneshot::Sender<Result<T, StoreError>>,
}

impl<T, W> Operation for Waiting<T, W>
where
    T: Send,
    W: FnMut(&Connection) -> Result<T, StoreError> + Send,
{
    fn is_wanted(&self) -> bool {
        !self.answer.is_closed()
    }

    fn question(&self) -> Option<&Question> {
        self.question.as_ref()
    }

    fn run(&mut self, db: &Connection) -> Result<(), StoreError> {
        let found = catch_unwind(AssertUnwindSafe(|| (self.work)(db)));
        let found = found.unwrap_or_else(|_| Err(StoreError::Defect("it panicked".to_owned())));
        let error = found.as_ref().err().cloned();
        self.found = Some(found);
        error.map_or(Ok(()), Err)
    }

    fn fail(&mut self, error: &StoreError) {
        self.found = Some(Err(error.clone()));
    }

    fn answer(self: Box<Self>, committed: Result<(), StoreError>) {
        let Self { found, answer, .. } = *self;
        let never_ran = || Err(StoreError::Unavailable("it was closed".to_owned()));
        // If this fails, the client has disconnected, and has seen no acknowledgement.
        let _ = answer.send(committed.and_then(|()| found.unwrap_or_else(never_ran)));
    }
}
