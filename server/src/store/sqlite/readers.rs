//! Reading: short reads on the calling thread, long reads on threads that may block.

use super::connection;
use super::file::DatabaseFile;
use super::original::Original;
use crate::store::error::StoreError;
use crate::store::operation::Operation;
use crate::store::sql::Connection;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Semaphore;

/// Maximum number of concurrent long reads.
const LONG_READS: usize = 4;

/// Read-only connections.
#[derive(Debug)]
pub(super) struct Readers {
    file: DatabaseFile,
    original: Arc<Original>,
    /// Whether the file must stay untouched.
    only_reads: bool,
    /// The idle connections. `None` once the store is closed.
    idle: Mutex<Option<Vec<Connection>>>,
    long: Arc<Semaphore>,
}

impl Readers {
    /// Readers of the original file. They never read a file that replaces it.
    pub(super) fn new(file: DatabaseFile, original: Arc<Original>, only_reads: bool) -> Self {
        let idle = Mutex::new(Some(Vec::new()));
        Self { file, original, only_reads, idle, long: Arc::new(Semaphore::new(LONG_READS)) }
    }

    /// Reads a few rows on the calling thread. Readers never wait in WAL mode, and reading a few rows
    /// takes some microseconds. Handing the work to another thread would take longer.
    pub(super) fn short(&self, mut operation: Operation) {
        let done = self.with(|db| operation.run(db));
        operation.answer(done);
    }

    fn with(
        &self,
        read: impl FnOnce(&Connection) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        self.original.check()?;
        let db = self.take()?;
        let mut done = read(&db);
        if done.is_err()
            && let Err(error) = self.original.check()
        {
            done = Err(error);
        }
        if !done.as_ref().err().is_some_and(StoreError::ends_transaction) {
            self.give_back(db);
        }
        done
    }

    /// Reads any number of rows from one snapshot of the database.
    pub(super) async fn long(self: &Arc<Self>, mut operation: Operation) {
        let Ok(permit) = Arc::clone(&self.long).acquire_owned().await else {
            return operation.answer(Err(StoreError::closed()));
        };
        let readers = Arc::clone(self);
        tokio::task::spawn_blocking(move || {
            // The caller may be cancelled, so the work keeps the permit.
            let _permit = permit;
            let done = readers.with(|db| {
                db.control("BEGIN")?;
                let done = operation.run(db);
                // COMMIT would fail again because of a damaged page that the operation has already reported.
                db.control("ROLLBACK")?;
                done
            });
            operation.answer(done);
        });
    }

    /// Takes an idle connection. It has the file open even if the file was renamed or deleted, and
    /// can copy the data that it sees.
    pub(super) fn take_idle(&self) -> Option<Connection> {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let db = idle.as_mut()?.pop()?;
        // VACUUM INTO counts as a write.
        db.batch("PRAGMA query_only = OFF").ok()?;
        Some(db)
    }

    pub(super) fn close(&self) {
        self.long.close();
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).take();
        for db in idle.into_iter().flatten() {
            if self.original.check().is_err() {
                // Closing the last connection would delete the log, which may belong to another
                // file, or be the only copy of the data.
                std::mem::forget(db);
                continue;
            }
            // The last connection to close deletes an empty log.
            if !self.only_reads && !self.file.has_log() {
                let _ = db.batch("PRAGMA query_only = OFF");
            }
        }
        if self.only_reads {
            connection::leave_no_log(&self.file);
        }
    }

    fn take(&self) -> Result<Connection, StoreError> {
        let idle = {
            let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
            idle.as_mut().ok_or_else(StoreError::closed)?.pop()
        };
        match idle {
            Some(db) => Ok(db),
            None => Ok(connection::reading(&self.file, self.only_reads)?),
        }
    }

    fn give_back(&self, db: Connection) {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(idle) = idle.as_mut() {
            idle.push(db);
        }
    }
}

impl Drop for Readers {
    fn drop(&mut self) {
        self.close();
    }
}
