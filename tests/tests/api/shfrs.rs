//! `shfrs`: regions, tuning, Pareto curves and danger for recorded trials of synthetic people
//! (`shared/tests/data/README.md`), and invalid input.

use sidestep_tests::folder::{data, number, rows};
use sidestep_tests::process::Said;
#[cfg(unix)]
use sidestep_tests::process::interrupted;
use sidestep_tests::{Folder, run};

async fn shfrs(out: &str, flags: &[&str]) -> Said {
    let args = ["shfrs", "--trials", &data("trials.csv"), "--out", out];
    run(&[&args[..], flags].concat()).await
}

#[tokio::test]
async fn every_file_says_what_it_depends_on() {
    let folder = Folder::default();
    // The folder does not exist yet.
    let out = folder.path("found");
    // Two people have 30 calibration trajectories, and the PAC guarantee of 0.9 needs 29.
    let flags = ["--seed", "3", "--participant", "2", "--participant", "3"];
    let asked = ["--guarantee", "conformal,pac,fixed-sequence", "--probability", "0.5,0.9"];
    let guarantees = [&flags[..], &asked].concat();
    let line = shfrs(&folder.name("found"), &guarantees).await.only_json();
    assert_eq!((&line["training"], &line["calibration"]), (&40.into(), &30.into()));
    for file in line["files"].as_array().unwrap() {
        assert!(out.join(file.as_str().unwrap()).is_file(), "{file}");
    }

    let regions = rows(out.join("regions.csv"));
    assert_eq!(regions.len(), 3 * 5);
    for choice in ["every_step", "random_one", "avoidance_onset"] {
        let of: Vec<_> = regions.iter().filter(|row| row["window_choice"] == choice).collect();
        let sum: f64 = of.iter().map(|row| number(row, "p_region")).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{choice}: {sum}");
        assert_eq!(number(of[4], "p_set"), 1.0);
        assert!(of.iter().map(|row| number(row, "p_set")).is_sorted());
        assert!(of.iter().map(|row| number(row, "mean_area_m2")).is_sorted());
        for row in of {
            let p = number(row, "p_set");
            assert!(number(row, "p_set_low") <= p && p <= number(row, "p_set_high"));
            assert_eq!(number(row, "tolerance_m"), 0.005);
        }
    }
    let windows = |choice: &str| {
        regions.iter().find(|row| row["window_choice"] == choice).unwrap()["windows"].clone()
    };
    assert_eq!((windows("every_step"), windows("random_one")), ("2460".into(), "60".into()));

    let tuning = rows(out.join("tuning.csv"));
    assert_eq!(tuning.len(), 6);
    for row in &tuning {
        // The confidence interval of the coverage must not exclude the guaranteed probability.
        assert!(number(row, "coverage_high") >= number(row, "p"), "{row:?}");
        assert!(number(row, "mean_area_m2") < 16.0 / 3.0 + 1e-9);
        assert!(row["statement"].contains("30 trajectories"));
        let paper = row["guarantee"] == "fixed_sequence";
        assert_eq!(row["rollout"], if paper { "paper" } else { "base" });
    }

    let pareto = rows(out.join("pareto.csv"));
    for family in ["worst case", "constant velocity", "hold the input", "learned disturbance"] {
        let of: Vec<_> = pareto.iter().filter(|row| row["family"] == family).collect();
        assert_eq!(of.len(), 2, "{family}");
        assert!(of.iter().map(|row| number(row, "mean_area_m2")).is_sorted());
    }
    let danger = rows(out.join("danger.csv"));
    assert_eq!(danger.len(), 30);
    for row in &danger {
        let (low, high) = (number(row, "probability_low"), number(row, "probability_high"));
        assert!((0.0..=1.0).contains(&low) && low <= high && high <= 1.0, "{row:?}");
        assert!(!(row["entered"] == "1" && high == 0.0), "{row:?}");
    }
    for figure in ["regions.svg", "pareto.svg"] {
        let svg = std::fs::read_to_string(out.join(figure)).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
    }

    // If the trained predictor is passed to the command, no other predictor is trained.
    let predictor = out.join("predictor.json");
    let given = [&flags[..], &["--predictor", predictor.to_str().unwrap()]].concat();
    shfrs(&folder.name("again"), &given).await.json();
    assert_eq!(rows(folder.path("again/regions.csv")), regions);
}

/// A guarantee that is impossible with so few tasks is left out and named. The other guarantees are
/// not affected.
#[tokio::test]
async fn an_impossible_guarantee_does_not_refuse_the_others() {
    let folder = Folder::default();
    let said = shfrs(&folder.name("found"), &["--participant", "2", "--participant", "3"]).await;
    assert!(said.err.contains(
        "p = 0.95 (pac) is left out: expected at least 59 trajectories to calibrate with, found 30"
    ));
    let line = said.json();
    let left_out = line["left_out"].as_array().unwrap();
    assert_eq!((left_out.len(), &left_out[0]["needed"]), (1, &59.into()));
    let tuning = rows(folder.path("found/tuning.csv"));
    assert_eq!(tuning.len(), 5);
    for row in &tuning {
        // The reachable area in 2 s is 16/3 m².
        let share = number(row, "mean_area_m2") / (16.0 / 3.0);
        assert!((number(row, "share_of_worst_case") - share).abs() < 1e-9, "{row:?}");
        let warns = row["statement"].contains("% of all that the vehicle can reach");
        assert_eq!(warns, share >= 0.95, "{row:?}");
        assert_eq!(row["unit"], "trajectories");
    }
    assert_eq!(rows(folder.path("found/pareto.csv")).len() % 3, 0, "conformal can all three");
    for row in rows(folder.path("found/regions.csv")) {
        assert_eq!(row["people"], "2");
        assert!(number(&row, "p_set_low_people") <= number(&row, "p_set_low"), "{row:?}");
        assert!(number(&row, "p_set_high_people") >= number(&row, "p_set_high"), "{row:?}");
    }
}

/// People in the calibration set are not used in training. A guarantee for new people counts
/// people, not tasks.
#[tokio::test]
async fn a_split_by_people_guarantees_for_new_people() {
    let folder = Folder::default();
    let flags = ["--split", "people", "--probability", "0.5,0.9", "--guarantee", "conformal"];
    let said = shfrs(&folder.name("found"), &flags).await;
    let line = said.json();
    assert_eq!((&line["split"], &line["trajectories"]), (&"people".into(), &400.into()));
    // Of the 8 people, 40 % are used for training, with 50 tasks each. The other people contribute
    // one task each.
    let sizes = ["training", "calibration", "test"].map(|part| line[part].as_u64().unwrap());
    assert_eq!(sizes, [150, 3, 2]);
    assert_eq!(line["left_out"][0]["needed"], 9);
    let text = std::fs::read_to_string(folder.path("found/shfrs.json")).unwrap();
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    let danger = found["danger"]["statement"].as_str().unwrap();
    assert!(danger.contains("from 3 people, one random trajectory of each"), "{danger}");
    let tuning = rows(folder.path("found/tuning.csv"));
    assert_eq!(tuning.len(), 1);
    assert_eq!((&tuning[0]["unit"][..], &tuning[0]["calibration"][..]), ("people", "3"));
    assert!(tuning[0]["statement"].contains("3 people, one random trajectory of each"));
    let few = ["--split", "people", "--probability", "0.9", "--guarantee", "pac"];
    shfrs(&folder.name("none"), &few).await.refused(
        2,
        &[
            "expected at least 29 people to calibrate with (a share of 0.3) for p = 0.9 (pac)",
            "found 3 of 8",
        ],
    );
}

/// Settings from the explorer have the same effect as flags.
#[tokio::test]
async fn settings_of_a_file_are_those_of_the_flags() {
    let folder = Folder::default();
    let file = |name: &str, rest: &str| {
        folder.file(name, format!("{{\"format\":\"sidestep-shfrs/1\",{rest}}}"))
    };
    let good = file("good", r#""steps":3,"epsilon":[0,0.3,1],"k":[2,1,1],"rollout":"paper""#);
    let of = async |out: &str, flags: &[&str]| {
        let usual = ["--participant", "2", "--probability", "0.75", "--guarantee", "conformal"];
        let found = shfrs(&folder.name(out), &[&usual[..], flags].concat()).await;
        found.json();
        rows(folder.path(out).join("regions.csv"))
    };
    let flags = ["--steps", "3", "--epsilon", "0,0.3,1", "--k", "2,1,1", "--rollout", "paper"];
    assert_eq!(of("file", &["--settings", &good]).await, of("flags", &flags).await);
    let good = file("shortest", r#""steps":3,"epsilon":[0,0.3,1],"q":[0.9,0.9,0.9]"#);
    let flags = ["--steps", "3", "--epsilon", "0,0.3,1", "--q", "0.9"];
    assert_eq!(of("interval", &["--settings", &good]).await, of("flag", &flags).await);

    let wrong = file("wrong", r#""steps":3,"epsilon":[0.4,0.3],"tau":0.1"#);
    let other = folder.file("other", "{\"format\":\"sidestep-predictor/1\"}");
    for (flags, words) in [
        (&["--settings", &wrong[..]][..], "wrong: epsilon[1]: expected 0.4 rad/s or more"),
        (&["--settings", &other[..]], "other: format: expected"),
        (&["--settings", "nowhere.json"], "nowhere.json: cannot read"),
        (&["--settings", &good[..], "--tau", "0.1"], "--settings"),
        (&["--settings", &good[..], "--q", "0.1"], "--settings"),
    ] {
        shfrs(&folder.name("none"), flags).await.refused(2, &[words]);
    }
}

#[tokio::test]
async fn what_makes_no_sense_is_refused_in_words() {
    let folder = Folder::default();
    let (out, file) = (folder.name("new/out"), &folder.file("file", "x")[..]);
    for (flags, words) in [
        (&["--epsilon", "0.2,0.1,1"][..], "--epsilon[1]: expected 0.2 rad/s or more"),
        (&["--epsilon", "0,0.5"], "--epsilon[1]: expected at least 1 rad/s"),
        (&["--epsilon", "nan,1"], "--epsilon[0]"),
        (&["--k", "2,1"], "--k: expected 10 numbers (--steps), found 2"),
        (&["--k", "2,0", "--steps", "2"], "--k[1]: expected a whole number from 1 to 3"),
        (&["--k", "4,1", "--steps", "2"], "--k[0]: expected a whole number from 1 to 3, found 4"),
        (&["--tau", "0"], "--tau: expected a number in (0, 1]"),
        (&["--q", "0"], "--q[0]: expected a number in (0, 1]"),
        (&["--q", "0.9,0.8"], "--q: expected 10 numbers (--steps), found 2"),
        (&["--steps", "0"], "--steps: expected at least 1, found 0"),
        (&["--probability", "0.5,1"], "--probability"),
        (&["--probability", "NaN"], "--probability"),
        (&["--guarantee", "pac", "--delta", "0"], "--delta"),
        (&["--training", "0.9", "--calibration", "0.5"], "--calibration"),
        (&["--training", "0.5", "--calibration", "0.5"], "--calibration: expected shares"),
        (&["--confidence", "1"], "--confidence"),
        (&["--participant", "nobody"], "expected one of 0, 1, 2, 3, 4, 5, 6, 7, found nobody"),
        (
            &["--participant", "2", "--probability", "0.99"],
            "trials.csv: expected at least 99 tasks to calibrate with (a share of 0.3) for p = 0.99 (conformal), \
             found 15 of 50",
        ),
        (&["--features", "hrd,speed"], "--features"),
        (&["--predictor", "nowhere.json"], "nowhere.json: cannot read"),
        (&["--predictor", file], "file: "),
        (&["--steps", "60"], "--steps: expected at most 50"),
    ] {
        shfrs(&out, flags).await.refused(2, &[words]);
        assert_eq!(folder.names(), ["file"], "no folder is made: {flags:?}");
    }
    shfrs(file, &[]).await.refused(1, &["cannot write"]);
}

#[cfg(unix)]
#[tokio::test]
async fn an_analysis_that_is_interrupted_leaves_nothing() {
    let folder = Folder::default();
    let (trials, out) = (data("trials.csv"), folder.name("out"));
    for signal in ["INT", "TERM"] {
        // This tuning takes many seconds.
        let tuning = ["--guarantee", "conformal,pac,fixed-sequence", "--probability"];
        let levels = ["0.7,0.75,0.8,0.85,0.9,0.95", "--trials", &trials, "--out", &out];
        let args = [&["shfrs"], &tuning[..], &levels].concat();
        let said: Said = interrupted(&args, signal, || true).await.into();
        said.refused(1, &["nothing was written"]);
        assert!(folder.names().is_empty(), "{:?}", folder.names());
    }
}
