//! The laboratory: routes for experimenters and operators.

use reqwest::Method;
use serde_json::json;
use sidestep::api::{SelfCheck, StudySummary, TrainedPredictor, TrialDetail, TrialPage, routes};
use sidestep::predict::{ModelFile, Predictor};
use sidestep::reachability::ValueFunction;
use sidestep::scene::Evader;
use sidestep::trial::{outcome, simulation_fingerprint};
use sidestep::vehicle::TurnInput;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server, upload};

#[tokio::test]
async fn signing_in_and_out() {
    let server = Server::with_study(SHORT_STUDY).await;
    let request = |method, route| server.request(method, route);
    assert_eq!(Answer::of(request(Method::GET, routes::SESSION)).await.status, 401);
    let wrong = request(Method::POST, routes::SESSION).json(&json!({ "key": "guess" }));
    Answer::of(wrong).await.problem(401, "unauthorized", None);
    let right = request(Method::POST, routes::SESSION).json(&json!({ "key": server.key }));
    let answer = right.send().await.unwrap();
    assert_eq!(answer.status(), 200);
    let cookie = answer.headers()["set-cookie"].to_str().unwrap().to_owned();
    for part in ["HttpOnly", "SameSite=Lax", "Path=/", "Max-Age=2592000"] {
        assert!(cookie.contains(part), "{cookie}");
    }
    assert!(!cookie.contains(&server.key));
    let kept = cookie.split(';').next().unwrap();
    let with_cookie = |method, route| request(method, route).header("cookie", kept);
    assert_eq!(Answer::of(with_cookie(Method::GET, routes::SESSION)).await.status, 200);
    assert_eq!(Answer::of(with_cookie(Method::GET, routes::ADMIN_STUDIES)).await.status, 200);
    let out = with_cookie(Method::DELETE, routes::SESSION).send().await.unwrap();
    assert_eq!(out.status(), 204);
    let removed = out.headers()["set-cookie"].to_str().unwrap();
    assert!(removed.contains("Max-Age=0") && removed.contains("Path=/"), "{removed}");
    // After sign-out, a copy of the cookie is worthless.
    for route in [routes::SESSION, routes::ADMIN_STUDIES] {
        assert_eq!(Answer::of(with_cookie(Method::GET, route)).await.status, 401);
    }
}

#[tokio::test]
async fn every_laboratory_route_wants_a_key() {
    let server = Server::with_study(SHORT_STUDY).await;
    for route in [
        routes::ADMIN_STUDIES.to_owned(),
        routes::admin_study("default"),
        routes::CHANGES.to_owned(),
        routes::admin_trials("default"),
        routes::admin_trial("x"),
        routes::admin_predictor("x"),
        routes::SELF_CHECK.to_owned(),
        routes::DATA_CHECK.to_owned(),
        routes::exports("default"),
        routes::SESSION.to_owned(),
        routes::ADMIN_KEYS.to_owned(),
        routes::AUDIT.to_owned(),
        routes::admin_participants("default"),
    ] {
        server.get(&route).await.problem(401, "unauthorized", None);
    }
    for route in [
        routes::admin_study("nothing"),
        routes::admin_trials("nothing"),
        routes::admin_trial("x"),
        routes::admin_predictor("x"),
        routes::exports("nothing"),
    ] {
        server.admin(&route).await.problem(404, "not_found", None);
    }
    let format = format!("{}?format=xlsx", routes::exports("default"));
    let answer = server.admin(&format).await;
    assert!(answer.problem(422, "invalid", Some("format")).contains("csv"));
    for query in ["limit=0", "limit=501", "limit=x"] {
        let route = format!("{}?{query}", routes::admin_trials("default"));
        server.admin(&route).await.problem(422, "invalid", Some("limit"));
    }
}

#[tokio::test]
async fn trials_newest_first_page_by_page_and_whole() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let sent = driver.drive(&server, 5).await;
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    assert_eq!((studies[0].participants, studies[0].trials), (1, 5));
    assert_eq!(studies[0].title, "Short");

    let mut seen = Vec::new();
    let mut before = String::new();
    loop {
        let route = format!("{}?limit=2{before}", routes::admin_trials("default"));
        let page: TrialPage = server.admin(&route).await.into(200);
        seen.extend(page.trials.into_iter().map(|trial| trial.trial_id));
        let Some(next) = page.next_before else { break };
        before = format!("&before={next}");
    }
    let newest_first: Vec<_> = sent.iter().rev().map(|(id, _)| id.clone()).collect();
    assert_eq!(seen, newest_first);

    let (id, trial) = &sent[3];
    let detail: TrialDetail = server.admin(&routes::admin_trial(id)).await.into(200);
    assert_eq!(detail.inputs, trial.inputs);
    assert_eq!(detail.states, trial.states);
    assert!(detail.replay.exact);
    assert_eq!(detail.replay.max_position_error_m, 0.0);
    assert_eq!(detail.summary.flags, []);
    assert_eq!(detail.scene, driver.scenes()[3].1);
    assert_eq!(detail.summary.outcome, outcome(&detail.parameters, &trial.inputs, &trial.states));
    assert_eq!((detail.states.len(), detail.inputs.len()), (51, 50));

    let address = routes::value_function(detail.value_function(Evader::Human).unwrap());
    let answer = server.request(Method::GET, &address).send().await.unwrap();
    let cache = answer.headers()["cache-control"].to_str().unwrap();
    assert_eq!(cache, "public, max-age=31536000, immutable");
    let tag = answer.headers()["etag"].clone();
    let function = ValueFunction::decode(&answer.bytes().await.unwrap()).unwrap();
    let exact = detail.parameters.game(Evader::Human).exact().unwrap();
    assert_eq!(function, ValueFunction::Exact(exact));
    assert_eq!(detail.value_function_rh.as_deref(), Some(function.id().as_str()));
    let again = server.request(Method::GET, &address).header("if-none-match", tag);
    assert_eq!(Answer::of(again).await.status, 304);
    let packed = server.request(Method::GET, &address).header("accept-encoding", "br");
    assert_eq!(packed.send().await.unwrap().headers()["content-encoding"], "br");
}

#[tokio::test]
async fn a_predictor_learns_from_what_came_before() {
    let study = "phases = [{ phase = \"task\", scenes = 7 }]";
    let server = Server::with_study(study).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    for (i, (id, scene)) in scenes.iter().enumerate() {
        let mut inputs = vec![TurnInput::Straight; 50];
        let turn = [TurnInput::Left, TurnInput::Right][i % 2];
        inputs[8 + i..20 + i].fill(turn);
        driver.send(&server, id, &upload(scene, inputs)).await;
    }
    let predictor = async |i: usize| -> TrainedPredictor {
        server.admin(&routes::admin_predictor(&scenes[i].0)).await.into(200)
    };
    let first = predictor(0).await;
    let constant =
        |trained: &TrainedPredictor| matches!(trained.predictor.model, ModelFile::Constant(_));
    assert!(first.trials == 0 && constant(&first));
    assert!(first.fallback.is_some());
    assert!(constant(&predictor(4).await));
    let sixth = predictor(6).await;
    assert_eq!((sixth.trials, sixth.fallback), (6, None));
    assert_eq!(sixth.predictor.classes, [-1, 0, 1]);
    assert_eq!(sixth.predictor.features.len(), 8);
    Predictor::try_from(sixth.predictor).unwrap();
}

#[tokio::test]
async fn the_self_check_is_the_librarys() {
    let server = Server::with_study(SHORT_STUDY).await;
    let check: SelfCheck = server.admin(routes::SELF_CHECK).await.into(200);
    assert_eq!((check.seed, check.trials), (20_180_918, 10_000));
    let here = simulation_fingerprint(check.seed, check.trials);
    assert_eq!(check.fingerprint, here);
}

#[tokio::test]
async fn the_operators_routes() {
    let server = Server::with_study(SHORT_STUDY).await;
    Driver::enrol(&server).await.drive(&server, 2).await;
    for route in ["/healthz", "/readyz"] {
        assert_eq!(server.get(route).await.status, 200, "{route}");
    }
    let request = server.request(Method::GET, "/metrics");
    let text = request.send().await.unwrap().text().await.unwrap();
    for line in [
        "sidestep_participants 1",
        "sidestep_trials_stored 2",
        "sidestep_http_requests_total{status=\"201\"} 3",
        "sidestep_http_request_seconds_count{method=\"PUT\",route=\"/api/v1/participants/me/trials/{trial_id}\"} 2",
        "sidestep_backlog_trials 0",
        "sidestep_store_waiting{lane=\"trial\"} 0",
        "sidestep_analyses{state=\"queued\"} 0",
    ] {
        assert!(text.lines().any(|l| l == line), "{line} in\n{text}");
    }
    let value = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.unwrap_or_else(|| panic!("{name} in\n{text}")).parse::<f64>().unwrap()
    };
    assert!(value("sidestep_commit_writes_sum") >= 3.0);
    assert!(value("process_resident_memory_bytes") > 1e6);
    assert!(value("sidestep_connections_open") >= 1.0);
    assert!(text.ends_with("# EOF\n"));
}

#[tokio::test]
async fn a_new_key_ends_the_old_one_and_its_sessions() {
    let server = Server::with_study(SHORT_STUDY).await;
    let link = format!("{}/lab#key={}", server.origin, server.key);
    assert!(server.announcement().contains(&link), "{}", server.announcement());
    let old = server.key.clone();
    let sign_in = server.request(Method::POST, routes::SESSION);
    let answer = sign_in.json(&json!({ "key": old })).send().await.unwrap();
    let cookie = answer.headers()["set-cookie"].clone();

    let server = server.restarted_with(None, |args| args.new_admin_key = true).await;
    assert_ne!(server.key, old);
    assert_eq!(server.admin(routes::ADMIN_STUDIES).await.status, 200);
    let with_old = server.request(Method::GET, routes::ADMIN_STUDIES).bearer_auth(&old);
    assert_eq!(Answer::of(with_old).await.status, 401);
    let with_cookie = server.request(Method::GET, routes::ADMIN_STUDIES).header("cookie", cookie);
    assert_eq!(Answer::of(with_cookie).await.status, 401);
}

#[tokio::test]
async fn a_key_from_the_environment_is_the_only_one() {
    let server = Server::with_study(SHORT_STUDY).await;
    let made = server.key.clone();
    let server = server.restarted_with(Some("sixteen letters!"), |_| ()).await;
    assert_eq!(server.admin(routes::ADMIN_STUDIES).await.status, 200);
    assert!(!server.announcement().contains("#key="));
    let with_made = server.request(Method::GET, routes::ADMIN_STUDIES).bearer_auth(&made);
    assert_eq!(Answer::of(with_made).await.status, 401);
}

/// Trials are ordered by participant and then by the plan. Pilots have their own order.
#[tokio::test]
async fn a_trial_knows_the_trials_before_and_after_it() {
    let server = Server::with_study(SHORT_STUDY).await;
    let mut ids = Vec::new();
    for trials in [2, 0, 1] {
        let driver = Driver::enrol(&server).await;
        ids.extend(driver.drive(&server, trials).await.into_iter().map(|(id, _)| id));
    }
    let mut found = Vec::new();
    for id in &ids {
        let trial: TrialDetail = server.admin(&routes::admin_trial(id)).await.into(200);
        found.push((trial.previous, trial.next));
    }
    let id = |place: usize| Some(ids[place].clone());
    assert_eq!(found, [(None, id(1)), (id(0), id(2)), (id(1), None)]);
}
