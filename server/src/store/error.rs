//! Errors of the store, in domain terms.

use sqlx::error::DatabaseError;
use sqlx::postgres::PgDatabaseError;
use std::io;

/// The reason why an operation of the store failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// Too many writes are waiting.
    #[error("too many writes wait for the database")]
    Busy,
    /// Another process has held the write lock for too long.
    #[error("another process holds the database's write lock")]
    Locked,
    /// The disk is full.
    #[error("the disk is full")]
    Full,
    /// The file at the database's path is not the one that was opened, or another process changed this
    /// file.
    #[error("the database file was {0}")]
    Gone(String),
    /// The database cannot be read or written, or the store was closed.
    #[error("the database cannot be used: {0}")]
    Unavailable(String),
    /// The database is damaged, or contains a value that this version cannot read.
    #[error("the database is damaged: {0}")]
    Corrupt(String),
    /// The caller's key was revoked during the request.
    #[error("the key was revoked")]
    Revoked,
    /// A defect of this program.
    #[error("a database operation failed: {0}")]
    Defect(String),
}

impl StoreError {
    /// Whether the same request can succeed later without a change to the program or the file.
    #[must_use]
    pub fn is_temporary(&self) -> bool {
        !matches!(self, Self::Corrupt(_) | Self::Defect(_) | Self::Revoked)
    }

    /// Whether this error may have ended the transaction.
    pub(super) fn ends_transaction(&self) -> bool {
        matches!(self, Self::Full | Self::Gone(_) | Self::Unavailable(_))
    }

    /// The error after the store was closed.
    pub(super) fn closed() -> Self {
        Self::Unavailable("it was closed".to_owned())
    }

    /// The error for an invalid stored value.
    pub(super) fn corrupt(what: impl std::fmt::Display) -> Self {
        Self::Corrupt(what.to_string())
    }

    /// The error for an unknown stored word.
    pub(super) fn unknown_word(word: &str) -> Self {
        Self::Corrupt(format!("unknown word {word:?}"))
    }
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        use sqlx::Error::{
            ColumnDecode, Database, Decode, Io, PoolClosed, PoolTimedOut, Protocol, Tls,
            WorkerCrashed,
        };
        match &error {
            Database(found) => match found.try_downcast_ref::<PgDatabaseError>() {
                Some(found) => of_postgres(found),
                None => of_sqlite(&**found),
            },
            ColumnDecode { .. } | Decode(_) => Self::corrupt(one_line(&error)),
            Io(_) | Tls(_) | Protocol(_) => Self::Unavailable(advised(&error)),
            PoolTimedOut => Self::Unavailable("no session became free in time".to_owned()),
            PoolClosed => Self::closed(),
            WorkerCrashed => Self::Unavailable("its connection has ended".to_owned()),
            _ => Self::Defect(one_line(&error)),
        }
    }
}

/// Meaning of SQLite's result codes: <https://www.sqlite.org/rescode.html>.
fn of_sqlite(error: &dyn DatabaseError) -> StoreError {
    let message = error.message().replace('\n', " ");
    // The lower eight bits are the primary code.
    match error.code().and_then(|code| code.parse::<i32>().ok()).map(|code| code & 0xff) {
        // BUSY, LOCKED.
        Some(5 | 6) => StoreError::Locked,
        // FULL.
        Some(13) => StoreError::Full,
        // READONLY, IOERR, CANTOPEN. They also occur if a file that SQLite keeps beside the
        // database is missing.
        Some(8 | 10 | 14) => StoreError::Unavailable(format!(
            "{message}: the disk fails, or this user may not write to the file or its folder, or -wal or -shm beside the file \
             was deleted or replaced"
        )),
        // PERM, NOMEM, INTERRUPT, PROTOCOL.
        Some(3 | 7 | 9 | 15) => StoreError::Unavailable(message),
        // CORRUPT, NOTADB.
        Some(11 | 26) => StoreError::Corrupt(message),
        _ => StoreError::Defect(message),
    }
}

/// Meaning of PostgreSQL's error codes: appendix A of its documentation.
fn of_postgres(error: &PgDatabaseError) -> StoreError {
    // The detail of the error is omitted, because it contains values of rows.
    let message = error.message().replace('\n', " ");
    let advised = |advice: &str| StoreError::Unavailable(format!("{message}; {advice}"));
    match error.code() {
        // Serialization failures, deadlocks, lock timeouts, and a reference to a row that another
        // transaction has just deleted.
        "40001" | "40P01" | "55P03" | "23503" => StoreError::Locked,
        "53100" => StoreError::Full,
        // A read-only standby.
        "25006" => StoreError::Unavailable(message),
        "42501" => {
            advised("connect as the owner of the database, or have the owner GRANT this right")
        }
        "3D000" => advised("create it with 'createdb', or name another one in the address"),
        code if code.starts_with("28") => advised(
            "check the user and the password (in the address or in PGPASSWORD), and pg_hba.conf",
        ),
        // Insufficient resources, operator intervention, connection exceptions.
        code if ["53", "57", "58", "08"].iter().any(|class| code.starts_with(class)) => {
            StoreError::Unavailable(message)
        }
        "XX001" | "XX002" => StoreError::Corrupt(message),
        _ => StoreError::Defect(message),
    }
}

/// Advice if no connection to PostgreSQL can be made.
const NO_SERVER: &str = "check the host and the port, and that PostgreSQL runs there";

/// Words in an error of the client library, each with advice to the user.
const ADVICE: [(&str, &str); 4] = [
    ("password missing", "give the password in PGPASSWORD or in the address"),
    ("allow writes", "it is a standby, or set to read-only; name the primary"),
    (
        "not support TLS",
        "switch TLS on in PostgreSQL (ssl = on), or add sslmode=disable if nobody can eavesdrop",
    ),
    (
        "TLS",
        "check the certificate of the server (it must be one for servers, not one that signs others, and name its \
         host), and sslrootcert=FILE, or add sslmode=disable if nobody can eavesdrop",
    ),
];

/// The error of a connection, with advice.
fn advised(error: &sqlx::Error) -> String {
    let said = one_line(error);
    let advice = ADVICE.iter().find(|(words, _)| said.contains(words)).map(|(_, it)| *it);
    let is_refused =
        matches!(error, sqlx::Error::Io(error) if error.kind() != io::ErrorKind::UnexpectedEof);
    match advice.or(is_refused.then_some(NO_SERVER)) {
        Some(advice) => format!("{said}; {advice}"),
        None => said,
    }
}

fn one_line(error: &sqlx::Error) -> String {
    error.to_string().replace('\n', " ")
}
