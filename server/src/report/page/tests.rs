//! Tests that read the report of a made-up analysis as XML.

use super::testing::{made_up, made_up_but};
use crate::report::charts;
use crate::report::{Content, each_file};
use roxmltree::{Document, ParsingOptions};
use sidestep::comparison::Analysis;
use sidestep::comparison::FewTasks;
use sidestep::comparison::Request;
use sidestep::comparison::cell::Experiment;
use sidestep::comparison::findings::{Answer, Verdict};
use sidestep::comparison::importance::Importance;
use sidestep::comparison::models::ModelName;
use sidestep::safety::{LevelQuality, SafetyQuality};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

fn html(analysis: &Analysis) -> String {
    super::html(analysis, &charts::all(analysis)).unwrap()
}

fn latex(analysis: &Analysis) -> String {
    super::latex(analysis).unwrap()
}

fn read(html: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(html, options).unwrap()
}

/// All visible text, in one line.
fn words(document: &Document<'_>) -> String {
    let texts = document.descendants().filter(|node| node.is_text());
    let texts = texts.filter(|node| !node.parent().is_some_and(|of| of.has_tag_name("style")));
    let all: String = texts.filter_map(|node| node.text()).collect();
    all.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn with_class(document: &Document<'_>, class: &str) -> usize {
    let is = |node: &roxmltree::Node<'_, '_>| {
        node.attribute("class").is_some_and(|all| all.split(' ').any(|one| one == class))
    };
    document.descendants().filter(is).count()
}

/// The report also parses as XML, so every element is closed and every attribute quoted.
#[test]
fn it_stands_alone_and_names_cannot_break_it() {
    let html = html(&made_up(7, None));
    let document = read(&html);
    let named =
        |name: &str| document.descendants().filter(|node| node.tag_name().name() == name).count();
    assert_eq!(["script", "img", "link", "iframe"].map(named), [0; 4]);
    // URLs are only names of XML vocabularies. Nothing is fetched.
    for node in document.descendants() {
        for attribute in node.attributes() {
            assert!(
                !["src", "href", "style"].contains(&attribute.name())
                    || attribute.value().starts_with("--"),
                "{attribute:?}"
            );
        }
    }
    assert!(!html.contains("url(") && !html.contains("@import"));
    assert!(html.contains("--accent:"));
}

#[test]
fn charts_and_tables_can_be_heard() {
    let html = html(&made_up(7, None));
    let document = read(&html);
    let mut charts = 0;
    for svg in document.descendants().filter(|node| node.tag_name().name() == "svg") {
        if svg.attribute("aria-hidden") == Some("true") {
            continue;
        }
        charts += 1;
        assert_eq!(svg.attribute("role"), Some("img"));
        let has = |name: &str| svg.children().any(|node| node.tag_name().name() == name);
        assert!(has("title") && has("desc"));
    }
    // Three charts of gains, six of accuracy, six of distances, one map, three of roll-outs and two
    // of calibration.
    assert_eq!(charts, 21);
    let mut heads = document.descendants().filter(|node| node.tag_name().name() == "th");
    assert!(heads.all(|head| head.attribute("scope").is_some()));
    for name in ["table", "figure"] {
        let caption = if name == "table" { "caption" } else { "figcaption" };
        for node in document.descendants().filter(|node| node.tag_name().name() == name) {
            assert!(node.children().any(|child| child.tag_name().name() == caption));
        }
    }
}

/// There are 7 people. On hrd, models miss one of ten steps for 4 of them and two steps for the others.
#[test]
fn it_tells_the_numbers_of_the_tables() {
    let analysis = made_up(7, None);
    let html = html(&analysis);
    // The accuracy on hrd is 90 % or 80 %, and on d 80 % or 70 %.
    let [hrd, d] = [4.0 * 90.0 + 3.0 * 80.0, 4.0 * 80.0 + 3.0 * 70.0].map(|sum: f64| sum / 7.0);
    assert_eq!(format!("{hrd:.2} {d:.2}"), "85.71 75.71");
    let row = |first: &str| {
        let document = read(&html);
        let is = |node: &roxmltree::Node<'_, '_>| {
            let head = node.first_element_child();
            node.tag_name().name() == "tr" && head.is_some_and(|head| head.text() == Some(first))
        };
        let row = document.descendants().find(is).unwrap();
        let entry = |td: roxmltree::Node<'_, '_>| {
            let bold = td.children().any(|child| child.tag_name().name() == "strong");
            let text: String =
                td.descendants().filter(|n| n.is_text()).filter_map(|n| n.text()).collect();
            (text, bold)
        };
        let cells = row.children().filter(|n| n.tag_name().name() == "td");
        cells.map(entry).collect::<Vec<_>>()
    };
    let found = row("SVM (I)");
    assert_eq!(found[0], ("85.71".to_owned(), true));
    assert_eq!(found[6], ("75.71".to_owned(), false));
    assert_eq!(found[9], ("60.00".to_owned(), false));
    // All tied sets count as the best, except for sets that the paper did not compare.
    assert!(found[..6].iter().all(|(_, bold)| *bold) && !found[7].1);
    // The paper's accuracy follows.
    assert!(html.contains("<span class=\"paper\"><strong>78.67</strong></span>"));
    // Trials without any turn do not count. All 14 trials of the 7 people have a turn.
    assert!(words(&read(&html)).contains("mean over 14 test trials"));
    let lines = html.replace('\n', "");
    assert!(lines.contains("<td>70.25</td><td>91.50</td><td>+21.25</td>"));
    assert!((analysis.baseline_accuracy(Experiment::TurnDirection) - 60.0).abs() < 1e-9);
}

/// 7 people gain ten points each, so p = 2/2⁷ = 0.0156, and 0.75 after Holm over 48 tests.
#[test]
fn words_follow_the_numbers() {
    let said = |people| words(&read(&html(&made_up(people, None)))).replace('\u{202f}', "");
    let seven = said(7);
    assert!(seven.contains("10.0 points more of the steps than"), "{seven}");
    assert!(seven.contains("better for 7 of 7 people"));
    assert!(seven.contains("typical gain +10.0, with a 95 % interval of +10.0 to +10.0;"));
    assert!(
        seven.contains("of these vehicles: the human 2 m/s and ±0.5 rad/s, the robot 2 m/s and")
    );
    assert!(seven.contains("p = 0.016, after Holm over 48 tests 0.750"));
    assert!(seven.contains("look better than distance alone in 6 of 6 comparisons, but not after"));
    assert!(seven.contains(
        "no difference could be shown. Fewer than 11 people can show nothing after this correction. 11 are not enough"
    ));
    let four = said(4);
    assert!(four.contains("Too few people to show whether safety levels predict better"));
    assert!(four.contains("With 4 people the paired test cannot reach p < 0.05 at all"));
    assert!(!four.contains("with a 95 % interval"));
    assert!(!four.contains("Holm 1.000") && !four.contains("of 4 people"), "{four}");
    assert!(four.contains("Too few people to show whether the safety levels add anything"));
    assert!(four.contains("no p-value.") && !seven.contains("no p-value."));
    let many = said(12);
    assert!(many.contains(
        "Safety levels predict better than distance alone, in every model and experiment."
    ));
    assert!(!many.contains("no difference could be shown"));
    // Both sets give the same results for every person, so there is nothing to test.
    let same =
        "Too few people to show whether the human’s or the robot’s safety level predicts better.";
    assert!(many.contains(same), "{many}");
}

#[test]
fn a_level_that_says_nothing_has_a_warning() {
    let sound =
        LevelQuality { converged: true, last_change_m: None, spread_m: 2.0, accuracy_m: 0.02 };
    let said = |v_hr: LevelQuality, v_rh: LevelQuality| {
        let quality = SafetyQuality { v_hr, v_rh };
        let mut analysis = made_up(6, None);
        analysis.data.safety = Some(quality);
        html(&analysis)
    };
    // Only the warnings depend on the quality of the levels.
    assert_eq!(said(sound, sound), html(&made_up(6, None)));
    let restless =
        LevelQuality { converged: false, last_change_m: Some(1.3e-3), spread_m: 0.1, ..sound };
    let flat = LevelQuality { spread_m: 0.004, ..sound };

    let robot = said(sound, restless);
    let document = read(&robot);
    assert_eq!(with_class(&document, "banner"), 1);
    let text = words(&document);
    for part in ["VRH did not converge", "1.3 mm in the last 16 sweeps", "0.10 m"] {
        assert!(text.contains(part), "{part}");
    }
    let named = |text: &str| {
        let (_, sets) = text.split_once("These sets contain the level: ").unwrap();
        sets.split_once('.').unwrap().0.to_owned()
    };
    assert!(named(&text).starts_with("Bhrd, Bhr, Brd, Br"), "{text}");
    assert!(!text.contains("VHR did not") && !text.contains("nearly the same in all steps"));

    let human = said(flat, sound);
    let text = words(&read(&human));
    assert!(text.contains("VHR is nearly the same in all steps"), "{text}");
    assert!(named(&text).starts_with("Bhrd, Bhr, Bhd, Bh"), "{text}");
    assert_eq!(with_class(&read(&said(flat, restless)), "banner"), 2);
}

#[test]
fn synthetic_data_and_those_left_out_are_named() {
    let people = html(&made_up(6, None));
    let computed = html(&made_up(6, Some("seed <7>")));
    let banner = |html: &str| with_class(&read(html), "banner");
    assert_eq!([banner(&people), banner(&computed)], [0, 1]);
    assert!(computed.contains("seed &lt;7&gt;"));
    let mut mixed = made_up(6, Some("2 of 6"));
    mixed.data.is_mixed = true;
    let mixed = words(&read(&html(&mixed)));
    assert!(
        !mixed.contains("nothing here is about people.")
            && !mixed.contains("A program drove the trials")
    );
    assert!(mixed.contains("A program drove some of the trials (2 of 6)"));
    assert!(mixed.contains("Anything about people: some of the data are synthetic."));
    let said = words(&read(&people));
    assert!(said.contains("1 person was excluded:"));
    assert!(said.contains("<img src=x onerror=alert(2)> & \"co\": 3 tasks, at least 5 are needed"));
    let mut nobody = made_up(6, None);
    nobody.data.exclusions.clear();
    nobody.data.flagged.insert("replay_mismatch".to_owned(), 3);
    nobody.leakage.clear();
    let nobody = words(&read(&html(&nobody)));
    assert!(nobody.contains("some are flagged: 3 replay_mismatch."));
    assert!(!said.contains("are flagged"));
    assert!(nobody.contains("Nobody was excluded.") && !nobody.contains("Leakage"));
}

/// With the body frame, all models are as good as with safety levels. Only SVM I is better with
/// both, by one step of each trial.
#[test]
fn what_safety_levels_add_to_the_body_frame_is_an_answer_of_its_own() {
    let analysis = made_up_but(7, None, |results| {
        for cell in &mut results.comparison.cells {
            let is_svm =
                (cell.model, cell.experiment) == (ModelName::Svm, Experiment::TurnDirection);
            if is_svm && cell.features == "hrd_body" {
                cell.test.predicted.clone_from(&cell.test.truth);
            }
        }
    });
    let of = |answer: &Option<Answer>| answer.as_ref().unwrap().verdict;
    let findings = &analysis.findings;
    assert_eq!(of(&findings.body_frame_too), Verdict::Hint);
    // All differences are zero.
    assert_eq!(of(&findings.body_frame_instead), Verdict::TooFew);
    let text = words(&read(&html(&analysis)));
    let told = "Once the body frame is known, predictions with the safety levels look better in 1 \
                of 6 comparisons than without";
    assert!(text.contains(told), "{text}");
    // The p-value is 2/2⁷, which Holm's correction multiplies by 6.
    assert!(text.contains("SVM I+14.3p = 0.016, r +1.00Holm 0.094"), "{text}");
}

#[test]
fn fewer_tasks_other_people_and_fewer_features_are_shown() {
    let none = words(&read(&html(&made_up(6, None))));
    assert!(!none.contains("Fewer tasks, other people") && !none.contains("What people did"));
    let analysis = made_up_but(6, None, |results| {
        let cells = || results.comparison.cells.clone().into_iter();
        let few = cells().filter(|cell| cell.model == ModelName::Lr);
        let few = few.map(|cell| FewTasks { tasks: 5, cell }).collect();
        let unseen = cells().filter(|cell| cell.model == ModelName::Dt).collect();
        results.importance = vec![Importance {
            model: ModelName::Svm,
            experiment: Experiment::Avoidance,
            features: "hrd".to_owned(),
            permuted: "v_h".to_owned(),
            losses: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            mean: 3.5,
        }];
        (results.few_tasks, results.unseen) = (few, unseen);
    });
    let page = html(&analysis);
    let document = read(&page);
    let text = words(&document);
    // Models trained on others are as good as the person's own model, so there is no gain.
    let row = "DT IBhrd85.00 81.2585.000.00 1.0001.000 0.00";
    for told in [row, "What more tasks are worth.", "Mean loss in points. v_h: 3.5."] {
        assert!(text.contains(told), "{told}: {text}");
    }
    let figures = crate::report::charts::all(&analysis);
    let names: Vec<&str> = figures.iter().map(|figure| figure.name).collect();
    assert_eq!(names[3..6], ["learning", "unseen", "importance"], "{names:?}");
    for figure in figures {
        let svg = figure.svg();
        let document = Document::parse(&svg).unwrap();
        let size = document.root_element().attribute("height").unwrap();
        assert!(size.parse::<f64>().unwrap() > 200.0, "{}: {size}", figure.name);
        assert!(!svg.contains("var(--"), "{}: a file has no style sheet", figure.name);
    }
}

#[test]
fn what_was_asked_for_is_told() {
    let protocol = words(&read(&html(&made_up(6, None))));
    assert!(protocol.contains("linear SVM: C 0.01, 0.1, 1 and 10; decision"), "{protocol}");
    assert!(protocol.contains("These are the protocol’s.") && !protocol.contains("were added"));
    assert!(protocol.contains("importance.csv, leakage.csv and predictions.csv"));
    let mut analysis = made_up(6, None);
    let asked = r#"{"sets": {"mine": ["v_h", "distance"]},
                    "grids": {"linear_c": [2], "tree_depth": [3, null]}}"#;
    analysis.settings = serde_json::from_str::<Request>(asked).unwrap().settings().unwrap();
    analysis.leakage.clear();
    let said = words(&read(&html(&analysis)));
    assert!(said.contains("linear SVM: C 2 (the protocol: 0.01, 0.1, 1 and 10); decision"));
    assert!(said.contains("depth 3 and any (the protocol: 2, 3, 4, 6, 8 and any), at least 1, 5"));
    assert!(said.contains("Not all are the protocol’s"));
    assert!(said.contains("mine: v_h and distance") && !said.contains("leakage.csv"));
    let files = |analysis: &Analysis| {
        let mut names = Vec::new();
        let mut put = |name: &str, _: Content<'_>| {
            names.push(name.to_owned());
            Ok(())
        };
        each_file(analysis, &mut put).unwrap();
        names.iter().any(|name| name == "leakage.csv")
    };
    assert_eq!([files(&analysis), files(&made_up(6, None))], [false, true]);
}

/// All results in the text and charts of the report are also in tables.
#[test]
fn intervals_and_families_are_in_files() {
    let rows = |people: usize, wanted: &str| -> Vec<BTreeMap<String, String>> {
        let mut text = Vec::new();
        let mut put = |name: &str, content: Content<'_>| match name == wanted {
            true => content(&mut text),
            false => Ok(()),
        };
        each_file(&made_up(people, None), &mut put).unwrap();
        csv::Reader::from_reader(&text[..]).deserialize().map(Result::unwrap).collect()
    };
    for (file, count) in [("tests.csv", 48 + 2 * 24), ("beside.csv", 18)] {
        let found = rows(7, file);
        assert_eq!(found.len(), count, "{file}");
        for row in found {
            let number = |column: &str| row[column].parse::<f64>().unwrap();
            // If both sets give the same results for every person, there is no interval.
            if row["differing"] == "0" {
                assert_eq!((&*row["gain_low"], number("wilcoxon_persons")), ("", 1.0), "{row:?}");
                continue;
            }
            let interval = number("gain_low")..=number("gain_high");
            assert!(interval.contains(&number("typical_gain")), "{row:?}");
            // The interval contains the values that the test does not reject.
            assert_eq!(number("wilcoxon_persons") < 0.05, !interval.contains(&0.0), "{row:?}");
        }
        assert!(rows(5, file).iter().all(|row| row["gain_low"].is_empty()));
    }
    // All 7 people have the same gain in accuracy and in distance.
    let of = |metric: &str| {
        let mut all = rows(7, "tests.csv").into_iter();
        all.find(|row| row["metric"] == metric && row["second"] == "d").unwrap()
    };
    assert_eq!(of("accuracy")["gain_low"], "10.0000");
    assert_eq!(of("D_end")["gain_high"], of("D_end")["typical_gain"]);
    let beside = rows(7, "beside.csv");
    let pairs: BTreeSet<_> =
        beside.iter().map(|row| (&row["first"][..], &row["second"][..])).collect();
    assert_eq!(pairs, [("d_body", "hrd"), ("hrd", "none"), ("hrd_body", "d_body")].into());
}

#[test]
fn a_grid_that_ends_too_early_is_told() {
    let said = |analysis: &Analysis| words(&read(&html(analysis)));
    assert!(!said(&made_up(6, None)).contains("The greatest C"));
    let analysis = made_up_but(6, None, |results| {
        let cells = results.comparison.cells.iter_mut();
        for (i, cell) in cells.filter(|c| c.model == ModelName::SvmLinear).enumerate() {
            let chosen = if i % 2 == 0 { "{\"C\":10.0}" } else { "{\"C\":1.0}" };
            cell.hyperparameters = chosen.to_owned();
        }
    });
    let told = "The greatest C was often the best: C = 10 for 54 of 108 linear SVMs.";
    assert!(said(&analysis).contains(told), "{}", said(&analysis));
}

/// There are five names of models, two experiments and nine sets. The name SVM stands for the
/// better of two other models, so it is not counted.
#[test]
fn models_are_counted_once() {
    let html = html(&made_up(6, None));
    let trained = 6 * 2 * 9 * (ModelName::ALL.len() - 1);
    assert!(html.contains(&format!("<b>{trained} models</b>")), "{trained}");
}

#[test]
fn the_same_results_give_the_same_bytes() {
    for people in [1, 2, 40] {
        let (one, other) = (made_up(people, None), made_up(people, None));
        assert_eq!(html(&one), html(&other));
        assert_eq!(latex(&one), latex(&other));
        read(&html(&one));
    }
}

#[test]
fn latex_has_the_best_in_bold_and_says_who() {
    let tables = latex(&made_up(7, Some("50% & more")));
    assert!(tables.contains("SVM (I) & \\textbf{85.71} & "));
    assert!(tables.contains(" & 75.71 \\\\"));
    assert!(tables.contains("7 participants"));
    assert!(tables.contains("Synthetic data} (50\\% \\& more)"));
    assert!(tables.contains("(3 tasks, at least 5 are needed)"));
    assert!(!latex(&made_up(7, None)).contains("Synthetic"));
    let count = |what: &str| tables.matches(what).count();
    assert_eq!(count("\\begin{tabular}"), 2);
    assert_eq!(count("{"), count("}"));
}

/// For 35 of 40 people, accuracy rises by ten points. For the others, every prediction of DT II on hrd
/// is wrong.
#[test]
fn a_mean_that_points_the_other_way_is_told() {
    let analysis = made_up_but(40, None, |results| {
        for cell in &mut results.comparison.cells {
            let is_dt = (cell.model, cell.experiment) == (ModelName::Dt, Experiment::Avoidance);
            if is_dt && cell.features == "hrd" && cell.participant < 5 {
                cell.test.predicted.iter_mut().for_each(|class| *class = 9);
            }
        }
    });
    let told = "the mean points the other way than the test";
    let text = words(&read(&html(&analysis)));
    assert!(text.contains(&format!("In DT II {told}")), "{text}");
    assert!(!words(&read(&html(&made_up(40, None)))).contains(told));
}

/// The library computes all statistics. The code that prints them must not test, pool or average.
#[test]
fn printing_computes_no_statistics() {
    const FORBIDDEN: [&str; 9] = [
        "stats::",
        "wilcoxon(",
        "mann_whitney(",
        "hodges_lehmann(",
        "holm(",
        "Paired::of",
        "Predictions::",
        "Distances::of",
        ".calibration()",
    ];
    fn files(folder: &Path) -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/report");
    let printing = files(&folder).into_iter().filter(|path| {
        let name = path.file_name().unwrap().to_str().unwrap();
        name.ends_with(".rs")
            && !["tests.rs", "testing.rs", "sentence_tests.rs", "told.rs", "headlines.rs"]
                .contains(&name)
    });
    let mut seen = Vec::new();
    for path in printing {
        let text = fs::read_to_string(&path).unwrap();
        for word in FORBIDDEN {
            assert!(!text.contains(word), "{} has {word}", path.display());
        }
        seen.push(path.file_name().unwrap().to_owned());
    }
    seen.sort();
    let expected = [
        "charts.rs",
        "decisions.rs",
        "further.rs",
        "generalisation.rs",
        "page.rs",
        "people.rs",
        "rollouts.rs",
        "tables_csv.rs",
        "text.rs",
    ];
    assert_eq!(seen, expected);
}
