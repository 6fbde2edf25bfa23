//! The database as operations: the only code that speaks SQL.
//!
//! [`Store`] has one method for each operation; each module has the operations of one aggregate.
//! Arguments and results are values of the domain, outcomes are enums, and [`StoreError`] describes a
//! failure in the words of the domain. Every operation can return it; a method documents an error only
//! if it means something more. No connection, transaction or error code leaves this folder.
//!
//! There are two: SQLite, a file (`sqlite`), and PostgreSQL, a server that several Sidestep servers share
//! (`postgres`). Their statements are the same (`sql`).

mod error;
mod misfit;
mod lanes;
mod sql;
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
pub use sqlite::{LEAST_FREE_BYTES, MAGIC, Misplaced, copy_damaged};

use commits::Commits;
use lanes::{Lane, Lock};
use postgres::Postgres;
use sha2::{Digest, Sha256};
use sidestep::study::StudyConfig;
use sql::{Connection, Question};
use sqlite::{DatabaseFile, Sqlite};
use std::collections::HashMap;
use std::os::unix::fs::MetadataExt;
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
    /// Configurations by their hash; they never change.
    configs: RwLock<HashMap<String, Arc<StudyConfig>>>,
}

#[derive(Debug)]
enum Database {
    Sqlite(Sqlite),
    Postgres(Postgres),
}

/// What a database is opened for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To serve it or to fill it. It is created if there is none. No other server may use this file until it is
    /// closed: each would wait for the other's writes, and neither would know of them. Commands may read and write
    /// beside a server. Several servers share a PostgreSQL database.
    Alone,
    /// To copy a database into it, as [`Self::Alone`]. If it was empty, it is refused otherwise until
    /// [`Store::end_copy`].
    Copy,
    /// To add something. It is created if there is none.
    Create,
    /// To change what is there.
    Change,
    /// To read. The database is not changed: of a file of an older version, a copy is migrated and read.
    Read,
}

/// Why a database cannot be used. One line, naming the database.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The address is not that of a database that this build supports.
    #[error(
        "--database {url}: expected sqlite:FILE or postgres://USER@HOST/DATABASE, found {found}"
    )]
    Address {
        /// As given.
        url: String,
        /// What is wrong with it.
        found: String,
    },
    /// The database cannot be opened or created.
    #[error("{database}: cannot open the database: {reason}")]
    Unusable {
        /// The file, or the address without a password.
        database: String,
        /// What the system said.
        reason: String,
    },
    /// There is no database, and none was to be created.
    #[error("{0}: cannot open the database: it does not exist, or it is empty")]
    Absent(String),
    /// There is no database, but the log of one, which would be lost with the first write.
    #[error(
        "{database}: cannot open the database: it does not exist, or it is empty, but there is the write-ahead log \
         of one, {}, maybe with data that only it has; put its database back beside it, or move it to another folder",
        log.display()
    )]
    LogAlone {
        /// The file.
        database: String,
        /// The log.
        log: PathBuf,
    },
    /// The write-ahead log beside the file is not its own. SQLite would apply it.
    #[error(
        "{database}: cannot open the database: the write-ahead log beside it, {}, is not its own: {why}. Nothing was \
         changed. The log has what its database stored last: put that database back beside it. Only if that is gone for \
         good, move the log to another folder, and keep it",
        log.display()
    )]
    Misplaced {
        /// The file.
        database: String,
        /// The log.
        log: PathBuf,
        /// What is wrong.
        why: Misplaced,
    },
    /// SQLite would drop what the write-ahead log has behind a damaged part.
    #[error(
        "{database}: cannot open the database: the write-ahead log beside it, {}, is damaged: somebody overwrote a part of \
         it, and SQLite would drop all that was stored after that. Nothing was changed. Keep both files, and save what can \
         be read of them with 'sidestep salvage --from {database} --database sqlite:NEW'",
        log.display()
    )]
    DamagedLog {
        /// The file.
        database: String,
        /// The log.
        log: PathBuf,
    },
    /// The database is not of this version and cannot be migrated.
    #[error("{database}: cannot use the database: {reason}")]
    Version {
        /// The file, or the address without a password.
        database: String,
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

impl OpenError {
    /// The same of a database that its user knows by another name.
    #[must_use]
    pub fn named(self, name: String) -> Self {
        let log = PathBuf::from(format!("{name}-wal"));
        match self {
            Self::Address { .. } => self,
            Self::Unusable { reason, .. } => Self::Unusable { database: name, reason },
            Self::Absent(_) => Self::Absent(name),
            Self::LogAlone { .. } => Self::LogAlone { database: name, log },
            Self::DamagedLog { .. } => Self::DamagedLog { database: name, log },
            Self::Misplaced { why, .. } => Self::Misplaced { database: name, log, why },
            Self::Version { reason, .. } => Self::Version { database: name, reason },
            Self::Served(_) => Self::Served(name),
        }
    }
}

/// What messages say of an address that is none: no password, whatever else it has.
fn harmless(url: &str) -> String {
    match url.split_once(':') {
        Some((kind, _)) if kind.contains('=') || kind.contains('/') => "…".to_owned(),
        Some((kind, _)) if kind != "sqlite" => format!("{}:…", kind.trim()),
        None if url.contains('=') => "…".to_owned(),
        _ => url.to_owned(),
    }
}

/// Refuses what is no file, a file that this user must not read, and one to write to that has several names, or to read if the
/// log is that of another name: SQLite only says that it cannot open it, or keeps a log for each name.
fn check_file(file: &Path, purpose: Purpose) -> Result<(), OpenError> {
    let refuse =
        |reason: String| Err(OpenError::Unusable { database: file.display().to_string(), reason });
    let Ok(found) = std::fs::metadata(file) else {
        return match file.is_symlink() {
            true => refuse("it is a link, and what it leads to does not exist".to_owned()),
            false => Ok(()),
        };
    };
    if !found.is_file() {
        return refuse("it is a directory, a pipe or a device, not a file".to_owned());
    }
    if found.nlink() > 1
        && (purpose != Purpose::Read || DatabaseFile::at(file).has_log_of_other_name())
    {
        return refuse(
            "it has several names (hard links), and SQLite would keep a log for each; delete the names beside which there is no \
             -wal"
                .to_owned(),
        );
    }
    match std::fs::File::open(file) {
        Err(error) if error.kind() == std::io::ErrorKind::PermissionDenied => refuse(format!(
            "{error}; give this user the permission to read it, or run as its owner"
        )),
        _ => Ok(()),
    }
}

impl Store {
    /// Opens the database at `url` (`sqlite:FILE` or `postgres://…`) and applies missing migrations, unless it is
    /// only to be read.
    ///
    /// # Errors
    /// [`OpenError`], in one line; the database is unchanged then.
    pub async fn open(url: &str, purpose: Purpose) -> Result<Self, OpenError> {
        let url = url.to_owned();
        let opening = tokio::task::spawn_blocking(move || {
            Ok(match Postgres::is_address(&url) {
                true => Database::Postgres(Postgres::open(&url, purpose)?),
                false => {
                    let file = DatabaseFile::of_url(&url)
                        .map_err(|found| OpenError::Address { url: harmless(&url), found })?;
                    check_file(file.path(), purpose)?;
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

    /// The file of a database at `url`; none if that is the address of a server.
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

    /// Whether a server uses a file of SQLite, or did not close it.
    #[must_use]
    pub fn is_in_use(file: &Path) -> bool {
        DatabaseFile::at(file).is_in_use()
    }

    /// Whether a file of SQLite has a log that was not written back: a server uses it, or did not close it.
    #[must_use]
    pub fn has_log(file: &Path) -> bool {
        DatabaseFile::at(file).has_log()
    }

    /// Whether this is the file at `url`, by whatever name.
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

    /// Whether both are one database, by whatever names.
    ///
    /// # Errors
    /// [`StoreError`] if a database does not say which it is.
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

    /// What tells this database from others as long as it lives, also on another machine, in eight hexadecimal digits. A
    /// copy is another database.
    ///
    /// # Errors
    /// [`StoreError`] if the database does not say which it is.
    pub async fn code(&self) -> Result<String, StoreError> {
        let identity: String = self
            .read_long(|db| {
                // A mark: the word, the identity, and what changes with every commit.
                let file = "SELECT substr(text, 1, length('sidestep mark ') + 32) FROM mark";
                let server =
                    "SELECT (SELECT system_identifier FROM pg_control_system()) || ' ' || oid \
                     FROM pg_database WHERE datname = current_database()";
                Ok(db.query_row(db.choose(file, server), [], |row| row.get(0))?)
            })
            .await?;
        Ok(hex::encode(&Sha256::digest(identity)[..4]))
    }

    /// What messages call the database: its file, or its address without a password.
    #[must_use]
    pub fn name(&self) -> String {
        match &self.open.database {
            Database::Sqlite(database) => database.name(),
            Database::Postgres(database) => database.name().to_owned(),
        }
    }

    /// Writes everything, as it is at one instant, into a new file of SQLite, if this database is one.
    /// Returns whether it is.
    ///
    /// # Errors
    /// [`StoreError`] if the file is there already or the disk refuses it.
    pub async fn write_snapshot(&self, file: &Path) -> Result<bool, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.write_snapshot(file).await.map(|()| true),
            Database::Postgres(_) => Ok(false),
        }
    }

    /// Whether other servers may use this database.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        matches!(self.open.database, Database::Postgres(_))
    }

    /// Its commits.
    #[must_use]
    pub fn observed(&self) -> &Commits {
        match &self.open.database {
            Database::Sqlite(database) => database.observed(),
            Database::Postgres(database) => database.observed(),
        }
    }

    /// How many trials, other requests and jobs wait for a write.
    #[must_use]
    pub fn waiting(&self) -> [usize; 3] {
        match &self.open.database {
            Database::Sqlite(database) => database.waiting(),
            Database::Postgres(database) => database.waiting(),
        }
    }

    /// How many sessions with a database server are busy and idle, if there is such a server.
    #[must_use]
    pub fn sessions(&self) -> Option<[usize; 2]> {
        match &self.open.database {
            Database::Sqlite(_) => None,
            Database::Postgres(database) => Some(database.sessions()),
        }
    }

    /// The room on the disk of the database, bytes, where that is known.
    #[must_use]
    pub fn free_bytes(&self) -> Option<u64> {
        match &self.open.database {
            Database::Sqlite(database) => database.free_bytes().ok(),
            Database::Postgres(_) => None,
        }
    }

    /// Whether a write could be made now: one is begun and committed. SQLite's file must be the one that
    /// was opened, with [`LEAST_FREE_BYTES`] of room.
    ///
    /// # Errors
    /// What stands in the way.
    pub async fn ready(&self) -> Result<(), StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.ready().await,
            Database::Postgres(database) => database.ready().await,
        }
    }

    /// The folder for a temporary file of this length: SQLite's own, if that leaves room for what is to be
    /// stored, else the system's.
    ///
    /// # Errors
    /// [`StoreError::Full`] if there is not enough room.
    pub fn room(&self, bytes: u64) -> Result<PathBuf, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.room(bytes),
            Database::Postgres(database) => Ok(database.room()),
        }
    }

    /// Changes whenever something was stored, by this server or another one.
    #[must_use]
    pub fn commits(&self) -> watch::Receiver<u64> {
        match &self.open.database {
            Database::Sqlite(database) => database.commits(),
            Database::Postgres(database) => database.commits(),
        }
    }

    /// Notes that what was copied into an empty database is whole.
    ///
    /// # Errors
    /// [`StoreError`] if the disk or the server refuses.
    pub async fn end_copy(&self) -> Result<(), StoreError> {
        self.write_behind([Lock::Studies], migrations::end_copy).await
    }

    /// If somebody changes the file, what it had is written beside it; after this call, where that fails, to the working
    /// directory or to that for temporary files.
    pub fn rescue_elsewhere(&self) {
        if let Database::Sqlite(database) = &self.open.database {
            database.rescue_elsewhere();
        }
    }

    /// Why what was stored may be lost, once it is closed: somebody changed the file, and no other could be written.
    #[must_use]
    pub fn unrescued(&self) -> Option<StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.unrescued(),
            Database::Postgres(_) => None,
        }
    }

    /// Waits for what is under way and closes; SQLite writes its log back.
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

    /// Has SQLite overwrite what was deleted in its log too. PostgreSQL overwrites deleted rows when it
    /// vacuums.
    fn forget_deleted(&self) {
        if let Database::Sqlite(database) = &self.open.database {
            database.forget_deleted();
        }
    }

    /// A few rows, at once.
    async fn read<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.read(read),
            Database::Postgres(database) => database.read(read).await,
        }
    }

    /// Any number of rows, as they are at one instant.
    async fn read_long<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.read_long(read).await,
            Database::Postgres(database) => database.read_long(read).await,
        }
    }

    /// As [`Self::write`], ahead of all others: for trials.
    async fn write_first<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        question: Option<Question>,
        work: impl FnMut(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        match &self.open.database {
            Database::Sqlite(database) => database.write_trial(question, work).await,
            Database::Postgres(database) => {
                database.write_trial(locks.into(), question, work).await
            }
        }
    }

    /// An operation that a request waits for: its result is returned after the commit.
    async fn write<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.write_in(Lane::Request, locks.into(), work).await
    }

    /// As [`Self::write`], for an enrolment. While participants drive, PostgreSQL makes one enrolment at a time.
    async fn write_enrolment<T: Send + 'static, const N: usize>(
        &self,
        locks: [Lock; N],
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.write_in(Lane::Enrolment, locks.into(), work).await
    }

    /// An operation that no request waits for, and that no request may have to wait for long.
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
        match &self.open.database {
            Database::Sqlite(database) => database.write(lane, work).await,
            Database::Postgres(database) => database.write(lane, locks, work).await,
        }
    }
}
