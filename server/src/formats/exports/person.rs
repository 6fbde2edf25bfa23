//! A participant with all of their trials.

use super::damage::Damaged;
use crate::database_check::{self, Examined, Wrong};
use crate::formats::tables::Driven;
use crate::store::roster::RosterEntry;
use crate::store::{Store, StoreError};

/// All trials of a participant, in plan order. Each trial was replayed.
pub(super) struct Person {
    /// The participant's number.
    number: i64,
    /// Number of stored trials according to the roster.
    stored: usize,
    trials: Vec<Result<Examined, Wrong>>,
    /// The reason why no trial can be read, if so.
    unreadable: Option<String>,
    /// Number of stored trials that cannot be found because of damage.
    hidden: usize,
    /// Number of trials that were not counted because the stored count is damaged.
    uncounted: usize,
}

impl Person {
    /// Reads a participant and replays their trials.
    pub(super) async fn read(store: &Store, entry: &RosterEntry) -> Result<Self, StoreError> {
        let (trials, unreadable) = match database_check::examined(store, &entry.id).await {
            Ok(trials) => (trials, None),
            Err(StoreError::Corrupt(what)) => (Vec::new(), Some(what)),
            Err(error) => return Err(error),
        };
        let stored = usize::try_from(entry.trials.iter().sum::<i64>()).unwrap_or(0);
        let (mut hidden, mut uncounted) = (0, 0);
        if unreadable.is_none()
            && trials.len() != stored
            // `None` means that the trials were deleted in the meantime.
            && let Some(now) = store.stored_trials(&entry.id).await?
        {
            let now = usize::try_from(now).unwrap_or(0);
            hidden = stored.min(now).saturating_sub(trials.len());
            // `now` includes the trials that arrived meanwhile.
            uncounted = trials.len().saturating_sub(stored.max(now));
        }
        Ok(Self { number: entry.number, stored, trials, unreadable, hidden, uncounted })
    }

    /// Number of stored trials, if known.
    pub(super) fn count(&self) -> Option<usize> {
        self.unreadable.is_none().then_some(self.trials.len() + self.hidden)
    }

    /// Drops the trials that arrived after the count in the roster.
    pub(super) fn keep_counted(&mut self) {
        self.trials.truncate(self.stored + self.uncounted);
    }

    /// The readable trials, numbered by their place in the plan. So the pair (participant, trial)
    /// identifies a trial even if other trials are left out.
    pub(super) fn driven(&self) -> impl Iterator<Item = Driven<'_>> {
        self.trials.iter().filter_map(|examined| {
            let Examined { trial, config, fault } = examined.as_ref().ok()?;
            let number = usize::try_from(trial.head.ordinal).ok()?;
            Some(Driven { number, trial, parameters: &config.parameters, damage: fault.as_deref() })
        })
    }

    /// The damage in the participant's trials.
    pub(super) fn damaged(&self) -> impl Iterator<Item = Damaged> {
        let of = |trial_id: Option<&str>, trials: usize, what: &str, is_readable| Damaged {
            participant: self.number,
            trial_id: trial_id.map(str::to_owned),
            trials: trials as u64,
            what: what.to_owned(),
            is_readable,
        };
        let trials = self.trials.iter().filter_map(move |examined| match examined {
            Ok(Examined { trial, fault, .. }) => {
                Some(of(Some(&trial.head.trial_id), 1, fault.as_ref()?, true))
            }
            Err(Wrong { trial_id, what }) => Some(of(Some(trial_id), 1, what, false)),
        });
        let unreadable = self.unreadable.as_ref().map(|what| {
            of(None, self.stored.max(1), &format!("no trial can be read: {what}"), false)
        });
        let hidden = (self.hidden > 0).then(|| {
            let (hidden, stored) = (self.hidden, self.stored);
            let what =
                format!("of {stored} stored trials, {hidden} cannot be found by their scenes");
            of(None, hidden, &what, false)
        });
        let uncounted = (self.uncounted > 0).then(|| {
            let (stored, there) = (self.stored, self.trials.len());
            let what = format!("{there} trials are stored, and {stored} were counted");
            of(None, self.uncounted, &what, true)
        });
        trials.chain(unreadable).chain(hidden).chain(uncounted)
    }
}
