//! What anyone may know of a study.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use crate::store::Db;
use crate::store::studies::{Study, find};
use axum::Json;
use axum::extract::State;
use sidestep::api::{SCHEMA_VERSION, StudyInfo};
use std::sync::Arc;

/// `GET /api/v1/studies/{slug}`.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
) -> Result<Json<StudyInfo>, ApiError> {
    let study = named(&mut *app.store.reader().await?, &slug).await?;
    Ok(Json(StudyInfo {
        schema_version: SCHEMA_VERSION,
        slug: study.slug,
        title: study.config.title,
        parameters: study.config.parameters,
        phases: study.config.phases,
    }))
}

/// The study of that name.
///
/// # Errors
/// 404 if there is none.
pub async fn named(db: &mut Db, slug: &str) -> Result<Study, ApiError> {
    find(db, slug).await?.ok_or_else(|| ApiError::not_found("study"))
}
