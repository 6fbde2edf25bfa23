//! A SQLite or PostgreSQL database under test: its address for the server, and its rows for the
//! test.

use crate::sqlite::{self, Cell, cells};
use futures_util::TryStreamExt;
use sqlx::AssertSqlSafe;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Separators after a column and after a row in the output of `psql`.
const UNIT: char = '\u{1f}';
const RECORD: u8 = 0x1e;

/// A database under test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Database {
    /// An SQLite file.
    Sqlite(PathBuf),
    /// A PostgreSQL database, given by its address.
    Postgres(String),
}

impl Database {
    /// The file `name` in a folder.
    #[must_use]
    pub fn file(folder: &Path, name: &str) -> Self {
        Self::Sqlite(folder.join(name))
    }

    /// The address for `--database`.
    #[must_use]
    pub fn url(&self) -> String {
        match self {
            Self::Sqlite(file) => format!("sqlite:{}", file.display()),
            Self::Postgres(url) => url.clone(),
        }
    }

    /// Calls `row` with each row of a query. Both kinds of database give the same texts: numbers in
    /// the shortest decimal form, bytes in hexadecimal, and an empty text for NULL.
    ///
    /// # Panics
    /// If the query fails.
    pub async fn each_row(&self, query: &str, row: impl FnMut(&[&str])) {
        match self {
            Self::Sqlite(file) => rows_of_sqlite(file, query, row).await.expect(query),
            Self::Postgres(url) => psql(url, query, row),
        }
    }

    /// The single integer that a query returns.
    ///
    /// # Panics
    /// If it returns anything else.
    #[must_use]
    pub async fn number(&self, query: &str) -> i64 {
        let mut found = Vec::new();
        self.each_row(query, |row| found.push(row[0].parse().expect("a whole number"))).await;
        let [number] = found[..] else {
            panic!("expected one row, found {}: {query}", found.len())
        };
        number
    }

    /// Changes rows directly, bypassing the server.
    ///
    /// # Panics
    /// If a statement fails.
    pub async fn change(&self, statements: &str) {
        match self {
            Self::Sqlite(file) => {
                let change = sqlx::raw_sql(AssertSqlSafe(statements));
                sqlite::with(file, async |db| change.execute(db).await).await.expect(statements);
            }
            Self::Postgres(url) => psql(url, statements, |_| ()),
        }
    }
}

async fn rows_of_sqlite(
    file: &Path,
    query: &str,
    mut row: impl FnMut(&[&str]),
) -> sqlx::Result<()> {
    let read = async |db: &mut _| {
        let mut found = sqlx::query(AssertSqlSafe(query)).fetch(db);
        while let Some(values) = found.try_next().await? {
            let texts: Vec<String> = cells(&values)?.into_iter().map(text).collect();
            row(&texts.iter().map(String::as_str).collect::<Vec<_>>());
        }
        Ok(())
    };
    sqlite::with(file, read).await
}

fn text(cell: Cell) -> String {
    match cell {
        Cell::Null => String::new(),
        Cell::Integer(number) => number.to_string(),
        Cell::Real(number) => number.to_string(),
        Cell::Text(text) => text,
        Cell::Bytes(bytes) => hex::encode(bytes),
    }
}

/// Calls `row` with each row that the statements return. Runs `psql`, which is installed with
/// PostgreSQL.
pub(crate) fn psql(url: &str, query: &str, mut row: impl FnMut(&[&str])) {
    let mut psql = Command::new("psql")
        .args(["--no-psqlrc", "--quiet", "--no-align", "--tuples-only"])
        .args(["--set=ON_ERROR_STOP=1", "--field-separator", &UNIT.to_string()])
        .args(["--record-separator", &char::from(RECORD).to_string()])
        .args(["--dbname", url, "--command", query])
        .stdout(Stdio::piped())
        .spawn()
        .expect("psql");
    let out = BufReader::new(psql.stdout.take().expect("its output"));
    for record in out.split(RECORD) {
        let record = String::from_utf8(record.expect("its output")).expect("UTF-8");
        // A newline follows the last record.
        let record = record.trim_end_matches('\n');
        if !record.is_empty() {
            let values: Vec<&str> = record
                .split(UNIT)
                .map(|value| value.strip_prefix("\\x").unwrap_or(value))
                .collect();
            row(&values);
        }
    }
    assert!(psql.wait().is_ok_and(|status| status.success()), "{query}");
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Must match the corresponding test for PostgreSQL, `tests/faults/postgres.rs`.
    #[tokio::test]
    async fn values_of_a_file_are_texts() {
        let folder = tempfile::tempdir().unwrap();
        let database = Database::file(folder.path(), "kept.db");
        std::fs::write(folder.path().join("kept.db"), "").unwrap();
        let change = "CREATE TABLE kept (id INTEGER, name TEXT, bytes BLOB, x REAL); \
                      INSERT INTO kept VALUES (7, 'a b', X'00ff', 1760000000123.25), \
                      (8, NULL, NULL, -0.5), (9, CAST(X'61ff' AS TEXT), X'', 2)";
        database.change(change).await;
        let mut rows = Vec::new();
        let query = "SELECT id, name, bytes, x FROM kept ORDER BY id";
        database.each_row(query, |row| rows.push(row.join("|"))).await;
        assert_eq!(rows, ["7|a b|00ff|1760000000123.25", "8|||-0.5", "9|a\u{fffd}||2"]);
        assert_eq!(database.number("SELECT count(*) FROM kept").await, 3);
        // The connection is closed, so SQLite has left no other file.
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
