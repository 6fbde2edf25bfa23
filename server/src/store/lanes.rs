//! Who waits for a write, and what a write depends on.

use sha2::{Digest, Sha256};

/// Who waits for an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lane {
    /// A participant's browser that sends a trial.
    Trial,
    /// Somebody who enrols.
    Enrolment,
    /// Any other request.
    Request,
    /// A job in the background.
    Background,
}

/// What an operation reads and then depends on: nobody else may change it until the operation ends.
///
/// SQLite has one writer, which makes every operation alone, so it needs none of these. PostgreSQL has
/// many writers on many servers: an operation takes its locks before its first statement, in the order
/// of this list, and gives them back with its commit. An operation of a single statement needs none.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Lock {
    /// Which studies there are, and their configurations.
    Studies,
    /// The keys of experimenters.
    Keys,
    /// The participants of a study: their numbers and places.
    Study(i64),
    /// The analyses, and whose data they hold.
    Analyses,
    /// A participant's rows, by their id.
    Participant(String),
}

impl Lock {
    /// The two numbers of PostgreSQL's advisory lock. Two participants may have the same: one waits for
    /// the other then.
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
