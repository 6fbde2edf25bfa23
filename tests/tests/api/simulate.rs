//! Synthetic participants: into files, and through the server.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{TrialDetail, TrialPage, routes};
use sidestep::trial::Phase;
use sidestep::vehicle::TurnInput;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Server, behind, sidestep};
use std::path::Path;
use tempfile::TempDir;

const REFERENCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/tests/data/trials.csv");

/// What the command prints to stdout, which it must end well for.
async fn simulate(args: &[&str]) -> String {
    let output = sidestep(&[&["simulate"], args].concat()).await;
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.as_str()), (Some(0), ""), "{args:?}");
    String::from_utf8(output.stdout).unwrap()
}

async fn summary(args: &[&str]) -> Value {
    let line = simulate(args).await;
    assert_eq!(line.lines().count(), 1, "{line}");
    serde_json::from_str(&line).unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[tokio::test]
async fn the_reference_octet_for_octet() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("trials.csv");
    let reference = std::fs::read_to_string(REFERENCE).unwrap();
    let args = ["--seed", "20180918", "--participants"];
    let done = summary(&[&args[..], &["8", "--out", text(&out)]].concat()).await;
    assert!(std::fs::read_to_string(&out).unwrap() == reference);
    assert_eq!(done["rows"], 20_000);
    // Keys that change within steps do not replay from one input a step, and that is said.
    assert!(done["flags"]["replay_mismatch"].as_u64().unwrap() > 300, "{done}");
    // The first people are the same however many there are, and however much they drive.
    let piped = simulate(&[&args[..], &["1", "--tasks", "7", "--out", "-"]].concat()).await;
    assert_eq!(piped.lines().count(), 351);
    assert!(reference.starts_with(&piped));
}

#[tokio::test]
async fn drives_on_the_clock_are_imported_without_a_flag() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("trials.csv");
    let people = ["--participants", "3", "--seed", "20180918", "--tasks", "6"];
    let done = summary(&[&people[..], &["--keys", "clock", "--out", text(&out)]].concat()).await;
    let expected = json!({
        "synthetic": true, "participants": 3, "trials": 18, "rows": 900, "keys": "clock",
        "flags": {}, "file": out,
    });
    assert_eq!(done, expected);
    let database = format!("sqlite:{}", folder.path().join("study.db").display());
    let import = ["import", "--database", &database, "--trials", text(&out)];
    let imported = sidestep(&import).await;
    let imported: Value = serde_json::from_slice(&imported.stdout).unwrap();
    let expected = json!({ "participants": 3, "trials": 18, "flagged": 0, "skipped": 0 });
    assert_eq!(imported, expected);
    // What nobody drove stays known as such, in the study and in its export.
    let copy = folder.path().join("copy");
    let export =
        ["export", "--database", &database, "--study", "default", "--format", "csv", "--out"];
    let exported = sidestep(&[&export[..], &[text(&copy)]].concat()).await;
    assert_eq!(exported.status.code(), Some(0));
    let copy = copy.join("trials.csv");
    let sources = [["--database", &database], ["--trials", text(&copy)]];
    for (i, source) in sources.into_iter().enumerate() {
        let analysis = folder.path().join(i.to_string());
        let args = [&["analyze"], &source[..], &["--out", text(&analysis)]].concat();
        let done: Value = serde_json::from_slice(&sidestep(&args).await.stdout).unwrap();
        assert_eq!((&done["synthetic"], &done["participants"]), (&json!(true), &json!(3)));
    }
    // The scenes are the reference's.
    let start = |file: &str| -> Vec<f64> {
        let row = file.lines().nth(1).unwrap().split(',').skip(4).take(6);
        row.map(|number| number.parse().unwrap()).collect()
    };
    let ours = start(&std::fs::read_to_string(&out).unwrap());
    let theirs = start(&std::fs::read_to_string(REFERENCE).unwrap());
    assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 1e-7));
}

#[tokio::test]
async fn people_take_part_through_the_server() {
    let server = Server::with_study(SHORT_STUDY).await;
    let args = ["--seed", "5", "--url", &server.origin, "--study", "default", "--participants"];
    // Who drives a part of their tasks is not complete, and goes on later.
    let mut expected = json!({
        "synthetic": true, "participants": 2, "trials": 8, "already_stored": 0, "flags": {},
        "url": server.origin, "study": "default",
    });
    assert_eq!(summary(&[&args[..], &["2", "--tasks", "2"]].concat()).await, expected);
    let complete = || -> i64 {
        let query = "SELECT count(completed_at_ms) FROM participant";
        behind(&server.database()).query_row(query, [], |row| row.get(0)).unwrap()
    };
    assert_eq!(complete(), 0);
    expected["trials"] = json!(10);
    expected["already_stored"] = json!(8);
    assert_eq!(summary(&[&args[..], &["2", "--tasks", "50"]].concat()).await, expected);
    assert_eq!(complete(), 2);

    let admin = |route: &str| {
        Answer::of(server.request(Method::GET, route).bearer_auth(server.key.as_str()))
    };
    let page: TrialPage = admin(&routes::admin_trials("default")).await.into(200);
    assert_eq!(page.trials.len(), 10);
    let mut turns = 0;
    for trial in &page.trials {
        assert_eq!(trial.flags, []);
        let detail: TrialDetail = admin(&routes::admin_trial(&trial.trial_id)).await.into(200);
        assert!(detail.replay.exact);
        assert_eq!(detail.states[0], detail.scene.start());
        turns += detail.inputs.iter().filter(|&&input| input != TurnInput::Straight).count();
    }
    assert!(turns > 0, "nobody ever turned");
    let practised = page.trials.iter().filter(|trial| trial.phase == Phase::Practice).count();
    assert_eq!(practised, 2);

    // The same people again, and one more.
    expected["participants"] = json!(3);
    expected["trials"] = json!(15);
    expected["already_stored"] = json!(10);
    assert_eq!(summary(&[&args[..], &["3"]].concat()).await, expected);
    let studies = admin(routes::ADMIN_STUDIES).await;
    assert_eq!(studies.body[0]["participants"], 3, "{}", studies.body);
    assert_eq!(studies.body[0]["trials"], 15, "{}", studies.body);
    let check = sidestep(&["check", "--database", &server.database()]).await;
    assert!(check.status.success());
}

/// Vehicles, clock and number of steps are the study's.
#[tokio::test]
async fn other_studies_are_driven_by_their_own_rules() {
    let study = r#"
title = "Other"
phases = [{ phase = "task", scenes = 4 }]
[parameters]
step_s = 0.1
steps = 80
[parameters.robot]
speed_mps = 1.5
"#;
    let server = Server::with_study_and(study, |args| args.no_solve = true).await;
    let args = ["--participants", "1", "--seed", "0", "--url", &server.origin];
    let done = summary(&args).await;
    assert_eq!((&done["trials"], &done["flags"]), (&json!(4), &json!({})));
    let check = sidestep(&["check", "--database", &server.database()]).await;
    assert!(check.status.success());
}

async fn fails(args: &[&str], code: i32, words: &[&str]) {
    let output = sidestep(&[&["simulate"], args].concat()).await;
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{args:?}: {said}");
    assert!(output.stdout.is_empty(), "{args:?}");
    for word in words {
        assert!(said.contains(word), "{word} in {said}");
    }
}

#[tokio::test]
async fn bad_input_is_named() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("trials.csv");
    let people = ["--participants", "1", "--seed", "1"];
    let with = |args: &[&'static str]| [&people[..], args].concat();
    let to = |args: &[&'static str]| [&["--out", text(&out)], args].concat();
    fails(&to(&["--seed", "1", "--participants", "0"]), 2, &["--participants", "1..=10000"]).await;
    fails(&to(&["--seed", "1", "--participants", "9999999"]), 2, &["--participants"]).await;
    fails(&to(&["--seed", "-1", "--participants", "1"]), 2, &["--seed", "'-1'"]).await;
    fails(&to(&["--seed", "x", "--participants", "1"]), 2, &["--seed", "'x'"]).await;
    fails(&to(&["--participants", "1"]), 2, &["--seed"]).await;
    for tasks in ["0", "1001", "1.5"] {
        let tasks = [&people[..], &to(&["--tasks"]), &[tasks]].concat();
        fails(&tasks, 2, &["--tasks"]).await;
    }
    fails(&[&people[..], &to(&["--keys", "slow"])].concat(), 2, &["--keys", "clock, free"]).await;
    fails(&people, 2, &["--out", "--url"]).await;
    fails(&[&people[..], &to(&["--url", "http://127.0.0.1:1"])].concat(), 2, &["--url"]).await;
    fails(&[&people[..], &to(&["--study", "default"])].concat(), 2, &["--study"]).await;
    let free = with(&["--url", "http://127.0.0.1:1", "--keys", "free"]);
    fails(&free, 2, &["--keys: expected clock with --url", "found free"]).await;
    for url in ["https://127.0.0.1", "127.0.0.1:8080", "http://user:secret@host", ""] {
        let args = [&people[..], &["--url", url]].concat();
        fails(&args, 2, &["--url: expected an address such as http://", url]).await;
    }
    let slug = with(&["--url", "http://127.0.0.1:1", "--study", "../x"]);
    fails(&slug, 2, &["--study: expected", "found \"../x\""]).await;
    assert!(!out.exists());
    let nowhere = folder.path().join("no").join("trials.csv");
    let args = [&people[..], &["--out", text(&nowhere)]].concat();
    fails(&args, 1, &["trials.csv: cannot write: there is no folder"]).await;
}

#[tokio::test]
async fn what_the_server_says_is_passed_on() {
    let server = Server::with_study(SHORT_STUDY).await;
    let people = ["--participants", "1", "--seed", "1", "--url"];
    let at = |url: &'static str| [&people[..], &[url]].concat();
    fails(&at("http://127.0.0.1:1"), 1, &["http://127.0.0.1:1: no answer", "refused"]).await;
    let unknown = [&people[..], &[&server.origin, "--study", "nobody"]].concat();
    fails(&unknown, 2, &["--study nobody: no such study at http://"]).await;
    let elsewhere = format!("{}/elsewhere", server.origin);
    let args = [&people[..], &[&elsewhere]].concat();
    fails(&args, 2, &["--study default: no such study at http://", "/elsewhere"]).await;

    // Someone who has withdrawn does not come back.
    let enrol = server.request(Method::POST, &routes::participants("default"));
    let body = json!({ "consent": true, "external_id": "synthetic-1-0" });
    let enrolled: sidestep::api::Enrolled = Answer::of(enrol.json(&body)).await.into(201);
    let withdraw = format!("{}?data=keep", routes::ME);
    let withdraw = server.request(Method::DELETE, &withdraw).bearer_auth(&enrolled.token);
    assert_eq!(Answer::of(withdraw).await.status, 204);
    let again = [&people[..], &[&server.origin]].concat();
    fails(&again, 1, &["the enrolment was refused (410)", "withdrawn"]).await;
}
