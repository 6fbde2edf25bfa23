//! The database as operations: the only code that speaks SQL.
//!
//! [`Store`] has one method for each operation; each module has the operations of one aggregate.
//! Arguments and results are values of the domain, outcomes are enums, and [`StoreError`] describes a
//! failure in the words of the domain. Every operation can return it; a method documents an error only
//! if it means something more. No connection, transaction or error code leaves this folder. So another
//! database is another implementation of the same methods that passes the same tests
//! (`store/tests.rs`).
//!
//! Reads (`readers`) and writes (`writer`) are separate: SQLite has only one writer at a time, and in
//! WAL mode readers never wait.

mod error;
mod file;
mod connection;
mod migrations;
mod readers;
mod writer;
pub mod audit;
pub mod keys;
pub mod studies;
pub mod value_functions;
pub mod analyses;
pub mod predictors;
pub mod scenes;
pub mod participants;
pub mod enrolments;
pub mod roster;
mod tallies;
pub mod trials;
pub mod people;
pub mod overview;
pub mod profiles;
pub mod imports;
pub mod snapshot;
#[cfg(test)]
pub(crate) mod tests;

pub use error::StoreError;
pub use file::LEAST_FREE_BYTES;
pub use migrations::Misfit;

use file::DatabaseFile;
use readers::Readers;
use rusqlite::{Connection, ErrorCode};
use sidestep::study::StudyConfig;
use std::collections::HashMap;
use std::fs::File;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::time::Duration;
use tokio::sync::watch;
use writer::{Lane, Writer};

/// An open database with all migrations applied.
#[derive(Clone, Debug)]
pub struct Store {
    open: Arc<Open>,
}

#[derive(Debug)]
struct Open {
    file: DatabaseFile,
    readers: Arc<Readers>,
    writer: Arc<Writer>,
    /// Configurations by their hash; they never change.
    configs: RwLock<HashMap<String, Arc<StudyConfig>>>,
    /// The lock that a server holds.
    lock: Mutex<Option<File>>,
}

/// What to do if there is no database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// Create an empty one.
    Create,
    /// Return an error.
    Refuse,
}

/// Why a database cannot be used. One line, naming the database.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The address is not that of a database that this build supports.
    #[error("--database {url}: expected sqlite:FILE, found {found}")]
    Address {
        /// As given.
        url: String,
        /// What is wrong with it.
        found: String,
    },
    /// The database cannot be opened or created.
    #[error("{file}: cannot open the database: {reason}")]
    Unusable {
        /// The file.
        file: String,
        /// What the system said.
        reason: String,
    },
    /// There is no database, and none was to be created.
    #[error("{0}: cannot open the database: there is no such file, or it is empty")]
    Absent(String),
    /// The database is not of this version and cannot be migrated.
    #[error("{file}: cannot use the database: {reason}")]
    Version {
        /// The file.
        file: String,
        /// What does not fit.
        reason: Misfit,
    },
    /// Another server uses it.
    #[error(
        "{0}: another 'sidestep serve' uses this database; stop it first or give this one its own \
         file"
    )]
    Served(String),
}

impl Store {
    /// Opens the database at `url` (`sqlite:FILE`) and applies missing migrations.
    ///
    /// # Errors
    /// [`OpenError`], in one line; the file is unchanged then.
    pub async fn open(url: &str, missing: Missing) -> Result<Self, OpenError> {
        let file = address(url)?;
        let opening = tokio::task::spawn_blocking(move || Self::open_file(file, missing));
        opening.await.unwrap_or_else(|error| {
            let file = url.to_owned();
            Err(OpenError::Unusable { file, reason: error.to_string() })
        })
    }

    fn open_file(file: DatabaseFile, missing: Missing) -> Result<Self, OpenError> {
        let name = || file.path().display().to_string();
        let unusable = |reason: String| OpenError::Unusable { file: name(), reason };
        let hint =
            |reason: String| unusable(format!("{reason}; check the path and that it is writable"));
        let sqlite = |error: rusqlite::Error| match error.sqlite_error_code() {
            Some(ErrorCode::NotADatabase | ErrorCode::DatabaseCorrupt) => {
                unusable(error::reason(&error))
            }
            _ => hint(error::reason(&error)),
        };
        let misfit = |reason: Misfit| match reason {
            Misfit::Unusable(error) => sqlite(error),
            reason => OpenError::Version { file: name(), reason },
        };
        match missing {
            Missing::Create => file.create().map_err(|error| hint(error.to_string()))?,
            Missing::Refuse if file.is_empty() => return Err(OpenError::Absent(name())),
            Missing::Refuse => {}
        }
        // A file that this program cannot use is not changed by a single byte.
        let untouching = connection::untouching(file.path()).map_err(sqlite)?;
        migrations::check(&untouching).map_err(misfit)?;
        drop(untouching);
        let mut db = connection::writing(file.path()).map_err(sqlite)?;
        migrations::apply(&mut db).map_err(misfit)?;
        let unstarted = |error: StoreError| unusable(error.to_string());
        let writer = Writer::start(file.clone()).map_err(unstarted)?;
        let open = Open {
            readers: Arc::new(Readers::new(file.clone()).map_err(unstarted)?),
            writer: Arc::new(writer),
            configs: RwLock::default(),
            lock: Mutex::default(),
            file,
        };
        Ok(Self { open: Arc::new(open) })
    }

    /// Ensures that no other server uses this database until it is closed, because two servers would
    /// take over each other's analyses. Commands may read and write beside a server.
    ///
    /// # Errors
    /// [`OpenError::Served`] if another one does.
    pub fn serve_alone(&self) -> Result<(), OpenError> {
        let name = || self.open.file.path().display().to_string();
        let lock = self
            .open
            .file
            .lock()
            .map_err(|error| OpenError::Unusable { file: name(), reason: error.to_string() })?;
        let lock = lock.ok_or_else(|| OpenError::Served(name()))?;
        *self.open.lock.lock().unwrap_or_else(PoisonError::into_inner) = Some(lock);
        Ok(())
    }

    /// Whether a write could be made now: one is begun and committed, the file is the one that
    /// was opened, and there are [`LEAST_FREE_BYTES`] of room.
    ///
    /// # Errors
    /// What stands in the way.
    pub async fn ready(&self) -> Result<(), StoreError> {
        const PATIENCE: Duration = Duration::from_secs(2);
        let begun = self.write(|db| Ok(db.query_row("SELECT 1", [], |_| Ok(()))?));
        tokio::time::timeout(PATIENCE, begun).await.unwrap_or(Err(StoreError::Locked))?;
        let free = self.open.file.free_bytes()?;
        if free < LEAST_FREE_BYTES { Err(StoreError::Full) } else { Ok(()) }
    }

    /// The folder of the database, for a temporary file of this length that leaves room for what is to be
    /// stored.
    ///
    /// # Errors
    /// [`StoreError::Full`] if there is not enough room.
    pub fn room(&self, bytes: u64) -> Result<PathBuf, StoreError> {
        let enough = LEAST_FREE_BYTES.saturating_mul(16).saturating_add(bytes);
        if self.open.file.free_bytes()? < enough {
            return Err(StoreError::Full);
        }
        Ok(self.open.file.folder().to_owned())
    }

    /// What SQLite itself finds wrong with the file: damaged pages and references
    /// to nothing. Empty for a sound database.
    ///
    /// # Errors
    /// If the check cannot be run.
    pub async fn damage(&self) -> Result<Vec<String>, StoreError> {
        self.read_long(connection::damage).await
    }

    /// How often something was stored since the database was opened, whenever that changes.
    #[must_use]
    pub fn commits(&self) -> watch::Receiver<u64> {
        self.open.writer.commits()
    }

    /// Waits for what is under way, writes the log back and closes.
    pub async fn close(&self) {
        let open = Arc::clone(&self.open);
        let closing = tokio::task::spawn_blocking(move || {
            open.readers.close();
            open.writer.close();
            // Last: closing any handle of the file gives up SQLite's locks on it.
            open.lock.lock().unwrap_or_else(PoisonError::into_inner).take();
        });
        if let Err(error) = closing.await {
            tracing::error!(%error, "closing the database");
        }
    }

    /// A few rows, at once.
    fn read<T>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        self.open.readers.short(read)
    }

    /// Any number of rows, as they are at one instant.
    async fn read_long<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.open.readers.long(read).await
    }

    /// As [`Self::write`], ahead of all others: for trials.
    async fn write_first<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.open.writer.run(Lane::Trial, work).await
    }

    /// An operation that a request waits for: its result is returned after the commit.
    async fn write<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.open.writer.run(Lane::Request, work).await
    }

    /// An operation that no request waits for, and that no request may have to wait for long.
    async fn write_behind<T: Send + 'static>(
        &self,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.open.writer.run(Lane::Background, work).await
    }
}

fn address(url: &str) -> Result<DatabaseFile, OpenError> {
    if url.starts_with("postgres:") || url.starts_with("postgresql:") {
        return Err(OpenError::Address {
            // Such an address may hold a password: it is not repeated.
            url: "postgres:…".to_owned(),
            found: "a PostgreSQL address, and this build speaks SQLite only".to_owned(),
        });
    }
    DatabaseFile::of_url(url).map_err(|found| OpenError::Address { url: url.to_owned(), found })
}
