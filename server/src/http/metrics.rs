//! Liveness, readiness and counts for the operator of the server.

use crate::http::app::App;
use crate::http::error::ApiError;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::fmt::Write;
use std::sync::Arc;

/// `GET /healthz`: the process answers.
pub async fn healthz() -> &'static str {
    "ok\n"
}

/// `GET /readyz`: whether a trial can be stored now: a write can begin, there is free space, and the file
/// is the one that was opened.
pub async fn readyz(State(app): State<Arc<App>>) -> Result<&'static str, ApiError> {
    app.store.ready().await.map_err(|error| {
        tracing::error!(%error, "not ready");
        ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "not_ready", error.to_string())
    })?;
    Ok("ready\n")
}

/// `GET /metrics`: Prometheus text.
pub async fn show(State(app): State<Arc<App>>) -> Result<Response, ApiError> {
    let [participants, trials] = app.store.counts().await?;
    let gauges = [
        ("sidestep_participants", "Participants enrolled or imported.", participants),
        ("sidestep_trials_stored", "Trials in the database.", trials),
    ];
    let mut text = String::new();
    for (name, help, value) in gauges {
        let _ = write!(text, "# HELP {name} {help}\n# TYPE {name} gauge\n{name} {value}\n");
    }
    let name = "sidestep_http_requests_total";
    let _ =
        write!(text, "# HELP {name} Requests answered since the start.\n# TYPE {name} counter\n");
    for (status, count) in app.answers.by_status() {
        let _ = writeln!(text, "{name}{{status=\"{status}\"}} {count}");
    }
    let kind = "text/plain; version=0.0.4; charset=utf-8";
    Ok(([(header::CONTENT_TYPE, kind)], text).into_response())
}
