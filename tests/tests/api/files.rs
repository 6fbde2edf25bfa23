//! `export`, `import` and `check`.

use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use sidestep::api::KeyEvent;
use sidestep::scene::JointState;
use sidestep::vehicle::Pose;
use sidestep_tests::process::Said;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Folder, Process, Server, behind, driven, run};

async fn import(database: &str, study: &str, file: &str) -> Said {
    run(&["import", "--database", database, "--study", study, "--trials", file]).await
}

/// Exports a study into `folder` and returns the table of steps.
async fn export(database: &str, study: &str, folder: &Folder) -> String {
    let dir = folder.name("out");
    let args = ["export", "--database", database, "--study", study, "--format", "csv"];
    run(&[&args[..], &["--out", &dir]].concat()).await.json();
    folder.text("out/steps.csv")
}

/// The columns with these names, row by row.
fn columns(file: &str, names: &[&str]) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_reader(file.as_bytes());
    let header = reader.headers().unwrap().clone();
    let place = |name: &&str| header.iter().position(|column| column == *name).unwrap();
    let places: Vec<usize> = names.iter().map(place).collect();
    let pick =
        |record: csv::StringRecord| places.iter().map(|&place| record[place].to_owned()).collect();
    reader.records().map(|record| pick(record.unwrap())).collect()
}

const REQUIRED: [&str; 11] =
    ["participant", "trial", "step", "t", "hx", "hy", "hpsi", "rx", "ry", "rpsi", "omega"];

#[tokio::test]
async fn an_export_is_what_was_uploaded_bit_for_bit() {
    let server = Server::with_study(SHORT_STUDY).await;
    let (ada, bob) = (Driver::enrol(&server).await, Driver::enrol(&server).await);
    let mut expected = Vec::new();
    for (number, driver, count) in [(1, &ada, 5), (2, &bob, 2)] {
        let sent = driver.drive(&server, count).await;
        for (trial, (id, upload)) in sent.into_iter().enumerate() {
            expected.push((number, trial, id, upload));
        }
    }
    let file = server.export("default").await;
    assert!(file.starts_with(&REQUIRED.join(",")));
    assert!(!file.contains("external_id"));
    let rows = columns(&file, &REQUIRED);
    let extra = columns(
        &file,
        &["trial_id", "phase", "phase_index", "flags", "sampled_at_ms", "started_at_ms"],
    );
    assert_eq!(rows.len(), 50 * expected.len());
    for (i, (row, extra)) in rows.iter().zip(&extra).enumerate() {
        let (number, trial, id, upload) = &expected[i / 50];
        let step = i % 50;
        let numbers: Vec<f64> = row.iter().map(|field| field.parse().unwrap()).collect();
        assert_eq!(numbers[..3], [f64::from(*number), *trial as f64, step as f64]);
        let state = JointState {
            human: Pose::from([numbers[4], numbers[5], numbers[6]]),
            robot: Pose::from([numbers[7], numbers[8], numbers[9]]),
        };
        assert_eq!(state, upload.states[step]);
        assert_eq!(numbers[10], 0.5 * f64::from(upload.inputs[step].sign()));
        assert_eq!(extra[0], *id);
        assert_eq!(extra[1], ["familiarisation", "practice", "task", "task", "task"][*trial]);
        assert_eq!(extra[2], ["0", "0", "0", "1", "2"][*trial]);
        assert_eq!(extra[3], "");
        assert_eq!(extra[4].parse::<f64>().unwrap(), upload.sampled_at_ms[step]);
        assert_eq!(extra[5].parse::<f64>().unwrap(), upload.started_at_ms);
    }
    // The command writes the same file as the route.
    assert_eq!(export(&server.database(), "default", &Folder::default()).await, file);
}

#[tokio::test]
async fn an_export_imported_elsewhere_is_the_same_again() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 4).await;
    let mut late = driven(&driver.scenes()[4].1);
    late.sampled_at_ms[49] += 500.0;
    late.states[20].human.y += 0.5;
    let (last, _) = driver.scenes()[4].clone();
    assert_eq!(driver.send(&server, &last, &late).await.status, 201);
    let file = server.export("default").await;
    let folder = Folder::default();
    let path = folder.file("trials.csv", &file);
    let database = folder.database("copy.db");

    let done = import(&database, "copy", &path).await.json();
    let expected =
        json!({ "participants": 1, "trials": 5, "flagged": 1, "skipped": 0, "excluded": 0 });
    assert_eq!(done, expected);
    let again = export(&database, "copy", &folder).await;
    let same =
        [&REQUIRED[..], &["phase", "phase_index", "trial_id", "started_at_ms", "sampled_at_ms"]]
            .concat();
    assert_eq!(columns(&again, &same), columns(&file, &same));
    let flags = columns(&again, &["flags"]);
    assert_eq!(flags[0], ["imported"]);
    assert_eq!(flags[249], ["replay_mismatch;late_sample;imported;interrupted"]);
    let report = run(&["check", "--database", &database]).await.json();
    assert_eq!(report["wrong"], json!([]));
    // `check` reports the same counts as `import`.
    assert_eq!((&report["trials"], &report["flagged"]), (&5.into(), &1.into()));

    // A second import changes nothing.
    let twice = import(&database, "copy", &path).await;
    assert!(twice.err.contains("skipped"), "{}", twice.err);
    assert_eq!(twice.json()["skipped"], 1);
    assert_eq!(export(&database, "copy", &folder).await, again);
    // In their original database, trials are recognised by their ids.
    let home = import(&server.database(), "default", &path).await;
    home.refused(2, &["line 2: trial_id"]);
    assert_eq!(server.export("default").await, file);
}

/// The exported steps of simulated people. An export has trial ids.
async fn exported(folder: &Folder, people: &str, tasks: &str) -> String {
    let (file, database) = (folder.name("simulated.csv"), folder.database("simulated.db"));
    let simulate = ["simulate", "--seed", "3", "--keys", "clock", "--out", &file];
    run(&[&simulate[..], &["--participants", people, "--tasks", tasks]].concat()).await.json();
    import(&database, "default", &file).await.json();
    export(&database, "default", folder).await
}

#[tokio::test]
async fn an_export_says_what_it_has() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 4).await;
    let mut late = driven(&driver.scenes()[4].1);
    late.sampled_at_ms[49] += 500.0;
    late.key_events = vec![KeyEvent { t_ms: -1.5, key: "=1,\"x".to_owned(), down: true }];
    let (last, _) = driver.scenes()[4].clone();
    assert_eq!(driver.send(&server, &last, &late).await.status, 201);
    let (folder, database) = (Folder::default(), server.database());
    let export = |format: &'static str, more: &'static [&'static str]| {
        let (out, database) = (folder.name(format), database.clone());
        async move {
            let args = ["export", "--database", &database, "--format", format, "--output", &out];
            run(&[&args[..], more].concat()).await.json()
        }
    };
    for format in ["csv", "jsonl", "parquet"] {
        let said = export(format, &[]).await;
        let text = folder.text(&format!("{format}/manifest.json"));
        let manifest: Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&manifest["study"], &manifest["files"]), (&json!("default"), &said["files"]));
        let rows: Vec<_> = manifest["files"]
            .as_array()
            .unwrap()
            .iter()
            .map(|file| {
                let name = file["name"].as_str().unwrap();
                let bytes = std::fs::read(folder.path(format).join(name)).unwrap();
                assert_eq!(file["sha256"], hex::encode(Sha256::digest(&bytes)), "{name}");
                assert_eq!(file["bytes"], bytes.len(), "{name}");
                (name.split('.').next().unwrap().to_owned(), file["rows"].as_u64().unwrap())
            })
            .collect();
        let expected = [("steps", 250), ("trials", 5), ("key_events", 9), ("participants", 1)];
        for (found, (name, count)) in rows.iter().zip(expected) {
            assert_eq!((&*found.0, found.1), (name, count), "{format}");
        }
        assert_eq!((&*rows[4].0, rows[4].1, &*rows[5].0), ("configurations", 1, "dictionary"));
    }
    assert_eq!(folder.text("csv/steps.csv"), server.export("default").await);
    let events = folder.text("csv/key_events.csv");
    let line = format!("1,4,{last},0,-1.5,\"'=1,\"\"x\",1");
    assert_eq!(events.lines().last().unwrap(), line);
    let trials = folder.text("csv/trials.csv");
    let ends = columns(&trials, &["trial_id", "flags", "end_hx", "steps"]);
    let end = format!("{:?}", late.states[50].human.x);
    assert_eq!(ends[4], [&*last, "late_sample;interrupted", &*end, "50"]);
    // Configurations are exported byte for byte.
    let configurations = folder.text("csv/configurations.json");
    let configuration = configurations.lines().nth(1).unwrap();
    let (hash, study) = configuration.split_once(", \"study\": ").unwrap();
    let hash = &hash[r#"{"configuration": ""#.len()..][..64];
    assert_eq!(hash, hex::encode(Sha256::digest(study.strip_suffix('}').unwrap())));

    // In a partial export, trials keep their numbers.
    let part = export("csv", &["--phase", "task", "--quality", "unflagged"]).await;
    let rows = |said: &Value, file: usize| said["files"][file]["rows"].as_u64().unwrap();
    assert_eq!([0, 1, 2, 3].map(|file| rows(&part, file)), [100, 2, 4, 1]);
    let numbers = columns(&folder.text("csv/trials.csv"), &["trial", "phase"]);
    assert_eq!(numbers, [["2", "task"], ["3", "task"]]);
    let out = folder.name("csv");
    let args = ["export", "--database", &database, "--out", &out, "--configuration"];
    let said = run(&[&args[..], &[&hash[..10]]].concat()).await.json();
    assert_eq!(rows(&said, 0), 250);
    run(&[&args[..], &["0xyz"]].concat()).await.refused(2, &["--configuration", hash, "0xyz"]);
}

#[tokio::test]
async fn a_file_that_was_cut_off_is_refused() {
    let folder = Folder::default();
    let whole = exported(&folder, "2", "3").await;
    let (database, path) = (folder.database("copy.db"), folder.path("out/steps.csv"));
    // The manifest in the same folder reveals that a part is missing.
    for end in
        [whole.len() - 1, whole.len() / 2, whole.lines().take(151).map(|l| l.len() + 1).sum()]
    {
        std::fs::write(&path, &whole[..end]).unwrap();
        let said = import(&database, "default", &path.display().to_string()).await;
        said.refused(2, &["steps.csv: SHA-256: expected", "as manifest.json beside it says"]);
    }
    // Without a manifest, incomplete trials and participants are detected.
    let step = whole.len() / 300;
    for end in (1..20).map(|cut| whole.len() - cut * step - cut) {
        let file = folder.file("cut.csv", &whole[..end]);
        import(&database, "default", &file).await.refused(2, &["cut.csv: line "]);
    }
    assert!(!folder.path("copy.db").exists());
    std::fs::write(&path, &whole).unwrap();
    let done = import(&database, "default", &path.display().to_string()).await.json();
    assert_eq!((&done["participants"], &done["trials"]), (&json!(2), &json!(6)));
    // The table of trials has no column for steps.
    let trials = import(&database, "default", &folder.name("out/trials.csv")).await;
    trials.refused(2, &["no column step", "steps.csv"]);
}

#[tokio::test]
async fn rows_in_any_order_are_the_same_trials() {
    let folder = Folder::default();
    let whole = exported(&folder, "3", "4").await;
    let header = whole.lines().next().unwrap();
    let mut lines: Vec<&str> = whole.lines().skip(1).collect();
    lines.sort_by_key(|line| line.split(',').nth(2).unwrap().parse::<u32>().unwrap());
    let sorted = folder.file("sorted.csv", format!("{header}\n{}\n", lines.join("\n")));
    let database = folder.database("copy.db");
    let done = import(&database, "default", &sorted).await.json();
    assert_eq!(
        done,
        json!({ "participants": 3, "trials": 12, "flagged": 0, "skipped": 0, "excluded": 0 })
    );
    // The same rows in order give the same trials.
    let ordered = folder.file("ordered.csv", &whole);
    assert_eq!(import(&database, "default", &ordered).await.json()["skipped"], 3);
}

/// An export lists exclusions in its table of participants. Apart from the manifest and this table,
/// import reads no other file in the folder of the steps.
#[tokio::test]
async fn whom_an_export_excludes_stays_excluded() {
    let folder = Folder::default();
    let steps = folder.file("steps.csv", exported(&folder, "3", "4").await);
    folder.file("participants.csv", "participant,exclusion_reason\n1,\n2,fell asleep\n3,\n");
    let database = folder.database("copy.db");
    let done = import(&database, "default", &steps).await.json();
    assert_eq!((&done["participants"], &done["excluded"]), (&json!(3), &json!(1)));
    let out = folder.name("again");
    let args = ["export", "--database", &database, "--study", "default", "--out", &out];
    run(&args).await.json();
    let again = std::fs::read_to_string(folder.path("again/participants.csv")).unwrap();
    assert_eq!(columns(&again, &["exclusion_reason"]), [[""], ["fell asleep"], [""]]);
    // Existing participants are not changed.
    let twice = import(&database, "default", &steps).await.json();
    assert_eq!((&twice["skipped"], &twice["excluded"]), (&json!(3), &json!(0)));
}

#[tokio::test]
async fn headings_in_degrees_are_told() {
    let folder = Folder::default();
    let whole = exported(&folder, "2", "4").await;
    let (header, rows) = whole.split_once('\n').unwrap();
    let at = header.split(',').position(|name| name == "hpsi").unwrap();
    let rows = rows.lines().map(|row| {
        let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
        cells[at] = cells[at].parse::<f64>().unwrap().to_degrees().to_string();
        cells.join(",") + "\n"
    });
    let path = folder.file("degrees.csv", format!("{header}\n{}", rows.collect::<String>()));
    let told = import(&folder.database("copy.db"), "default", &path).await;
    assert!(told.err.contains("every trial is flagged"), "{}", told.err);
    assert!(told.err.contains("hpsi and rpsi are headings in radians"), "{}", told.err);
}

#[tokio::test]
async fn an_import_that_fails_after_a_part_takes_it_back() {
    let folder = Folder::default();
    let whole = exported(&folder, "7", "50").await;
    let (header, rows) = whole.split_once('\n').unwrap();
    let begin = whole.find("\n7,0,0,").unwrap() + 1;
    let last = folder.file("last.csv", format!("{header}\n{}", &whole[begin..]));
    let database = folder.database("copy.db");
    import(&database, "one", &last).await.json();
    // Six participants are stored before the import finds that the trials of the last one are in
    // another study.
    let all = folder.file("all.csv", format!("{header}\n{rows}"));
    import(&database, "two", &all).await.refused(2, &["all.csv: line 15002: trial_id"]);
    let two = ["export", "--database", &database, "--study", "two", "--out", "none"];
    run(&two).await.refused(2, &["which has one"]);
    let report = run(&["check", "--database", &database]).await.json();
    assert_eq!([&report["participants"], &report["trials"]], [&json!(1), &json!(50)]);
    assert_eq!((&report["damage"], &report["wrong"]), (&json!([]), &json!([])));
}

/// The rows of one trial, in which the human drives straight from the origin.
fn straight() -> Vec<Vec<String>> {
    let row = |step: usize| {
        let t = step as f64 * 0.2;
        let (human, robot) = (2.0 * t, 20.0 - 2.0 * t);
        let row = format!("a,0,{step},{t},{human},0,0,{robot},1,3.14,0");
        row.split(',').map(str::to_owned).collect()
    };
    (0..50).map(row).collect()
}

fn written(folder: &Folder, header: &str, rows: &[Vec<String>]) -> String {
    let lines: Vec<String> = rows.iter().map(|row| row.join(",")).collect();
    folder.file("given.csv", format!("{header}\n{}\n", lines.join("\n")))
}

#[tokio::test]
async fn files_that_are_none_name_their_line() {
    let folder = Folder::default();
    let database = folder.database("sidestep.db");
    let header = REQUIRED.join(",");
    type Change = fn(&mut Vec<Vec<String>>);
    let table: [(Change, &str); 10] = [
        (
            |rows| rows[5][10] = "0.3".to_owned(),
            "line 7: omega: expected -0.5, 0 or 0.5, found 0.3",
        ),
        (|rows| rows[5][4] = "NaN".to_owned(), "line 7: hx: expected a finite number"),
        (|rows| rows[5][4] = "left".to_owned(), "line 7: hx: expected a number, found \"left\""),
        (|rows| rows.swap(3, 4), "line 5: step: expected 3, found 4"),
        (|rows| rows[4] = rows[3].clone(), "line 6: step: expected 4, found 3"),
        (|rows| drop(rows.remove(9)), "line 11: step: expected 9, found 10"),
        (|rows| drop(rows.pop()), "line 50: step: expected 50 entries, found 49"),
        (|rows| rows[5][3] = "9.9".to_owned(), "line 7: t: expected 1"),
        (|rows| drop(rows[5].pop()), "line 7: row"),
        (|rows| rows.clear(), "expected at least one trial"),
    ];
    for (change, complaint) in table {
        let mut rows = straight();
        change(&mut rows);
        let said = import(&database, "default", &written(&folder, &header, &rows)).await;
        said.refused(2, &["given.csv", complaint]);
    }
    // The last trial is invalid, so the first one is not stored either.
    let mut rows = straight();
    let mut second = straight();
    second.iter_mut().for_each(|row| row[1] = "1".to_owned());
    second[49][10] = "7".to_owned();
    rows.extend(second);
    let said = import(&database, "default", &written(&folder, &header, &rows)).await;
    said.refused(2, &["line 101: omega"]);
    let said = import(&database, "default", &written(&folder, "participant,trial", &[])).await;
    said.refused(2, &["no column step"]);
    let good = import(&database, "default", &written(&folder, &header, &straight())).await;
    assert_eq!(good.json()["trials"], 1);
    let all = export(&database, "default", &folder).await;
    assert_eq!(all.lines().count(), 51);
}

#[tokio::test]
async fn columns_in_any_order_and_phases() {
    let folder = Folder::default();
    let database = folder.database("sidestep.db");
    let mut rows = straight();
    for row in &mut rows {
        row.insert(0, "practice".to_owned());
        row.swap(1, 11);
    }
    let header = "phase,omega,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,participant";
    let done = import(&database, "pilot", &written(&folder, header, &rows)).await;
    assert_eq!(done.json()["participants"], 1);
    let file = export(&database, "pilot", &folder).await;
    let rows = columns(&file, &["study", "phase", "participant", "hx", "attempt"]);
    assert_eq!(rows[49], ["pilot", "practice", "1", "19.6", "1"]);
}

#[tokio::test]
async fn a_check_finds_what_was_tampered_with() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    let database = folder.database("sidestep.db");
    let file = written(&folder, &REQUIRED.join(","), &straight());
    import(&database, "default", &file).await.json();
    server.kill().await;
    let sound = run(&["check", "--database", &database]).await.json();
    assert_eq!((&sound["trials"], &sound["flagged"]), (&1.into(), &1.into()));

    let inputs = hex::encode([vec![0; 49], vec![1]].concat());
    let change = format!("UPDATE trial SET inputs = X'{inputs}'");
    behind(&database).execute(&change).await.unwrap();
    let checked = run(&["check", "--database", &database]).await;
    assert_eq!(checked.code, Some(1));
    let report: Value = serde_json::from_str(&checked.out).unwrap();
    assert_eq!(report["wrong"].as_array().unwrap().len(), 1);
    assert!(checked.err.contains("1 fault;"));
}
