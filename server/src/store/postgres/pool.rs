//! Sessions that wait to be used again.

use crate::store::error::StoreError;
use crate::store::sql::Connection;
use rustls::ClientConfig;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tokio_postgres::Config;
use tokio_postgres_rustls::MakeRustlsConnect;

/// What holds in every session. `synchronous_commit`: an acknowledged trial survives a power cut, whatever
/// the server's default is. `enable_seqscan`: a session keeps the plans of its statements; one that was made
/// while a table was nearly empty would read the whole of it for every trial, until PostgreSQL next analyses it.
/// `jit`: such plans look too dear, and would be compiled. The other limits let nobody wait for ever.
const SETTINGS: &str = "SET synchronous_commit = on; SET lock_timeout = '10s'; \
                        SET idle_in_transaction_session_timeout = '60s'; \
                        SET client_min_messages = warning; \
                        SET enable_seqscan = off; SET jit = off";

/// The oldest PostgreSQL that is known to work.
const OLDEST: i32 = 140_000;

/// How many transactions store trials at a time unless the database says otherwise. One alone stores as many as wait, with
/// one statement of each kind; only where PostgreSQL has many cores do several together store more.
const WRITERS: usize = 1;

/// Most that a database may ask for.
const MOST_WRITERS: usize = 64;

/// The number that the database's setting names, if it is one; [`WRITERS`] if there is no setting.
fn writers_of(setting: &str) -> Option<usize> {
    match setting.trim() {
        "" => Some(WRITERS),
        number => number.parse().ok().filter(|number| (1..=MOST_WRITERS).contains(number)),
    }
}

/// Idle sessions, and how to begin one.
pub(super) struct Pool {
    /// How many transactions of all servers store trials at a time: the database's setting `sidestep.writers`; 0
    /// until a session has asked for it.
    writers: AtomicUsize,
    config: Config,
    tls: ClientConfig,
    /// None once the store is closed.
    idle: Mutex<Option<Vec<Connection>>>,
}

impl Drop for Pool {
    fn drop(&mut self) {
        self.close();
    }
}

/// Says goodbye on a thread of its own: that waits for the network, which the thread of a request must not.
fn end(sessions: Option<Vec<Connection>>) {
    if let Some(sessions) = sessions.filter(|sessions| !sessions.is_empty()) {
        // Without a thread the sessions end with the process.
        let _ = std::thread::Builder::new().spawn(move || drop(sessions));
    }
}

impl Pool {
    pub(super) fn new(config: Config, tls: ClientConfig) -> Self {
        let writers = AtomicUsize::new(0);
        Self { writers, config, tls, idle: Mutex::new(Some(Vec::new())) }
    }

    /// Begins a session.
    pub(super) fn connect(&self) -> Result<Connection, StoreError> {
        let tls = MakeRustlsConnect::new(self.tls.clone());
        let db = Connection::to_server(&self.config, tls)?;
        db.batch(SETTINGS)?;
        let about = "SELECT CAST(current_setting('server_version_num') AS INTEGER), \
                         current_setting('server_version'), current_setting('server_encoding'), \
                         coalesce(current_setting('sidestep.writers', TRUE), '')";
        let (number, version, encoding, writers): (i64, String, String, String) =
            db.query_row(about, [], |row| {
                Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
            })?;
        if number < OLDEST.into() {
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
        Ok(db)
    }

    /// How many transactions of all servers store trials at a time.
    pub(super) fn writers(&self) -> usize {
        self.writers.load(Ordering::Relaxed).max(1)
    }

    /// A session in which the statements of `begin` were run.
    pub(super) fn begin(&self, begin: &str) -> Result<Connection, StoreError> {
        if let Some(db) = self.take()? {
            match db.batch(begin).map_err(StoreError::from) {
                Ok(()) => return Ok(db),
                // The database was restarted meanwhile; nothing was done yet.
                Err(StoreError::Unavailable(_)) => self.forget(),
                Err(error) => {
                    if db.roll_back().is_ok() {
                        self.give_back(db);
                    }
                    return Err(error);
                }
            }
        }
        let db = self.connect()?;
        db.batch(begin)?;
        Ok(db)
    }

    /// Reads outside a transaction.
    pub(super) fn with<T>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        let db = match self.take()? {
            Some(db) => db,
            None => self.connect()?,
        };
        let found = read(&db);
        match &found {
            Err(StoreError::Unavailable(_)) => self.forget(),
            _ => self.give_back(db),
        }
        found
    }

    /// How many sessions are idle.
    pub(super) fn count(&self) -> usize {
        self.idle().as_ref().map_or(0, Vec::len)
    }

    pub(super) fn give_back(&self, db: Connection) {
        if let Some(idle) = self.idle().as_mut() {
            idle.push(db);
        }
    }

    /// Gives all idle sessions up: the database, or the way to it, was lost.
    pub(super) fn forget(&self) {
        if let Some(idle) = self.idle().as_mut() {
            end(Some(std::mem::take(idle)));
        }
    }

    pub(super) fn close(&self) {
        end(self.idle().take());
    }

    /// An idle session, if there is one.
    fn take(&self) -> Result<Option<Connection>, StoreError> {
        let mut idle = self.idle();
        let closed = || StoreError::Unavailable("it was closed".to_owned());
        let idle = idle.as_mut().ok_or_else(closed)?;
        while let Some(db) = idle.pop() {
            if !db.is_closed() {
                return Ok(Some(db));
            }
        }
        Ok(None)
    }

    fn idle(&self) -> MutexGuard<'_, Option<Vec<Connection>>> {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
