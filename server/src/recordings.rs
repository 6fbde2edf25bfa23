//! The rows of a study as a recording.

use crate::store::studies::StoredStudy;
use crate::store::trials::StoredTrial;
use crate::store::{Store, StoreError};
use sidestep::motion;
use sidestep::recording::{
    Exclusion, Origin, Provenance, RecordedParticipant, RecordedTrial, Recording,
};
use sidestep::synthetic;
use sidestep::trial::Phase;

/// The tasks of all participants of a study whose data have not been deleted. Participants who
/// enrolled under other parameters than the study has now are excluded, as are those whom an
/// experimenter excluded and those with states that the vehicles cannot have driven.
///
/// # Errors
/// [`StoreError`] if the database cannot be read.
pub async fn of_study(store: &Store, study: &StoredStudy) -> Result<Recording, StoreError> {
    let scene = study.config.parameters;
    let (mut participants, mut exclusions) = (Vec::new(), Vec::new());
    let excluded = store.exclusions(study.id).await?;
    // One participant at a time, because a long read keeps SQLite from writing back its log.
    for id in store.participant_ids(study.id, false).await? {
        let driven = store.trials_of(&id).await?;
        let Some(first) = driven.first() else { continue };
        let name = first.head.participant_number.to_string();
        if let Some(reason) = excluded.get(&id) {
            exclusions.push(Exclusion::by_experimenter(&name, reason));
            continue;
        }
        if store.config(&first.config_hash).await?.parameters != scene {
            let reason = "enrolled under other parameters than the study's present ones";
            exclusions.push(Exclusion::new(&name, reason.to_owned()));
            continue;
        }
        participants.push(tasks(name, &driven));
    }
    let origin = Origin::Study(study.slug.clone());
    let provenance = Provenance { origin, synthetic: synthetic::recognised(&participants) };
    let mut recording = Recording { provenance, scene, participants, exclusions };
    motion::exclude_impossible(&mut recording);
    Ok(recording)
}

/// What the participant of a trial drove before it, one trial of each scene: what the laboratory's usual
/// predictor learns from.
///
/// # Errors
/// [`StoreError`] if the database cannot be read.
pub async fn earlier(store: &Store, trial: &StoredTrial) -> Result<Vec<RecordedTrial>, StoreError> {
    let driven = store.trials_of(&trial.head.participant_id).await?;
    Ok(before(&driven, trial))
}

/// The same, of all trials of that participant in the plan's order.
#[must_use]
pub fn before(driven: &[StoredTrial], trial: &StoredTrial) -> Vec<RecordedTrial> {
    let count = driven.partition_point(|other| other.head.ordinal < trial.head.ordinal);
    one_attempt(String::new(), &driven[..count]).trials
}

/// One participant's trials of all phases, one of each scene.
#[must_use]
pub fn one_attempt(name: String, driven: &[StoredTrial]) -> RecordedParticipant {
    // Trials are numbered over all phases, as in exports.
    let trials: Vec<RecordedTrial> =
        (0..).zip(driven).map(|(number, trial)| recorded(number, trial)).collect();
    let mut participant = RecordedParticipant { name, line: None, trials, marked_synthetic: false };
    participant.keep_one_attempt();
    participant
}

/// One participant's tasks, one trial of each scene.
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
    }
}
