//! Exports in all formats, and exports as archives over HTTP.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use sidestep::api::{KeyEvent, routes};
use sidestep_tests::folder;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::sqlite::{self, Cell, cells};
use sidestep_tests::{Driver, Folder, Server, behind, driven, run};
use sqlx::sqlite::SqliteRow;
use sqlx::{AssertSqlSafe, Column, Connection, Row, SqliteConnection};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{Cursor, Read};
use std::path::Path;

const FORMATS: [&str; 5] = ["csv", "jsonl", "parquet", "psych-ds", "sqlite"];

/// A study with two participants. One of them pressed a key whose name is a spreadsheet formula.
async fn study() -> Server {
    let server = Server::with_study(SHORT_STUDY).await;
    let (ada, bob) = (Driver::enrol(&server).await, Driver::enrol(&server).await);
    ada.drive(&server, 4).await;
    bob.drive(&server, 2).await;
    let (last, scene) = ada.scenes()[4].clone();
    let mut odd = driven(&scene);
    odd.key_events = vec![KeyEvent { t_ms: -1.5, key: "=1,\"x".to_owned(), down: true }];
    assert_eq!(ada.send(&server, &last, &odd).await.status, 201);
    server
}

async fn export(server: &Server, format: &str, out: &str, more: &[&str]) {
    let database = server.database();
    let args = ["export", "--database", &database, "--format", format, "--out", out];
    run(&[&args[..], more].concat()).await.json();
}

/// The content of all files in a folder and its subfolders, by path with forward slashes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(open) = folders.pop() {
        for entry in std::fs::read_dir(open).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_str().unwrap().replace('\\', "/");
                found.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    found
}

fn json(file: &[u8]) -> Value {
    serde_json::from_slice(file).unwrap()
}

/// The names of the variables in Psych-DS metadata.
fn variables(metadata: &Value) -> Vec<String> {
    let variables = metadata["variableMeasured"].as_array().unwrap();
    variables
        .iter()
        .map(|variable| {
            assert_eq!(variable["@type"], "PropertyValue");
            assert!(!variable["description"].as_str().unwrap().is_empty());
            variable["name"].as_str().unwrap().to_owned()
        })
        .collect()
}

/// Checks the rules of the standard's validator that can apply to an export.
#[tokio::test]
async fn psych_ds_is_what_its_validator_wants() {
    let server = study().await;
    let folder = Folder::default();
    export(&server, "csv", &folder.name("csv"), &[]).await;
    export(&server, "psych-ds", &folder.name("psych"), &[]).await;
    let (tables, found) = (files(&folder.path("csv")), files(&folder.path("psych")));
    let description = json(&found["dataset_description.json"]);
    assert_eq!(description["@context"], "https://schema.org/");
    assert_eq!((&description["@type"], &description["name"]), (&json!("Dataset"), &json!("Short")));
    assert!(description["description"].as_str().unwrap().contains("Short"));
    let mut columns = BTreeSet::new();
    for (table, keyword) in [
        ("steps", "steps"),
        ("trials", "trials"),
        ("key_events", "keyevents"),
        ("participants", "participants"),
    ] {
        let name = format!("data/study-default_description-{keyword}_data");
        let file = &found[&format!("{name}.csv")];
        // The table is the same as in the CSV export.
        assert_eq!(file, &tables[&format!("{table}.csv")]);
        let mut reader = csv::Reader::from_reader(&file[..]);
        let header: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
        assert!(reader.records().all(|row| row.unwrap().len() == header.len()));
        let sidecar = json(&found[&format!("{name}.json")]);
        assert_eq!(variables(&sidecar), header, "{table}");
        columns.extend(header);
    }
    let listed = variables(&description);
    assert_eq!(listed.len(), columns.len(), "each once");
    assert_eq!(listed.into_iter().collect::<BTreeSet<_>>(), columns);
    // In a file name, the value of a keyword consists of letters and digits.
    for path in found.keys().filter(|path| path.ends_with("_data.csv")) {
        let name = path.strip_prefix("data/").unwrap().strip_suffix("_data.csv").unwrap();
        for keyword in name.split('_') {
            let (key, value) = keyword.split_once('-').unwrap();
            assert!(["study", "description"].contains(&key), "{path}");
            assert!(value.chars().all(|sign| sign.is_ascii_alphanumeric()), "{path}");
        }
    }
    for recommended in ["README.md", "CHANGES.md", "data/file_metadata.json"] {
        assert!(!found[recommended].is_empty());
    }
    for recommended in ["analysis/", "results/", "materials/", "documentation/"] {
        assert!(found.keys().any(|path| path.starts_with(recommended)), "{recommended}");
    }
    let ignored = std::str::from_utf8(&found[".psychds-ignore"]).unwrap();
    assert_eq!(ignored.lines().collect::<Vec<_>>(), ["manifest.json", ".psychds-ignore"]);
    assert!(found.values().all(|file| !file.is_empty()));
    assert_eq!(found["documentation/configurations.json"], tables["configurations.json"]);
}

async fn rows(db: &mut SqliteConnection, query: &str) -> Vec<SqliteRow> {
    sqlx::query(AssertSqlSafe(query)).fetch_all(db).await.unwrap()
}

#[tokio::test]
async fn sqlite_has_the_same_rows() {
    let server = study().await;
    let folder = Folder::default();
    export(&server, "csv", &folder.name("csv"), &[]).await;
    export(&server, "sqlite", &folder.name("sqlite"), &[]).await;
    let mut db = sqlite::open(&folder.path("sqlite/study.sqlite")).await.unwrap();
    let sound = sqlx::query_scalar::<_, String>("PRAGMA integrity_check").fetch_one(&mut db).await;
    assert_eq!(sound.unwrap(), "ok");
    for (table, key) in [
        ("steps", &["participant", "trial", "step"][..]),
        ("trials", &["participant", "trial"]),
        ("key_events", &["participant", "trial", "event"]),
        ("participants", &["participant"]),
    ] {
        let primary =
            format!("SELECT name FROM pragma_table_info('{table}') WHERE pk > 0 ORDER BY pk");
        let primary = sqlx::query_scalar::<_, String>(AssertSqlSafe(primary)).fetch_all(&mut db);
        assert_eq!(primary.await.unwrap(), key);

        let text = folder.text(&format!("csv/{table}.csv"));
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let rows = rows(&mut db, &format!("SELECT * FROM {table}")).await;
        let columns: Vec<&str> = rows[0].columns().iter().map(Column::name).collect();
        assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>(), columns);
        let records: Vec<_> = reader.records().map(Result::unwrap).collect();
        assert_eq!(records.len(), rows.len(), "{table}");
        for (record, row) in records.iter().zip(&rows) {
            for (place, cell) in cells(row).unwrap().into_iter().enumerate() {
                match cell {
                    Cell::Null => assert_eq!(&record[place], ""),
                    Cell::Integer(number) => assert_eq!(record[place], number.to_string()),
                    Cell::Real(number) => {
                        let printed: f64 = record[place].parse().unwrap();
                        assert_eq!(printed.to_bits(), number.to_bits());
                    }
                    // Only CSV puts an apostrophe before a formula.
                    Cell::Text(text) => {
                        assert_eq!(
                            record[place].strip_prefix('\'').unwrap_or(&record[place]),
                            text
                        );
                    }
                    Cell::Bytes(_) => panic!("a blob in {table}"),
                }
            }
        }
    }
    let words = "SELECT unit FROM dictionary WHERE \"table\" = 'steps' AND name = 'omega'";
    assert_eq!(rows(&mut db, words).await[0].get::<&str, _>(0), "rad/s");
    let configuration = &rows(&mut db, "SELECT * FROM configurations").await[0];
    let (hash, study): (&str, &str) = (configuration.get(0), configuration.get(1));
    assert_eq!(hash, hex::encode(Sha256::digest(study)));
    db.close().await.unwrap();
    let dictionary = json(folder.text("sqlite/dictionary.json").as_bytes());
    assert_eq!(
        (&dictionary[0]["table"], &dictionary[0]["missing"]),
        (&json!("steps"), &json!("NULL"))
    );
    let dictionary = json(folder.text("csv/dictionary.json").as_bytes());
    assert_eq!(dictionary[0]["missing"], "an empty field");
    // Two exports are identical.
    let first = std::fs::read(folder.path("sqlite/study.sqlite")).unwrap();
    export(&server, "sqlite", &folder.name("again"), &[]).await;
    assert_eq!(std::fs::read(folder.path("again/study.sqlite")).unwrap(), first);
}

/// The server's response to a request for an archive.
struct Answer {
    status: u16,
    headers: reqwest::header::HeaderMap,
    body: Vec<u8>,
}

impl Answer {
    fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }
}

async fn archive(server: &Server, query: &str, headers: &[(&str, &str)]) -> Answer {
    let route = format!("{}?{query}", routes::exports("default"));
    let mut request = server.request(reqwest::Method::GET, &route).bearer_auth(&server.key);
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    let response = request.send().await.unwrap();
    let (status, headers) = (response.status().as_u16(), response.headers().clone());
    Answer { status, headers, body: response.bytes().await.unwrap().to_vec() }
}

/// The names and contents of the files in an archive, in order.
fn unpacked(archive: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut archive = zip::ZipArchive::new(Cursor::new(archive)).unwrap();
    let count = archive.len();
    let file = |place| {
        let mut file = archive.by_index(place).unwrap();
        let mut content = Vec::new();
        file.read_to_end(&mut content).unwrap();
        (file.name().unwrap().into_owned(), content)
    };
    (0..count).map(file).collect()
}

#[tokio::test]
async fn an_archive_has_the_files_of_the_command() {
    let server = study().await;
    let folder = Folder::default();
    let filters = [
        ("", &[][..]),
        ("&phase=task&quality=unflagged", &["--phase", "task", "--quality", "unflagged"]),
        ("&pilots=true&phase=&configuration=", &["--pilots"]),
    ];
    for (number, (query, arguments)) in filters.into_iter().enumerate() {
        for format in FORMATS {
            let out = format!("{format}{number}");
            export(&server, format, &folder.name(&out), arguments).await;
            let mut expected = files(&folder.path(&out));
            let answer = archive(&server, &format!("format={format}{query}"), &[]).await;
            assert_eq!((answer.status, answer.header("content-type")), (200, "application/zip"));
            let name = format!("attachment; filename=\"default-{format}.zip\"");
            assert_eq!(answer.header("content-disposition"), name);
            let mut found = unpacked(&answer.body);
            let (last, manifest) = found.pop().unwrap();
            assert_eq!(last, "manifest.json");
            let mut manifest = json(&manifest);
            let mut written = json(&expected.remove("manifest.json").unwrap());
            for manifest in [&mut manifest, &mut written] {
                manifest["created_at"].take();
            }
            assert_eq!(manifest, written);
            assert_eq!(found.into_iter().collect::<BTreeMap<_, _>>(), expected, "{out}");
        }
    }
    // Without a format, the response is one file of steps, as in earlier versions.
    assert_eq!(server.export("default").await, folder.text("csv0/steps.csv"));
}

#[tokio::test]
async fn a_download_that_broke_off_goes_on() {
    let server = study().await;
    for format in FORMATS {
        let query = format!("format={format}");
        let whole = archive(&server, &query, &[]).await;
        let (tag, length) = (whole.header("etag").to_owned(), whole.body.len());
        assert!(tag.starts_with('"') && whole.header("accept-ranges") == "bytes");
        // A partial download is recognised, because it is not a valid archive.
        for part in [length - 1, length / 2] {
            assert!(zip::ZipArchive::new(Cursor::new(&whole.body[..part])).is_err());
        }
        let range = format!("bytes={}-", length / 2);
        let headers = [("range", &*range), ("if-range", &*tag)];
        let rest = archive(&server, &query, &headers).await;
        assert_eq!(rest.status, 206);
        assert_eq!([&whole.body[..length / 2], &rest.body].concat(), whole.body, "{format}");
        let place = format!("bytes {}-{}/{length}", length / 2, length - 1);
        assert_eq!((rest.header("content-range"), rest.header("etag")), (&*place, &*tag));
        let some = archive(&server, &query, &[("range", "bytes=10-19")]).await;
        assert_eq!((some.status, &some.body[..]), (206, &whole.body[10..20]));
        let none = archive(&server, &query, &[("range", &format!("bytes={length}-"))]).await;
        assert_eq!(none.status, 416);
        assert_eq!(none.header("content-range"), format!("bytes */{length}"));
        let known = archive(&server, &query, &[("if-none-match", &tag)]).await;
        assert_eq!((known.status, known.body.len()), (304, 0));
    }
    // The length is also known if no client has downloaded the whole archive.
    let query = "format=csv&phase=practice";
    let end = archive(&server, query, &[("range", "bytes=-22")]).await;
    let whole = archive(&server, query, &[]).await;
    assert_eq!((end.status, &*end.body), (206, &whole.body[whole.body.len() - 22..]));

    // When the data change, the archive changes.
    let tag = whole.header("etag").to_owned();
    Driver::enrol(&server).await;
    let other = archive(&server, query, &[("range", "bytes=5-"), ("if-range", &tag)]).await;
    assert_eq!(other.status, 200);
    assert_ne!(other.header("etag"), tag);
    let other = archive(&server, query, &[("range", "bytes=5-"), ("if-match", &tag)]).await;
    assert_eq!((other.status, &json(&other.body)["code"]), (412, &json!("changed")));
}

#[tokio::test]
async fn wrong_filters_are_named() {
    let server = Server::with_study(SHORT_STUDY).await;
    for (query, field) in [
        ("format=xlsx", "format"),
        ("format=csv&phase=tasks", "phase"),
        ("format=csv&quality=good", "quality"),
        ("format=csv&configuration=0xyz", "configuration"),
        ("format=csv&pilots=perhaps", "pilots"),
        ("phase=task", "format"),
        ("format=csv&size=1", "size"),
    ] {
        let answer = archive(&server, query, &[]).await;
        let said = json(&answer.body);
        assert_eq!((answer.status, &said["field"]), (422, &json!(field)), "{query}: {said}");
    }
    // A study without data gives an archive of empty tables.
    for format in FORMATS {
        let answer = archive(&server, &format!("format={format}"), &[]).await;
        let (_, manifest) = unpacked(&answer.body).pop().unwrap();
        assert_eq!(json(&manifest)["files"][0]["rows"], 0, "{format}");
    }
}

/// A folder contains only one export, because the files of two exports would look like one export.
#[tokio::test]
async fn another_export_in_the_same_folder_is_replaced_or_left_alone() {
    let server = study().await;
    let folder = Folder::default();
    let (out, database) = (folder.name("out"), server.database());
    export(&server, "parquet", &out, &[]).await;
    std::fs::write(folder.path("out/mine.txt"), "mine").unwrap();
    export(&server, "csv", &out, &[]).await;
    let names: Vec<_> = files(&folder.path("out")).into_keys().collect();
    assert!(names.iter().all(|name| !name.ends_with(".parquet")), "{names:?}");
    assert!(["mine.txt", "trials.csv"].iter().all(|name| names.iter().any(|it| it == name)));
    let trials = folder.name("trials.csv");
    run(&["simulate", "--participants", "2", "--seed", "1", "--out", &trials]).await.json();
    run(&["import", "--study", "other", "--trials", &trials, "--database", &database]).await.json();
    let before = files(&folder.path("out"));
    let other = ["export", "--database", &database, "--study", "other", "--out", &out];
    run(&other).await.refused(2, &["--out", "the export of study default"]);
    assert!(files(&folder.path("out")) == before);
}

#[tokio::test]
async fn what_is_damaged_is_named_and_marked_and_the_rest_is_exported() {
    let server = study().await;
    let db = behind(&server.database());
    // One character of one trial's record changes, and another trial gets an unknown flag.
    let of = async |number: i64, ordinal: i64| {
        let query = format!(
            "SELECT scene.trial_id FROM scene JOIN participant ON participant.id = participant_id \
             WHERE number = {number} AND ordinal = {ordinal}"
        );
        db.row(&query, |row| row.get::<String>(0)).await.unwrap()
    };
    let (changed, unreadable) = (of(2, 0).await, of(1, 3).await);
    let change = format!(
        "UPDATE trial SET display = replace(display, '6', '7') WHERE trial_id = '{changed}'; \
         UPDATE trial SET flags = 'odd' WHERE trial_id = '{unreadable}'"
    );
    db.execute(&change).await.unwrap();

    let (folder, database) = (Folder::default(), server.database());
    for format in FORMATS {
        let out = folder.name(format);
        let export = ["export", "--database", &database, "--format", format, "--out", &out];
        let said = run(&export).await;
        assert_eq!(said.code, Some(1), "{}", said.err);
        let lines: Vec<&str> = said.err.lines().collect();
        let [first, second, last] = lines[..] else { panic!("{}", said.err) };
        for (line, participant, trial, words) in [
            (first, "participant 1", &unreadable, "unknown word \"odd\"; left out"),
            (second, "participant 2", &changed, "the content is not that of its hash"),
        ] {
            let begin = format!("sidestep: {participant}, trial {trial}: ");
            assert!(line.starts_with(&begin) && line.ends_with(words), "{line}");
        }
        let words = ["2 trials are damaged", "--allow-damaged", "restore a backup"];
        assert!(words.iter().all(|word| last.contains(word)), "{last}");
        assert_eq!(json(said.out.as_bytes())["damaged_trials"], 2);
        let manifest = json(folder.text(&format!("{format}/manifest.json")).as_bytes());
        let readable = |place: usize| &manifest["damage"][place]["readable"];
        assert_eq!((readable(0), readable(1)), (&json!(false), &json!(true)), "{manifest}");

        let mut downloaded =
            unpacked(&archive(&server, &format!("format={format}"), &[]).await.body);
        let said = json(&downloaded.pop().unwrap().1);
        assert_eq!(said["damage"], manifest["damage"]);
        assert!(said["files"] == manifest["files"] && said["damaged_trials"] == 2, "{said}");
        let allowed = run(&[&export[..], &["--allow-damaged"]].concat()).await;
        assert_eq!(
            (allowed.json()["damaged_trials"].clone(), allowed.err.lines().count()),
            (2.into(), 2)
        );
    }
    let trials = folder::rows(folder.path("csv/trials.csv"));
    let damaged: Vec<_> = trials.iter().filter(|row| row["damaged"] == "1").collect();
    let [row] = damaged[..] else { panic!("{damaged:?}") };
    assert!(row["trial_id"] == changed && row["damage"].contains("hash"), "{row:?}");
    assert!(trials.len() == 6 && trials.iter().all(|row| row["trial_id"] != unreadable));
    // The number of the unreadable trial is not given to another trial.
    let numbers = trials.iter().filter(|row| row["participant"] == "1").map(|row| &*row["trial"]);
    assert_eq!(numbers.collect::<Vec<_>>(), ["0", "1", "2", "4"]);
    let steps = folder::rows(folder.path("csv/steps.csv"));
    let marked = steps.iter().filter(|row| row["damaged"] == "1");
    assert!(steps.len() == 300 && marked.clone().count() == 50);
    assert!(marked.clone().all(|row| row["trial_id"] == changed));
    let out = folder.name("unflagged");
    let unflagged = ["export", "--database", &database, "--quality", "unflagged", "--out", &out];
    assert_eq!(run(&unflagged).await.code, Some(1));
    assert!(
        folder::rows(folder.path("unflagged/trials.csv")).iter().all(|row| row["damaged"] == "0")
    );

    // A file of steps alone cannot name missing trials, so the download aborts.
    let route = routes::exports("default");
    let all = server.request(reqwest::Method::GET, &route).bearer_auth(&server.key);
    let all = async { all.send().await?.bytes().await };
    assert!(all.await.is_err());
    let delete = format!(
        "DELETE FROM trial WHERE trial_id = '{unreadable}'; UPDATE tally SET task = task - 1 WHERE number = 1"
    );
    db.execute(&delete).await.unwrap();
    let steps = server.export("default").await;
    assert_eq!(steps.lines().filter(|line| line.ends_with(",1")).count(), 50);

    // A stored count that is too low hides no trial, and is reported.
    db.execute("UPDATE tally SET task = task - 1 WHERE number = 2").await.unwrap();
    let out = folder.name("counted");
    let counted = run(&["export", "--database", &database, "--out", &out]).await;
    assert!(
        counted.code == Some(1) && counted.err.contains("2 trials are stored, and 1 were counted"),
        "{counted:?}"
    );
    assert_eq!(folder::rows(folder.path("counted/trials.csv")).len(), 6);
}
