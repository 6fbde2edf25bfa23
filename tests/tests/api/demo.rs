//! `sidestep serve --demo`: the study that it fills, its mark as synthetic everywhere, and the
//! continuation after an interruption.

use serde_json::{Value, json};
use sidestep::api::{
    AnalysisPage, Configuration, ParticipantDetail, ParticipantPage, Stage, StudyInfo,
    StudySummary, TrialDetail, TrialPage, routes,
};
use sidestep::study::Status;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Address, Answer, Driver, Folder, Process, Server, behind, run};
use std::time::Duration;

/// Timeout for filling the study, long enough for any machine.
const PATIENCE: Duration = Duration::from_secs(600);

/// Starts a server with the demonstration and waits until it is filled. Its analysis might still be
/// running.
async fn filled() -> Server {
    let server = Server::with_study_and("", |args| {
        args.demo = true;
        args.study = None;
    });
    let server = server.await;
    until_filled(|| async { server.admin(&routes::admin_study("demo")).await }).await;
    server
}

/// Waits until the study is closed, which is the last step of filling.
async fn until_filled<F: Future<Output = Answer>>(ask: impl Fn() -> F) {
    let waited = tokio::time::timeout(PATIENCE, async {
        loop {
            let study: StudySummary = ask().await.into(200);
            if study.status == Status::Closed {
                break;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    });
    waited.await.expect("a demonstration that is filled");
}

#[tokio::test]
async fn every_page_of_the_demonstration_has_something_to_show() {
    let server = filled().await;
    let studies: Vec<StudySummary> = server.admin(routes::ADMIN_STUDIES).await.into(200);
    let [demo] = &studies[..] else { panic!("one study: {studies:?}") };
    assert!(demo.synthetic && demo.participants == 12, "{demo:?}");
    let people: ParticipantPage = server.admin(&routes::admin_participants("demo")).await.into(200);
    let at = |stage| people.participants.iter().filter(|of| of.stage == stage).count();
    let stages = [Stage::Complete, Stage::Withdrawn, Stage::Task, Stage::ScreenedOut].map(at);
    assert_eq!(stages, [9, 1, 1, 1]);
    let flagged = |of: fn(&sidestep::api::Quality) -> u32| {
        people.participants.iter().filter(|it| of(&it.quality) > 0).count()
    };
    assert!(flagged(|it| it.late_sample) > 0 && flagged(|it| it.focus_lost) > 0);
    assert_eq!(
        (flagged(|it| it.never_steered) > 0, flagged(|it| it.interrupted) > 0),
        (true, true)
    );
    let excluded = people.participants.iter().find(|it| it.excluded).unwrap();
    let route = routes::admin_participant(&excluded.participant_id);
    let excluded: ParticipantDetail = server.admin(&route).await.into(200);
    assert!(excluded.synthetic && !excluded.notes.is_empty() && !excluded.answers.is_empty());
    assert!(excluded.exclusion.is_some_and(|it| it.reason.contains("never steered")));
    let route = format!("{}?format=csv", routes::admin_participants("demo"));
    let table = server.admin_text(&route).await;
    let (header, rows) = table.split_once('\n').unwrap();
    let at = header.split(',').position(|name| name == "synthetic").unwrap();
    assert!(rows.lines().all(|row| row.split(',').nth(at) == Some("1")), "{rows}");
    let analyses: AnalysisPage = server.admin(&routes::admin_analyses("demo")).await.into(200);
    assert_eq!(analyses.analyses.len(), 1);
    let said = server.announcement();
    assert!(said.contains("/lab/studies/demo") && !said.contains("/s/demo"), "{said}");
    run(&["check", "--database", &server.database()]).await.json();
}

#[tokio::test]
async fn a_demonstration_is_marked_as_synthetic_and_takes_no_people() {
    let server = filled().await;
    let trials: TrialPage = server.admin(&routes::admin_trials("demo")).await.into(200);
    let trial = &trials.trials[0].trial_id;
    let trial: TrialDetail = server.admin(&routes::admin_trial(trial)).await.into(200);
    assert!(trial.synthetic);
    let folder = Folder::default();
    let out = folder.name("data");
    let database = server.database();
    let export = ["export", "--database", &database, "--study", "demo", "--out", &out];
    run(&[&export[..], &["--format", "psych-ds"]].concat()).await.json();
    let manifest: Value = serde_json::from_str(&folder.text("data/manifest.json")).unwrap();
    assert_eq!(manifest["synthetic"], true);
    for file in ["README.md", "dataset_description.json"] {
        let text = folder.text(&format!("data/{file}"));
        assert!(text.contains("synthetic)") && text.contains("no evidence about people"), "{text}");
    }
    let info: StudyInfo = server.get(&routes::study("demo")).await.into(200);
    assert_eq!(serde_json::to_value(info.admission).unwrap(), "closed");
    assert!(!server.admin_text("/").await.contains("/s/demo"));
    // People are not admitted even if someone opens the study.
    let route = routes::admin_status("demo");
    let request = server.request(reqwest::Method::PUT, &route).bearer_auth(&server.key);
    let opened: Configuration =
        Answer::of(request.json(&json!({"status": "open"}))).await.into(200);
    let person = json!({"consent": true, "screen": {"width": 1280}});
    let refused = Driver::ask_in(&server, "demo", person).await;
    assert!(refused.problem(403, "closed", None).contains("synthetic"));
    let pilot = json!({"consent": true, "pilot": true});
    assert_eq!(Driver::ask_in(&server, "demo", pilot).await.status, 201);
    // A synthetic study cannot become a study of people.
    let people = opened.toml.replace("synthetic = true", "synthetic = false");
    let body = json!({"toml": people, "base": opened.hash});
    let route = routes::admin_configuration("demo");
    let request = server.request(reqwest::Method::PUT, &route).bearer_auth(&server.key);
    let refused = Answer::of(request.json(&body)).await;
    assert!(refused.problem(422, "invalid", Some("synthetic")).contains("stay apart"));
    let request = server.request(reqwest::Method::POST, routes::ADMIN_DRAFTS);
    let checked = Answer::of(request.bearer_auth(&server.key).json(&body)).await;
    assert_eq!(checked.body["complaint"]["field"], "synthetic", "{}", checked.body);
}

/// A participant's number, the index of a scene, the stored states of the trial, and whether the
/// participant completed the study.
type Driven = (i64, i64, Vec<u8>, bool);

/// Asserts that participants, scenes and states are the same.
fn assert_same(found: &[Driven], expected: &[Driven]) {
    let other = found.iter().zip(expected).find(|(found, expected)| found != expected);
    let head = |it: &Driven| (it.0, it.1, it.2.len(), it.3);
    let other = other.map(|(found, expected)| (head(found), head(expected)));
    assert_eq!((found.len(), other), (expected.len(), None), "participant, scene, bytes, complete");
}

/// All stored trials, each with the progress of its participant.
async fn drives(folder: &Folder) -> Vec<Driven> {
    let query = "SELECT participant.number, scene.ordinal, trial.states, completed_at_ms IS NOT NULL \
                 FROM trial JOIN scene ON scene.trial_id = trial.trial_id \
                 JOIN participant ON participant.id = scene.participant_id ORDER BY 1, 2";
    let db = behind(&folder.database("sidestep.db"));
    db.rows(query, |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))).await.unwrap()
}

async fn until_status(server: &Address, folder: &Folder, enough: impl Fn(i64, bool) -> bool) {
    let waited = tokio::time::timeout(PATIENCE, async {
        loop {
            assert_eq!(server.get("/readyz").await.status, 200, "pages answer meanwhile");
            let db = behind(&folder.database("sidestep.db"));
            let query = "SELECT (SELECT count(*) FROM trial), json ->> '$.status' = 'closed' FROM study \
                         JOIN study_config ON hash = config_hash";
            let found = db.row(query, |row| Ok((row.get(0)?, row.get(1)?))).await;
            if found.is_ok_and(|(trials, closed)| enough(trials, closed)) {
                break;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    });
    waited.await.expect("a demonstration that goes on");
}

#[tokio::test]
async fn a_demonstration_that_was_killed_goes_on_and_is_the_same() {
    let (whole, broken) = (Folder::default(), Folder::default());
    let server = Process::start_demo(&whole).await;
    until_status(&server, &whole, |_, closed| closed).await;
    server.kill().await;
    let expected = drives(&whole).await;

    // Kill the server while participants drive, and after some have withdrawn or been screened out.
    for trials in [50, 200] {
        let server = Process::start_demo(&broken).await;
        until_status(&server, &broken, |stored, _| stored >= trials).await;
        server.kill().await;
    }
    let server = Process::start_demo(&broken).await;
    until_status(&server, &broken, |_, closed| closed).await;
    server.kill().await;
    assert_same(&drives(&broken).await, &expected);
    let counts = async || -> [i64; 4] {
        let query = "SELECT (SELECT count(*) FROM participant), (SELECT count(*) FROM note), \
                     (SELECT count(*) FROM exclusion), (SELECT count(*) FROM analysis)";
        let db = behind(&broken.database("sidestep.db"));
        let row = db.row(query, |row| Ok([row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?]));
        row.await.unwrap()
    };
    assert_eq!(counts().await, [12, 4, 1, 1]);

    // When the study is closed, another start adds nothing and does not announce filling.
    let server = Process::start_demo(&broken).await;
    assert!(!server.announcement.concat().contains("being filled"));
    server.kill().await;
    assert_eq!(counts().await, [12, 4, 1, 1]);
    assert_same(&drives(&broken).await, &expected);
    run(&["check", "--database", &broken.database("sidestep.db")]).await.json();
}

#[tokio::test]
async fn a_study_that_somebody_else_made_stays_as_it_is() {
    let folder = Folder::default();
    let study = format!("slug = \"demo\"\n{SHORT_STUDY}");
    let server = Server::with_study(&study).await;
    let database = server.database();
    let file = folder.file("study.toml", &study);
    let stopped = server.stop().await;
    let site = stopped.path("site").display().to_string();
    let args = ["serve", "--listen", "127.0.0.1:0", "--static", &site, "--demo"];
    let said = run(&[&args[..], &["--database", &database]].concat()).await;
    said.refused(2, &["--demo", "found another one", "--database"]);
    let query = "SELECT count(*) FROM participant";
    let people: i64 = behind(&database).row(query, |row| row.get(0)).await.unwrap();
    assert_eq!(people, 0);
    let said = run(&[&args[..], &["--database", &database, "--study", &file]].concat()).await;
    said.refused(2, &["--demo", "--study"]);
}

#[tokio::test]
async fn files_of_people_are_not_imported_among_synthetic_participants() {
    let server = Server::with_study("slug = \"rehearsal\"\nsynthetic = true\n").await;
    let folder = Folder::default();
    let (marked, people) = (folder.name("marked.csv"), folder.name("people.csv"));
    let simulate =
        ["simulate", "--participants", "1", "--seed", "3", "--tasks", "2", "--keys", "clock"];
    run(&[&simulate[..], &["--out", &marked]].concat()).await.json();
    let text = folder.text("marked.csv");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let place = header.iter().position(|name| *name == "synthetic").unwrap();
    let unmarked = |line: &str| {
        let mut cells: Vec<&str> = line.split(',').collect();
        cells[place] = "0";
        cells.join(",")
    };
    let rows: Vec<String> = lines.map(unmarked).collect();
    folder.file("people.csv", format!("{}\n{}\n", header.join(","), rows.join("\n")));
    let database = server.database();
    let import = ["import", "--database", &database, "--study", "rehearsal", "--trials"];
    let said = run(&[&import[..], &[&people]].concat()).await;
    said.refused(2, &["people.csv", "synthetic", "participant 0 without this mark"]);
    let said = run(&[&import[..], &[&marked]].concat()).await;
    assert_eq!(said.json()["participants"], 1);
}
