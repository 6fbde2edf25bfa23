//! PostgreSQL: a database server that several Sidestep servers share.
//!
//! Each operation runs in its own transaction, at isolation level READ COMMITTED, on a session of
//! the connection pool. Only waiting trials share a transaction. An operation first locks the data
//! that it reads and depends on ([`Lock`]). After a connection error, the session and all idle
//! sessions are discarded. So service resumes as soon as the database or a new primary is
//! available.

mod address;
mod sessions;
mod trials;

use super::error::StoreError;
use super::lanes::{Lane, Lock};
use super::migrations::{self, Failure, State};
use super::misfit::Misfit;
use super::opening::{OpenError, Purpose};
use super::operation::{Operation, result_of};
use super::sql::Connection;
use crate::store::commits::Commits;
use address::Address;
use sessions::Sessions;
use std::fmt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Weak};
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task;
use trials::{Trials, Waiting};

/// Maximum number of sessions for each purpose. For writes of trials, a second limit applies to all
/// servers together (see [`Sessions::writers`]).
const SESSIONS: [usize; 5] = [4, 2, 1, 5, 4];

/// The purposes: writes of trials, writes for other requests, writes for jobs, short reads, long reads.
const TRIALS: usize = 0;
const REQUESTS: usize = 1;
const JOBS: usize = 2;
const READS: usize = 3;
const LONG_READS: usize = 4;

/// Maximum number of operations that wait for a session of one kind. Further operations are refused.
const QUEUE: usize = 1_024;

/// Interval at which a server polls for other servers' changes, while a client watches.
const WATCH: Duration = Duration::from_millis(500);

/// Ends a transaction that writes. After a failed statement, COMMIT would roll back without an
/// error. The query before COMMIT detects this case, because every query fails after a failed
/// statement. The query returns the current LSN. The commit acknowledges the write-ahead log up to
/// this LSN. Other servers are notified after the commit, never before.
const COMMIT: &str = "SELECT CAST(pg_current_wal_insert_lsn() - '0/0' AS BIGINT); COMMIT; \
     SELECT nextval('changed')";

/// Timeout of the readiness check.
const PATIENCE: Duration = Duration::from_secs(2);

/// An open database with all migrations applied.
#[derive(Debug)]
pub(super) struct Postgres {
    /// The address without the password.
    name: String,
    shared: Arc<Shared>,
    kinds: [Kind; 5],
    /// While trials are arriving, an enrolment needs one of these permits besides its session.
    enrolments: Kind,
}

/// The state that the threads of all operations share.
struct Shared {
    sessions: Sessions,
    trials: Trials,
    committed: watch::Sender<u64>,
    observed: Commits,
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Postgres").finish_non_exhaustive()
    }
}

/// Sessions for one purpose.
#[derive(Debug)]
struct Kind {
    free: Arc<Semaphore>,
    sessions: u32,
    waiting: AtomicUsize,
}

impl Kind {
    fn new(sessions: usize) -> Self {
        let free = Arc::new(Semaphore::new(sessions));
        Self { free, sessions: sessions as u32, waiting: AtomicUsize::new(0) }
    }

    /// Waits for a permit to use a session.
    async fn turn(&self) -> Result<OwnedSemaphorePermit, StoreError> {
        /// Decrements the number of waiting callers on drop, even if the caller is cancelled.
        struct Waiting<'a>(&'a AtomicUsize);
        impl Drop for Waiting<'_> {
            fn drop(&mut self) {
                self.0.fetch_sub(1, Ordering::Relaxed);
            }
        }
        if self.waiting.fetch_add(1, Ordering::Relaxed) >= QUEUE {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            return Err(StoreError::Busy);
        }
        let _waiting = Waiting(&self.waiting);
        let closed = |_| StoreError::Unavailable("it was closed".to_owned());
        Arc::clone(&self.free).acquire_owned().await.map_err(closed)
    }
}

impl Postgres {
    /// Whether this is the address of a PostgreSQL database.
    pub(super) fn is_address(url: &str) -> bool {
        Address::is_one(url)
    }

    /// Connects to the database and applies missing migrations, unless the purpose is to read.
    pub(super) fn open(url: &str, purpose: Purpose) -> Result<Self, OpenError> {
        let address = Address::parse(url)?;
        let database = address.name.clone();
        let unusable =
            |reason: String| OpenError::Unusable { database: address.name.clone(), reason };
        let refused = |error: StoreError| match error {
            StoreError::Unavailable(reason) => unusable(reason),
            other => unusable(other.to_string()),
        };
        // Polling for other servers' changes needs one more session.
        let count = SESSIONS.iter().sum::<usize>() + 1;
        let runtime = Handle::current();
        let sessions = Sessions::new(&address, count as u32, runtime);
        let db = sessions.take().map_err(refused)?;
        check_schema(&db).map_err(refused)?;
        let misfit = |failure: Failure| match failure {
            Failure::Unusable(error) => refused(error),
            Failure::Misfit(reason) => {
                OpenError::Version { database: address.name.clone(), reason }
            }
        };
        let may_change = purpose != Purpose::Read;
        let state = migrations::check(&db).map_err(misfit)?;
        match (state, purpose) {
            (State::Empty, Purpose::Change | Purpose::Read) => {
                return Err(OpenError::Absent(database));
            }
            (State::Older { found, known }, Purpose::Read) => {
                return Err(OpenError::Version {
                    database,
                    reason: Misfit::Older { found, known },
                });
            }
            _ => {}
        }
        if state != State::Empty && purpose != Purpose::Copy {
            migrations::check_finished(&db).map_err(misfit)?;
        }
        if may_change {
            migrations::apply(&db).map_err(misfit)?;
            check_rights(&db).map_err(refused)?;
            if state == State::Empty && purpose == Purpose::Copy {
                migrations::begin_copy(&db).map_err(refused)?;
            }
        }
        drop(db);
        let mut counts = SESSIONS;
        // All servers together run at most this many transactions that store trials. More sessions
        // would only wait.
        counts[TRIALS] = counts[TRIALS].min(sessions.writers());
        let (kinds, enrolments) = (counts.map(Kind::new), Kind::new(1));
        let (trials, observed) = Default::default();
        let shared = Shared { sessions, trials, committed: watch::Sender::new(0), observed };
        Ok(Self { name: database, shared: Arc::new(shared), kinds, enrolments })
    }

    /// Starts to poll for other servers' changes, while a client watches.
    pub(super) fn watch(&self) {
        let shared = Arc::downgrade(&self.shared);
        task::spawn(watch_commits(shared));
    }

    /// Identity of this database, independent of its address: its OID, and the start time of its server.
    pub(super) async fn identity(&self) -> Result<String, StoreError> {
        let asked = "SELECT oid || ' ' || extract(epoch FROM pg_postmaster_start_time()) \
                     FROM pg_database WHERE datname = current_database()";
        let read = move |db: &Connection| Ok(db.query_row(asked, [], |row| row.get(0))?);
        result_of(None, read, |operation| self.read(operation)).await
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Checks that the database accepts writes now.
    pub(super) async fn ready(&self) -> Result<(), StoreError> {
        // Nothing is stored, so other servers are not notified.
        let asked = result_of(None, check_writing, |operation| {
            self.transaction(REQUESTS, None, ["BEGIN", "COMMIT"].map(str::to_owned), operation)
        });
        if let Ok(answer) = tokio::time::timeout(PATIENCE, asked).await {
            return answer;
        }
        // A new session shows whether the server is reachable at all.
        let found = tokio::time::timeout(PATIENCE, self.shared.sessions.find()).await;
        found.unwrap_or_else(|_| Err(StoreError::Unavailable("it does not answer".to_owned())))?;
        let busy = "its sessions are all busy, or wait for a lock";
        Err(StoreError::Unavailable(busy.to_owned()))
    }

    /// The folder for a temporary file: the system's temporary directory.
    pub(super) fn room(&self) -> PathBuf {
        std::env::temp_dir()
    }

    pub(super) fn commits(&self) -> watch::Receiver<u64> {
        self.shared.committed.subscribe()
    }

    pub(super) fn observed(&self) -> &Commits {
        &self.shared.observed
    }

    /// Numbers of waiting trials, other requests and background jobs.
    pub(super) fn waiting(&self) -> [usize; 3] {
        let kind = |kind: usize| self.kinds[kind].waiting.load(Ordering::Relaxed);
        let requests = kind(REQUESTS) + self.enrolments.waiting.load(Ordering::Relaxed);
        [self.shared.trials.count(), requests, kind(JOBS)]
    }

    /// Numbers of busy and idle sessions.
    pub(super) fn sessions(&self) -> [usize; 2] {
        let busy =
            |kind: &Kind| (kind.sessions as usize).saturating_sub(kind.free.available_permits());
        [self.kinds.iter().map(busy).sum(), self.shared.sessions.idle()]
    }

    /// Waits for operations in progress, and closes the sessions.
    pub(super) async fn close(&self) {
        for kind in &self.kinds {
            // Once all permits are acquired, no operation is in progress.
            if let Ok(all) = kind.free.acquire_many(kind.sessions).await {
                all.forget();
            }
            kind.free.close();
        }
        self.shared.refuse_trials(&StoreError::closed());
        self.shared.sessions.close().await;
    }

    /// Reads a few rows.
    pub(super) async fn read(&self, mut operation: Operation) {
        let turn = match self.kinds[READS].turn().await {
            Ok(turn) => turn,
            Err(error) => return operation.answer(Err(error)),
        };
        let shared = Arc::clone(&self.shared);
        task::spawn_blocking(move || {
            let _turn = turn;
            let done = shared.sessions.with(|db| operation.run(db));
            operation.answer(done);
        });
    }

    /// Reads any number of rows from one snapshot.
    pub(super) async fn read_long(&self, operation: Operation) {
        // A read of most rows of a table should scan it sequentially.
        const BEGIN: &str =
            "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY; SET LOCAL enable_seqscan = on";
        let statements = [BEGIN, "COMMIT"].map(str::to_owned);
        self.transaction(LONG_READS, None, statements, operation).await;
    }

    /// Runs an operation, and answers it after the commit.
    pub(super) async fn write(&self, lane: Lane, locks: Vec<Lock>, operation: Operation) {
        let kind = match lane {
            Lane::Trial => return self.write_trial(locks, operation).await,
            Lane::Request | Lane::Enrolment => REQUESTS,
            Lane::Background => JOBS,
        };
        let alone = match lane {
            Lane::Enrolment if self.shared.trials.are_coming() => {
                match self.enrolments.turn().await {
                    Ok(turn) => Some(turn),
                    Err(error) => return operation.answer(Err(error)),
                }
            }
            _ => None,
        };
        self.transaction(kind, alone, [begin(locks), COMMIT.to_owned()], operation).await;
    }

    /// Queues a trial. The first caller to get a session stores a batch of waiting trials. The work
    /// of a trial runs again if another trial of its transaction fails.
    async fn write_trial(&self, locks: Vec<Lock>, operation: Operation) {
        if let Err(refused) = self.shared.trials.push(Waiting { locks, operation }) {
            return refused.operation.answer(Err(StoreError::Busy));
        }
        let turn = match self.kinds[TRIALS].turn().await {
            Ok(turn) => turn,
            // A caller that waits for a session will store this trial, too.
            Err(StoreError::Busy) => return,
            Err(closed) => return self.shared.refuse_trials(&closed),
        };
        let shared = Arc::clone(&self.shared);
        task::spawn_blocking(move || {
            let _turn = turn;
            // Callers that did not wait, because too many callers were waiting, rely on this caller.
            while shared.trials.count() > 0 {
                shared.write_trials();
            }
        });
    }

    /// Runs a transaction on a session of this kind. `other_turn` is another permit that the operation needs.
    async fn transaction(
        &self,
        kind: usize,
        other_turn: Option<OwnedSemaphorePermit>,
        [begin, commit]: [String; 2],
        mut operation: Operation,
    ) {
        let turn = match self.kinds[kind].turn().await {
            Ok(turn) => turn,
            Err(error) => return operation.answer(Err(error)),
        };
        let shared = Arc::clone(&self.shared);
        task::spawn_blocking(move || {
            // The caller may be cancelled, so the work keeps the permits.
            let _turns = (turn, other_turn);
            let begun = Instant::now();
            let done = shared.transact([&begin, &commit], |db| operation.run(db));
            if done.is_ok() && commit == COMMIT {
                shared.observed.note(1, begun.elapsed());
                shared.committed.send_modify(|commits| *commits += 1);
            }
            operation.answer(done);
        });
    }
}

impl Shared {
    fn transact(
        &self,
        [begin, commit]: [&str; 2],
        work: impl FnOnce(&Connection) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let db = self.sessions.begin(begin)?;
        let done = work(&db).and_then(|()| Ok(db.settle()?));
        let ended = match done.is_ok() {
            true if commit == COMMIT => {
                db.batch_with_answer(COMMIT, |row| row.get(0)).map(|bytes| {
                    self.sessions.note_acknowledged(bytes);
                })
            }
            true => db.batch(commit),
            false => db.roll_back("ROLLBACK"),
        };
        if ended.is_err() {
            self.sessions.give_up(db);
        }
        done.and(Ok(ended?))
    }
}

/// Checks, in a transaction, that this user can write now.
fn check_writing(db: &Connection) -> Result<(), StoreError> {
    let refuses = "SELECT pg_is_in_recovery() OR current_setting('transaction_read_only') = 'on'";
    if db.query_row(refuses, [], |row| row.get(0))? {
        return Err(StoreError::Unavailable("it accepts no writes now".to_owned()));
    }
    check_rights(db)?;
    // Storing a trial takes the same locks, and another session may hold a conflicting lock.
    Ok(db.batch(
        "SET LOCAL lock_timeout = '1s'; \
         LOCK TABLE participant, scene, trial, tally IN ROW EXCLUSIVE MODE",
    )?)
}

/// Checks that the user can see the schema. Without rights to the schema, the database would seem empty.
fn check_schema(db: &Connection) -> Result<(), StoreError> {
    if db.query_row("SELECT current_schema() IS NULL", [], |row| row.get(0))? {
        let hidden = "this user has no rights to the schema of the tables; GRANT USAGE ON SCHEMA (public) to it";
        return Err(StoreError::Unavailable(hidden.to_owned()));
    }
    Ok(())
}

/// The tables that a server writes to (all except the table of migrations), and the sequence that
/// notifies other servers of changes.
pub(super) const TABLES: &str = "study_config study study_version participant participant_token scene trial \
     value_function safety_function api_key session audit note exclusion tally analysis analysis_participant \
     analysis_file analysis_cell analysis_predictor analysis_trial predictor_kind predictor_participant throttle \
     changed";

/// Checks that the user may write to all [`TABLES`].
fn check_rights(db: &Connection) -> Result<(), StoreError> {
    let asked = "SELECT coalesce(string_agg(name, ', '), '') \
                 FROM unnest(string_to_array($1, ' ')) AS name WHERE CASE \
                 WHEN to_regclass(name) IS NULL THEN TRUE \
                 WHEN name = 'changed' THEN NOT (has_sequence_privilege(to_regclass(name), 'USAGE') \
                     AND has_sequence_privilege(to_regclass(name), 'SELECT')) \
                 ELSE NOT (has_table_privilege(to_regclass(name), 'SELECT') \
                     AND has_table_privilege(to_regclass(name), 'INSERT') \
                     AND has_table_privilege(to_regclass(name), 'UPDATE') \
                     AND has_table_privilege(to_regclass(name), 'DELETE')) END";
    let refused: String = db.query_row(asked, [TABLES], |row| row.get(0))?;
    if refused.is_empty() {
        return Ok(());
    }
    Err(StoreError::Unavailable(format!(
        "this user must not write to {refused}, or does not see it; use the user who owns the tables, or have that one \
         GRANT USAGE on their schema, SELECT, INSERT, UPDATE, DELETE on all tables and USAGE, SELECT on the \
         sequence 'changed'"
    )))
}

/// Statements that begin a transaction with these locks. All transactions take the locks in the
/// same order, so there are no deadlocks.
fn begin(locks: Vec<Lock>) -> String {
    format!("BEGIN{}", taking(locks))
}

/// Statements that take these locks.
fn taking(mut locks: Vec<Lock>) -> String {
    locks.sort();
    locks.dedup();
    let one =
        |[kind, number]: [i32; 2]| format!("; SELECT pg_advisory_xact_lock({kind}, {number})");
    locks.iter().map(Lock::numbers).map(one).collect()
}

/// Reports commits of other servers to watchers.
async fn watch_commits(shared: Weak<Shared>) {
    let mut last = 0;
    loop {
        tokio::time::sleep(WATCH).await;
        let Some(shared) = shared.upgrade() else { return };
        if shared.committed.receiver_count() == 0 {
            continue;
        }
        let looking = task::spawn_blocking(move || {
            let marker = "SELECT last_value FROM changed";
            let found = shared.sessions.with(|db| Ok(db.query_row(marker, [], |row| row.get(0))?));
            (shared, found)
        });
        // While the database is unavailable, requests report the error.
        let Ok((shared, Ok(found))) = looking.await else { continue };
        let found: i64 = found;
        if found != last {
            last = found;
            shared.committed.send_modify(|commits| *commits += 1);
        }
    }
}
