//! Enrolment, and the plan of a participant.

use crate::http::app::App;
use crate::http::endings::{newcomers_url, over};
use crate::http::error::ApiError;
use crate::http::evidence::EvidenceBody;
use crate::http::params::PathText;
use crate::http::studies::{gate, named};
use crate::store::StoreError;
use crate::store::enrolments::{self, Gate, NewParticipant};
use crate::store::participants::Participant;
use crate::store::scenes::{PlannedRow, trial_ids};
use crate::store::studies::StoredStudy;
use crate::support::clock::now_ms;
use crate::support::secrets;
use anyhow::Context;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde_json::Value;
use sidestep::api::{Admission, Enrolled, Enrolment, Object, Plan, PlannedPhase, PlannedScene};
use sidestep::invalid::Invalid;
use sidestep::scene::StratifiedScene;
use sidestep::study::{PhaseConfig, Status, StudyConfig, normalised_id};
use std::collections::BTreeMap;
use std::sync::Arc;
use uuid::Uuid;

/// `POST /api/v1/studies/{slug}/participants`: 201 for a new participant. 200, with the same plan
/// and a new token, for a participant who is known by the request id or the external id.
pub async fn enrol(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    EvidenceBody(body): EvidenceBody<Enrolment>,
) -> Result<(StatusCode, Json<Enrolled>), ApiError> {
    body.check()?;
    let study = named(&app.store, &slug).await?;
    let config = &study.config;
    if config.status == Status::Archived {
        return Err(ApiError::archived(goes_to(&study, Admission::Archived, &body)));
    }
    if config.recruitment.require_external_id && body.external_id.is_none() && !body.pilot {
        let expected = "the id of your recruiting service, in the link that it gave you";
        return Err(Invalid::new("external_id", expected, "none").into());
    }
    // Reserve a place in the queue first. If the queue is full, the request fails before anything is
    // stored.
    let drawing = app.drawing.queue()?;
    let page = body
        .locale
        .as_deref()
        .map(|locale| app.library.page(config, &study.config_hash, std::iter::once(locale), None));
    let [closed, full] =
        [Admission::Closed, Admission::Full].map(|admission| goes_to(&study, admission, &body));
    let gate = Gate { is_open: config.admits(is_synthetic(&body)), ..gate(&study) };
    let token = secrets::token()?;
    let new = NewParticipant {
        id: Uuid::new_v4().to_string(),
        study_id: study.id,
        request_hash: request_hash(&body),
        external_key: match &body.external_id {
            Some(id) if !body.pilot => Some(normalised_id("external_id", id)?),
            _ => None,
        },
        pilot_place: body.pilot.then(secrets::seed).transpose()?.map(|seed| seed as u32),
        config_hash: study.config_hash.clone(),
        screen: body.screen.as_ref().map(json).transpose()?,
        parameters: recorded(config, &body.parameters)?,
        consent: page.map(|page| (page.texts.language.clone(), page.consent_hash.clone())),
        external_id: body.external_id,
        locale: body.locale,
        enrolled_at_ms: now_ms(),
    };
    let (status, participant) = match app.store.enrol(new, gate, secrets::hash(&token)).await? {
        enrolments::Enrolment::New(participant) => (StatusCode::CREATED, participant),
        enrolments::Enrolment::Known(participant, _) => (StatusCode::OK, participant),
        enrolments::Enrolment::Over(participant) => {
            let config = app.store.config(&participant.config_hash).await?;
            return Err(over(&config, &participant));
        }
        enrolments::Enrolment::Closed => {
            let message = if config.admits(true) {
                "this study takes synthetic participants only"
            } else {
                "this study is closed; it takes no new participants"
            };
            return Err(ApiError::no_admission("closed", message, closed));
        }
        enrolments::Enrolment::Full => {
            let message = "this study is full: enough people have taken part";
            return Err(ApiError::no_admission("full", message, full));
        }
    };
    let config = app.store.config(&participant.config_hash).await?;
    let mut rows = app.store.plan(&participant.id).await?;
    // Two kinds of participants have no plan: new ones, and those whose enrolment was interrupted
    // when the server stopped.
    if rows.is_empty()
        && let Some(place) = participant.place
    {
        let drawn = Arc::clone(&config);
        let drawn = drawing.run(move || plan_rows(&drawn, place.unsigned_abs())).await??;
        rows = app.store.put_plan(&participant.id, drawn).await?;
    }
    let Participant { id: participant_id, .. } = participant;
    let plan = plan(&config, &rows);
    Ok((status, Json(Enrolled { participant_id, token, plan })))
}

/// The return link for a participant who cannot enrol. Pilot participants get no link.
fn goes_to(study: &StoredStudy, admission: Admission, body: &Enrolment) -> Option<String> {
    let to = || newcomers_url(&study.config, admission, body.external_id.as_deref());
    if body.pilot { None } else { to() }
}

/// Whether the `screen` field identifies a program, such as `sidestep simulate`.
fn is_synthetic(body: &Enrolment) -> bool {
    let said = body.screen.as_ref().and_then(|screen| screen.get("synthetic"));
    said == Some(&Value::Bool(true))
}

/// A hash of the request id, the external id and the pilot flag, which together identify a request.
/// Returns `None` if the request has no id.
fn request_hash(body: &Enrolment) -> Option<[u8; 32]> {
    let kind = if body.pilot { "pilot " } else { "" };
    body.request_id.as_ref().map(|id| match &body.external_id {
        Some(external_id) => secrets::hash(&format!("{kind}{id} {external_id}")),
        None => secrets::hash(&format!("{kind}{id}")),
    })
}

/// The URL parameters that the study records, as JSON. `None` if there are no such parameters.
fn recorded(config: &StudyConfig, parameters: &Object<String>) -> Result<Option<String>, ApiError> {
    let wanted = |name: &str| config.recruitment.record.iter().any(|known| known == name);
    let kept: BTreeMap<_, _> = parameters.iter().filter(|(name, _)| wanted(name)).collect();
    if kept.is_empty() { Ok(None) } else { json(&kept).map(Some) }
}

fn json(value: &impl serde::Serialize) -> Result<String, ApiError> {
    Ok(serde_json::to_string(value).context("an enrolment as JSON")?)
}

/// Draws the scenes of the participant with this place number, as rows of the plan.
fn plan_rows(config: &StudyConfig, place: u64) -> Result<Vec<PlannedRow>, StoreError> {
    let phases = config.stratified(place).map_err(|error| StoreError::Defect(error.to_string()))?;
    let scenes = phases.into_iter().flat_map(|(phase, scenes)| {
        let in_phase = move |(index, scene)| (phase.phase, index, scene);
        scenes.into_iter().enumerate().map(in_phase)
    });
    let row = |((ordinal, (phase, index, planned)), trial_id): (
        (i64, (_, _, StratifiedScene)),
        String,
    )| PlannedRow {
        trial_id,
        ordinal,
        phase,
        index,
        attempt: 1,
        scene: planned.scene,
        stored: false,
    };
    Ok((0..).zip(scenes).zip(trial_ids()).map(row).collect())
}

/// The plan for the participant's page, from its rows. Phases are in the order of the configuration.
#[must_use]
pub fn plan(config: &StudyConfig, rows: &[PlannedRow]) -> Plan {
    let scene = |row: &PlannedRow| PlannedScene {
        trial_id: row.trial_id.clone(),
        index: row.index,
        attempt: row.attempt,
        human: row.scene.human,
        robot: row.scene.robot,
        goal: row.scene.goal,
        policy: row.scene.policy.clone(),
    };
    let phase = |phase: &PhaseConfig| PlannedPhase {
        phase: phase.phase,
        show_danger_zone: phase.show_danger_zone,
        scenes: rows.iter().filter(|row| row.phase == phase.phase).map(scene).collect(),
    };
    Plan { phases: config.phases.iter().map(phase).collect() }
}
