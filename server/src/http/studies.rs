//! The public part of a study.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use crate::store::Store;
use crate::store::studies::StoredStudy;
use axum::Json;
use axum::extract::State;
use sidestep::api::StudyInfo;
use std::sync::Arc;

/// `GET /api/v1/studies/{slug}`.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<StudyInfo>, ApiError> {
    let study = named(&app.store, &slug).await?;
    Ok(Json(StudyInfo::of(&study.config, study.config.status.into())))
}

/// The study with this name.
///
/// # Errors
/// 404 if there is none.
pub async fn named(store: &Store, slug: &str) -> Result<StoredStudy, ApiError> {
    store.study(slug).await?.ok_or_else(|| ApiError::not_found("study"))
}
