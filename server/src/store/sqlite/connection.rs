//! Connections to SQLite with this program's settings.

use super::file::DatabaseFile;
use crate::store::error::{StoreError, reason};
use rusqlite::{Connection, OpenFlags};
use std::path::Path;
use std::time::Duration;

/// How long a write waits for another process that holds the write lock.
const WRITE_PATIENCE: Duration = Duration::from_secs(5);

/// How long a read waits; it blocks a thread that serves requests.
const READ_PATIENCE: Duration = Duration::from_millis(250);

/// A connection that only reads, and changes no file even when it is closed.
pub(super) fn untouching(file: &DatabaseFile) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = match file.is_fixed() {
        true => fixed(file.path())?,
        false => Connection::open_with_flags(file.path(), flags)?,
    };
    db.busy_timeout(WRITE_PATIENCE)?;
    Ok(db)
}

/// A connection to a file that nobody changes. SQLite would otherwise make a log and its index beside it, which this user
/// must not, or which the file's owner could not use.
fn fixed(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_NO_MUTEX
        | OpenFlags::SQLITE_OPEN_URI;
    let path = path.to_string_lossy().replace('%', "%25").replace('?', "%3f").replace('#', "%23");
    Connection::open_with_flags(format!("file:{path}?immutable=1"), flags)
}

/// Writes all rows, as they are at one instant, into another file, which must be empty.
pub(super) fn copy(from: &DatabaseFile, to: &Path) -> rusqlite::Result<()> {
    let copied = untouching(from)?.execute("VACUUM INTO ?1", [to.to_string_lossy()]).map(drop);
    leave_no_log(from);
    copied
}

/// Deletes the empty log that connections which only read leave behind, unless somebody uses the file.
fn leave_no_log(file: &DatabaseFile) {
    let is_there = std::fs::exists(file.log()).unwrap_or(false);
    if is_there && !file.has_log() && !file.is_fixed() {
        // The last connection that may write deletes it when it is closed. Nothing is lost if it stays.
        let _ = writing_nothing(file.path());
    }
}

fn writing_nothing(path: &Path) -> rusqlite::Result<()> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = Connection::open_with_flags(path, flags)?;
    db.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))
}

/// A connection that writes. The file must exist; a deleted file is not created again.
pub(super) fn writing(path: &Path) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = Connection::open_with_flags(path, flags)?;
    db.busy_timeout(WRITE_PATIENCE)?;
    if db.is_readonly(rusqlite::MAIN_DB)? {
        // SQLite opens such a file, and refuses the first write.
        let code = rusqlite::ffi::Error::new(rusqlite::ffi::SQLITE_READONLY);
        let words = "this user must not write to the file".to_owned();
        return Err(rusqlite::Error::SqliteFailure(code, Some(words)));
    }
    db.pragma_update(None, "journal_mode", "WAL")?;
    // So that an acknowledged trial survives a power cut, not only a crash.
    db.pragma_update(None, "synchronous", "FULL")?;
    db.pragma_update(None, "foreign_keys", true)?;
    // Deleted rows are overwritten.
    db.pragma_update(None, "secure_delete", true)?;
    // What undoes an operation is kept in memory, and not in a file that is made and deleted for each batch.
    db.pragma_update(None, "temp_store", "MEMORY")?;
    db.set_prepared_statement_cache_capacity(128);
    Ok(db)
}

/// A connection that cannot write, not even by a mistake in a query.
pub(super) fn reading(file: &DatabaseFile) -> rusqlite::Result<Connection> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let db = match file.is_fixed() {
        true => fixed(file.path())?,
        false => Connection::open_with_flags(file.path(), flags)?,
    };
    db.busy_timeout(READ_PATIENCE)?;
    db.pragma_update(None, "query_only", true)?;
    db.set_prepared_statement_cache_capacity(64);
    Ok(db)
}

/// Writes back as much of the log as readers allow, and returns how many pages it had at the beginning; none if
/// another connection is writing it back.
pub(super) fn write_back(db: &Connection) -> rusqlite::Result<Option<i64>> {
    db.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |row| {
        let (busy, pages): (bool, i64) = (row.get(0)?, row.get(1)?);
        Ok((!busy).then_some(pages))
    })
}

/// Writes the whole log back and empties it, unless a reader uses it. Returns whether it was emptied.
pub(super) fn empty_log(db: &Connection) -> Result<bool, StoreError> {
    db.busy_timeout(Duration::ZERO)?;
    let busy = db.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get::<_, bool>(0));
    db.busy_timeout(WRITE_PATIENCE)?;
    match busy.map_err(StoreError::from) {
        Err(StoreError::Locked) => Ok(false),
        busy => Ok(!busy?),
    }
}

/// The damage that SQLite finds in the file: damaged pages and references to missing rows.
pub(super) fn damage(db: &Connection) -> Result<Vec<String>, StoreError> {
    let mut found: Vec<String> = Vec::new();
    let mut check = db.prepare("PRAGMA integrity_check")?;
    let mut lines = check.query([])?;
    // A damaged page ends either check; it must not hide what was found before it.
    loop {
        match lines.next() {
            Ok(Some(line)) => found.push(line.get(0)?),
            Ok(None) => break,
            Err(error) => {
                found.push(reason(&error));
                break;
            }
        }
    }
    drop(lines);
    found.retain(|line| line != "ok");
    found.extend(dangling(db).unwrap_or_else(|error| vec![reason(&error)]));
    found.dedup();
    Ok(found)
}

/// References to missing rows.
pub(super) fn dangling(db: &Connection) -> rusqlite::Result<Vec<String>> {
    let mut statement = db.prepare("PRAGMA foreign_key_check")?;
    let lines = statement.query_map([], |row| {
        let (table, parent): (String, String) = (row.get(0)?, row.get(2)?);
        let row: Option<i64> = row.get(1)?;
        Ok(format!("{table}: row {} refers to nothing in {parent}", row.unwrap_or(-1)))
    })?;
    lines.collect()
}
