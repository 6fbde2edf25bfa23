//! features: what predictors look at, in a file.

use serde_json::{Value, json};
use sidestep_tests::sidestep;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

fn data(name: &str) -> String {
    format!("{}/../shared/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Runs the command and gives its exit code, stdout and stderr.
async fn features(trials: &str, flags: &[&str], out: &Path) -> (Option<i32>, String, String) {
    let args = ["features", "--trials", trials, "--out", out.to_str().unwrap()];
    let output = sidestep(&[&args[..], flags].concat()).await;
    let text = |octets| String::from_utf8(octets).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

type Row = HashMap<String, String>;

fn table(path: impl AsRef<Path>) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(Result::unwrap).collect()
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap()
}

/// So much a number may be off that is printed so: half of its last digit.
fn half_a_digit(printed: &str) -> f64 {
    let (digits, exponent) = printed.split_once('e').unwrap_or((printed, "0"));
    let places = digits.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    0.5 * 10f64.powi(exponent.parse::<i32>().unwrap() - places as i32)
}

const COLUMNS: &str =
    "participant,trial,step,abs_dx,abs_dy,dpsi,cos_dpsi,sin_dpsi,v_h,v_r,distance,turn,avoid";

#[tokio::test]
async fn every_row_is_the_references() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("features.csv");
    let (code, said, complaints) = features(&data("trials.csv"), &[], &out).await;
    assert_eq!((code, complaints.as_str()), (Some(0), ""));
    let said: Value = serde_json::from_str(&said).unwrap();
    let expected = json!({"participants": 8, "trials": 400, "steps": 20_000, "file": out});
    assert_eq!(said, expected);
    let header = fs::read_to_string(&out).unwrap().lines().next().unwrap().to_owned();
    let further = header.strip_prefix(COLUMNS).unwrap();
    assert!(further.starts_with(",robot_ahead,robot_left,"), "{further}");

    let (ours, theirs) = (table(&out), table(data("features.csv")));
    assert_eq!(ours.len(), theirs.len());
    let mut off: [Vec<f64>; 2] = Default::default();
    for (own, reference) in ours.iter().zip(&theirs) {
        for key in ["participant", "trial", "step"] {
            assert_eq!(own[key], reference[key]);
        }
        for (name, other) in [
            ("abs_dx", "apx"),
            ("abs_dy", "apy"),
            ("dpsi", "dpsi"),
            ("cos_dpsi", "cosd"),
            ("sin_dpsi", "sind"),
            ("distance", "d"),
            ("turn", "y1"),
            ("avoid", "y2"),
        ] {
            let apart = (number(own, name) - number(reference, other)).abs();
            // A little more than half a digit, for what decimal fractions are as binary ones.
            let allowed = half_a_digit(&reference[other]) + 1e-12;
            assert!(apart <= allowed, "{name}: {} for {}", own[name], reference[other]);
        }
        for (off, (name, other)) in off.iter_mut().zip([("v_h", "vh"), ("v_r", "vr")]) {
            off.push((number(own, name) - number(reference, other)).abs());
            assert!(number(own, name) <= number(own, "distance") - 3.0 + 1e-9);
        }
    }
    // The reference's safety levels come from a grid, whose error is about 0.02 m and more at the
    // kink and outside.
    for off in &mut off {
        off.sort_by(f64::total_cmp);
        let share = |share: f64| off[(share * off.len() as f64) as usize];
        assert!(share(0.5) < 0.01 && share(0.95) < 0.2, "{} {}", share(0.5), share(0.95));
    }
}

/// Of one trial each of two people.
fn some_rows() -> Vec<String> {
    let text = fs::read_to_string(data("trials.csv")).unwrap();
    let wanted = |line: &&str| line.starts_with("0,0,") || line.starts_with("3,7,");
    let header = text.lines().take(1);
    header.chain(text.lines().skip(1).filter(wanted)).map(str::to_owned).collect()
}

fn written(folder: &TempDir, rows: &[String]) -> String {
    let path = folder.path().join("trials.csv");
    fs::write(&path, rows.join("\n") + "\n").unwrap();
    path.to_str().unwrap().to_owned()
}

/// The pursuer's pose in the evader's frame.
fn relative(of: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = of[2].sin_cos();
    let (dx, dy) = (other[0] - of[0], other[1] - of[1]);
    let turned = (other[2] - of[2] + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
    [cos * dx + sin * dy, cos * dy - sin * dx, turned - std::f64::consts::PI]
}

/// What `sidestep value` says of the same poses.
#[tokio::test]
async fn safety_levels_are_those_of_the_game() {
    let folder = TempDir::new().unwrap();
    let trials = written(&folder, &some_rows());
    let poses = table(&trials);
    let [states, values, out] =
        ["states.csv", "values.csv", "features.csv"].map(|name| folder.path().join(name));
    let mut found = Vec::new();
    for flags in [&[][..], &["--radius", "2"]] {
        let (code, _, said) = features(&trials, flags, &out).await;
        assert_eq!((code, said.as_str()), (Some(0), ""));
        let rows = table(&out);
        found.push(rows.iter().map(|row| number(row, "v_h")).collect::<Vec<_>>());
        for (level, own, other) in [("v_h", "h", "r"), ("v_r", "r", "h")] {
            let pose = |row: &Row, of: &str| {
                ["x", "y", "psi"].map(|coordinate| number(row, &format!("{of}{coordinate}")))
            };
            let all = poses.iter().map(|row| relative(pose(row, own), pose(row, other)));
            let lines: Vec<String> = all.map(|[x, y, psi]| format!("{x},{y},{psi}")).collect();
            fs::write(&states, format!("x,y,psi\n{}\n", lines.join("\n"))).unwrap();
            let files = ["--states", states.to_str().unwrap(), "--out", values.to_str().unwrap()];
            let output = sidestep(&[&["value"], flags, &files].concat()).await;
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            for (row, exact) in rows.iter().zip(table(&values)) {
                let apart = (number(row, level) - number(&exact, "value")).abs();
                assert!(apart < 1e-9, "{level}: {} for {}", row[level], exact["value"]);
            }
        }
    }
    assert!(found[0].iter().zip(&found[1]).all(|(one, other)| one != other));
}

#[tokio::test]
async fn bad_input_is_named_and_writes_nothing() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("features.csv");
    fs::write(&out, "former").unwrap();
    let rows = some_rows();
    let with = |line: usize, column: usize, text: &str| {
        let mut rows = rows.clone();
        let mut fields: Vec<&str> = rows[line - 1].split(',').collect();
        fields[column] = text;
        rows[line - 1] = fields.join(",");
        rows
    };
    let cases = [
        (with(1, 6, "heading"), "line 1: header: expected the columns"),
        (vec![rows.join("\n").replace(',', ";")], "found no column participant in \"participant;"),
        (with(9, 10, "0.2"), "line 9: omega: expected -0.5, 0 or 0.5, found 0.2"),
        (with(9, 4, "NaN"), "line 9: hx: expected a finite number, found NaN"),
        (with(9, 4, "1e300"), "line 2: abs_dx: expected features of at most 1e9"),
        (with(9, 2, "8"), "line 9: step: expected 7, found 8"),
        (rows[..51 + 49].to_vec(), "line 100: step: expected 50 entries, found 49"),
        (with(9, 0, ""), "line 9: participant: expected a name or number"),
        (rows[..1].to_vec(), "expected at least one trial, found no row"),
        (vec![], "line 1: header: expected the columns"),
    ];
    for (rows, words) in cases {
        let trials = written(&folder, &rows);
        let (code, printed, said) = features(&trials, &[], &out).await;
        assert_eq!((code, printed.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(words) && said.contains("trials.csv"), "{words}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        assert_eq!(fs::read_to_string(&out).unwrap(), "former");
    }
    let trials = written(&folder, &rows);
    for (flags, words) in [
        (["--radius", "-1"], "--radius"),
        (["--evader-speed", "fast"], "--evader-speed"),
        // The inputs of the file are not this vehicle's.
        (["--evader-turn-rate", "0.4"], "omega: expected -0.4, 0 or 0.4"),
    ] {
        let (code, printed, said) = features(&trials, &flags, &out).await;
        assert_eq!((code, printed.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(words), "{words}: {said}");
    }
    let (code, _, said) = features("nowhere.csv", &[], &out).await;
    assert_eq!(code, Some(2));
    assert!(said.contains("nowhere.csv: cannot read"), "{said}");

    // Where nothing can be written: a folder, and below a file.
    for place in [folder.path().to_owned(), out.join("features.csv")] {
        let (code, printed, said) = features(&trials, &[], &place).await;
        assert_eq!((code, printed.as_str()), (Some(1), ""), "{said}");
        assert!(said.contains("cannot write"), "{said}");
    }
    let mut names: Vec<_> =
        fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["features.csv", "trials.csv"], "no temporary file is left");
}
