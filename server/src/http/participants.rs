//! Enrolment, progress, completion and withdrawal of participants.

use crate::clock::now_ms;
use crate::http::app::App;
use crate::http::auth::{Me, MeOrGone};
use crate::http::error::ApiError;
use crate::http::json::JsonBody;
use crate::http::params::{Params, PathText};
use crate::http::studies::named;
use crate::secrets;
use crate::store::participants::{self, Completion, Known, NewParticipant, Participant};
use crate::store::scenes::PlannedRow;
use crate::store::{Store, StoreError};
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde::Deserialize;
use sidestep::api::{Completed, Enrolled, Enrolment, Plan, PlannedPhase, PlannedScene, Progress};
use sidestep::study::StudyConfig;
use std::sync::Arc;
use uuid::Uuid;

/// `POST /api/v1/studies/{slug}/participants`: 201 for a new participant; 200 with the same plan and
/// a further token for a participant who is known by external id or request id.
pub async fn enrol(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    JsonBody(body): JsonBody<Enrolment>,
) -> Result<(StatusCode, Json<Enrolled>), ApiError> {
    body.check()?;
    let study = named(&app.store, &slug).await?;
    // A request is its id and the person whom it is for.
    let request = |id: &str| match &body.external_id {
        Some(external_id) => secrets::hash(&format!("{id} {external_id}")),
        None => secrets::hash(id),
    };
    let known = Known {
        request_hash: body.request_id.as_deref().map(request),
        external_id: body.external_id,
    };
    let seed = secrets::seed()?;
    let scenes = if app.store.is_known(study.id, &known).await? {
        None
    } else {
        let config = Arc::clone(&study.config);
        Some(app.drawing.run(move || plan_rows(&config, seed)).await??)
    };
    let (id, token) = (Uuid::new_v4().to_string(), secrets::token()?);
    let plan = plan(&study.config, scenes.as_deref().unwrap_or_default());
    let screen = body.screen.as_ref().map(serde_json::to_string).transpose();
    let new = NewParticipant {
        id: id.clone(),
        study_id: study.id,
        known,
        config_hash: study.config_hash,
        seed,
        locale: body.locale,
        screen: screen.context("a screen as JSON")?,
        plan: scenes,
        enrolled_at_ms: now_ms(),
    };
    match app.store.enrol(new, secrets::hash(&token)).await? {
        participants::Enrolment::New => Ok((StatusCode::CREATED, Json(enrolled(id, token, plan)))),
        participants::Enrolment::Known(known) => {
            let (plan, _) = plan_of(&app.store, &known).await?;
            Ok((StatusCode::OK, Json(enrolled(known.id, token, plan))))
        }
        participants::Enrolment::Withdrawn => Err(ApiError::withdrawn()),
        // The known participant deleted their data meanwhile: the next attempt is a new enrolment.
        participants::Enrolment::Unplanned => Err(StoreError::Locked.into()),
    }
}

fn enrolled(participant_id: String, token: String, plan: Plan) -> Enrolled {
    Enrolled { participant_id, token, plan }
}

/// `GET /api/v1/participants/me`.
pub async fn show(State(app): State<Arc<App>>, Me(me): Me) -> Result<Json<Progress>, ApiError> {
    let config = app.store.config(&me.config_hash).await?;
    let (plan, rows) = plan_of(&app.store, &me).await?;
    let id = |row: &PlannedRow| row.trial_id.clone();
    Ok(Json(Progress {
        participant_id: me.id,
        study: config.slug.clone(),
        plan,
        stored: rows.iter().filter(|row| row.stored).map(id).collect(),
        next: rows.iter().find(|row| !row.stored).map(id),
        complete: me.completion_code.is_some(),
        completion_code: me.completion_code,
        return_url: None,
        understood: true,
        answered: true,
        pilot: false,
        may_withdraw: true,
    }))
}

/// `POST /api/v1/participants/me/complete`: the completion code, once all trials are stored.
pub async fn complete(
    State(app): State<Arc<App>>,
    Me(me): Me,
) -> Result<Json<Completed>, ApiError> {
    let code = secrets::completion_code()?;
    match app.store.complete(&me.id, code, now_ms()).await? {
        Completion::Complete { code } => {
            Ok(Json(Completed { completion_code: code, return_url: None }))
        }
        Completion::Incomplete { missing, of } => {
            let message = format!("{missing} of {of} trials are not stored yet");
            Err(ApiError::conflict("incomplete", message))
        }
        Completion::Withdrawn => Err(ApiError::withdrawn()),
    }
}

/// What a withdrawal does to the participant's data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// The trials so far may be used.
    Keep,
    /// All data are deleted now.
    Delete,
}

/// The query of a withdrawal.
#[derive(Debug, Deserialize)]
pub struct WithdrawParams {
    data: Fate,
}

/// `DELETE /api/v1/participants/me?data=keep|delete`. Can be repeated, and `keep`
/// followed by `delete`.
pub async fn withdraw(
    State(app): State<Arc<App>>,
    MeOrGone(me): MeOrGone,
    Params(params): Params<WithdrawParams>,
) -> Result<StatusCode, ApiError> {
    app.store.withdraw(&me.id, params.data == Fate::Delete, now_ms()).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The scenes of one participant, as rows.
fn plan_rows(config: &StudyConfig, seed: u64) -> anyhow::Result<Vec<PlannedRow>> {
    let phases = config.plan(seed)?;
    let scenes = phases.into_iter().flat_map(|(phase, scenes)| {
        let in_phase = move |(index, scene)| (phase.phase, index, scene);
        scenes.into_iter().enumerate().map(in_phase)
    });
    let row = |(ordinal, (phase, index, scene))| PlannedRow {
        trial_id: Uuid::new_v4().to_string(),
        ordinal,
        phase,
        index,
        scene,
        stored: false,
    };
    Ok((0..).zip(scenes).map(row).collect())
}

async fn plan_of(
    store: &Store,
    participant: &Participant,
) -> Result<(Plan, Vec<PlannedRow>), ApiError> {
    let config = store.config(&participant.config_hash).await?;
    let rows = store.plan(&participant.id).await?;
    Ok((plan(&config, &rows), rows))
}

/// The plan for the participant's page, from its rows: phases in the configuration's order.
fn plan(config: &StudyConfig, rows: &[PlannedRow]) -> Plan {
    let scene = |row: &PlannedRow| PlannedScene {
        trial_id: row.trial_id.clone(),
        index: row.index,
        attempt: 1,
        human: row.scene.human,
        robot: row.scene.robot,
        goal: row.scene.goal,
    };
    let phase = |phase: &sidestep::study::PhaseConfig| PlannedPhase {
        phase: phase.phase,
        show_danger_zone: phase.show_danger_zone,
        scenes: rows.iter().filter(|row| row.phase == phase.phase).map(scene).collect(),
    };
    Plan { phases: config.phases.iter().map(phase).collect() }
}
