//! Analyses of a study: requests, progress, cancellation and files. The analysis worker computes them.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::{Manager, Reader};
use crate::http::json::JsonBody;
use crate::http::laboratory::{PageParams, page};
use crate::http::params::{Params, PathText};
use crate::http::studies::named;
use crate::store::analyses::{Asked, LONGEST_QUEUE, StoredAnalysis};
use crate::support::clock::now_ms;
use anyhow::Context;
use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use flate2::read::GzDecoder;
use sidestep::api::{
    Action, AnalysisDetail, AnalysisPage, AnalysisProgress, AnalysisState, AnalysisSummary,
};
use sidestep::comparison::Request;
use std::io::Read;
use std::sync::Arc;
use uuid::Uuid;

/// `POST /api/v1/admin/studies/{slug}/analyses`: 201 for a new analysis, and 200 if an identical
/// request is already queued.
pub async fn ask(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    JsonBody(request): JsonBody<Request>,
) -> Result<(StatusCode, Json<AnalysisSummary>), ApiError> {
    request.settings()?;
    let study = named(&app.store, &slug).await?;
    app.analysis_limits.check(&app.store, &study, &request).await??;
    let id = Uuid::new_v4().to_string();
    let entry = me.does(Action::AnalysisRequested, Some(&slug), Some(id.clone()));
    let (status, asked) = match app.store.ask_analysis(id, study.id, &request, entry).await? {
        Asked::New(asked) => (StatusCode::CREATED, asked),
        Asked::Waiting(asked) => (StatusCode::OK, asked),
        Asked::QueueFull => {
            let message = format!("{LONGEST_QUEUE} analyses are queued already; cancel some");
            return Err(ApiError::conflict("queue_full", message));
        }
    };
    app.analysis_asked.notify_one();
    Ok((status, Json(summary(*asked))))
}

/// `GET /api/v1/admin/studies/{slug}/analyses?limit=&before=`: newest first.
pub async fn list(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(slug): PathText,
    Params(params): Params<PageParams>,
) -> Result<Json<AnalysisPage>, ApiError> {
    let (limit, before) = params.checked()?;
    let study = named(&app.store, &slug).await?;
    let found = app.store.analyses_page(study.id, before, limit + 1).await?;
    let (found, next_before) = page(found, limit, |analysis| analysis.sequence);
    let mut analyses: Vec<AnalysisSummary> = found.into_iter().map(summary).collect();
    // Leave out the accuracies, because each analysis has about fifty. The page of an analysis
    // shows them.
    analyses.iter_mut().filter_map(|of| of.result.as_mut()).for_each(|of| of.accuracies.clear());
    Ok(Json(AnalysisPage { next_before, analyses }))
}

/// `GET /api/v1/admin/analyses/{id}`.
pub async fn show(
    _: Reader,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<Json<AnalysisDetail>, ApiError> {
    let (analysis, files) = app.store.analysis(&id).await?.ok_or_else(unknown)?;
    Ok(Json(AnalysisDetail { summary: summary(analysis), files }))
}

/// `POST /api/v1/admin/analyses/{id}/cancel`: idempotent. 409 if the analysis has already ended without
/// being cancelled.
pub async fn cancel(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<Json<AnalysisSummary>, ApiError> {
    let entry = me.does(Action::AnalysisCancelled, None, Some(id.clone()));
    let now = app.store.cancel_analysis(&id, entry).await?.ok_or_else(unknown)?;
    if now.state == AnalysisState::Cancelled {
        return Ok(Json(summary(now)));
    }
    let message = format!("this analysis has ended: it is {}", now.state.word());
    Err(ApiError::conflict("over", message))
}

/// `DELETE /api/v1/admin/analyses/{id}`: also deletes its files, and cancels a running analysis.
pub async fn delete(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<StatusCode, ApiError> {
    let entry = me.does(Action::AnalysisDeleted, None, Some(id.clone()));
    let deleted = app.store.delete_analysis(&id, entry).await?;
    if deleted { Ok(StatusCode::NO_CONTENT) } else { Err(unknown()) }
}

/// The content security policy of a report. It allows only inline styles and inline images.
const REPORTS_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; \
                              base-uri 'none'; form-action 'none'; frame-ancestors 'self'";

/// `GET /api/v1/admin/analyses/{id}/files/{name}`: a file of an analysis. Browsers show a report, and
/// download any other file.
pub async fn file(
    _: Reader,
    State(app): State<Arc<App>>,
    path: Result<Path<(String, String)>, axum::extract::rejection::PathRejection>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let not_found = || ApiError::not_found("file of an analysis");
    let Path((id, name)) = path.map_err(|_| not_found())?;
    let packed = app.store.analysis_file(&id, &name).await?.ok_or_else(not_found)?;
    let packed_will_do = accepts_gzip(&headers);
    let bytes = match packed_will_do {
        true => packed,
        false => {
            tokio::task::spawn_blocking(move || unpacked(&packed)).await.context("unpacking")??
        }
    };
    let mut answer = bytes.into_response();
    let mut set = |name, value: &str| {
        // This program chose the file name, so the header is valid.
        if let Ok(value) = HeaderValue::from_str(value) {
            answer.headers_mut().insert(name, value);
        }
    };
    set(header::CONTENT_TYPE, media_type(&name));
    set(header::VARY, "accept-encoding");
    if packed_will_do {
        set(header::CONTENT_ENCODING, "gzip");
    }
    if name.ends_with(".html") {
        set(header::CONTENT_SECURITY_POLICY, REPORTS_POLICY);
    } else {
        let last = name.rsplit('/').next().unwrap_or(&name);
        set(header::CONTENT_DISPOSITION, &format!("attachment; filename=\"{last}\""));
    }
    Ok(answer)
}

/// The decompressed bytes of a stored file.
///
/// # Errors
/// If the file is damaged.
pub fn unpacked(packed: &[u8]) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    GzDecoder::new(packed).read_to_end(&mut bytes).context("a file of an analysis")?;
    Ok(bytes)
}

fn accepts_gzip(headers: &HeaderMap) -> bool {
    let codings = headers.get_all(header::ACCEPT_ENCODING).iter();
    let mut codings = codings.filter_map(|value| value.to_str().ok()).flat_map(|v| v.split(','));
    codings.any(|coding| {
        let (name, weight) = coding.split_once(';').unwrap_or((coding, ""));
        let refused = weight.trim().strip_prefix("q=").and_then(|q| q.parse().ok()) == Some(0.0);
        name.trim().eq_ignore_ascii_case("gzip") && !refused
    })
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("csv") => "text/csv; charset=utf-8",
        Some("html") => "text/html; charset=utf-8",
        Some("json") => "application/json",
        Some("tex") => "text/x-tex; charset=utf-8",
        _ => "application/octet-stream",
    }
}

fn unknown() -> ApiError {
    ApiError::not_found("analysis")
}

fn summary(stored: StoredAnalysis) -> AnalysisSummary {
    let running = stored.state == AnalysisState::Running;
    let progress = running.then(|| {
        let (done, of) = (stored.done.unsigned_abs(), stored.of.unsigned_abs());
        let elapsed_ms = stored.started_at_ms.map(|start| (now_ms() - start).max(0));
        // Ignore cached results, because they took no time.
        let left_s = elapsed_ms.filter(|_| stored.fresh > 0).map(|elapsed_ms| {
            1e-3 * elapsed_ms as f64 * of.saturating_sub(done) as f64 / stored.fresh as f64
        });
        AnalysisProgress { done, of, left_s }
    });
    AnalysisSummary {
        id: stored.id,
        study: stored.study,
        request: stored.request,
        state: stored.state,
        progress,
        created_at_ms: stored.created_at_ms,
        started_at_ms: stored.started_at_ms,
        ended_at_ms: stored.ended_at_ms,
        message: stored.message,
        result: stored.result,
        stale: stored.stale,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codings_that_are_refused_are_not_sent() {
        let accepts = |value: &'static str| {
            let headers = [(header::ACCEPT_ENCODING, HeaderValue::from_static(value))];
            accepts_gzip(&headers.into_iter().collect())
        };
        assert!(accepts("gzip"));
        assert!(accepts("br, GZIP;q=0.5"));
        assert!(!accepts("br, gzip;q=0"));
        assert!(!accepts("gzip; q=0.0"));
        assert!(!accepts("identity"));
        assert!(!accepts_gzip(&HeaderMap::new()));
    }
}
