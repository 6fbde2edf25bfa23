//! What a server must withstand: the answer says what is wrong, and nothing is
//! written.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{Progress, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server, driven};

/// Sends bytes as a trial and returns the answer.
async fn put(server: &Server, driver: &Driver, kind: &str, body: Vec<u8>) -> Answer {
    let route = routes::my_trial(&driver.scenes()[0].0);
    let request = driver.request(server, Method::PUT, &route);
    Answer::of(request.header("content-type", kind).body(body)).await
}

#[tokio::test]
async fn bodies_that_are_no_trial() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let honest = serde_json::to_value(driven(&driver.scenes()[0].1)).unwrap();
    let json_type = "application/json";
    let raw: [(&str, &[u8], u16, &str); 8] = [
        (json_type, b"", 400, "malformed"),
        (json_type, b"{\"inputs\":[0", 400, "malformed"),
        (json_type, b"{} {}", 400, "malformed"),
        (json_type, b"{\"started_at_ms\":NaN}", 400, "malformed"),
        (json_type, b"{\"display\":\"\xff\"}", 400, "malformed"),
        ("text/plain", b"{}", 415, "content_type"),
        ("application/x-www-form-urlencoded", b"a=b", 415, "content_type"),
        (json_type, b"[1]", 422, "invalid"),
    ];
    for (kind, body, status, code) in raw {
        let answer = put(&server, &driver, kind, body.to_vec()).await;
        let text = String::from_utf8_lossy(body);
        assert_eq!(answer.status, status, "{text}: {}", answer.body);
        assert_eq!(answer.body["code"], code, "{text}");
    }
    let nested = [b"{\"display\":".to_vec(), b"[".repeat(100_000)].concat();
    let answer = put(&server, &driver, json_type, nested).await;
    answer.problem(400, "malformed", None);

    type Change = fn(&mut Value);
    let changes: [(Change, &str); 16] = [
        (|t| t["inputs"] = json!(vec![0; 49]), "inputs"),
        (|t| t["inputs"][7] = json!(2), "inputs[7]"),
        (|t| t["inputs"][7] = json!(0.5), "inputs[7]"),
        (|t| t["states"] = json!([]), "states"),
        (|t| t["states"][17]["human"] = json!([0, 0]), "states[17].human"),
        (|t| t["states"][3]["robot"][1] = json!("1"), "states[3].robot[1]"),
        (|t| t["states"][3]["robot"][0] = json!(-1e308), "states[3].robot.x"),
        (|t| t["states"][3]["speed"] = json!(1), "states[3].speed"),
        (|t| t["sampled_at_ms"][9] = json!(0.0), "sampled_at_ms[9]"),
        (|t| t["started_at_ms"] = json!(-1), "started_at_ms"),
        (|t| t["started_at_ms"] = json!(null), "started_at_ms"),
        (
            |t| t["key_events"] = json!([{ "t_ms": 1, "key": "a\nb", "down": true }]),
            "key_events[0].key",
        ),
        (|t| t["key_events"] = json!([{ "t_ms": 1, "key": "a" }]), "key_events[0].down"),
        (|t| t["display"] = json!({ "x": "y".repeat(9000) }), "display"),
        (|t| t["display"] = json!(1), "display"),
        (|t| t["extra"] = json!(1), "extra"),
    ];
    for (change, field) in changes {
        let mut trial = honest.clone();
        change(&mut trial);
        let answer = put(&server, &driver, json_type, trial.to_string().into()).await;
        let message = answer.problem(422, "invalid", Some(field)).to_owned();
        assert!(!message.is_empty(), "{field}");
    }
    let huge = honest.to_string().replacen("1760000000123.25", "1e999", 1);
    let answer = put(&server, &driver, json_type, huge.into()).await;
    let message = answer.problem(422, "invalid", Some("started_at_ms"));
    assert!(message.contains("expected") && message.contains("found"), "{message}");

    let me: Progress = driver.me(&server).await.into(200);
    assert!(me.stored.is_empty(), "a refused body leaves nothing behind");
    assert_eq!(server.export("default").await.lines().count(), 1);
}

#[tokio::test]
async fn long_and_packed_bodies() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let long = vec![b' '; 300_000];
    let answer = put(&server, &driver, "application/json", long.clone()).await;
    answer.problem(413, "too_large", None);
    // Without a length in front: the limit is on what arrives.
    let pieces = long.chunks(1000).map(|piece| Ok::<_, std::io::Error>(piece.to_vec()));
    let pieces: Vec<_> = pieces.collect();
    let route = routes::my_trial(&driver.scenes()[0].0);
    let request = driver.request(&server, Method::PUT, &route);
    let request = request.header("content-type", "application/json");
    let body = reqwest::Body::wrap_stream(futures_util::stream::iter(pieces));
    Answer::of(request.body(body)).await.problem(413, "too_large", None);
    let request = driver.request(&server, Method::PUT, &route);
    let request = request.header("content-type", "application/json");
    let request = request.header("content-encoding", "gzip").body("x");
    Answer::of(request).await.problem(415, "content_encoding", None);
}

#[tokio::test]
async fn enrolments_that_are_none() {
    let server = Server::with_study(SHORT_STUDY).await;
    let long = "x".repeat(129);
    let table = [
        (json!({ "consent": false }), "consent"),
        (json!({}), "consent"),
        (json!({ "consent": true, "external_id": "" }), "external_id"),
        (json!({ "consent": true, "external_id": long }), "external_id"),
        (json!({ "consent": true, "external_id": "a\r\nSet-Cookie: b" }), "external_id"),
        (json!({ "consent": true, "locale": "\u{0}" }), "locale"),
        (json!({ "consent": true, "screen": 3 }), "screen"),
        (json!({ "consent": true, "name": "Ada" }), "name"),
    ];
    for (body, field) in table {
        let answer = Driver::ask(&server, body).await;
        answer.problem(422, "invalid", Some(field));
    }
    let studies = server.admin(routes::ADMIN_STUDIES).await;
    assert_eq!(studies.body[0]["participants"], 0);
}

#[tokio::test]
async fn strangers_and_other_peoples_trials() {
    let server = Server::with_study(SHORT_STUDY).await;
    let (ada, bob) = (Driver::enrol(&server).await, Driver::enrol(&server).await);
    let (adas, scene) = ada.scenes()[0].clone();
    let answer = bob.send(&server, &adas, &driven(&scene)).await;
    let other = answer.problem(404, "not_found", None).to_owned();
    for unknown in ["nonsense", "%00", "1' OR '1'='1", "..%2f..%2fetc"] {
        let answer = bob.send(&server, unknown, &driven(&scene)).await;
        assert_eq!(answer.problem(404, "not_found", None), other, "{unknown}");
    }
    let mut answers = Vec::new();
    for token in ["", "0", &"0".repeat(64), &server.key] {
        let request = server.request(Method::GET, routes::ME).bearer_auth(token);
        answers.push(Answer::of(request).await);
    }
    answers.push(server.get(routes::ME).await);
    let basic = server.request(Method::GET, routes::ME).basic_auth("a", Some("b"));
    answers.push(Answer::of(basic).await);
    for answer in &answers {
        answer.problem(401, "unauthorized", None);
        assert_eq!(answer.body, answers[0].body, "uniform");
    }
    // A participant is nobody in the laboratory.
    let request = ada.request(&server, Method::GET, routes::ADMIN_STUDIES);
    Answer::of(request).await.problem(401, "unauthorized", None);
    for slug in ["nothing", "%27%20OR%201=1", "a%2fb"] {
        server.get(&routes::study(slug)).await.problem(404, "not_found", None);
    }
}

#[tokio::test]
async fn odd_recordings_are_stored_and_flagged() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    let mut teleport = driven(&scenes[0].1);
    teleport.states[30].human.x += 5.0;
    let mut elsewhere = driven(&scenes[2].1);
    elsewhere.sampled_at_ms[40..].iter_mut().for_each(|t| *t += 80.0);
    for ((id, _), trial) in scenes.iter().zip([&teleport, &elsewhere]) {
        assert_eq!(driver.send(&server, id, trial).await.status, 201);
    }
    let flags = async |i: usize| {
        let answer = server.admin(&routes::admin_trial(&scenes[i].0)).await;
        (answer.body["flags"].clone(), answer.body["replay"].clone())
    };
    let (first, replay) = flags(0).await;
    assert_eq!(first, json!(["replay_mismatch"]));
    assert_eq!(replay["first_difference"], 30);
    let error = replay["max_position_error_m"].as_f64().unwrap();
    assert!((error - 5.0).abs() < 1e-12, "{error}");
    let (second, replay) = flags(1).await;
    assert_eq!(second, json!(["start_mismatch", "late_sample"]));
    assert_eq!(replay["exact"], true);
}

#[tokio::test]
async fn other_sites_and_other_methods() {
    let server = Server::with_study(SHORT_STUDY).await;
    let enrol = |name: &str, value: &str| {
        server
            .request(Method::POST, &routes::participants("default"))
            .header(name, value)
            .json(&json!({ "consent": true }))
    };
    for (name, value) in
        [("sec-fetch-site", "cross-site"), ("origin", "https://evil.example"), ("origin", "null")]
    {
        let answer = Answer::of(enrol(name, value)).await;
        answer.problem(403, "cross_site", None);
    }
    for (name, value) in [("sec-fetch-site", "same-origin"), ("origin", server.origin.as_str())] {
        assert_eq!(Answer::of(enrol(name, value)).await.status, 201);
    }
    let delete = server.request(Method::DELETE, &routes::study("default"));
    Answer::of(delete).await.problem(405, "method_not_allowed", None);
    for route in ["/api/v1/nothing", "/api/", "/api/v2/studies/default"] {
        server.get(route).await.problem(404, "not_found", None);
    }
}
