//! Tests of the predictors in a replay: baselines, files, models of other studies, and two
//! predictors side by side.

use super::analyses::{analysis, list};
use super::explorer::usual;
use super::predictors::{model, page, right, trained};
use super::*;
use sidestep::api::{AnalysisState, Drive, LearnedSets, TrialUse};
use sidestep::picture::Picture;
use sidestep::shfrs::baselines::EmpiricalFamily;
use sidestep::shfrs::probability::probabilities;
use sidestep::shfrs::window::Trajectory;
use sidestep::trial_view::source::fitted;

const FILE: &str = r#"{"format":"sidestep-predictor/1","kind":"constant","features":["distance"],
    "classes":[-1,0,1],"probabilities":[0.25,0.5,0.25]}"#;

/// Opens a replay and loads its value function and the default predictor.
fn predicted() -> Session {
    let mut session = replay_of_equals();
    session.send("predictor", 200, &trained(0.9, None));
    session
}

#[test]
fn baselines_need_no_server_and_are_in_the_link() {
    let mut session = predicted();
    let asked = session.urls().len();
    for (way, said) in [
        ("constant", "33 %"),
        ("constant-velocity", "0 %"),
        ("hold-the-input", "0 %"),
        ("worst-case", "33 %"),
    ] {
        session.choose("choose-predictor", way);
        assert_eq!(right(&session).as_deref(), Some(said), "{way}");
        assert_eq!(session.link(), format!("/lab/replay/t?predictor={way}"));
        assert_eq!(session.urls().len(), asked, "{way}");
    }
    // Every trajectory stays inside the worst case, which is a single set that contains every
    // reachable state.
    let words = session.words("regions").unwrap();
    assert!(words.contains("F 1 1.00 5.33") && !words.contains("F 2"), "{words}");
    session.choose("choose-predictor", "");
    assert_eq!(session.link(), "/lab/replay/t");
    assert!(session.words("prediction").is_none(), "it is on its way");
}

#[test]
fn a_baseline_that_is_chosen_meanwhile_stays() {
    let mut session = replay_of_equals();
    session.choose("choose-predictor", "constant");
    assert!(session.asked.iter().all(|request| request.name != "predictor"));
    assert_eq!(right(&session).as_deref(), Some("33 %"));
}

#[test]
fn models_with_history_are_trained_by_the_server() {
    let mut session = signed_in("/lab/replay/t?predictor=history");
    session.send("trial", 200, &trial(unequal(), [None, None]));
    let asked = format!("{}?features=hrd_body_history", routes::admin_predictor("t"));
    assert!(session.urls().contains(&asked.as_str()), "{:?}", session.urls());
    session.send("predictor", 200, &trained(0.4, None));
    assert!(session.words("predictor").unwrap().contains("turns so far. Trained on the 7 trials"));
}

#[test]
fn a_file_predicts_and_is_in_no_link() {
    let mut session = predicted();
    session.choose("choose-predictor", "constant");
    session.choose("predictor-file", FILE);
    assert_eq!(right(&session).as_deref(), Some("25 %"));
    assert_eq!(session.link(), "/lab/replay/t");
    let words = session.words("predictor").unwrap();
    assert!(
        words.contains("On 1 feature, from a file") && words.contains("cannot hold"),
        "{words}"
    );
    assert!(session.words("choose-predictor").unwrap().contains("Opened here"));
    for (content, sentence) in [
        ("".to_owned(), "It is not JSON: expected a predictor.json"),
        ("{\"format\":1".to_owned(), "It is not JSON"),
        ("[".repeat(100_000), "It is nested too deep"),
        (format!("{}{}", "[".repeat(3000), "]".repeat(3000)), "It is nested too deep"),
        ("{}".to_owned(), "format"),
        (FILE.replace("distance", "colour"), "features[0]: expected one of abs_dx"),
        (FILE.replace("[-1,0,1]", "[0,1,2]"), "classes: expected some of -1 (right)"),
        (FILE.replace("0.5", "0.6"), "probabilities: expected numbers from 0 to 1 that sum to 1"),
        (FILE.replace("\"kind\"", "\"experiment\":2,\"kind\""), "a model of the turn direction"),
    ] {
        session.choose("predictor-file", &content);
        let said = session.words("unusable").unwrap();
        assert!(said.starts_with("This file cannot be used.") && said.contains(sentence), "{said}");
        assert_eq!(right(&session).as_deref(), Some("25 %"), "what was there stays");
    }
    session.choose("choose-predictor", "constant");
    assert!(session.words("unusable").is_none());
}

#[test]
fn a_link_to_another_way_says_which_ways_there_are() {
    for query in ["predictor=best", "beside=best"] {
        let mut session = signed_in(&format!("/lab/replay/t?{query}&t=2"));
        session.send("trial", 200, &trial(unequal(), [None, None]));
        let said = session.words("misread").unwrap();
        assert!(
            said.contains("expected earlier, history,") && said.contains("found best"),
            "{said}"
        );
    }
}

/// The second picture, if there is one.
fn beside(session: &Session) -> Option<Picture> {
    let mut picture = Picture::default();
    session.page.draw_beside(0.0, &mut picture).then_some(picture)
}

#[test]
fn two_predictors_side_by_side_have_one_clock_and_one_link() {
    let mut session = predicted();
    assert_eq!(beside(&session), None);
    session.key("KeyB");
    assert_eq!(session.link(), "/lab/replay/t?beside=constant-velocity");
    session.slide("slider", 2.4);
    let shown = beside(&session).unwrap();
    assert_eq!(shown.canvas, "replay-beside");
    let step = shown.attributes.iter().find(|(name, _)| *name == "data-step");
    assert_eq!(step.map(|(_, value)| value.as_str()), Some("12"));
    // The second picture has the same layers, but different sets.
    let first = session.picture().unwrap();
    assert_eq!(first.shapes().len(), shown.shapes().len());
    let numbers = session.words("numbers-beside").unwrap();
    assert!(!numbers.contains(&session.words("regions").unwrap()), "{numbers}");
    let numbers = numbers.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(numbers.contains("straight 100 %"), "{numbers}");
    assert_eq!(right(&session).as_deref(), Some("90 %"), "the first one is as it was");

    // Each pane has its own predictor.
    session.choose("choose-predictor-beside", "a1/models/dt-1-hrd-1.json");
    let asked = "?analysis=a1&file=models%2Fdt-1-hrd-1.json";
    let asked = format!("{}{asked}", routes::admin_predictor("t"));
    assert_eq!(session.urls().last(), Some(&asked.as_str()));
    session.send(
        "predictor-beside",
        200,
        &trained(0.3, Some((model("dt", 1, 1), TrialUse::Trained))),
    );
    assert!(session.words("trained-on-this-beside").is_some());
    assert!(session.words("trained-on-this").is_none());
    session.choose("choose-predictor", "worst-case");
    session.choose("predictor-file-beside", FILE);
    assert!(session.words("predictor-beside").unwrap().contains("from a file"));
    let both = "/lab/replay/t?predictor=worst-case&beside=constant";
    session.choose("choose-predictor-beside", "constant");
    assert_eq!(session.link(), format!("{both}&t=2.4"));

    // Both pictures are saved together as one picture.
    session.press("save-svg");
    session.press("save-png");
    for (_, content) in &session.files {
        let svg = String::from_utf8(content.clone()).unwrap();
        for expected in ["Worst case", "Constant: 1/3 each", "t = 2.4 s"] {
            assert!(svg.contains(expected), "{expected}");
        }
    }
    // The link to the next trial opens it in the same view.
    let view = session.page.view();
    let next = view.find("next-trial").unwrap().attribute("href").unwrap();
    assert_eq!(next, "/lab/replay/after?predictor=worst-case&beside=constant");
    session.press("beside");
    assert_eq!(beside(&session), None);
    assert_eq!(session.link(), "/lab/replay/t?predictor=worst-case&t=2.4");
}

#[test]
fn a_second_predictor_that_is_gone_leaves_the_first_one_alone() {
    let mut session = signed_in("/lab/replay/t?predictor=constant&beside=a0/gone.json");
    let parameters = SceneParameters::default();
    let function = ValueFunction::Exact(parameters.game(Evader::Human).exact().unwrap());
    let id = Some(function.id());
    session.send("trial", 200, &trial(parameters, [id.clone(), id]));
    let problem = br#"{"code":"not_found","message":"there is no such model: x"}"#;
    session.answer("predictor-beside", 404, problem);
    session.answer(of(Evader::Human), 200, &function.encode());
    let said = session.words("refused-beside").unwrap();
    assert!(said.contains("No predicted sets.") && said.contains("no such model"), "{said}");
    assert!(session.words("refused").is_none());
    assert_eq!(right(&session).as_deref(), Some("33 %"));
    assert!(beside(&session).is_some(), "the trial is there all the same");
}

#[test]
fn models_of_other_people_and_studies_are_found_by_words() {
    let mut session = predicted();
    session.press("find-models");
    session.send("finder-studies", 200, &Vec::<sidestep::api::StudySummary>::new());
    let analyses = [("a2", AnalysisState::Queued), ("a1", AnalysisState::Done)];
    let analyses = list(analyses.map(|(id, state)| analysis(id, state)).into());
    session.send("finder-analyses", 200, &analyses);
    let asked = "/api/v1/admin/analyses/a1/predictors?experiment=1&limit=500";
    assert_eq!(session.urls().last(), Some(&asked));
    let models = vec![model("dt", 1, 1), model("lr", 1, 1), model("lr", 1, 2)];
    session.send("finder-models", 200, &page(models, 3));
    assert!(session.words("finder-count").unwrap().contains("3 models."));
    session.choose("finder-search", "participant 2 LOGISTIC");
    assert!(session.words("finder-count").unwrap().contains("1 model."));
    session.press("found-model");
    assert_eq!(session.link(), "/lab/replay/t?analysis=a1&file=models%2Flr-1-hrd-2.json");
    // Choose another participant, then another study.
    session.choose("finder-participant", "2");
    assert_eq!(session.urls().last(), Some(&format!("{asked}&participant=2").as_str()));
    session.unreachable("finder-models");
    assert!(session.words("finder-trouble").unwrap().contains("Models cannot be listed."));
    session.choose("finder-study", "other");
    assert_eq!(session.urls().last(), Some(&routes::admin_analyses("other").as_str()));
    session.send("finder-analyses", 200, &list(Vec::new()));
    assert!(session.words("finder-empty").unwrap().contains("No analysis of this study is done."));
    session.press("finder-close");
    assert!(session.words("finder").is_none());
}

/// Sets learned from six tasks, as the server sends them, with the server's counts over the other
/// tasks.
fn learned_sets(family: EmpiricalFamily) -> LearnedSets {
    let drives = usual();
    let task = |drive: &Drive| drive.trajectory(&drives.parameters).unwrap();
    let tasks: Vec<Trajectory> = drives.tasks.iter().map(task).collect();
    let (earlier, others) = tasks.split_at(6);
    let fitted = fitted(family, &drives.parameters, earlier).unwrap();
    let held = fitted.smallest_holding(others).unwrap();
    let held = Some(probabilities(&held, 5, 0.95).unwrap());
    LearnedSets { sets: fitted.sets, trials: 6, held }
}

/// Sets learned from recorded futures have levels instead of ε, and no probabilities of inputs. How
/// often they contain the future is counted over the tasks that did not train them.
#[test]
fn learned_sets_say_their_levels_and_no_inputs() {
    for (family, level) in [
        (EmpiricalFamily::Empirical, "share of futures"),
        (EmpiricalFamily::Gaussian, "Mahalanobis radius"),
    ] {
        let LearnedSets { mut sets, held, .. } = learned_sets(family);
        let way = family.name();
        let mut session = predicted();
        session.press("beside");
        session.choose("choose-predictor-beside", way);
        let asked = format!("/api/v1/admin/trials/t/sets?family={way}");
        assert_eq!(session.urls().last(), Some(&asked.as_str()));
        session.send("predictor-beside", 200, &learned_sets(family));
        assert_eq!(session.link(), format!("/lab/replay/t?beside={way}"));
        let said = session.words("predictor-beside").unwrap();
        assert!(said.contains("Trained on the 6 trials before."), "{said}");
        session.send("drives", 200, &usual());
        session.slide("slider", 2.4);

        let numbers = session.words("numbers-beside").unwrap();
        let numbers = numbers.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(!numbers.contains("Next input") && !numbers.contains('ε'), "{numbers}");
        for p in &held.unwrap().inside {
            assert!(numbers.contains(&format!("{:.3}", p.value)), "{numbers}: {p:?}");
        }
        assert!(numbers.contains("246 windows of 6 tasks"), "{numbers}");
        let legend = session.words("legend").unwrap();
        assert!(legend.contains("ε = 0.15 rad/s"), "{legend}");
        let state = trial(SceneParameters::default(), [None, None]).states[12];
        sets.place(state.human, TurnInput::Straight);
        for (j, set) in (1..).zip(sets.sets()) {
            let words = format!("{level} {:.2}", set.level);
            assert!(legend.contains(&words), "{legend}: {words}");
            let row = format!("F {j} {:.2} {:.2}", set.level, set.area_m2);
            assert!(numbers.contains(&row), "{numbers}: {row}");
        }
        // At the human's position, the picture shows every corner of every set.
        let shown = beside(&session).unwrap();
        let painted = |piece: &[[f64; 2]]| {
            shown.shapes().iter().any(|shape| match shape {
                Shape::Path { points, closed: true, .. } => shown.points(points) == piece,
                _ => false,
            })
        };
        for piece in sets.sets().iter().flat_map(|set| &set.tube).filter(|it| !it.is_empty()) {
            assert!(painted(piece), "{way}");
        }
        // The strip shows the probabilities of the first pane. That pane now has none, so the strip
        // has none either.
        session.choose("choose-predictor", way);
        session.send("predictor", 200, &learned_sets(family));
        session.press("numbers-switch");
        assert!(!session.text().contains("predicted left"));
        assert_eq!(session.words("prediction"), None);
        let legend = session.words("legend").unwrap();
        assert!(!legend.contains("rad/s") && !legend.contains("beside"), "{legend}");
    }
}

#[test]
fn sets_that_cannot_be_learned_are_refused_in_a_sentence() {
    let mut session = predicted();
    session.choose("choose-predictor", "empirical");
    assert!(session.words("predictor").unwrap().contains("Loading"));
    let problem = br#"{"code":"invalid","message":"earlier trials: expected at least one","field":"earlier trials"}"#;
    session.answer("predictor", 422, problem);
    let said = session.words("refused").unwrap();
    assert!(said.starts_with("No predicted sets. ") && said.contains("at least one"), "{said}");
    assert!(session.words("regions").is_none());
    session.choose("choose-predictor", "gaussian");
    session.answer("predictor", 404, br#"{"code":"not_found","message":"there is no such trial"}"#);
    assert!(session.words("refused").unwrap().contains("no such trial"));
    session.choose("choose-predictor", "constant");
    assert_eq!(right(&session).as_deref(), Some("33 %"));
}

/// Learned sets need no safety levels, so they appear before the safety levels are solved.
#[test]
fn learned_sets_do_not_wait_for_safety_levels() {
    let mut session = signed_in("/lab/replay/t?predictor=empirical");
    session.send("trial", 200, &trial(unequal(), [None, None]));
    session.send("predictor", 200, &learned_sets(EmpiricalFamily::Empirical));
    let words = session.words("regions").unwrap();
    assert!(words.contains("F 5 1.00 5.33"), "{words}");
}
