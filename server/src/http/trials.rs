//! The one way into the database for what a participant drove.

use crate::clock::now_ms;
use crate::content;
use crate::http::app::App;
use crate::http::auth::Me;
use crate::http::error::ApiError;
use crate::http::json::JsonBody;
use crate::http::params::PathText;
use crate::store::participants::is_withdrawn;
use crate::store::scenes;
use crate::store::studies;
use crate::store::trials::{NewTrial, content_hash, insert};
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use sidestep::api::{TrialStored, TrialUpload};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::trial::{flags, outcome};
use std::sync::Arc;

/// `PUT /api/v1/participants/me/trials/{trial_id}`: 201 stored, after the commit;
/// 200 the same again; 409 other content, or a trial before its turn.
pub async fn store(
    State(app): State<Arc<App>>,
    Me(me): Me,
    PathText(trial_id): PathText,
    JsonBody(upload): JsonBody<TrialUpload>,
) -> Result<(StatusCode, Json<TrialStored>), ApiError> {
    let (parameters, scene) = {
        let mut db = app.store.reader().await?;
        let config = studies::config(&mut db, &me.config_hash).await?;
        // Another person's trial is answered like one that does not exist.
        let scene = scenes::find(&mut db, &me.id, &trial_id)
            .await?
            .ok_or_else(|| ApiError::not_found("trial of yours"))?;
        (config.parameters, scene)
    };
    upload.check(&parameters)?;
    let recording = Recording::of(&upload, &parameters, &scene)?;

    let mut db = app.store.write().await?;
    if is_withdrawn(&mut db, &me.id).await? {
        return Err(ApiError::withdrawn());
    }
    // What is stored is read again under the lock: a copy may have come first.
    let status = if let Some(stored) = content_hash(&mut db, &trial_id).await? {
        if stored != recording.content_hash {
            let message = "this trial is stored with other content, which is kept";
            return Err(ApiError::conflict("different_content", message));
        }
        StatusCode::OK
    } else {
        let next = scenes::next(&mut db, &me.id).await?;
        if let Some(next) = next.filter(|next| *next != trial_id) {
            let message = format!("the next trial is {next}; send it first");
            return Err(ApiError::conflict("out_of_order", message));
        }
        insert(&mut db, &recording.row(&trial_id, &upload)).await?;
        StatusCode::CREATED
    };
    let next = scenes::next(&mut db, &me.id).await?;
    db.commit().await?;
    Ok((status, Json(TrialStored { trial_id, next })))
}

/// What is worked out of an upload before the write lock is taken.
struct Recording {
    content_hash: [u8; 32],
    key_events: String,
    display: String,
    flags: Vec<sidestep::trial::Flag>,
    outcome: sidestep::trial::Outcome,
}

impl Recording {
    /// The hash is of the content as it was understood, so spaces and the order
    /// of fields make no difference.
    fn of(
        upload: &TrialUpload,
        parameters: &SceneParameters,
        scene: &Scene,
    ) -> Result<Self, ApiError> {
        let TrialUpload { inputs, states, sampled_at_ms, .. } = upload;
        Ok(Self {
            content_hash: content::of_upload(upload).context("an upload as JSON")?,
            key_events: serde_json::to_string(&upload.key_events).context("key events as JSON")?,
            display: serde_json::to_string(&upload.display).context("a display as JSON")?,
            flags: flags(parameters, scene, inputs, states, sampled_at_ms),
            outcome: outcome(parameters, inputs, states),
        })
    }

    fn row<'a>(&'a self, trial_id: &'a str, upload: &'a TrialUpload) -> NewTrial<'a> {
        NewTrial {
            trial_id,
            content_hash: self.content_hash,
            received_at_ms: now_ms(),
            started_at_ms: Some(upload.started_at_ms),
            inputs: &upload.inputs,
            states: &upload.states,
            sampled_at_ms: Some(&upload.sampled_at_ms),
            key_events: &self.key_events,
            display: &self.display,
            flags: &self.flags,
            outcome: self.outcome,
        }
    }
}
