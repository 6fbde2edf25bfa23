//! A database that is in trouble: nothing is acknowledged that is not stored, and the service
//! comes back as soon as the cause is gone.

use reqwest::{Client, Method, StatusCode};
use serde_json::json;
use sidestep::api::{Enrolled, Progress, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Process, Server, behind, driven, sidestep};
use tempfile::TempDir;

#[tokio::test]
async fn a_lock_of_another_process_is_waited_for_and_then_refused() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    let other = behind(&server.database());
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    // Reading goes on.
    assert_eq!(driver.me(&server).await.status, 200);
    let request = driver.request(&server, Method::PUT, &routes::my_trial(&trial_id));
    let refused = request.json(&trial).send().await.unwrap();
    assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(refused.headers()["retry-after"], "5");
    server.get("/readyz").await.problem(503, "not_ready", None);
    other.execute_batch("ROLLBACK").unwrap();
    assert_eq!(server.get("/readyz").await.status, 200);
    assert_eq!(driver.send(&server, &trial_id, &trial).await.status, 201);
}

#[tokio::test]
async fn a_deleted_database_acknowledges_nothing() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    let (file, aside) = (server.path("sidestep.db"), server.path("aside.db"));
    std::fs::rename(&file, &aside).unwrap();
    for _ in 0..2 {
        driver.send(&server, &trial_id, &trial).await.problem(503, "storage", None);
        let ready = server.get("/readyz").await;
        assert!(ready.problem(503, "not_ready", None).contains("deleted, moved or replaced"));
    }
    // Another file in its place is not written to either.
    std::fs::write(&file, b"").unwrap();
    driver.send(&server, &trial_id, &trial).await.problem(503, "storage", None);
    assert_eq!(std::fs::metadata(&file).unwrap().len(), 0);
    std::fs::rename(&aside, &file).unwrap();
    let again = driver.send(&server, &trial_id, &trial).await;
    assert!([200, 201].contains(&again.status), "{}", again.body);
    assert_eq!(server.get("/readyz").await.status, 200);
    let server = server.restarted().await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored, [trial_id]);
}

/// Files of the process may not grow beyond this. SQLite is told of an error in writing, as by a
/// disk that is full or breaks.
#[cfg(target_os = "linux")]
fn limit_files(server: &Process, bytes: &str) {
    let limit = format!("--fsize={bytes}:unlimited");
    let pid = server.id().to_string();
    let set = std::process::Command::new("prlimit").args([&limit, "--pid", &pid]).status();
    assert!(set.is_ok_and(|status| status.success()), "prlimit {limit}");
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn writing_goes_on_when_there_is_room_again() {
    let folder = TempDir::new().unwrap();
    // Writing beyond the limit is an error, and not the end.
    let server = Process::start_through(&["env", "--ignore-signal=XFSZ"], &folder).await;
    let client = Client::new();
    let enrol = || {
        let route = format!("{}{}", server.origin, routes::participants("default"));
        Answer::of(client.post(route).json(&json!({ "consent": true })))
    };
    let driver = Driver { enrolled: enrol().await.into(201) };
    limit_files(&server, "4096");
    let mut stored = Vec::new();
    let put = |trial_id: &str, trial: &sidestep::api::TrialUpload| {
        let request = client.put(format!("{}{}", server.origin, routes::my_trial(trial_id)));
        Answer::of(request.bearer_auth(&driver.enrolled.token).json(trial))
    };
    let scenes = driver.scenes();
    for _ in 0..3 {
        let answer = put(&scenes[0].0, &driven(&scenes[0].1)).await;
        answer.problem(503, "storage", None);
        enrol().await.problem(503, "storage", None);
    }
    limit_files(&server, "unlimited");
    for (trial_id, scene) in &scenes[..3] {
        assert_eq!(put(trial_id, &driven(scene)).await.status, 201);
        stored.push(trial_id.clone());
    }
    let _: Enrolled = enrol().await.into(201);
    server.kill().await;
    let server = Process::start(&folder, &[]).await;
    let me = client.get(format!("{}{}", server.origin, routes::ME));
    let me: Progress = Answer::of(me.bearer_auth(&driver.enrolled.token)).await.into(200);
    assert_eq!(me.stored, stored);
}

#[tokio::test]
async fn one_server_a_database() {
    let server = Server::with_study(SHORT_STUDY).await;
    let site = server.path("site").display().to_string();
    let database = server.database();
    let second = ["serve", "--listen", "127.0.0.1:0", "--static", &site, "--database", &database];
    let output = sidestep(&second).await;
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("another 'sidestep serve' uses this database"), "{said}");
    // Commands work beside it.
    let checked = sidestep(&["check", "--database", &database]).await;
    assert_eq!(checked.status.code(), Some(0));
    assert_eq!(Driver::enrol(&server).await.scenes().len(), 5);
}

#[cfg(unix)]
#[tokio::test]
async fn nobody_else_reads_the_file() {
    use std::os::unix::fs::PermissionsExt;
    let server = Server::with_study(SHORT_STUDY).await;
    Driver::enrol(&server).await;
    for name in ["sidestep.db", "sidestep.db-wal"] {
        let mode = std::fs::metadata(server.path(name)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{name}");
    }
}
