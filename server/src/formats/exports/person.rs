//! A participant with all that they drove.

use crate::formats::tables::Driven;
use crate::store::trials::StoredTrial;
use crate::store::{Store, StoreError};
use sidestep::study::StudyConfig;
use std::sync::Arc;

/// All trials of a participant, in the plan's order, with the configuration of their enrolment.
pub(super) struct Person {
    config: Arc<StudyConfig>,
    trials: Vec<StoredTrial>,
}

impl Person {
    /// Reads a participant; none if they drove nothing.
    pub(super) async fn read(store: &Store, id: &str) -> Result<Option<Self>, StoreError> {
        let trials = store.trials_of(id).await?;
        let Some(first) = trials.first() else { return Ok(None) };
        let config = store.config(&first.config_hash).await?;
        // Rows are printed as they are stored; what is not of the study's length is damage.
        match trials.iter().find(|trial| !is_whole(trial)) {
            Some(trial) => {
                let id = &trial.head.trial_id;
                Err(StoreError::Corrupt(format!("trial {id}: not as many times as inputs")))
            }
            None => Ok(Some(Self { config, trials })),
        }
    }

    /// How many trials are stored.
    pub(super) fn count(&self) -> usize {
        self.trials.len()
    }

    /// Forgets all but the first trials of the plan.
    pub(super) fn keep_first(&mut self, count: usize) {
        self.trials.truncate(count);
    }

    /// Their trials, numbered from 0 over all phases, so that (participant, trial) identifies a trial.
    pub(super) fn driven(&self) -> impl Iterator<Item = Driven<'_>> {
        let parameters = &self.config.parameters;
        let trials = self.trials.iter().enumerate();
        trials.map(move |(number, trial)| Driven { number, trial, parameters })
    }
}

/// Whether there is a state before each step, and a time if times were recorded.
fn is_whole(trial: &StoredTrial) -> bool {
    let content = &trial.content;
    let steps = content.inputs.len();
    content.states.len() == steps + 1
        && content.sampled_at_ms.as_ref().is_none_or(|times| times.len() == steps)
}
