//! Damaged files: the reports of `check`, and the results of `salvage`.

use sha2::{Digest, Sha256};
use sidestep_tests::behind::new_postgres_database;
use sidestep_tests::process::Said;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Folder, Server, behind, run};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const PAGE: usize = 4096;

/// A database file with trials of people and imported trials. The trials of people are longer than
/// a page. Most pages contain trials.
async fn collected(folder: &Folder) -> String {
    let server = Server::on_a_file(SHORT_STUDY).await;
    for _ in 0..4 {
        Driver::enrol(&server).await.drive(&server, 5).await;
    }
    let (file, trials) = (folder.name("study.db"), folder.name("trials.csv"));
    let from = server.database();
    let simulate = ["simulate", "--participants", "12", "--seed", "1", "--out", &trials];
    run(&simulate).await.json();
    let import = ["import", "--study", "imported", "--trials", &trials, "--database", &from];
    run(&import).await.json();
    let stopped = server.stop().await;
    std::fs::copy(stopped.path("sidestep.db"), &file).unwrap();
    file
}

/// All trials of a file, each with a hash of all its stored data.
async fn trials(file: &str) -> BTreeMap<String, String> {
    let db = behind(&format!("sqlite:{file}"));
    let query = "SELECT trial_id, content_version || hex(content_hash) || received_at_ms || \
                 coalesce(started_at_ms, '') || hex(inputs) || hex(states) || \
                 hex(coalesce(sampled_at_ms, '')) || key_events || display || flags || closest_m FROM trial";
    let row = |row: &sidestep_tests::behind::BehindRow| {
        Ok((row.get(0)?, hex::encode(Sha256::digest(row.get::<String>(1)?))))
    };
    db.rows(query, row).await.unwrap().into_iter().collect()
}

/// The index of the page that contains these bytes.
fn page_of(file: &str, bytes: &[u8]) -> usize {
    let content = std::fs::read(file).unwrap();
    content.windows(bytes.len()).position(|window| window == bytes).unwrap() / PAGE
}

/// The index of the root page of a table or index.
async fn root_of(file: &str, name: &str) -> usize {
    let query = format!("SELECT rootpage FROM sqlite_schema WHERE name = '{name}'");
    let root: i64 = behind(&format!("sqlite:{file}")).row(&query, |row| row.get(0)).await.unwrap();
    usize::try_from(root).unwrap() - 1
}

/// The leaf pages of the schema. Its inner page is the first page of the file.
fn schema_leaves(file: &str) -> Vec<usize> {
    let content = std::fs::read(file).unwrap();
    let number = |at: usize, count: usize| {
        content[at..][..count].iter().fold(0, |number, byte| number << 8 | usize::from(*byte))
    };
    assert_eq!(content[100], 5, "an inner page");
    let cells = (0..number(103, 2)).map(|cell| number(number(112 + 2 * cell, 2), 4));
    cells.chain([number(108, 4)]).map(|page| page - 1).collect()
}

/// The id and one column of a stored trial.
async fn stored(file: &str, part: &str, of: &str) -> (String, Vec<u8>) {
    let query = format!("SELECT trial_id, {part} FROM trial WHERE {of} LIMIT 1");
    let db = behind(&format!("sqlite:{file}"));
    db.row(&query, |row| Ok((row.get(0)?, row.get(1)?))).await.unwrap()
}

/// A copy of a file with the bytes of one page replaced.
fn with_page(file: &str, name: &str, page: usize, byte: impl Fn(usize) -> u8) -> String {
    let mut content = std::fs::read(file).unwrap();
    for (at, place) in content[page * PAGE..][..PAGE].iter_mut().enumerate() {
        *place = byte(at);
    }
    let damaged = Path::new(file).with_file_name(name);
    std::fs::write(&damaged, content).unwrap();
    damaged.display().to_string()
}

fn noise(at: usize) -> u8 {
    Sha256::digest(at.to_le_bytes())[0]
}

/// Salvages a file and checks the guarantees: every trial is either saved unchanged or named, the
/// new database is sound, and the damaged file does not change. Returns the output and the lost
/// trials.
async fn salvaged(file: &str, before: &BTreeMap<String, String>) -> (Said, BTreeSet<String>) {
    let folder = Folder::default();
    let content = std::fs::read(file).unwrap();
    let (out, to) = (folder.name("saved.db"), folder.database("saved.db"));
    let said = run(&["salvage", "--from", file, "--database", &to]).await;
    assert!(std::fs::read(file).unwrap() == content, "the damaged file is as it was");
    let beside = ["-wal", "-shm", "-journal"].map(|end| format!("{file}{end}"));
    assert!(beside.iter().all(|path| !Path::new(path).exists()));
    run(&["check", "--database", &to]).await.json();
    let saved = trials(&out).await;
    assert!(saved.iter().all(|(id, row)| before.get(id) == Some(row)), "as it was");
    let lost: BTreeSet<String> =
        before.keys().filter(|id| !saved.contains_key(*id)).cloned().collect();
    let summary: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(summary["trials"], saved.len(), "{summary}");
    assert_eq!(said.code, Some(i32::from(summary["lost"] != 0)), "{}", said.err);
    (said, lost)
}

fn names_all(said: &Said, lost: &BTreeSet<String>) -> bool {
    lost.iter().all(|id| said.err.contains(&format!("sidestep: trial {id}: ")))
}

#[tokio::test]
async fn a_damaged_page_costs_what_is_on_it_and_no_more() {
    let folder = Folder::default();
    let file = collected(&folder).await;
    let before = trials(&file).await;
    assert!(before.len() > 600, "{}", before.len());
    let (_, none) = salvaged(&file, &before).await;
    assert!(none.is_empty(), "nothing is lost of a sound file");

    // Damage a leaf page of the table, and an overflow page that contains bytes of an upload.
    let (imported, hash) = stored(&file, "content_hash", "content_version = 2").await;
    let leaf = page_of(&file, &hash);
    let (uploaded, states) = stored(&file, "substr(states, 1201, 64)", "content_version = 3").await;
    let rest = page_of(&file, &states);
    for (trial, page) in [(&imported, leaf), (&uploaded, rest)] {
        for (name, byte) in [("zero.db", (|_| 0) as fn(usize) -> u8), ("noise.db", noise)] {
            let damaged = with_page(&file, name, page, byte);
            let (said, lost) = salvaged(&damaged, &before).await;
            // At most two such trials share a page.
            assert!(
                lost.contains(trial) && lost.len() <= 2 && names_all(&said, &lost),
                "{}",
                said.err
            );
            assert_eq!(said.err.lines().count(), lost.len() + 1, "{}", said.err);
        }
    }
    // One bit of a trial changed. The trial is readable, but differs from what was stored.
    let content = std::fs::read(&file).unwrap();
    let at = content.windows(states.len()).position(|window| window == states).unwrap() % PAGE;
    let flipped = with_page(&file, "flipped.db", rest, |place| {
        content[rest * PAGE + place] ^ u8::from(place == at)
    });
    let (said, lost) = salvaged(&flipped, &before).await;
    assert!(lost.len() == 1 && lost.contains(&uploaded), "{lost:?}");
    assert!(said.err.contains("not sound: the content is not that of its hash"), "{}", said.err);

    // Salvage also works into a database of the other kind. The counts of trials are recomputed.
    let other = new_postgres_database().await.unwrap_or_else(|| folder.database("other.db"));
    let salvage = ["salvage", "--from", &flipped, "--database", &other];
    assert_eq!(run(&salvage).await.code, Some(1));
    let sound = run(&["check", "--database", &other]).await.json();
    assert_eq!(sound["trials"], before.len() - 1);

    // Bytes of the header that are the same in every database are put back.
    for at in (16..24).chain([0, 31, 47, 52, 59, 67, 95]) {
        let damaged = with_page(&file, "header.db", 0, |place| {
            content[place] ^ u8::from(place == at).wrapping_mul(3)
        });
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(said.code == Some(0) && lost.is_empty(), "byte {at}: {}", said.err);
    }

    // If an index is lost, rows are found through their table, and no trial is lost.
    for index in [
        "sqlite_autoindex_trial_1",
        "sqlite_autoindex_scene_2",
        "sqlite_autoindex_participant_1",
        "sqlite_autoindex_study_config_1",
        "sqlite_autoindex_safety_function_1",
        "sqlite_autoindex_value_function_1",
    ] {
        let damaged = with_page(&file, "index.db", root_of(&file, index).await, |_| 0);
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(said.code == Some(0) && lost.is_empty(), "{index}: {}", said.err);
    }
    // If the root page of a table or the first page of the file is lost, all rows still exist, and
    // the identity and version of the database can be restored.
    let mut pages = vec![0];
    for table in ["trial", "scene", "mark", "_sqlx_migrations"] {
        pages.push(root_of(&file, table).await);
    }
    for page in pages {
        for byte in [(|_| 0) as fn(usize) -> u8, noise] {
            let damaged = with_page(&file, "inner.db", page, byte);
            let (said, lost) = salvaged(&damaged, &before).await;
            assert!(lost.is_empty(), "page {page}: {}", said.err);
        }
    }
    // The schema is the same in every database of this version, so it can be restored.
    let words = b"CREATE INDEX trial_of_study";
    let place = content.windows(words.len()).position(|window| window == words).unwrap();
    let damaged = with_page(&file, "words.db", place / PAGE, |at| {
        content[place / PAGE * PAGE + at] ^ u8::from(at == place % PAGE)
    });
    let (said, lost) = salvaged(&damaged, &before).await;
    assert!(said.code == Some(0) && lost.is_empty(), "{}", said.err);
    // Tables whose definitions are lost are restored over their surviving rows.
    for page in schema_leaves(&file) {
        let damaged = with_page(&file, "schema.db", page, |_| 0);
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(lost.is_empty(), "page {page}: {}", said.err);
    }
    // If another page of the table is written over the table's root page, its rows are hidden. The
    // index still names them.
    let root = root_of(&file, "trial").await;
    let damaged = with_page(&file, "hidden.db", root, |at| content[leaf * PAGE + at]);
    let (said, lost) = salvaged(&damaged, &before).await;
    assert!(lost.len() > before.len() / 2 && names_all(&said, &lost), "{}", said.err);
    // A schema page is also restored if only one of its sectors is lost, or if another page was
    // written over it.
    let schema = schema_leaves(&file)[0];
    for page in [schema, root_of(&file, "mark").await, root_of(&file, "_sqlx_migrations").await] {
        for sector in [0..512, PAGE - 512..PAGE] {
            let damaged = with_page(&file, "sector.db", page, |at| match sector.contains(&at) {
                true => 0,
                false => content[page * PAGE + at],
            });
            let (said, lost) = salvaged(&damaged, &before).await;
            assert!(lost.is_empty(), "page {page} without {sector:?}: {}", said.err);
        }
        for other in [leaf, root_of(&file, "study").await] {
            let damaged = with_page(&file, "over.db", page, |at| content[other * PAGE + at]);
            let (said, lost) = salvaged(&damaged, &before).await;
            assert!(lost.is_empty(), "page {other} over page {page}: {}", said.err);
        }
    }
    // In a file with another layout, the root pages of the lost tables are unknown.
    let moved = folder.name("moved.db");
    std::fs::copy(&file, &moved).unwrap();
    behind(&format!("sqlite:{moved}")).execute("VACUUM").await.unwrap();
    let mut without_loss = 0;
    for page in schema_leaves(&moved) {
        let damaged = with_page(&moved, "schema.db", page, |_| 0);
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(names_all(&said, &lost), "page {page}: {}", said.err);
        without_loss += usize::from(lost.is_empty());
    }
    assert!(without_loss > 4, "{without_loss}");
    // A row of `study` equals the study's last version, so it can be restored.
    let damaged = with_page(&file, "study.db", root_of(&file, "study").await, |_| 0);
    let (said, lost) = salvaged(&damaged, &before).await;
    assert!(lost.is_empty() && said.code == Some(0), "{}", said.err);
    // Without participants, trials have no owner. Without the parameters of a study, its trials
    // cannot be replayed. All these trials are named.
    for table in ["participant", "study_config"] {
        let damaged = with_page(&file, "people.db", root_of(&file, table).await, |_| 0);
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(lost.len() == before.len() && names_all(&said, &lost), "{table}");
    }
    // A truncated file loses only some of the trials.
    let short = folder.file("short.db", &content[..content.len() * 9 / 10 / PAGE * PAGE - 7]);
    let (said, lost) = salvaged(&short, &before).await;
    assert!(said.code == Some(1) && lost.len() < before.len() / 2, "{}: {}", lost.len(), said.err);
}

/// The keys of configurations and value functions are hashes of their content.
#[tokio::test]
async fn altered_configurations_and_value_functions_are_named() {
    let folder = Folder::default();
    let file = collected(&folder).await;
    let before = trials(&file).await;
    let of_imported = "(SELECT config_hash FROM study WHERE slug = 'imported')";
    let altered = async |change: String| {
        let name = folder.name("altered.db");
        std::fs::copy(&file, &name).unwrap();
        behind(&format!("sqlite:{name}")).execute(&change).await.unwrap();
        let check = run(&["check", "--database", &format!("sqlite:{name}")]).await;
        assert!(check.code == Some(1) && check.out.contains("altered"), "{change}: {}", check.out);
        let (said, lost) = salvaged(&name, &before).await;
        assert!(names_all(&said, &lost), "{}", said.err);
        (said, lost)
    };
    // The trials of an altered configuration are still saved, and the configuration gets the hash
    // of its content.
    let title = format!(
        "UPDATE study_config SET json = replace(json, '\"title\":\"', '\"title\":\"X') \
         WHERE hash = {of_imported}"
    );
    let (said, lost) = altered(title).await;
    assert!(lost.is_empty() && said.err.contains("altered, and is saved as"), "{}", said.err);
    let unreadable = format!("UPDATE study_config SET json = '{{' WHERE hash = {of_imported}");
    let (said, lost) = altered(unreadable).await;
    assert!(lost.len() == before.len() - 4 * 5, "the other study is saved");
    assert!(said.err.contains("sidestep: study_config "), "{}", said.err);
    let function = "UPDATE value_function SET octets = CAST(octets || x'00' AS BLOB)".to_owned();
    let (said, lost) = altered(function).await;
    let functions = said.err.lines().filter(|line| line.contains("value_function")).count();
    assert!(lost.is_empty() && functions > 0, "{}", said.err);
}

#[tokio::test]
async fn a_check_goes_on_after_damage_and_says_what_to_do() {
    let folder = Folder::default();
    let file = collected(&folder).await;
    let before = trials(&file).await;
    let (trial, hash) = stored(&file, "content_hash", "content_version = 2").await;
    let damaged = with_page(&file, "zero.db", page_of(&file, &hash), |_| 0);
    let database = format!("sqlite:{damaged}");
    let said = run(&["check", "--database", &database]).await;
    assert_eq!(said.code, Some(1));
    let words = ["sidestep restore", "sidestep salvage --from ", "zero.db", "stop the server"];
    assert!(words.iter().all(|word| said.err.contains(word)), "{}", said.err);
    let report: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let checked = usize::try_from(report["trials"].as_u64().unwrap()).unwrap();
    let wrong = report["wrong"].as_array().unwrap();
    assert!(checked + wrong.len() == before.len() && wrong.len() <= 2, "{report}");
    assert!(wrong.iter().any(|wrong| wrong["trial_id"] == *trial), "{report}");
    let page = page_of(&file, &hash) + 1;
    let place = |line: &serde_json::Value| {
        let line = line.as_str().unwrap();
        line.starts_with("trial, ") && line.contains(&format!("page {page}"))
    };
    assert!(report["damage"].as_array().unwrap().iter().any(place), "{report}");
    // Other commands also tell the user what to do.
    let out = folder.name("backup.db");
    let backup = run(&["backup", "--database", &database, "--out", &out]).await;
    backup.refused(1, &["damaged", "sidestep check", "sidestep restore", "sidestep salvage"]);
    // An export contains everything that can be read.
    let out = folder.name("export");
    let export = ["export", "--database", &database, "--study", "imported", "--out", &out];
    let export = run(&export).await;
    assert!(export.code == Some(1) && export.err.contains(&trial), "{}", export.err);
}

/// Flips a bit of the id that joins a trial and its scene, in each row and index that contains the
/// id.
#[tokio::test]
async fn a_trial_that_damage_hides_is_counted() {
    let folder = Folder::default();
    let file = collected(&folder).await;
    let before = trials(&file).await;
    let all = before.len() - 4 * 5;
    let (trial, _) = stored(&file, "content_hash", "content_version = 2").await;
    let content = std::fs::read(&file).unwrap();
    let windows = content.windows(trial.len()).enumerate();
    let places: Vec<_> =
        windows.filter(|(_, id)| *id == trial.as_bytes()).map(|(at, _)| at).collect();
    assert!(places.len() >= 4, "rows and indices of two tables");
    let mut hidden = 0;
    for (number, place) in places.into_iter().enumerate() {
        let (page, place) = (place / PAGE, place % PAGE + 20);
        let damaged = with_page(&file, "flipped.db", page, |at| {
            content[page * PAGE + at] ^ u8::from(at == place)
        });
        let (database, out) = (format!("sqlite:{damaged}"), folder.name(&format!("{number}")));
        let export = ["export", "--database", &database, "--study", "imported", "--out", &out];
        let said = run(&export).await;
        let summary: serde_json::Value = serde_json::from_str(&said.out).unwrap();
        let is_trials = |file: &&serde_json::Value| file["name"] == "trials.csv";
        let files = summary["files"].as_array().unwrap();
        let rows = files.iter().find(is_trials).unwrap()["rows"].as_u64().unwrap();
        let missing = all as u64 - rows;
        assert!(missing <= summary["damaged_trials"].as_u64().unwrap(), "{summary}: {}", said.err);
        let is_damaged = ["damaged_trials", "database_damage"].iter().any(|of| summary[of] != 0);
        assert_eq!(said.code, Some(i32::from(is_damaged)), "{}", said.err);
        hidden += missing;
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(lost.is_subset(&BTreeSet::from([trial.clone()])), "{}", said.err);
    }
    assert!(hidden > 0);
}

/// Values that a sound database cannot have.
#[tokio::test]
async fn a_value_that_the_new_database_refuses_costs_its_own_row() {
    let folder = Folder::default();
    let file = collected(&folder).await;
    let before = trials(&file).await;
    for (name, change, words) in [
        (
            "evader.db",
            "UPDATE safety_function SET evader = 'nobody' WHERE evader = (SELECT min(evader) FROM safety_function)",
            "safety_function of study ",
        ),
        ("key.db", "UPDATE api_key SET access = 'nobody'", "sidestep: api_key "),
        (
            "token.db",
            "UPDATE participant_token SET participant_id = 'nobody' \
             WHERE rowid = (SELECT min(rowid) FROM participant_token)",
            "participant_token (1 of participant nobody): participant nobody is lost",
        ),
    ] {
        let damaged = folder.name(name);
        std::fs::copy(&file, &damaged).unwrap();
        let unchecked = "PRAGMA ignore_check_constraints = ON; PRAGMA foreign_keys = OFF";
        let db = behind(&format!("sqlite:{damaged}"));
        db.execute(&format!("{unchecked}; {change}")).await.unwrap();
        let (said, lost) = salvaged(&damaged, &before).await;
        assert!(lost.is_empty() && said.code == Some(1), "{name}: {}", said.err);
        assert!(said.err.contains(words), "{name}: {}", said.err);
    }
}

#[tokio::test]
async fn what_cannot_be_salvaged_is_refused() {
    let folder = Folder::default();
    let to = folder.database("new.db");
    let garbage = folder.file("garbage.db", (0..50_000).map(noise).collect::<Vec<_>>());
    let empty = folder.file("empty.db", "");
    for (from, words) in [
        (&garbage, "not a database"),
        (&empty, "it is empty"),
        (&folder.name("nowhere.db"), "No such file"),
        (&folder.name(""), "directory"),
    ] {
        let said = run(&["salvage", "--from", from, "--database", &to]).await;
        said.refused(2, &["--from", "cannot read", words]);
    }
    // Pages that the server has not yet checkpointed are in the write-ahead log.
    let server = Server::on_a_file(SHORT_STUDY).await;
    Driver::enrol(&server).await.drive(&server, 3).await;
    let file = server.path("sidestep.db").display().to_string();
    let said = run(&["salvage", "--from", &file, "--database", &to]).await;
    said.refused(2, &["--from", "a server uses it"]);
    for end in ["", "-wal"] {
        std::fs::copy(format!("{file}{end}"), folder.name(&format!("crashed.db{end}"))).unwrap();
    }
    let salvage = ["salvage", "--from", &folder.name("crashed.db"), "--database", &to];
    assert_eq!(run(&salvage).await.only_json()["trials"], 3);
    run(&salvage).await.refused(2, &["--database", "new.db", "it has data"]);
    let left = folder.names();
    assert!(!left.iter().any(|name| name.starts_with('.')), "{left:?}");
}
