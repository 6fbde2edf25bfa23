//! Sessions with the primary, in sqlx's connection pool.

use super::address::Address;
use crate::store::error::StoreError;
use crate::store::sql::Connection;
use futures_util::future::join_all;
use sqlx::pool::PoolConnection;
use sqlx::postgres::{PgConnectOptions, PgConnection, PgPool, PgPoolOptions};
use sqlx::{Connection as _, Executor, Postgres, Row as _};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::runtime::Handle;

/// Settings of every session. With `synchronous_commit`, an acknowledged trial survives a power
/// failure, whatever the server's default is. `enable_seqscan` is off because a session caches the
/// plans of its statements. A plan made while a table was nearly empty would scan the whole table
/// for every trial, until PostgreSQL next analyses the table. `jit` is off because PostgreSQL
/// overestimates the costs of plans without sequential scans, and would therefore JIT-compile even
/// cheap queries. The timeouts prevent endless waits.
const SETTINGS: &str = "SET synchronous_commit = on; SET lock_timeout = '10s'; \
                        SET idle_in_transaction_session_timeout = '60s'; \
                        SET client_min_messages = warning; \
                        SET enable_seqscan = off; SET jit = off";

/// The properties of a server that are checked and reported.
const ABOUT: &str = "SELECT CAST(current_setting('server_version_num') AS BIGINT), \
     current_setting('server_version'), current_setting('server_encoding'), \
     coalesce(current_setting('sidestep.writers', TRUE), ''), \
     pg_is_in_recovery() OR current_setting('transaction_read_only') = 'on'";

/// The query for the state of the primary: the identifier of its cluster, its timeline, and its LSN (bytes).
const POSITION: &str = "SELECT (SELECT system_identifier FROM pg_control_system()), \
     CAST(CAST('x' || substr(pg_walfile_name(pg_current_wal_lsn()), 1, 8) AS BIT(32)) AS BIGINT), \
     CAST(pg_current_wal_lsn() - '0/0' AS BIGINT)";

/// The position of a database in its history. A standby that is promoted to primary begins a new
/// timeline. The old primary then lacks everything that is stored after the failover.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Position {
    timeline: i64,
    /// The LSN: the position in the write-ahead log (bytes).
    bytes: i64,
}

/// The most advanced state of a database that this server has seen.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// The identifier of the cluster, which its replicas share.
    system: i64,
    position: Position,
}

impl Seen {
    async fn of(session: &mut PgConnection) -> sqlx::Result<Self> {
        let row = session.fetch_one(POSITION).await?;
        let position = Position { timeline: row.try_get(1)?, bytes: row.try_get(2)? };
        Ok(Self { system: row.try_get(0)?, position })
    }

    /// Refuses a server that belongs to another cluster or lacks data of this state.
    fn check(&self, found: &Self) -> Result<(), StoreError> {
        let place = |position: Position| {
            let (high, low) = (position.bytes >> 32, position.bytes & 0xffff_ffff);
            format!("timeline {} at {high:X}/{low:X}", position.timeline)
        };
        let refuse = |what: String| {
            Err(StoreError::Unavailable(format!(
                "{what}; nothing is read from it or stored in it. Fence it: see 'After a failover' in docs/operation.md"
            )))
        };
        let (seen, position) = (self.position, found.position);
        if found.system != self.system {
            return refuse("the server is another PostgreSQL cluster than before".to_owned());
        }
        if position.timeline < seen.timeline || position.bytes < seen.bytes {
            let (found, seen) = (place(position), place(seen));
            return refuse(format!(
                "the server that answers is at {found} of its write-ahead log, and trials were acknowledged at {seen}: it \
                 is an old primary that came back, or a standby that lacks trials"
            ));
        }
        Ok(())
    }
}

/// The oldest supported version of PostgreSQL.
const OLDEST: i64 = 140_000;

/// Default number of concurrent transactions that store trials. One transaction stores all waiting
/// trials with one statement of each kind. Several concurrent transactions store more trials only if
/// PostgreSQL has many cores.
const WRITERS: usize = 1;

/// Upper bound of the database's setting `sidestep.writers`.
const MOST_WRITERS: usize = 64;

/// Sessions that were idle for longer than this are tested before use.
const TRUSTED: Duration = Duration::from_secs(1);

/// Parses the database's setting. Returns [`WRITERS`] if it is not set, and `None` if it is invalid.
fn writers_of(setting: &str) -> Option<usize> {
    match setting.trim() {
        "" => Some(WRITERS),
        number => number.parse().ok().filter(|number| (1..=MOST_WRITERS).contains(number)),
    }
}

/// The session pool, and the location of the primary.
pub(super) struct Sessions {
    pool: PgPool,
    runtime: Handle,
    hosts: Vec<PgConnectOptions>,
    patience: Duration,
    /// Number of concurrent transactions of all servers that store trials. It is the database's
    /// setting `sidestep.writers`, or 0 until the setting is read.
    writers: AtomicUsize,
    /// When the database or the connection to it was last lost. Older sessions are discarded.
    lost_at: Arc<Mutex<Option<Instant>>>,
    /// Whether the primary must be found again.
    is_lost: AtomicBool,
    /// The most advanced state of the database that was seen.
    seen: Arc<Mutex<Option<Seen>>>,
}

impl Sessions {
    /// A pool of at most `count` sessions, whose tasks run on `runtime`. It is empty at first.
    pub(super) fn new(address: &Address, count: u32, runtime: Handle) -> Self {
        let lost_at = Arc::new(Mutex::new(None));
        let lost = Arc::clone(&lost_at);
        let seen = Arc::new(Mutex::new(None));
        let known = Arc::clone(&seen);
        let options = PgPoolOptions::new()
            .max_connections(count)
            .acquire_timeout(address.patience)
            // Testing each session before each use would double the round trips.
            .test_before_acquire(false)
            .before_acquire(move |session, meta| {
                let lost: Option<Instant> = *lost.lock().unwrap_or_else(PoisonError::into_inner);
                Box::pin(async move {
                    let is_older = lost.is_some_and(|lost| meta.age >= lost.elapsed());
                    Ok(!is_older && (meta.idle_for < TRUSTED || session.ping().await.is_ok()))
                })
            })
            .after_connect(move |session, _| {
                let seen: Option<Seen> = *known.lock().unwrap_or_else(PoisonError::into_inner);
                Box::pin(async move {
                    session.execute(SETTINGS).await?;
                    let Some(seen) = seen else { return Ok(()) };
                    let checked = seen.check(&Seen::of(session).await?);
                    checked.map_err(|error| sqlx::Error::Configuration(error.into()))
                })
            });
        let hosts = address.hosts.clone();
        let pool = options.connect_lazy_with(hosts[0].clone());
        let (writers, is_lost) = (AtomicUsize::new(0), AtomicBool::new(true));
        let patience = address.patience;
        Self { pool, runtime, hosts, patience, writers, lost_at, is_lost, seen }
    }

    /// Number of concurrent transactions of all servers that store trials.
    pub(super) fn writers(&self) -> usize {
        self.writers.load(Ordering::Relaxed).max(1)
    }

    /// Finds the primary among the hosts of the address. If several hosts accept writes, chooses
    /// the one with the newest timeline, and of these the one with the highest LSN.
    pub(super) async fn find(&self) -> Result<(), StoreError> {
        let tries = self.hosts.iter().map(|host| async move {
            let silent = |_| StoreError::Unavailable("the server does not answer".to_owned());
            tokio::time::timeout(self.patience, self.try_host(host)).await.map_err(silent)?
        });
        let found = join_all(tries).await;
        let takes = |(at, found): (usize, &Result<Seen, StoreError>)| {
            Some((found.as_ref().ok()?.position, at))
        };
        // Ties go to the first host in the address.
        let best = found
            .iter()
            .enumerate()
            .filter_map(takes)
            .max_by_key(|(position, at)| (*position, usize::MAX - at));
        let Some((_, best)) = best else {
            let first = found.into_iter().find_map(Result::err);
            return Err(first.unwrap_or_else(StoreError::closed));
        };
        if let Ok(found) = &found[best] {
            self.note(*found);
        }
        self.pool.set_connect_options(self.hosts[best].clone());
        self.is_lost.store(false, Ordering::Relaxed);
        Ok(())
    }

    /// Records the cluster that answers, and its timeline. Its LSN is not recorded, because it may
    /// include commits that are not acknowledged yet. A standby that is promoted later may lack these
    /// commits.
    fn note(&self, found: Seen) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = seen.map_or(0, |seen| seen.position.bytes);
        *seen = Some(Seen { position: Position { bytes, ..found.position }, ..found });
    }

    /// Records that commits up to this LSN were acknowledged.
    pub(super) fn note_acknowledged(&self, bytes: i64) {
        if let Some(seen) = &mut *self.seen.lock().unwrap_or_else(PoisonError::into_inner) {
            seen.position.bytes = seen.position.bytes.max(bytes);
        }
    }

    async fn try_host(&self, host: &PgConnectOptions) -> Result<Seen, StoreError> {
        let mut session = PgConnection::connect_with(host).await?;
        let about = session.fetch_one(ABOUT).await?;
        let (number, version): (i64, String) = (about.try_get(0)?, about.try_get(1)?);
        let (encoding, writers): (String, String) = (about.try_get(2)?, about.try_get(3)?);
        let refuses: bool = about.try_get(4)?;
        let found = if refuses { None } else { Some(Seen::of(&mut session).await?) };
        // Ignore errors, because nothing is lost if the server misses the end of the session.
        let _ = session.close().await;
        if number < OLDEST {
            let old = format!("expected PostgreSQL {} or newer, found {version}", OLDEST / 10_000);
            return Err(StoreError::Unavailable(old));
        }
        if encoding != "UTF8" {
            let other = format!(
                "expected a database with the encoding UTF8, found {encoding}; make one with CREATE DATABASE … \
                 ENCODING 'UTF8' TEMPLATE template0"
            );
            return Err(StoreError::Unavailable(other));
        }
        let Some(found) = found else {
            let standby = "the server does not allow writes; it is a standby, or set to read-only; name the primary";
            return Err(StoreError::Unavailable(standby.to_owned()));
        };
        let seen = *self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(seen) = seen {
            seen.check(&found).inspect_err(|error| tracing::error!(%error, "refused"))?;
        }
        match writers_of(&writers) {
            Some(writers) => self.writers.store(writers, Ordering::Relaxed),
            None => {
                let faulty = format!(
                    "the setting sidestep.writers of the database: expected a number from 1 to {MOST_WRITERS}, \
                     found {writers:?}"
                );
                if self.writers.load(Ordering::Relaxed) == 0 {
                    return Err(StoreError::Unavailable(faulty));
                }
                // A Sidestep server that is already running continues with the old setting.
                tracing::warn!("{faulty}");
            }
        }
        Ok(found)
    }

    async fn acquire(&self) -> Result<PoolConnection<Postgres>, StoreError> {
        if self.pool.is_closed() {
            return Err(StoreError::closed());
        }
        if self.is_lost.load(Ordering::Relaxed) {
            self.find().await?;
        }
        match self.pool.acquire().await {
            Ok(session) => Ok(session),
            // The pool retries until its timeout, and does not report why it failed.
            Err(sqlx::Error::PoolTimedOut) => {
                // Until the primary is found, other callers search for it, too, instead of waiting
                // for the pool.
                self.is_lost.store(true, Ordering::Relaxed);
                self.find().await?;
                Err(sqlx::Error::PoolTimedOut.into())
            }
            Err(error) => {
                self.forget();
                Err(error.into())
            }
        }
    }

    /// Takes a session. Call it on a thread that may block.
    pub(super) fn take(&self) -> Result<Connection, StoreError> {
        let session = self.runtime.block_on(self.acquire())?;
        Ok(Connection::to_server(session, self.runtime.clone()))
    }

    /// Takes a session and runs the statements `begin` in it. Retries once if the session is broken.
    pub(super) fn begin(&self, begin: &str) -> Result<Connection, StoreError> {
        let mut is_second = false;
        loop {
            let db = self.take()?;
            match db.batch(begin).map_err(StoreError::from) {
                Ok(()) => return Ok(db),
                // The database may have been restarted. A retry is safe, because nothing has been done yet.
                Err(StoreError::Unavailable(_)) if !is_second => self.give_up(db),
                Err(error) => {
                    match db.roll_back("ROLLBACK") {
                        Ok(()) => drop(db),
                        Err(_) => self.give_up(db),
                    }
                    return Err(error);
                }
            }
            is_second = true;
        }
    }

    /// Runs a read outside a transaction.
    pub(super) fn with<T>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let db = self.take()?;
        let found = read(&db);
        if matches!(found, Err(StoreError::Unavailable(_))) {
            self.give_up(db);
        }
        found
    }

    /// Closes a broken session. All older sessions are discarded before their next use.
    pub(super) fn give_up(&self, db: Connection) {
        if let Some(mut session) = db.into_session() {
            session.close_on_drop();
        }
        self.forget();
    }

    fn forget(&self) {
        *self.lost_at.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        self.is_lost.store(true, Ordering::Relaxed);
    }

    pub(super) fn idle(&self) -> usize {
        self.pool.num_idle()
    }

    pub(super) async fn close(&self) {
        self.pool.close().await;
    }
}
