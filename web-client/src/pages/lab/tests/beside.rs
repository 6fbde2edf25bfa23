//! What predicts in a replay: baselines, files, models of other studies, and two of them side by side.

use super::analyses::{analysis, list};
use super::predictors::{model, page, right, trained};
use super::*;
use sidestep::api::{AnalysisState, TrialUse};
use sidestep::picture::Picture;

const FILE: &str = r#"{"format":"sidestep-predictor/1","kind":"constant","features":["distance"],
    "classes":[-1,0,1],"probabilities":[0.25,0.5,0.25]}"#;

/// A replay with its value function and the usual predictor.
fn predicted() -> Session {
    let mut session = replay_of_equals();
    session.send("predictor", 200, &trained(0.9, None));
    session
}

fn link(session: &Session) -> &str {
    session.visited.last().map_or("", String::as_str)
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
        assert_eq!(link(&session), format!("/lab/replay/t?predictor={way}"));
        assert_eq!(session.urls().len(), asked, "{way}");
    }
    // Nobody leaves the worst case: one set, with everything that can be reached.
    let words = session.words("regions").unwrap();
    assert!(words.contains("F 1 0.00 5.33") && !words.contains("F 2"), "{words}");
    session.choose("choose-predictor", "");
    assert_eq!(link(&session), "/lab/replay/t");
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
    assert_eq!(link(&session), "/lab/replay/t");
    let words = session.words("predictor").unwrap();
    assert!(
        words.contains("On 1 feature, from a file") && words.contains("cannot hold"),
        "{words}"
    );
    assert!(session.words("choose-predictor").unwrap().contains("Opened here"));
    for (content, sentence) in [
        ("".to_owned(), "It is not JSON: expected a predictor.json"),
        ("{\"format\":1".to_owned(), "It is not JSON"),
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
    assert_eq!(link(&session), "/lab/replay/t?beside=constant-velocity");
    session.slide("slider", 2.4);
    let shown = beside(&session).unwrap();
    assert_eq!(shown.canvas, "replay-beside");
    let step = shown.attributes.iter().find(|(name, _)| *name == "data-step");
    assert_eq!(step.map(|(_, value)| value.as_str()), Some("12"));
    // The same layers, and other sets.
    let first = session.picture().unwrap();
    assert_eq!(first.shapes().len(), shown.shapes().len());
    let numbers = session.words("numbers-beside").unwrap();
    assert!(!numbers.contains(&session.words("regions").unwrap()), "{numbers}");
    let numbers = numbers.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(numbers.contains("straight 100 %"), "{numbers}");
    assert_eq!(right(&session).as_deref(), Some("90 %"), "the first one is as it was");

    // Each has its own predictor.
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
    assert_eq!(link(&session), format!("{both}&t=2.4"));

    // Both are saved, in one picture.
    session.press("save-svg");
    session.press("save-png");
    for (_, content) in &session.files {
        let svg = String::from_utf8(content.clone()).unwrap();
        for expected in ["Worst case", "Constant: 1/3 each", "t = 2.4 s"] {
            assert!(svg.contains(expected), "{expected}");
        }
    }
    // The next trial is seen in the same way.
    let view = session.page.view();
    let next = view.find("next-trial").unwrap().attribute("href").unwrap();
    assert_eq!(next, "/lab/replay/after?predictor=worst-case&beside=constant");
    session.press("beside");
    assert_eq!(beside(&session), None);
    assert_eq!(link(&session), "/lab/replay/t?predictor=worst-case&t=2.4");
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
    assert_eq!(link(&session), "/lab/replay/t?analysis=a1&file=models%2Flr-1-hrd-2.json");
    // Another participant, another study.
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
