//! Who is left out, and where in the trials it shows.

use crate::formats::csv_lines::LineError;
use crate::formats::trials_csv::Fault;
use serde::Serialize;
use sidestep::comparison::Exclusion;
use std::fmt;

/// Somebody who is left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Excluded {
    /// As the data call them.
    pub participant: String,
    /// Why.
    pub reason: String,
    /// The line that is wrong, where it is one of a file of trials.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// The line of their first row, where all of them together are the reason. It depends on the
    /// order of the rows, which changes nothing in the files of an analysis: only messages tell it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_line: Option<u64>,
}

impl Excluded {
    /// For a reason that is in no line.
    #[must_use]
    pub fn new(participant: &str, reason: String) -> Self {
        Self { participant: participant.to_owned(), reason, line: None, first_line: None }
    }

    /// As the report tells it: the line that is wrong, and why.
    #[must_use]
    pub fn why(&self) -> String {
        match self.line {
            Some(line) => format!("line {line}: {}", self.reason),
            None => self.reason.clone(),
        }
    }
}

/// A row or a trial of theirs is wrong.
impl From<Fault> for Excluded {
    fn from(Fault { participant, error: LineError { line, what } }: Fault) -> Self {
        // Rows of a database are in no line.
        Self { line: (line > 0).then_some(line), ..Self::new(&participant, what.to_string()) }
    }
}

impl From<Exclusion> for Excluded {
    fn from(Exclusion { participant, reason }: Exclusion) -> Self {
        Self::new(&participant, reason)
    }
}

/// As the HTTP interface tells it.
impl From<&Excluded> for Exclusion {
    fn from(excluded: &Excluded) -> Self {
        Self { participant: excluded.participant.clone(), reason: excluded.why() }
    }
}

impl fmt::Display for Excluded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Names may hold what a terminal would obey.
        write!(f, "participant {}: {}", self.participant.escape_debug(), self.why())?;
        self.first_line.map_or(Ok(()), |line| write!(f, " (their rows begin in line {line})"))
    }
}
