//! The single writer: a thread with the only connection that writes.
//!
//! Operations wait in bounded queues. The writer takes a batch, runs its operations in one
//! transaction (trials together, every other operation in a savepoint), commits once, and only then
//! answers. With this group commit, one wait for the disk serves many requests. After an error that
//! may have ended the transaction, the writer closes the connection and refuses the whole batch.
//! The next batch opens a new connection, so writing resumes as soon as the disk accepts writes
//! again.
//!
//! There are three queues (lanes). Trials go first, because a browser waits for each of them. Other
//! requests follow, but only for about the duration of a commit. So even if a whole school class
//! enrols at the same time, the enrolments hardly delay participants who are driving. Background
//! work (files and cells of an analysis, value functions) runs in separate transactions, one
//! operation between two batches, so that requests wait for at most one such operation.

mod rescue;

use super::connection;
use super::file::DatabaseFile;
use super::mark;
use super::original::Original;
use super::readers::Readers;
use super::write_back::WriteBack;
use crate::store::commits::Commits;
use crate::store::error::StoreError;
use crate::store::lanes::Lane;
use crate::store::operation::{Batch, Operation, attempt, run, run_trials};
use crate::store::sql::Connection;
use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// Maximum length of a lane's queue. Further operations are refused.
const QUEUE: usize = 1_024;

/// Maximum number of trials in a batch.
const BATCH: usize = 64;

/// Maximum number of other requests in a batch. A test of `http/layers.rs` enrols this many people.
const OTHERS: usize = 64;

/// Pause between two background operations while requests wait.
const BACKGROUND_PAUSE: Duration = Duration::from_millis(50);

/// Minimum time from one commit to the next while requests arrive faster than commits end. A client
/// does not notice this delay.
const COMMIT_INTERVAL: Duration = Duration::from_millis(3);

/// Pause between two attempts to empty the log.
const EMPTY_LOG_PAUSE: Duration = Duration::from_millis(200);

#[derive(Default)]
struct Lanes {
    trials: VecDeque<Operation>,
    requests: VecDeque<Operation>,
    background: VecDeque<Operation>,
    /// When to try to empty the log. `None` unless emptying the log was requested.
    empty_log_at: Option<Instant>,
    /// Whether a rescue was requested, because another process has changed the file.
    rescue: bool,
    /// Whether the last write failed because of the disk.
    has_failed: bool,
    closed: bool,
}

struct Queue {
    lanes: Mutex<Lanes>,
    changed: Condvar,
}

/// The writer thread's next action.
enum Next {
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
    fn lanes(&self) -> MutexGuard<'_, Lanes> {
        self.lanes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, lane: Lane, operation: Operation) {
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
    fn has_requests(&self) -> bool {
        let lanes = self.lanes();
        !lanes.trials.is_empty() || !lanes.requests.is_empty()
    }

    /// Waits for the next action. Operations that were queued before the writer was closed still run.
    fn next(&self, last_background: Instant) -> Next {
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
    fn put_back(&self, others: Batch) {
        let mut lanes = self.lanes();
        for other in others.into_iter().rev() {
            lanes.requests.push_front(other);
        }
    }

    /// Takes all waiting operations.
    fn drain(&self) -> Batch {
        let mut lanes = self.lanes();
        let Lanes { trials, requests, background, .. } = &mut *lanes;
        trials.drain(..).chain(requests.drain(..)).chain(background.drain(..)).collect()
    }
}

/// A handle to the writer thread.
pub(super) struct Writer {
    queue: Arc<Queue>,
    committed: watch::Sender<u64>,
    observed: Commits,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl fmt::Debug for Writer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Writer").finish_non_exhaustive()
    }
}

impl Writer {
    /// Starts the thread. The file at the database's path must stay the same.
    pub(super) fn start(
        file: DatabaseFile,
        original: Arc<Original>,
        readers: Arc<Readers>,
    ) -> Result<Self, StoreError> {
        let db = Some(open(&file, &original)?);
        let queue = Arc::new(Queue { lanes: Mutex::default(), changed: Condvar::new() });
        let log = WriteBack::start(file.clone(), Arc::clone(&original))?;
        let committed = watch::Sender::new(0);
        let observed = Commits::default();
        let thread = Thread {
            queue: Arc::clone(&queue),
            committed: committed.clone(),
            observed: observed.clone(),
            file,
            original,
            readers,
            db,
            log,
            disk: Duration::ZERO,
        };
        let thread = std::thread::Builder::new()
            .name("store-writer".to_owned())
            .spawn(move || thread.run())
            .map_err(|error| StoreError::Unavailable(error.to_string()))?;
        Ok(Self { queue, committed, observed, thread: Mutex::new(Some(thread)) })
    }

    /// The writer of a file that is opened read-only. It refuses every operation.
    pub(super) fn none() -> Self {
        let lanes = Lanes { closed: true, ..Lanes::default() };
        Self {
            queue: Arc::new(Queue { lanes: Mutex::new(lanes), changed: Condvar::new() }),
            committed: watch::Sender::new(0),
            observed: Commits::default(),
            thread: Mutex::default(),
        }
    }

    /// Queues an operation, which is answered after its commit.
    pub(super) fn submit(&self, lane: Lane, operation: Operation) {
        self.queue.push(lane, operation);
    }

    /// Publishes the number of commits.
    pub(super) fn commits(&self) -> watch::Receiver<u64> {
        self.committed.subscribe()
    }

    /// Whether the last write failed because of the disk.
    pub(super) fn has_failed(&self) -> bool {
        self.queue.lanes().has_failed
    }

    pub(super) fn observed(&self) -> &Commits {
        &self.observed
    }

    /// Numbers of waiting trials, other requests and background jobs.
    pub(super) fn waiting(&self) -> [usize; 3] {
        let lanes = self.queue.lanes();
        [lanes.trials.len(), lanes.requests.len(), lanes.background.len()]
    }

    /// Empties the write-ahead log as soon as no reader uses it.
    pub(super) fn empty_log(&self) {
        let mut lanes = self.queue.lanes();
        lanes.empty_log_at.get_or_insert_with(Instant::now);
        self.queue.changed.notify_one();
    }

    /// Returns a function that triggers the rescue of the data into another file.
    pub(super) fn rescue(&self) -> impl Fn() + Send + 'static {
        let queue = Arc::clone(&self.queue);
        move || {
            queue.lanes().rescue = true;
            queue.changed.notify_one();
        }
    }

    /// Runs the waiting operations and ends the thread.
    pub(super) fn close(&self) {
        self.queue.lanes().closed = true;
        self.queue.changed.notify_one();
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread
            && thread.join().is_err()
        {
            tracing::error!("the database's writer failed");
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.close();
    }
}

struct Thread {
    queue: Arc<Queue>,
    committed: watch::Sender<u64>,
    observed: Commits,
    file: DatabaseFile,
    /// The file that was opened at the start. The thread never writes to another file.
    original: Arc<Original>,
    /// Readers can have the file open while the writer does not.
    readers: Arc<Readers>,
    /// `None` after an error. The next batch opens another connection.
    db: Option<Connection>,
    /// Runs a checkpoint when the log is long.
    log: WriteBack,
    /// Duration of the last commit.
    disk: Duration,
}

impl Thread {
    fn run(mut self) {
        let (mut last_background, mut begun) = (Instant::now(), Instant::now());
        loop {
            // Requests that wait at the end of a commit arrived during the commit, so more requests
            // will probably arrive soon. With fewer and larger commits, the processors have more
            // time for requests.
            if self.queue.has_requests() {
                std::thread::sleep(COMMIT_INTERVAL.saturating_sub(begun.elapsed()));
            }
            begun = Instant::now();
            match self.queue.next(last_background) {
                Next::Write { batch, trials } => self.write(batch, trials),
                Next::Background(batch) => {
                    self.write(batch, 0);
                    last_background = Instant::now();
                }
                Next::EmptyLog => self.empty_log(),
                Next::Rescue => self.rescue(),
                Next::Stop => {
                    if let Err(error) = self.original.check_all() {
                        self.rescue();
                        if self.original.lacks_rescue() || self.original.has_lost_data() {
                            self.original.note_lost(error);
                        }
                        // Closing the connection would delete the log, which may belong to another
                        // file, or be the only copy of the data.
                        std::mem::forget(self.db.take());
                    }
                    return;
                }
            }
        }
    }

    /// Commits a batch whose first `trials` operations store trials, or refuses the whole batch.
    fn write(&mut self, mut batch: Batch, trials: usize) {
        let mut others = batch.split_off(trials);
        batch.retain(|operation| operation.is_wanted());
        others.retain(|operation| operation.is_wanted());
        let trials = batch.len();
        batch.append(&mut others);
        if batch.is_empty() {
            return;
        }
        let begun = Instant::now();
        let committed = self.commit(&mut batch, trials);
        if committed.is_ok() {
            self.observed.note(batch.len(), begun.elapsed());
        }
        // Commits that change no rows, such as a readiness check, are not published.
        if committed == Ok(true) {
            self.committed.send_modify(|commits| *commits += 1);
            self.queue.lanes().has_failed = false;
        }
        if let Err(error) = &committed {
            tracing::error!(%error, writes = batch.len(), "nothing was stored");
            if error.is_temporary() {
                self.queue.lanes().has_failed = true;
                // The waiting operations would fail for the same reason, only later.
                batch.extend(self.queue.drain());
            }
        }
        for operation in batch {
            operation.answer(committed.clone().map(|_| ()));
        }
        // A log that is not the file's own must not be written back.
        if let Some(open) = &self.db
            && self.original.check().is_ok()
        {
            self.log.after_commit(open);
        }
    }

    /// Commits a batch. Returns whether a row changed. After a failed commit, the connection is
    /// replaced, because a new connection has no failed transaction. But if another process has
    /// changed the file, the connection stays open, because it may be the last access to the data.
    fn commit(&mut self, batch: &mut Batch, trials: usize) -> Result<bool, StoreError> {
        self.original.check_with_log()?;
        let open = match self.db.take() {
            Some(open) => open,
            None => open(&self.file, &self.original)?,
        };
        let committed = self.transact(&open, batch, trials);
        // SQLite reports success even for a deleted file, whose content is lost.
        let checked = self.original.check_with_log();
        if committed.is_ok() || checked.is_err() {
            if committed.is_err() {
                // Otherwise the transaction would block other writers, and the rescue.
                let _ = open.roll_back("ROLLBACK");
            }
            self.db = Some(open);
        } else {
            // If no other connection has the file open, closing this one deletes the log and its index.
            self.original.note_companions(false);
        }
        checked?;
        committed
    }

    fn transact(
        &mut self,
        db: &Connection,
        batch: &mut Batch,
        trials: usize,
    ) -> Result<bool, StoreError> {
        db.control("BEGIN IMMEDIATE")?;
        let (mark, changes) = mark::with_changes(db)?;
        self.original.check_mark(mark.as_ref())?;
        let (first, others) = batch.split_at_mut(trials);
        let mut done = 0;
        match (&mut *first, &mut *others) {
            // An operation alone needs no savepoint.
            ([alone], []) | ([], [alone]) => {
                done = 1 - trials;
                if let Err(error) = attempt(db, alone) {
                    if error.ends_transaction() {
                        return Err(error);
                    }
                    db.roll_back("ROLLBACK").map_err(|_| error)?;
                    return Ok(false);
                }
            }
            _ => {
                run_trials(db, first)?;
                // Runs at least one operation, and more operations until a time limit. The time is
                // limited, because a trial that arrives during this time waits for all these
                // operations.
                let begun = Instant::now();
                for operation in others {
                    run(db, operation)?;
                    done += 1;
                    if begun.elapsed() >= self.disk.max(COMMIT_INTERVAL) {
                        break;
                    }
                }
            }
        }
        let next = mark::count(db, changes)?;
        let has_changed = next.is_some();
        let begun = Instant::now();
        db.control("COMMIT")?;
        self.original.note_mark(next.or(mark));
        self.disk = begun.elapsed();
        self.queue.put_back(batch.split_off(trials + done));
        Ok(has_changed)
    }

    fn empty_log(&mut self) {
        let emptied = match &self.db {
            Some(open) => {
                let checked = self.original.check_all();
                checked.and_then(|()| self.original.writing_back(|| connection::empty_log(open)))
            }
            None => Ok(false),
        };
        if let Err(error) = &emptied {
            tracing::warn!(%error, "the write-ahead log was not written back");
        }
        if emptied != Ok(true) {
            self.queue.lanes().empty_log_at = Some(Instant::now() + EMPTY_LOG_PAUSE);
        }
    }
}

/// Opens the file if it is the original file.
fn open(file: &DatabaseFile, original: &Original) -> Result<Connection, StoreError> {
    original.check()?;
    let db = connection::writing(file.path())?;
    // SQLite creates the log at the first read.
    db.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))?;
    original.note_companions(true);
    Ok(db)
}
