//! Signing in to the laboratory and signing out.

use crate::http::app::{App, COOKIE};
use crate::http::error::ApiError;
use crate::http::experimenters::{
    Experimenter, Reader, check_key, session_cookie, session_hash, session_hashes,
};
use crate::http::json::JsonBody;
use crate::http::peer::Client;
use crate::support::clock::now_ms;
use crate::support::secrets;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, IntoResponseParts, Response};
use axum::{Extension, Json};
use sidestep::api::{Action, Session, SignIn};
use std::sync::Arc;

const LIFETIME_S: i64 = 30 * 24 * 3600;

/// `POST /api/v1/admin/session`: exchanges an experimenter's key for a cookie.
pub async fn sign_in(
    State(app): State<Arc<App>>,
    client: Option<Extension<Client>>,
    JsonBody(body): JsonBody<SignIn>,
) -> Result<Response, ApiError> {
    let client = client.map(|Extension(it)| it).unwrap_or_default();
    let me = check_key(&app, &body.key, client.address).await?;
    let cookie = secrets::token()?;
    let expires_at_ms = now_ms() + LIFETIME_S * 1000;
    let entry = me.does(Action::SignedIn, None, None);
    let hash = session_hash(&app, &me, &cookie);
    app.store.add_session(hash, me.key_id, expires_at_ms, entry).await?;
    Ok((set_cookie(&cookie, LIFETIME_S, client), session(me)).into_response())
}

/// `GET /api/v1/admin/session`: 200 for an experimenter who is signed in.
pub async fn show(Reader(me): Reader) -> Json<Session> {
    session(me)
}

fn session(Experimenter { name, access, .. }: Experimenter) -> Json<Session> {
    Json(Session { signed_in: true, name, access })
}

/// `DELETE /api/v1/admin/session`: invalidates the cookie.
pub async fn sign_out(
    State(app): State<Arc<App>>,
    client: Option<Extension<Client>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    if let Some(cookie) = session_cookie(&headers) {
        for hash in session_hashes(&app, cookie) {
            app.store.end_session(hash).await?;
        }
    }
    let client = client.map(|Extension(it)| it).unwrap_or_default();
    Ok((StatusCode::NO_CONTENT, set_cookie("", 0, client)).into_response())
}

/// The header that sets the cookie. SameSite is Lax, because the sign-in link is opened from a
/// terminal or a mail. The same-origin check protects all requests that change something. A browser
/// that connected through TLS sends the cookie only through TLS.
fn set_cookie(
    value: &str,
    age_s: i64,
    client: Client,
) -> impl IntoResponseParts + IntoResponse + use<> {
    let secure = if client.is_secure { "; Secure" } else { "" };
    let cookie =
        format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Lax; Max-Age={age_s}{secure}");
    AppendHeaders([(header::SET_COOKIE, cookie)])
}
