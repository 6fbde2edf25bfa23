//! The public part of a study.

use crate::clock::now_ms;
use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use crate::store::Store;
use crate::store::enrolments::Gate;
use crate::store::studies::StoredStudy;
use axum::Json;
use axum::extract::State;
use sidestep::api::{Admission, StudyInfo};
use sidestep::study::Status;
use std::sync::Arc;

/// `GET /api/v1/studies/{slug}`.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<StudyInfo>, ApiError> {
    let study = named(&app.store, &slug).await?;
    let mut admission = study.config.status.into();
    if admission == Admission::Open && app.store.is_full(study.id, gate(&study)).await? {
        admission = Admission::Full;
    }
    Ok(Json(StudyInfo::of(&study.config, admission)))
}

/// Who may enrol in a study now.
#[must_use]
pub fn gate(study: &StoredStudy) -> Gate {
    let recruitment = &study.config.recruitment;
    let hold_ms = (recruitment.hold_min * 60_000.0) as i64;
    Gate {
        is_open: study.config.status == Status::Open,
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
