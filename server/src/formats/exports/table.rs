//! The tables of an export.

use super::person::Person;
use super::{ExportError, Filter};
use crate::formats::table::{Batch, Column};
use crate::formats::tables::{Driven, key_events, steps, trials};
use crate::store::StoreError;

/// A table of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Table {
    Steps,
    Trials,
    KeyEvents,
    Participants,
}

impl Table {
    /// The tables made from trials.
    pub(super) const DRIVEN: [Self; 3] = [Self::Steps, Self::Trials, Self::KeyEvents];

    /// The name of the table.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Steps => "steps",
            Self::Trials => "trials",
            Self::KeyEvents => "key_events",
            Self::Participants => "participants",
        }
    }

    /// The meaning of a row.
    pub(super) fn meaning(self) -> &'static str {
        match self {
            Self::Steps => "A row for each step: the state before it and the input held in it.",
            Self::Trials => "A row for each trial: its scene, its outcome and its record.",
            Self::KeyEvents => "A row for each key that went down or up while a scene was driven.",
            Self::Participants => "A row for each participant: when they did what, and answers.",
        }
    }

    /// The columns that identify a row.
    pub(super) fn key(self) -> &'static [&'static str] {
        match self {
            Self::Steps => &["participant", "trial", "step"],
            Self::Trials => &["participant", "trial"],
            Self::KeyEvents => &["participant", "trial", "event"],
            Self::Participants => &["participant"],
        }
    }

    /// The columns of a table made from trials.
    pub(super) fn columns(self) -> Vec<Column> {
        match self {
            Self::Steps => steps::columns(),
            Self::Trials => trials::columns(),
            Self::KeyEvents => key_events::columns(),
            Self::Participants => Vec::new(),
        }
    }

    /// Adds the rows of a participant's trials that the filter keeps.
    pub(super) fn add(
        self,
        batch: &mut Batch,
        person: &Person,
        filter: &Filter,
    ) -> Result<(), ExportError> {
        for driven in person.driven().filter(|driven| filter.keeps(driven)) {
            match self {
                Self::Steps => steps::add(batch, &driven),
                Self::Trials => trials::add(batch, &driven),
                Self::KeyEvents => events(batch, &driven)?,
                Self::Participants => {}
            }
        }
        Ok(())
    }
}

/// Adds key events. For a damaged trial, adds them only if they can be read.
fn events(batch: &mut Batch, driven: &Driven<'_>) -> Result<(), ExportError> {
    match key_events::add(batch, driven) {
        Err(error) if driven.damage.is_none() => {
            let id = &driven.trial.head.trial_id;
            Err(StoreError::Corrupt(format!("trial {id}: key events: {error}")).into())
        }
        _ => Ok(()),
    }
}
