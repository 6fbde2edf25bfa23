//! `analyze`: an error in one person's data excludes that person, and an error in the file format
//! rejects the file.

use crate::analyze::{analyze, some_trials, written};
use serde_json::{Value, json};
use sidestep_tests::folder::{data, rows as table};
use sidestep_tests::sidestep;
use std::fs;
use tempfile::TempDir;

/// Line number of the first row of person 1, in a file of persons 0 and 1 with six tasks each.
const FIRST: usize = 302;

fn changed(row: &str, column: usize, text: &str) -> String {
    let mut fields: Vec<&str> = row.split(',').collect();
    fields[column] = text;
    fields.join(",")
}

#[tokio::test]
async fn who_has_a_wrong_row_is_named_and_all_others_are_compared() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let (header, good) = some_trials(&["0", "1"], 6);
    let own = good.iter().position(|row| row.starts_with("1,")).unwrap();
    assert_eq!(own + 2, FIRST);
    type Change = fn(&mut Vec<String>);
    let cases: [(Change, u64, &str); 16] = [
        (|own| drop(own.pop()), 600, "step: expected 50 entries, found 49"),
        (|own| own.truncate(251), 552, "step: expected 50 entries, found 1"),
        (|own| drop(own.remove(9)), 311, "step: expected 9, found 10"),
        (
            |own| own.push(changed(&changed(&own[299], 2, "50"), 3, "10")),
            602,
            "step: expected 50 steps a trial, found a further row, 50",
        ),
        (|own| own.swap(9, 10), 311, "step: expected 9, found 10"),
        (|own| own.insert(10, own[9].clone()), 312, "step: expected 10, found 9"),
        (|own| own[20] = changed(&own[20], 10, "0.3"), 322, "omega: expected -0.5, 0 or 0.5"),
        (|own| own[20] = changed(&own[20], 4, "nan"), 322, "hx: expected a finite number"),
        (|own| own[20] = changed(&own[20], 9, "-inf"), 322, "rpsi: expected a finite number"),
        (|own| own[20] = changed(&own[20], 4, "left"), 322, "hx: expected a number, found"),
        (|own| own[20] = changed(&own[20], 4, ""), 322, "hx: expected a number, found"),
        (|own| own[20] = changed(&own[20], 4, "1e300"), 322, "hx: expected a number from -1000000"),
        (
            |own| own[20] = changed(&own[20], 9, "-5e6"),
            322,
            "rpsi: expected a number from -1000000",
        ),
        (|own| own[20] = changed(&own[20], 1, "-1"), 322, "trial: expected a whole number"),
        (|own| own[20] = changed(&own[20], 3, "9"), 322, "t: expected 4 (steps of 0.2 s)"),
        // The first of several errors is reported.
        (
            |own| {
                own[70] = changed(&own[70], 4, "x");
                own[60] = changed(&own[60], 5, "y");
            },
            362,
            "hy: expected a number",
        ),
    ];
    for (change, line, words) in cases {
        let mut rows = good.clone();
        let mut wrong = rows.split_off(own);
        change(&mut wrong);
        rows.extend(wrong);
        let trials = written(&folder, "trials.csv", &header, &rows);
        let (code, printed, said) = analyze(&["--trials", &trials], &out).await;
        assert_eq!(code, Some(0), "{words}: {said}");
        let start = format!("{trials}: excluded: participant 1: line {line}: ");
        assert!(said.contains(&start) && said.contains(words), "{words}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        let printed: Value = serde_json::from_str(&printed).unwrap();
        let [excluded] = &printed["excluded"].as_array().unwrap()[..] else {
            panic!("{printed}");
        };
        assert_eq!((&excluded["participant"], &excluded["line"]), (&"1".into(), &line.into()));
        assert!(excluded["reason"].as_str().unwrap().contains(words), "{excluded}");
        for file in ["report.html", "tables.tex"] {
            let text = fs::read_to_string(out.join(file)).unwrap();
            assert!(text.contains(&format!("line {line}: ")), "{file}");
        }
        let cells = table(out.join("cells.csv"));
        assert!(cells.len() == 90 && cells.iter().all(|row| row["participant"] == "0"));
    }
}

#[tokio::test]
async fn who_cannot_be_learned_from_is_named_and_left_out() {
    let folder = TempDir::new().unwrap();
    let (header, mut rows) = some_trials(&["0"], 6);
    rows.extend(some_trials(&["1"], 4).1);
    let idle = some_trials(&["2"], 6).1;
    rows.extend(idle.iter().map(|row| changed(row, 10, "0.0")));
    let task = |row: &String| format!("{row},task");
    let mut rows: Vec<String> = rows.iter().map(task).collect();
    rows.extend(some_trials(&["3"], 6).1.iter().map(|row| format!("{row},practice")));
    let trials = written(&folder, "trials.csv", &format!("{header},phase"), &rows);
    let out = folder.path().join("out");
    let (code, line, said) = analyze(&["--trials", &trials], &out).await;
    assert_eq!(code, Some(0), "{said}");
    let expected = [
        "participant 1: 4 tasks, at least 5 are needed (their rows begin in line 302)",
        "participant 2: only one kind of input in the training tasks (straight) (their rows begin \
         in line 502)",
        "participant 3: 0 tasks, at least 5 are needed (their rows begin in line 802)",
    ];
    for (said, expected) in said.lines().zip(expected) {
        assert!(said.ends_with(expected), "{said}");
    }
    assert_eq!(said.lines().count(), 3, "{said}");
    let line: Value = serde_json::from_str(&line).unwrap();
    let lines = line["excluded"].as_array().unwrap().iter().map(|one| one["first_line"].as_u64());
    assert_eq!(lines.collect::<Vec<_>>(), [Some(302), Some(502), Some(802)]);
    assert_eq!(line["participants"], 1);
    assert!(table(out.join("cells.csv")).iter().all(|row| row["participant"] == "0"));
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("3 people were excluded:"));

    let alone = written(&folder, "alone.csv", &header, &some_trials(&["1"], 4).1);
    let (code, _, said) = analyze(&["--trials", &alone], &out).await;
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("participants: expected a participant with usable data"), "{said}");
}

#[tokio::test]
async fn one_person_under_several_names_is_told() {
    let folder = TempDir::new().unwrap();
    let (header, mut rows) = some_trials(&["0", "1"], 6);
    let twin = some_trials(&["0"], 6).1;
    rows.extend(twin.iter().map(|row| changed(row, 0, "<twin>")));
    let trials = written(&folder, "trials.csv", &header, &rows);
    let out = folder.path().join("out");
    let (code, line, said) = analyze(&["--trials", &trials], &out).await;
    assert_eq!(code, Some(0), "{said}");
    let line: Value = serde_json::from_str(&line).unwrap();
    assert_eq!((&line["participants"], &line["same_trials"]), (&3.into(), &json!(["0", "<twin>"])));
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(
        report.contains("2 people have the same trials as somebody else</b>: 0 and &lt;twin&gt;.")
    );
}

/// Two of the first tasks are copied to the end, where they become test tasks.
#[tokio::test]
async fn trials_copied_within_one_person_are_told() {
    let folder = TempDir::new().unwrap();
    let (header, mut rows) = some_trials(&["0"], 10);
    let again = some_trials(&["0"], 2).1;
    let renumbered = |row: &String| {
        let number = if row.starts_with("0,0,") { "10" } else { "11" };
        changed(row, 1, number)
    };
    rows.extend(again.iter().map(renumbered));
    let trials = written(&folder, "trials.csv", &header, &rows);
    let out = folder.path().join("out");
    let (code, line, said) = analyze(&["--trials", &trials], &out).await;
    assert_eq!(code, Some(0), "{said}");
    let line: Value = serde_json::from_str(&line).unwrap();
    let expected = json!([{"participant": "0", "trials": [[0, 10], [1, 11]], "leaking": 2}]);
    assert_eq!((&line["copied_trials"], &line["same_trials"]), (&expected, &json!([])));
    let report = fs::read_to_string(out.join("report.html")).unwrap();
    assert!(report.contains("1 person</b>: 0 (trials 0 = 10, 1 = 11)."), "{report}");
    assert!(report.contains("2 tasks of the test are among those"));
}

#[tokio::test]
async fn files_are_refused_where_it_cannot_be_told_whose_the_rows_are() {
    let folder = TempDir::new().unwrap();
    let (header, rows) = some_trials(&["0", "1"], 6);
    let out = folder.path().join("out");
    let trials = folder.path().join("trials.csv");
    let path = trials.to_str().unwrap();
    let refused = async |bytes: Vec<u8>, words: &str| {
        fs::write(&trials, bytes).unwrap();
        let (code, line, said) = analyze(&["--trials", path], &out).await;
        assert_eq!((code, line.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(&format!("trials.csv: {words}")), "{words}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        assert!(!out.exists());
    };
    let text = |header: &str, rows: &[String]| format!("{header}\n{}\n", rows.join("\n"));
    let all = text(&header, &rows);
    let with = |line: usize, row: &str| {
        let mut rows = rows.clone();
        rows[line - 2] = row.to_owned();
        text(&header, &rows).into_bytes()
    };
    refused(Vec::new(), "line 1: header: expected the columns participant,").await;
    refused(header.clone().into(), "line 1: file: expected at least one trial, found no row").await;
    let columns =
        "line 1: header: expected the columns participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega";
    let heading = text(&header.replace("hpsi", "heading"), &rows);
    refused(heading.into(), &format!("{columns}, found no column hpsi")).await;
    refused(
        all.replace(',', "|").into(),
        &format!(
            "{columns}, found no column participant in {:?}; \
        separate columns by commas, semicolons or tabs",
            header.replace(',', "|").chars().take(60).collect::<String>()
        ),
    )
    .await;
    let twice = all.replacen("omega", "hx", 1);
    refused(twice.into(), "line 1: header: expected each column once").await;
    let (start, _) = rows[400].rsplit_once(',').unwrap();
    refused(with(402, start), "line 402: row: expected 11 fields, as in the header, found 10")
        .await;
    let long = format!("{},1", rows[400]);
    refused(with(402, &long), "line 402: row: expected 11 fields, as in the header, found 12")
        .await;
    let open = changed(&rows[400], 4, "\"1");
    refused(with(402, &open), "line 402: row: expected 11 fields, as in the header").await;
    // Lines are counted as in an editor, even with CR LF line ends and empty lines.
    let other_ends = String::from_utf8(with(402, start)).unwrap().replace('\n', "\r\n");
    refused(other_ends.into(), "line 402: row: expected 11 fields, as in the header").await;
    let spaced = String::from_utf8(with(402, start)).unwrap().replacen('\n', "\n\n\n", 1);
    refused(spaced.into(), "line 404: row: expected 11 fields, as in the header").await;
    let nobody = changed(&rows[400], 0, " ");
    refused(with(402, &nobody), "line 402: participant: expected a name or number").await;
    let long = changed(&rows[400], 0, &"7".repeat(1_000_000));
    refused(with(402, &long), "line 402: participant: expected a name or number").await;
    let mut bytes = all.clone().into_bytes();
    bytes.insert(all.len() - 3, 0xff);
    refused(bytes, "line 601: row: expected UTF-8 text, found a byte 0xff").await;
    let practice: Vec<String> = rows.iter().map(|row| format!("{row},practice")).collect();
    let practice = text(&format!("{header},phase"), &practice);
    refused(practice.into(), "expected at least one task, found none").await;
    // The data of every participant are wrong.
    let other: Vec<String> = rows.iter().map(|row| changed(row, 10, "7")).collect();
    let words = "line 2: omega: expected -0.5, 0 or 0.5, found 7; --evader-turn-rate sets the \
                 human's turn rate; 1 more have faults too";
    refused(text(&header, &other).into(), words).await;

    let (code, _, said) = analyze(&["--trials", "nowhere.csv"], &out).await;
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("nowhere.csv: cannot read"), "{said}");
    fs::write(&trials, &all).unwrap();
    let (code, printed, said) = analyze(&["--trials", path], &trials).await;
    assert_eq!((code, printed.as_str()), (Some(1), ""), "{said}");
    assert!(said.contains("cannot write"), "{said}");
}

/// Files as other programs write them: with a byte-order mark, CR LF line ends, quotes, and another
/// order of columns.
#[tokio::test]
async fn other_writers_files_are_read() {
    let folder = TempDir::new().unwrap();
    let (header, rows) = some_trials(&["0"], 5);
    let plain = written(&folder, "plain.csv", &header, &rows);
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    let (code, _, said) = analyze(&["--trials", &plain], &first).await;
    assert_eq!(code, Some(0), "{said}");
    let other = |line: &str| {
        let fields: Vec<String> = line.rsplit(',').map(|field| format!("\"{field}\"")).collect();
        format!("{},\"a, b\"\r\n", fields.join(", ").replace("\", \"", "\",\""))
    };
    let lines: Vec<String> = rows.iter().map(|row| other(row)).collect();
    let header = other(&header).replace("a, b", "further");
    let path = folder.path().join("other.csv");
    fs::write(&path, format!("\u{feff}{header}{}", lines.concat())).unwrap();
    let (code, _, said) = analyze(&["--trials", path.to_str().unwrap()], &second).await;
    assert_eq!(code, Some(0), "{said}");
    let cells = |out: &std::path::Path| fs::read(out.join("cells.csv")).unwrap();
    assert!(cells(&first) == cells(&second));
}

#[tokio::test]
async fn features_that_do_not_go_with_somebodys_trials_leave_them_out() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let (header, rows) = some_trials(&["0", "1"], 6);
    let trials = written(&folder, "trials.csv", &header, &rows);
    let features = folder.path().join("features.csv");
    let features = features.to_str().unwrap();
    let output = sidestep(&["features", "--trials", &trials, "--out", features]).await;
    assert!(output.status.success());
    let good = fs::read_to_string(features).unwrap();
    let good: Vec<String> = good.lines().map(str::to_owned).collect();
    let other = |turn: &str| if turn == "0" { "1" } else { "0" };
    let turn = good[FIRST].split(',').nth(11).unwrap();
    let cases = [
        (vec![(FIRST, changed(&good[FIRST], 8, "NaN"))], "line 303: v_h: expected a finite"),
        (vec![(FIRST, changed(&good[FIRST], 8, "?"))], "line 303: v_h: expected a number"),
        (vec![(FIRST, changed(&good[FIRST], 11, other(turn)))], "line 303: turn: expected"),
        (vec![(FIRST, good[FIRST - 1].clone())], "line 303: row: expected each step once"),
        (vec![(FIRST, changed(&good[FIRST], 2, "70"))], "participant 1, trial 0, step 1"),
    ];
    for (changes, words) in cases {
        let mut lines = good.clone();
        for (place, line) in changes {
            lines[place] = line;
        }
        fs::write(features, lines.join("\n")).unwrap();
        let args = ["--trials", &trials, "--features", features];
        let (code, printed, said) = analyze(&args, &out).await;
        assert_eq!(code, Some(0), "{said}");
        assert!(
            said.contains("excluded: participant 1: features: ") && said.contains(words),
            "{said}"
        );
        let printed: Value = serde_json::from_str(&printed).unwrap();
        assert_eq!(printed["excluded"][0]["participant"], "1");
        assert_eq!(printed["participants"], 1);
    }

    // The reference's features match its trials. A file without rows or with a wrong header is
    // rejected.
    let (code, _, said) =
        analyze(&["--trials", &trials, "--features", &data("features.csv")], &out).await;
    assert_eq!(code, Some(0), "the reference's go with its trials: {said}");
    let none = folder.path().join("none");
    for (text, words) in [
        (good[..1].join("\n"), "features.csv: row: expected participant 0, trial 0, step 0"),
        (good.join("\n").replacen("v_h", "safety", 1), "features.csv: line 1: header: expected"),
        (String::new(), "features.csv: line 1: header: expected"),
    ] {
        fs::write(features, text).unwrap();
        let args = ["--trials", &trials, "--features", features];
        let (code, printed, said) = analyze(&args, &none).await;
        assert_eq!((code, printed.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(words), "{words}: {said}");
        assert!(!none.join("cells.csv").exists());
    }
}

/// Apart from the unit of headings, everything is consistent: positions, speeds, inputs, and the
/// relative heading of the vehicles.
#[tokio::test]
async fn headings_in_degrees_are_refused() {
    let folder = TempDir::new().unwrap();
    let (header, rows) = some_trials(&["0", "1"], 6);
    let degrees = |row: &String, columns: &[usize]| {
        columns.iter().fold(row.clone(), |row, &column| {
            let radians: f64 = row.split(',').nth(column).unwrap().parse().unwrap();
            changed(&row, column, &radians.to_degrees().to_string())
        })
    };
    for (columns, words) in [(&[6, 9][..], "hpsi: expected"), (&[6], "hpsi:"), (&[9], "rpsi:")] {
        let wrong: Vec<String> = rows.iter().map(|row| degrees(row, columns)).collect();
        let trials = written(&folder, "trials.csv", &header, &wrong);
        let out = folder.path().join("out");
        let path = out.to_str().unwrap();
        let (code, line, said) = analyze(&["--trials", &trials], &out).await;
        assert_eq!((code, line.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(words) && said.contains("the headings are in degrees"), "{said}");
        for command in ["shfrs", "features"] {
            let output = sidestep(&[command, "--trials", &trials, "--out", path]).await;
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "{command}: {said}");
            assert!(said.contains("the headings are in degrees"), "{command}: {said}");
        }
        assert!(!out.exists());
    }
}

/// For one impossible step, `analyze` excludes the participant, and other commands reject the file.
/// Inputs with the opposite sign affect everyone, so no command accepts the file.
#[tokio::test]
async fn states_that_no_inputs_explain_are_refused() {
    let folder = TempDir::new().unwrap();
    let (out, file) = (folder.path().join("out"), folder.path().join("features.csv"));
    let (header, rows) = some_trials(&["0", "1"], 6);
    let number =
        |row: &str, column: usize| -> f64 { row.split(',').nth(column).unwrap().parse().unwrap() };
    let one = |column: usize, change: fn(f64) -> f64| -> Vec<String> {
        let mut rows = rows.clone();
        rows[20] = changed(&rows[20], column, &change(number(&rows[20], column)).to_string());
        rows
    };
    for (wrong, words) in [
        (one(4, |x| x + 0.02), "step 19: hx, hy: expected a position 0.4000 m away"),
        (one(6, f64::to_degrees), "step 19: hpsi: expected a heading in radians"),
        (one(9, |psi| psi + 0.2), "step 19: rpsi: expected a heading"),
    ] {
        let trials = written(&folder, "trials.csv", &header, &wrong);
        let (code, line, said) = analyze(&["--trials", &trials], &out).await;
        assert_eq!(code, Some(0), "{said}");
        assert!(
            said.contains("excluded: participant 0: line 2: trial 0, ") && said.contains(words)
        );
        assert!(line.contains(r#""participants":1"#) && line.contains(words), "{line}");
        let path = file.to_str().unwrap();
        let output = sidestep(&["features", "--trials", &trials, "--out", path]).await;
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(words) && !file.exists(), "{said}");
    }
    let opposite = rows.iter().map(|row| changed(row, 10, &(-number(row, 10)).to_string()));
    let trials = written(&folder, "trials.csv", &header, &opposite.collect::<Vec<_>>());
    let (code, _, said) = analyze(&["--trials", &trials], &folder.path().join("none")).await;
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("trials.csv: omega: expected") && said.contains("the opposite of omega"));
}

/// If the safety levels were computed for other vehicles than those of the trials, the results
/// would look valid. Therefore, such trials are refused.
#[tokio::test]
async fn trials_of_other_vehicles_are_not_taken_for_these() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("out");
    let (header, rows) = some_trials(&["0", "1"], 6);
    let trials = written(&folder, "trials.csv", &header, &rows);
    for (flag, speed, words) in [
        ("--evader-speed", "1.5", "the human to move 0.3000 m in a step (--evader-speed 1.5)"),
        ("--pursuer-speed", "3", "the robot to move 0.6000 m in a step (--pursuer-speed 3)"),
    ] {
        let (code, printed, said) = analyze(&["--trials", &trials, flag, speed], &out).await;
        assert_eq!((code, printed.as_str()), (Some(2), ""), "{said}");
        assert!(said.contains(words) && said.contains(&format!("{flag} 2.0000 fits")), "{said}");
        let features = folder.path().join("features.csv");
        let args = ["features", "--trials", &trials, flag, speed, "--out"];
        let output = sidestep(&[&args[..], &[features.to_str().unwrap()]].concat()).await;
        assert_eq!((output.status.code(), features.exists()), (Some(2), false));
    }
    // Trials with fewer steps are accepted if the flag states the number of steps.
    let short: Vec<String> = (rows.iter())
        .filter(|row| row.split(',').nth(2).unwrap().parse::<u64>().unwrap() < 40)
        .cloned()
        .collect();
    let trials = written(&folder, "short.csv", &header, &short);
    let (code, _, said) = analyze(&["--trials", &trials], &out).await;
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("expected 50 entries, found 40"), "{said}");
    let (code, _, said) = analyze(&["--trials", &trials, "--trial-steps", "40"], &out).await;
    assert_eq!(code, Some(0), "{said}");
    for (args, field) in [
        (["--trial-steps", "0"], "--trial-steps"),
        (["--step", "-1"], "--step"),
        (["--step", "inf"], "--step"),
    ] {
        let (code, _, said) = analyze(&[&["--trials", &trials], &args[..]].concat(), &out).await;
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(&format!("sidestep: {field}: expected")), "{said}");
    }
}
