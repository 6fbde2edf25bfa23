//! The database as operations. Only this module and its submodules contain SQL.
//!
//! [`Store`] has one method for each operation. Each submodule has the operations of one aggregate.
//! Arguments and results are domain types, outcomes are enums, and [`StoreError`] describes a
//! failure in domain terms. Every operation can return this error. The docs of a method mention the
//! error only if it has a special meaning for this method. Connections, transactions and error
//! codes are private to this folder.
//!
//! There are two back ends. SQLite is a file (`sqlite`). PostgreSQL is a server that several
//! Sidestep servers share (`postgres`). Both run the same statements (`sql`).

mod error;
mod misfit;
mod lanes;
mod sql;
mod opening;
mod migrations;
mod operation;
pub mod commits;
mod sqlite;
mod postgres;
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
pub mod throttles;
pub mod trials;
pub mod people;
pub mod overview;
pub mod profiles;
pub mod imports;
pub mod copying;
pub mod retention;
mod damage;
pub mod snapshot;
#[cfg(test)]
pub(crate) mod tests;

pub use error::StoreError;
pub use misfit::Misfit;
pub use opening::{Misplaced, OpenError, Purpose};
pub use sqlite::{LEAST_FREE_BYTES, MAGIC, copy_damaged};

use commits::Commits;
use lanes::{Lane, Lock};
use operation::{Operation, once, result_of};
use postgres::Postgres;
use sha2::{Digest, Sha256};
use sidestep::study::StudyConfig;
use sql::{Connection, Question};
use sqlite::{COMPANION, DatabaseFile, Sqlite};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, RwLock};
use tokio::sync::watch;

/// An open database with all migrations applied.
#[derive(Clone, Debug)]
pub struct Store {
    open: Arc<Open>,
}

#[derive(Debug)]
struct Open {
    database: Database,
    /// Configurations by their hash. They never change.
    configs: RwLock<HashMap<String, Arc<StudyConfig>>>,
}

#[derive(Debug)]
enum Database {
    Sqlite(Sqlite),
    Postgres(Postgres),
}

/// An invalid address as messages show it. All parts that could contain a password are replaced.
#[must_use]
pub fn harmless(url: &str) -> String {
    match url.split_once(':') {
        Some(("sqlite", name)) if name.contains("://") || name.contains('@') => {
            "sqlite:…".to_owned()
        }
        Some((kind, _)) if kind.contains('=') || kind.contains('/') => "…".to_owned(),
        Some((kind, _)) if kind != "sqlite" => format!("{}:…", kind.trim()),
        None if url.contains('=') => "…".to_owned(),
        _ => url.to_owned(),
    }
}

impl Store {
    /// Opens the database at `url` (`sqlite:FILE` or `postgres://…`) and applies missing
    /// migrations, unless `purpose` is only to read.
    ///
    /// # Errors
    /// [`OpenError`], whose message is one line. In this case the database is unchanged.
    pub async fn open(url: &str, purpose: Purpose) -> Result<Self, OpenError> {
        let url = url.to_owned();
        let opening = tokio::task::spawn_blocking(move || {
            Ok(match Postgres::is_address(&url) {
                true => Database::Postgres(Postgres::open(&url, purpose)?),
                false => {
                    let file = DatabaseFile::of_url(&url)
                        .map_err(|found| OpenError::Address { url: harmless(&url), found })?;
                    DatabaseFile::check(file.path(), purpose)?;
                    Database::Sqlite(Sqlite::open(file, purpose)?)
                }
            })
        });
        let database = opening.await.unwrap_or_else(|error| {
            let database = "the database".to_owned();
            Err(OpenError::Unusable { database, reason: error.to_string() })
        })?;
        if let Database::Postgres(database) = &database {
            database.watch();
        }
        Ok(Self { open: Arc::new(Open { database, configs: RwLock::default() }) })
    }

    /// The file of the database at `url`. Returns `None` if `url` is the address of a server.
    ///
    /// # Errors
    /// [`OpenError::Address`].
    pub fn file(url: &str) -> Result<Option<PathBuf>, OpenError> {
        if Postgres::is_address(url) {
            return Ok(None);
        }
        let file = DatabaseFile::of_url(url);
        let file = file.map_err(|found| OpenError::Address { url: harmless(url), found })?;
        Ok(Some(file.path().to_owned()))
    }

    /// The reason why this file must not be a database or a backup: SQLite could overwrite or
    /// delete a file with this name. `None` if the name is allowed.
    #[must_use]
    pub fn refused_name(file: &Path) -> Option<&'static str> {
        DatabaseFile::is_companion(file).then_some(COMPANION)
    }

    /// Whether a server uses this SQLite file, or exited without closing it.
    #[must_use]
    pub fn is_in_use(file: &Path) -> bool {
        DatabaseFile::at(file).is_in_use()
    }

    /// Whether a SQLite file has a log that was not written back. This means that a server uses the
    /// file, or exited without closing it.
    #[must_use]
    pub fn has_log(file: &Path) -> bool {
        DatabaseFile::at(file).has_log()
    }

    /// Whether `url` is the address of this database's file, under any of the file's names.
    ///
    /// # Errors
    /// [`OpenError::Address`].
    pub fn is_file_at(&self, url: &str) -> Result<bool, OpenError> {
        let other = Self::file(url)?.and_then(|path| DatabaseFile::at(&path).identity().ok());
        Ok(match &self.open.database {
            Database::Sqlite(database) => other.is_some() && other == database.identity().ok(),
            Database::Postgres(_) => false,
        })
    }

    /// Whether both stores are the same database, possibly under different names.
    ///
    /// # Errors
    /// [`StoreError`] if the identity of a database cannot be read.
    pub async fn is_same(&self, other: &Self) -> Result<bool, StoreError> {
        Ok(self.identity().await? == other.identity().await?)
    }

    async fn identity(&self) -> Result<String, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => {
                let (device, inode) = database.identity()?;
                Ok(format!("{device} {inode}"))
            }
            Database::Postgres(database) => database.identity().await,
        }
    }

    /// A permanent identifier of this database in eight hexadecimal digits. It does not change if
    /// the database moves to another machine. A copy gets a new identifier.
    ///
    /// # Errors
    /// [`StoreError`] if the identity of the database cannot be read.
    pub async fn code(&self) -> Result<String, StoreError> {
        let identity: String = self
            .read_long(|db| {
                // A mark consists of a prefix, the identity, and a part that changes with every commit.
                let file = "SELECT substr(text, 1, length('sidestep mark ') + 32) FROM mark";
                let server =
                    "SELECT (SELECT system_identifier FROM pg_control_system()) || ' ' || oid \
                     FROM pg_database WHERE datname = current_database()";
                Ok(db.query_row(db.choose(file, server), [], |row| row.get(0))?)
            })
            .await?;
        Ok(hex::encode(&Sha256::digest(identity)[..4]))
    }

    /// The database's name in messages: its file, or its address without a password.
    #[must_use]
    pub fn name(&self) -> String {
        match &self.open.database {
            Database::Sqlite(database) => database.name(),
            Database::Postgres(database) => database.name().to_owned(),
        }
    }

    /// If this database is SQLite, writes a snapshot into a new SQLite file. Returns whether this
    /// database is SQLite.
    ///
    /// # Errors
    /// [`StoreError`] if the file exists or cannot be written.
    pub async fn write_snapshot(&self, file: &Path) -> Result<bool, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.write_snapshot(file).await.map(|()| true),
            Database::Postgres(_) => Ok(false),
        }
    }

    /// Whether other servers can use this database at the same time.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        matches!(self.open.database, Database::Postgres(_))
    }

    /// Statistics of this store's commits.
    #[must_use]
    pub fn observed(&self) -> &Commits {
        match &self.open.database {
            Database::Sqlite(database) => database.observed(),
            Database::Postgres(database) => database.observed(),
        }
    }

    /// The numbers of trials, of other requests, and of background jobs that wait for a write.
    #[must_use]
    pub fn waiting(&self) -> [usize; 3] {
        match &self.open.database {
            Database::Sqlite(database) => database.waiting(),
            Database::Postgres(database) => database.waiting(),
        }
    }

    /// The numbers of busy and idle sessions with the database server. `None` for SQLite.
    #[must_use]
    pub fn sessions(&self) -> Option<[usize; 2]> {
        match &self.open.database {
            Database::Sqlite(_) => None,
            Database::Postgres(database) => Some(database.sessions()),
        }
    }

    /// Free space on the disk of the database (bytes), if known.
    #[must_use]
    pub fn free_bytes(&self) -> Option<u64> {
        match &self.open.database {
            Database::Sqlite(database) => database.free_bytes().ok(),
            Database::Postgres(_) => None,
        }
    }

    /// Checks that the database accepts writes now, by beginning and committing a transaction. A SQLite
    /// file must still be the file that was opened, and its disk must have [`LEAST_FREE_BYTES`] of free
    /// space.
    ///
    /// # Errors
    /// The reason, if the database does not accept writes.
    pub async fn ready(&self) -> Result<(), StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.ready().await,
            Database::Postgres(database) => database.ready().await,
        }
    }

    /// The folder for a temporary file of this length. For SQLite, it is the folder of the database file,
    /// if enough space stays free for later writes. For PostgreSQL, it is the system's temporary folder.
    ///
    /// # Errors
    /// [`StoreError::Full`] if there is not enough space.
    pub fn room(&self, bytes: u64) -> Result<PathBuf, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.room(bytes),
            Database::Postgres(database) => Ok(database.room()),
        }
    }

    /// A value that changes with every commit by this server or by another server.
    #[must_use]
    pub fn commits(&self) -> watch::Receiver<u64> {
        match &self.open.database {
            Database::Sqlite(database) => database.commits(),
            Database::Postgres(database) => database.commits(),
        }
    }

    /// If a copy into this database was begun while it was empty, records the source of the copy.
    /// Returns whether there is an unfinished copy from another source.
    ///
    /// # Errors
    /// [`StoreError`] if this cannot be stored.
    pub async fn claim_copy(&self, source: &str) -> Result<bool, StoreError> {
        let hash = Sha256::digest(source);
        let hash = u32::from_be_bytes([hash[0], hash[1], hash[2], hash[3]]);
        self.write_behind([Lock::Studies], move |db| migrations::claim_copy(db, hash)).await
    }

    /// Records that the copy into an empty database is complete.
    ///
    /// # Errors
    /// [`StoreError`] if this cannot be stored.
    pub async fn end_copy(&self) -> Result<(), StoreError> {
        self.write_behind([Lock::Studies], migrations::end_copy).await
    }

    /// If another process changes the database file, its content is rescued into a file beside it. After
    /// this call, a rescue that fails is tried again in the working directory and the temporary directory.
    pub fn rescue_elsewhere(&self) {
        if let Database::Sqlite(database) = &self.open.database {
            database.rescue_elsewhere();
        }
    }

    /// The reason why stored data may be lost when the database is closed. It exists if another
    /// process changed the file and the rescue failed.
    #[must_use]
    pub fn unrescued(&self) -> Option<StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.unrescued(),
            Database::Postgres(_) => None,
        }
    }

    /// Waits for operations in progress and closes the database. SQLite then writes its log back.
    pub async fn close(&self) {
        match &self.open.database {
            Database::Sqlite(_) => {
                let open = Arc::clone(&self.open);
                let closing = tokio::task::spawn_blocking(move || {
                    if let Database::Sqlite(database) = &open.database {
                        database.close();
                    }
                });
                if let Err(error) = closing.await {
                    tracing::error!(%error, "closing the database");
                }
            }
            Database::Postgres(database) => database.close().await,
        }
    }

    /// Makes SQLite overwrite deleted data in its log as well. PostgreSQL overwrites deleted rows
    /// when it vacuums.
    fn forget_deleted(&self) {
        if let Database::Sqlite(database) = &self.open.database {
            database.forget_deleted();
        }
    }

    /// Reads a few rows. For SQLite, this runs on the calling thread.
    async fn read<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        result_of(None, once(read), |operation| self.open.database.read(operation)).await
    }

    /// Reads any number of rows, from one snapshot.
    async fn read_long<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        result_of(None, once(read), |operation| self.open.database.read_long(operation)).await
    }

    /// Like [`Self::write`], for an operation that stores a trial. The operation runs before all
    /// other waiting writes. It runs again if another trial in the same transaction fails.
    async fn write_first<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        question: Option<Question>,
        work: impl FnMut(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        let database = &self.open.database;
        result_of(question, work, |operation| database.write(Lane::Trial, locks.into(), operation))
            .await
    }

    /// Runs an operation for a waiting request, and returns the result after the commit.
    async fn write<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.write_in(Lane::Request, locks.into(), work).await
    }

    /// Like [`Self::write`], for an enrolment. While trials are arriving, PostgreSQL runs one
    /// enrolment at a time.
    async fn write_enrolment<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.write_in(Lane::Enrolment, locks.into(), work).await
    }

    /// Runs an operation for which no request waits. It must not delay requests.
    async fn write_behind<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.write_in(Lane::Background, locks.into(), work).await
    }

    async fn write_in<T: Send + 'static>(
        &self,
        lane: Lane,
        locks: Vec<Lock>,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        let database = &self.open.database;
        result_of(None, once(work), |operation| database.write(lane, locks, operation)).await
    }
}

impl Database {
    async fn read(&self, operation: Operation) {
        match self {
            Self::Sqlite(database) => database.read(operation),
            Self::Postgres(database) => database.read(operation).await,
        }
    }

    async fn read_long(&self, operation: Operation) {
        match self {
            Self::Sqlite(database) => database.read_long(operation).await,
            Self::Postgres(database) => database.read_long(operation).await,
        }
    }

    async fn write(&self, lane: Lane, locks: Vec<Lock>, operation: Operation) {
        match self {
            Self::Sqlite(database) => database.write(lane, operation),
            Self::Postgres(database) => database.write(lane, locks, operation).await,
        }
    }
}
