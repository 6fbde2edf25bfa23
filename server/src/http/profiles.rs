//! A participant's complete record with their trials as pictures, notes of experimenters, exclusion
//! from analyses, and deletion on request.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::{Manager, Reader};
use crate::http::json::JsonBody;
use crate::http::laboratory::summary;
use crate::http::params::PathText;
use crate::store::profiles::Profile;
use crate::store::trials::{StoredTrial, TrialHead};
use crate::study_recording;
use crate::support::clock::now_ms;
use crate::trial_content::Content;
use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use sidestep::api::{
    Access, Action, Drive, Drives, Inputs, NewExclusion, NewNote, Note, ParticipantDetail,
    TrialPicture, scene_words,
};
use sidestep::scene::{Evader, JointState};
use sidestep::study::StudyConfig;
use sidestep::vehicle::Pose;
use std::sync::Arc;

/// Only every `STRIDE`-th position and the last one are sent.
const STRIDE: usize = 2;

/// `GET /api/v1/admin/participants/{id}`: includes external id, code, answers and parameters if the
/// key has export access.
pub async fn show(
    Reader(me): Reader,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<Json<ParticipantDetail>, ApiError> {
    let mut found = app.store.profile(&id).await?.ok_or_else(unknown)?;
    if me.access < Access::Export {
        (found.summary.external_id, found.summary.completion_code) = (None, None);
        found.answers.clear();
        found.parameters.clear();
    }
    let config = app.store.config(&found.config_hash).await?;
    let study = app.store.study(&found.study).await?.ok_or_else(unknown)?;
    // A participant belongs to the latest version that equals their configuration. Only the status
    // can differ.
    let versions = app.store.study_versions(study.id).await?;
    let version = versions.iter().rev().find(|version| version.says(&config));
    let synthetic = is_synthetic(&found, &config);
    Ok(Json(ParticipantDetail {
        summary: found.summary,
        study: found.study,
        configuration: found.config_hash,
        synthetic,
        configuration_number: version.map(|version| version.number),
        configuration_label: config.version.clone(),
        danger_radius_m: config.parameters.danger_radius_m,
        withdrawn_at_ms: found.withdrawn_at_ms,
        data_deleted: found.data_deleted,
        answers: found.answers,
        parameters: found.parameters,
        exclusion: found.exclusion,
        notes: found.notes,
        trials: found.trials.into_iter().map(picture).collect(),
    }))
}

/// `GET /api/v1/admin/participants/{id}/drives`: the tasks that analyses use, in plan order.
pub async fn drives(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<Json<Drives>, ApiError> {
    let found = app.store.profile(&id).await?.ok_or_else(unknown)?;
    let config = app.store.config(&found.config_hash).await?;
    let hash = &found.config_hash;
    let value_function_hr = app.store.value_function_id(hash, Evader::Human).await?;
    let value_function_rh = app.store.value_function_id(hash, Evader::Robot).await?;
    // Only `study_recording::tasks` decides which trials analyses use.
    let used = study_recording::tasks(String::new(), &found.trials).trials;
    let used = |trial: &&StoredTrial| {
        used.iter().any(|task| task.trial_id.as_ref() == Some(&trial.head.trial_id))
    };
    let drive = |trial: &StoredTrial| {
        let TrialHead { trial_id, phase, index, attempt, .. } = &trial.head;
        let words = scene_words(*phase, *index, *attempt);
        let Content { inputs, states, .. } = &trial.content;
        Drive::new(trial_id.clone(), words, trial.scene.clone(), inputs, states)
    };
    Ok(Json(Drives {
        synthetic: is_synthetic(&found, &config),
        number: found.summary.number,
        pilot: found.summary.pilot,
        study: found.study,
        data_deleted: found.data_deleted,
        excluded: found.exclusion.map(|exclusion| exclusion.reason),
        parameters: config.parameters,
        value_function_hr,
        value_function_rh,
        tasks: found.trials.iter().filter(used).map(drive).collect(),
    }))
}

/// Whether this participant is a program. In a study for programs, a pilot participant may be a person.
fn is_synthetic(found: &Profile, config: &StudyConfig) -> bool {
    (config.synthetic && !found.summary.pilot) || found.trials.iter().any(StoredTrial::is_synthetic)
}

/// `POST /api/v1/admin/participants/{id}/notes`: 201 with the note.
pub async fn add_note(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
    JsonBody(new): JsonBody<NewNote>,
) -> Result<(StatusCode, Json<Note>), ApiError> {
    new.check()?;
    let entry = me.does(Action::NoteAdded, None, None);
    let note = app.store.add_note(&id, new.text, entry).await?.ok_or_else(unknown)?;
    Ok((StatusCode::CREATED, Json(note)))
}

/// `DELETE /api/v1/admin/participants/{id}/notes/{note}`: 204.
pub async fn delete_note(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    path: Result<Path<(String, String)>, PathRejection>,
) -> Result<StatusCode, ApiError> {
    let unknown = || ApiError::not_found("note");
    let Path((id, note)) = path.map_err(|_| unknown())?;
    let note = note.parse().map_err(|_| unknown())?;
    let entry = me.does(Action::NoteDeleted, None, None);
    let deleted = app.store.delete_note(&id, note, entry).await?;
    if deleted { Ok(StatusCode::NO_CONTENT) } else { Err(unknown()) }
}

/// `PUT /api/v1/admin/participants/{id}/exclusion`: 204. Excludes the participant from analyses.
pub async fn exclude(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
    JsonBody(new): JsonBody<NewExclusion>,
) -> Result<StatusCode, ApiError> {
    new.check()?;
    let entry = me.does(Action::Excluded, None, None);
    let found = app.store.exclude(&id, Some(new.reason), entry).await?;
    if found { Ok(StatusCode::NO_CONTENT) } else { Err(unknown()) }
}

/// `DELETE /api/v1/admin/participants/{id}/exclusion`: 204. Includes the participant in analyses.
/// Idempotent.
pub async fn include(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<StatusCode, ApiError> {
    let entry = me.does(Action::Included, None, None);
    let found = app.store.exclude(&id, None, entry).await?;
    if found { Ok(StatusCode::NO_CONTENT) } else { Err(unknown()) }
}

/// `DELETE /api/v1/admin/participants/{id}`: 204. Deletes the same data as a participant's own
/// request for deletion. Idempotent.
pub async fn delete(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<StatusCode, ApiError> {
    let found = app.store.profile(&id).await?.ok_or_else(unknown)?;
    let kind = if found.summary.pilot { "pilot " } else { "" };
    let number = format!("{kind}{}", found.summary.number);
    let entry = me.does(Action::ParticipantDeleted, Some(&found.study), Some(number));
    app.store.withdraw(&id, true, now_ms(), Some(entry)).await?;
    Ok(StatusCode::NO_CONTENT)
}

fn unknown() -> ApiError {
    ApiError::not_found("participant")
}

fn picture(trial: StoredTrial) -> TrialPicture {
    let centimetres = |metres: f64| (metres * 100.0).round() / 100.0;
    let states = &trial.content.states;
    let last = states.len().saturating_sub(1);
    let path = |pose: fn(&JointState) -> &Pose| -> Vec<[f64; 2]> {
        let shown = states.iter().enumerate().filter(|(i, _)| i % STRIDE == 0 || *i == last);
        shown.map(|(_, state)| pose(state)).map(|at| [at.x, at.y].map(centimetres)).collect()
    };
    TrialPicture {
        human: path(|state| &state.human),
        robot: path(|state| &state.robot),
        inputs: Inputs(trial.content.inputs),
        summary: summary(trial.head),
    }
}
