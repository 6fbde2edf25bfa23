//! Checkpoints: a thread writes the write-ahead log back to the database while the writer continues.
//!
//! By default, SQLite runs a checkpoint in the commit that makes the log long, and every caller
//! that waits for the writer would wait for two syncs of many pages. So a thread with its own
//! connection runs checkpoints in rounds, until few pages are left. The writer writes these pages
//! back itself between two batches, because SQLite restarts the log only after a complete
//! checkpoint.

use super::connection;
use super::file::DatabaseFile;
use super::original::Original;
use crate::store::error::StoreError;
use crate::store::sql::Connection;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// Number of pages in the log that triggers a checkpoint.
const LONG: i64 = 4_000;

/// Number of pages in the log at which the writer runs a checkpoint itself instead of starting the
/// thread.
const TOO_LONG: i64 = 10 * LONG;

/// At most this many pages are left to the writer.
const FEW: i64 = 64;

/// Maximum number of rounds. Each round writes back the pages that were added during the previous round.
const MOST_ROUNDS: usize = 8;

/// Who runs the next checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Turn {
    /// Nobody. The next checkpoint begins when the log has reached the length `due`.
    Nobody,
    Thread,
    /// The writer, because only few pages are left.
    Writer,
}

/// A handle to the thread, for the writer.
pub(super) struct WriteBack {
    begin: Option<SyncSender<()>>,
    turn: Arc<Mutex<Turn>>,
    original: Arc<Original>,
    /// Number of pages in the log that triggers the next checkpoint. Every checkpoint raises this
    /// number. Otherwise, every commit would retry after an error or an incomplete round.
    due: i64,
    thread: Option<JoinHandle<()>>,
}

impl WriteBack {
    /// Starts the thread. It writes only to the original file.
    pub(super) fn start(file: DatabaseFile, original: Arc<Original>) -> Result<Self, StoreError> {
        let turn = Arc::new(Mutex::new(Turn::Nobody));
        let (begin, asked) = sync_channel(1);
        let (next, own) = (Arc::clone(&turn), Arc::clone(&original));
        let thread = std::thread::Builder::new()
            .name("store-log".to_owned())
            .spawn(move || {
                for () in asked {
                    let written = write_back(&file, &original);
                    if let Err(error) = &written {
                        tracing::warn!(%error, "the write-ahead log was not written back");
                    }
                    set(&next, if written == Ok(true) { Turn::Writer } else { Turn::Nobody });
                }
            })
            .map_err(|error| StoreError::Unavailable(error.to_string()))?;
        Ok(Self { begin: Some(begin), turn, original: own, due: LONG, thread: Some(thread) })
    }

    /// Triggers a checkpoint if the log is long. The writer thread calls this after a commit.
    pub(super) fn after_commit(&mut self, db: &Connection) {
        // If the number cannot be read, a checkpoint would fail, too, and the next commit reports the error.
        let pages = self.original.log_pages().unwrap_or(0);
        if pages < LONG {
            self.due = LONG;
        }
        let turn = *self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = pages >= self.due && turn == Turn::Nobody;
        if turn == Turn::Writer || (is_due && pages >= TOO_LONG) {
            self.due = pages.saturating_add(LONG);
            set(&self.turn, Turn::Nobody);
            let written = self.original.writing_back(|| connection::write_back(db));
            if let Err(error) = written.map_err(StoreError::from) {
                tracing::warn!(%error, "the write-ahead log was not written back");
            }
        } else if is_due && let Some(begin) = &self.begin {
            self.due = pages.saturating_add(LONG);
            // `turn` is set first, because the other thread may finish before this thread continues.
            set(&self.turn, Turn::Thread);
            if begin.try_send(()).is_err() {
                set(&self.turn, Turn::Nobody);
            }
        }
    }
}

fn set(turn: &Mutex<Turn>, to: Turn) {
    *turn.lock().unwrap_or_else(PoisonError::into_inner) = to;
}

impl Drop for WriteBack {
    fn drop(&mut self) {
        self.begin = None;
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("the thread that writes the log back failed");
        }
    }
}

/// Runs checkpoints. Returns whether only few pages are left, which were added during the last rounds.
fn write_back(file: &DatabaseFile, original: &Original) -> Result<bool, StoreError> {
    original.check_all()?;
    let db = connection::writing(file.path())?;
    let mut before = 0;
    for _ in 0..MOST_ROUNDS {
        let Some(pages) = original.writing_back(|| connection::write_back(&db))? else {
            return Ok(false);
        };
        if pages - before <= FEW {
            return Ok(true);
        }
        before = pages;
    }
    Ok(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_log_begins_anew_while_commits_go_on() {
        const COMMITS: usize = 3_000;
        let folder = tempfile::tempdir().unwrap();
        let file = DatabaseFile::at(&folder.path().join("log.db"));
        file.create().unwrap();
        let db = connection::writing(file.path()).unwrap();
        db.batch("CREATE TABLE page (bytes BLOB NOT NULL) STRICT").unwrap();
        let original = Original::new(file.clone(), true).unwrap();
        original.note_companions(true);
        let mut log = WriteBack::start(file, Arc::new(original)).unwrap();
        let mut longest = 0;
        let began_anew = (0..COMMITS).any(|_| {
            db.execute("INSERT INTO page VALUES (zeroblob(100000))", []).unwrap();
            let pages = connection::log_pages(&db).unwrap();
            log.after_commit(&db);
            longest = longest.max(pages);
            pages < longest
        });
        assert!(began_anew, "{longest} pages");
        assert!((LONG..=TOO_LONG + LONG).contains(&longest), "{longest} pages");
    }
}
