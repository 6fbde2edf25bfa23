//! The reasons why a database does not fit this version of the program.

/// The reason why a database cannot be migrated. Each message is a sentence about the database.
#[derive(Debug, thiserror::Error)]
pub enum Misfit {
    /// A newer version of the program migrated the database.
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
    /// The last migration is from an older version, and the database is opened to read.
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
    /// The database has a migration of another build, with the same number as a migration of this build.
    #[error(
        "its migration {0} is not the one of this version; it comes from another build: use that one, or a \
             release of Sidestep"
    )]
    Other(i64),
    /// A copy into the empty database was begun and not finished.
    #[error(
        "it is incomplete: a copy into it was not finished; run 'sidestep copy' again, or delete it"
    )]
    Unfinished,
    /// The database contains tables of another program.
    #[error("it is a database of another program")]
    Foreign,
    /// A statement of a migration failed.
    #[error("migration {version} failed and nothing was changed: {reason}")]
    Failed {
        /// The number of the migration.
        version: i64,
        /// The database's message.
        reason: String,
    },
}
