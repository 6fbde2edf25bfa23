//! Invalid request bodies.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{Progress, routes};
use sidestep_tests::{Answer, Driver, Server, driven};

const JSON: &str = "application/json";

/// Uploads these bytes as a trial, and returns the answer.
async fn put(
    server: &Server,
    driver: &Driver,
    kind: &str,
    body: impl Into<reqwest::Body>,
) -> Answer {
    let route = routes::my_trial(&driver.scenes()[0].0);
    let request = driver.request(server, Method::PUT, &route);
    Answer::of(request.header("content-type", kind).body(body)).await
}

async fn nothing_is_stored(server: &Server, driver: &Driver) {
    let me: Progress = driver.me(server).await.into(200);
    assert!(me.stored.is_empty(), "a refused body leaves nothing behind");
    assert_eq!(server.export("default").await.lines().count(), 1);
}

pub(super) async fn case_01_malformed_json_bad_utf8_and_other_media_types(server: &Server) {
    let driver = Driver::enrol(server).await;
    let raw: [(&str, &[u8], u16, &str); 9] = [
        (JSON, b"", 400, "malformed"),
        (JSON, b"{\"inputs\":[0", 400, "malformed"),
        (JSON, b"{} {}", 400, "malformed"),
        (JSON, b"{\"started_at_ms\":NaN}", 400, "malformed"),
        (JSON, b"{\"display\":\"\xff\"}", 400, "malformed"),
        ("text/plain", b"{}", 415, "content_type"),
        ("application/json; charset=utf-16", b"{}", 415, "content_type"),
        ("application/x-www-form-urlencoded", b"a=b", 415, "content_type"),
        (JSON, b"[1]", 422, "invalid"),
    ];
    for (kind, body, status, code) in raw {
        let answer = put(server, &driver, kind, body.to_vec()).await;
        let text = String::from_utf8_lossy(body);
        assert_eq!(answer.status, status, "{text}: {}", answer.body);
        assert_eq!(answer.body["code"], code, "{text}");
    }
    nothing_is_stored(server, &driver).await;
}

pub(super) async fn case_02_long_and_chunked_bodies(server: &Server) {
    let driver = Driver::enrol(server).await;
    let long = vec![b' '; 300_000];
    put(server, &driver, JSON, long.clone()).await.problem(413, "too_large", None);
    // Without a content length, the limit applies to the bytes that arrive.
    let pieces = long.chunks(1000).map(|piece| Ok::<_, std::io::Error>(piece.to_vec()));
    let pieces: Vec<_> = pieces.collect();
    let body = reqwest::Body::wrap_stream(futures_util::stream::iter(pieces));
    put(server, &driver, JSON, body).await.problem(413, "too_large", None);
    nothing_is_stored(server, &driver).await;
}

pub(super) async fn case_03_packed_bodies(server: &Server) {
    let driver = Driver::enrol(server).await;
    for coding in ["gzip", "br", "deflate, gzip"] {
        let route = routes::my_trial(&driver.scenes()[0].0);
        let request = driver.request(server, Method::PUT, &route).header("content-type", JSON);
        let request = request.header("content-encoding", coding).body("x");
        Answer::of(request).await.problem(415, "content_encoding", None);
    }
    nothing_is_stored(server, &driver).await;
}

pub(super) async fn case_04_deep_nesting(server: &Server) {
    let driver = Driver::enrol(server).await;
    for begin in ["", "{\"display\":", "{\"display\":{\"a\":"] {
        let nested = [begin.as_bytes(), &b"[".repeat(100_000)].concat();
        put(server, &driver, JSON, nested).await.problem(400, "malformed", None);
    }
    nothing_is_stored(server, &driver).await;
}

pub(super) async fn case_05_numbers_that_are_none(server: &Server) {
    let driver = Driver::enrol(server).await;
    let honest = serde_json::to_value(driven(&driver.scenes()[0].1)).unwrap();
    let huge = honest.to_string().replacen("1760000000123.25", "1e999", 1);
    let answer = put(server, &driver, JSON, huge).await;
    let message = answer.problem(422, "invalid", Some("started_at_ms"));
    assert!(message.contains("expected") && message.contains("found"), "{message}");
    for text in ["NaN", "Infinity", "-Infinity"] {
        let body = honest.to_string().replacen("1760000000123.25", text, 1);
        put(server, &driver, JSON, body).await.problem(400, "malformed", None);
    }
    type Change = fn(&mut Value);
    let changes: [(Change, &str); 3] = [
        (|t| t["states"][3]["robot"][0] = json!(-1e308), "states[3].robot.x"),
        (|t| t["states"][3]["robot"][1] = json!("1"), "states[3].robot[1]"),
        (|t| t["started_at_ms"] = json!(null), "started_at_ms"),
    ];
    for (change, field) in changes {
        let mut trial = honest.clone();
        change(&mut trial);
        put(server, &driver, JSON, trial.to_string()).await.problem(422, "invalid", Some(field));
    }
    nothing_is_stored(server, &driver).await;
}
