//! Databases of other versions, and identities that persist.

use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{
    AnalysisDetail, AnalysisPage, Configuration, Enrolled, Plan, Progress, TrialDetail, TrialPage,
    routes,
};
use sidestep::scene::{Evader, SceneParameters};
use sidestep_tests::behind::new_postgres_database;
use sidestep_tests::server::{SHORT_STUDY, write_site};
use sidestep_tests::{Answer, Driver, Folder, Server, behind, driven, driven_with, run};
use std::path::{Path, PathBuf};

fn old(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/old-database").join(name)
}

fn facts() -> Value {
    serde_json::from_slice(&std::fs::read(old("facts.json")).unwrap()).unwrap()
}

/// A participant of the old database with the data that the browser keeps, and further facts about
/// the participant.
fn known(name: &str) -> (Driver, Value) {
    let facts = facts()["participants"][name].clone();
    let enrolled = Enrolled {
        participant_id: facts["participant_id"].as_str().unwrap_or_default().to_owned(),
        token: facts["token"].as_str().unwrap().to_owned(),
        plan: Plan { phases: Vec::new() },
    };
    (Driver { enrolled }, facts)
}

/// Drives the next trial with these vehicles.
async fn goes_on(server: &Server, driver: &Driver, parameters: &SceneParameters) {
    let before: Progress = driver.me(server).await.into(200);
    let next = before.next.unwrap();
    let scene = before.plan.scenes().find(|(_, scene)| scene.trial_id == next).unwrap().1;
    let answer = driver.send(server, &next, &driven_with(parameters, &scene.scene())).await;
    assert_eq!(answer.status, 201, "{}", answer.body);
    let after: Progress = driver.me(server).await.into(200);
    assert_eq!(after.stored, [before.stored, vec![next.clone()]].concat());
    let detail: TrialDetail = server.admin(&routes::admin_trial(&next)).await.into(200);
    assert_eq!((detail.replay.exact, detail.parameters), (true, *parameters));
    assert!(detail.value_function(Evader::Human).is_some());
}

#[tokio::test]
async fn a_database_of_the_version_before_goes_on() {
    goes_on_with_all(Server::with_database(SHORT_STUDY, &old("sidestep.db")).await).await;
}

#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_postgresql_database_of_the_version_before_goes_on() {
    let url = new_postgres_database().await.expect("a cluster, which cargo xtask test starts");
    let dump = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/old-postgres/schema-2.sql");
    behind(&url).execute(&std::fs::read_to_string(dump).unwrap()).await.unwrap();
    goes_on_with_all(Server::on(url, Some(SHORT_STUDY)).await).await;
}

/// Checks the content of the old database against its README, and continues with it.
async fn goes_on_with_all(server: Server) {
    // Earlier versions did not number the configurations of a study.
    for slug in ["first", "second", "default"] {
        let configuration: Configuration =
            server.admin(&routes::admin_configuration(slug)).await.into(200);
        let versions = &configuration.versions;
        assert_eq!(versions[0].toml, configuration.toml, "{slug}");
        let numbers: Vec<_> = versions.iter().map(|version| version.number as usize).collect();
        assert_eq!(numbers, (1..=versions.len()).rev().collect::<Vec<_>>(), "{slug}");
    }
    let exported = server.export("first").await;
    let old_facts = facts();
    let (incomplete, known_of_them) = known("incomplete");

    // If the same upload is repeated, it is accepted as identical. A different upload is refused.
    let me: Progress = incomplete.me(&server).await.into(200);
    assert_eq!(json!(me.stored), known_of_them["stored"]);
    let route = routes::my_trial(&me.stored[1]);
    let send =
        |upload: &Value| Answer::of(incomplete.request(&server, Method::PUT, &route).json(upload));
    let mut upload = known_of_them["upload"].clone();
    assert_eq!(send(&upload).await.status, 200);
    upload["display"]["refresh_hz"] = json!(75.0);
    send(&upload).await.problem(409, "different_content", None);
    assert_eq!(server.export("first").await, exported);

    // Participants can continue and return, and new ones can enrol.
    goes_on(&server, &incomplete, &SceneParameters::default()).await;
    let mut faster = SceneParameters::default();
    for vehicle in [&mut faster.human, &mut faster.robot] {
        (vehicle.speed_mps, vehicle.turn_rate_radps) = (2.5, 0.6);
    }
    faster.danger_radius_m = 2.5;
    goes_on(&server, &known("second").0, &faster).await;
    let again = json!({ "consent": true, "external_id": " p-17 " });
    let again: Enrolled = Driver::ask_in(&server, "first", again).await.into(200);
    assert_eq!(json!(again.participant_id), known_of_them["participant_id"]);
    assert_eq!(again.plan, me.plan);
    for (slug, scenes) in [("first", 6), ("second", 2), ("default", 5)] {
        let enrolled: Enrolled =
            Driver::ask_in(&server, slug, json!({ "consent": true })).await.into(201);
        assert_eq!(enrolled.plan.scenes().count(), scenes, "{slug}");
    }
    let (complete, expected) = known("complete");
    let code = complete.complete(&server).await;
    assert_eq!(code.body["completion_code"], expected["completion_code"]);
    for gone in ["withdrawn", "deleted"] {
        known(gone).0.me(&server).await.problem(410, "withdrawn", None);
    }

    // The laboratory finds the old data.
    let page: TrialPage = server.admin(&routes::admin_trials("first")).await.into(200);
    assert_eq!(page.trials.len() * 50, server.export("first").await.lines().count() - 1);
    let id = old_facts["analysis"]["id"].as_str().unwrap();
    let page: AnalysisPage = server.admin(&routes::admin_analyses("first")).await.into(200);
    assert_eq!(page.analyses.iter().map(|a| &a.id[..]).collect::<Vec<_>>(), [id]);
    let detail: AnalysisDetail = server.admin(&routes::admin_analysis(id)).await.into(200);
    for file in &detail.files {
        let route = routes::analysis_file(id, &file.name);
        let answer = server.request(Method::GET, &route).bearer_auth(&server.key);
        let bytes = answer.send().await.unwrap().bytes().await.unwrap();
        assert_eq!(bytes.len() as u64, file.octets, "{}", file.name);
    }
    assert_eq!(detail.files.len(), 13);

    // `check` replays every trial of the migrated database and finds nothing wrong.
    let report = run(&["check", "--database", &server.database()]).await.json();
    assert_eq!(report["wrong"], json!([]));
    assert_eq!((&report["damage"], &report["trials"]), (&json!([]), &json!(21)));
    assert!(server.restarted().await.export("first").await.starts_with("participant,"));
}

#[tokio::test]
async fn ids_that_are_one_person_now_belong_to_the_first() {
    let folder = Folder::default();
    let file = folder.path("sidestep.db");
    std::fs::copy(old("sidestep.db"), &file).unwrap();
    let database = folder.database("sidestep.db");
    let change = "UPDATE participant SET external_id = ' P-' || 18 WHERE number = 2 AND study_id = 1; \
                  UPDATE participant SET external_id = 'p-18' WHERE number = 3 AND study_id = 1";
    behind(&database).execute(change).await.unwrap();
    Server::on(database.clone(), None).await.stop().await;
    let query = "SELECT number, external_key FROM participant WHERE study_id = 1 \
                 AND number IN (2, 3) ORDER BY number";
    let found: Vec<(i64, Option<String>)> =
        behind(&database).rows(query, |row| Ok((row.get(0)?, row.get(1)?))).await.unwrap();
    assert_eq!(found, [(2, Some("p-18".to_owned())), (3, None)]);
}

#[tokio::test]
async fn a_configuration_is_known_by_what_was_stored() {
    let server = Server::on_a_file(SHORT_STUDY).await;
    let database = server.database();
    let stopped = server.stop().await;
    // The stored configuration lacks a field that this version writes, and its fields have another
    // order, as if an earlier version had stored it.
    let otherwise = r#"{ "title": "Short", "slug": "default",
        "phases": [{ "phase": "task", "scenes": 2 }],
        "parameters": { "steps": 50, "step_s": 0.2, "danger_radius_m": 3.0,
            "robot": { "turn_rate_radps": 0.5, "speed_mps": 2.0 },
            "human": { "turn_rate_radps": 0.5, "speed_mps": 2.0 } } }"#;
    let hash = "0123456789abcdef".repeat(4);
    let change = format!(
        "INSERT INTO study_config VALUES ('{hash}', '{otherwise}'); \
         UPDATE study SET config_hash = '{hash}'"
    );
    behind(&database).execute(&change).await.unwrap();
    let same = "title = \"Short\"\nphases = [{ phase = \"task\", scenes = 2 }]\n";
    stopped.write_study(same);
    let server = stopped.start().await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 2).await;
    let counts = format!(
        "SELECT count(*), (SELECT count(*) FROM study_config) FROM participant \
         WHERE config_hash = '{hash}'"
    );
    let counts: (i64, i64) =
        behind(&database).row(&counts, |row| Ok((row.get(0)?, row.get(1)?))).await.unwrap();
    assert_eq!(counts, (1, 2), "an equal configuration is not stored again");
    let detail: TrialDetail =
        server.admin(&routes::admin_trial(&driver.scenes()[0].0)).await.into(200);
    assert!(detail.value_function(Evader::Human).is_some());
}

#[tokio::test]
async fn numbers_are_never_used_twice() {
    let server = Server::with_database(SHORT_STUDY, &old("sidestep.db")).await;
    let highest = async |table: &str| -> i64 {
        let query = format!("SELECT seq FROM sqlite_sequence WHERE name = '{table}'");
        behind(&server.database()).row(&query, |row| row.get(0)).await.unwrap()
    };
    let before = highest("analysis").await;
    let id = facts()["analysis"]["id"].as_str().unwrap().to_owned();
    let delete = server.request(Method::DELETE, &routes::admin_analysis(&id));
    assert_eq!(Answer::of(delete.bearer_auth(&server.key)).await.status, 204);
    let ask = server.request(Method::POST, &routes::admin_analyses("second"));
    let asked = Answer::of(ask.bearer_auth(&server.key).json(&json!({}))).await;
    assert_eq!(asked.status, 201, "{}", asked.body);
    assert_eq!(highest("analysis").await, before + 1);

    let drives = async || {
        let enrolled = Driver::ask_in(&server, "first", json!({ "consent": true })).await;
        let driver = Driver { enrolled: enrolled.into(201) };
        driver.drive(&server, 1).await;
        driver
    };
    let driver = drives().await;
    let before = highest("trial").await;
    assert_eq!(driver.withdraw(&server, "delete").await.status, 200);
    drives().await;
    assert_eq!(highest("trial").await, before + 1);
}

/// Checks that commands reject a database after this change and give the reason, and that the file
/// stays unchanged to the last byte.
async fn is_refused(change: &str, words: &[&str]) {
    let folder = Folder::default();
    let file = folder.path("sidestep.db");
    std::fs::copy(old("sidestep.db"), &file).unwrap();
    let database = folder.database("sidestep.db");
    behind(&database).execute(change).await.unwrap();
    let before = std::fs::read(&file).unwrap();
    let out = folder.name("out");
    for args in [
        &["check", "--database", &database][..],
        &["export", "--database", &database, "--study", "first", "--out", &out],
    ] {
        run(args).await.refused(1, &[&["sidestep.db"], words].concat());
        assert!(std::fs::read(&file).unwrap() == before, "{args:?} wrote to the file");
    }
}

#[tokio::test]
async fn what_cannot_be_used_stays_as_it_was() {
    let newer = "INSERT INTO _sqlx_migrations \
                 VALUES (99, 'later', '2030-01-01', 1, x'00', 0)";
    is_refused(newer, &["newer version of Sidestep", "99", "update"]).await;
    let other = "UPDATE _sqlx_migrations SET checksum = x'00' WHERE version = 2";
    is_refused(other, &["migration 2", "another build"]).await;
    is_refused("DROP TABLE _sqlx_migrations", &["another program"]).await;
    // The fourth migration fails half-way, and its first statements are rolled back.
    let in_the_way = "CREATE TABLE new_analysis (x)";
    is_refused(in_the_way, &["migration 4 failed", "nothing was changed"]).await;
}

#[tokio::test]
async fn reading_changes_no_file_of_an_older_version() {
    let folder = Folder::default();
    let file = folder.path("sidestep.db");
    std::fs::copy(old("sidestep.db"), &file).unwrap();
    let before = std::fs::read(&file).unwrap();
    let (database, to) = (folder.database("sidestep.db"), folder.database("to.db"));
    let [out, backup] = ["out", "backup.db"].map(|name| folder.name(name));
    for args in [
        &["check", "--database", &database][..],
        &["export", "--database", &database, "--study", "first", "--out", &out],
        &["backup", "--database", &database, "--out", &backup],
        &["retention", "--database", &database, "--audit", "1"],
        &["copy", "--from", &database, "--to", &to],
    ] {
        run(args).await.json();
        assert!(std::fs::read(&file).unwrap() == before, "{args:?} wrote to the file");
    }
    #[cfg(unix)]
    for file in std::fs::read_dir(&out).unwrap() {
        let about = file.unwrap().metadata().unwrap();
        assert_eq!(std::os::unix::fs::PermissionsExt::mode(&about.permissions()) & 0o777, 0o600);
    }
    // Files that a killed command left are deleted by the next command.
    let left_behind = folder.path(".sidestep-copy-killed");
    std::fs::create_dir(&left_behind).unwrap();
    std::fs::write(left_behind.join("copy.db"), b"external ids").unwrap();
    run(&["check", "--database", &database]).await.json();
    let left = std::fs::read_dir(folder.root()).unwrap().map(|it| it.unwrap().file_name());
    let is_left = |name: &str| name.starts_with('.') || name.starts_with("sidestep.db-");
    assert!(left.into_iter().all(|name| !is_left(&name.to_string_lossy())));
    // While another program serves the database, it must not be migrated.
    let served = std::fs::File::open(&file).unwrap();
    served.lock().unwrap();
    let site = folder.name("site");
    write_site(Path::new(&site));
    let serve = ["serve", "--listen", "127.0.0.1:0", "--static", &site, "--database", &database];
    let delete = ["retention", "--database", &database, "--audit", "1", "--delete"];
    for args in [&serve[..], &delete] {
        run(args).await.refused(1, &["sidestep.db", "another 'sidestep serve'"]);
        assert!(std::fs::read(&file).unwrap() == before, "{args:?} wrote to the file");
    }
    run(&["check", "--database", &database]).await.json();
    drop(served);
    run(&delete).await.json();
    assert!(std::fs::read(&file).unwrap() != before, "it is migrated");
}

/// Each error is one line with instructions, and the exit code is 1.
#[tokio::test]
#[ignore = "needs PostgreSQL"]
async fn a_postgresql_database_that_cannot_be_used_says_what_to_do() {
    let new =
        async || new_postgres_database().await.expect("a cluster, which cargo xtask test starts");
    let url = new().await;
    let whole = url.as_str();
    let (_, rest) = whole.split_once(":///").unwrap();
    let name = rest.split('?').next().unwrap();
    let admin = behind(whole);
    let folder = Folder::default();
    let site = folder.name("site");
    write_site(Path::new(&site));
    let serve = async |url: &str| {
        run(&["serve", "--listen", "127.0.0.1:0", "--static", &site, "--database", url]).await
    };
    serve("postgres://me:secret@127.0.0.1:1/db").await.refused(1, &["check the host and the port"]);
    serve(&whole.replace(name, "absent")).await.refused(1, &["absent", "createdb"]);
    let narrow = format!("{name}_narrow");
    let encoding = "ENCODING 'SQL_ASCII' LC_COLLATE 'C' LC_CTYPE 'C' TEMPLATE template0";
    admin.execute(&format!("CREATE DATABASE {narrow} {encoding}")).await.unwrap();
    serve(&whole.replace(name, &narrow)).await.refused(1, &["UTF8", "SQL_ASCII", "template0"]);
    let asks = |number: &str| format!("ALTER DATABASE {name} SET sidestep.writers = '{number}'");
    for wrong in ["abc", "0", "65"] {
        admin.execute(&asks(wrong)).await.unwrap();
        serve(whole).await.refused(1, &["sidestep.writers", "from 1 to 64", wrong]);
    }
    admin.execute(&asks("4")).await.unwrap();
    Server::on(url.clone(), Some(SHORT_STUDY)).await.stop().await;

    // A user with read-only access.
    let reader = format!("reader_{name}");
    let grants = format!(
        "CREATE ROLE {reader} LOGIN; GRANT USAGE ON SCHEMA public TO {reader}; \
         GRANT SELECT ON ALL TABLES IN SCHEMA public TO {reader}"
    );
    admin.execute(&grants).await.unwrap();
    let owner = rest.split('&').find(|part| part.starts_with("user=")).unwrap();
    let of = |user: &str| whole.replace(owner, &format!("user={user}"));
    serve(&of(&reader)).await.refused(1, &["must not write to", "trial", "GRANT"]);
    run(&["check", "--database", &of(&reader)]).await.json();
    serve(&of("nobody_at_all")).await.refused(1, &["nobody_at_all", "check the user"]);
    let writes = format!(
        "GRANT INSERT, UPDATE, DELETE ON ALL TABLES IN SCHEMA public TO {reader}; \
         GRANT USAGE, SELECT ON SEQUENCE changed TO {reader}"
    );
    admin.execute(&writes).await.unwrap();
    let server = Server::on(of(&reader), Some(SHORT_STUDY)).await;
    assert_eq!(server.get("/readyz").await.status, 200);
    Driver::enrol(&server).await.drive(&server, 5).await;
    admin.execute(&format!("REVOKE INSERT ON trial FROM {reader}")).await.unwrap();
    let told = server.get("/readyz").await;
    assert!(told.problem(503, "not_ready", None).contains("must not write to trial"));
    // A database whose content is hidden is not mistaken for a new one.
    for (hide, show) in [
        ("ALTER TABLE trial RENAME TO hidden", "ALTER TABLE hidden RENAME TO trial"),
        ("REVOKE USAGE ON SCHEMA public FROM PUBLIC", "GRANT USAGE ON SCHEMA public TO PUBLIC"),
    ] {
        admin.execute(&format!("GRANT INSERT ON trial TO {reader}")).await.unwrap();
        admin.execute(&format!("REVOKE USAGE ON SCHEMA public FROM {reader}")).await.unwrap();
        assert_eq!(server.get("/readyz").await.status, 200);
        admin.execute(hide).await.unwrap();
        server.get("/readyz").await.problem(503, "not_ready", None);
        let said = run(&["check", "--database", &of(&reader)]).await;
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(!said.err.contains("does not exist, or it is empty"), "{said:?}");
        admin.execute(show).await.unwrap();
    }
    server.stop().await;

    // Commands that only read do not migrate.
    let old = new().await;
    let dump = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/old-postgres/schema-2.sql");
    behind(&old).execute(&std::fs::read_to_string(dump).unwrap()).await.unwrap();
    run(&["check", "--database", &old]).await.refused(1, &["older version", "sidestep serve"]);
    let last = "SELECT CAST(max(version) AS BIGINT) FROM sidestep_migration";
    assert_eq!(behind(&old).row(last, |row| row.get::<i64>(0)).await.unwrap(), 2);
}

#[tokio::test]
async fn an_enrolment_repeated_after_a_lost_answer_is_one_participant() {
    let server = Server::on_a_file(SHORT_STUDY).await;
    let body = json!({ "consent": true, "request_id": "3f0e2d6c-7a44-4c3e-9b1e-000000000001" });
    let asked = (0..8).map(|_| Driver::ask(&server, body.clone()));
    let answers = futures_util::future::join_all(asked).await;
    assert_eq!(answers.iter().filter(|a| a.status == 201).count(), 1);
    let enrolled: Vec<Enrolled> =
        answers.into_iter().map(|a| serde_json::from_value(a.body).unwrap()).collect();
    for again in &enrolled {
        assert_eq!(again.participant_id, enrolled[0].participant_id);
        assert_eq!(again.plan, enrolled[0].plan);
    }
    // The tokens of all responses are valid, because any of the responses can be the one that the
    // client receives.
    let driver = Driver { enrolled: enrolled[7].clone() };
    let (trial_id, scene) = driver.scenes()[0].clone();
    assert_eq!(driver.send(&server, &trial_id, &driven(&scene)).await.status, 201);
    let other = json!({ "consent": true, "request_id": "3f0e2d6c-7a44-4c3e-9b1e-000000000002" });
    assert_eq!(Driver::ask(&server, other).await.status, 201);
    // The same request id with another external id is another request.
    for (person, status) in [("alice", 201), ("bob", 201), ("alice", 200)] {
        let mut body = body.clone();
        body["external_id"] = person.into();
        assert_eq!(Driver::ask(&server, body).await.status, status);
    }
    let short = json!({ "consent": true, "request_id": "1" });
    Driver::ask(&server, short).await.problem(422, "invalid", Some("request_id"));
    let query = "SELECT count(*) FROM participant";
    let people: i64 = behind(&server.database()).row(query, |row| row.get(0)).await.unwrap();
    assert_eq!(people, 4);
}
