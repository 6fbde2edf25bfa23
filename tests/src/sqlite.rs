//! Files of SQLite, opened beside the server that uses them.

use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteRow};
use sqlx::{ConnectOptions, Connection, Row, TypeInfo, ValueRef};
use std::path::Path;
use std::time::Duration;

/// What a row has in a column.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// Nothing.
    Null,
    /// A whole number, or on PostgreSQL a truth value: 0 or 1.
    Integer(i64),
    /// A number.
    Real(f64),
    /// A text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// Opens a file that exists. Whoever looks at the file afterwards must close the connection: SQLite does so in
/// a thread, and dropping the connection does not wait for it.
///
/// # Errors
/// If there is no such file.
pub async fn open(file: &Path) -> sqlx::Result<SqliteConnection> {
    let options = SqliteConnectOptions::new().filename(file);
    options.busy_timeout(Duration::from_secs(10)).connect().await
}

/// What `talk` makes of a file, which is closed again when this returns.
///
/// # Errors
/// If there is no such file, or `talk` fails.
pub async fn with<T>(
    file: &Path,
    talk: impl AsyncFnOnce(&mut SqliteConnection) -> sqlx::Result<T>,
) -> sqlx::Result<T> {
    let mut db = open(file).await?;
    let found = talk(&mut db).await;
    db.close().await?;
    found
}

/// What a row has in each column.
///
/// # Errors
/// If SQLite does not give a value.
pub fn cells(row: &SqliteRow) -> sqlx::Result<Vec<Cell>> {
    (0..row.len()).map(|at| cell(row, at)).collect()
}

fn cell(row: &SqliteRow, at: usize) -> sqlx::Result<Cell> {
    let value = row.try_get_raw(at)?;
    if value.is_null() {
        return Ok(Cell::Null);
    }
    // What the value is, whatever the column was declared as.
    Ok(match value.type_info().name() {
        "INTEGER" => Cell::Integer(row.try_get(at)?),
        "REAL" => Cell::Real(row.try_get(at)?),
        "TEXT" => Cell::Text(String::from_utf8_lossy(row.try_get_unchecked(at)?).into_owned()),
        _ => Cell::Bytes(row.try_get(at)?),
    })
}
