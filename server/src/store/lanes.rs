//! Priorities of writes, and the locks that they need.

use sha2::{Digest, Sha256};

/// The kind of caller that waits for an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lane {
    /// A participant's browser that uploads a trial.
    Trial,
    /// A participant who enrols.
    Enrolment,
    /// Any other request.
    Request,
    /// A background job.
    Background,
}

/// Data that an operation reads and depends on. No other operation may change the data until this
/// operation ends.
///
/// SQLite has one writer, which runs one operation at a time, so it needs no locks. PostgreSQL has
/// many writers on many servers. In PostgreSQL, an operation takes its locks before its first
/// statement, in the order of this list, and its commit releases them. An operation with a single
/// statement needs no locks.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Lock {
    /// The list of studies, and their configurations.
    Studies,
    /// The keys of experimenters.
    Keys,
    /// The participants of a study: their numbers and places.
    Study(i64),
    /// The analyses, and the participants whose data they use.
    Analyses,
    /// A participant's rows, by the participant's id.
    Participant(String),
}

impl Lock {
    /// The two keys of PostgreSQL's advisory lock. If two participants have the same keys, operations
    /// on one participant wait for operations on the other.
    pub(super) fn numbers(&self) -> [i32; 2] {
        match self {
            Self::Studies => [1, 0],
            Self::Keys => [2, 0],
            Self::Study(id) => [3, hashed(&id.to_le_bytes())],
            Self::Analyses => [4, 0],
            Self::Participant(id) => [5, hashed(id.as_bytes())],
        }
    }
}

fn hashed(bytes: &[u8]) -> i32 {
    let hash = Sha256::digest(bytes);
    i32::from_le_bytes([hash[0], hash[1], hash[2], hash[3]])
}
