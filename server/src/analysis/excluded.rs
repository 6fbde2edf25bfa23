//! Who is left out, and where in the trials it shows.

use crate::trials_csv::{Fault, LineError, Person};
use serde::Serialize;
use sidestep::comparison::Exclusion;
use std::collections::HashMap;
use std::fmt;

/// Somebody who is left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Excluded {
    /// As the data call them.
    pub participant: String,
    /// Why.
    pub reason: String,
    /// Where in the file of trials: the line that is wrong, or that of their first row where all
    /// of them together are; nothing where the trials are right or are no file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
}

impl Excluded {
    /// Rows of theirs are wrong.
    #[must_use]
    pub fn by_trials(fault: Fault) -> Self {
        let Fault { participant, error: LineError { line, what } } = fault;
        Self { participant, reason: what.to_string(), line: Some(line) }
    }

    /// The file of features does not go with their trials.
    #[must_use]
    pub fn by_features(participant: &str, error: &LineError) -> Self {
        let reason = format!("features: {error}");
        Self { participant: participant.to_owned(), reason, line: None }
    }

    /// The comparison left them out, who are among the people of this file.
    #[must_use]
    pub fn by_comparison(exclusions: &[Exclusion], file: &[Person]) -> Vec<Self> {
        let lines: HashMap<&str, u64> =
            file.iter().map(|person| (person.name.as_str(), person.line)).collect();
        let one = |Exclusion { participant, reason }: &Exclusion| Self {
            participant: participant.clone(),
            reason: reason.clone(),
            line: lines.get(participant.as_str()).copied(),
        };
        exclusions.iter().map(one).collect()
    }
}

impl fmt::Display for Excluded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "participant {}: ", self.participant)?;
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        f.write_str(&self.reason)
    }
}

/// As the report tells it, whose lines are those that are wrong themselves: others depend on the
/// order of the rows, which changes nothing.
impl From<&Excluded> for Exclusion {
    fn from(excluded: &Excluded) -> Self {
        let Excluded { participant, reason, line } = excluded;
        let reason = match line {
            Some(line) => format!("line {line}: {reason}"),
            None => reason.clone(),
        };
        Self { participant: participant.clone(), reason }
    }
}
