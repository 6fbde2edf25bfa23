//! Two servers behind NGINX or HAProxy, with the configuration files of `docs/deploy`.

use futures_util::StreamExt;
use futures_util::future::join_all;
use reqwest::Method;
use serde_json::json;
use sidestep::api::routes;
use sidestep_tests::front::{Front, Kind, NAME};
use sidestep_tests::postgres::{Cluster, Fsync};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Folder, Process, driven};
use std::time::Duration;

/// Number of people who drive at the same time.
const PEOPLE: usize = 6;

/// Maximum number of retries of a request whose connection was closed without a response.
const ASKED_AGAIN: usize = 3;

async fn behind(kind: Kind) {
    let (one, two) = (Folder::default(), Folder::default());
    let cluster = Cluster::new(Fsync::Off).await;
    let database = cluster.create();
    let study = one.file("study.toml", format!("slug = \"default\"\n{SHORT_STUDY}"));
    let args = ["--trusted-proxy", "127.0.0.1", "--allowed-host", NAME, "--study", &study];
    let mut first = Process::start_with(&one, &database, &args).await;
    let key = first.key().await;
    let second = Process::start_with(&two, &database, &args).await;
    let front = Front::start(kind, [&first, &second]).await;

    what_the_proxy_says(&front, &key).await;

    // Participants do not notice that one of the servers is killed while they drive.
    let people = join_all((0..PEOPLE).map(|_| Driver::enrol(&front.address))).await;
    let drives = join_all(people.iter().map(async |person| {
        for (id, scene) in person.scenes() {
            let answer = person.send(&front.address, &id, &driven(&scene)).await;
            assert!([200, 201].contains(&answer.status), "{kind:?}: {}", answer.body);
            tokio::time::sleep(Duration::from_millis(40)).await;
        }
        person.complete(&front.address).await.status
    }));
    let kill = async {
        tokio::time::sleep(Duration::from_millis(60)).await;
        first.kill().await;
    };
    let (completed, ()) = tokio::join!(drives, kill);
    assert_eq!(completed, [200; PEOPLE]);
    let stored = database.number("SELECT count(*) FROM trial").await;
    assert_eq!(stored, 5 * PEOPLE as i64);

    // Without any server, the page gets a response that it understands, which says when to retry.
    // HAProxy might still have connections that the server has just closed. In this case, it closes
    // the client's connection without a response, and the client retries as browsers do (RFC 9112,
    // 9.3.1).
    second.kill().await;
    let ask = || front.address.request(Method::GET, "/s/default").send();
    let mut away = ask().await;
    for _ in 0..ASKED_AGAIN {
        if away.is_ok() {
            break;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
        away = ask().await;
    }
    let away = away.expect("an answer of the proxy");
    assert_eq!(
        (away.status().as_u16(), &away.headers()["retry-after"]),
        (503, &"1".parse().unwrap())
    );
    assert_eq!(away.json::<serde_json::Value>().await.unwrap()["code"], "away");

    // The log contains the requests, but not the identity of their senders.
    let log = front.log();
    for word in ["/api/v1/participants/me/trials", "/api/v1/studies/", "PUT", " 201 "] {
        assert!(log.contains(word), "{word} in\n{log}");
    }
    let person = &people[0].enrolled;
    for secret in [&person.participant_id, &person.token, &people[0].scenes()[0].0, &key] {
        assert!(!log.contains(secret.as_str()), "{secret} in\n{log}");
    }
}

/// Checks for faults that only a proxy can cause: in host names, schemes, paths that bypass its
/// rules, and streams.
async fn what_the_proxy_says(front: &Front, key: &str) {
    let to = |method, route: &str| front.address.request(method, route);
    let redirected = front.plain.request(Method::GET, "/s/default?x=1").send().await.unwrap();
    assert_eq!(redirected.status(), 301);
    assert_eq!(redirected.headers()["location"], format!("https://{NAME}/s/default?x=1"));
    for route in ["/metrics", "//metrics", "/%6detrics"] {
        assert_eq!(Answer::of(to(Method::GET, route)).await.status, 404, "{route}");
    }
    // The server knows that the visitor's connection is encrypted.
    let signed_in = to(Method::POST, routes::SESSION).json(&json!({ "key": key })).send();
    let signed_in = signed_in.await.unwrap();
    assert_eq!(signed_in.status(), 200);
    assert!(signed_in.headers()["set-cookie"].to_str().unwrap().contains("; Secure"));
    assert!(signed_in.headers().contains_key("strict-transport-security"));
    assert!(signed_in.headers().contains_key("x-request-id"));
    // Forged headers do not make a client local.
    for (name, value) in [("x-forwarded-for", "127.0.0.1"), ("forwarded", "for=127.0.0.1")] {
        let guesses = (0..30).map(async |i| {
            let guess = json!({ "key": format!("a guess with number {i}") });
            Answer::of(to(Method::POST, routes::SESSION).header(name, value).json(&guess)).await
        });
        let refused = join_all(guesses).await;
        assert!(refused.iter().all(|answer| [401, 429].contains(&answer.status)));
    }
    // A body above the limit is rejected.
    let large = to(Method::POST, routes::SESSION).body(vec![b' '; 300_000]);
    let large = large.header("content-type", "application/json");
    assert_eq!(Answer::of(large).await.status, 413);
    // Events arrive while the stream is open.
    let changes = to(Method::GET, routes::CHANGES).bearer_auth(key).send().await.unwrap();
    assert_eq!(changes.status(), 200);
    let mut changes = changes.bytes_stream();
    // A proxy that buffers the response would forward nothing in this time.
    let first = tokio::time::timeout(Duration::from_secs(60), changes.next());
    assert!(first.await.expect("an event while the stream is open").unwrap().is_ok());
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn two_servers_behind_nginx() {
    behind(Kind::Nginx).await;
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn two_servers_behind_haproxy() {
    behind(Kind::Haproxy).await;
}
