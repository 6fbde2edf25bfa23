//! `analyze`: the whole comparison, checked against scikit-learn's results on the same data.

use serde_json::{Value, json};
use sidestep_tests::folder::{Row, data, number, rows as table};
#[cfg(unix)]
use sidestep_tests::process::interrupted;
use sidestep_tests::{Server, run, sidestep};
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::time::SystemTime;
use tempfile::TempDir;

/// Runs the command and returns its exit code, stdout and stderr.
pub(crate) async fn analyze(args: &[&str], out: &Path) -> (Option<i32>, String, String) {
    let all = [&["analyze"], args, &["--out", out.to_str().unwrap()]].concat();
    let said = run(&all).await;
    (said.code, said.out, said.err)
}

const SETS: [&str; 7] = ["hrd", "hr", "hd", "rd", "h", "r", "d"];

fn key(row: &Row) -> [String; 4] {
    ["model", "experiment", "features", "participant"].map(|column| row[column].clone())
}

/// Where hyper-parameters tie in cross-validation, the reference chose by rounding errors of its
/// solvers. Therefore some cells differ, but at least 85 % must agree.
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
    let same = |row: &&Row| {
        let ours = &ours[&key(row)];
        (number(ours, "test_accuracy") - number(row, "test_accuracy")).abs() < 1e-9
    };
    let equal = theirs.iter().filter(same).count();
    assert!(equal as f64 >= 0.85 * theirs.len() as f64, "{equal} of {}", theirs.len());

    let ours = table(out.join("table1.csv"));
    for row in table(data("sklearn_table1.csv")) {
        let same = |other: &&Row| {
            other["model"] == row["model"] && other["experiment"] == row["experiment"]
        };
        let ours = ours.iter().find(same).unwrap();
        for set in SETS {
            let apart = (number(ours, set) - number(&row, set)).abs();
            assert!(apart <= 0.3, "{} {} {set}: {apart}", row["model"], row["experiment"]);
        }
    }
    generalisation_is_that_of_scikit_learn(&out);
}

/// Logistic regression with fewer training tasks, and logistic regression trained on the other
/// participants.
fn generalisation_is_that_of_scikit_learn(out: &Path) {
    let theirs = table(data("sklearn_generalisation.csv"));
    assert_eq!(theirs.len(), 2 * 2 * 4 * 8);
    let (learning, unseen) = (table(out.join("learning.csv")), table(out.join("unseen.csv")));
    let of = |rows: &[Row], like: &Row, column: &str, value: &str| {
        let is = |row: &&Row| {
            row["model"] == "lr"
                && row[column] == value
                && ["experiment", "features"].iter().all(|column| row[*column] == like[*column])
        };
        rows.iter().find(is).unwrap().clone()
    };
    for (i, row) in theirs.iter().enumerate() {
        if row["training"] == "others" {
            let ours = of(&unseen, row, "participant", &row["participant"]);
            let apart = number(&ours, "accuracy_percent") - 100.0 * number(row, "accuracy");
            assert!(apart.abs() < 1e-3, "{row:?}: {ours:?}");
            continue;
        }
        // The file also has the learning curve, whose points are means over participants. Check
        // each point once.
        if row["participant"] != "0" {
            continue;
        }
        let same = |other: &&Row| {
            ["experiment", "features", "training"].iter().all(|of| other[*of] == row[*of])
        };
        let all: Vec<&Row> = theirs[i..].iter().filter(same).collect();
        let ours = of(&learning, row, "training_tasks", &row["training"]);
        assert_eq!(number(&ours, "participants"), 8.0);
        for column in ["accuracy", "balanced_accuracy"] {
            let mean = all.iter().map(|row| 100.0 * number(row, column)).sum::<f64>() / 8.0;
            let apart = number(&ours, &format!("{column}_percent")) - mean;
            assert!(apart.abs() < 1e-3, "{column} of {row:?}: {ours:?}");
        }
    }
}

/// The header of the reference's trials, and the rows of the first `tasks` tasks of these
/// participants.
pub(crate) fn some_trials(people: &[&str], tasks: u64) -> (String, Vec<String>) {
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

pub(crate) fn written(folder: &TempDir, name: &str, header: &str, rows: &[String]) -> String {
    let path = folder.path().join(name);
    fs::write(&path, format!("{header}\n{}\n", rows.join("\n"))).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The name and content of every file in a folder and its subfolders, except the cache.
pub(crate) fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let (path, name) = entry.map(|e| (e.path(), e.file_name())).unwrap();
        let name = name.into_string().unwrap();
        if path.is_dir() && name != ".cache" {
            let below = contents(&path).into_iter();
            found.extend(below.map(|(file, bytes)| (format!("{name}/{file}"), bytes)));
        } else if path.is_file() {
            found.push((name, fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

/// The rows sorted by a hash, which makes their order independent of the original order.
fn shuffled(rows: &[String]) -> Vec<String> {
    let mut rows = rows.to_vec();
    rows.sort_by_key(|row| {
        row.bytes().fold(7u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3).rotate_left(23)
        })
    });
    rows
}

#[tokio::test]
async fn neither_order_nor_threads_nor_the_cache_change_a_byte() {
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
    // Rows of one trial on both sides of a train-test split leak the answers.
    let leaks = table(folder.path().join("a").join("leakage.csv"));
    let rbf = leaks.iter().find(|row| row["model"] == "svm" && row["experiment"] == "1").unwrap();
    assert!(number(rbf, "leaking_percent") > number(rbf, "grouped_percent") + 5.0, "{rbf:?}");
}

/// Writes a study of two people with six tasks each, and analyses it into `out`. Returns the path
/// of the trials.
async fn analysed(folder: &TempDir, out: &Path) -> String {
    let (header, rows) = some_trials(&["0", "3"], 6);
    let trials = written(folder, "trials.csv", &header, &rows);
    let (code, _, said) = analyze(&["--trials", &trials], out).await;
    assert_eq!(code, Some(0), "{said}");
    trials
}

/// After Ctrl-C, the previous result, if any, is unchanged, and the models fitted so far stay in
/// the cache.
#[cfg(unix)]
#[tokio::test]
async fn an_analysis_that_is_interrupted_changes_nothing() {
    let folder = TempDir::new().unwrap();
    let [former, none] = ["former", "none"].map(|name| folder.path().join(name));
    let small = analysed(&folder, &former).await;
    let before = contents(&former);
    for (signal, out) in [("INT", &former), ("TERM", &none)] {
        let all = data("trials.csv");
        let args = ["analyze", "--trials", &all, "--out", out.to_str().unwrap()];
        let output = interrupted(&args, signal, || out.join(".cache").is_dir()).await;
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{said}");
        assert!(said.contains("nothing was written"), "{said}");
    }
    assert!(contents(&former) == before);
    assert_eq!(contents(&none), []);
    let names = |out: &Path| -> Vec<_> {
        fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    };
    assert_eq!(names(&none), [".cache"], "and no temporary folder");
    // The previous result is still valid for the same input.
    let (code, _, said) = analyze(&["--trials", &small], &former).await;
    assert_eq!(code, Some(0), "{said}");
    assert!(contents(&former) == before);
}

/// The modification time of each file in the cache, by name.
fn kept(out: &Path) -> HashMap<String, SystemTime> {
    let time = |entry: fs::DirEntry| {
        (entry.file_name().into_string().unwrap(), entry.metadata().unwrap().modified().unwrap())
    };
    fs::read_dir(out.join(".cache")).unwrap().map(|entry| time(entry.unwrap())).collect()
}

#[tokio::test]
async fn only_what_changed_is_fitted_again() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let trials = analysed(&folder, &out).await;
    let first = kept(&out);
    let before = contents(&out);
    let (code, _, _) = analyze(&["--trials", &trials], &out).await;
    assert_eq!((code, kept(&out)), (Some(0), first.clone()));
    assert!(contents(&out) == before);

    // Change the input in the last step of person 3. All models of this person are fitted again.
    let (header, mut rows) = some_trials(&["0", "3"], 6);
    let last = rows.pop().unwrap();
    let (start, omega) = last.rsplit_once(',').unwrap();
    let other = if omega.parse::<f64>().unwrap() == 0.5 { "0.0" } else { "0.5" };
    rows.push(format!("{start},{other}"));
    let changed = written(&folder, "changed.csv", &header, &rows);
    let (code, _, said) = analyze(&["--trials", &changed], &out).await;
    assert_eq!(code, Some(0), "{said}");
    let second = kept(&out);
    let same = second.iter().filter(|(name, time)| first.get(*name) == Some(time)).count();
    // For both people, the models that are trained on the other person are also fitted again: two
    // kinds of model on three sets.
    let shared = 2 * 2 * 3;
    assert_eq!((second.len(), 2 * same + shared), (first.len(), first.len()));

    // A truncated or modified cache file is not used.
    for (i, name) in second.keys().take(6).enumerate() {
        let path = out.join(".cache").join(name);
        let text = fs::read_to_string(&path).unwrap();
        let changed = text.replacen("\"cv_accuracy\":0.", "\"cv_accuracy\":0.1", 1);
        assert_ne!(changed, text);
        fs::write(path, if i < 3 { "[{" } else { &changed }).unwrap();
    }
    let (code, _, said) = analyze(&["--trials", &trials], &out).await;
    assert_eq!(code, Some(0), "{said}");
    assert!(contents(&out) == before);
}

/// Reading features that `sidestep features` wrote gives exactly the same results as computing
/// them.
#[tokio::test]
async fn features_of_a_file_change_nothing() {
    let folder = TempDir::new().unwrap();
    let [computed, read] = ["computed", "read"].map(|name| folder.path().join(name));
    let trials = analysed(&folder, &computed).await;
    let features = folder.path().join("features.csv");
    let features = features.to_str().unwrap();
    let output = sidestep(&["features", "--trials", &trials, "--out", features]).await;
    assert!(output.status.success());
    let (code, _, said) = analyze(&["--trials", &trials, "--features", features], &read).await;
    assert_eq!(code, Some(0), "{said}");
    assert!(contents(&computed) == contents(&read));
}

/// The tables and models in a folder, without the files that name the origin of the trials.
fn tables(out: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = contents(out);
    all.retain(|(name, _)| name.ends_with(".csv") || name.starts_with("models/"));
    all
}

#[tokio::test]
async fn a_study_in_a_database_is_analysed_as_its_export() {
    let study = r#"
title = "Six"
phases = [{ phase = "practice", scenes = 1 }, { phase = "task", scenes = 6 }]
"#;
    let server = Server::with_study(study).await;
    let simulated =
        sidestep(&["simulate", "--participants", "2", "--seed", "5", "--url", &server.origin])
            .await;
    assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
    let folder = TempDir::new().unwrap();
    let [stored, exported] = ["stored", "exported"].map(|name| folder.path().join(name));
    let database = server.database();
    let (code, said, complaints) = analyze(&["--database", &database], &stored).await;
    assert_eq!((code, complaints.as_str()), (Some(0), ""));
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!((&said["participants"], &said["synthetic"]), (&2.into(), &true.into()));
    assert!(fs::read_to_string(stored.join("report.html")).unwrap().contains("class=\"banner\""));

    let trials = folder.path().join("trials.csv");
    fs::write(&trials, server.export("default").await).unwrap();
    let (code, _, said) = analyze(&["--trials", trials.to_str().unwrap()], &exported).await;
    assert_eq!(code, Some(0), "{said}");
    assert!(tables(&stored).len() > 100 && tables(&stored) == tables(&exported));
    of_both("features", &[], &folder, [&database, trials.to_str().unwrap()], ".").await;
    let few = ["--probability", "0.5", "--guarantee", "conformal"];
    of_both("shfrs", &few, &folder, [&database, trials.to_str().unwrap()], "tuning.csv").await;

    for (flags, words) in [
        (&["--database", &database, "--study", "other"][..], "no such study"),
        (&["--database", "sqlite:/nowhere/at.db"], "nowhere"),
        (&["--database", &database, "--trials", "trials.csv"], "--trials"),
        (&["--database", &database, "--radius", "2"], "--radius"),
        (&[], "--trials"),
    ] {
        let (code, printed, said) = analyze(flags, &folder.path().join("no")).await;
        assert_ne!(code, Some(0));
        assert!(printed.is_empty() && said.contains(words), "{flags:?}: {said}");
        assert!(!folder.path().join("no").exists());
    }
}

/// Checks that a command writes the same output from a database as from its export. `file` is a
/// file in the output folder, or `.` if the output itself is a file.
async fn of_both(
    command: &str,
    flags: &[&str],
    folder: &TempDir,
    [database, trials]: [&str; 2],
    file: &str,
) {
    let mut written = Vec::new();
    for source in [["--database", database], ["--trials", trials]] {
        let out = folder.path().join(format!("{command}{}", source[0]));
        let args = [&[command, "--out", out.to_str().unwrap()], &source[..], flags].concat();
        let output = sidestep(&args).await;
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let line: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!((&line["excluded"], &line["flagged"]), (&json!([]), &json!({})));
        let path = if file == "." { out } else { out.join(file) };
        written.push(fs::read(path).unwrap());
    }
    assert!(written[0].len() > 100 && written[0] == written[1], "{command}");
}

/// Synthetic participants are recognised. Trials of people get no banner.
#[tokio::test]
async fn synthetic_data_are_recognised() {
    let folder = TempDir::new().unwrap();
    let banner = async |name: &str, trials: &str, flags: &[&str]| {
        let out = folder.path().join(name);
        let (code, said, complaints) =
            analyze(&[&["--trials", trials], flags].concat(), &out).await;
        assert_eq!(code, Some(0), "{complaints}");
        let said: Value = serde_json::from_str(&said).unwrap();
        let report = fs::read_to_string(out.join("report.html")).unwrap();
        let latex = fs::read_to_string(out.join("tables.tex")).unwrap();
        let shown = report.contains("class=\"banner\"");
        assert_eq!((&said["synthetic"], latex.contains("Synthetic")), (&shown.into(), shown));
        shown
    };
    let (header, rows) = some_trials(&["0"], 6);
    let reference = written(&folder, "reference.csv", &header, &rows);
    assert!(banner("reference", &reference, &[]).await);
    // The label from the data remains if the flag is also given.
    assert!(banner("both", &reference, &["--synthetic"]).await);
    let both = fs::read_to_string(folder.path().join("both/report.html")).unwrap();
    assert!(both.contains("of seed 20180918; the experimenter says so, too"));
    // Renamed and slightly shifted trials are not recognised without the flag.
    let moved: Vec<String> = rows
        .iter()
        .map(|row| {
            let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
            fields[0] = "Ada".to_owned();
            for place in [4, 7] {
                fields[place] = (fields[place].parse::<f64>().unwrap() + 1.0).to_string();
            }
            fields.join(",")
        })
        .collect();
    let moved = written(&folder, "moved.csv", &header, &moved);
    assert!(!banner("moved", &moved, &[]).await);
    assert!(banner("said", &moved, &["--synthetic"]).await);
    let simulated = folder.path().join("simulated.csv");
    let simulated = simulated.to_str().unwrap();
    let output = sidestep(&[
        "simulate",
        "--participants",
        "1",
        "--seed",
        "9",
        "--tasks",
        "6",
        "--out",
        simulated,
    ])
    .await;
    assert!(output.status.success());
    assert!(banner("simulated", simulated, &[]).await);
}
