//! The hash of a trial's content: it tells the same upload again from another
//! one, and a sound row from a damaged one.

use crate::store::octets::{pack, pack_inputs, pack_states};
use crate::store::trials::StoredTrial;
use sha2::{Digest, Sha256};
use sidestep::api::TrialUpload;
use sidestep::scene::JointState;
use sidestep::vehicle::TurnInput;

/// Hash of an upload as it was understood, so that spaces and the order of fields
/// make no difference.
///
/// # Errors
/// If it has no JSON form, which is for numbers that are not finite.
pub fn of_upload(upload: &TrialUpload) -> serde_json::Result<[u8; 32]> {
    serde_json::to_vec(upload).map(|octets| Sha256::digest(octets).into())
}

/// Hash of a trial that was read from a file.
#[must_use]
pub fn of_import(
    inputs: &[TurnInput],
    states: &[JointState],
    sampled_at_ms: Option<&[f64]>,
) -> [u8; 32] {
    let mut hash = Sha256::new();
    hash.update(pack_inputs(inputs));
    hash.update(pack_states(states));
    hash.update(pack(sampled_at_ms.unwrap_or_default().iter().copied()));
    hash.finalize().into()
}

/// Hash of a stored row, by the recipe that it was stored with.
///
/// # Errors
/// If its JSON columns do not parse.
pub fn of_stored(trial: &StoredTrial, imported: bool) -> serde_json::Result<[u8; 32]> {
    if imported {
        let times = trial.sampled_at_ms.as_deref();
        return Ok(of_import(&trial.inputs, &trial.states, times));
    }
    of_upload(&TrialUpload {
        started_at_ms: trial.started_at_ms.unwrap_or_default(),
        inputs: trial.inputs.clone(),
        states: trial.states.clone(),
        sampled_at_ms: trial.sampled_at_ms.clone().unwrap_or_default(),
        key_events: serde_json::from_str(&trial.key_events)?,
        display: serde_json::from_str(&trial.display)?,
    })
}
