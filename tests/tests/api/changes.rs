//! Running studies in the laboratory: their counts, and an event for each change.

use crate::people::{come, drive};
use reqwest::{Method, Response};
use serde_json::json;
use sidestep::api::{KeyMade, ParticipantPage, StudySummary, routes};
use sidestep::study::Status;
use sidestep::vehicle::TurnInput;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Server};
use std::time::{Duration, Instant};

/// Opens the server's event stream.
async fn follow(server: &Server) -> Response {
    let request = server.request(Method::GET, routes::CHANGES).bearer_auth(&server.key);
    let events = request.send().await.unwrap();
    assert_eq!(events.status(), 200);
    assert_eq!(events.headers()["content-type"], "text/event-stream");
    events
}

/// Timeout for an event. Even on a busy machine, events arrive sooner.
const PATIENCE: Duration = Duration::from_secs(300);

/// Two and a half times the server's pause between events. If there was a change, an event arrives
/// within this time.
const SILENCE: Duration = Duration::from_millis(2_500);

/// The number of the next event.
async fn next(events: &mut Response) -> u64 {
    next_within(events, PATIENCE).await.expect("an event")
}

/// The number of the next event. `None` if no event arrives within this time.
async fn next_within(events: &mut Response, time: Duration) -> Option<u64> {
    let chunk = tokio::time::timeout(time, events.chunk()).await.ok()?.unwrap()?;
    let text = std::str::from_utf8(&chunk).unwrap();
    assert!(text.contains("event: change\n"), "{text:?}");
    let data = text.lines().find_map(|line| line.strip_prefix("data: ")).unwrap();
    Some(data.parse().unwrap())
}

#[tokio::test]
async fn an_open_page_hears_of_changes_and_only_of_changes() {
    let server = Server::with_study(SHORT_STUDY).await;
    let mut events = follow(&server).await;
    let at_once = next(&mut events).await;
    let driver = Driver::enrol(&server).await;
    let joined = next(&mut events).await;
    assert!(joined > at_once);
    driver.drive(&server, 3).await;
    // Several changes at the same time cause one event, or two if the first event has already been
    // sent.
    assert!(next(&mut events).await > joined);
    while next_within(&mut events, SILENCE).await.is_some() {}
    // A readiness check changes nothing.
    assert_eq!(server.request(Method::GET, "/readyz").send().await.unwrap().status(), 200);
    assert_eq!(next_within(&mut events, SILENCE).await, None);
    // A server that stops does not wait for event listeners.
    let begin = Instant::now();
    let stopped = tokio::join!(server.stop(), async {
        while events.chunk().await.is_ok_and(|it| it.is_some()) {}
    });
    drop(stopped);
    assert!(begin.elapsed() < Duration::from_secs(8), "{:?}", begin.elapsed());
}

#[tokio::test]
async fn a_study_is_counted_without_its_pilots() {
    let server = Server::with_study(SHORT_STUDY).await;
    let study = async || -> StudySummary {
        let study = server.admin(&routes::admin_study("default")).await.into(200);
        let all: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
        assert_eq!(all, [StudySummary::clone(&study)]);
        study
    };
    let empty = study().await;
    let counts = |it: &StudySummary| {
        [it.participants, it.complete, it.active, it.doubtful, it.trials, it.pilots]
    };
    assert_eq!((counts(&empty), empty.last_seen_at_ms), ([0; 6], None));
    assert_eq!((empty.title.as_str(), empty.status), ("Short", Status::Open));
    let pilot = json!({ "consent": true, "pilot": true });
    let pilot = Driver { enrolled: Driver::ask(&server, pilot).await.into(201) };
    pilot.drive(&server, 1).await;
    assert_eq!(counts(&study().await), [0, 0, 0, 0, 0, 1]);
    // One participant steers like a person and finishes, one never steers, and one leaves.
    let finishes = come(&server, "finishes").await;
    finishes.drive(&server, 5).await;
    finishes.complete(&server).await.into::<serde_json::Value>(200);
    drive(&server, &come(&server, "never").await, TurnInput::Straight, &[]).await;
    come(&server, "left").await.withdraw(&server, "keep").await;
    let found = study().await;
    assert_eq!(counts(&found), [3, 1, 1, 1, 10, 1]);
    assert!(found.last_seen_at_ms.is_some());
    let doubtful = format!("{}?having=doubtful", routes::admin_participants("default"));
    let doubtful: ParticipantPage = server.admin(&doubtful).await.into(200);
    let numbers: Vec<_> = doubtful.participants.iter().map(|person| person.number).collect();
    assert_eq!(numbers, [2], "who never steered");
}

#[tokio::test]
async fn a_revoked_key_hears_nothing_more() {
    let server = Server::with_study(SHORT_STUDY).await;
    let new = json!({ "name": "guest", "access": "read" });
    let made = server.request(Method::POST, routes::ADMIN_KEYS).bearer_auth(&server.key).json(&new);
    let guest: KeyMade = Answer::of(made).await.into(201);
    let request = server.request(Method::GET, routes::CHANGES).bearer_auth(&guest.secret);
    let mut events = request.send().await.unwrap();
    next(&mut events).await;
    let key = routes::admin_key(&guest.key.id.to_string());
    let revoke = server.request(Method::DELETE, &key).bearer_auth(&server.key);
    assert_eq!(Answer::of(revoke).await.status, 204);
    // The server ends the response; the timeout of the test does not.
    let ended = async { while events.chunk().await.unwrap().is_some() {} };
    tokio::time::timeout(PATIENCE, ended).await.expect("the answer goes on");
}
