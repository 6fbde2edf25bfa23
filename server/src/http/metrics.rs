//! Liveness, readiness and metrics for the operator. The metrics reveal how many data a study
//! collects, so only programs on this machine and holders of a key are allowed to read them.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::Reader;
use crate::http::openapi::operation::{Input, Operation};
use crate::http::openapi::schemas::Schemas;
use crate::http::peer::Client;
use axum::Extension;
use axum::extract::{FromRequestParts, State};
use axum::http::{StatusCode, header, request::Parts};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;

/// `GET /healthz`: whether the process responds.
pub async fn healthz() -> String {
    "ok\n".to_owned()
}

/// `GET /readyz`: whether a trial can be stored now. This requires that a write can begin, that
/// there is free space, and that the database file is still the file that was opened. A second line
/// reports faults that the last check found in stored data. These faults do not prevent storing
/// more data. Only programs on this machine get the cause of an error, because the cause can name
/// files and hosts.
pub async fn readyz(
    State(app): State<Arc<App>>,
    client: Option<Extension<Client>>,
) -> Result<String, ApiError> {
    app.store.ready().await.map_err(|error| {
        tracing::error!(%error, "not ready");
        let message = match client {
            Some(Extension(Client { is_local: true, .. })) => error.to_string(),
            _ => "no trial can be stored now; the server's log says why".to_owned(),
        };
        ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "not_ready", message)
    })?;
    let faults = app.data_check.borrow().fault_count;
    Ok(match faults {
        0 => "ready\n".to_owned(),
        _ => format!("ready\nfaults in stored data: {faults}; see 'sidestep check'\n"),
    })
}

/// An experimenter, or a program on this machine that is not a proxy.
pub struct Operator;

impl FromRequestParts<Arc<App>> for Operator {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        if !parts.extensions.get::<Client>().is_some_and(|client| client.is_local) {
            Reader::from_request_parts(parts, app).await?;
        }
        Ok(Self)
    }
}

impl Input for Operator {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.problems(&["unauthorized", "busy", "storage"]);
    }
}

/// `GET /metrics`: the metrics in the text format of OpenMetrics.
pub async fn show(_: Operator, State(app): State<Arc<App>>) -> Result<Response, ApiError> {
    let counts = app.store.counts().await?;
    let data_check = app.data_check.borrow().clone();
    let connections = app.connections.count();
    let backups = app.writes_backups;
    let text = app.metrics.text(&app.store, counts, connections, &data_check, backups);
    let text = text.map_err(|error| ApiError::Internal(error.into()))?;
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    Ok(([(header::CONTENT_TYPE, kind)], text).into_response())
}
