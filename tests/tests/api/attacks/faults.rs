//! Faults below the server, and the content of its log.

use reqwest::Method;
use serde_json::json;
use sidestep::api::{Enrolled, Progress, routes};
use sidestep_tests::{Answer, Driver, Folder, Process, driven, run};

/// Only stored trials are acknowledged, and acknowledged trials survive SIGKILL.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn case_30_a_full_disk_and_a_kill() {
    let folder = Folder::default();
    let database = folder.database("sidestep.db");
    // A write beyond the limit must fail with an error, not with a fatal signal.
    let launcher = ["env", "--ignore-signal=XFSZ"];
    let server = Process::start_through(&launcher, &folder, &database).await;
    let limit = |bytes: &str| {
        let (limit, pid) = (format!("--fsize={bytes}:unlimited"), server.id().to_string());
        let set = std::process::Command::new("prlimit").args([&limit, "--pid", &pid]).status();
        assert!(set.is_ok_and(|status| status.success()), "prlimit {limit}");
    };
    crate::trouble::waits_for_room(&server, || limit("4096"), || limit("unlimited")).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    assert_eq!(driver.send(&server, &trial_id, &driven(&scene)).await.status, 201);
    server.kill().await;

    let server = Process::start(&folder).await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored, std::slice::from_ref(&trial_id));
    let again = driver.send(&server, &trial_id, &driven(&scene)).await;
    assert_eq!(again.status, 200, "the same again");
    server.kill().await;
    let report = run(&["check", "--database", &database]).await.json();
    assert_eq!((&report["trials"], &report["participants"]), (&json!(4), &json!(3)));
}

#[tokio::test]
async fn case_32_logs_without_secrets() {
    let folder = Folder::default();
    let mut server = Process::start(&folder).await;
    let key = server.key().await;
    let body = json!({
        "consent": true, "external_id": "PERSON-4711", "locale": "LOCALE-WORD",
        "parameters": { "SESSION_ID": "SESSION-WORD" }, "screen": { "note": "SCREEN-WORD" },
    });
    let enrolled: Enrolled = Driver::ask(&server, body).await.into(201);
    let get = |route, token| Answer::of(server.request(Method::GET, route).bearer_auth(token));
    for route in ["/api/v1/participants/me?data=QUERY", "/SECRET-PATH", "/lab?key=QUERY"] {
        get(route, &enrolled.token[..]).await;
    }
    assert_eq!(get(routes::ADMIN_STUDIES, "WRONG-KEY").await.status, 401);
    assert_eq!(get(routes::ADMIN_STUDIES, &key).await.status, 200);
    let sign_in = server.request(Method::POST, routes::SESSION).json(&json!({ "key": key }));
    let signed_in = sign_in.send().await.unwrap();
    let cookie = signed_in.headers()["set-cookie"].to_str().unwrap().to_owned();
    let cookie = cookie.split(['=', ';']).nth(1).unwrap().to_owned();
    let foreign = server.request(Method::GET, "/").header("host", "HOST-WORD.example");
    assert_eq!(Answer::of(foreign).await.status, 421);
    server.kill().await;
    let log = folder.text("log");
    assert!(log.contains("/api/v1/participants/me") && log.contains("wrong"), "{log}");
    for secret in [
        &enrolled.token,
        &key,
        &cookie,
        "PERSON-4711",
        "LOCALE-WORD",
        "SESSION-WORD",
        "SCREEN-WORD",
        "QUERY",
        "SECRET-PATH",
        "WRONG-KEY",
        "HOST-WORD",
    ] {
        assert!(!log.contains(secret), "{secret} in {log}");
    }
}
