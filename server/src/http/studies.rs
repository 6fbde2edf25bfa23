//! The public part of a study.

use crate::clock::now_ms;
use crate::http::app::App;
use crate::http::auth::visitor;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use crate::store::Store;
use crate::store::enrolments::Gate;
use crate::store::studies::StoredStudy;
use axum::Json;
use axum::extract::State;
use axum::http::HeaderMap;
use sidestep::api::{Admission, StudyInfo};
use sidestep::study::{Status, StudyConfig};
use std::sync::Arc;

/// `GET /api/v1/studies/{slug}`. With a participant's token, the study as they enrolled in it.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    headers: HeaderMap,
) -> Result<Json<StudyInfo>, ApiError> {
    let study = named(&app.store, &slug).await?;
    let mut admission = match study.config.status {
        Status::Open if !study.config.admits(false) => Admission::Closed,
        status => status.into(),
    };
    if admission == Admission::Open && app.store.is_full(study.id, gate(&study)).await? {
        admission = Admission::Full;
    }
    let (config, _) = asked_for(&app, &study, &headers).await?;
    Ok(Json(StudyInfo::of(&config, admission)))
}

/// The configuration that a request is about, with its hash: that of the participant whose token it
/// carries, else that of new participants. An edited study file changes nothing for participants who have begun.
///
/// # Errors
/// If the database cannot be read.
pub async fn asked_for(
    app: &App,
    study: &StoredStudy,
    headers: &HeaderMap,
) -> Result<(Arc<StudyConfig>, String), ApiError> {
    let participant = visitor(app, headers).await?.map(|visitor| visitor.participant);
    match participant.filter(|participant| participant.study_id == study.id) {
        Some(it) => Ok((app.store.config(&it.config_hash).await?, it.config_hash)),
        None => Ok((Arc::clone(&study.config), study.config_hash.clone())),
    }
}

/// The people who may enrol in a study now.
#[must_use]
pub fn gate(study: &StoredStudy) -> Gate {
    let recruitment = &study.config.recruitment;
    let hold_ms = (recruitment.hold_min * 60_000.0) as i64;
    Gate {
        is_open: study.config.admits(false),
        quota: recruitment.quota,
        away_before_ms: now_ms() - hold_ms,
    }
}

/// The study with this name.
///
/// # Errors
/// 404 if there is none.
pub async fn named(store: &Store, slug: &str) -> Result<StoredStudy, ApiError> {
    store.study(slug).await?.ok_or_else(|| ApiError::not_found("study"))
}
