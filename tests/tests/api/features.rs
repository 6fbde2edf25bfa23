//! `features`: writes the inputs of predictors to a file.

use serde_json::json;
use sidestep_tests::folder::{Row, data, number, rows};
use sidestep_tests::process::Said;
use sidestep_tests::{Folder, run};
use std::fs;

async fn features(trials: &str, flags: &[&str], out: &str) -> Said {
    let args = ["features", "--trials", trials, "--out", out];
    run(&[&args[..], flags].concat()).await
}

/// Rounding error of a printed number: half a unit of its last digit.
fn half_a_digit(printed: &str) -> f64 {
    let (digits, exponent) = printed.split_once('e').unwrap_or((printed, "0"));
    let places = digits.split_once('.').map_or(0, |(_, fraction)| fraction.len());
    0.5 * 10f64.powi(exponent.parse::<i32>().unwrap() - places as i32)
}

const COLUMNS: &str =
    "participant,trial,step,abs_dx,abs_dy,dpsi,cos_dpsi,sin_dpsi,v_h,v_r,distance,turn,avoid";

#[tokio::test]
async fn every_row_is_the_references() {
    let folder = Folder::default();
    let out = folder.name("features.csv");
    let said = features(&data("trials.csv"), &[], &out).await.only_json();
    // In the reference's trials, keys changed within steps, so most trials do not replay.
    let expected = json!({
        "participants": 8, "trials": 400, "steps": 20_000, "file": out,
        "excluded": [], "flagged": {"replay_mismatch": 381},
    });
    assert_eq!(said, expected);
    let header = folder.text("features.csv").lines().next().unwrap().to_owned();
    let further = header.strip_prefix(COLUMNS).unwrap();
    assert!(further.starts_with(",robot_ahead,robot_left,"), "{further}");

    let (ours, theirs) = (rows(&out), rows(data("features.csv")));
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
            // Allow slightly more than half a digit, because decimal fractions are not exact in
            // binary.
            let allowed = half_a_digit(&reference[other]) + 1e-12;
            assert!(apart <= allowed, "{name}: {} for {}", own[name], reference[other]);
        }
        for (off, (name, other)) in off.iter_mut().zip([("v_h", "vh"), ("v_r", "vr")]) {
            off.push((number(own, name) - number(reference, other)).abs());
            assert!(number(own, name) <= number(own, "distance") - 3.0 + 1e-9);
        }
    }
    // The reference's safety levels come from a grid. Their error is about 0.02 m, but larger at
    // the kink and outside the grid.
    for off in &mut off {
        off.sort_by(f64::total_cmp);
        let share = |share: f64| off[(share * off.len() as f64) as usize];
        assert!(share(0.5) < 0.01 && share(0.95) < 0.2, "{} {}", share(0.5), share(0.95));
    }
}

/// The header, and one trial each of two participants.
fn some_rows() -> Vec<String> {
    let text = fs::read_to_string(data("trials.csv")).unwrap();
    let wanted = |line: &&str| line.starts_with("0,0,") || line.starts_with("3,7,");
    let header = text.lines().take(1);
    header.chain(text.lines().skip(1).filter(wanted)).map(str::to_owned).collect()
}

fn written(folder: &Folder, rows: &[String]) -> String {
    folder.file("trials.csv", rows.join("\n") + "\n")
}

/// The second pose in the frame of the first: the pursuer's pose in the evader's frame.
fn relative(of: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = of[2].sin_cos();
    let (dx, dy) = (other[0] - of[0], other[1] - of[1]);
    let turned = (other[2] - of[2] + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU);
    [cos * dx + sin * dy, cos * dy - sin * dx, turned - std::f64::consts::PI]
}

/// The safety levels equal the output of `sidestep value` at the same poses.
#[tokio::test]
async fn safety_levels_are_those_of_the_game() {
    let folder = Folder::default();
    let trials = written(&folder, &some_rows());
    let poses = rows(&trials);
    let [values, out] = ["values.csv", "features.csv"].map(|name| folder.name(name));
    let mut found = Vec::new();
    for flags in [&[][..], &["--radius", "2"]] {
        features(&trials, flags, &out).await.only_json();
        let found_rows = rows(&out);
        found.push(found_rows.iter().map(|row| number(row, "v_h")).collect::<Vec<_>>());
        for (level, own, other) in [("v_h", "h", "r"), ("v_r", "r", "h")] {
            let pose = |row: &Row, of: &str| {
                ["x", "y", "psi"].map(|coordinate| number(row, &format!("{of}{coordinate}")))
            };
            let all = poses.iter().map(|row| relative(pose(row, own), pose(row, other)));
            let lines: Vec<String> = all.map(|[x, y, psi]| format!("{x},{y},{psi}")).collect();
            let lines = format!("x,y,psi\n{}\n", lines.join("\n"));
            let states = folder.file("states.csv", lines);
            let files = ["--states", &states, "--out", &values];
            run(&[&["value"], flags, &files].concat()).await.json();
            for (row, exact) in found_rows.iter().zip(rows(&values)) {
                let apart = (number(row, level) - number(&exact, "value")).abs();
                assert!(apart < 1e-9, "{level}: {} for {}", row[level], exact["value"]);
            }
        }
    }
    assert!(found[0].iter().zip(&found[1]).all(|(one, other)| one != other));
}

#[tokio::test]
async fn bad_input_is_named_and_writes_nothing() {
    let folder = Folder::default();
    let out = folder.file("features.csv", "former");
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
        (vec![rows.join("\n").replace(',', "|")], "found no column participant in \"participant|"),
        (with(9, 10, "0.2"), "line 9: omega: expected -0.5, 0 or 0.5, found 0.2"),
        (with(9, 4, "NaN"), "line 9: hx: expected a finite number, found NaN"),
        (with(9, 4, "1e300"), "line 9: hx: expected a number from -1000000"),
        (with(9, 2, "8"), "line 9: step: expected 7, found 8"),
        (rows[..51 + 49].to_vec(), "line 100: step: expected 50 entries, found 49"),
        (with(9, 0, ""), "line 9: participant: expected a name or number"),
        (rows[..1].to_vec(), "expected at least one trial, found no row"),
        (vec![], "line 1: header: expected the columns"),
    ];
    for (rows, words) in cases {
        let trials = written(&folder, &rows);
        features(&trials, &[], &out).await.refused(2, &[words, "trials.csv"]);
        assert_eq!(folder.text("features.csv"), "former");
    }
    let trials = written(&folder, &rows);
    for (flags, words) in [
        (["--radius", "-1"], "--radius"),
        (["--evader-speed", "fast"], "--evader-speed"),
        // A vehicle with this turn rate cannot have the inputs in the file.
        (["--evader-turn-rate", "0.4"], "omega: expected -0.4, 0 or 0.4"),
    ] {
        features(&trials, &flags, &out).await.refused(2, &[words]);
    }
    features("nowhere.csv", &[], &out).await.refused(2, &["nowhere.csv: cannot read"]);

    // Outputs that cannot be written: a folder, and a path inside a file.
    for place in [folder.root().display().to_string(), folder.name("features.csv/features.csv")] {
        features(&trials, &[], &place).await.refused(1, &["cannot write"]);
    }
    assert_eq!(folder.names(), ["features.csv", "trials.csv"], "no temporary file is left");
}
