//! The data of an export: the state of a study at one instant.

use super::person::Person;
use super::{ExportError, Filter, Format};
use crate::formats::table::{csv_header, csv_rows};
use crate::formats::tables::participants::Participants;
use crate::store::roster::RosterEntry;
use crate::store::studies::StoredStudy;
use crate::store::{Store, StoreError};
use futures_util::{StreamExt, stream};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::sync::mpsc;

/// The participants and configurations that a filter selects, at one instant. Trials are read from
/// the store when they are needed. Stored trials never change, and later trials follow them in plan
/// order. So the first trials of each participant are the trials of this instant.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// The study.
    pub study: StoredStudy,
    /// The filter.
    pub filter: Filter,
    pub(super) people: Arc<Vec<RosterEntry>>,
    pub(super) configurations: Arc<Vec<(String, String)>>,
}

impl Dataset {
    /// Reads everything except the trials.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn read(
        store: &Store,
        study: &StoredStudy,
        filter: &Filter,
    ) -> Result<Self, StoreError> {
        let mut people = store.roster(study.id, filter.pilots).await?;
        people.retain(|person| filter.keeps_configuration(&person.config_hash));
        let mut configurations = store.configurations(study.id).await?;
        configurations.retain(|(hash, _)| filter.keeps_configuration(hash));
        Ok(Self {
            study: study.clone(),
            filter: filter.clone(),
            people: Arc::new(people),
            configurations: Arc::new(configurations),
        })
    }

    /// A hash that changes whenever a file of the export changes. It covers the program's version, the
    /// format, the filter, the configurations and the table of participants, which includes the number
    /// of trials.
    #[must_use]
    pub fn fingerprint(&self, format: Format) -> String {
        let mut hash = Sha256::new();
        let mut add = |part: &[u8]| {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        };
        add(env!("CARGO_PKG_VERSION").as_bytes());
        add(format.word().as_bytes());
        add(&serde_json::to_vec(&self.filter).unwrap_or_default());
        add(self.study.slug.as_bytes());
        add(self.study.config_hash.as_bytes());
        for (digest, json) in self.configurations.iter() {
            add(digest.as_bytes());
            add(json.as_bytes());
        }
        let table = Participants::new(&self.study.config, &self.people);
        let mut text = csv_header(&table.columns());
        csv_rows(&table.columns(), &table.rows(), &mut text);
        add(&text);
        hex::encode(hash.finalize())
    }

    /// Whether all participants are programs. A pilot of a synthetic study can be a person.
    #[must_use]
    pub fn is_synthetic(&self) -> bool {
        self.study.config.synthetic && !self.filter.pilots
    }

    /// Number of trials of the dataset's participants.
    #[must_use]
    pub fn trials(&self) -> u64 {
        let counts = self.people.iter().flat_map(|person| person.trials);
        u64::try_from(counts.sum::<i64>()).unwrap_or(0)
    }

    /// The time at which data were last stored (ms since 1970). Returns `None` if there are no
    /// participants.
    #[must_use]
    pub fn changed_at_ms(&self) -> Option<i64> {
        let excluded = |person: &RosterEntry| person.exclusion.as_ref().map(|(at_ms, _)| *at_ms);
        let times = |person: &RosterEntry| {
            person.times_ms.into_iter().chain([excluded(person)]).flatten().max()
        };
        self.people.iter().filter_map(times).max()
    }

    /// Reads the participants with their trials, one after another, ahead of the consumer. Stops
    /// after an error, and sets `failed` before the consumer can receive the error.
    pub(super) fn driven(&self, store: &Store, failed: Arc<AtomicBool>) -> People {
        let (sender, receiver) = mpsc::channel(4);
        let (store, people) = (store.clone(), Arc::clone(&self.people));
        let one = move |at: usize| {
            let (store, people) = (store.clone(), Arc::clone(&people));
            async move { read(&store, &people[at]).await }
        };
        // Read the next participant's trials while the current participant's trials are replayed.
        let mut reading = stream::iter(0..self.people.len()).map(one).buffered(2);
        tokio::spawn(async move {
            while let Some(person) = reading.next().await {
                let last = person.is_err();
                failed.fetch_or(last, Ordering::SeqCst);
                if sender.send(person).await.is_err() || last {
                    break;
                }
            }
        });
        receiver
    }
}

/// A channel of participants with their trials, in the order of reading.
pub(super) type People = mpsc::Receiver<Result<Person, ExportError>>;

/// Reads a participant with the trials that they had at the dataset's instant.
async fn read(store: &Store, entry: &RosterEntry) -> Result<Person, ExportError> {
    let expected = usize::try_from(entry.trials.iter().sum::<i64>()).unwrap_or(0);
    let mut person = Person::read(store, entry).await?;
    if person.count().is_some_and(|count| count < expected) {
        return Err(ExportError::Changed { participant: entry.number });
    }
    person.keep_counted();
    Ok(person)
}
