//! Experimenters, authenticated by cookies or keys, and their access levels.

use crate::http::app::{App, COOKIE};
use crate::http::auth::bearer;
use crate::http::error::ApiError;
use crate::http::openapi::operation::{Input, Operation, Who};
use crate::http::openapi::schemas::Schemas;
use crate::http::peer::{Client, origin};
use crate::store::Store;
use crate::store::audit::NewEntry;
use crate::store::keys::{ENVIRONMENT, Holder, StoredKey};
use crate::support::clock::now_ms;
use crate::support::secrets;
use crate::support::secrets::chosen::ChosenKey;
use axum::body::Body;
use axum::extract::{FromRequestParts, MatchedPath};
use axum::http::{HeaderMap, Method, header, request::Parts};
use futures_util::{StreamExt, stream};
use sidestep::api::{Access, Action};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

/// Minimum interval between two checks of the key during a long response.
const RECHECK: Duration = Duration::from_secs(1);

/// An experimenter with a valid cookie or key.
#[derive(Clone, Debug)]
pub struct Experimenter {
    /// The name of the key, as in the audit trail.
    pub name: String,
    /// The access level of the key.
    pub access: Access,
    /// The number of the key. `None` for the key in the environment variable.
    pub key_id: Option<i64>,
}

/// An experimenter who may read.
pub struct Reader(pub Experimenter);

/// An experimenter who may download data.
pub struct Exporter(pub Experimenter);

/// An experimenter who may change and delete.
pub struct Manager(pub Experimenter);

impl Experimenter {
    /// An audit entry for an action of this experimenter at the present time.
    #[must_use]
    pub fn does(&self, action: Action, study: Option<&str>, subject: Option<String>) -> NewEntry {
        let (who, study) = (self.name.clone(), study.map(str::to_owned));
        NewEntry { at_ms: now_ms(), key_id: self.key_id, who, action, study, subject }
    }

    /// Accepts an experimenter whose key has at least this access level. A refusal is recorded in
    /// the audit trail with the pattern of the route. The URL is not recorded, because it can
    /// contain anything.
    ///
    /// # Errors
    /// 403 `access`.
    pub async fn must(
        &self,
        app: &App,
        needed: Access,
        method: &Method,
        route: Option<&MatchedPath>,
    ) -> Result<(), ApiError> {
        if self.access >= needed {
            return Ok(());
        }
        let what = format!("{method} {}", route.map_or("(none)", MatchedPath::as_str));
        app.store.note_refusal(self.does(Action::Refused, None, Some(what))).await?;
        let [has, needed] = [self.access, needed].map(Access::word);
        let message = format!("this needs a key with the right to {needed}; yours has {has}");
        Err(ApiError::forbidden("access", message))
    }

    /// Completes at most one second after the key is revoked. The key in the environment variable
    /// is valid as long as the server runs.
    pub async fn revoked(self, store: Store) {
        let Some(id) = self.key_id else { return std::future::pending().await };
        let mut commits = store.commits();
        while store.is_valid_key(id).await.unwrap_or(true) {
            tokio::time::sleep(RECHECK).await;
            if commits.changed().await.is_err() {
                return;
            }
        }
    }

    /// The body, which is aborted when the key is revoked.
    pub fn while_valid(self, store: Store, body: Body) -> Body {
        let revoked = Box::pin(self.revoked(store));
        let parts = (body.into_data_stream(), Some(revoked));
        Body::from_stream(stream::unfold(parts, async |(mut body, revoked)| {
            let mut revoked = revoked?;
            tokio::select! {
                biased;
                () = &mut revoked => {
                    Some((Err(axum::Error::new("the key was revoked")), (body, None)))
                }
                part = body.next() => part.map(|part| (part, (body, Some(revoked)))),
            }
        }))
    }

    fn of(holder: Holder) -> Self {
        match holder {
            Holder::Key(StoredKey { id, name, access, .. }) => {
                Self { name, access, key_id: Some(id) }
            }
            Holder::Environment => {
                let name = ENVIRONMENT.to_owned();
                Self { name, access: Access::Manage, key_id: None }
            }
        }
    }
}

impl FromRequestParts<Arc<App>> for Reader {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        admitted(parts, app, Access::Read).await.map(Self)
    }
}

impl FromRequestParts<Arc<App>> for Exporter {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        admitted(parts, app, Access::Export).await.map(Self)
    }
}

impl FromRequestParts<Arc<App>> for Manager {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &Arc<App>) -> Result<Self, ApiError> {
        admitted(parts, app, Access::Manage).await.map(Self)
    }
}

impl Input for Reader {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        needs(operation, Access::Read);
    }
}

impl Input for Exporter {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        needs(operation, Access::Export);
    }
}

impl Input for Manager {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        needs(operation, Access::Manage);
    }
}

fn needs(operation: &mut Operation, access: Access) {
    operation.who = Who::Experimenter(access);
    operation.problems(&["unauthorized", "throttled", "busy", "storage"]);
    if access > Access::Read {
        operation.problems(&["access"]);
    }
}

/// The experimenter of a request. Their key must have at least this access level.
async fn admitted(parts: &Parts, app: &App, needed: Access) -> Result<Experimenter, ApiError> {
    let experimenter = experimenter(parts, app).await?;
    let route = parts.extensions.get::<MatchedPath>();
    experimenter.must(app, needed, &parts.method, route).await?;
    Ok(experimenter)
}

async fn experimenter(parts: &Parts, app: &App) -> Result<Experimenter, ApiError> {
    if let Some(cookie) = session_cookie(&parts.headers)
        && let Some(holder) = session(app, cookie).await?
    {
        return used(app, holder).await;
    }
    let key = bearer(&parts.headers).ok_or_else(ApiError::unauthorized)?;
    let client = parts.extensions.get::<Client>().copied().unwrap_or_default();
    check_key(app, key, client.address).await
}

/// The holder of the key with which a valid session was opened.
async fn session(app: &App, cookie: &str) -> Result<Option<Holder>, ApiError> {
    for (i, hash) in session_hashes(app, cookie).enumerate() {
        let found = app.store.session(hash, now_ms()).await?;
        let is_bound = i > 0;
        // A session of the key in the environment variable is valid only under the hash that
        // depends on this key.
        let fits = |holder: &Holder| matches!(holder, Holder::Environment) == is_bound;
        if let Some(holder) = found.filter(|holder| is_valid(app, holder) && fits(holder)) {
            return Ok(Some(holder));
        }
    }
    Ok(None)
}

/// The hash under which an experimenter's session is stored. If the experimenter has the key in the
/// environment variable, the hash depends on this key. So a server with another key does not accept the
/// session.
#[must_use]
pub fn session_hash(app: &App, me: &Experimenter, cookie: &str) -> [u8; 32] {
    match (&app.environment_key, me.key_id) {
        (Some(key), None) => key.session_hash(cookie),
        _ => secrets::hash(cookie),
    }
}

/// The hashes under which the session with this cookie can be stored.
pub fn session_hashes(app: &App, cookie: &str) -> impl Iterator<Item = [u8; 32]> + use<> {
    let bound = app.environment_key.as_ref().map(|key| key.session_hash(cookie));
    std::iter::once(secrets::hash(cookie)).chain(bound)
}

/// The holder of a key. A correct key is accepted regardless of the number of wrong keys from the same
/// address.
///
/// # Errors
/// 401 for a wrong key, and 429 after too many wrong keys.
pub async fn check_key(app: &App, key: &str, address: IpAddr) -> Result<Experimenter, ApiError> {
    // These keys have 256 random bits and are looked up by their hash. Neither guessing nor timing
    // finds them, so there is no delay.
    match app.store.key(secrets::hash(key)).await?.map(Holder::Key) {
        Some(holder) if is_valid(app, &holder) => return used(app, holder).await,
        // A revoked key does not count as a guess.
        Some(Holder::Key(StoredKey { is_revoked: true, .. })) => {
            return Err(ApiError::unauthorized());
        }
        _ => {}
    }
    let origin = origin(address);
    if let Some(chosen) = &app.environment_key {
        app.guesses.slow_down(origin).await;
        if is_chosen(app, chosen, key, origin).await? {
            return used(app, Holder::Environment).await;
        }
    }
    tracing::warn!("a wrong experimenter's key was sent");
    match app.guesses.count(origin).await {
        Ok(()) => Err(ApiError::unauthorized()),
        Err(wait) => Err(ApiError::Throttled("wrong keys", wait)),
    }
}

/// Whether this is the key in the environment variable.
async fn is_chosen(
    app: &App,
    chosen: &ChosenKey,
    key: &str,
    origin: IpAddr,
) -> Result<bool, ApiError> {
    if let Some(answer) = chosen.compare(key) {
        return Ok(answer);
    }
    // The slow hash is computed on separate threads, a few at a time.
    let (chosen, key) = (chosen.clone(), key.to_owned());
    app.hashing.run(origin, move || chosen.verify(&key)).await
}

/// Whether a known key is valid on this server. The key in the environment variable replaces the first key.
fn is_valid(app: &App, holder: &Holder) -> bool {
    match holder {
        Holder::Key(key) => !key.is_revoked && (!key.is_first || app.environment_key.is_none()),
        Holder::Environment => app.environment_key.is_some(),
    }
}

/// Records the use of a key, at most once a minute.
async fn used(app: &App, holder: Holder) -> Result<Experimenter, ApiError> {
    const MINUTE_MS: i64 = 60_000;
    if let Holder::Key(key) = &holder {
        let now_ms = now_ms();
        // If the clock was set back, later uses must still be recorded.
        let recent = |last_ms: i64| (0..MINUTE_MS).contains(&(now_ms - last_ms));
        if !key.last_used_at_ms.is_some_and(recent) {
            app.store.note_use(key.id, now_ms).await?;
        }
    }
    Ok(Experimenter::of(holder))
}

/// The session's cookie, if the request has one.
#[must_use]
pub fn session_cookie(headers: &HeaderMap) -> Option<&str> {
    headers
        .get_all(header::COOKIE)
        .iter()
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(';'))
        .find_map(|pair| pair.trim().strip_prefix(COOKIE)?.strip_prefix('='))
}

/// Ensures that there is a first key. `make_another` replaces an existing first key. Returns the
/// key if it is new. Only its hash is stored.
///
/// # Errors
/// If the database cannot be written.
pub async fn first_key(store: &Store, make_another: bool) -> Result<Option<String>, ApiError> {
    let key = secrets::token()?;
    let kept = store.put_first_key(secrets::hash(&key), make_another, now_ms()).await?;
    Ok(kept.then_some(key))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cookie_is_found_among_others() {
        let found = |cookies: &str| {
            let headers = [(header::COOKIE, cookies.parse().unwrap())].into_iter().collect();
            session_cookie(&headers).map(str::to_owned)
        };
        assert_eq!(found("a=1; sidestep_session=xyz; b=2").as_deref(), Some("xyz"));
        assert_eq!(found("sidestep_session2=xyz"), None);
    }
}
