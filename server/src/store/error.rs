//! Errors of the store, in the words of the domain.

use rusqlite::ErrorCode;
use std::error::Error;
use std::io;

/// Why an operation of the store failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// Too many writes are waiting.
    #[error("too many writes wait for the database")]
    Busy,
    /// Another process holds the write lock for too long.
    #[error("another process holds the database's write lock")]
    Locked,
    /// The disk is full.
    #[error("the disk is full")]
    Full,
    /// The file at the database's path is not the one that was opened.
    #[error("the database file was deleted, moved or replaced")]
    Gone,
    /// The file cannot be read or written, or the store was closed.
    #[error("the database cannot be used: {0}")]
    Unavailable(String),
    /// The file is damaged, or contains a value that this version cannot read.
    #[error("the database is damaged: {0}")]
    Corrupt(String),
    /// The key with which a change was asked for was revoked meanwhile.
    #[error("the key was revoked")]
    Revoked,
    /// A defect of this program.
    #[error("a database operation failed: {0}")]
    Defect(String),
}

impl StoreError {
    /// Whether the same request can succeed later without a change of the program or the file.
    #[must_use]
    pub fn is_temporary(&self) -> bool {
        !matches!(self, Self::Corrupt(_) | Self::Defect(_) | Self::Revoked)
    }

    /// Whether this error may have ended the transaction.
    pub(super) fn ends_transaction(&self) -> bool {
        matches!(self, Self::Full | Self::Gone | Self::Unavailable(_))
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

impl From<rusqlite::Error> for StoreError {
    fn from(error: rusqlite::Error) -> Self {
        use rusqlite::Error::{
            FromSqlConversionFailure, IntegralValueOutOfRange, InvalidColumnType, Utf8Error,
        };
        match error.sqlite_error_code() {
            Some(ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked) => Self::Locked,
            Some(ErrorCode::DiskFull) => Self::Full,
            Some(
                ErrorCode::SystemIoFailure
                | ErrorCode::CannotOpen
                | ErrorCode::ReadOnly
                | ErrorCode::PermissionDenied
                | ErrorCode::OutOfMemory
                | ErrorCode::FileLockingProtocolFailed
                | ErrorCode::OperationInterrupted,
            ) => Self::Unavailable(reason(&error)),
            Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase) => {
                Self::Corrupt(reason(&error))
            }
            _ => match error {
                FromSqlConversionFailure(..)
                | IntegralValueOutOfRange(..)
                | InvalidColumnType(..)
                | Utf8Error(..) => Self::corrupt(error),
                _ => Self::Defect(reason(&error)),
            },
        }
    }
}

impl From<tokio_postgres::Error> for StoreError {
    fn from(error: tokio_postgres::Error) -> Self {
        let Some(found) = error.as_db_error() else {
            let said = cause(&error);
            let is_network = error.source().is_some_and(|it| it.is::<io::Error>());
            if error.to_string().contains("deserializing") {
                return Self::corrupt(said);
            }
            let advice = ADVICE.iter().find(|(words, _)| said.contains(words)).map(|(_, it)| *it);
            let advice = advice.or(is_network.then_some(NO_SERVER)).filter(|_| !error.is_closed());
            return Self::Unavailable(match advice {
                Some(advice) => format!("{said}; {advice}"),
                None => said,
            });
        };
        // Never the detail of a message, which has values of rows.
        let message = found.message().replace('\n', " ");
        let advised = |advice: &str| Self::Unavailable(format!("{message}; {advice}"));
        match found.code().code() {
            // Serialization failures, deadlocks, and locks that were waited for too long; a reference to
            // a row that another transaction has just deleted.
            "40001" | "40P01" | "55P03" | "23503" => Self::Locked,
            "53100" => Self::Full,
            // A standby that takes no writes.
            "25006" => Self::Unavailable(message),
            "42501" => {
                advised("use the user who owns the database, or have that one GRANT this right")
            }
            "3D000" => advised("create it with 'createdb', or name another one in the address"),
            code if code.starts_with("28") => advised(
                "check the user and the password (in the address or in PGPASSWORD), and pg_hba.conf",
            ),
            // No resources, operator intervention, connection exceptions.
            code if ["53", "57", "58", "08"].iter().any(|class| code.starts_with(class)) => {
                Self::Unavailable(message)
            }
            "XX001" | "XX002" => Self::Corrupt(message),
            _ => Self::Defect(message),
        }
    }
}

/// What to do if there is no connection to PostgreSQL.
const NO_SERVER: &str = "check the host and the port, and that PostgreSQL runs there";

/// What to do if the client's error has certain words.
const ADVICE: [(&str, &str); 4] = [
    ("password missing", "give the password in PGPASSWORD or in the address"),
    ("allow writes", "it is a standby, or set to be read only; name the primary"),
    (
        "not support TLS",
        "switch TLS on in PostgreSQL (ssl = on), or add sslmode=disable if nobody can listen between",
    ),
    (
        "TLS",
        "check the certificate of the server (it must be one for servers, not one that signs others, and name its \
         host), and sslrootcert=FILE, or add sslmode=disable if nobody can listen between",
    ),
];

/// What an error of PostgreSQL's client says, with its cause, in one line.
fn cause(error: &tokio_postgres::Error) -> String {
    let source = error.source().map_or_else(String::new, |source| format!(": {source}"));
    format!("{error}{source}").replace('\n', " ")
}

/// SQLite's message, in one line.
pub(super) fn reason(error: &rusqlite::Error) -> String {
    let text = match error {
        rusqlite::Error::SqliteFailure(_, Some(message)) => message.clone(),
        other => other.to_string(),
    };
    text.replace('\n', " ")
}
