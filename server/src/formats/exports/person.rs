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
}

impl Person {
    /// Reads a participant and replays their trials.
    pub(super) async fn read(store: &Store, entry: &RosterEntry) -> Result<Self, StoreError> {
        let (trials, unreadable) = match soundness::examined(store, &entry.id).await {
            Ok(trials) => (trials, None),
            Err(StoreError::Corrupt(what)) => (Vec::new(), Some(what)),
            Err(error) => return Err(error),
        };
        Ok(Self { number: entry.number, trials, unreadable })
    }

    /// How many trials are stored, if that is known.
    pub(super) fn count(&self) -> Option<usize> {
        self.unreadable.is_none().then_some(self.trials.len())
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
        trials.chain(self.unreadable.iter().map(move |what| damaged(None, what, false)))
    }
}
