//! A new SQLite file for an export. The caller names its tables and columns.

use super::StoreError;
use crate::private;
use rusqlite::types::{ToSqlOutput, ValueRef};
use rusqlite::{Connection, OpenFlags, ToSql, params_from_iter};
use std::path::Path;

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

impl ToSql for Value<'_> {
    fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
        Ok(ToSqlOutput::Borrowed(match *self {
            Self::Null => ValueRef::Null,
            Self::Whole(number) => ValueRef::Integer(number),
            Self::Number(number) => ValueRef::Real(number),
            Self::Text(text) => ValueRef::Text(text.as_bytes()),
        }))
    }
}

impl Snapshot {
    /// Creates the file, which must not be there. Only this user can read it.
    ///
    /// # Errors
    /// [`StoreError`] if the disk refuses it.
    pub fn create(path: &Path) -> Result<Self, StoreError> {
        let refused = |error: std::io::Error| StoreError::Unavailable(error.to_string());
        private::new_file(path).map_err(refused)?;
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let db = Connection::open_with_flags(path, flags)?;
        // A half file is thrown away, so nothing has to survive a crash.
        db.pragma_update(None, "journal_mode", "OFF")?;
        db.pragma_update(None, "synchronous", "OFF")?;
        db.pragma_update(None, "cache_size", -8_000)?;
        db.execute_batch("BEGIN")?;
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
        Ok(self.db.execute_batch(&create)?)
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
        let places = vec!["?"; columns].join(", ");
        let insert = format!("INSERT INTO {} VALUES ({places})", quoted(table));
        let mut insert = self.db.prepare_cached(&insert)?;
        for row in rows {
            insert.execute(params_from_iter(row))?;
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// [`StoreError`] if the disk refuses it.
    pub fn finish(self) -> Result<(), StoreError> {
        self.db.execute_batch("COMMIT")?;
        self.db.flush_prepared_statement_cache();
        self.db.close().map_err(|(_, error)| error.into())
    }
}

/// A name in SQL.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('"', "\"\""))
}
