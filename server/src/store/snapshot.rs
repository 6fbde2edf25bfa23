//! A new SQLite file for an export. The caller defines its tables and columns.

use super::StoreError;
use super::sql::{self, Connection, ToSql};
use super::sqlite;
use crate::support::private;
use sqlx::ConnectOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use std::path::Path;

/// Rows per INSERT statement.
const ROWS: usize = 64;

/// A SQLite file that is being filled. Before it is finished, it does not survive a crash.
#[derive(Debug)]
pub struct Snapshot {
    db: Connection,
}

/// Type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// INTEGER.
    Whole,
    /// REAL.
    Number,
    /// TEXT.
    Text,
}

/// A value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value<'a> {
    /// NULL.
    Null,
    /// An integer.
    Whole(i64),
    /// A number.
    Number(f64),
    /// A text.
    Text(&'a str),
}

impl sql::ToSql for Value<'_> {
    fn value(&self) -> sql::Value<'_> {
        match *self {
            // The kind is irrelevant, because SQLite needs no type for NULL.
            Self::Null => sql::Value::Null(sql::Kind::Text),
            Self::Whole(number) => sql::Value::Integer(number),
            Self::Number(number) => sql::Value::Real(number),
            Self::Text(text) => sql::Value::Text(text.into()),
        }
    }
}

impl Snapshot {
    /// Creates the file, which must not exist. Only this user can read it.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be created.
    pub fn create(path: &Path) -> Result<Self, StoreError> {
        // Without this call, SQLite would open an existing file instead of refusing it.
        private::new_file(path).map_err(|error| StoreError::Unavailable(error.to_string()))?;
        let options = SqliteConnectOptions::new()
            .filename(path)
            // An incomplete file is deleted, so it need not survive a crash.
            .journal_mode(SqliteJournalMode::Off)
            .synchronous(SqliteSynchronous::Off)
            .pragma("cache_size", "-8000")
            .disable_statement_logging();
        let db = sqlite::open(&options)?;
        db.batch("BEGIN")?;
        Ok(Self { db })
    }

    /// Creates a table. Add rows in the order of its key.
    ///
    /// # Errors
    /// [`StoreError`] if the table cannot be written.
    pub fn table(
        &mut self,
        name: &str,
        columns: &[(&str, Type)],
        key: &[&str],
    ) -> Result<(), StoreError> {
        let mut fields = Vec::new();
        for (column, kind) in columns {
            let kind = match kind {
                Type::Whole => "INTEGER",
                Type::Number => "REAL",
                Type::Text => "TEXT",
            };
            fields.push(format!("{} {kind}", quoted(column)));
        }
        let key: Vec<_> = key.iter().map(|column| quoted(column)).collect();
        let (fields, key) = (fields.join(", "), key.join(", "));
        let name = quoted(name);
        let create = format!("CREATE TABLE {name} ({fields}, PRIMARY KEY ({key})) WITHOUT ROWID");
        Ok(self.db.batch(&create)?)
    }

    /// Adds rows to a table with this number of columns.
    ///
    /// # Errors
    /// [`StoreError`] if the rows cannot be written, or two rows have the same key.
    pub fn add<'a, R: Iterator<Item = Value<'a>>>(
        &mut self,
        table: &str,
        columns: usize,
        rows: impl Iterator<Item = R>,
    ) -> Result<(), StoreError> {
        let mut waiting: Vec<sql::Value<'static>> = Vec::new();
        for row in rows {
            waiting.extend(row.map(|value| value.value().into_owned()));
            if waiting.len() >= ROWS * columns {
                self.insert(table, columns, &waiting)?;
                waiting.clear();
            }
        }
        self.insert(table, columns, &waiting)
    }

    fn insert(
        &self,
        table: &str,
        columns: usize,
        values: &[sql::Value<'_>],
    ) -> Result<(), StoreError> {
        if values.is_empty() {
            return Ok(());
        }
        let row = format!("({})", vec!["?"; columns].join(", "));
        let rows = vec![row; values.len() / columns].join(", ");
        self.db.execute(&format!("INSERT INTO {} VALUES {rows}", quoted(table)), values)?;
        Ok(())
    }

    /// Finishes the file.
    ///
    /// # Errors
    /// [`StoreError`] if the file cannot be written.
    pub fn finish(self) -> Result<(), StoreError> {
        Ok(self.db.batch("COMMIT")?)
    }
}

/// A quoted SQL identifier.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}
