//! `design`: a preview of the scenes of a study, and invalid input.

use sidestep_tests::folder::{Row, number, rows};
use sidestep_tests::process::Said;
use sidestep_tests::{Folder, run};
use std::collections::{BTreeMap, BTreeSet};

async fn design(study: &str, out: &str, flags: &[&str]) -> Said {
    run(&[&["design", "--study", study, "--out", out], flags].concat()).await
}

#[tokio::test]
async fn every_stratum_and_every_scene_is_listed() {
    let folder = Folder::default();
    let text = "slug = \"pilot\"\nphases = [{ phase = \"practice\", scenes = 3 }, \
                { phase = \"task\", scenes = 10 }]\n[encounters]\nmax_entry_s = 7.0\n";
    let study = folder.file("study.toml", text);
    let out = folder.path("design");
    let said = design(&study, &folder.name("design"), &[]).await;
    assert_eq!(said.err.lines().count(), 2, "one sentence for each phase: {}", said.err);
    assert!(said.err.contains("of 100 scenes") && !said.err.contains("warning"), "{}", said.err);
    let line = said.json();
    // There is one block of ten tasks.
    assert_eq!(line["participants"], 10);
    for file in line["files"].as_array().unwrap() {
        assert!(out.join(file.as_str().unwrap()).is_file(), "{file}");
    }
    let tasks = &line["phases"][1];
    assert_eq!((&tasks["phase"], &tasks["drawn"]), (&"task".into(), &100.into()));
    for balanced in ["approach_at_position", "approach_after_approach"] {
        assert_eq!(tasks[balanced], serde_json::json!({ "least": 1, "most": 1 }), "{balanced}");
    }

    let strata = rows(out.join("strata.csv"));
    assert_eq!(strata.len(), 3 * (3 + 10));
    let [mut planned, mut realised] = [0.0, 0.0];
    for row in strata.iter().filter(|row| row["phase"] == "task") {
        assert_eq!(number(row, "planned"), 10.0);
        assert!(number(row, "low") < number(row, "high"));
        planned += number(row, "planned");
        realised += number(row, "realised");
        if row["coordinate"] == "approach" {
            assert_eq!((row["unit"].as_str(), row["realised"].as_str()), ("deg", "10"));
        }
    }
    assert_eq!((planned, realised), (300.0, 300.0));
    let last = strata.last().unwrap();
    assert_eq!((last["coordinate"].as_str(), last["high"].as_str()), ("entry", "7.0"));

    let scenes = rows(out.join("scenes.csv"));
    assert_eq!(scenes.len(), 10 * (3 + 10));
    let ends: BTreeMap<_, _> = strata
        .iter()
        .map(|row| {
            let name = (row["phase"].clone(), row["coordinate"].clone(), row["stratum"].clone());
            (name, [number(row, "low"), number(row, "high")])
        })
        .collect();
    let mut pairs = BTreeSet::new();
    for scene in &scenes {
        for (coordinate, value) in
            [("approach", "approach_deg"), ("miss", "miss_m"), ("entry", "entry_s")]
        {
            let stratum = scene[&format!("{coordinate}_stratum")].clone();
            let [low, high] = ends[&(scene["phase"].clone(), coordinate.to_owned(), stratum)];
            let value = number(scene, value);
            assert!(low - 1e-9 <= value && value <= high + 1e-9, "{scene:?}");
        }
        // `closest_m` is sampled every 0.01 s, so it is at least the miss distance.
        let closest = number(scene, "closest_m");
        assert!(closest <= 3.0 && closest >= number(scene, "miss_m").abs() - 1e-9, "{scene:?}");
        if scene["phase"] == "task" {
            let planned = |scene: &Row| {
                ["approach_stratum", "planned_miss_stratum"].map(|name| scene[name].clone())
            };
            assert!(pairs.insert(planned(scene)), "each pair is planned once: {scene:?}");
        }
    }
    let svg = std::fs::read_to_string(out.join("design.svg")).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("10 participants"));

    // The same seed gives the same scenes, and another seed gives other scenes.
    design(&study, &folder.name("again"), &["--participants", "2"]).await.json();
    assert_eq!(rows(folder.path("again/scenes.csv")), scenes[..26]);
    let study = folder.file("other.toml", format!("seed = 1\n{text}"));
    design(&study, &folder.name("other"), &["--participants", "2"]).await.json();
    assert_ne!(rows(folder.path("other/scenes.csv")), scenes[..26]);
}

#[tokio::test]
async fn what_is_wrong_is_named_and_nothing_is_written() {
    let folder = Folder::default();
    let file = |name: &str, text: &str| folder.file(name, format!("slug = \"pilot\"\n{text}"));
    let good = file("good.toml", "");
    let degrees = file("degrees.toml", "[encounters]\nmin_approach_rad = 20.0\n");
    let unknown = file("unknown.toml", "[encounters]\nmin_angle = 0.3\n");
    let short = file("short.toml", "[encounters]\nmin_entry_s = 11.0\nmax_entry_s = 12.0\n");
    let out = folder.name("out");
    let none = folder.name("none.toml");
    for (study, flags, words) in [
        (&good, &["--participants", "0"][..], &["--participants", "from 1 to", "found 0"][..]),
        (&good, &["--participants", "10001"], &["--participants", "10000"]),
        (&none, &[], &["none.toml"]),
        (&degrees, &[], &["degrees.toml", "encounters.min_approach_rad", "radians", "20"]),
        (&unknown, &[], &["encounters", "min_angle"]),
        (&short, &[], &["short.toml", "encounters", "duration"]),
    ] {
        design(study, &out, flags).await.refused(2, words);
        assert!(!folder.path("out").exists());
    }
}

#[tokio::test]
async fn design_refuses_what_serve_refuses() {
    let folder = Folder::default();
    for (text, words) in [
        ("languages = [\"xx\"]", ["languages[0]", "--languages"]),
        ("[texts.en]\n\"welcome.laed\" = \"x\"", ["texts.en.welcome.laed", "sentence"]),
        ("[texts.en]\n\"welcome.lead\" = \" \"", ["texts.en.welcome.lead", "a text"]),
        ("[texts.en]\n\"ready.task\" = \"Go\"", ["texts.en.ready.task", "{i}, {n}"]),
    ] {
        let study = folder.file("wrong.toml", format!("slug = \"a\"\n{text}\n"));
        design(&study, &folder.name("out"), &[]).await.refused(2, &words);
    }
}
