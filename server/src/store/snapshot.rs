//! A new SQLite file for an export. The caller names its tables and columns.

use super::StoreError;
use super::sql::{self, Connection, ToSql};
use super::sqlite;
use crate::private;
use sqlx::ConnectOptions;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use std::path::Path;

/// Rows that are inserted with one statement.
const ROWS: usize = 64;

/// A SQLite file that is being filled. It is not safe against a crash until it is finished.
#[derive(Debug)]
pub struct Snapshot {
    db: Connection,
}

/// What the values of a column are.
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
    /// A whole number.
    Whole(i64),
    /// A number.
    Number(f64),
    /// A text.
    Text(&'a str),
}

impl sql::ToSql for Value<'_> {
    fn value(&self) -> sql::Value<'_> {
        match *self {
            // No type: SQLite needs none.
            Self::Null => sql::Value::Null(sql::Kind::Text),
            Self::Whole(number) => sql::Value::Integer(number),
            Self::Number(number) => sql::Value::Real(number),
            Self::Text(text) => sql::Value::Text(text.into()),
        }
    }
}

impl Snapshot {
    /// Creates the file, which must not be there. Only this user can read it.
    ///
    /// # Errors
    /// [`StoreError`] if the disk refuses it.
    pub fn create(path: &Path) -> Result<Self, StoreError> {
        // SQLite would fill a file that is there.
        private::new_file(path).map_err(|error| StoreError::Unavailable(error.to_string()))?;
        let options = SqliteConnectOptions::new()
            .filename(path)
            // A half file is thrown away, so nothing has to survive a crash.
            .journal_mode(SqliteJournalMode::Off)
            .synchronous(SqliteSynchronous::Off)
            .pragma("cache_size", "-8000")
            .disable_statement_logging();
        let db = sqlite::open(&options)?;
        db.batch("BEGIN")?;
        Ok(Self { db })
    }

    /// Creates a table. Rows are to be added in the order of its key.
    ///
    /// # Errors
    /// [`StoreError`] if the disk refuses it.
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
    /// [`StoreError`] if the disk refuses them, or two have the same key.
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

    /// Ends the file.
    ///
    /// # Errors
    /// [`StoreError`] if the disk refuses it.
    pub fn finish(self) -> Result<(), StoreError> {
        Ok(self.db.batch("COMMIT")?)
    }
}

/// A name in SQL.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}
