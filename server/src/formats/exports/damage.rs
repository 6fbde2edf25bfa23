//! The damage in the data of an export.

use serde::Serialize;
use std::fmt;

/// A damaged trial, whose data do not reproduce the stored results.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Damaged {
    /// The participant's number.
    pub participant: i64,
    /// The trial, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trial_id: Option<String>,
    /// Number of trials affected.
    pub trials: u64,
    /// The fault.
    pub what: String,
    /// Whether the trial can be read. A trial that cannot be read is not in any table.
    #[serde(rename = "readable")]
    pub is_readable: bool,
}

impl fmt::Display for Damaged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { participant, trial_id, trials: _, what, is_readable } = self;
        match trial_id {
            Some(trial_id) => write!(f, "participant {participant}, trial {trial_id}: {what}")?,
            None => write!(f, "participant {participant}: {what}")?,
        }
        f.write_str(if *is_readable { "" } else { "; left out" })
    }
}

/// All damage.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Damage {
    /// Number of trials affected.
    #[serde(rename = "damaged_trials")]
    pub count: u64,
    /// The first damaged trials.
    #[serde(rename = "damage", skip_serializing_if = "Vec::is_empty")]
    pub first: Vec<Damaged>,
    /// Faults that the database system finds in its file, and stored counts that do not match the
    /// trials. Because of such a fault, rows might be missing or belong to another participant.
    #[serde(rename = "database_damage", skip_serializing_if = "Vec::is_empty")]
    pub database: Vec<String>,
}

impl Damage {
    /// Upper bound on the number of trials listed in `first`, so that memory does not grow with the
    /// study. The tables mark all damaged trials.
    const MOST: usize = 10_000;

    pub(super) fn add(&mut self, damaged: Damaged) {
        self.count += damaged.trials;
        if self.first.len() < Self::MOST {
            self.first.push(damaged);
        }
    }
}
