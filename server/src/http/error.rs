//! The error type of all handlers, and its response body.

use crate::http::throttle::seconds;
use crate::store::StoreError;
use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use sidestep::api::Problem;
use sidestep::invalid::Invalid;
use std::time::Duration;

/// The reason why a request failed.
#[derive(Debug, thiserror::Error)]
pub enum ApiError {
    /// The client can correct the request.
    #[error("{status}: {}", problem.message)]
    Problem {
        /// Status of the response.
        status: StatusCode,
        /// Body of the response.
        problem: Problem,
    },
    /// The request was rate-limited. The client may retry after this time.
    #[error("too many {0}")]
    Throttled(&'static str, Duration),
    /// The store is temporarily unavailable. The client may retry.
    #[error("{0}")]
    Unavailable(StoreError),
    /// A defect of this program. It is logged, and never sent.
    #[error("{0:#}")]
    Internal(#[from] anyhow::Error),
}

impl ApiError {
    /// A response with this status, a stable code, and a message.
    pub fn new(status: StatusCode, code: &str, message: impl Into<String>) -> Self {
        let (code, message) = (code.to_owned(), message.into());
        Self::Problem { status, problem: Problem { code, message, field: None, return_url: None } }
    }

    /// The message to the client.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self {
            Self::Problem { problem, .. } => problem.message.clone(),
            other => other.to_string(),
        }
    }

    /// 400 `malformed`: the body is not valid JSON.
    pub fn malformed(message: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "malformed", message)
    }

    /// 401 `unauthorized`. The response does not reveal the reason.
    #[must_use]
    pub fn unauthorized() -> Self {
        let message = "this needs a valid token or key";
        Self::new(StatusCode::UNAUTHORIZED, "unauthorized", message)
    }

    /// 404 `not_found`.
    #[must_use]
    pub fn not_found(what: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, "not_found", format!("there is no such {what}"))
    }

    /// 409 with this code.
    pub fn conflict(code: &str, message: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, code, message)
    }

    /// 403 with this code.
    pub fn forbidden(code: &str, message: impl Into<String>) -> Self {
        Self::new(StatusCode::FORBIDDEN, code, message)
    }

    /// 403: the token was given to a client that only knew the external id.
    #[must_use]
    pub fn not_yours() -> Self {
        let message = "use the browser in which you began or your personal link, or ask the \
                       researchers";
        Self::forbidden("not_yours", message)
    }

    /// 410: the study is archived. Participants are sent to this return link.
    #[must_use]
    pub fn archived(return_url: Option<String>) -> Self {
        let message = "this study is over; nothing more is stored";
        Self::ended(StatusCode::GONE, "archived", message, return_url)
    }

    /// 403: the study admits no new participants. They are sent to this return link.
    #[must_use]
    pub fn no_admission(code: &str, message: &str, return_url: Option<String>) -> Self {
        Self::ended(StatusCode::FORBIDDEN, code, message, return_url)
    }

    /// 410: the comprehension check ended the participation. The participant is sent to this return link.
    #[must_use]
    pub fn screened_out(return_url: Option<String>) -> Self {
        let message = "this participation has ended: the answers about the instructions were wrong \
                       too often";
        Self::ended(StatusCode::GONE, "screened_out", message, return_url)
    }

    /// 410: the participant has withdrawn, and is sent to this return link.
    #[must_use]
    pub fn withdrawn(return_url: Option<String>) -> Self {
        let message = "this participation was withdrawn; nothing more is stored";
        Self::ended(StatusCode::GONE, "withdrawn", message, return_url)
    }

    fn ended(status: StatusCode, code: &str, message: &str, return_url: Option<String>) -> Self {
        let (code, message) = (code.to_owned(), message.to_owned());
        let problem = Problem { code, message, field: None, return_url };
        Self::Problem { status, problem }
    }
}

impl From<Invalid> for ApiError {
    /// 422 naming the field.
    fn from(invalid: Invalid) -> Self {
        let message = format!("expected {}, found {}", invalid.expected, invalid.found);
        let (code, field) = ("invalid".to_owned(), Some(invalid.field));
        let problem = Problem { code, message, field, return_url: None };
        Self::Problem { status: StatusCode::UNPROCESSABLE_ENTITY, problem }
    }
}

impl From<StoreError> for ApiError {
    /// Temporary faults and faults that the operator can repair, such as a full disk, become a 503,
    /// so that the client keeps its data and retries. All other faults are defects of this program.
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Revoked => Self::unauthorized(),
            // The operator must repair a damaged file. Browsers keep their data until then.
            error if error.is_temporary() || matches!(error, StoreError::Corrupt(_)) => {
                Self::Unavailable(error)
            }
            error => Self::Internal(error.into()),
        }
    }
}

/// Value of `Retry-After` for a 503 (s). A full queue empties quickly, and a full disk does not.
fn retry_after_s(error: &StoreError) -> u64 {
    if *error == StoreError::Busy { 1 } else { 5 }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        match self {
            Self::Problem { status, problem } => {
                let mut answer = (status, Json(problem)).into_response();
                if status == StatusCode::UNAUTHORIZED {
                    let scheme = HeaderValue::from_static("Bearer");
                    answer.headers_mut().insert(header::WWW_AUTHENTICATE, scheme);
                }
                answer
            }
            Self::Throttled(what, wait) => {
                let seconds = seconds(wait);
                let message = format!("too many {what}; try again in {seconds} s");
                let status = StatusCode::TOO_MANY_REQUESTS;
                let mut answer = Self::new(status, "throttled", message).into_response();
                answer.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(seconds));
                answer
            }
            Self::Unavailable(error) => {
                const LATER: &str = "nothing was stored, try again later";
                let (code, message) = match error {
                    StoreError::Busy => ("busy", format!("too many requests are waiting; {LATER}")),
                    StoreError::Corrupt(_) => {
                        let advice = "run 'sidestep check' on the server";
                        (
                            "storage",
                            format!(
                                "the database is damaged, and the server cannot read what this request needs; {advice}"
                            ),
                        )
                    }
                    _ => ("storage", format!("the server cannot store anything now; {LATER}")),
                };
                tracing::warn!(%error, "answered with 503");
                let status = StatusCode::SERVICE_UNAVAILABLE;
                let mut answer = Self::new(status, code, message).into_response();
                let seconds = HeaderValue::from(retry_after_s(&error));
                answer.headers_mut().insert(header::RETRY_AFTER, seconds);
                answer
            }
            Self::Internal(error) => {
                tracing::error!("internal error: {error:#}");
                let message = "something went wrong here; it was logged";
                let status = StatusCode::INTERNAL_SERVER_ERROR;
                Self::new(status, "internal", message).into_response()
            }
        }
    }
}
