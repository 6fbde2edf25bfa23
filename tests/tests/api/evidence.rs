//! Whatever a participant's computer records, the data are stored and flagged.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{Completed, KeyEvent, TrialStored, TrialUpload, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Folder, Server, behind, driven, run};

/// Sends a body byte for byte.
async fn send(server: &Server, driver: &Driver, route: &str, body: String) -> Answer {
    let request = driver.request(server, Method::PUT, route);
    Answer::of(request.header("content-type", "application/json").body(body)).await
}

async fn flags(server: &Server, id: &str) -> Value {
    server.admin(&routes::admin_trial(id)).await.body["flags"].clone()
}

#[tokio::test]
async fn trials_of_odd_computers_are_stored_and_flagged() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    let pressed = |i: usize| KeyEvent {
        t_ms: 2.0 * i as f64,
        key: "ArrowLeft".to_owned(),
        down: i.is_multiple_of(2),
    };
    let key = |t_ms: f64, key: &str| KeyEvent { t_ms, key: key.to_owned(), down: false };
    type Change<'a> = Box<dyn Fn(&mut TrialUpload) + 'a>;
    let cases: [(Change<'_>, Value); 5] = [
        (Box::new(|trial| trial.started_at_ms = -5.0), json!(["wrong_clock"])),
        (Box::new(|trial| trial.started_at_ms = 1e300), json!(["wrong_clock"])),
        // 200 key presses in 0.8 s.
        (
            Box::new(|trial| trial.key_events = (0..400).map(pressed).collect()),
            json!(["fast_keys"]),
        ),
        (
            Box::new(|trial| trial.key_events = vec![key(7.0, "a\nb"), key(6.0, "")]),
            json!(["unordered_times"]),
        ),
        (
            Box::new(|trial| {
                trial.sampled_at_ms[9] = 0.0;
                trial.exposures = 20_000;
            }),
            json!(["late_sample", "interrupted", "shown_before", "unordered_times"]),
        ),
    ];
    for ((id, scene), (change, expected)) in scenes.iter().zip(&cases) {
        let mut trial = driven(scene);
        change(&mut trial);
        let stored: TrialStored = driver.send(&server, id, &trial).await.into(201);
        assert_eq!(stored.trial_id, *id);
        assert_eq!(flags(&server, id).await, *expected);
        assert_eq!(driver.send(&server, id, &trial).await.status, 200, "the same again");
    }
    let checked = async |database: &str| {
        let said = run(&["check", "--database", database]).await;
        assert!(matches!(said.code, Some(0 | 1)), "{}", said.err);
        said.code == Some(0)
    };
    assert!(checked(&server.database()).await);
    // A trial of an earlier version can lack flags that were added later, and is valid
    // nevertheless. A trial with wrong flags is damaged.
    let change = async |flags: &str| {
        let change =
            format!("UPDATE trial SET flags = '{flags}' WHERE trial_id = '{}'", scenes[0].0);
        behind(&server.database()).execute(&change).await.unwrap();
    };
    change("").await;
    assert!(checked(&server.database()).await);
    change("fast_keys").await;
    assert!(!checked(&server.database()).await);
    change("wrong_clock").await;
    // An export can be imported unchanged.
    let folder = Folder::default();
    let file = folder.file("steps.csv", server.export("default").await);
    let elsewhere = folder.database("other.db");
    let args = ["import", "--database", &elsewhere, "--trials", &file];
    assert_eq!(run(&args).await.json()["flagged"], 5);
    assert!(checked(&elsewhere).await);
}

#[tokio::test]
async fn characters_that_no_file_can_hold_are_replaced_and_flagged() {
    let server = Server::with_study(&format!(
        "{SHORT_STUDY}{}",
        r#"
        [[questions]]
        name = "words"
        kind = "text"
        max_chars = 9
        text = { en = "Anything else?" }
        [recruitment]
        record = ["source"]
        "#
    ))
    .await;
    let enrolment =
        r#"{"consent":true,"parameters":{"source":"a\u0000b"},"screen":{"x":"\ud800"}}"#;
    let request = server.request(Method::POST, &routes::participants("default"));
    let request = request.header("content-type", "application/json").body(enrolment);
    let driver = Driver { enrolled: Answer::of(request).await.into(201) };
    let (id, scene) = driver.scenes()[0].clone();
    let trial = serde_json::to_string(&driven(&scene)).unwrap();
    let odd = trial.replacen("\"refresh_hz\"", "\"gpu\":\"\\u0000\\ud83d\",\"refresh_hz\"", 1);
    let route = routes::my_trial(&id);
    assert_eq!(send(&server, &driver, &route, odd.clone()).await.status, 201);
    assert_eq!(send(&server, &driver, &route, odd).await.status, 200, "the same again");
    assert_eq!(flags(&server, &id).await, json!(["replaced_characters"]));
    let other = trial.replacen("\"refresh_hz\"", "\"gpu\":\"x\",\"refresh_hz\"", 1);
    let conflict = send(&server, &driver, &route, other).await;
    conflict.problem(409, "different_content", None);
    for (id, scene) in driver.scenes().into_iter().skip(1) {
        let trial = serde_json::to_value(driven(&scene)).unwrap();
        assert_eq!(driver.put(&server, &routes::my_trial(&id), &trial).await.status, 201);
    }
    // A surrogate pair and line ends are kept. A lone surrogate, NUL and other control characters
    // are replaced.
    let answers = r#"{"answers":{"words":"\ud83d\ude00\ud83d\u0000\u001b\na"}}"#.to_owned();
    assert_eq!(send(&server, &driver, routes::ANSWERS, answers).await.status, 204);
    let _: Completed = driver.complete(&server).await.into(200);
    let query = "SELECT answers FROM participant";
    let stored: String = behind(&server.database()).row(query, |row| row.get(0)).await.unwrap();
    assert_eq!(stored, "{\"words\":\"😀\u{fffd}\u{fffd}\u{fffd}\\na\"}");
    // Texts that are too long and invalid JSON are still rejected.
    let long = format!(r#"{{"answers":{{"words":"{}"}}}}"#, "\\ud800".repeat(10));
    let refused = send(&server, &driver, routes::ANSWERS, long).await;
    refused.problem(422, "invalid", Some("answers.words"));
    let broken = send(&server, &driver, routes::ANSWERS, r#"{"answers":"\ud8"#.to_owned()).await;
    broken.problem(400, "malformed", None);
    let folder = Folder::default();
    let args = ["export", "--database", &server.database(), "--out", &folder.name("out")];
    run(&args).await.json();
    let people = folder.text("out/participants.csv");
    assert!(people.contains("replaced_characters"), "{people}");
    assert!(people.contains("a\u{fffd}b"), "{people}");
}
