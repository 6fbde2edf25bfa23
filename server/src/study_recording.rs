//! Reads the rows of a study as a recording.

use crate::store::studies::StoredStudy;
use crate::store::trials::StoredTrial;
use crate::store::{Store, StoreError};
use sidestep::plausibility;
use sidestep::recording::{Exclusion, Origin, RecordedParticipant, RecordedTrial, Recording};
use sidestep::scene::SceneParameters;
use sidestep::synthetic;
use sidestep::trial::Phase;
use std::collections::HashMap;

/// The tasks of a study's participants, without participants whose data were deleted. Excludes
/// participants who enrolled under parameters that differ from the study's present parameters, who were
/// excluded by an experimenter, or who have states that the vehicles cannot have driven.
///
/// # Errors
/// [`StoreError`] if the database cannot be read.
pub async fn of_study(store: &Store, study: &StoredStudy) -> Result<Recording, StoreError> {
    let (mut participants, mut exclusions) = (Vec::new(), Vec::new());
    let mut people = People::of(store, study).await?;
    while let Some(person) = people.next().await? {
        match person {
            Person::Drove(participant) => participants.push(participant),
            Person::Excluded(exclusion) => exclusions.push(exclusion),
        }
    }
    Ok(complete(&study.slug, study.config.parameters, participants, exclusions))
}

/// A participant of a study, as read by [`People`].
#[derive(Clone, Debug)]
pub enum Person {
    /// A participant who drove, with their tasks.
    Drove(RecordedParticipant),
    /// A participant who is excluded from analyses.
    Excluded(Exclusion),
}

/// Reads the participants of a study one after another, so that at most one participant is in memory
/// and no read is long. A long read prevents SQLite from checkpointing its log.
pub struct People<'a> {
    store: &'a Store,
    scene: SceneParameters,
    ids: std::vec::IntoIter<String>,
    /// The participants whom an experimenter excluded, with the reasons.
    excluded: HashMap<String, String>,
}

impl<'a> People<'a> {
    /// Begins to read the participants of this study.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn of(store: &'a Store, study: &StoredStudy) -> Result<Self, StoreError> {
        let ids = store.participant_ids(study.id, false).await?.into_iter();
        let excluded = store.exclusions(study.id).await?;
        Ok(Self { store, scene: study.config.parameters, ids, excluded })
    }

    /// The next participant who drove. Returns `None` after the last participant.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn next(&mut self) -> Result<Option<Person>, StoreError> {
        for id in self.ids.by_ref() {
            let driven = self.store.trials_of(&id).await?;
            let Some(first) = driven.first() else { continue };
            let name = first.head.participant_number.to_string();
            if let Some(reason) = self.excluded.get(&id) {
                return Ok(Some(Person::Excluded(Exclusion::by_experimenter(&name, reason))));
            }
            if self.store.config(&first.config_hash).await?.parameters != self.scene {
                let reason = "enrolled under other parameters than the study's present ones";
                return Ok(Some(Person::Excluded(Exclusion::new(&name, reason.to_owned()))));
            }
            return Ok(Some(Person::Drove(tasks(name, &driven))));
        }
        Ok(None)
    }
}

/// The recording of a study whose participants were read by [`People`].
#[must_use]
pub fn complete(
    slug: &str,
    scene: SceneParameters,
    participants: Vec<RecordedParticipant>,
    exclusions: Vec<Exclusion>,
) -> Recording {
    let origin = Origin::Study(slug.to_owned());
    let provenance = synthetic::provenance(origin, &participants);
    let mut recording = Recording { provenance, scene, participants, exclusions };
    plausibility::exclude_impossible(&mut recording);
    recording
}

/// The trials that a participant drove before this trial, with one trial of each scene. They are
/// the training data of the laboratory's default predictor.
///
/// # Errors
/// [`StoreError`] if the database cannot be read.
pub async fn earlier(store: &Store, trial: &StoredTrial) -> Result<Vec<RecordedTrial>, StoreError> {
    let driven = store.trials_of(&trial.head.participant_id).await?;
    Ok(before(&driven, trial))
}

/// Like [`earlier`]. `driven` has all trials of the participant, in plan order.
#[must_use]
pub fn before(driven: &[StoredTrial], trial: &StoredTrial) -> Vec<RecordedTrial> {
    let count = driven.partition_point(|other| other.head.ordinal < trial.head.ordinal);
    one_attempt(String::new(), &driven[..count]).trials
}

/// A participant's trials of all phases, with one trial of each scene.
#[must_use]
pub fn one_attempt(name: String, driven: &[StoredTrial]) -> RecordedParticipant {
    // Number the trials over all phases, as in exports.
    let trials: Vec<RecordedTrial> =
        (0..).zip(driven).map(|(number, trial)| recorded(number, trial)).collect();
    let mut participant = RecordedParticipant { name, line: None, trials, marked_synthetic: false };
    participant.keep_one_attempt();
    participant
}

/// A participant's tasks, with one trial of each scene.
#[must_use]
pub fn tasks(name: String, driven: &[StoredTrial]) -> RecordedParticipant {
    let mut participant = one_attempt(name, driven);
    participant.keep_tasks();
    let is_marked = |trial: &StoredTrial| trial.head.phase == Phase::Task && trial.is_synthetic();
    participant.marked_synthetic = driven.iter().any(is_marked);
    participant
}

fn recorded(number: u64, trial: &StoredTrial) -> RecordedTrial {
    RecordedTrial {
        line: None,
        number,
        phase: trial.head.phase,
        attempt: trial.head.attempt,
        trial_id: Some(trial.head.trial_id.clone()),
        inputs: trial.content.inputs.clone(),
        states: trial.content.states.clone(),
        started_at_ms: trial.content.started_at_ms,
        sampled_at_ms: trial.content.sampled_at_ms.clone(),
        flags: trial.head.flags.clone(),
        robot: trial.scene.policy.as_ref().map(|policy| policy.name.clone()),
    }
}
