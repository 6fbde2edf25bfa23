//! A study's data as files, for the command, and its steps as one file, for the route.
//!
//! Participants are read one after the other, so that memory does not grow with the study and no long
//! read keeps SQLite from writing back its log. Each participant's rows come from one snapshot.

mod filter;
mod table_file;
mod folder;

pub use filter::{Filter, Quality};
pub use folder::{ExportError, FileEntry, MANIFEST, Manifest, write};
pub use table_file::Format;

use super::table::{Batch, csv_header, csv_rows};
use super::tables::{Driven, steps};
use crate::store::studies::StoredStudy;
use crate::store::trials::StoredTrial;
use crate::store::{Store, StoreError};
use futures_util::stream::{self, Stream};
use sidestep::invalid::Invalid;
use sidestep::study::StudyConfig;
use std::sync::Arc;

/// Accepts the format of a download.
///
/// # Errors
/// [`Invalid`] naming it.
pub fn check_format(format: &str) -> Result<(), Invalid> {
    if format == "csv" { Ok(()) } else { Err(Invalid::new("format", "csv", format!("{format:?}"))) }
}

/// All trials of a participant, in the plan's order, with the configuration of their enrolment.
struct Person {
    config: Arc<StudyConfig>,
    trials: Vec<StoredTrial>,
}

impl Person {
    /// Reads a participant; none if they drove nothing.
    async fn read(store: &Store, id: &str) -> Result<Option<Self>, StoreError> {
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

    /// Their trials, numbered from 0 over all phases, so that (participant, trial) identifies a trial.
    fn driven(&self) -> impl Iterator<Item = Driven<'_>> {
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

/// The table of steps as CSV, piece by piece. After an error there are no further pieces, so a download
/// breaks off instead of ending as if it were complete.
pub fn stream(
    store: Store,
    study: StoredStudy,
) -> impl Stream<Item = Result<Vec<u8>, StoreError>> + Send + 'static {
    enum Stage {
        Header,
        People(std::vec::IntoIter<String>),
        End,
    }
    stream::unfold(Stage::Header, move |stage| {
        let (store, study_id) = (store.clone(), study.id);
        async move {
            match stage {
                Stage::Header => match store.participant_ids(study_id, false).await {
                    Ok(ids) => {
                        let header = csv_header(&steps::columns());
                        Some((Ok(header), Stage::People(ids.into_iter())))
                    }
                    Err(error) => Some((Err(error), Stage::End)),
                },
                Stage::People(mut ids) => match steps_of(&store, &ids.next()?).await {
                    Ok(rows) => Some((Ok(rows), Stage::People(ids))),
                    Err(error) => Some((Err(error), Stage::End)),
                },
                Stage::End => None,
            }
        }
    })
}

async fn steps_of(store: &Store, participant_id: &str) -> Result<Vec<u8>, StoreError> {
    let mut rows = Vec::new();
    if let Some(person) = Person::read(store, participant_id).await? {
        let columns = steps::columns();
        let mut batch = Batch::new(&columns);
        person.driven().for_each(|driven| steps::add(&mut batch, &driven));
        csv_rows(&columns, &batch, &mut rows);
    }
    Ok(rows)
}
