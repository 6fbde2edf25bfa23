//! Synthetic participants, written to files or taking part through the server.

use serde_json::{Value, json};
use sidestep::api::{TrialDetail, TrialPage, routes};
use sidestep::trial::Phase;
use sidestep::vehicle::TurnInput;
use sidestep_tests::folder::data;
use sidestep_tests::process::Said;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Folder, Server, behind, run};

async fn simulate(args: &[&str]) -> Said {
    run(&[&["simulate"], args].concat()).await
}

async fn summary(args: &[&str]) -> Value {
    simulate(args).await.only_json()
}

#[tokio::test]
async fn the_reference_byte_for_byte() {
    let folder = Folder::default();
    let out = folder.name("trials.csv");
    let reference = std::fs::read_to_string(data("trials.csv")).unwrap();
    let args = ["--seed", "20180918", "--participants"];
    let done = summary(&[&args[..], &["8", "--out", &out]].concat()).await;
    assert!(folder.text("trials.csv") == reference);
    assert_eq!(done["rows"], 20_000);
    // Keys that change within a step cannot be replayed from one input per step. The command
    // reports this.
    assert!(done["flags"]["replay_mismatch"].as_u64().unwrap() > 300, "{done}");
    // The first participants do not depend on the number of participants and tasks.
    let piped = simulate(&[&args[..], &["1", "--tasks", "7", "--out", "-"]].concat()).await.out;
    assert_eq!(piped.lines().count(), 351);
    assert!(reference.starts_with(&piped));
}

#[tokio::test]
async fn drives_on_the_clock_are_imported_without_a_flag() {
    let folder = Folder::default();
    let out = folder.name("trials.csv");
    let people = ["--participants", "3", "--seed", "20180918", "--tasks", "6"];
    let done = summary(&[&people[..], &["--keys", "clock", "--out", &out]].concat()).await;
    let expected = json!({
        "synthetic": true, "participants": 3, "trials": 18, "rows": 900, "keys": "clock",
        "flags": {}, "file": out,
    });
    assert_eq!(done, expected);
    let database = folder.database("study.db");
    let imported = run(&["import", "--database", &database, "--trials", &out]).await.json();
    let expected =
        json!({ "participants": 3, "trials": 18, "flagged": 0, "skipped": 0, "excluded": 0 });
    assert_eq!(imported, expected);
    // Synthetic trials stay labelled as such, in the study and in its export.
    let (copy, exported) = (folder.name("copy"), folder.name("copy/steps.csv"));
    run(&["export", "--database", &database, "--out", &copy]).await.json();
    for (i, source) in [["--database", &database], ["--trials", &exported]].iter().enumerate() {
        let analysis = folder.name(&i.to_string());
        let args = [&["analyze"], &source[..], &["--out", &analysis]].concat();
        let done = run(&args).await.json();
        assert_eq!((&done["synthetic"], &done["participants"]), (&json!(true), &json!(3)));
    }
    // The scenes equal the reference's scenes.
    let start = |file: &str| -> Vec<f64> {
        let row = file.lines().nth(1).unwrap().split(',').skip(4).take(6);
        row.map(|number| number.parse().unwrap()).collect()
    };
    let ours = start(&folder.text("trials.csv"));
    let theirs = start(&std::fs::read_to_string(data("trials.csv")).unwrap());
    assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 1e-7));
}

#[tokio::test]
async fn people_take_part_through_the_server() {
    let server = Server::with_study(SHORT_STUDY).await;
    let args = ["--seed", "5", "--url", &server.origin, "--study", "default", "--participants"];
    // A participant who has not driven all tasks is not complete, and continues later.
    let mut expected = json!({
        "synthetic": true, "participants": 2, "trials": 8, "already_stored": 0, "flags": {},
        "url": server.origin, "study": "default",
    });
    assert_eq!(summary(&[&args[..], &["2", "--tasks", "2"]].concat()).await, expected);
    let complete = async || -> i64 {
        let query = "SELECT count(completed_at_ms) FROM participant";
        behind(&server.database()).row(query, |row| row.get(0)).await.unwrap()
    };
    assert_eq!(complete().await, 0);
    expected["trials"] = json!(10);
    expected["already_stored"] = json!(8);
    assert_eq!(summary(&[&args[..], &["2", "--tasks", "50"]].concat()).await, expected);
    assert_eq!(complete().await, 2);

    let page: TrialPage = server.admin(&routes::admin_trials("default")).await.into(200);
    assert_eq!(page.trials.len(), 10);
    let mut turns = 0;
    for trial in &page.trials {
        assert_eq!(trial.flags, []);
        let detail: TrialDetail =
            server.admin(&routes::admin_trial(&trial.trial_id)).await.into(200);
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
    let studies = server.admin(routes::ADMIN_STUDIES).await;
    assert_eq!(studies.body[0]["participants"], 3, "{}", studies.body);
    assert_eq!(studies.body[0]["trials"], 15, "{}", studies.body);
    run(&["check", "--database", &server.database()]).await.json();
}

#[tokio::test]
async fn simulated_people_pass_the_check_and_answer_the_questions() {
    let study = r#"
phases = [{ phase = "task", scenes = 1 }]
comprehension = { attempts = 1 }
recruitment = { require_external_id = true, quota = 2 }
[[questions]]
name = "age"
kind = "scale"
from = 18
to = 30
required = true
text = { en = "How old are you?" }
[[questions]]
name = "hand"
kind = "choice"
required = true
text = { en = "Which hand?" }
options = [{ value = "left", text = { en = "L" } }, { value = "right", text = { en = "R" } }]
[[questions]]
name = "words"
kind = "text"
max_chars = 3
required = true
text = { en = "Anything else?" }
"#;
    let server = Server::with_study(study).await;
    let args =
        ["--seed", "5", "--url", &server.origin, "--study", "default", "--participants", "2"];
    summary(&args).await;
    let query = "SELECT count(understood_at_ms), count(completed_at_ms), min(answers), \
                     min(consent_language) FROM participant";
    let found: (i64, i64, String, String) = behind(&server.database())
        .row(query, |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))
        .await
        .unwrap();
    let answers = r#"{"age":24,"hand":"left","words":"syn"}"#;
    assert_eq!(found, (2, 2, answers.to_owned(), "en".to_owned()));
}

/// Vehicles, step duration and number of steps come from the study.
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
    run(&["check", "--database", &server.database()]).await.json();
}

#[tokio::test]
async fn bad_input_is_named() {
    let folder = Folder::default();
    let (out, nowhere) = (folder.name("trials.csv"), folder.name("no/trials.csv"));
    let one = ["--participants", "1", "--seed", "1"];
    let with = |args: &[&'static str]| [&one[..], args].concat();
    let to = |args: &[&'static str]| [&["--out", &out], args].concat();
    let away = "http://127.0.0.1:1";
    let mut table = vec![
        (to(&["--seed", "1", "--participants", "0"]), vec!["--participants", "1..=10000"]),
        (to(&["--seed", "1", "--participants", "9999999"]), vec!["--participants"]),
        (to(&["--seed", "-1", "--participants", "1"]), vec!["--seed", "'-1'"]),
        (to(&["--seed", "x", "--participants", "1"]), vec!["--seed", "'x'"]),
        (to(&["--participants", "1"]), vec!["--seed"]),
        (one.to_vec(), vec!["--out", "--url"]),
        (
            with(&["--url", away, "--keys", "free"]),
            vec!["--keys: expected clock with --url", "found free"],
        ),
        (with(&["--url", away, "--study", "../x"]), vec!["--study: expected", "found \"../x\""]),
    ];
    for (flag, value, words) in [
        ("--tasks", "0", "--tasks"),
        ("--tasks", "1001", "--tasks"),
        ("--tasks", "1.5", "--tasks"),
        ("--keys", "slow", "clock, free"),
        ("--url", away, "--url"),
        ("--study", "default", "--study"),
    ] {
        table.push(([&one[..], &to(&[flag, value])].concat(), vec![words]));
    }
    for url in ["ftp://127.0.0.1", "127.0.0.1:8080", "http://user:secret@host", ""] {
        let words = vec!["--url: expected an address such as http://", url];
        table.push((with(&["--url", url]), words));
    }
    for (args, words) in table {
        simulate(&args).await.refused(2, &words);
    }
    let words = "trials.csv: cannot write: there is no folder";
    simulate(&[&one[..], &["--out", &nowhere]].concat()).await.refused(1, &[words]);
    assert!(folder.names().is_empty());
}

#[tokio::test]
async fn what_the_server_says_is_passed_on() {
    let server = Server::with_study(SHORT_STUDY).await;
    let at = async |url: &str, further: &[&str]| {
        let args = ["--participants", "1", "--seed", "1", "--url", url];
        simulate(&[&args[..], further].concat()).await
    };
    let nobody = "http://127.0.0.1:1: no answer";
    at("http://127.0.0.1:1", &[]).await.refused(1, &[nobody, "refused"]);
    let unknown = "--study nobody: no such study at http://";
    at(&server.origin, &["--study", "nobody"]).await.refused(2, &[unknown]);
    let unknown = "--study default: no such study at http://";
    let elsewhere = format!("{}/elsewhere", server.origin);
    at(&elsewhere, &[]).await.refused(2, &[unknown, "/elsewhere"]);

    // A participant who has withdrawn cannot return.
    let body = json!({ "consent": true, "external_id": "synthetic-1-0" });
    let leaver = Driver { enrolled: Driver::ask(&server, body).await.into(201) };
    assert_eq!(leaver.withdraw(&server, "keep").await.status, 200);
    let words = ["the enrolment was refused (410)", "withdrawn"];
    at(&server.origin, &[]).await.refused(1, &words);
}
