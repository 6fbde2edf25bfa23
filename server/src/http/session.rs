//! Signing in to the laboratory and signing out.

use crate::clock::now_ms;
use crate::http::app::{App, COOKIE};
use crate::http::error::ApiError;
use crate::http::experimenters::{Experimenter, Reader, address, check_key, session_cookie};
use crate::http::json::JsonBody;
use crate::http::listen::Client;
use crate::secrets;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, IntoResponseParts, Response};
use axum::{Extension, Json};
use sidestep::api::{Action, Session, SignIn};
use std::sync::Arc;

const LIFETIME_S: i64 = 30 * 24 * 3600;

/// `POST /api/v1/admin/session`: takes an experimenter's key, sets a cookie.
pub async fn sign_in(
    State(app): State<Arc<App>>,
    client: Option<Extension<Client>>,
    JsonBody(body): JsonBody<SignIn>,
) -> Result<Response, ApiError> {
    let me = check_key(&app, &body.key, address(client.map(|Extension(it)| it))).await?;
    let cookie = secrets::token()?;
    let expires_at_ms = now_ms() + LIFETIME_S * 1000;
    let entry = me.does(Action::SignedIn, None, None);
    app.store.add_session(secrets::hash(&cookie), me.key_id, expires_at_ms, entry).await?;
    Ok((set_cookie(&cookie, LIFETIME_S), session(me)).into_response())
}

/// `GET /api/v1/admin/session`: 200 for an experimenter who is signed in.
pub async fn show(Reader(me): Reader) -> Json<Session> {
    session(me)
}

fn session(Experimenter { name, access, .. }: Experimenter) -> Json<Session> {
    Json(Session { signed_in: true, name, access })
}

/// `DELETE /api/v1/admin/session`: the cookie becomes invalid.
pub async fn sign_out(
    State(app): State<Arc<App>>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    if let Some(cookie) = session_cookie(&headers) {
        app.store.end_session(secrets::hash(cookie)).await?;
    }
    Ok((StatusCode::NO_CONTENT, set_cookie("", 0)).into_response())
}

/// SameSite is Lax, because the sign-in link is opened from a terminal or a mail. The origin check
/// protects requests that change anything.
fn set_cookie(value: &str, age_s: i64) -> impl IntoResponseParts + IntoResponse + use<> {
    let cookie = format!("{COOKIE}={value}; Path=/; HttpOnly; SameSite=Lax; Max-Age={age_s}");
    AppendHeaders([(header::SET_COOKIE, cookie)])
}
