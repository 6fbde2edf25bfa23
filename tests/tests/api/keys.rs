//! Keys with names and rights, and the audit trail.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{
    Access, Action, AuditPage, Completed, KeyMade, KeySummary, ParticipantPage, Session, routes,
};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server};

async fn ask(server: &Server, key: &str, method: Method, route: &str, body: Value) -> Answer {
    let request = server.request(method, route).bearer_auth(key);
    Answer::of(if body.is_null() { request } else { request.json(&body) }).await
}

async fn made(server: &Server, name: &str, access: Access) -> KeyMade {
    let body = json!({ "name": name, "access": access.word() });
    ask(server, &server.key, Method::POST, routes::ADMIN_KEYS, body).await.into(201)
}

async fn get(server: &Server, key: &str, route: &str) -> Answer {
    ask(server, key, Method::GET, route, Value::Null).await
}

/// The audit trail, oldest first.
async fn trail(server: &Server) -> Vec<(String, Action, Option<String>)> {
    let page: AuditPage = get(server, &server.key, routes::AUDIT).await.into(200);
    page.entries.into_iter().rev().map(|entry| (entry.who, entry.action, entry.subject)).collect()
}

#[tokio::test]
async fn a_key_may_do_what_its_right_says() {
    let server = Server::with_study(SHORT_STUDY).await;
    let analyses = routes::admin_analyses("default");
    // The access that each route needs, and the status of a request with this access.
    let table = [
        (Access::Read, Method::GET, routes::ADMIN_STUDIES.to_owned(), Value::Null, 200),
        (Access::Read, Method::GET, routes::admin_trials("default"), Value::Null, 200),
        (Access::Read, Method::GET, analyses.clone(), Value::Null, 200),
        (Access::Read, Method::GET, routes::SELF_CHECK.to_owned(), Value::Null, 200),
        (Access::Read, Method::GET, routes::DATA_CHECK.to_owned(), Value::Null, 200),
        (Access::Export, Method::GET, routes::exports("default"), Value::Null, 200),
        (
            Access::Export,
            Method::GET,
            format!("{}?format=csv", routes::admin_participants("default")),
            Value::Null,
            200,
        ),
        (Access::Manage, Method::DELETE, routes::admin_pilots("default"), Value::Null, 200),
        (Access::Manage, Method::POST, analyses, json!({}), 201),
        (Access::Manage, Method::GET, routes::ADMIN_KEYS.to_owned(), Value::Null, 200),
        (Access::Manage, Method::GET, routes::AUDIT.to_owned(), Value::Null, 200),
    ];
    for access in Access::ALL {
        let KeyMade { secret, .. } = made(&server, access.word(), access).await;
        let session: Session = get(&server, &secret, routes::SESSION).await.into(200);
        assert_eq!((session.name.as_str(), session.access), (access.word(), access));
        for (needed, method, route, body, status) in table.clone() {
            let answer = ask(&server, &secret, method.clone(), &route, body).await;
            if access >= needed {
                assert!([200, status].contains(&answer.status), "{method} {route}");
            } else {
                answer.problem(403, "access", None);
            }
        }
    }
    let refused = |(who, action, subject): (String, Action, Option<String>)| {
        (action == Action::Refused).then_some((who, subject.unwrap()))
    };
    let refused: Vec<_> = trail(&server).await.into_iter().filter_map(refused).collect();
    assert_eq!(refused.len(), 6 + 4);
    let route = "/api/v1/admin/studies/{slug}/export".to_owned();
    assert_eq!(
        refused[0],
        ("read".to_owned(), format!("GET {route}")),
        "without what the sender wrote"
    );
    let reader = made(&server, "another reader", Access::Read).await;
    for slug in ["default", "a%40b"] {
        get(&server, &reader.secret, &routes::exports(slug)).await.problem(403, "access", None);
    }
    let by_reader = trail(&server).await.into_iter().filter(|(who, ..)| who == "another reader");
    assert_eq!(by_reader.count(), 1, "once a minute");
}

#[tokio::test]
async fn a_key_that_only_reads_sees_no_external_id_and_no_code() {
    let server = Server::with_study(SHORT_STUDY).await;
    let body = json!({ "consent": true, "external_id": "P1" });
    let driver = Driver { enrolled: Driver::ask(&server, body).await.into(201) };
    driver.drive(&server, 5).await;
    let code: Completed = driver.complete(&server).await.into(200);
    for (access, sees) in [(Access::Read, false), (Access::Export, true)] {
        let key = made(&server, access.word(), access).await.secret;
        let list = async |search: &str| -> ParticipantPage {
            let route = routes::admin_participants("default");
            get(&server, &key, &format!("{route}?search={search}")).await.into(200)
        };
        let person = list("1").await.participants.remove(0);
        assert_eq!((person.external_id.is_some(), person.completion_code.is_some()), (sees, sees));
        for search in ["p1", &code.completion_code] {
            assert_eq!(list(search).await.total, u64::from(sees), "{search}");
        }
    }
}

/// If the key of a request is revoked while the request is in progress, the request changes nothing
/// after the revocation.
#[tokio::test]
async fn nothing_outruns_a_revocation() {
    let server = Server::with_study(SHORT_STUDY).await;
    for round in 0..10 {
        let ada = made(&server, &format!("Ada {round}"), Access::Manage).await;
        let revoke = routes::admin_key(&ada.key.id.to_string());
        let sign_in = async || {
            let body = json!({ "key": ada.secret });
            let request = server.request(Method::POST, routes::SESSION).json(&body);
            let answer = request.send().await.unwrap();
            let cookie = answer.headers().get("set-cookie")?.to_str().unwrap().to_owned();
            Some(cookie.split(';').next().unwrap().to_owned())
        };
        let body = json!({ "name": format!("heir {round}"), "access": "manage" });
        let (revoked, first, second, _, third) = tokio::join!(
            ask(&server, &server.key, Method::DELETE, &revoke, Value::Null),
            sign_in(),
            sign_in(),
            ask(&server, &ada.secret, Method::POST, routes::ADMIN_KEYS, body),
            sign_in(),
        );
        assert_eq!(revoked.status, 204);
        for cookie in [first, second, third].into_iter().flatten() {
            let request = server.request(Method::GET, routes::SESSION).header("cookie", cookie);
            Answer::of(request).await.problem(401, "unauthorized", None);
        }
        let trail = trail(&server).await;
        let at = |action, who: &str| {
            trail.iter().rposition(|entry| entry.1 == action && entry.0.contains(who))
        };
        let revoked = at(Action::KeyRevoked, "first key").unwrap();
        assert!(at(Action::KeyMade, &format!("Ada {round}")).is_none_or(|made| made < revoked));
    }
}

#[tokio::test]
async fn the_trail_says_who_did_what() {
    let server = Server::with_study(SHORT_STUDY).await;
    let ada = made(&server, "Ada", Access::Manage).await;
    let pilots = routes::admin_pilots("default");
    ask(&server, &ada.secret, Method::DELETE, &pilots, Value::Null).await;
    get(&server, &ada.secret, &routes::exports("default")).await;
    let revoke = routes::admin_key(&ada.key.id.to_string());
    for _ in 0..2 {
        let revoked = ask(&server, &server.key, Method::DELETE, &revoke, Value::Null).await;
        assert_eq!(revoked.status, 204);
    }
    let entry =
        |who: &str, action, subject: &str| (who.to_owned(), action, Some(subject.to_owned()));
    let expected = [
        entry("first key", Action::KeyMade, "Ada"),
        entry("Ada", Action::PilotsDeleted, "0"),
        entry("Ada", Action::Exported, "trials as CSV"),
        entry("first key", Action::KeyRevoked, "Ada"),
    ];
    assert_eq!(trail(&server).await, expected);
    let page: AuditPage =
        get(&server, &server.key, &format!("{}?limit=3", routes::AUDIT)).await.into(200);
    assert_eq!(page.entries[1].study.as_deref(), Some("default"));
    let next = format!("{}?limit=3&before={}", routes::AUDIT, page.next_before.unwrap());
    let last: AuditPage = get(&server, &server.key, &next).await.into(200);
    assert_eq!((last.entries.len(), last.next_before), (1, None));
}

#[tokio::test]
async fn a_revoked_key_and_its_sessions_open_nothing() {
    let server = Server::with_study(SHORT_STUDY).await;
    let ada = made(&server, "Ada", Access::Read).await;
    let sign_in = server.request(Method::POST, routes::SESSION).json(&json!({ "key": ada.secret }));
    let signed_in = sign_in.send().await.unwrap();
    let cookie = signed_in.headers()["set-cookie"].to_str().unwrap().to_owned();
    let cookie = cookie.split(';').next().unwrap().to_owned();
    let with_cookie = async || {
        let request = server.request(Method::GET, routes::SESSION).header("cookie", &cookie);
        Answer::of(request).await
    };
    let session: Session = with_cookie().await.into(200);
    assert_eq!((session.name.as_str(), session.access), ("Ada", Access::Read));
    let keys: Vec<KeySummary> = get(&server, &server.key, routes::ADMIN_KEYS).await.into(200);
    assert_eq!(keys.iter().map(|key| &key.name[..]).collect::<Vec<_>>(), ["first key", "Ada"]);
    assert!(keys.iter().all(|key| key.last_used_at_ms.is_some()));

    let revoke = routes::admin_key(&ada.key.id.to_string());
    ask(&server, &server.key, Method::DELETE, &revoke, Value::Null).await;
    with_cookie().await.problem(401, "unauthorized", None);
    get(&server, &ada.secret, routes::SESSION).await.problem(401, "unauthorized", None);
    let keys: Vec<KeySummary> = get(&server, &server.key, routes::ADMIN_KEYS).await.into(200);
    assert!(keys[0].revoked_at_ms.is_none() && keys[1].revoked_at_ms.is_some());
}

#[tokio::test]
async fn keys_are_refused_with_a_reason() {
    let server = Server::with_study(SHORT_STUDY).await;
    let make =
        async |body: Value| ask(&server, &server.key, Method::POST, routes::ADMIN_KEYS, body).await;
    for (body, field) in [
        (json!({ "name": "", "access": "read" }), "name"),
        (json!({ "name": "a\nb", "access": "read" }), "name"),
        (json!({ "name": "x".repeat(65), "access": "read" }), "name"),
        (json!({ "name": "a", "access": "write" }), "access"),
        (json!({ "name": "a" }), "access"),
        (json!({ "name": "a", "access": "read", "until": 1 }), "until"),
    ] {
        make(body).await.problem(422, "invalid", Some(field));
    }
    made(&server, "Ada", Access::Read).await;
    for name in ["Ada", "ada", "First Key", "sidestep_admin_key"] {
        make(json!({ "name": name, "access": "read" })).await.problem(409, "taken", None);
    }
    let delete = async |id: &str| {
        ask(&server, &server.key, Method::DELETE, &routes::admin_key(id), Value::Null).await
    };
    delete("1").await.problem(409, "first_key", None);
    for id in ["99", "x", "-1", "99999999999999999999"] {
        delete(id).await.problem(404, "not_found", None);
    }
}

#[tokio::test]
async fn the_key_in_the_environment_takes_the_place_of_the_first_key() {
    let server = Server::with_study(SHORT_STUDY).await;
    let (first, ada) = (server.key.clone(), made(&server, "Ada", Access::Read).await);
    let server = server.restarted_with(Some("a key of the environment"), |_| {}).await;
    get(&server, &first, routes::SESSION).await.problem(401, "unauthorized", None);
    let session: Session = get(&server, &ada.secret, routes::SESSION).await.into(200);
    assert_eq!(session.name, "Ada");
    let session: Session =
        get(&server, "a key of the environment", routes::SESSION).await.into(200);
    assert_eq!((session.name.as_str(), session.access), ("SIDESTEP_ADMIN_KEY", Access::Manage));
}
