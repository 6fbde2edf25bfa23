//! The client bundle. Pages are revalidated at every request. Assets are cached, because their
//! names change with their content. The home page lists the open studies.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::params::PathText;
use crate::http::studies::gate;
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn};
use axum::response::{Html, IntoResponse, Redirect, Response};
use axum::routing::get;
use axum::{Extension, Router};
use minijinja::{AutoEscape, Environment, context};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tower::ServiceExt as _;
use tower_http::services::{ServeDir, ServeFile};

/// A folder with a client bundle.
#[derive(Clone, Debug)]
pub struct Site {
    folder: PathBuf,
    home: String,
    docs: String,
    /// Whether the demonstration is open to everyone.
    demo_is_open: bool,
}

const PAGES: [&str; 8] = [
    "index.html",
    "participant.html",
    "participant_robots.html",
    "lab.html",
    "viewer.html",
    "reachability.html",
    "demo.html",
    "docs.html",
];

impl Site {
    /// The bundle in `folder`.
    ///
    /// # Errors
    /// If a page is missing. The error is one line and contains advice.
    pub fn open(folder: &Path) -> Result<Self, String> {
        if PAGES.iter().all(|page| folder.join(page).is_file()) {
            let read = |name: &str| {
                let page = folder.join(name);
                let text = std::fs::read_to_string(&page);
                text.map_err(|error| format!("{}: {error}", page.display()))
            };
            let (home, docs) = (read("index.html")?, read("docs.html")?);
            return Ok(Self { folder: folder.to_owned(), home, docs, demo_is_open: false });
        }
        let folder = folder.display();
        Err(format!("no client bundle in {folder}: run 'cargo xtask build' or pass --static DIR"))
    }
}

impl Site {
    /// Opens the demonstration at `/demo` to everyone, if `is_open`.
    #[must_use]
    pub fn with_demo(self, is_open: bool) -> Self {
        Self { demo_is_open: is_open, ..self }
    }

    /// The documentation page, without its content.
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

/// Routes of pages and assets. Precompressed variants are served if they exist.
pub fn routes(site: &Site) -> Router<Arc<App>> {
    let page =
        |name: &str| ServeFile::new(site.folder.join(name)).precompressed_br().precompressed_gzip();
    let both = ["participant.html", "participant_robots.html"].map(page);
    let first = Home { page: site.home.as_str().into(), demo_is_open: site.demo_is_open };
    let mut pages = Router::new()
        .route("/", get(home).layer(Extension(first)))
        .route("/s/{slug}", get(participant).layer(Extension(Participant(both))))
        .route_service("/lab", page("lab.html"))
        .route_service("/lab/{*rest}", page("lab.html"))
        .route_service("/lab/replay/{id}", page("viewer.html"))
        .route_service("/lab/explorer/{id}", page("viewer.html"))
        .route_service("/lab/reachability", page("reachability.html"))
        .route_service("/lab/demo", page("demo.html"));
    if site.demo_is_open {
        pages = pages.route_service("/demo", page("demo.html"));
    }
    let pages = pages.layer(from_fn(ask_again));
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

/// The participant's page, without and with the rules of robots.
#[derive(Clone)]
struct Participant([ServeFile; 2]);

/// `GET /s/{slug}`: the page that can move the study's robots. A page that cannot is a third smaller.
async fn participant(
    State(app): State<Arc<App>>,
    Extension(Participant([usual, with_robots])): Extension<Participant>,
    PathText(slug): PathText,
    request: Request,
) -> Response {
    // The page itself reports a study that does not exist or cannot be read.
    let named = app.store.has_named_robots(&slug).await.unwrap_or_default();
    let page = if named { with_robots } else { usual };
    match page.oneshot(request).await {
        Ok(response) => response.into_response(),
        Err(never) => match never {},
    }
}

/// The home page, without the list of studies.
#[derive(Clone)]
struct Home {
    page: Arc<str>,
    /// Whether the demonstration is open to everyone.
    demo_is_open: bool,
}

/// Placeholder for the list of studies in the home page.
const OPEN_STUDIES: &str = "<!-- The server puts the open studies here. -->";

/// `GET /`: lists the studies that are open to everyone, this server's default study first.
async fn home(State(app): State<Arc<App>>, Extension(first): Extension<Home>) -> Response {
    let Home { page, demo_is_open } = first;
    let mut studies = Vec::new();
    for slug in app.store.slugs().await.unwrap_or_default() {
        // A study that cannot be read admits no one. The other studies are still listed.
        let Ok(Some(study)) = app.store.study(&slug).await else { continue };
        let config = &study.config;
        let for_everybody = config.admits(false) && !config.recruitment.require_external_id;
        if for_everybody && app.store.is_full(study.id, gate(&study)).await.is_ok_and(|full| !full)
        {
            studies.push(context! { slug => study.slug.clone(), title => config.title.clone() });
        }
    }
    let is_default = |study: &minijinja::Value| {
        study.get_attr("slug").is_ok_and(|slug| slug.as_str() == Some(&app.default_study))
    };
    studies.sort_by_key(|study| !is_default(study));
    let mut templates = Environment::new();
    templates.set_auto_escape_callback(|_| AutoEscape::Html);
    let template = include_str!("site/studies.html");
    match templates.render_str(template, context! { studies, demo_is_open }) {
        Ok(studies) => Html(page.replacen(OPEN_STUDIES, &studies, 1)).into_response(),
        Err(error) => ApiError::Internal(error.into()).into_response(),
    }
}

/// `GET /start`: redirects to this server's default study.
async fn start(State(app): State<Arc<App>>) -> Redirect {
    Redirect::to(&format!("/s/{}", app.default_study))
}

async fn ask_again(request: Request, next: Next) -> Response {
    with_cache_control(next.run(request).await, "no-cache")
}

/// Only existing assets may be cached forever. An asset that is missing during a deployment may
/// exist later.
async fn keep_forever(request: Request, next: Next) -> Response {
    let answer = next.run(request).await;
    match answer.status() {
        status if status.is_success() => {
            with_cache_control(answer, "public, max-age=31536000, immutable")
        }
        StatusCode::NOT_FOUND => ApiError::not_found("file").into_response(),
        _ => answer,
    }
}

fn with_cache_control(mut answer: Response, value: &'static str) -> Response {
    answer.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static(value));
    answer
}
