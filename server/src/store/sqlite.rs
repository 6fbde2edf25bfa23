//! The SQLite back end: one file, many readers and one writer thread.
//!
//! Reads (`readers`) and writes (`writer`) are separate, because SQLite allows only one writer at a
//! time, while readers never wait in WAL mode.

mod file;
mod connection;
mod log;
mod mark;
mod trees;
mod damaged;
mod original;
mod watch;
mod readers;
mod write_back;
mod writer;

use super::error::StoreError;
use super::lanes::Lane;
use super::migrations::{self, Failure, State};
use super::opening::{Misplaced, OpenError, Purpose};
use super::operation::{Operation, once, result_of};
use super::sql;
use crate::store::commits::Commits;
use file::Copied;
use log::Index;
use original::Original;
use readers::Readers;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::watch::Receiver;
use watch::Watch;
use writer::Writer;

pub(super) use connection::open;
pub use damaged::copy_damaged;
pub(super) use file::{COMPANION, DatabaseFile, Identity};
pub use file::{LEAST_FREE_BYTES, MAGIC};

/// An open database file with the schema of this version.
#[derive(Debug)]
pub(super) struct Sqlite {
    /// The file that the user named.
    named: DatabaseFile,
    /// The file in use: the named file, or a migrated copy of it.
    file: DatabaseFile,
    original: Arc<Original>,
    readers: Arc<Readers>,
    writer: Writer,
    watch: Mutex<Option<Watch>>,
    /// The lock for exclusive use of the file, if it was taken.
    lock: Mutex<Option<File>>,
    #[expect(dead_code, reason = "it is deleted when this is dropped")]
    copy: Option<Copied>,
}

impl Sqlite {
    /// Opens the file and applies missing migrations. If the purpose is only to read, the file is
    /// not changed. If it has an older version, a migrated copy of it is opened.
    pub(super) fn open(named: DatabaseFile, purpose: Purpose) -> Result<Self, OpenError> {
        let name = || named.path().display().to_string();
        let is_alone = matches!(purpose, Purpose::Alone | Purpose::Copy);
        let unusable = |reason: String| OpenError::Unusable { database: name(), reason };
        let advice = match purpose {
            Purpose::Read => "check the path, that it may be read, and that its disk has room",
            _ => "check the path, that it is writable, and that its disk has room",
        };
        let hint = |reason: String| unusable(format!("{reason}; {advice}"));
        let sqlite = |error: StoreError| match error {
            StoreError::Corrupt(reason) => {
                let if_it_was =
                    if reason.contains("not a database") { "if it was one, " } else { "" };
                unusable(format!(
                    "{reason}; {if_it_was}restore a backup with 'sidestep restore', or save what can still be read with \
                     'sidestep salvage'"
                ))
            }
            StoreError::Locked => {
                unusable("database is locked; another program writes to it, try again".to_owned())
            }
            StoreError::Unavailable(reason) => hint(reason),
            other => hint(other.to_string()),
        };
        let refused = |error: sql::Error| sqlite(error.into());
        let misfit = |failure: Failure| match failure {
            Failure::Unusable(error) => sqlite(error),
            Failure::Misfit(reason) => OpenError::Version { database: name(), reason },
        };
        let disk = |error: io::Error| hint(error.to_string());
        let replaced = || unusable(format!("{}; keep this file and its -wal", Misplaced::Replaced));
        if named.is_log_alone() {
            return Err(OpenError::LogAlone { database: name(), log: named.log().to_owned() });
        }
        if let Some(reason) = named.misleading() {
            return Err(unusable(reason));
        }
        // The index that a killed process left behind shows how many frames the log had.
        let index = || Index::read(&File::open(named.index()).ok()?, false);
        if let Some(why) = mark::misplaced(&named, index).map_err(disk)? {
            let (database, log) = (name(), named.log().to_owned());
            return Err(match why {
                Misplaced::Damaged => OpenError::DamagedLog { database, log },
                Misplaced::Replaced => replaced(),
                why => OpenError::Misplaced { database, log, why },
            });
        }
        // Servers of versions that had no marks do not lock the index.
        let has_mark = matches!(mark::of_file(&named), Ok(Some(_)));
        if !is_alone && has_mark && !named.shares_index() {
            return Err(unusable(format!(
                "a server uses it with another index of its write-ahead log than {}: the server's index was deleted or \
                 replaced; stop that server first",
                named.index().display()
            )));
        }
        match purpose {
            Purpose::Alone | Purpose::Copy | Purpose::Create => {
                named.sweep_copies();
                let is_new = named.is_empty();
                named.create().map_err(disk)?;
                if is_new && purpose == Purpose::Alone {
                    tracing::info!(file = name(), "created the database");
                }
            }
            Purpose::Change | Purpose::Read if named.is_empty() => {
                return Err(OpenError::Absent(name()));
            }
            Purpose::Change | Purpose::Read => {}
        }
        // If this program cannot use the file, or another server uses it, not a single byte of the
        // file is changed.
        let untouching = connection::untouching(&named).map_err(refused)?;
        let checked = migrations::check(&untouching).and_then(|state| {
            if state != State::Empty && purpose != Purpose::Copy {
                migrations::check_finished(&untouching)?;
            }
            Ok(state)
        });
        // A file that was copied while a server was writing mixes two states. Applying a log to
        // such a file would not repair it.
        let is_left = checked.is_ok()
            && purpose != Purpose::Read
            && named.has_log()
            && matches!(named.lock(), Ok(Some(_)));
        let torn = match is_left {
            true => connection::first_damage(&untouching).map_err(refused)?,
            false => None,
        };
        let is_replaced = checked.is_ok()
            && named.has_log()
            && mark::is_replaced(&named, &untouching).map_err(refused)?;
        drop(untouching);
        if checked.is_err() {
            connection::leave_no_log(&named);
        }
        let state = checked.map_err(misfit)?;
        if let Some(found) = torn {
            return Err(sqlite(StoreError::Corrupt(format!(
                "the file and its write-ahead log are not whole together ({found}), and nothing was changed; keep both"
            ))));
        }
        if is_replaced {
            return Err(replaced());
        }
        let is_current = state == State::Current;
        let lock = match (is_alone, purpose, is_current) {
            // A server of an older version may be using the file. It could not continue after a migration.
            (true, ..) | (_, Purpose::Create | Purpose::Change, false) => {
                let lock = named.lock_soon().map_err(|error| unusable(error.to_string()))?;
                Some(lock.ok_or_else(|| OpenError::Served(name()))?)
            }
            _ => None,
        };
        let is_copied = purpose == Purpose::Read && !is_current;
        let copy = is_copied.then(|| named.new_copy()).transpose().map_err(disk)?;
        let file = match &copy {
            None => named.clone(),
            Some(copy) => {
                let place = copy.file();
                let full = |error: sql::Error| match error.into() {
                    StoreError::Full => unusable(format!(
                        "it is of an older version, and there is no room for a copy of it in {}",
                        place.folder().display()
                    )),
                    other => sqlite(other),
                };
                connection::copy(&named, place.path()).map_err(full)?;
                copy.file()
            }
        };
        if purpose != Purpose::Read || is_copied {
            let db = connection::migrating(file.path()).map_err(refused)?;
            migrations::apply(&db).map_err(misfit)?;
            if state == State::Empty && purpose == Purpose::Copy {
                migrations::begin_copy(&db).map_err(sqlite)?;
            }
        }
        let original =
            Arc::new(Original::new(file.clone(), purpose == Purpose::Alone).map_err(sqlite)?);
        let only_reads = purpose == Purpose::Read;
        let readers = Arc::new(Readers::new(file.clone(), Arc::clone(&original), only_reads));
        let writer = match only_reads {
            true => Ok(Writer::none()),
            false => Writer::start(file.clone(), Arc::clone(&original), Arc::clone(&readers)),
        };
        let writer = writer.map_err(sqlite)?;
        let watch = match only_reads {
            true => None,
            false => Some(Watch::start(Arc::clone(&original), writer.rescue()).map_err(sqlite)?),
        };
        let (watch, lock) = (Mutex::new(watch), Mutex::new(lock));
        Ok(Self { named, file, original, readers, writer, watch, lock, copy })
    }

    /// Checks that the database accepts writes now.
    pub(super) async fn ready(&self) -> Result<(), StoreError> {
        const PATIENCE: Duration = Duration::from_secs(2);
        self.original.check()?;
        // After a failed write, only a real write shows whether the disk accepts writes again.
        let probe = match self.writer.has_failed() {
            true => "UPDATE mark SET text = text",
            false => "UPDATE mark SET text = text WHERE FALSE",
        };
        let probe = once(move |db| Ok(db.execute(probe, [])?));
        let begun = result_of(None, probe, async |operation| self.write(Lane::Request, operation));
        tokio::time::timeout(PATIENCE, begun).await.unwrap_or(Err(StoreError::Locked))?;
        self.file.check_disk()
    }

    /// Returns the folder of the file, if it has enough space for a temporary file of this size (bytes).
    pub(super) fn room(&self, bytes: u64) -> Result<PathBuf, StoreError> {
        let enough = LEAST_FREE_BYTES.saturating_mul(16).saturating_add(bytes);
        if self.file.free_bytes()? < enough {
            return Err(StoreError::Full);
        }
        Ok(self.file.folder().to_owned())
    }

    /// The identity of this file, independent of its name.
    pub(super) fn identity(&self) -> Result<Identity, StoreError> {
        self.named.identity()
    }

    pub(super) fn name(&self) -> String {
        self.named.path().display().to_string()
    }

    /// Writes a snapshot into a new file that only its owner can read.
    pub(super) async fn write_snapshot(&self, out: &Path) -> Result<(), StoreError> {
        let (from, to) = (self.file.clone(), DatabaseFile::at(out));
        let writing = tokio::task::spawn_blocking(move || {
            let refused = |error: std::io::Error| StoreError::Unavailable(error.to_string());
            to.create().map_err(refused)?;
            let copied = connection::copy(&from, to.path()).map_err(StoreError::from);
            if copied == Err(StoreError::Full)
                && let Some(what) = connection::damage(&connection::untouching(&from)?)?.pop()
            {
                // SQLite reports some kinds of damage as a full disk.
                return Err(StoreError::Corrupt(what));
            }
            copied
        });
        writing.await.map_err(|error| StoreError::Defect(error.to_string()))?
    }

    /// Lists damaged pages and dangling references.
    pub(super) async fn damage(&self) -> Result<Vec<String>, StoreError> {
        result_of(None, connection::damage, |operation| self.read_long(operation)).await
    }

    pub(super) fn commits(&self) -> Receiver<u64> {
        self.writer.commits()
    }

    /// Empties the write-ahead log, which still contains deleted data, as soon as no reader uses it.
    pub(super) fn forget_deleted(&self) {
        self.writer.empty_log();
    }

    pub(super) fn close(&self) {
        self.watch.lock().unwrap_or_else(PoisonError::into_inner).take();
        self.readers.close();
        self.writer.close();
        // This lock is released last, because closing any handle of the file releases SQLite's
        // locks on it.
        self.lock.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    pub(super) fn rescue_elsewhere(&self) {
        self.original.rescue_elsewhere();
    }

    /// Returns the reason why nothing can be stored any more, if the stored data could not be rescued
    /// either.
    pub(super) fn unrescued(&self) -> Option<StoreError> {
        let gone = || self.original.check().err().filter(|_| self.original.lacks_rescue());
        self.original.lost().or_else(gone)
    }

    pub(super) fn observed(&self) -> &Commits {
        self.writer.observed()
    }

    /// Numbers of waiting trials, other requests and background jobs.
    pub(super) fn waiting(&self) -> [usize; 3] {
        self.writer.waiting()
    }

    pub(super) fn free_bytes(&self) -> Result<u64, StoreError> {
        self.file.free_bytes()
    }

    pub(super) fn read(&self, operation: Operation) {
        self.readers.short(operation);
    }

    pub(super) async fn read_long(&self, operation: Operation) {
        self.readers.long(operation).await;
    }

    pub(super) fn write(&self, lane: Lane, operation: Operation) {
        self.writer.submit(lane, operation);
    }
}

#[cfg(test)]
mod tests;
