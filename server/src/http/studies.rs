//! The public part of a study.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use crate::store::Store;
use crate::store::studies::StoredStudy;
use axum::Json;
use axum::extract::State;
use sidestep::api::{SCHEMA_VERSION, StudyInfo};
use std::sync::Arc;

/// `GET /api/v1/studies/{slug}`.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<StudyInfo>, ApiError> {
    let study = named(&app.store, &slug).await?;
    Ok(Json(StudyInfo {
        schema_version: SCHEMA_VERSION,
        slug: study.slug,
        title: study.config.title.clone(),
        parameters: study.config.parameters,
        phases: study.config.phases.clone(),
        admission: study.config.status.into(),
        trials: study.config.trials,
        comprehension_attempts: study.config.comprehension.attempts,
        external_id_parameters: study.config.recruitment.external_id.clone(),
        recorded_parameters: study.config.recruitment.record.clone(),
    }))
}

/// The study with this name.
///
/// # Errors
/// 404 if there is none.
pub async fn named(store: &Store, slug: &str) -> Result<StoredStudy, ApiError> {
    store.study(slug).await?.ok_or_else(|| ApiError::not_found("study"))
}
