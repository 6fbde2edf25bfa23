//! Operations on the database. A trait hides the types of their work and result, so that the code of
//! the databases is compiled once, and not once per operation.

use super::error::StoreError;
use super::sql::{Connection, Question};
use std::panic::{AssertUnwindSafe, catch_unwind};
use tokio::sync::oneshot;

/// An operation whose caller waits for the answer.
pub(super) trait Operation: Send {
    /// Whether a caller still waits for the answer.
    fn is_wanted(&self) -> bool;
    /// The operation's first [query](Connection::query_ahead), if it can be prefetched.
    fn question(&self) -> Option<&Question>;
    /// Does the work. After an error, the work is rolled back, and may run again.
    fn run(&mut self, db: &Connection) -> Result<(), StoreError>;
    /// Records that a deferred statement of the work failed.
    fn fail(&mut self, error: &StoreError);
    /// Sends the result, after the transaction has succeeded or failed.
    fn answer(self: Box<Self>, done: Result<(), StoreError>);
}

/// Operations that run in one transaction.
pub(super) type Batch = Vec<Box<dyn Operation>>;

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

/// Submits an operation that does this work to a database, and returns the result. The database answers
/// every operation, even one that it refuses. `question` is the first query of the work, if it can be
/// prefetched.
pub(super) async fn result_of<T: Send + 'static, S: Future<Output = ()>>(
    question: Option<Question>,
    work: impl FnMut(&Connection) -> Result<T, StoreError> + Send + 'static,
    submit: impl FnOnce(Box<dyn Operation>) -> S,
) -> Result<T, StoreError> {
    let (answer, mut answered) = oneshot::channel();
    let submitted = submit(Box::new(Waiting { question, work, found: None, answer }));
    let answer = tokio::select! {
        biased;
        answer = &mut answered => answer,
        () = submitted => answered.await,
    };
    answer.unwrap_or_else(|_| Err(StoreError::Defect("it ended without an answer".to_owned())))
}

/// Work that runs only once.
pub(super) fn once<T>(
    work: impl FnOnce(&Connection) -> Result<T, StoreError>,
) -> impl FnMut(&Connection) -> Result<T, StoreError> {
    let mut work = Some(work);
    move |db| match work.take() {
        Some(work) => work(db),
        None => Err(StoreError::Defect("it ran twice".to_owned())),
    }
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

    fn answer(self: Box<Self>, done: Result<(), StoreError>) {
        let Self { found, answer, .. } = *self;
        let never_ran = || Err(StoreError::Unavailable("it was closed".to_owned()));
        // If this fails, the client has disconnected, and has seen no acknowledgement.
        let _ = answer.send(done.and_then(|()| found.unwrap_or_else(never_ran)));
    }
}
