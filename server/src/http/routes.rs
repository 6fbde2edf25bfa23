//! The one table of routes.

use crate::http::app::App;
use crate::http::error::ApiError;
use crate::http::site::Site;
use crate::http::{
    analyses, guard, laboratory, metrics, participants, session, site, studies, trials,
    value_functions,
};
use axum::Router;
use axum::http::StatusCode;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::routing::{get, post, put};
use sidestep::api::routes;
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;

/// Every route there is. Addresses come from the shared table with their
/// parameters left open.
pub fn router(app: Arc<App>, site: &Site) -> Router {
    let api = Router::new()
        .route(&routes::study("{slug}"), get(studies::show))
        .route(&routes::participants("{slug}"), post(participants::enrol))
        .route(routes::ME, get(participants::show).delete(participants::withdraw))
        .route(&routes::my_trial("{trial_id}"), put(trials::store))
        .route(routes::COMPLETE, post(participants::complete))
        .route(
            &routes::value_function("{id}"),
            get(value_functions::show).layer(CompressionLayer::new()),
        )
        .route(routes::SESSION, get(session::show).post(session::sign_in).delete(session::sign_out))
        .route(routes::ADMIN_STUDIES, get(laboratory::studies))
        .route(&routes::admin_trials("{slug}"), get(laboratory::trials))
        .route(&routes::admin_trial("{trial_id}"), get(laboratory::trial))
        .route(&routes::admin_predictor("{trial_id}"), get(laboratory::predictor))
        .route(routes::SELF_CHECK, get(laboratory::self_check))
        .route(&routes::exports("{slug}"), get(laboratory::export))
        .route(&routes::admin_analyses("{slug}"), get(analyses::list).post(analyses::ask))
        .route(&routes::admin_analysis("{id}"), get(analyses::show).delete(analyses::delete))
        .route(&routes::cancel_analysis("{id}"), post(analyses::cancel))
        .route(&routes::analysis_file("{id}", "{*name}"), get(analyses::file))
        .route("/healthz", get(metrics::healthz))
        .route("/readyz", get(metrics::readyz))
        .route("/metrics", get(metrics::show))
        .layer(from_fn(guard::no_store));
    // The outermost layer is the last: every answer, also to a panic, is counted,
    // logged and carries the security headers.
    api.merge(site::routes(site))
        .fallback(async || ApiError::not_found("page or route"))
        .method_not_allowed_fallback(method_not_allowed)
        .layer(from_fn(guard::same_site))
        .layer(from_fn(guard::time_limit))
        .layer(CatchPanicLayer::custom(guard::panicked))
        .layer(from_fn_with_state(Arc::clone(&app), guard::observed))
        .layer(from_fn(guard::security_headers))
        .with_state(app)
}

async fn method_not_allowed() -> ApiError {
    let message = "this address has no such method; see Allow";
    ApiError::new(StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed", message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::bounded::Bounded;
    use crate::store::{Missing, Store};
    use axum::body::Body;
    use axum::http::{Request, header};
    use axum::response::Response;
    use sidestep::study::StudyConfig;
    use tempfile::TempDir;
    use tower::ServiceExt;

    /// A server without sockets, whose store and drawing of plans can be held up.
    async fn served(folder: &TempDir, plans_waiting: usize) -> (Store, Router) {
        std::fs::create_dir_all(folder.path().join("assets")).unwrap();
        for page in ["index", "participant", "lab"] {
            std::fs::write(folder.path().join(format!("{page}.html")), "").unwrap();
        }
        let url = format!("sqlite:{}", folder.path().join("test.db").display());
        let store = Store::open(&url, Missing::Create).await.unwrap();
        store.put_study(&StudyConfig::default(), 0).await.unwrap();
        let app = App {
            store: store.clone(),
            default_study: "default".to_owned(),
            environment_key: None,
            throttle: Default::default(),
            drawing: Bounded::new(plans_waiting),
            answers: Default::default(),
            analysis_asked: Arc::default(),
            self_check: Default::default(),
        };
        (store, router(Arc::new(app), &Site::open(folder.path()).unwrap()))
    }

    async fn enrol(router: &Router) -> Response {
        let request = Request::post(routes::participants("default"))
            .header(header::CONTENT_TYPE, "application/json")
            .body(Body::from("{\"consent\":true}"));
        router.clone().oneshot(request.unwrap()).await.unwrap()
    }

    async fn is_busy(router: &Router) {
        let refused = enrol(router).await;
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert_eq!(refused.headers()[header::RETRY_AFTER], "1");
        let body = axum::body::to_bytes(refused.into_body(), 10_000).await.unwrap();
        let problem: sidestep::api::Problem = serde_json::from_slice(&body).unwrap();
        assert_eq!(problem.code, "busy");
    }

    #[tokio::test]
    async fn a_full_queue_of_writes_is_a_503_with_retry_after() {
        let folder = TempDir::new().unwrap();
        let (store, router) = served(&folder, 10).await;
        let held = store.stuffed().await;
        is_busy(&router).await;
        drop(held);
        while store.ready().await.is_err() {
            tokio::task::yield_now().await;
        }
        assert_eq!(store.counts().await, Ok([0, 0]), "who was refused is not there");
        assert_eq!(enrol(&router).await.status(), StatusCode::CREATED);
    }

    #[tokio::test]
    async fn enrolments_beyond_those_that_may_wait_are_a_503_with_retry_after() {
        let folder = TempDir::new().unwrap();
        let (_store, router) = served(&folder, 0).await;
        is_busy(&router).await;
    }
}
