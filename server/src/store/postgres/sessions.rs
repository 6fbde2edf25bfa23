//! Sessions with the server that takes writes, in a pool of sqlx.

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

/// What holds in every session. `synchronous_commit`: an acknowledged trial survives a power cut, whatever
/// the server's default is. `enable_seqscan`: a session keeps the plans of its statements; one that was made
/// while a table was nearly empty would read the whole of it for every trial, until PostgreSQL next analyses it.
/// `jit`: such plans look too dear, and would be compiled. The other limits let nobody wait for ever.
const SETTINGS: &str = "SET synchronous_commit = on; SET lock_timeout = '10s'; \
                        SET idle_in_transaction_session_timeout = '60s'; \
                        SET client_min_messages = warning; \
                        SET enable_seqscan = off; SET jit = off";

/// What must hold on a server, and what it says of itself.
const ABOUT: &str = "SELECT CAST(current_setting('server_version_num') AS BIGINT), \
     current_setting('server_version'), current_setting('server_encoding'), \
     coalesce(current_setting('sidestep.writers', TRUE), ''), \
     pg_is_in_recovery() OR current_setting('transaction_read_only') = 'on'";

/// Where a server that takes writes is in its write-ahead log.
const POSITION: &str = "SELECT (SELECT system_identifier FROM pg_control_system()), \
     CAST(CAST('x' || substr(pg_walfile_name(pg_current_wal_lsn()), 1, 8) AS BIT(32)) AS BIGINT), \
     CAST(pg_current_wal_lsn() - '0/0' AS BIGINT)";

/// How far a database was seen to have come. A standby that becomes the primary begins a new timeline; the old primary, which
/// stays on its own, lacks what is stored from then on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Position {
    timeline: i64,
    /// In the write-ahead log, bytes.
    bytes: i64,
}

/// The most that a server has seen of a database.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Which cluster it is: its copies have the same.
    system: i64,
    position: Position,
}

impl Seen {
    async fn of(session: &mut PgConnection) -> sqlx::Result<Self> {
        let row = session.fetch_one(POSITION).await?;
        let position = Position { timeline: row.try_get(1)?, bytes: row.try_get(2)? };
        Ok(Self { system: row.try_get(0)?, position })
    }

    /// Refuses what lacks something of this.
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
            return refuse(
                "the server that answers is another PostgreSQL cluster than before".to_owned(),
            );
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

/// The oldest PostgreSQL that is known to work.
const OLDEST: i64 = 140_000;

/// How many transactions store trials at a time unless the database says otherwise. One alone stores as many as wait, with
/// one statement of each kind; only where PostgreSQL has many cores do several together store more.
const WRITERS: usize = 1;

/// Most that a database may ask for.
const MOST_WRITERS: usize = 64;

/// A session that was idle for longer is asked whether it still lives.
const TRUSTED: Duration = Duration::from_secs(1);

/// The number that the database's setting names, if it is one; [`WRITERS`] if there is no setting.
fn writers_of(setting: &str) -> Option<usize> {
    match setting.trim() {
        "" => Some(WRITERS),
        number => number.parse().ok().filter(|number| (1..=MOST_WRITERS).contains(number)),
    }
}

/// The sessions, and where the server is.
pub(super) struct Sessions {
    pool: PgPool,
    runtime: Handle,
    hosts: Vec<PgConnectOptions>,
    patience: Duration,
    /// How many transactions of all servers store trials at a time: the database's setting `sidestep.writers`; 0
    /// until it was asked for.
    writers: AtomicUsize,
    /// Sessions that were begun before are given up: the database, or the way to it, was lost.
    lost_at: Arc<Mutex<Option<Instant>>>,
    /// Whether the server that takes writes must be looked for.
    is_lost: AtomicBool,
    /// The most that was seen of the database.
    seen: Arc<Mutex<Option<Seen>>>,
}

impl Sessions {
    /// At most `count` sessions, which `runtime` waits for. There is none yet.
    pub(super) fn new(address: &Address, count: u32, runtime: Handle) -> Self {
        let lost_at = Arc::new(Mutex::new(None));
        let lost = Arc::clone(&lost_at);
        let seen = Arc::new(Mutex::new(None));
        let known = Arc::clone(&seen);
        let options = PgPoolOptions::new()
            .max_connections(count)
            .acquire_timeout(address.patience)
            // Asking each session each time would double the ways to the database.
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

    /// How many transactions of all servers store trials at a time.
    pub(super) fn writers(&self) -> usize {
        self.writers.load(Ordering::Relaxed).max(1)
    }

    /// Finds the server that takes writes among those of the address: of several, the one on the newest timeline.
    pub(super) async fn find(&self) -> Result<(), StoreError> {
        let tries = self.hosts.iter().map(|host| async move {
            let silent = |_| StoreError::Unavailable("the server does not answer".to_owned());
            tokio::time::timeout(self.patience, self.try_host(host)).await.map_err(silent)?
        });
        let found = join_all(tries).await;
        let takes = |(at, found): (usize, &Result<Seen, StoreError>)| {
            Some((found.as_ref().ok()?.position, at))
        };
        // Of equal ones, the first of the address.
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

    /// Notes which cluster answers, and its timeline. Its position says nothing: a standby need not have what nobody
    /// was told is stored.
    fn note(&self, found: Seen) {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes = seen.map_or(0, |seen| seen.position.bytes);
        *seen = Some(Seen { position: Position { bytes, ..found.position }, ..found });
    }

    /// Notes that something was acknowledged that is in the write-ahead log up to here.
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
        // Nothing is lost if the server does not hear the goodbye.
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
            let standby = "the server does not allow writes; it is a standby, or set to be read only; name the primary";
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
                // A server that runs goes on as before.
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
            // The pool tries for as long as it may, and does not say why it failed.
            Err(sqlx::Error::PoolTimedOut) => {
                // Until it is found, nobody else waits for the pool.
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

    /// A session. To be called on a thread that may block.
    pub(super) fn take(&self) -> Result<Connection, StoreError> {
        let session = self.runtime.block_on(self.acquire())?;
        Ok(Connection::to_server(session, self.runtime.clone()))
    }

    /// A session in which the statements of `begin` were run.
    pub(super) fn begin(&self, begin: &str) -> Result<Connection, StoreError> {
        let mut is_second = false;
        loop {
            let db = self.take()?;
            match db.batch(begin).map_err(StoreError::from) {
                Ok(()) => return Ok(db),
                // The database was restarted meanwhile; nothing was done yet.
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

    /// Reads outside a transaction.
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

    /// Ends a session that does not work, and all that are idle.
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

    /// How many sessions are idle.
    pub(super) fn idle(&self) -> usize {
        self.pool.num_idle()
    }

    pub(super) async fn close(&self) {
        self.pool.close().await;
    }
}
