//! Authentication of participants, by their tokens.

use crate::http::app::App;
use crate::http::endings::{check_going_on, newcomers_url};
use crate::http::error::ApiError;
use crate::http::openapi::operation::{Input, Operation, Who};
use crate::http::openapi::schemas::Schemas;
use crate::http::params::PathText;
use crate::store::participants::Visitor;
use crate::store::trials::{AssignedScene, Assignment};
use crate::support::secrets;
use axum::extract::FromRequestParts;
use axum::http::{HeaderMap, header, request::Parts};
use sidestep::api::Admission;
use sidestep::study::{Status, StudyConfig};
use std::sync::Arc;

/// The holder of a valid token whose participation has not ended.
pub struct Me(pub Visitor);

/// Like [`Me`], but the study is not archived, so the holder may write.
pub struct Writer(pub Visitor);

/// The holder of a valid token, even if their participation has ended.
pub struct MeOrGone(pub Visitor);

/// A participant who may write, and the trial in the URL, which must be in their plan. Both are checked
/// before the body is read, so that other clients cannot send a body.
pub struct Assigned {
    /// The participant.
    pub participant_id: String,
    /// The configuration under which the participant enrolled.
    pub config: Arc<StudyConfig>,
    /// The trial.
    pub trial_id: String,
    /// The assigned scene.
    pub scene: AssignedScene,
}

impl FromRequestParts<Arc<App>> for MeOrGone {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        let found = visitor(app, &parts.headers).await?;
        found.map(Self).ok_or_else(ApiError::unauthorized)
    }
}

impl FromRequestParts<Arc<App>> for Me {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        let MeOrGone(visitor) = MeOrGone::from_request_parts(parts, app).await?;
        let config = app.store.config(&visitor.participant.config_hash).await?;
        check_going_on(&config, &visitor.participant)?;
        Ok(Self(visitor))
    }
}

impl FromRequestParts<Arc<App>> for Writer {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        let Me(visitor) = Me::from_request_parts(parts, app).await?;
        check_study(app, &visitor).await?;
        Ok(Self(visitor))
    }
}

impl FromRequestParts<Arc<App>> for Assigned {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        let token = bearer(&parts.headers).ok_or_else(ApiError::unauthorized)?;
        let token = secrets::hash(token);
        let PathText(trial_id) = PathText::from_request_parts(parts, app).await?;
        let found = app.store.assignment(token, &trial_id).await?;
        let Assignment { visitor, config, scene } = found.ok_or_else(ApiError::unauthorized)?;
        check_going_on(&config, &visitor.participant)?;
        check_study(app, &visitor).await?;
        // Another participant's trial gets the same response as a trial that does not exist.
        let scene = scene.ok_or_else(|| ApiError::not_found("trial of yours"))?;
        Ok(Self { participant_id: visitor.participant.id, config, trial_id, scene })
    }
}

impl Input for MeOrGone {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.who = Who::Participant;
        operation.problems(&["unauthorized", "busy", "storage"]);
    }
}

impl Input for Me {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        MeOrGone::describe(operation, schemas);
        operation.problems(&["screened_out", "withdrawn"]);
    }
}

impl Input for Writer {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        Me::describe(operation, schemas);
        operation.problems(&["archived"]);
    }
}

impl Input for Assigned {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        Writer::describe(operation, schemas);
        PathText::describe(operation, schemas);
    }
}

/// The holder of the token in a request. Returns `None` if there is no valid token.
///
/// # Errors
/// If the database cannot be read.
pub async fn visitor(app: &App, headers: &HeaderMap) -> Result<Option<Visitor>, ApiError> {
    let Some(token) = bearer(headers) else { return Ok(None) };
    // Tokens have 256 random bits and are looked up by their hash, so the timing leaks nothing.
    Ok(app.store.visitor(secrets::hash(token)).await?)
}

/// Refuses writes to a study that is now archived.
pub async fn check_study(app: &App, visitor: &Visitor) -> Result<(), ApiError> {
    let present = app.store.config(&visitor.present_config_hash).await?;
    if present.status != Status::Archived {
        return Ok(());
    }
    let me = &visitor.participant;
    let external_id = me.external_id.as_deref().filter(|_| !me.pilot);
    Err(ApiError::archived(newcomers_url(&present, Admission::Archived, external_id)))
}

/// The token or key of a request.
#[must_use]
pub fn bearer(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(token.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(header::HeaderName, &str)]) -> HeaderMap {
        let pair =
            |(name, value): &(header::HeaderName, &str)| (name.clone(), value.parse().unwrap());
        pairs.iter().map(pair).collect()
    }

    #[test]
    fn the_scheme_is_bearer_in_any_case() {
        let value = |text| headers(&[(header::AUTHORIZATION, text)]);
        assert_eq!(bearer(&value("bearer abc")), Some("abc"));
        assert_eq!(bearer(&value("Basic abc")), None);
        assert_eq!(bearer(&value("abc")), None);
    }
}
