//! The tables of an export: their columns, and the conversion of database rows to table rows.

pub mod steps;
pub mod trials;
pub mod key_events;
pub mod participants;

use super::table::Column;
use crate::store::trials::StoredTrial;
use sidestep::scene::SceneParameters;
use sidestep::trial::Flag;

/// A trial of a participant, with everything that is needed for its rows.
#[derive(Clone, Copy, Debug)]
pub struct Driven<'a> {
    /// Number of the trial among all trials of the participant, over all phases, from 0.
    pub number: usize,
    /// The trial.
    pub trial: &'a StoredTrial,
    /// The parameters in the configuration under which the participant enrolled.
    pub parameters: &'a SceneParameters,
    /// The fault of the trial, if it is damaged.
    pub damage: Option<&'a str>,
}

/// The column with the participant's number. Together with [`trial_column`], it identifies a trial
/// in several tables.
fn participant_column() -> Column {
    Column::new("participant", super::table::Kind::Whole, "as in the table of participants")
}

fn trial_column() -> Column {
    let meaning = "number of the trial among all of the participant, from 0";
    Column::new("trial", super::table::Kind::Whole, meaning)
}

/// The column that states whether a trial is damaged.
fn damaged_column() -> Column {
    let meaning = "1 if the trial differs from what was stored, so do not use it; else 0";
    Column::new("damaged", super::table::Kind::Whole, meaning).range("0, 1")
}

/// The column of a trial's flags.
fn flags_column() -> Column {
    let meaning = "evidence that an analyst should know, words joined by semicolons";
    let words = Flag::ALL.map(Flag::word).join(", ");
    Column::new("flags", super::table::Kind::Word, meaning).range(words)
}
