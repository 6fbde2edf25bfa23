//! Uploads of trials.

use crate::http::app::App;
use crate::http::auth::Assigned;
use crate::http::error::ApiError;
use crate::http::evidence::EvidenceBody;
use crate::http::params::Params;
use crate::store::trials::{AssignedScene, NewTrial, PutTrial};
use crate::support::clock::now_ms;
use crate::trial_content::{Content, Recipe};
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use schemars::JsonSchema;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use sidestep::api::{KeyEvent, TrialStored, TrialUpload};
use sidestep::study::StudyConfig;
use sidestep::trial::{Flag, Phase, outcome};
use std::sync::Arc;
use uuid::Uuid;

/// The query of an upload.
#[derive(Debug, Deserialize, JsonSchema)]
pub struct UploadParams {
    /// Number of further trials waiting in the participant's browser; capped at the study's maximum.
    #[serde(default)]
    waiting: u32,
}

/// `PUT /api/v1/participants/me/trials/{trial_id}`: 201 after the commit. 200 if the same content
/// was stored before. 409 if different content is stored, or if another trial must come first.
pub async fn store(
    State(app): State<Arc<App>>,
    Assigned { participant_id, config, trial_id, scene }: Assigned,
    Params(UploadParams { waiting }): Params<UploadParams>,
    EvidenceBody(upload): EvidenceBody<TrialUpload>,
) -> Result<(StatusCode, Json<TrialStored>), ApiError> {
    upload.check(&config.parameters)?;
    let waiting = waiting.min(most_trials(&config));
    let trial = NewTrial { waiting, ..recorded(trial_id.clone(), upload, &config, &scene)? };
    let (status, next) = match app.store.put_trial(&participant_id, trial).await? {
        PutTrial::Stored { next } => (StatusCode::CREATED, next),
        PutTrial::Same { next } => (StatusCode::OK, next),
        PutTrial::Different => {
            let message = "this trial is stored with other content, which is kept";
            return Err(ApiError::conflict("different_content", message));
        }
        PutTrial::OutOfOrder { next } => {
            let message = format!("the next trial is {next}; send it first");
            return Err(ApiError::conflict("out_of_order", message));
        }
        PutTrial::Withdrawn => return Err(ApiError::withdrawn(None)),
        PutTrial::Unknown => return Err(ApiError::not_found("trial of yours")),
    };
    Ok((status, Json(TrialStored { trial_id, next })))
}

/// Maximum number of a participant's trials, with two trials per scene.
fn most_trials(config: &StudyConfig) -> u32 {
    let scenes: usize = config.phases.iter().map(|phase| phase.scenes).sum();
    u32::try_from(2 * scenes).unwrap_or(u32::MAX)
}

/// Converts an upload into the trial to be stored, and computes its flags, outcome and hash.
fn recorded(
    trial_id: String,
    upload: TrialUpload,
    config: &StudyConfig,
    assigned: &AssignedScene,
) -> Result<NewTrial, ApiError> {
    let parameters = &config.parameters;
    let outcome = outcome(parameters, &upload.inputs, &upload.states);
    let key_timing = key_timing(&upload.key_events);
    let content = Content {
        started_at_ms: Some(upload.started_at_ms),
        inputs: upload.inputs,
        states: upload.states,
        sampled_at_ms: Some(upload.sampled_at_ms),
        key_events: serde_json::to_string(&upload.key_events).context("key events as JSON")?,
        page_events: Some(serde_json::to_string(&upload.page_events).context("events as JSON")?),
        exposures: Some(upload.exposures),
        display: serde_json::to_string(&upload.display).context("a display as JSON")?,
    };
    let flags = content.flags(parameters, &assigned.scene).context("flags of an upload")?;
    let is_repeated = config.trials.repeat_interrupted
        && assigned.phase == Phase::Task
        && assigned.attempt == 1
        && flags.contains(&Flag::Interrupted);
    let (recipe, received_at_ms) = (Recipe::UploadWithPage, now_ms());
    Ok(NewTrial {
        trial_id,
        recipe,
        content_hash: recipe.hash(&content),
        received_at_ms,
        content,
        flags,
        outcome,
        key_timing,
        repeated_as: is_repeated.then(|| Uuid::new_v4().to_string()),
        waiting: 0,
    })
}

/// A hash of the times of the key events, or `None` if there are too few events. Equal hashes of two
/// participants are no coincidence, because the times are precise to a fraction of a millisecond.
fn key_timing(events: &[KeyEvent]) -> Option<i64> {
    const ENOUGH: usize = 4;
    if events.len() < ENOUGH {
        return None;
    }
    let mut hash = Sha256::new();
    for event in events {
        hash.update(event.t_ms.to_le_bytes());
    }
    hash.finalize().first_chunk().copied().map(i64::from_le_bytes)
}
