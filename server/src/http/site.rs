//! The client bundle: pages that are not cached, and assets whose names change with their content.

use crate::http::app::App;
use axum::Router;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::get;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tower_http::services::{ServeDir, ServeFile};

/// A folder with a client bundle.
#[derive(Clone, Debug)]
pub struct Site {
    folder: PathBuf,
    docs: String,
}

const PAGES: [&str; 4] = ["index.html", "participant.html", "lab.html", "docs.html"];

impl Site {
    /// The bundle in `folder`.
    ///
    /// # Errors
    /// If a page is missing: one line that states what to do.
    pub fn open(folder: &Path) -> Result<Self, String> {
        if PAGES.iter().all(|page| folder.join(page).is_file()) {
            let page = folder.join("docs.html");
            let docs = std::fs::read_to_string(&page);
            let docs = docs.map_err(|error| format!("{}: {error}", page.display()))?;
            return Ok(Self { folder: folder.to_owned(), docs });
        }
        let folder = folder.display();
        Err(format!("no client bundle in {folder}: run 'cargo xtask build' or pass --static DIR"))
    }
}

impl Site {
    /// The page of the documentation, without its content.
    #[must_use]
    pub fn docs(&self) -> &str {
        &self.docs
    }
}

/// The default folder of the bundle: `site` beside the executable.
#[must_use]
pub fn default_folder() -> PathBuf {
    let executable = std::env::current_exe().unwrap_or_default();
    executable.with_file_name("site")
}

/// Routes of the pages and assets, with precompressed variants if they exist.
pub fn routes(site: &Site) -> Router<Arc<App>> {
    let page =
        |name: &str| ServeFile::new(site.folder.join(name)).precompressed_br().precompressed_gzip();
    let pages = Router::new()
        .route_service("/", page("index.html"))
        .route_service("/s/{slug}", page("participant.html"))
        .route_service("/lab", page("lab.html"))
        .route_service("/lab/{*rest}", page("lab.html"))
        .layer(from_fn(ask_again));
    let assets = ServeDir::new(site.folder.join("assets"))
        .append_index_html_on_directories(false)
        .precompressed_br()
        .precompressed_gzip();
    let assets = Router::new().nest_service("/assets", assets).layer(from_fn(keep_forever));
    let icon = site.folder.join("favicon.svg");
    let icon = if icon.is_file() {
        Router::new().route_service("/favicon.ico", ServeFile::new(icon))
    } else {
        Router::new().route("/favicon.ico", get(async || StatusCode::NO_CONTENT))
    };
    pages.merge(assets).merge(icon).route("/start", get(start))
}

/// `GET /start`: redirects to this server's default study.
async fn start(State(app): State<Arc<App>>) -> Redirect {
    Redirect::to(&format!("/s/{}", app.default_study))
}

async fn ask_again(request: Request, next: Next) -> Response {
    with_cache_control(next.run(request).await, "no-cache")
}

/// Only existing assets may be cached for ever: a name that is missing during a deployment may exist
/// later.
async fn keep_forever(request: Request, next: Next) -> Response {
    let answer = next.run(request).await;
    match answer.status() {
        status if status.is_success() => {
            with_cache_control(answer, "public, max-age=31536000, immutable")
        }
        StatusCode::NOT_FOUND => crate::http::error::ApiError::not_found("file").into_response(),
        _ => answer,
    }
}

fn with_cache_control(mut answer: Response, value: &'static str) -> Response {
    answer.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static(value));
    answer
}
