//! A database under test, of whichever kind: its address for the server, and its rows for the test.

use rusqlite::Connection;
use rusqlite::types::ValueRef;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Between two columns, and after a row, in what `psql` prints.
const UNIT: char = '\u{1f}';
const RECORD: u8 = 0x1e;

/// A database under test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Database {
    /// A file of SQLite.
    Sqlite(PathBuf),
    /// A database of PostgreSQL, by its address.
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

    /// Calls `row` with each row that a query returns. Values are text in the same form for both
    /// kinds: numbers in the shortest decimal form, bytes in hexadecimal, NULL as an empty text.
    ///
    /// # Panics
    /// If the query fails.
    pub fn each_row(&self, query: &str, row: impl FnMut(&[&str])) {
        match self {
            Self::Sqlite(file) => rows_of_sqlite(file, query, row).expect(query),
            Self::Postgres(url) => rows_of_postgres(url, query, row),
        }
    }

    /// The one whole number that a query returns.
    ///
    /// # Panics
    /// If it returns anything else.
    #[must_use]
    pub fn number(&self, query: &str) -> i64 {
        let mut found = Vec::new();
        self.each_row(query, |row| found.push(row[0].parse().expect("a whole number")));
        let [number] = found[..] else {
            panic!("expected one row, found {}: {query}", found.len())
        };
        number
    }

    /// Changes rows behind the server's back.
    ///
    /// # Panics
    /// If a statement fails.
    pub fn change(&self, statements: &str) {
        match self {
            Self::Sqlite(file) => opened(file).execute_batch(statements).expect(statements),
            Self::Postgres(url) => rows_of_postgres(url, statements, |_| ()),
        }
    }
}

fn opened(file: &Path) -> Connection {
    let db = Connection::open(file).expect("a database");
    db.busy_timeout(Duration::from_secs(10)).expect("a timeout");
    db
}

fn rows_of_sqlite(file: &Path, query: &str, mut row: impl FnMut(&[&str])) -> rusqlite::Result<()> {
    let db = opened(file);
    let mut statement = db.prepare(query)?;
    let count = statement.column_count();
    let mut found = statement.query([])?;
    while let Some(values) = found.next()? {
        let texts: Vec<String> = (0..count)
            .map(|i| {
                Ok(match values.get_ref(i)? {
                    ValueRef::Null => String::new(),
                    ValueRef::Integer(number) => number.to_string(),
                    ValueRef::Real(number) => number.to_string(),
                    ValueRef::Text(text) => String::from_utf8_lossy(text).into_owned(),
                    ValueRef::Blob(bytes) => hex::encode(bytes),
                })
            })
            .collect::<rusqlite::Result<_>>()?;
        row(&texts.iter().map(String::as_str).collect::<Vec<_>>());
    }
    Ok(())
}

/// Through `psql`, which comes with the server.
fn rows_of_postgres(url: &str, query: &str, mut row: impl FnMut(&[&str])) {
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
        // The last one ends with the line.
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
