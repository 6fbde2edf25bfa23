//! Access to SQLite files while a server uses them.

use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection, SqliteRow};
use sqlx::{ConnectOptions, Connection, Row, TypeInfo, ValueRef};
use std::path::Path;
use std::time::Duration;

/// The value of a column in a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// NULL.
    Null,
    /// An integer. From PostgreSQL, also a boolean as 0 or 1.
    Integer(i64),
    /// A floating-point number.
    Real(f64),
    /// A text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

/// Opens an existing file. A caller that accesses the file afterwards must close the connection,
/// because SQLite closes a file in another thread, and dropping the connection does not wait for
/// this.
///
/// # Errors
/// If the file does not exist.
pub async fn open(file: &Path) -> sqlx::Result<SqliteConnection> {
    let options = SqliteConnectOptions::new().filename(file);
    options.busy_timeout(Duration::from_secs(10)).connect().await
}

/// Applies `talk` to a connection to a file, and then closes the connection.
///
/// # Errors
/// If the file does not exist, or `talk` fails.
pub async fn with<T>(
    file: &Path,
    talk: impl AsyncFnOnce(&mut SqliteConnection) -> sqlx::Result<T>,
) -> sqlx::Result<T> {
    let mut db = open(file).await?;
    let found = talk(&mut db).await;
    db.close().await?;
    found
}

/// The values of all columns of a row.
///
/// # Errors
/// If SQLite does not return a value.
pub fn cells(row: &SqliteRow) -> sqlx::Result<Vec<Cell>> {
    (0..row.len()).map(|at| cell(row, at)).collect()
}

fn cell(row: &SqliteRow, at: usize) -> sqlx::Result<Cell> {
    let value = row.try_get_raw(at)?;
    if value.is_null() {
        return Ok(Cell::Null);
    }
    // The type of the value itself, which can differ from the declared type of the column.
    Ok(match value.type_info().name() {
        "INTEGER" => Cell::Integer(row.try_get(at)?),
        "REAL" => Cell::Real(row.try_get(at)?),
        "TEXT" => Cell::Text(String::from_utf8_lossy(row.try_get_unchecked(at)?).into_owned()),
        _ => Cell::Bytes(row.try_get(at)?),
    })
}
