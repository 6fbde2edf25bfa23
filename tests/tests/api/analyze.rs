//! analyze: the whole comparison, against scikit-learn's of the same data.

use serde_json::Value;
use sidestep_tests::sidestep;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn data(name: &str) -> String {
    format!("{}/../shared/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Runs the command and gives its exit code, stdout and stderr.
async fn analyze(args: &[&str], out: &Path) -> (Option<i32>, String, String) {
    let all = [&["analyze"], args, &["--out", out.to_str().unwrap()]].concat();
    let output = sidestep(&all).await;
    let text = |octets| String::from_utf8(octets).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// A table: its header and its rows, by name.
fn table(path: impl AsRef<Path>) -> Vec<HashMap<String, String>> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap()
}

const SETS: [&str; 7] = ["hrd", "hr", "hd", "rd", "h", "r", "d"];

fn key(row: &HashMap<String, String>) -> [String; 4] {
    ["model", "experiment", "features", "participant"].map(|column| row[column].clone())
}

/// The reference chose among hyper-parameters that came out equal in cross-validation by its own
/// solvers' last digits, so that some cells differ; at least 85 % must not.
#[tokio::test]
async fn the_comparison_is_that_of_scikit_learn() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let (trials, features) = (data("trials.csv"), data("features.csv"));
    let (code, said, complaints) =
        analyze(&["--trials", &trials, "--features", &features], &out).await;
    assert_eq!(code, Some(0), "{complaints}");
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["participants"], 8);

    let ours: HashMap<_, _> =
        table(out.join("cells.csv")).into_iter().map(|row| (key(&row), row)).collect();
    let theirs = table(data("sklearn_cells.csv"));
    assert_eq!(theirs.len(), 448);
    let same = |row: &&HashMap<String, String>| {
        let ours = &ours[&key(row)];
        (number(ours, "test_accuracy") - number(row, "test_accuracy")).abs() < 1e-9
    };
    let equal = theirs.iter().filter(same).count();
    assert!(equal as f64 >= 0.85 * theirs.len() as f64, "{equal} of {}", theirs.len());

    let ours = table(out.join("table1.csv"));
    for row in table(data("sklearn_table1.csv")) {
        let same = |other: &&HashMap<String, String>| {
            other["model"] == row["model"] && other["experiment"] == row["experiment"]
        };
        let ours = ours.iter().find(same).unwrap();
        for set in SETS {
            let apart = (number(ours, set) - number(&row, set)).abs();
            assert!(apart <= 0.3, "{} {} {set}: {apart}", row["model"], row["experiment"]);
        }
    }
}

/// Rows of the reference's trials: of these people, and so many tasks of each.
fn some_trials(people: &[&str], tasks: u64) -> (String, Vec<String>) {
    let text = fs::read_to_string(data("trials.csv")).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    let header = lines.next().unwrap();
    let wanted = |line: &String| {
        let mut fields = line.split(',');
        let (person, trial) = (fields.next().unwrap(), fields.next().unwrap());
        people.contains(&person) && trial.parse::<u64>().unwrap() < tasks
    };
    (header, lines.filter(wanted).collect())
}

fn written(folder: &TempDir, name: &str, header: &str, rows: &[String]) -> String {
    let path = folder.path().join(name);
    fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Every file below a folder but the cache, by name, with its octets.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let (path, name) = entry.map(|e| (e.path(), e.file_name())).unwrap();
        let name = name.into_string().unwrap();
        if path.is_dir() && name != ".cache" {
            let below = contents(&path).into_iter();
            found.extend(below.map(|(file, octets)| (format!("{name}/{file}"), octets)));
        } else if path.is_file() {
            found.push((name, fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

/// By the middle digits of a hash: an order that has nothing to do with the first one.
fn shuffled(rows: &[String]) -> Vec<String> {
    let mut rows = rows.to_vec();
    rows.sort_by_key(|row| {
        row.bytes().fold(7u64, |hash, octet| {
            (hash ^ u64::from(octet)).wrapping_mul(0x0100_0000_01b3).rotate_left(23)
        })
    });
    rows
}

#[tokio::test]
async fn neither_order_nor_threads_nor_the_cache_change_an_octet() {
    let folder = TempDir::new().unwrap();
    let (header, rows) = some_trials(&["0", "3"], 10);
    let ordered = written(&folder, "ordered.csv", &header, &rows);
    let mixed = written(&folder, "mixed.csv", &header, &shuffled(&rows));
    let mut first = None;
    for (name, trials, threads) in
        [("a", &ordered, "1"), ("b", &ordered, "2"), ("c", &mixed, "2"), ("a", &ordered, "2")]
    {
        let out = folder.path().join(name);
        let (code, _, said) =
            analyze(&["--trials", trials, "--threads", threads, "--leakage"], &out).await;
        assert_eq!(code, Some(0), "{said}");
        let found = contents(&out);
        let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
        for wanted in
            ["cells.csv", "table1.csv", "report.html", "tables.tex", "models/lr-1-hrd-0.json"]
        {
            assert!(names.contains(&wanted), "{names:?}");
        }
        assert!(names.iter().all(|name| !name.starts_with(".sidestep")), "{names:?}");
        for (before, now) in first.get_or_insert_with(|| found.clone()).iter().zip(&found) {
            assert!(before == now, "{name}: {} differs", now.0);
        }
    }
    // Rows of one trial on both sides let a model know the answers.
    let leaks = table(folder.path().join("a").join("leakage.csv"));
    let rbf = leaks.iter().find(|row| row["model"] == "svm" && row["experiment"] == "1").unwrap();
    assert!(number(rbf, "leaking_accuracy") > number(rbf, "grouped_accuracy") + 5.0, "{rbf:?}");
}

#[tokio::test]
async fn who_cannot_be_learned_from_is_named_and_left_out() {
    let folder = TempDir::new().unwrap();
    let (header, mut rows) = some_trials(&["0"], 6);
    rows.extend(some_trials(&["1"], 4).1);
    let idle = some_trials(&["2"], 6).1.into_iter().map(|row| {
        let (start, _) = row.rsplit_once(',').unwrap();
        format!("{start},0.0")
    });
    rows.extend(idle);
    let trials = written(&folder, "trials.csv", &header, &rows);
    let out = folder.path().join("out");
    let (code, line, said) = analyze(&["--trials", &trials], &out).await;
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("participant 1: 4 tasks, at least 5 are needed"), "{said}");
    assert!(said.contains("participant 2: one kind of input only"), "{said}");
    let line: Value = serde_json::from_str(&line).unwrap();
    assert_eq!((&line["participants"], line["excluded"].as_array().unwrap().len()), (&1.into(), 2));
    assert!(table(out.join("cells.csv")).iter().all(|row| row["participant"] == "0"));

    let alone = written(&folder, "alone.csv", &header, &some_trials(&["1"], 4).1);
    let (code, _, said) = analyze(&["--trials", &alone], &out).await;
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("participants: expected somebody"), "{said}");
}

#[tokio::test]
async fn bad_files_are_refused_with_their_lines() {
    let folder = TempDir::new().unwrap();
    let (header, rows) = some_trials(&["0"], 6);
    let out = folder.path().join("out");
    let refused = async |header: &str, rows: &[String], words: &str| {
        let trials = written(&folder, "trials.csv", header, rows);
        let (code, line, said) = analyze(&["--trials", &trials], &out).await;
        assert_eq!((code, line.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(words), "{said}");
    };
    refused(&header.replace("hpsi", "heading"), &rows, "no column hpsi").await;
    let mut changed = rows.clone();
    changed.swap(3, 4);
    refused(&header, &changed, "line 5: step: expected 3, found 4").await;
    let mut changed = rows.clone();
    changed[9] = changed[8].clone();
    refused(&header, &changed, "line 11: step: expected 9, found 8").await;
    let mut changed = rows.clone();
    changed.pop();
    refused(&header, &changed, "expected 50 entries, found 49").await;
    let mut changed = rows.clone();
    changed[7] = changed[7].rsplit_once(',').unwrap().0.to_owned() + ",0.2";
    refused(&header, &changed, "line 9: omega").await;

    // Features of other rows than the trials'.
    let trials = written(&folder, "trials.csv", &header, &rows);
    let features = folder.path().join("features.csv");
    let text = fs::read_to_string(data("features.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let features = features.to_str().unwrap();
    fs::write(features, lines[..120].join("\n")).unwrap();
    let (code, _, said) = analyze(&["--trials", &trials, "--features", features], &out).await;
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("participant 0, trial 2, step 19"), "{said}");
    assert!(!out.join("cells.csv").exists());
}
