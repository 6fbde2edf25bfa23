//! Path and query parameters. Errors name the parameter.

use crate::http::error::ApiError;
use crate::http::openapi::operation::{Input, Operation};
use crate::http::openapi::schemas::Schemas;
use axum::extract::{FromRequestParts, Path, Query};
use axum::http::Uri;
use axum::http::request::Parts;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::Value;
use sidestep::document::from_value;
use sidestep::invalid::Invalid;

/// The single parameter of a route's path.
pub struct PathText(pub String);

impl<S: Send + Sync> FromRequestParts<S> for PathText {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        // No resource has a path with invalid UTF-8.
        Path::<String>::from_request_parts(parts, state)
            .await
            .map(|Path(text)| Self(text))
            .map_err(|_| ApiError::not_found("page or route"))
    }
}

impl Input for PathText {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.problems(&["not_found"]);
    }
}

/// The query, parsed into a `T`.
pub struct Params<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Params<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        Ok(Self(parse(&parts.uri)?))
    }
}

impl<T: JsonSchema> Input for Params<T> {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        operation.query::<T>(schemas);
        operation.problems(&["invalid"]);
    }
}

/// Parses the query of a URL.
///
/// # Errors
/// [`Invalid`] with the name of the invalid parameter.
pub fn parse<T: DeserializeOwned>(uri: &Uri) -> Result<T, Invalid> {
    if let Ok(Query(value)) = Query::<T>::try_from_uri(uri) {
        return Ok(value);
    }
    // Parse the query again as an object, with numbers as numbers, so that the error names the parameter.
    let pairs = Query::<Vec<(String, String)>>::try_from_uri(uri).map(|Query(pairs)| pairs);
    let number = |text: String| text.parse::<i64>().map_or_else(|_| text.into(), Value::from);
    let object = pairs.unwrap_or_default().into_iter().map(|(name, text)| (name, number(text)));
    from_value::<T>(&object.collect())?;
    Err(Invalid::new("query", "each parameter once", "one of them twice"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Deserialize)]
    struct Page {
        limit: Option<u8>,
        order: Order,
        title: Option<String>,
    }

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Order {
        Up,
        Down,
    }

    #[test]
    fn complaints_name_the_parameter() {
        let read = |query: &str| parse::<Page>(&format!("/trials?{query}").parse().unwrap());
        let page = Page { limit: Some(3), order: Order::Up, title: Some("7".to_owned()) };
        assert_eq!(read("limit=3&order=up&title=7"), Ok(page));
        let said = |query: &str| read(query).unwrap_err().to_string();
        assert_eq!(said("order=x"), "order: expected up or down, found \"x\"");
        assert_eq!(said("order=1"), "order: expected up or down, found 1");
        assert_eq!(said("limit=3"), "order: expected a value, found nothing");
        assert_eq!(
            said("limit=many&order=up"),
            "limit: expected a whole number ≥ 0, found \"many\""
        );
        assert_eq!(said("limit=-1&order=up"), "limit: expected a whole number ≥ 0, found -1");
        assert_eq!(
            said("order=up&order=up"),
            "query: expected each parameter once, found one of them twice"
        );
    }
}
