//! The only place that speaks SQL: opening a database, and one module an aggregate.
//!
//! Reads and writes go through separate pools. SQLite has one writer at a time
//! anyway; a single writing connection queues writers here, fairly, instead of
//! letting them fail with "database is locked". A transaction takes the write
//! lock when it begins, so what it reads cannot change before it commits.

pub mod admin;
pub mod analyses;
pub mod octets;
pub mod participants;
pub mod scenes;
pub mod studies;
pub mod trials;
pub mod value_functions;

use sqlx::migrate::{MigrateError, Migrator};
use sqlx::pool::PoolConnection;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Sqlite, SqlitePool, Transaction};
use std::str::FromStr;
use std::time::Duration;

/// One connection, or a transaction on it.
pub type Db = sqlx::SqliteConnection;

static MIGRATIONS: Migrator = sqlx::migrate!("../migrations/sqlite");

/// A database that is open and up to date.
#[derive(Clone, Debug)]
pub struct Store {
    write: SqlitePool,
    read: SqlitePool,
}

/// What to do where there is no database yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Missing {
    /// Make an empty one.
    Create,
    /// Complain.
    Refuse,
}

/// Why a database cannot be used. One line, naming the database.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The address is not one of a database that this build knows.
    #[error("--database {url}: expected sqlite:FILE, found {found}")]
    Address {
        /// As given.
        url: String,
        /// What is wrong with it.
        found: String,
    },
    /// It cannot be opened or made.
    #[error("{file}: cannot open the database: {reason}; check the path and that it is writable")]
    Unusable {
        /// The file.
        file: String,
        /// What the system said.
        reason: String,
    },
    /// It is a database, but not of this version.
    #[error("{file}: cannot bring the database up to date: {reason}")]
    Version {
        /// The file.
        file: String,
        /// What does not fit.
        reason: MigrateError,
    },
}

impl Store {
    /// Opens the database at `url` (`sqlite:FILE`) and applies what migrations it lacks.
    ///
    /// # Errors
    /// [`OpenError`], in one line.
    pub async fn open(url: &str, missing: Missing) -> Result<Self, OpenError> {
        let options = options(url)?.create_if_missing(missing == Missing::Create);
        let file = options.get_filename().display().to_string();
        let unusable =
            |error: sqlx::Error| OpenError::Unusable { file: file.clone(), reason: reason(&error) };
        let write = SqlitePoolOptions::new()
            .max_connections(1)
            .acquire_timeout(Duration::from_secs(20))
            .connect_with(options.clone())
            .await
            .map_err(unusable)?;
        MIGRATIONS.run(&write).await.map_err(|reason| {
            let file = file.clone();
            OpenError::Version { file, reason }
        })?;
        // A connection that never writes cannot be made to by a slip in a query.
        let read = SqlitePoolOptions::new()
            .max_connections(4)
            .acquire_timeout(Duration::from_secs(20))
            .connect_with(options.pragma("query_only", "ON"))
            .await
            .map_err(unusable)?;
        Ok(Self { write, read })
    }

    /// A connection that only reads.
    ///
    /// # Errors
    /// If none becomes free or can be opened.
    pub async fn reader(&self) -> Result<PoolConnection<Sqlite>, sqlx::Error> {
        self.read.acquire().await
    }

    /// A transaction that holds the write lock. Dropped without a commit, it never was.
    ///
    /// # Errors
    /// If the lock or the connection cannot be had.
    pub async fn write(&self) -> Result<Transaction<'static, Sqlite>, sqlx::Error> {
        self.write.begin_with("BEGIN IMMEDIATE").await
    }

    /// Whether the database answers.
    ///
    /// # Errors
    /// If it does not.
    pub async fn ping(&self) -> Result<(), sqlx::Error> {
        sqlx::query("SELECT 1 FROM study LIMIT 1").fetch_optional(&self.read).await.map(drop)
    }

    /// Takes deleted content out of the write-ahead log too. Deleted rows are
    /// overwritten in the database itself (`secure_delete`).
    ///
    /// # Errors
    /// If the log cannot be written back.
    pub async fn forget(&self) -> Result<(), sqlx::Error> {
        sqlx::query("PRAGMA wal_checkpoint(TRUNCATE)").execute(&self.write).await.map(drop)
    }

    /// What SQLite itself finds wrong with the file: damaged pages and references
    /// to nothing. Empty for a sound database.
    ///
    /// # Errors
    /// If the check cannot be run.
    pub async fn damage(&self) -> Result<Vec<String>, sqlx::Error> {
        let found: Vec<String> =
            sqlx::query_scalar("PRAGMA integrity_check").fetch_all(&self.read).await?;
        let dangling: Vec<(String, Option<i64>, String, i64)> =
            sqlx::query_as("PRAGMA foreign_key_check").fetch_all(&self.read).await?;
        let dangling = dangling.into_iter().map(|(table, row, parent, _)| {
            format!("{table}: row {} refers to nothing in {parent}", row.unwrap_or(-1))
        });
        let found = found.into_iter().filter(|line| line != "ok");
        Ok(found.chain(dangling).collect())
    }

    /// Waits for what is under way, writes the log back and closes.
    pub async fn close(&self) {
        self.read.close().await;
        self.write.close().await;
    }
}

fn options(url: &str) -> Result<SqliteConnectOptions, OpenError> {
    let complain =
        |found: &str| OpenError::Address { url: url.to_owned(), found: found.to_owned() };
    if url.starts_with("postgres:") || url.starts_with("postgresql:") {
        return Err(OpenError::Address {
            // Such an address may hold a password: it is not repeated.
            url: "postgres:…".to_owned(),
            found: "a PostgreSQL address, and this build speaks SQLite only".to_owned(),
        });
    }
    let Some(file) = url.strip_prefix("sqlite:") else {
        return Err(complain("another kind of address"));
    };
    if file.is_empty() || file.contains(":memory:") || file.contains("mode=memory") {
        return Err(complain("no file; results must survive a restart"));
    }
    let options = SqliteConnectOptions::from_str(url).map_err(|e| complain(&reason(&e)))?;
    Ok(options
        .journal_mode(SqliteJournalMode::Wal)
        // An acknowledged trial survives a power cut, not only a crash.
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(Duration::from_secs(10))
        .pragma("secure_delete", "ON"))
}

/// What the database said, in one line.
fn reason(error: &sqlx::Error) -> String {
    let text = match error {
        sqlx::Error::Database(database) => database.message().to_owned(),
        other => other.to_string(),
    };
    text.replace('\n', " ")
}

/// Wraps what is wrong with a stored value as an error of its query.
fn undecodable(error: impl std::error::Error + Send + Sync + 'static) -> sqlx::Error {
    sqlx::Error::Decode(Box::new(error))
}

/// As [`undecodable`], for a word that is not in its table.
fn unknown_word(word: &str) -> sqlx::Error {
    sqlx::Error::Decode(format!("unknown word {word:?}").into())
}
