//! Connections to SQLite with this program's settings.

use super::file::DatabaseFile;
use crate::store::error::StoreError;
use crate::store::sql::{Connection, DANGLING, Result};
use futures_executor::block_on;
use futures_util::StreamExt;
use rustix::fs::{Access, access};
use sqlx::ConnectOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteJournalMode, SqliteSynchronous};
use std::path::Path;
use std::time::Duration;

/// How long a write waits for another process that holds the write lock.
const WRITE_PATIENCE: Duration = Duration::from_secs(5);

/// How long a read waits; it blocks a thread that serves requests.
const READ_PATIENCE: Duration = Duration::from_millis(250);

fn options(path: &Path, patience: Duration) -> SqliteConnectOptions {
    let options = SqliteConnectOptions::new().filename(path).busy_timeout(patience);
    options.statement_cache_capacity(128).disable_statement_logging()
}

pub(in crate::store) fn open(options: &SqliteConnectOptions) -> Result<Connection> {
    Ok(block_on(options.connect())?.into())
}

/// A connection that only reads, and changes no file even when it is closed.
pub(super) fn untouching(file: &DatabaseFile) -> Result<Connection> {
    // Of a file that nobody changes, SQLite would otherwise make a log and its index beside it, which this user must not,
    // or which the file's owner could not use.
    open(&options(file.path(), WRITE_PATIENCE).read_only(true).immutable(file.is_fixed()))
}

/// A connection that sees the file as it is without its log, and neither makes nor deletes anything.
pub(super) fn without_log(file: &DatabaseFile) -> Result<Connection> {
    open(&options(file.path(), WRITE_PATIENCE).read_only(true).immutable(true))
}

/// Writes all rows, as they are at one instant, into another file, which must be empty.
pub(super) fn copy(from: &DatabaseFile, to: &Path) -> Result<()> {
    let copied = copy_of(&untouching(from)?, to);
    leave_no_log(from);
    copied
}

/// The same of what a connection sees.
pub(super) fn copy_of(db: &Connection, to: &Path) -> Result<()> {
    db.execute("VACUUM INTO $1", [&*to.to_string_lossy()])?;
    draw_another(&open(&options(to, WRITE_PATIENCE).journal_mode(SqliteJournalMode::Delete))?)
}

/// Makes a copy a database of its own.
const ANOTHER: &str = "UPDATE mark SET text = printf('sidestep mark %s %020d %016d %s', \
     lower(hex(randomblob(16))), 0, 0, lower(hex(randomblob(8))))";

/// Makes a copy a database of its own, if it has a mark: the log of the one that was copied is not its own.
fn draw_another(db: &Connection) -> Result<()> {
    let has = "SELECT name FROM sqlite_schema WHERE name = 'mark'";
    if db.prepare_cached(has)?.exists([])? {
        db.execute(ANOTHER, [])?;
    }
    Ok(())
}

/// Deletes the empty log that connections which only read leave behind, unless somebody uses the file.
pub(super) fn leave_no_log(file: &DatabaseFile) {
    let is_there = std::fs::exists(file.log()).unwrap_or(false);
    if is_there && !file.has_log() && !file.is_fixed() {
        // The last connection that may write deletes it when it is closed. Nothing is lost if it stays.
        let nothing = "SELECT count(*) FROM sqlite_schema";
        let _ = open(&options(file.path(), READ_PATIENCE))
            .and_then(|db| db.query_row(nothing, [], |_| Ok(())));
    }
}

/// A connection that writes. The file must exist; a deleted file is not created again.
pub(super) fn writing(path: &Path) -> Result<Connection> {
    open(&of_writer(path)?)
}

/// The same for migrations, which rebuild tables under other names, so that references must not be enforced meanwhile.
pub(super) fn migrating(path: &Path) -> Result<Connection> {
    open(&of_writer(path)?.foreign_keys(false))
}

/// A connection to a damaged file of which nobody else knows, even if SQLite cannot parse what its tables are.
pub(super) fn mending(path: &Path) -> Result<Connection> {
    let options = options(path, WRITE_PATIENCE).foreign_keys(false);
    open(&options.pragma("writable_schema", "ON"))
}

fn of_writer(path: &Path) -> Result<SqliteConnectOptions> {
    if path.exists() && access(path, Access::WRITE_OK).is_err() {
        // SQLite opens such a file, and refuses the first write.
        let words = "this user must not write to the file".to_owned();
        return Err(StoreError::Unavailable(words).into());
    }
    Ok(options(path, WRITE_PATIENCE)
        .journal_mode(SqliteJournalMode::Wal)
        // So that an acknowledged trial survives a power cut, not only a crash.
        .synchronous(SqliteSynchronous::Full)
        // The log is written back elsewhere: see `write_back`.
        .pragma("wal_autocheckpoint", "0")
        // Deleted rows are overwritten.
        .pragma("secure_delete", "ON")
        // What undoes an operation is kept in memory, and not in a file that is made and deleted for each batch.
        .pragma("temp_store", "MEMORY"))
}

/// A connection that cannot write, not even by a mistake in a query. The last one that is closed writes the log back, unless
/// the file is to be left as it is.
pub(super) fn reading(file: &DatabaseFile, is_untouched: bool) -> Result<Connection> {
    let (options, is_fixed) = (options(file.path(), READ_PATIENCE), file.is_fixed());
    let options = options.pragma("query_only", "ON");
    open(&options.read_only(is_fixed || is_untouched).immutable(is_fixed))
}

/// Makes the indices of a file anew, as far as their tables can be read whole.
pub(super) fn renew_indices(db: &Connection) -> Result<()> {
    let query = "SELECT 'REINDEX ' || quote(name) FROM sqlite_schema WHERE type = 'index'";
    let mut statement = db.prepare_cached(query)?;
    let names = statement.query_map([], |row| row.get::<_, String>(0))?;
    for renewing in names.collect::<Result<Vec<_>>>()? {
        // An index of a table that has lost rows may know their keys, and stays.
        let _ = db.batch(&renewing);
    }
    Ok(())
}

/// How many rows its statements have changed so far, also those that were rolled back.
pub(super) fn changes(db: &Connection) -> Result<i64> {
    db.query_row("SELECT total_changes()", [], |row| row.get(0))
}

/// How many pages the log has.
pub(super) fn log_pages(db: &Connection) -> Result<i64> {
    db.query_row("PRAGMA wal_checkpoint(NOOP)", [], |row| row.get(1))
}

/// Writes back as much of the log as readers allow, and returns how many pages it had at the beginning; none if
/// another connection is writing it back.
pub(super) fn write_back(db: &Connection) -> Result<Option<i64>> {
    db.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |row| {
        let (busy, pages): (bool, i64) = (row.get(0)?, row.get(1)?);
        Ok((!busy).then_some(pages))
    })
}

/// Writes the whole log back and empties it, unless a reader uses it. Returns whether it was emptied.
pub(super) fn empty_log(db: &Connection) -> Result<bool, StoreError> {
    db.batch("PRAGMA busy_timeout = 0")?;
    let busy = db.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get::<_, bool>(0));
    db.batch(&format!("PRAGMA busy_timeout = {}", WRITE_PATIENCE.as_millis()))?;
    match busy.map_err(StoreError::from) {
        Err(StoreError::Locked) => Ok(false),
        busy => Ok(!busy?),
    }
}

/// The first damage that SQLite finds in the pages of the file, without comparing rows and indices.
pub(super) fn first_damage(db: &Connection) -> Result<Option<String>> {
    let found = db.query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0));
    match found.map_err(StoreError::from) {
        // The first line is a heading.
        Ok(found) => Ok(found.lines().last().filter(|found| *found != "ok").map(str::to_owned)),
        Err(StoreError::Corrupt(found)) => Ok(Some(found)),
        Err(error) => Err(error.into()),
    }
}

/// The damage that SQLite finds in the file: damaged pages and references to missing rows.
pub(super) fn damage(db: &Connection) -> Result<Vec<String>, StoreError> {
    let mut found = Vec::new();
    for query in ["PRAGMA integrity_check", DANGLING] {
        found.extend(db.with_link(async |db| lines(db, query).await, async |_| Vec::new())?);
    }
    found.retain(|line| line != "ok");
    found.dedup();
    Ok(found)
}

/// What a query answers, line by line. A damaged page ends it; that must not hide what was found before, nor what
/// other queries find.
async fn lines(db: &mut SqliteConnection, query: &'static str) -> Vec<String> {
    let mut rows = sqlx::query_scalar(query).fetch(db);
    let mut lines = Vec::new();
    while let Some(row) = rows.next().await {
        lines.push(row.unwrap_or_else(|error| StoreError::from(error).to_string()));
    }
    lines
}
