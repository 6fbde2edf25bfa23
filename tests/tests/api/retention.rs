//! Data that have been stored for too long, and their deletion by rules.

use serde_json::{Value, json};
use sidestep::api::{Action, AuditPage, ParticipantPage, Stage, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server, behind, run};

async fn retention(server: &Server, args: &[&str]) -> Value {
    let database = server.database();
    run(&[&["retention", "--database", &database], args].concat()).await.json()
}

/// Four people: one has finished, two dropped out (one of them a moment ago), and one has an
/// external id.
async fn people() -> Server {
    let server = Server::with_study(SHORT_STUDY).await;
    let complete = Driver::enrol(&server).await;
    complete.drive(&server, 5).await;
    assert_eq!(complete.complete(&server).await.status, 200);
    Driver::enrol(&server).await.drive(&server, 2).await;
    Driver::enrol(&server).await.drive(&server, 1).await;
    let called = json!({
        "consent": true, "external_id": "5f0c", "parameters": { "SESSION_ID": "abc" },
    });
    assert_eq!(Driver::ask(&server, called).await.status, 201);
    let long_ago = "UPDATE participant SET last_seen_at_ms = last_seen_at_ms - 3456000000 \
                    WHERE number <> 3";
    behind(&server.database()).execute(long_ago).await.unwrap();
    server
}

#[tokio::test]
async fn rules_say_what_they_would_delete_and_delete_it_when_asked_to() {
    let server = people().await;
    let rules = ["--unfinished", "30", "--identities", "39", "--audit", "1"];
    let told = retention(&server, &rules).await;
    let rule = |told: &Value, i: usize| {
        let rule = &told["rules"][i];
        (rule["rule"].clone(), rule["study"].clone(), rule["which"].clone(), rule["count"].clone())
    };
    assert_eq!(told["deleted"], false);
    let found =
        |rule: &str, which: Value, count: i64| (json!(rule), json!("default"), which, json!(count));
    assert_eq!(rule(&told, 0), found("unfinished", json!(["2", "4"]), 2));
    assert_eq!(rule(&told, 1), found("identities", json!(["4"]), 1));
    assert_eq!(rule(&told, 2), (json!("audit"), Value::Null, Value::Null, json!(0)));
    let trials = async || -> i64 {
        let query = "SELECT count(*) FROM trial";
        behind(&server.database()).row(query, |row| row.get(0)).await.unwrap()
    };
    assert_eq!(trials().await, 8, "nothing was deleted");

    let identity = ["--identities", "39", "--delete"];
    assert_eq!(rule(&retention(&server, &identity).await, 0), rule(&told, 1));
    let again = retention(&server, &identity).await;
    assert_eq!(rule(&again, 0), (json!("identities"), json!("default"), Value::Null, json!(0)));
    let people = "SELECT count(*) FROM participant \
                  WHERE external_id IS NOT NULL OR external_key IS NOT NULL OR parameters IS NOT NULL";
    let known: i64 = behind(&server.database()).row(people, |row| row.get(0)).await.unwrap();
    assert_eq!(known, 0);

    let unfinished = ["--study", "default", "--unfinished", "30", "--delete"];
    assert_eq!(retention(&server, &unfinished).await["rules"][0]["count"], 2);
    assert_eq!(trials().await, 6, "those of people 1 and 3 remain");
    assert_eq!(retention(&server, &unfinished).await["rules"][0]["count"], 0);
    let route = routes::admin_participants("default");
    let page: ParticipantPage = server.admin(&route).await.into(200);
    let at = |stage: Stage| {
        page.stages.iter().find(|it| it.stage == stage).map_or(0, |it| it.participants)
    };
    assert_eq!((at(Stage::Withdrawn), at(Stage::Complete)), (2, 1));

    // The audit trail lists every deletion, and records that it was itself shortened.
    let aged = "UPDATE audit SET at_ms = at_ms - 3 * 86400000";
    behind(&server.database()).execute(aged).await.unwrap();
    let before: AuditPage = server.admin(routes::AUDIT).await.into(200);
    let by_us = |page: &AuditPage| -> Vec<(Action, Option<String>)> {
        let ours = page.entries.iter().filter(|entry| entry.who == "sidestep retention");
        ours.map(|entry| (entry.action, entry.subject.clone())).collect()
    };
    let entry = |action, subject: &str| (action, Some(subject.to_owned()));
    let expected = [
        entry(Action::ParticipantDeleted, "4"),
        entry(Action::ParticipantDeleted, "2"),
        entry(Action::IdentityDeleted, "4"),
    ];
    assert_eq!(by_us(&before), expected);
    retention(&server, &["--audit", "2", "--delete"]).await;
    let after: AuditPage = server.admin(routes::AUDIT).await.into(200);
    let count = before.entries.len().to_string();
    assert_eq!(by_us(&after), [entry(Action::AuditShortened, &count)]);

    // The remaining data are intact, and everything works.
    run(&["check", "--database", &server.database()]).await.json();
    let all = retention(&server, &["--data", "30", "--analyses", "1", "--delete"]).await;
    assert_eq!(all["rules"][0]["which"], json!(["1"]), "{all}");
    assert_eq!(trials().await, 1);
    run(&["check", "--database", &server.database()]).await.json();
}

#[tokio::test]
async fn rules_that_are_none_are_refused() {
    let database = Server::with_study(SHORT_STUDY).await;
    let database = database.database();
    let refused = async |args: &[&str], words: &[&str]| {
        let args = [&["retention", "--database", &database], args].concat();
        run(&args).await.refused(2, words);
    };
    refused(&["--delete"], &["--data", "--unfinished", "--identities"]).await;
    refused(&["--data", "0"], &["--data", "1..=36500"]).await;
    refused(&["--data", "3", "--study", "other"], &["--study other", "default"]).await;
    refused(&["--audit", "3", "--study", "default"], &["--audit", "--study"]).await;
}
