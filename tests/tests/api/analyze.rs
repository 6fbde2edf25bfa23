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
    println!("{equal} of {} cells are equal", theirs.len());
    assert!(equal as f64 >= 0.85 * theirs.len() as f64, "{equal}");

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
