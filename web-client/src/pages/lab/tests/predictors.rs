//! Tests of the list of an analysis's models, and of their use in a replay.

use super::analyses::{analysis, detail, list};
use super::*;
use sidestep::api::{
    AnalysisState, PredictorChoices, PredictorPage, PredictorSource, PredictorSummary,
    TrainedPredictor, TrialUse,
};
use sidestep::features::FeatureSet;
use sidestep::predict::Predictor;

pub(super) fn model(kind: &str, experiment: u8, participant: i64) -> PredictorSummary {
    PredictorSummary {
        file: format!("models/{kind}-{experiment}-hrd-{participant}.json"),
        participant,
        model: kind.into(),
        experiment,
        features: "hrd".into(),
        columns: vec!["v_h".into(), "distance".into()],
        cv_accuracy: 0.75,
        test_accuracy: 0.7125,
        newest_task: Some("t9".into()),
    }
}

pub(super) fn page(predictors: Vec<PredictorSummary>, total: u64) -> PredictorPage {
    let choices = PredictorChoices {
        participants: vec![1, 2],
        models: vec!["dt".into(), "lr".into()],
        experiments: vec![1, 2],
        features: vec!["hrd".into()],
    };
    PredictorPage { predictors, total, choices }
}

/// Opens the page of a finished analysis with these models.
fn listed(path: &str, models: &PredictorPage) -> Session {
    let mut session = signed_in(path);
    session.send("analysis", 200, &detail(AnalysisState::Done));
    session.send("predictors", 200, models);
    session
}

#[test]
fn models_are_filtered_and_paged_by_the_server() {
    let models = vec![model("lr", 1, 1), model("lr", 2, 1)];
    let mut session = listed("/lab/analyses/a1", &page(models, 45));
    let words = session.words("predictors").unwrap();
    assert!(words.contains("1 Logistic regression I, direction hrd 75.0 % 71.2 %"), "{words}");
    assert_eq!(words.matches("Use in replay").count(), 1, "experiment II has no direction");
    assert_eq!(words.matches("Download").count(), 2);
    let view = session.page.view();
    let href = |test_id: &str| view.find(test_id).unwrap().attribute("href").unwrap();
    assert_eq!(href("download"), "/api/v1/admin/analyses/a1/files/models/lr-1-hrd-1.json");
    let link = "/lab/replay/t9?analysis=a1&file=models%2Flr-1-hrd-1.json";
    assert_eq!(href("use-in-replay"), link);

    session.press("next");
    let asked = "/api/v1/admin/analyses/a1/predictors?limit=20";
    assert_eq!(session.urls().last().unwrap(), &format!("{asked}&offset=20"));
    assert_eq!(session.visited.last().unwrap(), "/lab/analyses/a1?offset=20");
    // Changing a filter returns to the first page.
    session.choose("only-participant", "2");
    session.choose("only-model", "dt");
    session.choose("only-experiment", "1");
    session.choose("only-features", "hrd");
    let query = "participant=2&model=dt&experiment=1&features=hrd";
    assert_eq!(session.urls().last().unwrap(), &format!("{asked}&{query}"));
    assert_eq!(session.visited.last().unwrap(), &format!("/lab/analyses/a1?{query}"));
    session.send("predictors", 200, &page(Vec::new(), 0));
    assert!(session.words("no-predictors").unwrap().contains("No model matches"));

    // The address alone determines the filters.
    let session = listed(&format!("/lab/analyses/a1?{query}"), &page(vec![model("dt", 1, 2)], 1));
    let view = session.page.view();
    let chosen = |test_id: &str| {
        let node = view.find(test_id).unwrap();
        let options = node.children.iter().filter_map(|child| match child {
            crate::view::Child::Node(node) => Some(node),
            _ => None,
        });
        let mut chosen = options.filter(|it| it.attribute("selected").is_some());
        chosen.next().and_then(|it| it.attribute("value")).unwrap().to_owned()
    };
    let ids = ["only-participant", "only-model", "only-experiment", "only-features"];
    assert_eq!(ids.map(chosen), ["2", "dt", "1", "hrd"]);
}

#[test]
fn an_analysis_without_models_says_what_to_do() {
    let mut session = signed_in("/lab/analyses/a1");
    session.send("analysis", 200, &detail(AnalysisState::Running));
    assert!(session.asked.iter().all(|request| request.name != "predictors"), "it is not done");
    session.changed();
    session.send("analysis", 200, &detail(AnalysisState::Done));
    let nothing = PredictorPage { choices: PredictorChoices::default(), ..page(Vec::new(), 0) };
    session.send("predictors", 200, &nothing);
    assert!(session.words("no-predictors").unwrap().contains("start the analysis again"));
    // If a list cannot be loaded, an error is shown, and the previous list stays.
    let mut session = signed_in("/lab/analyses/a1");
    session.send("analysis", 200, &detail(AnalysisState::Done));
    session.unreachable("predictors");
    assert!(session.words("predictors-trouble").unwrap().contains("cannot be reached"));
    let mut session = listed("/lab/analyses/a1", &page(vec![model("dt", 1, 1)], 1));
    session.choose("only-model", "dt");
    session.unreachable("predictors");
    assert!(session.words("predictors").is_some() && session.words("predictors-trouble").is_some());
    // If a participant withdraws, the models are removed together with the analysis's other
    // results.
    session.changed();
    session.send("analysis", 200, &detail(AnalysisState::Withdrawn));
    assert!(session.words("predictors").is_none());
}

/// A predictor with constant probabilities: right with probability `right`, otherwise straight.
pub(super) fn trained(
    right: f64,
    source: Option<(PredictorSummary, TrialUse)>,
) -> TrainedPredictor {
    let features = FeatureSet::of(&["distance"]).unwrap();
    let shares = vec![right, 1.0 - right, 0.0];
    let predictor = Predictor::constant(features, vec![-1, 0, 1], shares).unwrap();
    let source = source.map(|(summary, trial)| PredictorSource {
        analysis: "a1".into(),
        study: "default".into(),
        summary,
        trial,
    });
    let (predictor, trained_on) = ((&predictor).into(), Vec::new());
    TrainedPredictor { predictor, trials: 7, fallback: None, trained_on, source }
}

const LR: &str = "a1/models/lr-1-hrd-1.json";

/// The addresses of the pending requests for a predictor.
fn asked(session: &Session) -> Vec<&str> {
    session.urls().into_iter().filter(|url| url.contains("/predictor")).collect()
}

/// Opens a replay with the default predictor, in a study whose newest finished analysis has two
/// models of the participant.
fn replay_with_models() -> Session {
    let mut session = replay_of_equals();
    session.send("predictor", 200, &trained(0.9, None));
    let analyses = [("a2", AnalysisState::Queued), ("a1", AnalysisState::Done)];
    session.send("analyses", 200, &list(analyses.map(|(id, state)| analysis(id, state)).into()));
    let asked = session.urls().pop().unwrap().to_owned();
    assert_eq!(
        asked, "/api/v1/admin/analyses/a1/predictors?participant=1&experiment=1&limit=500",
        "the newest that is done"
    );
    session.send("models", 200, &page(vec![model("dt", 1, 1), model("lr", 1, 1)], 2));
    session
}

/// The probability of a right turn that the page shows.
pub(super) fn right(session: &Session) -> Option<String> {
    let words = session.words("prediction")?;
    let mut words = words.split_whitespace().skip_while(|word| *word != "right").skip(1);
    Some(format!("{} {}", words.next()?, words.next()?))
}

#[test]
fn another_predictor_changes_the_prediction_and_the_address_but_not_the_time() {
    let mut session = replay_with_models();
    assert!(session.words("predictor").unwrap().contains("trained on the 7 trials before"));
    assert_eq!(right(&session).as_deref(), Some("90 %"));
    let options = session.words("choose-predictor").unwrap();
    for expected in ["Decision tree on hrd, 71.2 %", "Logistic regression on hrd, 71.2 %"] {
        assert!(options.contains(expected), "{options}");
    }
    session.tell(session.page.view().enter("slider", FieldValue::Number(Some(2.4))).unwrap());
    session.choose("choose-predictor", LR);
    // Nothing from the previous predictor is shown any more.
    assert!(session.words("prediction").is_none() && session.words("regions").is_none());
    assert!(session.words("predictor").unwrap().contains("Loading"));
    let query = "?analysis=a1&file=models%2Flr-1-hrd-1.json";
    assert_eq!(asked(&session), [format!("{}{query}", routes::admin_predictor("t"))]);
    assert_eq!(session.link(), format!("/lab/replay/t{query}&t=2.4"));
    session.send("predictor", 200, &trained(0.3, Some((model("lr", 1, 1), TrialUse::Trained))));
    assert_eq!(right(&session).as_deref(), Some("30 %"));
    assert!(session.text().contains("Step 12"), "the slider stays");
    let warning = session.words("trained-on-this").unwrap();
    assert!(
        warning.contains("was trained on this trial; its predictions look better"),
        "{warning}"
    );

    // Switch back to the study's predictor.
    session.choose("choose-predictor", "");
    assert_eq!(session.link(), "/lab/replay/t?t=2.4");
    assert_eq!(asked(&session), [routes::admin_predictor("t")]);
    session.send("predictor", 200, &trained(0.9, None));
    assert_eq!(right(&session).as_deref(), Some("90 %"));
    assert!(session.words("trained-on-this").is_none() && session.words("trial-use").is_none());
}

#[test]
fn only_the_predictor_that_was_chosen_last_counts() {
    let mut session = replay_with_models();
    session.choose("choose-predictor", LR);
    session.choose("choose-predictor", "a1/models/dt-1-hrd-1.json");
    assert_eq!(asked(&session).len(), 1, "the first request is given up");
    session.send("predictor", 200, &trained(0.3, Some((model("dt", 1, 1), TrialUse::HeldOut))));
    assert!(session.words("predictor").unwrap().contains("Decision tree on hrd of participant 1"));
    assert!(session.words("trained-on-this").is_none());
    assert!(session.words("trial-use").unwrap().contains("held out"));
}

#[test]
fn a_link_names_the_predictor() {
    let mut session = signed_in("/lab/replay/t?analysis=a0&file=models/lr-1-hrd-2.json");
    session.send("trial", 200, &trial(unequal(), [None, None]));
    let query = "?analysis=a0&file=models%2Flr-1-hrd-2.json";
    assert_eq!(session.urls()[0], format!("{}{query}", routes::admin_predictor("t")));
    let says = |used: TrialUse, words: &str| {
        let mut session = signed_in("/lab/replay/t?analysis=a0&file=models/lr-1-hrd-2.json");
        session.send("trial", 200, &trial(unequal(), [None, None]));
        session.send("predictor", 200, &trained(0.5, Some((model("lr", 1, 2), used))));
        let note = session.words("trial-use").unwrap();
        assert!(note.contains(words), "{note}");
        let options = session.words("choose-predictor").unwrap();
        assert!(options.contains("Logistic regression on hrd, participant 2"), "{options}");
    };
    says(TrialUse::OtherParticipant, "participant 2, who did not drive this trial");
    says(TrialUse::OtherStudy, "of study default, whose vehicles and scenes may differ");
    says(TrialUse::Unused, "did not use this trial");
}

#[test]
fn a_predictor_that_is_gone_or_of_no_use_says_so() {
    for (status, body, words) in [
        (404, r#"{"code":"not_found","message":"there is no such model: x"}"#, "no such model"),
        (422, r#"{"code":"invalid","field":"file","message":"expected a, found b"}"#, "found b"),
    ] {
        let mut session = replay_with_models();
        session.choose("choose-predictor", "a1/models/gone.json");
        session.answer("predictor", status, body.as_bytes());
        let said = session.words("refused").unwrap();
        assert!(said.contains("No predicted sets.") && said.contains(words), "{said}");
        assert!(session.words("prediction").is_none() && session.words("regions").is_none());
        // The user can still choose another predictor.
        session.choose("choose-predictor", "");
        session.send("predictor", 200, &trained(0.9, None));
        assert!(session.words("refused").is_none());
        assert_eq!(right(&session).as_deref(), Some("90 %"));
    }
}

#[test]
fn without_analyses_a_replay_says_where_they_are_made() {
    let mut session = replay_of_equals();
    session.send("analyses", 200, &list(Vec::new()));
    assert!(session.words("no-models").unwrap().contains("once the study is analysed"));
    let mut session = replay_of_equals();
    session.send("analyses", 200, &list(vec![analysis("a1", AnalysisState::Done)]));
    session.send("models", 200, &page(Vec::new(), 0));
    assert!(session.words("no-models").unwrap().contains("no model of this participant"));
    let mut session = replay_of_equals();
    session.unreachable("analyses");
    assert!(session.words("no-models").unwrap().contains("cannot be reached"));
    // The default predictor still works.
    session.send("predictor", 200, &trained(0.9, None));
    assert_eq!(right(&session).as_deref(), Some("90 %"));
}
