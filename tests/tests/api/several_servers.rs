//! Several servers on one PostgreSQL database. A run on SQLite ignores these tests: a second server is refused
//! there (`trouble::one_server_a_database`).

use futures_util::future::join_all;
use reqwest::Method;
use sidestep::api::{AnalysisDetail, AnalysisState, AnalysisSummary, routes};
use sidestep_tests::postgres::{Cluster, Fsync, Stop};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server, behind, driven};
use std::time::{Duration, Instant};

/// Two servers on one new database.
async fn two() -> [Server; 2] {
    let one = Server::with_study(SHORT_STUDY).await;
    let hint = "needs PostgreSQL: cargo xtask test --postgres -- --test api -- --include-ignored";
    assert!(one.database().starts_with("postgres:"), "{hint}");
    let two = one.beside().await;
    [one, two]
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn servers_on_one_database_are_as_one() {
    let [one, two] = two().await;
    let servers = [&one, &two];
    let driver = Driver::enrol(&one).await;
    for (i, (id, scene)) in driver.scenes().iter().enumerate() {
        let trial = driven(scene);
        let sent = join_all((0..20).map(|k| driver.send(servers[(i + k) % 2], id, &trial))).await;
        let stored = sent.iter().filter(|answer| answer.status == 201).count();
        assert_eq!(stored, 1, "of twenty copies one is stored");
        assert!(sent.iter().all(|answer| [200, 201].contains(&answer.status)));
    }
    assert_eq!(driver.complete(&two).await.status, 200);

    // Whoever enrols at once, at either, has a number and a place of their own.
    join_all((0..20).map(|i| Driver::enrol(servers[i % 2]))).await;
    let numbers = "SELECT number FROM participant ORDER BY number";
    let numbers: Vec<i64> = behind(&one.database()).rows(numbers, |row| row.get(0)).unwrap();
    assert_eq!(numbers, (1..=21).collect::<Vec<_>>());
    let places = "SELECT place FROM participant WHERE holds_place ORDER BY place";
    let places: Vec<i64> = behind(&one.database()).rows(places, |row| row.get(0)).unwrap();
    assert_eq!(places, (0..21).collect::<Vec<_>>());

    // One of them is gone: the other goes on.
    one.stop().await;
    let late = Driver::enrol(&two).await;
    late.drive(&two, 5).await;
    assert_eq!(late.complete(&two).await.status, 200);
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn an_analysis_is_computed_by_one_server_and_taken_over_from_a_lost_one() {
    let [one, two] = two().await;
    Driver::enrol(&one).await.drive(&one, 5).await;
    // As if a server had begun it and was gone since.
    let asked = one.request(Method::POST, &routes::admin_analyses("default"));
    let asked = asked.bearer_auth(&one.key).json(&serde_json::json!({}));
    let asked: AnalysisSummary = Answer::of(asked).await.into(201);
    let begun = Instant::now();
    let over = loop {
        let now: AnalysisDetail = two.admin(&routes::admin_analysis(&asked.id)).await.into(200);
        if now.summary.state.is_over() {
            break now.summary;
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "{now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    // Three tasks are too few to compare models: it ends with a sentence, and by one attempt.
    assert!([AnalysisState::Done, AnalysisState::Failed].contains(&over.state));
    let attempts = "SELECT attempts FROM analysis";
    let attempts: i64 = behind(&one.database()).query_row(attempts, [], |row| row.get(0)).unwrap();
    assert_eq!(attempts, 1);
    let lost = "UPDATE analysis SET state = 'running', worker = 'lost', lease_until_ms = 1, \
                ended_at_ms = NULL, message = NULL, result = NULL";
    behind(&one.database()).execute_batch(lost).unwrap();
    loop {
        let now: AnalysisDetail = two.admin(&routes::admin_analysis(&asked.id)).await.into(200);
        if now.summary.state.is_over() {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(120), "{now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let attempts = "SELECT attempts FROM analysis";
    let attempts: i64 = behind(&one.database()).query_row(attempts, [], |row| row.get(0)).unwrap();
    assert_eq!(attempts, 2, "one server took it over");
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_database_that_is_killed_and_back_loses_nothing() {
    let start = || (Cluster::start(Fsync::On), ());
    let (mut cluster, ()) = tokio::task::spawn_blocking(start).await.unwrap();
    let database = cluster.create();
    let server = Server::on(database.url(), Some(SHORT_STUDY)).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    let (id, scene) = &scenes[0];
    assert_eq!(driver.send(&server, id, &driven(scene)).await.status, 201);
    for (stop, (id, scene)) in
        [Stop::Fast, Stop::Immediate, Stop::Kill].into_iter().zip(&scenes[1..])
    {
        cluster.stop(stop);
        assert_eq!(driver.send(&server, id, &driven(scene)).await.status, 503);
        server.get("/readyz").await.problem(503, "not_ready", None);
        cluster.start_again();
        let begun = Instant::now();
        while driver.send(&server, id, &driven(scene)).await.status != 201 {
            assert!(begun.elapsed() < Duration::from_secs(10), "{stop:?}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    let stored = "SELECT count(*) FROM trial";
    let stored: i64 = behind(&database.url()).query_row(stored, [], |row| row.get(0)).unwrap();
    assert_eq!(stored, 4);
    server.stop().await;
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_guesser_gains_nothing_from_several_servers() {
    let servers = two().await;
    let guess = async |i: usize| {
        let request = servers[i % 2].request(Method::POST, routes::SESSION);
        let request = request.json(&serde_json::json!({ "key": "guess" }));
        request.send().await.unwrap().status().as_u16()
    };
    for i in 0..10 {
        assert_eq!(guess(i).await, 401);
    }
    assert_eq!([guess(0).await, guess(1).await], [429; 2]);
    // Nobody who has the right key waits for that, at either.
    for server in &servers {
        assert_eq!(server.admin(routes::ADMIN_STUDIES).await.status, 200);
    }
}
