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

/// Timeout of a write that waits for another process's write lock.
const WRITE_PATIENCE: Duration = Duration::from_secs(5);

/// Timeout of a read. It is short, because a read blocks a thread that serves requests.
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
    // If this user cannot change the file and no process uses it, `immutable` keeps SQLite from
    // creating a log and its index beside it. This user might not be allowed to create these files,
    // or the file's owner could not use them.
    open(&options(file.path(), WRITE_PATIENCE).read_only(true).immutable(file.is_fixed()))
}

/// A connection that reads the file without its log, and neither creates nor deletes any file.
pub(super) fn without_log(file: &DatabaseFile) -> Result<Connection> {
    open(&options(file.path(), WRITE_PATIENCE).read_only(true).immutable(true))
}

/// Writes a snapshot into another file, which must be empty.
pub(super) fn copy(from: &DatabaseFile, to: &Path) -> Result<()> {
    let copied = copy_of(&untouching(from)?, to);
    leave_no_log(from);
    copied
}

/// Writes the snapshot that a connection sees into another file, which must be empty.
pub(super) fn copy_of(db: &Connection, to: &Path) -> Result<()> {
    db.execute("VACUUM INTO $1", [&*to.to_string_lossy()])?;
    draw_another(&open(&options(to, WRITE_PATIENCE).journal_mode(SqliteJournalMode::Delete))?)
}

/// The statement that gives a copy its own identity.
const ANOTHER: &str = "UPDATE mark SET text = printf('sidestep mark %s %020d %016d %s', \
     lower(hex(randomblob(16))), 0, 0, lower(hex(randomblob(8))))";

/// Gives a copy that has a mark its own identity, so that the original's log does not match the copy.
fn draw_another(db: &Connection) -> Result<()> {
    let has = "SELECT name FROM sqlite_schema WHERE name = 'mark'";
    if db.prepare_cached(has)?.exists([])? {
        db.execute(ANOTHER, [])?;
    }
    Ok(())
}

/// Deletes the empty log that read-only connections leave behind, unless another process uses the file.
pub(super) fn leave_no_log(file: &DatabaseFile) {
    let is_there = std::fs::exists(file.log()).unwrap_or(false);
    if is_there && !file.has_log() && !file.is_fixed() {
        // When the last connection that can write closes, it deletes the log. An empty log that
        // remains does no harm.
        let nothing = "SELECT count(*) FROM sqlite_schema";
        let _ = open(&options(file.path(), READ_PATIENCE))
            .and_then(|db| db.query_row(nothing, [], |_| Ok(())));
    }
}

/// A connection that writes. The file must exist; a deleted file is not created again.
pub(super) fn writing(path: &Path) -> Result<Connection> {
    open(&of_writer(path)?)
}

/// A connection for migrations. It does not enforce foreign keys, because migrations rebuild tables
/// under other names.
pub(super) fn migrating(path: &Path) -> Result<Connection> {
    open(&of_writer(path)?.foreign_keys(false))
}

/// A connection to a damaged file that only this process uses. It works even if SQLite cannot parse
/// the schema.
pub(super) fn mending(path: &Path) -> Result<Connection> {
    let options = options(path, WRITE_PATIENCE).foreign_keys(false);
    open(&options.pragma("writable_schema", "ON"))
}

fn of_writer(path: &Path) -> Result<SqliteConnectOptions> {
    if path.exists() && access(path, Access::WRITE_OK).is_err() {
        // SQLite would open such a file, but refuse the first write.
        let words = "this user has no permission to write to the file".to_owned();
        return Err(StoreError::Unavailable(words).into());
    }
    Ok(options(path, WRITE_PATIENCE)
        .journal_mode(SqliteJournalMode::Wal)
        // An acknowledged trial must survive a power failure, not only a crash.
        .synchronous(SqliteSynchronous::Full)
        // `write_back` runs the checkpoints.
        .pragma("wal_autocheckpoint", "0")
        // Overwrites deleted rows.
        .pragma("secure_delete", "ON")
        // Keeps savepoint data in memory, instead of creating and deleting a file for each batch.
        .pragma("temp_store", "MEMORY"))
}

/// A connection that cannot write, not even through a faulty query. When the last connection to the
/// file closes, it runs a checkpoint, unless the file must stay untouched.
pub(super) fn reading(file: &DatabaseFile, is_untouched: bool) -> Result<Connection> {
    let (options, is_fixed) = (options(file.path(), READ_PATIENCE), file.is_fixed());
    let options = options.pragma("query_only", "ON");
    open(&options.read_only(is_fixed || is_untouched).immutable(is_fixed))
}

/// Rebuilds the indices of all tables that can be read completely. The connection must come from
/// [`mending`]. If a table has lost rows, its indices stay as they are, because they still contain the
/// keys of these rows.
pub(super) fn renew_indices(db: &Connection) -> Result<()> {
    const PUT: &str = "UPDATE sqlite_schema SET rootpage = \
                           (SELECT rootpage FROM sqlite_schema WHERE name = 'renewed') WHERE name = $1";
    let query = "SELECT name, printf('\"%w\"', name), printf('\"%w\"', tbl_name), coalesce(sql, ''), \
                     (SELECT group_concat(printf('\"%w\"', key.name)) FROM pragma_index_info(own.name) AS key) \
                 FROM sqlite_schema AS own WHERE type = 'index'";
    let mut statement = db.prepare_cached(query)?;
    let indices = statement.query_map([], |row| {
        let texts: [String; 4] = [row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?];
        Ok((texts, row.get::<_, Option<String>>(4)?))
    })?;
    for ([name, quoted, table, made_by], columns) in indices.collect::<Result<Vec<_>>>()? {
        let lacks_rows = format!(
            "SELECT (SELECT count(rowid) FROM {table} INDEXED BY {quoted}) \
                  > (SELECT count(rowid) FROM {table} NOT INDEXED)"
        );
        match db.query_row(&lacks_rows, [], |row| row.get::<_, bool>(0)) {
            Ok(true) => continue,
            Ok(false) if db.batch(&format!("REINDEX {quoted}")).is_ok() => continue,
            // If the count fails, the index is damaged and may refer to pages of a table. REINDEX
            // is not run, because it could free these pages.
            Ok(false) | Err(_) => {}
        }
        let Some(columns) = columns else { continue };
        // SQLite cannot clear an index with damaged pages, so a new index takes its place.
        let make = match &*made_by {
            "" => format!("CREATE UNIQUE INDEX renewed ON {table} ({columns})"),
            text => text.replacen(&format!("INDEX {name} "), "INDEX renewed ", 1),
        };
        if db.batch(&make).is_ok() {
            db.execute(PUT, [name])?;
            db.batch(
                "DELETE FROM sqlite_schema WHERE name = 'renewed'; PRAGMA writable_schema = RESET; \
                 PRAGMA writable_schema = ON",
            )?;
        }
    }
    Ok(())
}

/// Number of pages (frames) in the log.
pub(super) fn log_pages(db: &Connection) -> Result<i64> {
    db.query_row("PRAGMA wal_checkpoint(NOOP)", [], |row| row.get(1))
}

/// Runs a checkpoint as far as readers allow. Returns the number of pages in the log, or `None` if
/// another connection is running a checkpoint.
pub(super) fn write_back(db: &Connection) -> Result<Option<i64>> {
    db.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |row| {
        let (busy, pages): (bool, i64) = (row.get(0)?, row.get(1)?);
        Ok((!busy).then_some(pages))
    })
}

/// Runs a complete checkpoint and empties the log, unless a reader uses the log. Returns whether it
/// was emptied.
pub(super) fn empty_log(db: &Connection) -> Result<bool, StoreError> {
    db.batch("PRAGMA busy_timeout = 0")?;
    let busy = db.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |row| row.get::<_, bool>(0));
    db.batch(&format!("PRAGMA busy_timeout = {}", WRITE_PATIENCE.as_millis()))?;
    match busy.map_err(StoreError::from) {
        Err(StoreError::Locked) => Ok(false),
        busy => Ok(!busy?),
    }
}

/// The first damaged page that SQLite finds in the file, without comparing rows and indices.
pub(super) fn first_damage(db: &Connection) -> Result<Option<String>> {
    let found = db.query_row("PRAGMA quick_check(1)", [], |row| row.get::<_, String>(0));
    match found.map_err(StoreError::from) {
        // The first line can be a title.
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

/// The lines of a query's result. A damaged page ends the query. The error then becomes the last
/// line, so that it hides neither the lines before it nor the results of other queries.
async fn lines(db: &mut SqliteConnection, query: &'static str) -> Vec<String> {
    let mut rows = sqlx::query_scalar(query).fetch(db);
    let mut lines = Vec::new();
    while let Some(row) = rows.next().await {
        lines.push(row.unwrap_or_else(|error| StoreError::from(error).to_string()));
    }
    lines
}
