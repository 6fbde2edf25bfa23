//! What applies to every request: where it may come from, how long it may take,
//! and what every answer carries.

use crate::http::app::App;
use crate::http::error::ApiError;
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Response, StatusCode, header};
use axum::middleware::Next;
use axum::response::IntoResponse;
use std::any::Any;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest time until the head of an answer, s. Streams may then take longer.
const TIME_LIMIT: Duration = Duration::from_secs(30);

const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; \
         style-src 'self'; img-src 'self' data:; connect-src 'self'; base-uri 'none'; \
         form-action 'self'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    // Isolated pages get the finer clock that sampling times are taken from.
    (HeaderName::from_static("cross-origin-embedder-policy"), "require-corp"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// Adds the security headers to every answer, unless it has its own.
pub async fn security_headers(request: Request, next: Next) -> axum::response::Response {
    let mut answer = next.run(request).await;
    for (name, value) in HEADERS {
        answer.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    }
    answer
}

/// Keeps answers out of caches, unless they say otherwise.
pub async fn no_store(request: Request, next: Next) -> axum::response::Response {
    let mut answer = next.run(request).await;
    answer
        .headers_mut()
        .entry(header::CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-store"));
    answer
}

/// Refuses what another site's page makes a browser send. Programs, which send
/// neither header, are not concerned: they carry no cookie by accident.
pub async fn same_site(request: Request, next: Next) -> axum::response::Response {
    let safe = matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS);
    if safe || is_same_origin(request.headers()) {
        return next.run(request).await;
    }
    let message = "requests from other sites are not accepted";
    ApiError::new(StatusCode::FORBIDDEN, "cross_site", message).into_response()
}

fn is_same_origin(headers: &HeaderMap) -> bool {
    let text = |name: &str| headers.get(name).map(|v| v.to_str().unwrap_or("?"));
    if text("sec-fetch-site").is_some_and(|site| !matches!(site, "same-origin" | "none")) {
        return false;
    }
    text("origin").is_none_or(|origin| {
        let (_, authority) = origin.split_once("://").unwrap_or_default();
        !authority.is_empty() && text("host") == Some(authority)
    })
}

/// Gives up on a request that takes too long, such as a body that trickles in.
pub async fn time_limit(request: Request, next: Next) -> axum::response::Response {
    tokio::time::timeout(TIME_LIMIT, next.run(request)).await.unwrap_or_else(|_| {
        let message = format!("not done within {} s", TIME_LIMIT.as_secs());
        ApiError::new(StatusCode::REQUEST_TIMEOUT, "timeout", message).into_response()
    })
}

/// Counts and logs. Only the route's pattern is logged: addresses, queries,
/// headers and bodies can hold what is nobody's business.
pub async fn observed(
    State(app): State<Arc<App>>,
    request: Request,
    next: Next,
) -> axum::response::Response {
    let begin = Instant::now();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().cloned();
    let answer = next.run(request).await;
    app.answers.count(answer.status());
    let route = route.as_ref().map_or("(none)", MatchedPath::as_str);
    let (status, ms) = (answer.status().as_u16(), begin.elapsed().as_millis());
    tracing::info!(%method, route, status, ms, "request");
    answer
}

/// A handler panicked: our own fault, and the server goes on.
pub fn panicked(cause: Box<dyn Any + Send + 'static>) -> Response<axum::body::Body> {
    let cause = cause
        .downcast_ref::<&str>()
        .map(|text| (*text).to_owned())
        .or_else(|| cause.downcast_ref::<String>().cloned())
        .unwrap_or_default();
    ApiError::Internal(anyhow::anyhow!("a handler panicked: {cause}")).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(pairs: &[(&'static str, &str)], accepted: bool) {
        let mut headers = HeaderMap::new();
        headers.insert("host", HeaderValue::from_static("lab.example:8080"));
        for (name, value) in pairs {
            headers.insert(*name, value.parse().unwrap());
        }
        assert_eq!(is_same_origin(&headers), accepted, "{pairs:?}");
    }

    #[test]
    fn only_the_own_origin_and_programs() {
        check(&[], true);
        check(&[("origin", "http://lab.example:8080")], true);
        check(&[("origin", "https://lab.example:8080")], true);
        check(&[("sec-fetch-site", "same-origin")], true);
        check(&[("origin", "http://lab.example")], false);
        check(&[("origin", "http://evil.example:8080")], false);
        check(&[("origin", "null")], false);
        check(&[("sec-fetch-site", "cross-site")], false);
        check(&[("sec-fetch-site", "same-site")], false);
    }
}
