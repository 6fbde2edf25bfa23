//! The purposes of opening a database, and the reasons why it cannot be used.

use super::misfit::Misfit;
use std::path::PathBuf;

/// The purpose of opening a database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Serve or fill the database, exclusively. The database is created if it is missing. No other
    /// server may use the file until it is closed, because each server would wait for the other's
    /// writes and miss its changes. Commands may read and write at the same time. Several servers can
    /// share a PostgreSQL database.
    Alone,
    /// Copy another database into this one, exclusively like [`Self::Alone`]. If this database was
    /// empty, all other purposes are refused until [`end_copy`](super::Store::end_copy).
    Copy,
    /// Add data. The database is created if it is missing.
    Create,
    /// Change existing data.
    Change,
    /// Read without changing the database. If the file has an older version, a migrated copy of it is
    /// read.
    Read,
}

/// The reason why a database cannot be used. The message is one line that names the database.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The address does not name a database that this build supports.
    #[error(
        "--database {url}: expected sqlite:FILE or postgres://USER@HOST/DATABASE, found {found}"
    )]
    Address {
        /// The given address.
        url: String,
        /// The error in the address.
        found: String,
    },
    /// The database cannot be opened or created.
    #[error("{database}: cannot open the database: {reason}")]
    Unusable {
        /// The file, or the address without a password.
        database: String,
        /// The error of the system.
        reason: String,
    },
    /// The database is missing, and this purpose does not create it.
    #[error("{0}: cannot open the database: it does not exist, or it is empty")]
    Absent(String),
    /// The database is missing, but its write-ahead log exists and would be lost at the first write.
    #[error(
        "{database}: cannot open the database: it does not exist, or it is empty, but its write-ahead log {} exists \
         and may have data that are stored nowhere else; put its database back beside it, or move it to another folder",
        log.display()
    )]
    LogAlone {
        /// The file.
        database: String,
        /// The log.
        log: PathBuf,
    },
    /// The write-ahead log beside the file belongs to another database. SQLite would apply the log
    /// anyway.
    #[error(
        "{database}: cannot open the database: the write-ahead log beside it, {}, is not its own: {why}. Nothing was \
         changed. The log has the latest data of its database: put that database back beside it. Only if that is \
         permanently lost, move the log to another folder, and keep it",
        log.display()
    )]
    Misplaced {
        /// The file.
        database: String,
        /// The log.
        log: PathBuf,
        /// The reason why the log does not belong to the database.
        why: Misplaced,
    },
    /// The write-ahead log is damaged. SQLite would drop everything after the damaged part.
    #[error(
        "{database}: cannot open the database: the write-ahead log beside it, {}, is damaged: a part of it was overwritten, \
         and SQLite would drop everything stored after that part. Nothing was changed. Keep both files, and save the \
         readable data with 'sidestep salvage --from {database} --database sqlite:NEW'",
        log.display()
    )]
    DamagedLog {
        /// The file.
        database: String,
        /// The log.
        log: PathBuf,
    },
    /// The database is of another version and cannot be migrated.
    #[error("{database}: cannot use the database: {reason}")]
    Version {
        /// The file, or the address without a password.
        database: String,
        /// The reason.
        reason: Misfit,
    },
    /// Another server uses the database.
    #[error(
        "{0}: another 'sidestep serve' uses this database; stop it first or give this one its own \
         file"
    )]
    Served(String),
}

impl OpenError {
    /// The same error, with the database's name as the user gave it.
    #[must_use]
    pub fn named(self, name: String) -> Self {
        let log = PathBuf::from(format!("{name}-wal"));
        match self {
            Self::Address { .. } => self,
            Self::Unusable { reason, .. } => Self::Unusable { database: name, reason },
            Self::Absent(_) => Self::Absent(name),
            Self::LogAlone { .. } => Self::LogAlone { database: name, log },
            Self::DamagedLog { .. } => Self::DamagedLog { database: name, log },
            Self::Misplaced { why, .. } => Self::Misplaced { database: name, log, why },
            Self::Version { reason, .. } => Self::Version { database: name, reason },
            Self::Served(_) => Self::Served(name),
        }
    }
}

/// A mismatch between a file and the log beside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Misplaced {
    /// The log belongs to another database.
    #[error("it belongs to another database")]
    Other,
    /// The log belongs to a copy of this database that has diverged.
    #[error(
        "it belongs to another copy of this database: both went on from the same state, each by itself"
    )]
    Fork,
    /// The file is older than the beginning of the log.
    #[error(
        "it continues a later state of this database than this file has; the file is an older copy"
    )]
    Later,
    /// The file has more commits than the log.
    #[error("it is older than this file, which has more commits")]
    Earlier,
    /// Another program has written another database into the file, through SQLite.
    #[error(
        "another program wrote another database over this one ('.restore' of sqlite3 does that); 'sidestep salvage' saves \
         what was there before"
    )]
    Replaced,
    /// The log has no mark.
    #[error(
        "no commit of Sidestep is in it; another program wrote it, or it belongs to another database"
    )]
    Unmarked,
    /// A part of the log or of its index was overwritten, and SQLite would lose transactions.
    #[error(
        "a part of it was overwritten, and SQLite would drop everything stored after that part"
    )]
    Damaged,
}
