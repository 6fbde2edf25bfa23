//! The command as a process: exit codes, and death without notice.

use reqwest::Client;
use serde_json::json;
use sidestep::api::{Enrolled, Progress, routes};
use sidestep_tests::{Answer, Driver, Process, driven, sidestep};
use tempfile::TempDir;

async fn fails(args: &[&str], code: i32, words: &[&str]) {
    let output = sidestep(args).await;
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    assert_eq!(said.trim_end().lines().count(), 1, "one line: {said}");
    for word in words {
        assert!(said.contains(word), "{word} in {said}");
    }
}

#[tokio::test]
async fn what_is_acknowledged_survives_a_kill() {
    let folder = TempDir::new().unwrap();
    let client = Client::new();
    let server = Process::start(&folder, &[]).await;
    let at = |server: &Process, route: &str| format!("{}{route}", server.origin);
    let enrol = client
        .post(at(&server, &routes::participants("default")))
        .json(&json!({ "consent": true }));
    let enrolled: Enrolled = Answer::of(enrol).await.into(201);
    let driver = Driver { enrolled };
    let token = &driver.enrolled.token;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let put = |server: &Process| {
        let request = client.put(at(server, &routes::my_trial(&trial_id)));
        request.bearer_auth(token).json(&driven(&scene))
    };
    assert_eq!(Answer::of(put(&server)).await.status, 201);
    server.kill().await;

    let server = Process::start(&folder, &[]).await;
    let me = client.get(at(&server, routes::ME)).bearer_auth(token);
    let me: Progress = Answer::of(me).await.into(200);
    assert_eq!(me.stored, std::slice::from_ref(&trial_id));
    assert_eq!(Answer::of(put(&server)).await.status, 200, "the same again");
}

#[tokio::test]
async fn a_start_that_fails_says_what_to_do() {
    let folder = TempDir::new().unwrap();
    let running = Process::start(&folder, &[]).await;
    assert_eq!(running.announcement[0], "Sidestep is ready.");
    let site = folder.path().join("site");
    let site = site.to_str().unwrap();
    let spare = format!("sqlite:{}", folder.path().join("spare.db").display());
    let port = running.origin.trim_start_matches("http://");
    let serve = ["serve", "--database", &spare, "--static", site, "--listen"];
    let with = |args: &[&'static str]| [&serve[..5], args].concat();
    fails(&[&serve[..], &[port]].concat(), 1, &["--listen", "in use", "another"]).await;
    let nowhere = ["serve", "--listen", "127.0.0.1:0", "--static", site, "--database"];
    fails(
        &[&nowhere[..], &["sqlite:/proc/nowhere/sidestep.db"]].concat(),
        1,
        &["/proc/nowhere/sidestep.db", "writable"],
    )
    .await;
    fails(&[&nowhere[..], &["postgres://u:secret@h/d"]].concat(), 2, &["SQLite only"]).await;
    fails(&[&nowhere[..], &["sqlite::memory:"]].concat(), 2, &["sqlite:FILE"]).await;
    let empty = ["serve", "--listen", "127.0.0.1:0", "--database", &spare, "--static", "/tmp"];
    fails(&empty, 1, &["no client bundle in /tmp: run 'cargo xtask build' or pass --static DIR"])
        .await;
    let study = folder.path().join("study.toml");
    std::fs::write(&study, "[parameters.human]\nspeed_mps = -2").unwrap();
    let study = study.to_str().unwrap();
    let bad = [&serve[..], &["127.0.0.1:0", "--study", study]].concat();
    fails(&bad, 2, &[study, "parameters.human.speed_mps", "expected", "found -2"]).await;
    fails(&with(&["--study", "missing.toml"]), 2, &["missing.toml"]).await;
}

#[tokio::test]
async fn commands_without_a_database_make_none() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("none.db");
    let database = format!("sqlite:{}", file.display());
    let out = folder.path().to_str().unwrap();
    fails(&["check", "--database", &database], 1, &["none.db"]).await;
    fails(&["export", "--database", &database, "--out", out], 1, &["none.db"]).await;
    assert!(!file.exists());
    let format = ["export", "--database", &database, "--format", "xlsx", "--out", out];
    fails(&format, 2, &["--format", "csv", "xlsx"]).await;
    let missing = ["import", "--database", &database, "--trials", "missing.csv"];
    fails(&missing, 2, &["missing.csv"]).await;
    let server = Process::start(&folder, &[]).await;
    let database = format!("sqlite:{}", folder.path().join("sidestep.db").display());
    let unknown = ["export", "--database", &database, "--study", "other", "--out", out];
    fails(&unknown, 2, &["--study other"]).await;
    drop(server);
}

#[tokio::test]
async fn the_log_holds_no_secrets() {
    let folder = TempDir::new().unwrap();
    let server = Process::start(&folder, &[]).await;
    let client = Client::new();
    let enrol = client
        .post(format!("{}{}", server.origin, routes::participants("default")))
        .json(&json!({ "consent": true, "external_id": "PERSON-4711" }));
    let enrolled: Enrolled = Answer::of(enrol).await.into(201);
    for route in ["/api/v1/participants/me?data=QUERY", "/SECRET-PATH", "/lab?key=QUERY"] {
        let request = client.get(format!("{}{route}", server.origin));
        Answer::of(request.bearer_auth(&enrolled.token)).await;
    }
    let key =
        client.get(format!("{}{}", server.origin, routes::ADMIN_STUDIES)).bearer_auth("WRONG-KEY");
    assert_eq!(Answer::of(key).await.status, 401);
    server.kill().await;
    let log = std::fs::read_to_string(folder.path().join("log")).unwrap();
    assert!(log.contains("/api/v1/participants/me") && log.contains("wrong"), "{log}");
    for secret in [&enrolled.token, "PERSON-4711", "QUERY", "SECRET-PATH", "WRONG-KEY"] {
        assert!(!log.contains(secret), "{secret} in {log}");
    }
}

#[tokio::test]
async fn a_short_key_in_the_environment_is_refused() {
    let output = std::process::Command::new(sidestep_tests::process::binary())
        .args(["serve", "--listen", "127.0.0.1:0", "--static", "/nowhere"])
        .env("SIDESTEP_ADMIN_KEY", "short")
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("SIDESTEP_ADMIN_KEY: expected 16 characters or more, found 5"), "{said}");
}
