//! Request bodies. JSON is parsed into a typed value, and an error names the field.

use crate::http::error::ApiError;
use crate::http::openapi::operation::{Input, Operation};
use crate::http::openapi::schemas::Schemas;
use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, Request};
use axum::http::{StatusCode, header};
use futures_util::StreamExt;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use sidestep::api::MAX_BODY_BYTES;
use sidestep::document::{Unread, object_from_json};

/// A request body of type `T`.
///
/// Responds with 415 to another media type or a compressed body, with 413 to a body that is too
/// long, and with 400 to a body that is not JSON (or is nested more than 64 deep). Responds with
/// 422, naming the field, to JSON of another shape or with a number that is out of range.
pub struct JsonBody<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for JsonBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, _: &S) -> Result<Self, ApiError> {
        parse(&body(request).await?).map(Self)
    }
}

/// Reads the bytes of a body whose media type is JSON.
///
/// # Errors
/// 400, 413 or 415, as for [`JsonBody`].
pub async fn body(request: Request) -> Result<Vec<u8>, ApiError> {
    check_headers(&request)?;
    read(request.into_body()).await
}

impl<T: JsonSchema> Input for JsonBody<T> {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        operation.body = Some(schemas.of_request::<T>());
        operation.problems(&[
            "malformed",
            "too_large",
            "content_encoding",
            "content_type",
            "invalid",
        ]);
    }
}

fn check_headers(request: &Request) -> Result<(), ApiError> {
    let unsupported =
        |code, message: &str| Err(ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, code, message));
    let text = |name| request.headers().get(name).map(|v| v.to_str().unwrap_or(""));
    if text(header::CONTENT_ENCODING).is_some_and(|coding| coding != "identity") {
        return unsupported("content_encoding", "send the body as it is, without Content-Encoding");
    }
    let media_type = text(header::CONTENT_TYPE).unwrap_or("");
    let (essence, parameters) = media_type.split_once(';').unwrap_or((media_type, ""));
    if !essence.trim().eq_ignore_ascii_case("application/json") {
        return unsupported("content_type", "send Content-Type: application/json");
    }
    if !parameters.split(';').all(means_utf8) {
        return unsupported("content_type", "send JSON as UTF-8, without another charset");
    }
    let announced = text(header::CONTENT_LENGTH).and_then(|length| length.parse::<u64>().ok());
    if announced.is_some_and(|length| length > MAX_BODY_BYTES as u64) {
        return Err(too_large());
    }
    Ok(())
}

/// Returns false if this parameter of a media type is a charset other than UTF-8.
fn means_utf8(parameter: &str) -> bool {
    let (name, value) = parameter.split_once('=').unwrap_or((parameter, ""));
    !name.trim().eq_ignore_ascii_case("charset")
        || ["utf-8", "utf8"]
            .iter()
            .any(|utf8| value.trim().trim_matches('"').eq_ignore_ascii_case(utf8))
}

fn too_large() -> ApiError {
    let message = format!("a body may have at most {MAX_BODY_BYTES} bytes");
    ApiError::new(StatusCode::PAYLOAD_TOO_LARGE, "too_large", message)
}

/// Reads a body of at most the maximum length, regardless of the length that the headers announce.
async fn read(body: Body) -> Result<Vec<u8>, ApiError> {
    let mut bytes = Vec::new();
    let mut chunks = body.into_data_stream();
    while let Some(chunk) = chunks.next().await {
        let chunk: Bytes = chunk.map_err(|_| ApiError::malformed("the body is incomplete"))?;
        if bytes.len() + chunk.len() > MAX_BODY_BYTES {
            return Err(too_large());
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes)
}

/// Parses one JSON object of type `T`, with nothing after it.
///
/// # Errors
/// 400 or 422, as for [`JsonBody`].
pub fn parse<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ApiError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| ApiError::malformed(format!("the body is not UTF-8: {e}")))?;
    object_from_json(text).map_err(|unread| match unread {
        Unread::NotJson(why) => ApiError::malformed(format!("the body is not JSON: {why}")),
        Unread::Invalid(invalid) => invalid.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::api::{Enrolment, TrialUpload};

    fn check<T: DeserializeOwned>(text: &[u8], status: u16, field: Option<&str>) {
        match parse::<T>(text) {
            Err(ApiError::Problem { status: found, problem }) => {
                assert_eq!(found.as_u16(), status, "{}", problem.message);
                assert_eq!(problem.field.as_deref(), field, "{}", problem.message);
            }
            _ => panic!("no complaint about {}", String::from_utf8_lossy(text)),
        }
    }

    #[test]
    fn complaints_say_where() {
        check::<Enrolment>(b"{", 400, None);
        check::<Enrolment>(b"{\"consent\":true} x", 400, None);
        check::<Enrolment>(b"{\"consent\":tr\xffue}", 400, None);
        check::<Enrolment>(b"{\"consent\":NaN}", 400, None);
        check::<Enrolment>(b"{\"consent\":1}", 422, Some("consent"));
        check::<Enrolment>(b"{\"consent\":true,\"extra\":1}", 422, Some("extra"));
        check::<Enrolment>(b"{}", 422, Some("consent"));
        check::<Enrolment>(b"[]", 422, Some(""));
        check::<Enrolment>(b" [true, null]", 422, Some(""));
        check::<TrialUpload>(b"{\"started_at_ms\":1e999}", 422, Some("started_at_ms"));
        check::<TrialUpload>(b"{\"inputs\":[0,2]}", 422, Some("inputs[1]"));
        let state = b"{\"states\":[{\"human\":[0,0,\"x\"],\"robot\":[0,0,0]}]}";
        check::<TrialUpload>(state, 422, Some("states[0].human[2]"));
        check::<TrialUpload>(&b"[".repeat(100_000), 400, None);
        let nested = [&b"{\"display\":{\"a\":"[..], &b"[".repeat(100_000)].concat();
        check::<TrialUpload>(&nested, 400, None);
    }
}
