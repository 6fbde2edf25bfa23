//! Several servers on one PostgreSQL database. These tests are skipped on SQLite, because a SQLite
//! database accepts only one server (`trouble::one_server_a_database`).

use futures_util::future::join_all;
use rcgen::{CertificateParams, KeyPair};
use reqwest::Method;
use sidestep::api::{AnalysisDetail, AnalysisState, AnalysisSummary, Progress, routes};
use sidestep_tests::front::free_port;
use sidestep_tests::postgres::{Cluster, Fsync, Stop};
use sidestep_tests::process::{Said, binary};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Database, Driver, Folder, Process, Server, behind, driven};
use std::time::{Duration, Instant};

/// Starts two servers on one new database.
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

    // Concurrent enrolments at both servers get unique numbers and places.
    join_all((0..20).map(|i| Driver::enrol(servers[i % 2]))).await;
    let numbers = "SELECT number FROM participant ORDER BY number";
    let numbers: Vec<i64> = behind(&one.database()).rows(numbers, |row| row.get(0)).await.unwrap();
    assert_eq!(numbers, (1..=21).collect::<Vec<_>>());
    let places = "SELECT place FROM participant WHERE holds_place ORDER BY place";
    let places: Vec<i64> = behind(&one.database()).rows(places, |row| row.get(0)).await.unwrap();
    assert_eq!(places, (0..21).collect::<Vec<_>>());

    // When one server stops, the other server continues.
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
    // Wait until one analysis has ended. Then change its row as if a server had started it and
    // died.
    let asked = one.request(Method::POST, &routes::admin_analyses("default"));
    let asked = asked.bearer_auth(&one.key).json(&serde_json::json!({}));
    let asked: AnalysisSummary = Answer::of(asked).await.into(201);
    let begun = Instant::now();
    let over = loop {
        let now: AnalysisDetail = two.admin(&routes::admin_analysis(&asked.id)).await.into(200);
        if now.summary.state.is_over() {
            break now.summary;
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "{now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    // Three tasks are too few to compare models, so the analysis ends with a message after one
    // attempt.
    assert!([AnalysisState::Done, AnalysisState::Failed].contains(&over.state));
    let attempts = "SELECT attempts FROM analysis";
    let attempts: i64 = behind(&one.database()).row(attempts, |row| row.get(0)).await.unwrap();
    assert_eq!(attempts, 1);
    let lost = "UPDATE analysis SET state = 'running', worker = 'lost', lease_until_ms = 1, \
                ended_at_ms = NULL, message = NULL, result = NULL";
    behind(&one.database()).execute(lost).await.unwrap();
    loop {
        let now: AnalysisDetail = two.admin(&routes::admin_analysis(&asked.id)).await.into(200);
        if now.summary.state.is_over() {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "{now:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let attempts = "SELECT attempts FROM analysis";
    let attempts: i64 = behind(&one.database()).row(attempts, |row| row.get(0)).await.unwrap();
    assert_eq!(attempts, 2, "one server took it over");
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_database_that_is_killed_and_back_loses_nothing() {
    let mut cluster = Cluster::new(Fsync::On).await;
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
    let stored: i64 = behind(&database.url()).row(stored, |row| row.get(0)).await.unwrap();
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
    // Users with the right key do not have to wait at either server.
    for server in &servers {
        assert_eq!(server.admin(routes::ADMIN_STUDIES).await.status, 200);
    }
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_standby_takes_over_and_has_everything() {
    let ports = [free_port(), free_port()];
    let both = move || {
        let primary = Cluster::at_port(ports[0]);
        let standby = primary.standby(ports[1]);
        (primary, standby)
    };
    let (mut primary, standby) = tokio::task::spawn_blocking(both).await.unwrap();
    let database = primary.create().url();
    let name = database.split(['/', '?']).nth(3).unwrap();
    let hosts = ports.map(|port| format!("127.0.0.1:{port}")).join(",");
    let url = format!("postgres://app@{hosts}/{name}");
    let server = Server::on(url, Some(SHORT_STUDY)).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    for (id, scene) in &scenes[..2] {
        assert_eq!(driver.send(&server, id, &driven(scene)).await.status, 201);
    }
    primary.stop(Stop::Kill);
    let (id, scene) = &scenes[2];
    // Until the standby is promoted, nothing is stored and nothing is acknowledged.
    let refused = driver.send(&server, id, &driven(scene)).await;
    assert_eq!(refused.status, 503, "{}", refused.body);
    standby.promote();
    let begun = Instant::now();
    while driver.send(&server, id, &driven(scene)).await.status != 201 {
        assert!(begun.elapsed() < Duration::from_secs(10), "the server finds the new primary");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert_eq!(server.get("/readyz").await.status, 200);
    for (id, scene) in &scenes[..3] {
        let again = driver.send(&server, id, &driven(scene)).await;
        assert_eq!(again.status, 200, "stored before: {}", again.body);
    }
    let new = Database::Postgres(standby.url(name));
    assert_eq!(new.number("SELECT count(*) FROM trial").await, 3);

    // The old primary is not fenced. It comes back at the first address in the list and accepts
    // writes without waiting for a standby, and all sessions are terminated.
    let primary = tokio::task::spawn_blocking(move || {
        primary.settings.push("synchronous_standby_names=".to_owned());
        primary.start_again();
        primary
    });
    let mut primary = primary.await.unwrap();
    let end = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity \
               WHERE application_name = 'sidestep'";
    assert_ne!(new.number(end).await, 0);
    let (id, scene) = &scenes[3];
    let begun = Instant::now();
    loop {
        let answer = driver.send(&server, id, &driven(scene)).await;
        match answer.status {
            201 => break,
            status => assert_eq!(status, 503, "{}", answer.body),
        }
        assert!(begun.elapsed() < Duration::from_secs(10), "the server stays at the new primary");
    }
    assert_eq!(new.number("SELECT count(*) FROM trial").await, 4);
    assert_eq!(Database::Postgres(primary.url(name)).number("SELECT count(*) FROM trial").await, 2);
    // After a restart, the server still uses the new primary, not the old one.
    let server = server.restarted().await;
    assert_eq!(driver.me(&server).await.into::<Progress>(200).stored.len(), 4);
    // If the new primary is down, the server refuses to use the old primary, and clients get the
    // reason.
    let mut standby = standby;
    standby.stop(Stop::Kill);
    let ready = server.get("/readyz").await;
    let why = ready.problem(503, "not_ready", None);
    assert!(why.contains("old primary") && why.contains("Fence it"), "{why}");
    driver.me(&server).await.problem(503, "storage", None);
    server.stop().await;
    primary.stop(Stop::Kill);
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_database_is_reached_by_tls_and_a_password() {
    let folder = Folder::default();
    let key = KeyPair::generate().unwrap();
    let params = CertificateParams::new(vec!["localhost".to_owned()]).unwrap();
    let certificate = params.self_signed(&key).unwrap().pem();
    let other = params.self_signed(&KeyPair::generate().unwrap()).unwrap().pem();
    let (trusted, other) = (folder.file("cert.pem", &certificate), folder.file("other.pem", other));
    let port = free_port();
    let pem = key.serialize_pem();
    let start = move || (Cluster::encrypted("swordfish", port, &certificate, &pem), ());
    let (cluster, ()) = tokio::task::spawn_blocking(start).await.unwrap();
    let Database::Postgres(local) = cluster.create() else { panic!("a database of PostgreSQL") };
    let name = local.split(['/', '?']).nth(3).unwrap();
    let url = |root: &str| {
        format!("postgres://app@localhost:{port}/{name}?sslmode=require&sslrootcert={root}")
    };
    let environment = ["env", "PGPASSWORD=swordfish"];
    let server = Process::start_through(&environment, &folder, &url(&trusted)).await;
    Driver::enrol(&server).await;
    let mine = "SELECT count(*) FROM pg_stat_ssl JOIN pg_stat_activity USING (pid) \
                WHERE application_name LIKE 'sidestep%' AND ssl = ";
    let database = Database::Postgres(local.clone());
    assert_eq!(database.number(&format!("{mine} FALSE")).await, 0);
    assert!(database.number(&format!("{mine} TRUE")).await > 0);
    server.kill().await;

    // Every error is one line, without any password.
    let check = async |url: &str, password: &str| {
        let mut command = tokio::process::Command::new(binary());
        let command = command.args(["check", "--database", url]).env("PGPASSWORD", password);
        Said::from(command.output().await.unwrap())
    };
    assert_eq!(check(&url(&trusted), "swordfish").await.code, Some(0));
    for (url, password, word) in [
        (url(&trusted), "sardine", "password"),
        (url(&other), "swordfish", "certificate"),
        (url(&trusted).replace("localhost", "127.0.0.1"), "swordfish", "certificate"),
        (url(&trusted).replace("require", "disable"), "swordfish", "no pg_hba.conf entry"),
    ] {
        let said = check(&url, password).await;
        said.refused(1, &[word]);
        assert!(!said.err.contains(password), "{}", said.err);
    }
}
