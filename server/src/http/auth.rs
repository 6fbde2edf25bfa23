//! Authentication: participants by token, experimenters by key or cookie.

use crate::clock::now_ms;
use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::listen::Client;
use crate::http::params::PathText;
use crate::secrets;
use crate::store::Store;
use crate::store::participants::Visitor;
use crate::store::trials::{AssignedScene, Assignment};
use axum::extract::FromRequestParts;
use axum::http::{HeaderMap, header, request::Parts};
use sidestep::study::{Status, StudyConfig};
use std::net::{IpAddr, Ipv4Addr};
use std::sync::Arc;
use subtle::ConstantTimeEq;

/// The cookie of the laboratory.
pub const COOKIE: &str = "sidestep_session";

/// The holder of a valid token whose participation goes on.
pub struct Me(pub Visitor);

/// As [`Me`], in a study that is not archived: whoever may write.
pub struct Writer(pub Visitor);

/// The holder of a valid token, whether their participation goes on or not.
pub struct MeOrGone(pub Visitor);

/// Whoever may write, and the trial that the address names. The trial is in the participant's plan. It is
/// extracted before the body is read, so nobody else can send a body.
pub struct Assigned {
    /// The participant.
    pub participant_id: String,
    /// The configuration of their enrolment.
    pub config: Arc<StudyConfig>,
    /// The trial.
    pub trial_id: String,
    /// The scene that was assigned.
    pub scene: AssignedScene,
}

/// An experimenter with a valid cookie or key.
pub struct Admin;

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
        check_going_on(&visitor)?;
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
        check_going_on(&visitor)?;
        check_study(app, &visitor).await?;
        // The answer for another participant's trial is that for one that does not exist.
        let scene = scene.ok_or_else(|| ApiError::not_found("trial of yours"))?;
        Ok(Self { participant_id: visitor.participant.id, config, trial_id, scene })
    }
}

/// The holder of the token that a request carries, if it is valid.
///
/// # Errors
/// If the database cannot be read.
pub async fn visitor(app: &App, headers: &HeaderMap) -> Result<Option<Visitor>, ApiError> {
    let Some(token) = bearer(headers) else { return Ok(None) };
    // The time to look up a hash of 256 random bits reveals nothing.
    Ok(app.store.visitor(secrets::hash(token)).await?)
}

/// Refuses participants who have withdrawn or were screened out.
fn check_going_on(visitor: &Visitor) -> Result<(), ApiError> {
    let participant = &visitor.participant;
    match (participant.withdrawn_at_ms, participant.screened_out) {
        (Some(_), _) => Err(ApiError::withdrawn()),
        (None, true) => Err(ApiError::screened_out()),
        (None, false) => Ok(()),
    }
}

/// Refuses writing to a study that is archived now.
pub async fn check_study(app: &App, visitor: &Visitor) -> Result<(), ApiError> {
    let present = app.store.config(&visitor.present_config_hash).await?;
    if present.status == Status::Archived { Err(ApiError::archived()) } else { Ok(()) }
}

impl FromRequestParts<Arc<App>> for Admin {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        if let Some(cookie) = session_cookie(&parts.headers)
            && app.store.has_session(secrets::hash(cookie), now_ms()).await?
        {
            return Ok(Self);
        }
        let key = bearer(&parts.headers).ok_or_else(ApiError::unauthorized)?;
        let client = parts.extensions.get::<Client>().copied();
        check_key(app, key, address(client)).await?;
        Ok(Self)
    }
}

/// The address of the client, for the throttle.
#[must_use]
pub fn address(client: Option<Client>) -> IpAddr {
    client.map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |client| client.0)
}

/// Accepts the experimenter's key.
///
/// # Errors
/// 401 for a wrong key, 429 after too many of them.
pub async fn check_key(app: &App, key: &str, address: IpAddr) -> Result<(), ApiError> {
    if let Some(seconds) = app.throttle.wait_s(address) {
        return Err(ApiError::Throttled(seconds));
    }
    let presented = secrets::hash(key);
    let valid = match app.environment_key {
        Some(hash) => vec![hash.to_vec()],
        None => app.store.keys().await?,
    };
    if valid.iter().any(|hash| bool::from(hash.ct_eq(&presented))) {
        return Ok(());
    }
    app.throttle.failed(address);
    tracing::warn!("a wrong experimenter's key was sent");
    Err(ApiError::unauthorized())
}

/// The session's cookie, if the request carries one.
#[must_use]
pub fn session_cookie(headers: &HeaderMap) -> Option<&str> {
    headers
        .get_all(header::COOKIE)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(';'))
        .find_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='))
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(header::AUTHORIZATION)?.to_str().ok()?;
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(token.trim())
}

/// Makes sure that there is a key. Returns it if it is new: later, only its hash is known.
///
/// # Errors
/// If the database cannot be written.
pub async fn first_key(store: &Store, make_another: bool) -> Result<Option<String>, ApiError> {
    let key = secrets::token()?;
    let kept = store.put_key(secrets::hash(&key), make_another, now_ms()).await?;
    Ok(kept.then_some(key))
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
    fn the_cookie_is_found_among_others() {
        let cookies = headers(&[(header::COOKIE, "a=1; sidestep_session=xyz; b=2")]);
        assert_eq!(session_cookie(&cookies), Some("xyz"));
        let other = headers(&[(header::COOKIE, "sidestep_session2=xyz")]);
        assert_eq!(session_cookie(&other), None);
    }

    #[test]
    fn the_scheme_is_bearer_in_any_case() {
        let value = |text| headers(&[(header::AUTHORIZATION, text)]);
        assert_eq!(bearer(&value("bearer abc")), Some("abc"));
        assert_eq!(bearer(&value("Basic abc")), None);
        assert_eq!(bearer(&value("abc")), None);
    }
}
