//! Operations on the database. The types of their work and result are hidden, so that the code of the
//! back ends is compiled once, and not once per operation. Only SQLite's writer uses savepoints.

use super::error::StoreError;
use super::sql::{Connection, Question};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use tokio::sync::oneshot;

/// The result of an operation's work. It has the type that the caller expects.
type Found = Result<Box<dyn Any + Send>, StoreError>;

/// An operation whose caller waits for the answer.
pub(super) struct Operation {
    /// The first [query](Connection::query_ahead) of the work, if it can be prefetched.
    question: Option<Question>,
    work: Box<dyn FnMut(&Connection) -> Found + Send>,
    found: Option<Found>,
    answer: oneshot::Sender<Found>,
}

/// Operations that run in one transaction.
pub(super) type Batch = Vec<Operation>;

impl Operation {
    /// Whether a caller still waits for the answer.
    pub(super) fn is_wanted(&self) -> bool {
        !self.answer.is_closed()
    }

    /// Runs the work. After an error, the work is rolled back, and may run again.
    pub(super) fn run(&mut self, db: &Connection) -> Result<(), StoreError> {
        let found = catch_unwind(AssertUnwindSafe(|| (self.work)(db)));
        let found = found.unwrap_or_else(|_| Err(StoreError::Defect("it panicked".to_owned())));
        let error = found.as_ref().err().cloned();
        self.found = Some(found);
        error.map_or(Ok(()), Err)
    }

    /// Records that a deferred statement of the work failed.
    fn fail(&mut self, error: &StoreError) {
        self.found = Some(Err(error.clone()));
    }

    /// Sends the result, after the transaction has succeeded or failed.
    pub(super) fn answer(self, done: Result<(), StoreError>) {
        let never_ran = || Err(StoreError::Unavailable("it was closed".to_owned()));
        // If sending fails, the client has disconnected, and has seen no acknowledgement.
        let _ = self.answer.send(done.and_then(|()| self.found.unwrap_or_else(never_ran)));
    }
}

/// Runs operations and their deferred statements. The first queries of the operations are
/// prefetched as a batch.
pub(super) fn run_together<'a>(
    db: &Connection,
    operations: impl Iterator<Item = &'a mut Operation>,
) -> Result<(), StoreError> {
    let operations: Vec<_> = operations.collect();
    let questions = operations.iter().filter_map(|operation| operation.question.clone());
    db.ask_ahead(questions.collect())?;
    let done = operations.into_iter().try_for_each(|operation| operation.run(db));
    let done = done.and_then(|()| Ok(db.settle()?));
    db.forget_asked();
    done
}

/// Stores trials together. If one of them fails, each trial is stored in its own savepoint.
/// Savepoints are not the default, because they cost two more statements per trial, and separate
/// statements for the rows of each trial.
pub(super) fn run_trials(db: &Connection, trials: &mut [Operation]) -> Result<(), StoreError> {
    match trials {
        [] => return Ok(()),
        [alone] => return run(db, alone),
        _ => {}
    }
    db.control("SAVEPOINT trials")?;
    if let Err(error) = run_together(db, trials.iter_mut()) {
        if error.ends_transaction() {
            return Err(error);
        }
        // After some errors SQLite has rolled back the whole transaction, and the savepoint is gone.
        db.roll_back("ROLLBACK TO trials").map_err(|_| error)?;
        for trial in trials {
            run(db, trial)?;
        }
    }
    Ok(db.control("RELEASE trials")?)
}

/// Runs an operation and its deferred statements.
pub(super) fn attempt(db: &Connection, operation: &mut Operation) -> Result<(), StoreError> {
    operation.run(db)?;
    db.settle().map_err(StoreError::from).inspect_err(|error| operation.fail(error))
}

/// Runs an operation in a savepoint, so that only a failed operation is undone. If this function
/// returns an error, the whole transaction has failed.
pub(super) fn run(db: &Connection, operation: &mut Operation) -> Result<(), StoreError> {
    db.control("SAVEPOINT operation")?;
    if let Err(error) = attempt(db, operation) {
        if error.ends_transaction() {
            return Err(error);
        }
        // After some errors SQLite has rolled back the whole transaction, and the savepoint is gone.
        db.roll_back("ROLLBACK TO operation").map_err(|_| error)?;
    }
    db.control("RELEASE operation")?;
    Ok(())
}

/// Submits this work to a database as an operation, and returns the result. The database answers
/// every operation, even one that it refuses. `question` is the first query of the work, if it can
/// be prefetched.
pub(super) async fn result_of<T: Send + 'static, S: Future<Output = ()>>(
    question: Option<Question>,
    mut work: impl FnMut(&Connection) -> Result<T, StoreError> + Send + 'static,
    submit: impl FnOnce(Operation) -> S,
) -> Result<T, StoreError> {
    let (answer, answered) = oneshot::channel();
    let work = Box::new(move |db: &Connection| Ok(Box::new(work(db)?) as _));
    let submitted = submit(Operation { question, work, found: None, answer });
    let found = answer_of(submitted, answered).await?.downcast();
    found.map_or_else(|_| Err(StoreError::Defect("it has another type".to_owned())), |it| Ok(*it))
}

/// Waits until an operation is answered, even if it is not yet completely submitted.
async fn answer_of(
    submitted: impl Future<Output = ()>,
    mut answered: oneshot::Receiver<Found>,
) -> Found {
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
