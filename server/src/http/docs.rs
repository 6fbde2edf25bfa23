//! The documentation of all routes, as OpenAPI and as a page.

mod view;

use axum::Extension;
use axum::body::Bytes;
use axum::http::header;
use axum::response::{Html, IntoResponse, Response};
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment};
use serde_json::Value;
use std::sync::Arc;

/// The placeholder in the site's page that the content replaces.
const PLACE: &str = "<!-- The server puts the document here. -->";

/// The documentation in both formats.
#[derive(Clone, Debug)]
pub struct Published {
    json: Bytes,
    page: Bytes,
}

impl Published {
    /// Renders the documentation. `shell` is the documentation page of the site, with a placeholder for
    /// the content.
    ///
    /// # Panics
    /// If the template is invalid, which is a defect of this program.
    #[must_use]
    pub fn of(document: &Value, shell: &str) -> Self {
        let mut templates = Environment::new();
        templates.set_auto_escape_callback(|_| AutoEscape::Html);
        let content = templates
            .render_str(include_str!("docs/page.html"), Serde(view::of(document)))
            .unwrap_or_else(|error| panic!("the template of /api/docs: {error:#}"));
        let page = shell.replacen(PLACE, &content, 1);
        Self { json: document.to_string().into(), page: page.into() }
    }
}

/// `GET /api/openapi.json`.
pub async fn document(Extension(published): Extension<Arc<Published>>) -> Response {
    let kind = [(header::CONTENT_TYPE, "application/json")];
    (kind, published.json.clone()).into_response()
}

/// `GET /api/docs`.
pub async fn page(Extension(published): Extension<Arc<Published>>) -> Response {
    Html(published.page.clone()).into_response()
}
