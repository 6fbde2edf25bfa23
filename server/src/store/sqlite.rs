//! SQLite: a file, read by many connections and written by one thread.
//!
//! Reads (`readers`) and writes (`writer`) are separate: SQLite has only one writer at a time, and in
//! WAL mode readers never wait.

mod file;
mod connection;
mod migrations;
mod readers;
mod write_back;
mod writer;

use super::error::{StoreError, reason};
use super::lanes::Lane;
use super::sql::Connection;
use super::{Missing, OpenError};
use crate::store::commits::Commits;
use readers::Readers;
use rusqlite::ErrorCode;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use writer::Writer;

pub(super) use file::DatabaseFile;
pub use file::LEAST_FREE_BYTES;

/// An open file with all migrations applied.
#[derive(Debug)]
pub(super) struct Sqlite {
    file: DatabaseFile,
    readers: Arc<Readers>,
    writer: Writer,
    /// The lock that a server holds.
    lock: Mutex<Option<File>>,
}

impl Sqlite {
    /// Opens the file and applies missing migrations.
    pub(super) fn open(file: DatabaseFile, missing: Missing) -> Result<Self, OpenError> {
        let name = || file.path().display().to_string();
        let unusable = |reason: String| OpenError::Unusable { database: name(), reason };
        let hint =
            |reason: String| unusable(format!("{reason}; check the path and that it is writable"));
        let sqlite = |error: rusqlite::Error| match error.sqlite_error_code() {
            Some(ErrorCode::NotADatabase | ErrorCode::DatabaseCorrupt) => unusable(reason(&error)),
            _ => hint(reason(&error)),
        };
        let misfit = |failure: migrations::Failure| match failure {
            migrations::Failure::Unusable(error) => sqlite(error),
            migrations::Failure::Misfit(reason) => OpenError::Version { database: name(), reason },
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
        let readers = Arc::new(Readers::new(file.clone()).map_err(unstarted)?);
        Ok(Self { readers, writer, lock: Mutex::default(), file })
    }

    /// Ensures that no other server uses this file until it is closed.
    pub(super) fn serve_alone(&self) -> Result<(), OpenError> {
        let name = || self.file.path().display().to_string();
        let lock = self
            .file
            .lock()
            .map_err(|error| OpenError::Unusable { database: name(), reason: error.to_string() })?;
        let lock = lock.ok_or_else(|| OpenError::Served(name()))?;
        *self.lock.lock().unwrap_or_else(PoisonError::into_inner) = Some(lock);
        Ok(())
    }

    /// Whether a write could be made now.
    pub(super) async fn ready(&self) -> Result<(), StoreError> {
        const PATIENCE: Duration = Duration::from_secs(2);
        let begun = self.write(Lane::Request, |db| Ok(db.query_row("SELECT 1", [], |_| Ok(()))?));
        tokio::time::timeout(PATIENCE, begun).await.unwrap_or(Err(StoreError::Locked))?;
        let free = self.file.free_bytes()?;
        if free < LEAST_FREE_BYTES { Err(StoreError::Full) } else { Ok(()) }
    }

    /// The folder of the file, if it has room for a temporary file of this length.
    pub(super) fn room(&self, bytes: u64) -> Result<PathBuf, StoreError> {
        let enough = LEAST_FREE_BYTES.saturating_mul(16).saturating_add(bytes);
        if self.file.free_bytes()? < enough {
            return Err(StoreError::Full);
        }
        Ok(self.file.folder().to_owned())
    }

    /// What tells this file from every other one, whatever it is called.
    pub(super) fn identity(&self) -> Result<String, StoreError> {
        let (device, inode) = self.file.identity()?;
        Ok(format!("{device} {inode}"))
    }

    pub(super) fn name(&self) -> String {
        self.file.path().display().to_string()
    }

    /// Writes all rows into a new file that only its owner can read.
    pub(super) async fn write_snapshot(&self, out: &Path) -> Result<(), StoreError> {
        let (from, to) = (self.file.path().to_owned(), DatabaseFile::at(out));
        let writing = tokio::task::spawn_blocking(move || {
            let refused = |error: std::io::Error| StoreError::Unavailable(error.to_string());
            to.create().map_err(refused)?;
            let db = connection::untouching(&from)?;
            db.execute("VACUUM INTO ?1", [to.path().to_string_lossy()])?;
            Ok(())
        });
        writing.await.map_err(|error| StoreError::Defect(error.to_string()))?
    }

    /// Damaged pages and references to nothing.
    pub(super) async fn damage(&self) -> Result<Vec<String>, StoreError> {
        self.read_long(|db| match db {
            Connection::Sqlite(db) => connection::damage(db),
            Connection::Postgres(_) => Ok(Vec::new()),
        })
        .await
    }

    pub(super) fn commits(&self) -> watch::Receiver<u64> {
        self.writer.commits()
    }

    /// Empties the write-ahead log, which still has what was deleted, as soon as no reader uses it.
    pub(super) fn forget_deleted(&self) {
        self.writer.empty_log();
    }

    pub(super) fn close(&self) {
        self.readers.close();
        self.writer.close();
        // Last: closing any handle of the file gives up SQLite's locks on it.
        self.lock.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    pub(super) fn observed(&self) -> &Commits {
        self.writer.observed()
    }

    /// How many trials, other requests and jobs wait.
    pub(super) fn waiting(&self) -> [usize; 3] {
        self.writer.waiting()
    }

    pub(super) fn free_bytes(&self) -> Result<u64, StoreError> {
        self.file.free_bytes()
    }

    pub(super) fn read<T>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        self.readers.short(read)
    }

    pub(super) async fn read_long<T: Send + 'static>(
        &self,
        read: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.readers.long(read).await
    }

    pub(super) async fn write<T: Send + 'static>(
        &self,
        lane: Lane,
        work: impl FnOnce(&Connection) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, StoreError> {
        self.writer.run(lane, work).await
    }
}
