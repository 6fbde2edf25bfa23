//! Parts of addresses: what does not parse is answered like everything else.

use crate::http::error::ApiError;
use axum::extract::{FromRequestParts, Path, Query};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;
use sidestep::invalid::Invalid;

/// The one open part of a route's address.
pub struct PathText(pub String);

impl<S: Send + Sync> FromRequestParts<S> for PathText {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        // An address that is not UTF-8 names nothing.
        Path::<String>::from_request_parts(parts, state)
            .await
            .map(|Path(text)| Self(text))
            .map_err(|_| ApiError::not_found("page or route"))
    }
}

/// The query, as a `T`.
pub struct Params<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Params<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        Query::<T>::from_request_parts(parts, state).await.map(|Query(value)| Self(value)).map_err(
            |rejection| {
                // The text begins with "Failed to deserialize query string: FIELD: …".
                let text = rejection.body_text();
                let mut parts = text.splitn(3, ": ").skip(1);
                let (field, found) = match (parts.next(), parts.next()) {
                    (Some(field), Some(found)) => (field.to_owned(), found.to_owned()),
                    _ => ("query".to_owned(), text.clone()),
                };
                Invalid::new(field, "a query as documented", found).into()
            },
        )
    }
}
