//! Identities and their permissions.

use reqwest::Method;
use serde_json::json;
use sidestep::api::{Enrolled, KeyMade, routes};
use sidestep_tests::{Answer, Driver, Server, driven};

pub(super) async fn case_14_guessed_expired_and_revoked_tokens(server: &Server) {
    let gone = Driver::enrol(server).await;
    assert_eq!(gone.withdraw(server, "delete").await.status, 200);
    gone.me(server).await.problem(410, "withdrawn", None);
    let new = json!({ "name": "Ada", "access": "read" });
    let request = server.request(Method::POST, routes::ADMIN_KEYS).bearer_auth(&server.key);
    let KeyMade { key, secret } = Answer::of(request.json(&new)).await.into(201);
    let route = routes::admin_key(&key.id.to_string());
    let revoke = server.request(Method::DELETE, &route).bearer_auth(&server.key);
    assert_eq!(Answer::of(revoke).await.status, 204);

    let mut answers = vec![server.get(routes::ME).await, server.get(routes::ADMIN_STUDIES).await];
    for token in ["", "0", &"0".repeat(64), &secret] {
        for route in [routes::ME, routes::ADMIN_STUDIES] {
            let request = server.request(Method::GET, route).bearer_auth(token);
            answers.push(Answer::of(request).await);
        }
    }
    let basic = server.request(Method::GET, routes::ME).basic_auth("a", Some("b"));
    answers.push(Answer::of(basic).await);
    for answer in &answers {
        answer.problem(401, "unauthorized", None);
        assert_eq!(answer.body, answers[0].body, "uniform");
    }
}

pub(super) async fn case_15_trials_of_other_people(server: &Server) {
    let (ada, bob) = (Driver::enrol(server).await, Driver::enrol(server).await);
    let (adas, scene) = ada.scenes()[0].clone();
    let answer = bob.send(server, &adas, &driven(&scene)).await;
    let other = answer.problem(404, "not_found", None).to_owned();
    for unknown in ["nonsense", "%00", "1' OR '1'='1", "..%2f..%2fetc"] {
        let answer = bob.send(server, unknown, &driven(&scene)).await;
        assert_eq!(answer.problem(404, "not_found", None), other, "{unknown}");
    }
}

pub(super) async fn case_16_participants_in_the_laboratory(server: &Server) {
    let driver = Driver::enrol(server).await;
    for route in [routes::ADMIN_STUDIES, routes::AUDIT, &routes::exports("default")] {
        let request = driver.request(server, Method::GET, route);
        Answer::of(request).await.problem(401, "unauthorized", None);
    }
    // An experimenter's key is not a participant's token.
    server.admin(routes::ME).await.problem(401, "unauthorized", None);
}

pub(super) async fn case_17_a_code_before_everything_is_stored(server: &Server) {
    let driver = Driver::enrol(server).await;
    driver.complete(server).await.problem(409, "incomplete", None);
    driver.drive(server, 4).await;
    driver.complete(server).await.problem(409, "incomplete", None);
}

pub(super) async fn case_18_forged_external_ids(server: &Server) {
    let ask =
        async |id: &str| Driver::ask(server, json!({ "consent": true, "external_id": id })).await;
    let long = "x".repeat(129);
    for id in
        ["", " ", &long, "a\r\nSet-Cookie: b", "<b>", "a\u{202e}b", "a\u{200b}", "é", "{code}"]
    {
        ask(id).await.problem(422, "invalid", Some("external_id"));
    }
    let person: Enrolled = ask("P1").await.into(201);
    for same in ["p1", " P1 ", "P1"] {
        let known: Enrolled = ask(same).await.into(200);
        assert_eq!(known.participant_id, person.participant_id, "{same:?} is the same person");
        // Someone who knows only the external id can continue the participation, but cannot withdraw it.
        let other = Driver { enrolled: known };
        for data in ["keep", "delete"] {
            other.withdraw(server, data).await.problem(403, "not_yours", None);
        }
    }
    for (body, field) in [
        (json!({ "consent": false }), "consent"),
        (json!({ "consent": true, "screen": 3 }), "screen"),
        (json!({ "consent": true, "name": "Ada" }), "name"),
    ] {
        Driver::ask(server, body).await.problem(422, "invalid", Some(field));
    }
    let studies = server.admin(routes::ADMIN_STUDIES).await;
    assert_eq!(studies.body[0]["participants"], 1);
}

pub(super) async fn case_19_return_links_lead_nowhere_else(server: &Server) {
    let make = async |url: &str| {
        let study = format!(
            "slug = \"paid\"\n[recruitment]\nreturn_hosts = [\"app.prolific.com\"]\n\
             completed_url = \"{url}\"\n"
        );
        let request = server.request(Method::POST, routes::ADMIN_STUDIES);
        Answer::of(request.bearer_auth(&server.key).json(&json!({ "toml": study }))).await
    };
    for url in [
        "https://evil.example/{code}",
        "https://app.prolific.com.evil.example/",
        "https://app.prolific.com@evil.example/",
        "http://app.prolific.com/",
        "//app.prolific.com/",
        "javascript:alert(1)",
    ] {
        let answer = make(url).await;
        assert_eq!(answer.status, 422, "{url}: {}", answer.body);
    }
    assert_eq!(make("https://app.prolific.com/done?code={code}").await.status, 201);
    // No page redirects to an address in the query.
    for query in ["?next=https://evil.example", "?url=//evil.example", "//evil.example"] {
        for page in ["/start", "/", "/s/default", "/lab"] {
            let request = server.request(Method::GET, &format!("{page}{query}"));
            let answer = request.send().await.unwrap();
            let location = answer.headers().get("location").map_or("", |it| it.to_str().unwrap());
            assert!(!location.contains("evil"), "{page}{query} leads to {location}");
        }
    }
}
