//! All routes, with the layers around them.

use crate::http::app::App;
use crate::http::docs::Published;
use crate::http::error::ApiError;
use crate::http::hosts::{self, Hosts};
use crate::http::site::Site;
use crate::http::{guard, routes, site};
use axum::http::StatusCode;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::{Extension, Router};
use std::sync::Arc;
use tower_http::catch_panic::CatchPanicLayer;

/// All routes of the interface and all pages, for a server with these host names.
pub fn router(app: Arc<App>, site: &Site, hosts: Hosts) -> Router {
    let (api, document) = routes::table().finished();
    let api = api
        .layer(Extension(Arc::new(Published::of(&document, site.docs()))))
        .layer(from_fn(guard::no_store));
    // The last layer is the outermost. So every response, even after a panic, is counted and logged
    // and has the security headers.
    api.merge(site::routes(site))
        .fallback(async || ApiError::not_found("page or route"))
        .method_not_allowed_fallback(method_not_allowed)
        .layer(from_fn(guard::same_site))
        .layer(from_fn_with_state(Arc::clone(&app), guard::paced))
        .layer(from_fn_with_state(Arc::new(hosts), hosts::known_host))
        .layer(from_fn(guard::short_address))
        .layer(from_fn(guard::time_limit))
        .layer(CatchPanicLayer::custom(guard::panicked))
        .layer(from_fn_with_state(Arc::clone(&app), guard::measured))
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
    use crate::http::bounded::{Bounded, TakingTurns};
    use crate::http::connections::{self, Connections};
    use crate::http::pace::{Guesses, Pace};
    use crate::http::peer::Proxies;
    use crate::jobs::analysis::limits::Limits;
    use crate::languages::Languages;
    use crate::languages::library::Library;
    use crate::metrics::Metrics;
    use crate::store::overview::Counts;
    use crate::store::tests::begun;
    use crate::store::{Purpose, Store};
    use axum::body::Body;
    use axum::http::request::Builder;
    use axum::http::{Request, header};
    use axum::response::Response;
    use serde::de::DeserializeOwned;
    use sidestep::api::{Enrolled, Problem, TrialUpload, routes};
    use sidestep::scene::SceneParameters;
    use sidestep::study::StudyConfig;
    use sidestep::trial::simulate;
    use sidestep::vehicle::TurnInput;
    use std::net::Ipv4Addr;
    use std::sync::mpsc;
    use std::task::Poll;
    use tempfile::TempDir;
    use tokio::sync::{oneshot, watch};
    use tokio::task::JoinSet;
    use tokio_util::sync::CancellationToken;
    use tower::ServiceExt;

    /// A server without sockets. Tests can block its store. At most `plans_waiting` plans wait in
    /// its queue.
    async fn served(folder: &TempDir, plans_waiting: usize) -> (Store, Router) {
        std::fs::create_dir_all(folder.path().join("assets")).unwrap();
        let pages = ["index", "participant", "participant_robots", "lab", "viewer"];
        for page in pages.into_iter().chain(["reachability", "demo", "docs"]) {
            std::fs::write(folder.path().join(format!("{page}.html")), "").unwrap();
        }
        let url = format!("sqlite:{}", folder.path().join("test.db").display());
        let store = Store::open(&url, Purpose::Create).await.unwrap();
        // With one scene, whole classes enrol well within the time limit of a request.
        let mut study = StudyConfig::default();
        study.phases.truncate(1);
        study.phases[0].scenes = 1;
        store.put_study(&study, 0).await.unwrap();
        let app = App {
            store: store.clone(),
            default_study: "default".to_owned(),
            library: Library::new(Languages::load(None).unwrap()),
            environment_key: None,
            pace: Pace::new(&store),
            guesses: Guesses::new(&store),
            drawing: Bounded::new(plans_waiting),
            hashing: TakingTurns::default(),
            metrics: Metrics::new(&store),
            connections: Arc::new(Connections::new(connections::Limits {
                all: 100,
                each: 100,
                body_bytes: 1 << 20,
            })),
            analysis_asked: Arc::default(),
            analysis_limits: Limits { memory_mib: 2048, hours: 24.0, threads: 1 },
            study_stored: Arc::default(),
            self_check: Default::default(),
            data_check: watch::channel(Default::default()).1,
            writes_backups: false,
            lengths: Arc::default(),
            stopping: CancellationToken::new(),
        };
        let hosts = Hosts::new(&[], Ipv4Addr::LOCALHOST.into(), &Proxies::default());
        (store, router(Arc::new(app), &Site::open(folder.path()).unwrap(), hosts))
    }

    async fn send(router: &Router, request: Builder, body: impl Into<Body>) -> Response {
        let request = request
            .header(header::CONTENT_TYPE, "application/json")
            .header(header::HOST, "localhost")
            .body(body.into());
        router.clone().oneshot(request.unwrap()).await.unwrap()
    }

    async fn enrol(router: &Router) -> Response {
        let request = Request::post(routes::participants("default"));
        send(router, request, "{\"consent\":true}").await
    }

    async fn body<T: DeserializeOwned>(response: Response) -> T {
        let bytes = axum::body::to_bytes(response.into_body(), 1_000_000).await.unwrap();
        serde_json::from_slice(&bytes).unwrap()
    }

    async fn is_busy(router: &Router) {
        let refused = enrol(router).await;
        assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert_eq!(refused.headers()[header::RETRY_AFTER], "1");
        assert_eq!(body::<Problem>(refused).await.code, "busy");
    }

    /// A trial that arrives after the enrolments of a whole school class is stored while most
    /// enrolments still wait.
    #[tokio::test]
    async fn a_trial_is_answered_ahead_of_a_class_that_enrols() {
        // As many as one commit takes at most (`OTHERS` of SQLite's writer), so that on a disk of any
        // speed the operation after them runs after the commit of the trial.
        const AHEAD: usize = 64;
        const BEHIND: usize = 80;
        let folder = TempDir::new().unwrap();
        let (store, router) = served(&folder, 1 + AHEAD + BEHIND).await;
        let me: Enrolled = body(enrol(&router).await).await;
        let (_, planned) = me.plan.scenes().next().unwrap();

        let held = store.held().await;
        let mut class = JoinSet::new();
        let begin = |class: &mut JoinSet<StatusCode>, count| {
            for _ in 0..count {
                let router = router.clone();
                class.spawn(async move { enrol(&router).await.status() });
            }
        };
        begin(&mut class, AHEAD);
        store.until_waiting([0, AHEAD]).await;
        // Queue an operation between the enrolments, to block the writer again.
        let (go, wait) = mpsc::channel();
        let (began, again) = oneshot::channel();
        let mut holding = Box::pin(store.hold(began, wait));
        assert!(begun(&mut holding).is_pending());
        begin(&mut class, BEHIND);
        store.until_waiting([0, AHEAD + 1 + BEHIND]).await;
        let parameters = SceneParameters::default();
        let inputs = vec![TurnInput::Left; parameters.steps];
        let upload: TrialUpload = TrialUpload {
            started_at_ms: 1.0,
            states: simulate(&parameters, &planned.scene(), &inputs),
            sampled_at_ms: (0..inputs.len()).map(|step| 200.0 * step as f64).collect(),
            inputs,
            key_events: Vec::new(),
            page_events: Vec::new(),
            exposures: 1,
            display: sidestep::api::Object::default(),
        };
        let request = Request::put(routes::my_trial(&planned.trial_id))
            .header(header::AUTHORIZATION, format!("Bearer {}", me.token));
        let mut trial = Box::pin(send(&router, request, serde_json::to_vec(&upload).unwrap()));
        assert!(begun(&mut trial).is_pending());

        drop(held);
        again.await.unwrap();
        let Poll::Ready(answer) = begun(&mut trial) else { panic!("it waits behind the class") };
        assert_eq!(answer.status(), StatusCode::CREATED);
        let Counts { participants: enrolled, trials, .. } = store.counts().await.unwrap();
        assert!(trials == 1 && enrolled as usize <= 1 + AHEAD, "{enrolled} are enrolled");
        drop(go);
        while let Some(status) = class.join_next().await {
            assert_eq!(status.unwrap(), StatusCode::CREATED);
        }
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
        assert_eq!(store.counts().await, Ok(Counts::default()), "who was refused is not there");
        assert_eq!(enrol(&router).await.status(), StatusCode::CREATED);
    }

    #[tokio::test]
    async fn enrolments_beyond_those_that_may_wait_are_a_503_with_retry_after() {
        let folder = TempDir::new().unwrap();
        let (_store, router) = served(&folder, 0).await;
        is_busy(&router).await;
    }
}
