//! A participant with all that they drove.

use super::damage::Damaged;
use crate::formats::tables::Driven;
use crate::soundness::{self, Examined, Wrong};
use crate::store::roster::RosterEntry;
use crate::store::{Store, StoreError};

/// All trials of a participant, in the plan's order, each replayed.
pub(super) struct Person {
    /// The participant's number.
    number: i64,
    trials: Vec<Result<Examined, Wrong>>,
    /// Why no trial can be read.
    unreadable: Option<String>,
    /// How many were stored that are not found: damage hides them.
    hidden: usize,
}

impl Person {
    /// Reads a participant and replays their trials.
    pub(super) async fn read(store: &Store, entry: &RosterEntry) -> Result<Self, StoreError> {
        let (trials, unreadable) = match soundness::examined(store, &entry.id).await {
            Ok(trials) => (trials, None),
            Err(StoreError::Corrupt(what)) => (Vec::new(), Some(what)),
            Err(error) => return Err(error),
        };
        let mut hidden = 0;
        let stored = entry.trials.iter().sum();
        if unreadable.is_none() && (trials.len() as i64) < stored {
            // Unless they were deleted since.
            let stored = stored.min(store.stored_trials(&entry.id).await?);
            hidden = usize::try_from(stored).unwrap_or(0).saturating_sub(trials.len());
        }
        Ok(Self { number: entry.number, trials, unreadable, hidden })
    }

    /// How many trials are stored, if that is known.
    pub(super) fn count(&self) -> Option<usize> {
        self.unreadable.is_none().then_some(self.trials.len() + self.hidden)
    }

    /// Forgets all but the first trials of the plan.
    pub(super) fn keep_first(&mut self, count: usize) {
        self.trials.truncate(count);
    }

    /// Their trials that can be read, numbered from 0 over all trials and phases, so that (participant, trial)
    /// identifies a trial.
    pub(super) fn driven(&self) -> impl Iterator<Item = Driven<'_>> {
        self.trials.iter().enumerate().filter_map(|(number, examined)| {
            let Examined { trial, config, fault } = examined.as_ref().ok()?;
            Some(Driven { number, trial, parameters: &config.parameters, damage: fault.as_deref() })
        })
    }

    /// What is damaged.
    pub(super) fn damaged(&self) -> impl Iterator<Item = Damaged> {
        let damaged = |trial_id: Option<&str>, what: &str, is_readable| Damaged {
            participant: self.number,
            trial_id: trial_id.map(str::to_owned),
            what: what.to_owned(),
            is_readable,
        };
        let trials = self.trials.iter().filter_map(move |examined| match examined {
            Ok(Examined { trial, fault, .. }) => {
                Some(damaged(Some(&trial.head.trial_id), fault.as_ref()?, true))
            }
            Err(Wrong { trial_id, what }) => Some(damaged(Some(trial_id), what, false)),
        });
        let unreadable = self.unreadable.iter();
        let unreadable = unreadable.map(|what| format!("no trial can be read: {what}"));
        let hidden = "a trial that was stored is not found by its scene; 'sidestep check' says where the damage is";
        let hidden = std::iter::repeat_n(hidden.to_owned(), self.hidden);
        trials.chain(unreadable.chain(hidden).map(move |what| damaged(None, &what, false)))
    }
}
