//! The experimenters' keys, and the audit trail.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::experimenters::Manager;
use crate::http::json::JsonBody;
use crate::http::laboratory::{PageParams, page};
use crate::http::params::{Params, PathText};
use crate::store::keys::Revocation;
use crate::support::secrets;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use sidestep::api::{Action, AuditPage, KeyMade, KeySummary, NewKey};
use std::sync::Arc;

/// `GET /api/v1/admin/keys`: all keys, including revoked ones.
pub async fn list(
    Manager(_): Manager,
    State(app): State<Arc<App>>,
) -> Result<Json<Vec<KeySummary>>, ApiError> {
    Ok(Json(app.store.keys().await?))
}

/// `POST /api/v1/admin/keys`: 201 with the new key, which is shown only once.
pub async fn make(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    JsonBody(new): JsonBody<NewKey>,
) -> Result<(StatusCode, Json<KeyMade>), ApiError> {
    new.check()?;
    let secret = secrets::token()?;
    let entry = me.does(Action::KeyMade, None, Some(new.name.clone()));
    let made = app.store.add_key(&new.name, secrets::hash(&secret), new.access, entry).await?;
    let taken = || ApiError::conflict("taken", "another key, perhaps a revoked one, has this name");
    Ok((StatusCode::CREATED, Json(KeyMade { key: made.ok_or_else(taken)?, secret })))
}

/// `DELETE /api/v1/admin/keys/{id}`: 204. The key and its sessions become invalid immediately.
/// Idempotent.
pub async fn revoke(
    Manager(me): Manager,
    State(app): State<Arc<App>>,
    PathText(id): PathText,
) -> Result<StatusCode, ApiError> {
    let unknown = || ApiError::not_found("key");
    let id = id.parse().map_err(|_| unknown())?;
    match app.store.revoke_key(id, me.does(Action::KeyRevoked, None, None)).await? {
        Revocation::Revoked => Ok(StatusCode::NO_CONTENT),
        Revocation::Unknown => Err(unknown()),
        Revocation::First => {
            let message = "the first key is replaced by another start with --new-admin-key";
            Err(ApiError::conflict("first_key", message))
        }
    }
}

/// `GET /api/v1/admin/audit?limit=&before=`: newest first.
pub async fn audit(
    Manager(_): Manager,
    State(app): State<Arc<App>>,
    Params(params): Params<PageParams>,
) -> Result<Json<AuditPage>, ApiError> {
    let (limit, before) = params.checked()?;
    let entries = app.store.audit_page(before, limit + 1).await?;
    let (entries, next_before) = page(entries, limit, |entry| entry.sequence);
    Ok(Json(AuditPage { entries, next_before }))
}
