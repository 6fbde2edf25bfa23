//! Detects trials of synthetic participants, so that nobody mistakes findings from them for
//! findings about people.

use super::SyntheticParticipant;
use crate::recording::{Origin, Provenance, RecordedParticipant, RecordedTrial};
use crate::scene::{JointState, SceneParameters};

/// The seed of the project's reference data. The file of these data does not mark the participants
/// as synthetic.
pub const REFERENCE_SEED: u64 = 20_180_918;

/// The reference's participant numbers. In a copy of the data, the participants can have other
/// names.
const REFERENCE_PARTICIPANTS: core::ops::Range<u64> = 0..8;

/// The provenance of these participants' trials from `origin`.
#[must_use]
pub fn provenance(origin: Origin, participants: &[RecordedParticipant]) -> Provenance {
    let is_marked = |of: &RecordedParticipant| of.marked_synthetic;
    let is_mixed = participants.iter().any(is_marked) && !participants.iter().all(is_marked);
    Provenance { origin, synthetic: recognised(participants), is_mixed }
}

/// Returns the evidence that these participants' trials are synthetic, if any. Either the data are
/// marked as synthetic, or a participant's first trial starts like a trial of the reference.
#[must_use]
pub fn recognised(participants: &[RecordedParticipant]) -> Option<String> {
    let marked: Vec<&str> =
        participants.iter().filter(|of| of.marked_synthetic).map(|of| &of.name[..]).collect();
    if marked.len() == participants.len() && !participants.is_empty() {
        return Some("the file or the server marks all of them as synthetic".to_owned());
    }
    if !marked.is_empty() {
        let (some, all) = (marked.len(), participants.len());
        // Lists the names only if there are few.
        let names = if some <= 12 { format!(": {}", marked.join(", ")) } else { String::new() };
        return Some(format!(
            "the file or the server marks {some} of {all} people as synthetic{names}"
        ));
    }
    let known = participants.iter().any(is_of_the_reference);
    known.then(|| format!("the same as those of seed {REFERENCE_SEED}"))
}

fn is_of_the_reference(participant: &RecordedParticipant) -> bool {
    let Some(trial) = participant.trials.first() else {
        return false;
    };
    let own = participant.name.parse::<u64>().ok();
    own.into_iter().chain(REFERENCE_PARTICIPANTS).any(|number| begins_as(number, trial))
}

/// Whether the trial has the same start poses as the same-numbered trial of this reference
/// participant.
fn begins_as(participant: u64, trial: &RecordedTrial) -> bool {
    let person = SyntheticParticipant::new(REFERENCE_SEED, participant);
    let (scene, _) = person.own_scene(&SceneParameters::default(), trial.number);
    let numbers = |state: &JointState| [state.human, state.robot].map(<[f64; 3]>::from).concat();
    let near = |(a, b): (f64, f64)| (a - b).abs() < 1e-6;
    let (own, driven) = (numbers(&scene.start()), numbers(&trial.states[0]));
    own.into_iter().zip(driven).all(near)
}
