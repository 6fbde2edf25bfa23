//! The encoded value functions. The content of a URL never changes.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;

const IMMUTABLE: &str = "public, max-age=31536000, immutable";

/// `GET /api/v1/value-functions/{id}`.
pub async fn show(
    State(app): State<Arc<App>>,
    PathText(id): PathText,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let found = app.store.value_function(&id).await?;
    let bytes = found.ok_or_else(|| ApiError::not_found("value function"))?;
    // The ETag is weak, because the same bytes may be sent in several content encodings.
    let tag = format!("W/\"{id}\"");
    let cached = headers
        .get(header::IF_NONE_MATCH)
        .and_then(|value| value.to_str().ok())
        .is_some_and(|tags| tags.contains(&id));
    let fixed = [(header::CACHE_CONTROL, IMMUTABLE.to_owned()), (header::ETAG, tag)];
    if cached {
        return Ok((StatusCode::NOT_MODIFIED, fixed).into_response());
    }
    let kind = [(header::CONTENT_TYPE, "application/octet-stream")];
    Ok((fixed, kind, bytes).into_response())
}
