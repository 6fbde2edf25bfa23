//! Why a database does not fit this version of the program.

/// Why a database cannot be migrated. Each message is a sentence about the database.
#[derive(Debug, thiserror::Error)]
pub enum Misfit {
    /// It was migrated by a newer version of the program.
    #[error(
        "a newer version of Sidestep made it (it has migration {found}, this version knows 1 to \
         {known}); update Sidestep"
    )]
    Newer {
        /// The highest number in the database.
        found: i64,
        /// The highest number that this program knows.
        known: i64,
    },
    /// Created by an older version; opened read-only.
    #[error(
        "an older version of Sidestep made it (its last migration is {found}, that of this version is {known}), and \
         reading changes nothing; stop its servers and start 'sidestep serve' of this version, which migrates it"
    )]
    Older {
        /// The highest number in the database.
        found: i64,
        /// The highest number that this program knows.
        known: i64,
    },
    /// It has a migration of another build with the same number as one of this build.
    #[error(
        "its migration {0} is not the one of this version; it comes from another build: use that one, or a \
             release of Sidestep"
    )]
    Other(i64),
    /// A copy into it began while it was empty, and did not end.
    #[error(
        "it is incomplete: a copy into it was not finished; run 'sidestep copy' again, or delete it"
    )]
    Unfinished,
    /// It contains tables of another program.
    #[error("it is a database of another program")]
    Foreign,
    /// A statement of a migration failed.
    #[error("migration {version} failed and nothing was changed: {reason}")]
    Failed {
        /// Its number.
        version: i64,
        /// The database's message.
        reason: String,
    },
}
