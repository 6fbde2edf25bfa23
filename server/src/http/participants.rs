//! A participation from enrolment to its end.

use crate::clock::now_ms;
use crate::http::app::App;
use crate::http::auth::{Me, MeOrGone};
use crate::http::error::ApiError;
use crate::http::json::JsonBody;
use crate::http::params::{Params, PathText};
use crate::http::studies::named;
use crate::secrets;
use crate::store::participants::{self, NewParticipant, Participant};
use crate::store::scenes::{self, PlannedRow};
use crate::store::{Db, studies};
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde::Deserialize;
use sidestep::api::{Completed, Enrolled, Enrolment, Plan, PlannedPhase, PlannedScene, Progress};
use sidestep::study::StudyConfig;
use std::sync::Arc;
use uuid::Uuid;

/// `POST /api/v1/studies/{slug}/participants`: 201 for someone new; 200 with the
/// same plan and a further token for a known external id.
pub async fn enrol(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    JsonBody(body): JsonBody<Enrolment>,
) -> Result<(StatusCode, Json<Enrolled>), ApiError> {
    body.check()?;
    let study = named(&mut *app.store.reader().await?, &slug).await?;
    // Drawing scenes takes a while: not under the write lock, and not on this thread.
    let seed = secrets::seed()?;
    let config = study.config.clone();
    let scenes = tokio::task::spawn_blocking(move || plan_rows(&config, seed))
        .await
        .context("drawing scenes")??;

    let mut db = app.store.write().await?;
    if let Some(external_id) = &body.external_id
        && let Some(known) = participants::by_external_id(&mut db, study.id, external_id).await?
    {
        if known.withdrawn_at_ms.is_some() {
            return Err(ApiError::withdrawn());
        }
        let token = give_token(&mut db, &known.id).await?;
        let (plan, _) = plan_of(&mut db, &known).await?;
        db.commit().await?;
        return Ok((StatusCode::OK, Json(enrolled(known.id, token, plan))));
    }
    let id = Uuid::new_v4().to_string();
    let screen =
        body.screen.as_ref().map(serde_json::to_string).transpose().context("a screen as JSON")?;
    let config_hash = study.config.hash();
    let new = NewParticipant {
        id: &id,
        study_id: study.id,
        external_id: body.external_id.as_deref(),
        config_hash: &config_hash,
        seed: Some(seed),
        import_hash: None,
        locale: body.locale.as_deref(),
        screen: screen.as_deref(),
        enrolled_at_ms: now_ms(),
    };
    participants::insert(&mut db, &new).await?;
    for scene in &scenes {
        scenes::insert(&mut db, &id, scene).await?;
    }
    let token = give_token(&mut db, &id).await?;
    db.commit().await?;
    let plan = plan(&study.config, &scenes);
    Ok((StatusCode::CREATED, Json(enrolled(id, token, plan))))
}

fn enrolled(participant_id: String, token: String, plan: Plan) -> Enrolled {
    Enrolled { participant_id, token, plan }
}

async fn give_token(db: &mut Db, participant_id: &str) -> Result<String, ApiError> {
    let token = secrets::token()?;
    participants::add_token(db, participant_id, &secrets::hash(&token), now_ms()).await?;
    Ok(token)
}

/// `GET /api/v1/participants/me`.
pub async fn show(State(app): State<Arc<App>>, Me(me): Me) -> Result<Json<Progress>, ApiError> {
    let mut db = app.store.reader().await?;
    let (plan, rows) = plan_of(&mut db, &me).await?;
    let config = studies::config(&mut db, &me.config_hash).await?;
    let id = |row: &PlannedRow| row.trial_id.clone();
    Ok(Json(Progress {
        participant_id: me.id,
        study: config.slug,
        plan,
        stored: rows.iter().filter(|row| row.stored).map(id).collect(),
        next: rows.iter().find(|row| !row.stored).map(id),
        completion_code: me.completion_code,
    }))
}

/// `POST /api/v1/participants/me/complete`: a code, but only for what is stored.
pub async fn complete(
    State(app): State<Arc<App>>,
    Me(me): Me,
) -> Result<Json<Completed>, ApiError> {
    let mut db = app.store.write().await?;
    let rows = scenes::of_participant(&mut db, &me.id).await?;
    let missing = rows.iter().filter(|row| !row.stored).count();
    if missing > 0 {
        let message = format!("{missing} of {} trials are not stored yet", rows.len());
        return Err(ApiError::conflict("incomplete", message));
    }
    if participants::is_withdrawn(&mut db, &me.id).await? {
        return Err(ApiError::withdrawn());
    }
    let code = secrets::completion_code()?;
    let completion_code = participants::complete(&mut db, &me.id, &code, now_ms()).await?;
    db.commit().await?;
    Ok(Json(Completed { completion_code }))
}

/// What becomes of the data of someone who withdraws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// What was driven so far may be used.
    Keep,
    /// It is deleted now.
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
    let mut db = app.store.write().await?;
    participants::withdraw(&mut db, &me.id, now_ms()).await?;
    if params.data == Fate::Delete {
        participants::delete_data(&mut db, &me.id).await?;
    }
    db.commit().await?;
    if params.data == Fate::Delete
        && let Err(error) = app.store.forget().await
    {
        // The rows are gone; their octets leave the log with the next checkpoint.
        tracing::warn!(%error, "the write-ahead log was not written back");
    }
    Ok(StatusCode::NO_CONTENT)
}

/// The scenes of one participant, as they are written down.
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
    db: &mut Db,
    participant: &Participant,
) -> Result<(Plan, Vec<PlannedRow>), ApiError> {
    let config = studies::config(db, &participant.config_hash).await?;
    let rows = scenes::of_participant(db, &participant.id).await?;
    Ok((plan(&config, &rows), rows))
}

/// Rows to the plan that a participant sees: phases in the configuration's order.
fn plan(config: &StudyConfig, rows: &[PlannedRow]) -> Plan {
    let scene = |row: &PlannedRow| PlannedScene {
        trial_id: row.trial_id.clone(),
        index: row.index,
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
