//! Layers around every request: the same-origin check, the rate limit, the limit of the URL length,
//! the timeout, logging, and the headers of every response.

use crate::http::app::App;
use crate::http::auth::bearer;
use crate::http::error::ApiError;
use crate::http::peer::{Client, origin};
use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, Response, StatusCode, header};
use axum::middleware::Next;
use axum::response::IntoResponse;
use std::any::Any;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tracing::Instrument;

/// Timeout until the head of a response. A streamed body may take longer.
const TIME_LIMIT: Duration = Duration::from_secs(30);

const HEADERS: [(HeaderName, &str); 6] = [
    (
        header::CONTENT_SECURITY_POLICY,
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; \
         style-src 'self'; img-src 'self' data:; connect-src 'self'; frame-src 'self'; base-uri 'none'; \
         form-action 'self'; frame-ancestors 'none'",
    ),
    (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (header::REFERRER_POLICY, "no-referrer"),
    (HeaderName::from_static("cross-origin-opener-policy"), "same-origin"),
    // Cross-origin isolated pages have a clock with a higher resolution, which measures the
    // sampling times.
    (HeaderName::from_static("cross-origin-embedder-policy"), "require-corp"),
    (HeaderName::from_static("cross-origin-resource-policy"), "same-origin"),
];

/// A browser that has connected through TLS uses only TLS for one year.
const ENCRYPTED_ONLY: HeaderValue = HeaderValue::from_static("max-age=31536000");

/// Adds the security headers to every response that does not set its own.
pub async fn security_headers(request: Request, next: Next) -> axum::response::Response {
    let is_secure = request.extensions().get::<Client>().is_some_and(|client| client.is_secure);
    let mut answer = next.run(request).await;
    // Only responses with their own policy are allowed in a frame, and only in pages of this site.
    if !answer.headers().contains_key(header::CONTENT_SECURITY_POLICY) {
        answer.headers_mut().insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
    }
    if is_secure {
        answer.headers_mut().insert(header::STRICT_TRANSPORT_SECURITY, ENCRYPTED_ONLY);
    }
    for (name, value) in HEADERS {
        answer.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    }
    answer
}

/// Forbids caching, unless the response sets its own rule.
pub async fn no_store(request: Request, next: Next) -> axum::response::Response {
    let mut answer = next.run(request).await;
    answer
        .headers_mut()
        .entry(header::CACHE_CONTROL)
        .or_insert(HeaderValue::from_static("no-store"));
    answer
}

/// Refuses requests that a page of another site makes a browser send. Programs other than browsers send
/// neither `Sec-Fetch-Site` nor `Origin`. Their requests are accepted, because such programs never send
/// a cookie unintentionally.
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
        let (scheme, authority) = origin.split_once("://").unwrap_or_default();
        matches!(scheme, "http" | "https")
            && !authority.is_empty()
            && text("host") == Some(authority)
    })
}

/// Maximum length of path and query (bytes).
const LONGEST_ADDRESS: usize = 8192;

/// Refuses requests with a URL that is too long.
pub async fn short_address(request: Request, next: Next) -> axum::response::Response {
    let length = request.uri().path_and_query().map_or(0, |it| it.as_str().len());
    if length <= LONGEST_ADDRESS {
        return next.run(request).await;
    }
    let message = format!("expected an address of at most {LONGEST_ADDRESS} bytes, found {length}");
    ApiError::new(StatusCode::URI_TOO_LONG, "long_address", message).into_response()
}

/// Applies the rate limits.
pub async fn paced(
    State(app): State<Arc<App>>,
    request: Request,
    next: Next,
) -> axum::response::Response {
    let client = request.extensions().get::<Client>().copied().unwrap_or_default();
    if !client.is_local {
        let enrols = *request.method() == Method::POST
            && request.uri().path().starts_with("/api/v1/studies/");
        let token = bearer(request.headers());
        if let Err(error) = app.pace.count(origin(client.address), token, enrols).await {
            return error.into_response();
        }
    }
    next.run(request).await
}

/// Cancels a request that takes too long, such as a request with a slow body.
pub async fn time_limit(request: Request, next: Next) -> axum::response::Response {
    tokio::time::timeout(TIME_LIMIT, next.run(request)).await.unwrap_or_else(|_| {
        let message = format!("not done within {} s", TIME_LIMIT.as_secs());
        ApiError::new(StatusCode::REQUEST_TIMEOUT, "timeout", message).into_response()
    })
}

const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// The id of a request, which is in all its log lines and in its response. An id from a trusted
/// proxy is kept, so that the logs of the proxy and of this server have the same id. Otherwise the
/// id is new.
fn request_id(request: &Request) -> String {
    let is_proxied = request.extensions().get::<Client>().is_some_and(|client| client.is_proxied);
    let given = request.headers().get(REQUEST_ID).filter(|_| is_proxied);
    let is_plain = |id: &&str| {
        (1..=64).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-')
    };
    let given = given.and_then(|id| id.to_str().ok()).filter(is_plain);
    given.map_or_else(|| uuid::Uuid::new_v4().simple().to_string(), str::to_owned)
}

/// The name of a method for logs and metrics. All uncommon methods share one name, because a client
/// can invent any number of methods.
fn known(method: &Method) -> &str {
    match *method {
        Method::GET
        | Method::HEAD
        | Method::POST
        | Method::PUT
        | Method::PATCH
        | Method::DELETE
        | Method::OPTIONS => method.as_str(),
        _ => "(other)",
    }
}

/// Counts and logs responses. Logs contain only the route's pattern, because URLs, queries, headers
/// and bodies may contain personal data.
pub async fn measured(
    State(app): State<Arc<App>>,
    request: Request,
    next: Next,
) -> axum::response::Response {
    let begin = Instant::now();
    let method = request.method().clone();
    let route = request.extensions().get::<MatchedPath>().cloned();
    let id = request_id(&request);
    let span = tracing::info_span!("request", id);
    let mut answer = next.run(request).instrument(span.clone()).await;
    if let Ok(id) = HeaderValue::from_str(&id) {
        answer.headers_mut().insert(REQUEST_ID, id);
    }
    let route = route.as_ref().map_or("(none)", MatchedPath::as_str);
    let method = known(&method);
    let (status, took) = (answer.status().as_u16(), begin.elapsed());
    app.metrics.answered(method, route, status, took);
    let ms = took.as_millis();
    span.in_scope(|| match route {
        // Proxies poll these routes every second.
        "/healthz" | "/readyz" if status == 200 => {
            tracing::debug!(method, route, status, ms, "answered")
        }
        _ => tracing::info!(method, route, status, ms, "answered"),
    });
    answer
}

/// The response after a panic of a handler, which is a defect of this program. The server continues.
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
