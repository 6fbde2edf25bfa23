//! The models of analyses: their list, and their use in replays.

use crate::analyses::{ask, done, show};
use crate::openapi::Document;
use reqwest::Method;
use serde_json::json;
use sidestep::api::{
    AnalysisState, LearnedSets, PredictorPage, PredictorSummary, TrainedPredictor, TrialDetail,
    TrialUse, routes,
};
use sidestep::comparison::split::first_test_task;
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::ShfrsSettings;
use sidestep::shfrs::baselines::{EmpiricalFamily, EmpiricalSets};
use sidestep::trial::Phase;
use sidestep::trial_view::source::Way;
use sidestep::trial_view::view::View;
use sidestep::trial_view::{Learned, Playback, Recorded, side_by_side};
use sidestep_tests::{Answer, Driver, Folder, Server, behind, run};
use std::ops::ControlFlow;

/// A warm-up that no analysis uses, and eight tasks.
const STUDY: &str =
    r#"phases = [{ phase = "practice", scenes = 1 }, { phase = "task", scenes = 8 }]"#;

const CONSTANT: &str = r#"{"format":"sidestep-predictor/1","kind":"constant","features":[],"classes":[-1,0,1],"probabilities":[0.1,0.2,0.7]}"#;

/// Rows of the comparison for each participant: five kinds of model, two experiments, nine sets.
const MODELS: u64 = 5 * 2 * 9;

/// A fast analysis: one setting in each grid.
fn quick() -> serde_json::Value {
    let grids = json!({
        "rbf_c": [1.0], "rbf_gamma": [0.1], "linear_c": [1.0], "tree_depth": [3], "tree_leaf": [5],
        "logistic_c": [1.0],
    });
    json!({ "grids": grids, "paper_only": true })
}

async fn drive(server: &Server, who: u64) -> Driver {
    let driver = Driver::enrol(server).await;
    driver.drive_restlessly(server, &SceneParameters::default(), who).await;
    driver
}

/// The trials of a participant's tasks, in order.
fn tasks(driver: &Driver) -> Vec<String> {
    let scenes = driver.enrolled.plan.scenes();
    scenes
        .filter(|(phase, _)| phase.phase == Phase::Task)
        .map(|(_, it)| it.trial_id.clone())
        .collect()
}

async fn list(server: &Server, id: &str, query: &str) -> PredictorPage {
    server.admin(&format!("{}?{query}", routes::analysis_predictors(id))).await.into(200)
}

/// The response for this model in a replay of a trial.
async fn model(server: &Server, trial: &str, id: &str, file: &str) -> Answer {
    let route = routes::admin_predictor(trial);
    server.admin(&format!("{route}?analysis={id}&file={file}")).await
}

async fn count(server: &Server, table: &str) -> i64 {
    let query = format!("SELECT count(*) FROM {table}");
    behind(&server.database()).row(&query, |row| row.get(0)).await.unwrap()
}

/// The number of models according to three tables: the rows of models, and the sums of the counts
/// by kind and by participant.
async fn models_counted(server: &Server) -> [i64; 3] {
    let sum = async |table: &str| -> i64 {
        let query = format!("SELECT CAST(coalesce(sum(models), 0) AS BIGINT) FROM {table}");
        behind(&server.database()).row(&query, |row| row.get(0)).await.unwrap()
    };
    let rows = count(server, "analysis_predictor").await;
    [rows, sum("predictor_kind").await, sum("predictor_participant").await]
}

#[tokio::test]
async fn models_are_listed_and_say_what_they_have_to_do_with_a_trial() {
    let server = Server::with_study(STUDY).await;
    let (first, second) = (drive(&server, 1).await, drive(&server, 2).await);
    let id = ask(&server, quick()).await.id;
    done(&server, &id).await;

    // Paging returns every model once, ordered by participant.
    let all = list(&server, &id, "limit=500").await;
    assert_eq!((all.total, all.predictors.len() as u64), (2 * MODELS, 2 * MODELS));
    let halves =
        [list(&server, &id, "limit=90").await, list(&server, &id, "limit=90&offset=90").await];
    assert_eq!(halves.concat_predictors(), all.predictors);
    assert!(all.predictors.is_sorted_by_key(|it| it.participant));
    let choices = &all.choices;
    assert_eq!(choices.participants, [1, 2]);
    assert_eq!(choices.models, ["svm", "svm_rbf", "svm_linear", "dt", "lr"]);
    assert_eq!(choices.experiments, [1, 2]);
    assert_eq!((choices.features.len(), choices.features[0].as_str()), (9, "hrd"));
    let newest = [&first, &second].map(|driver| tasks(driver).pop());
    for it in &all.predictors {
        assert_eq!(it.newest_task, newest[it.participant as usize - 1]);
    }

    // The numbers equal the numbers in cells.csv, and the model's file exists.
    let cells = server.admin_text(&routes::analysis_file(&id, "cells.csv")).await;
    for it in &all.predictors {
        let head = format!("{},{},{},{},", it.model, it.experiment, it.features, it.participant);
        let row = cells.lines().find_map(|line| line.strip_prefix(&head)).unwrap();
        let numbers: Vec<f64> = row.split(',').take(2).map(|it| it.parse().unwrap()).collect();
        assert_eq!(numbers, [it.cv_accuracy, it.test_accuracy], "{head}");
    }

    // With filters.
    let query = "participant=2&model=lr&experiment=1&features=hd";
    let found = list(&server, &id, query).await;
    assert_eq!((found.total, &found.choices), (1, choices));
    let lr = &found.predictors[0];
    assert_eq!(lr.file, "models/lr-1-hd-2.json");
    assert_eq!(lr.columns, ["abs_dx", "abs_dy", "dpsi", "cos_dpsi", "sin_dpsi", "v_h", "distance"]);
    assert_eq!(list(&server, &id, "experiment=2").await.total, MODELS);
    for (query, total) in [("features=none", 0), ("participant=9", 0), ("model=boosted", 0)] {
        assert_eq!(list(&server, &id, query).await.total, total, "{query}");
    }

    // Trials are classified by the split that was used in training.
    let used = async |trial: &str, file: &str| {
        let found: TrainedPredictor = model(&server, trial, &id, file).await.into(200);
        (found.trials, found.source.unwrap().trial)
    };
    let trained_on = first_test_task(8);
    for (place, trial) in tasks(&second).iter().enumerate() {
        let expected = if place < trained_on { TrialUse::Trained } else { TrialUse::HeldOut };
        assert_eq!(used(trial, &lr.file).await, (trained_on, expected), "task {place}");
    }
    let practice = &second.scenes()[0].0;
    assert_eq!(used(practice, &lr.file).await.1, TrialUse::Unused);
    assert_eq!(used(&tasks(&first)[0], &lr.file).await.1, TrialUse::OtherParticipant);

    // A replay gets the model that is in the file, and the summary that is in the list.
    let trial = tasks(&second).swap_remove(0);
    for model_file in ["models/svm_rbf-1-hrd_body-2.json", "models/dt-1-hrd-2.json", &lr.file] {
        let found: TrainedPredictor = model(&server, &trial, &id, model_file).await.into(200);
        let source = found.source.unwrap();
        let listed = all.predictors.iter().find(|it| it.file == model_file).unwrap();
        assert_eq!((&source.summary, source.study.as_str()), (listed, "default"));
        let text = server.admin_text(&routes::analysis_file(&id, model_file)).await;
        assert_eq!(found.predictor, serde_json::from_str::<PredictorFile>(&text).unwrap());
    }
    // The responses match the OpenAPI document.
    let document = Document::of(&server).await;
    for (path, route) in [
        ("/api/v1/admin/analyses/{id}/predictors", routes::analysis_predictors(&id)),
        (
            "/api/v1/admin/trials/{trial_id}/predictor",
            format!("{}?analysis={id}&file={}", routes::admin_predictor(&trial), lr.file),
        ),
    ] {
        let body = server.admin(&route).await.body;
        let validator = document.validator(&Method::GET, path, 200).unwrap();
        let errors: Vec<_> = validator.iter_errors(&body).map(|it| it.to_string()).collect();
        assert!(errors.is_empty() && body.is_object(), "{path}: {errors:?}");
    }
    // Without a query, the response is still the model of the earlier trials.
    let plain: TrainedPredictor = server.admin(&routes::admin_predictor(&trial)).await.into(200);
    assert_eq!((plain.trials, plain.source), (1, None));

    // The trial is in another study, whose participants have the same numbers.
    let server = server.restarted_with_study(&format!("slug = \"second\"\n{STUDY}")).await;
    let elsewhere = Driver::ask_in(&server, "second", json!({ "consent": true })).await;
    let elsewhere = Driver { enrolled: elsewhere.into(201) };
    elsewhere.drive(&server, 2).await;
    let found: TrainedPredictor =
        model(&server, &tasks(&elsewhere)[0], &id, "models/lr-1-hd-1.json").await.into(200);
    assert_eq!(found.source.unwrap().trial, TrialUse::OtherStudy);
}

/// Concatenates two pages.
trait Pages {
    fn concat_predictors(&self) -> Vec<PredictorSummary>;
}

impl Pages for [PredictorPage; 2] {
    fn concat_predictors(&self) -> Vec<PredictorSummary> {
        self.iter().flat_map(|page| page.predictors.clone()).collect()
    }
}

#[tokio::test]
async fn bad_questions_about_models_are_explained() {
    let server = Server::with_study(STUDY).await;
    let driver = drive(&server, 1).await;
    let asked = ask(&server, quick()).await.id;
    // An unfinished analysis has no list.
    let cancelled = ask(&server, json!({})).await.id;
    let request = server.request(Method::POST, &routes::cancel_analysis(&cancelled));
    assert_eq!(Answer::of(request.bearer_auth(&server.key)).await.status, 200);
    let page = list(&server, &cancelled, "").await;
    assert_eq!((page.total, page.predictors.len(), page.choices.participants.len()), (0, 0, 0));
    done(&server, &asked).await;
    let models = routes::analysis_predictors(&asked);
    for (query, field) in [
        ("limit=0", "limit"),
        ("limit=501", "limit"),
        ("limit=many", "limit"),
        ("offset=-1", "offset"),
        ("participant=0", "participant"),
        ("participant=Ada", "participant"),
        ("model=oracle", "model"),
        ("experiment=3", "experiment"),
        ("expriment=1", "expriment"),
    ] {
        let answer = server.admin(&format!("{models}?{query}")).await;
        answer.problem(422, "invalid", Some(field));
    }
    let nothing = routes::analysis_predictors("none");
    server.admin(&nothing).await.problem(404, "not_found", None);

    let trial = tasks(&driver).swap_remove(0);
    let route = routes::admin_predictor(&trial);
    let file = "models/lr-1-hrd-1.json";
    for (query, field) in [
        (format!("analysis={asked}"), "file"),
        (format!("file={file}"), "analysis"),
        (format!("analysis={asked}&model={file}"), "model"),
        // This model predicts whether a person turns, not the direction.
        (format!("analysis={asked}&file=models/lr-2-hrd-1.json"), "file"),
    ] {
        let answer = server.admin(&format!("{route}?{query}")).await;
        answer.problem(422, "invalid", Some(field));
    }
    // Missing files, and files that are not models.
    for (id, name) in [
        ("none", file),
        (&asked, "models/lr-1-hrd-9.json"),
        (&asked, "cells.csv"),
        (&asked, "../cells.csv"),
        (&asked, ""),
    ] {
        let answer = model(&server, &trial, id, name).await;
        assert!(answer.problem(404, "not_found", None).contains("start the analysis again"));
    }
    let answer = model(&server, "none", &asked, file).await;
    assert!(answer.problem(404, "not_found", None).contains("trial"));

    // A read-only key is sufficient. Without a key, access is refused.
    let new = json!({ "name": "reader", "access": "read" });
    let request = server.request(Method::POST, routes::ADMIN_KEYS).bearer_auth(&server.key);
    let made: sidestep::api::KeyMade = Answer::of(request.json(&new)).await.into(201);
    for route in [models, format!("{route}?analysis={asked}&file={file}")] {
        let get = || server.request(Method::GET, &route);
        assert_eq!(Answer::of(get().bearer_auth(&made.secret)).await.status, 200);
        Answer::of(get()).await.problem(401, "unauthorized", None);
        let participant = get().bearer_auth(&driver.enrolled.token);
        Answer::of(participant).await.problem(401, "unauthorized", None);
    }
}

#[tokio::test]
async fn models_go_with_their_participant_and_their_analysis() {
    let server = Server::with_study(STUDY).await;
    let (stays, leaves) = (drive(&server, 1).await, drive(&server, 2).await);
    let [before, deleted] = [quick(), json!({ "grids": quick()["grids"] })];
    let before = ask(&server, before).await.id;
    let deleted = ask(&server, deleted).await.id;
    for id in [&before, &deleted] {
        done(&server, id).await;
    }
    assert_eq!(models_counted(&server).await, [4 * MODELS as i64; 3]);
    assert_eq!(count(&server, "analysis_trial").await, 2 * 2 * 8);
    let request = server.request(Method::DELETE, &routes::admin_analysis(&deleted));
    assert_eq!(Answer::of(request.bearer_auth(&server.key)).await.status, 204);
    assert_eq!(models_counted(&server).await, [2 * MODELS as i64; 3]);
    assert_eq!(count(&server, "analysis_trial").await, 2 * 8);
    let trial = tasks(&stays).swap_remove(0);
    let file = "models/lr-1-hrd-1.json";
    model(&server, &trial, &deleted, file).await.problem(404, "not_found", None);

    assert_eq!(leaves.withdraw(&server, "delete").await.status, 200);
    assert_eq!(show(&server, &before).await.summary.state, AnalysisState::Withdrawn);
    let page = list(&server, &before, "").await;
    assert_eq!((page.total, page.predictors, page.choices.participants), (0, vec![], vec![]));
    model(&server, &trial, &before, file).await.problem(404, "not_found", None);
    assert_eq!(models_counted(&server).await, [0; 3]);
    // Only the trials of the remaining participant are left.
    assert_eq!(count(&server, "analysis_trial").await, 8);
    let after = ask(&server, quick()).await.id;
    done(&server, &after).await;
    assert_eq!(list(&server, &after, "").await.choices.participants, [1]);
}

/// For the same view, trial and model, the command draws the same picture as the page.
#[tokio::test]
async fn plot_draws_the_picture_of_a_replay() {
    let server = Server::with_study(STUDY).await;
    let driver = drive(&server, 1).await;
    let trial_id = tasks(&driver).pop().unwrap();
    let trial: TrialDetail = server.admin(&routes::admin_trial(&trial_id)).await.into(200);
    let route = routes::admin_predictor(&trial_id);
    let trained: TrainedPredictor = server.admin(&route).await.into(200);
    let predictor = Predictor::try_from(trained.predictor).unwrap();

    let folder = Folder::default();
    let out = folder.name("replay.svg");
    for query in
        ["", "t=3.45&show=v-hr,shfrs,samples,avoidance,shade-rh&hr=-1,0,1&sets=4&colours=safe"]
    {
        let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
        let view = View::of_query(pairs).unwrap();
        let TrialDetail { parameters, scene, inputs, states, .. } = trial.clone();
        let mut playback = Playback::new(Recorded { parameters, scene, inputs, states }).unwrap();
        let solved = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()));
        playback.use_safety(solved.unwrap()).unwrap();
        let settings = ShfrsSettings::paper(predictor.classes().len()).unwrap();
        let learned = Learned { predictor: predictor.clone(), settings };
        playback.use_learned(Some(learned)).unwrap();
        playback.go(&view).unwrap();
        let expected = playback.figure(&view, "default / participant 1 / task 8").svg();

        let database = server.database();
        let args = ["plot", "--kind", "replay", "--database", &database, "--trial", &trial_id];
        run(&[&args[..], &["--view", query, "--out", &out]].concat()).await.json();
        assert!(std::fs::read_to_string(&out).unwrap() == expected, "{query}");
    }
    // The command can also draw other predictors, and two of them side by side.
    let database = server.database();
    let args = ["plot", "--kind", "replay", "--database", &database, "--trial", &trial_id];
    let TrialDetail { parameters, scene, inputs, states, .. } = trial.clone();
    let solved = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
    let recorded = Recorded { parameters, scene, inputs, states };
    let pane = |learned: Learned, view: &View| {
        let mut playback = Playback::new(recorded.clone()).unwrap();
        playback.use_safety(solved.clone()).unwrap();
        playback.use_learned(Some(learned)).unwrap();
        playback.go(view).unwrap();
        playback
    };
    let history = format!("{route}?features=hrd_body_history");
    let history: TrainedPredictor = server.admin(&history).await.into(200);
    assert!(history.fallback.is_none() && history.predictor.features.contains(&"turned_5".into()));
    let history = Predictor::try_from(history.predictor).unwrap();
    let view = View::of_query([("t", "3.45")]).unwrap();
    let mut first = pane(Way::History.learned(Some(history)).unwrap(), &view);
    let mut second = pane(Way::HoldTheInput.learned(None).unwrap(), &view);
    let heading = "default / participant 1 / task 8";
    let expected = [
        ("t=3.45&predictor=history", first.figure(&view, heading)),
        (
            "t=3.45&predictor=history&beside=hold-the-input",
            side_by_side(
                [(&mut first, Way::History.label()), (&mut second, Way::HoldTheInput.label())],
                &view,
                heading,
            ),
        ),
    ];
    for (query, expected) in expected {
        run(&[&args[..], &["--view", query, "--out", &out]].concat()).await.json();
        assert!(std::fs::read_to_string(&out).unwrap() == expected.svg(), "{query}");
    }
    // The page gets sets that are learned from the trials before this one.
    let mut learned = Vec::new();
    for family in [EmpiricalFamily::Empirical, EmpiricalFamily::Gaussian] {
        let route = format!("{}?family={}", routes::admin_sets(&trial_id), family.name());
        let sets: LearnedSets = server.admin(&route).await.into(200);
        assert_eq!((sets.trials, sets.sets.family()), (8, family));
        // Only this trial, the last task, is held out.
        let held = sets.held.unwrap();
        assert_eq!((held.trajectories, held.windows, held.inside.len()), (1, 41, 5));
        learned.push(sets.sets);
    }
    let mut learned = learned.into_iter();
    let [empirical, gaussian] = [learned.next().unwrap(), learned.next().unwrap()];
    let pane = |sets: &EmpiricalSets, view: &View| {
        let mut playback = Playback::new(recorded.clone()).unwrap();
        playback.use_safety(solved.clone()).unwrap();
        playback.use_method(Some(sets.clone().into())).unwrap();
        playback.go(view).unwrap();
        playback
    };
    for look in ["t=3.45", "t=3.45&colours=safe", "t=3.45&sets=steps"] {
        let view = View::of_query(look.split('&').filter_map(|it| it.split_once('='))).unwrap();
        let mut first = pane(&empirical, &view);
        let mut second = pane(&gaussian, &view);
        let query = format!("{look}&predictor=empirical&beside=gaussian");
        run(&[&args[..], &["--view", &query, "--out", &out]].concat()).await.json();
        let panes = [(&mut first, Way::Empirical.label()), (&mut second, Way::Gaussian.label())];
        let expected = side_by_side(panes, &view, heading).svg();
        assert!(std::fs::read_to_string(&out).unwrap() == expected, "{look}");
        assert!(expected.contains("share of futures") && expected.contains("Mahalanobis radius"));
    }
    let none = driver.enrolled.plan.scenes().next().unwrap().1.trial_id.clone();
    let of_none = routes::admin_sets(&none);
    let said = server.admin(&format!("{of_none}?family=empirical")).await;
    let said = said.problem(422, "invalid", Some("earlier trials"));
    assert!(said.contains("at least one of 10 steps or more, to learn from"), "{said}");
    for (query, field) in [("", "family"), ("?family=best", "family"), ("?kind=gaussian", "kind")] {
        let answer = server.admin(&format!("{of_none}{query}")).await;
        answer.problem(422, "invalid", Some(field));
    }
    let wrong = format!("{route}?features=best");
    let wrong = server.admin(&wrong).await;
    wrong.problem(422, "invalid", Some("features"));
    let both = format!("{route}?analysis=a&file=b&features=hrd");
    server.admin(&both).await.problem(422, "invalid", Some("features"));
    // From the exported file, the command draws the same picture except for its title.
    let steps = folder.file("steps.csv", server.export("default").await);
    let number = trial.summary.index + 1;
    let args = ["plot", "--kind", "replay", "--trials", &steps, "--participant", "1", "--trial"];
    run(&[&args[..], &[&number.to_string(), "--out", &out]].concat()).await.json();
    let svg = std::fs::read_to_string(&out).unwrap();
    assert!(svg.contains("participant 1 / task / trial 8"), "{}", &svg[..400]);

    let refused = async |args: &[&str], words: &str| {
        let all = [&["plot", "--kind", "replay", "--out", &out], args].concat();
        run(&all).await.refused(2, &[words]);
    };
    let database = server.database();
    refused(&[], "expected --database URL --trial ID, or --trials").await;
    refused(&["--database", &database, "--trial", "none"], "--trial none: no such trial").await;
    let view = ["--database", &database, "--trial", &trial_id, "--view", "t=soon"];
    refused(&view, "--view.t: expected a time in s from 0 on, such as 3.4, found soon").await;
    let view = ["--database", &database, "--trial", &trial_id, "--view", "t=1&speedy=2"];
    refused(&view, "--view: expected the names t, speed, show, hr, rh, sets, colours").await;
    refused(&[&args[3..6], &["2", "--trial", "1"]].concat(), "no participant of the file").await;
    let view = ["--database", &database, "--trial", &trial_id, "--view", "predictor=best"];
    refused(&view, "--view.predictor: expected earlier, history, learned-disturbance").await;
    let view = ["--database", &database, "--trial", &trial_id, "--view", "beside=a0%2Fgone.json"];
    refused(&view, "--view: there is no such model").await;
    let model = folder.file("model.json", CONSTANT);
    // No trial was driven before the first one.
    let view = [&args[3..], &["0", "--view", "predictor=empirical"]].concat();
    refused(&view, "earlier trials: expected at least one of 10 steps or more").await;
    let view = [&args[3..], &["8", "--predictor", &model, "--view", "predictor=constant"]].concat();
    refused(&view, "--predictor: expected nothing beside the predictor that --view names").await;
    let view = [&args[3..], &["8", "--view", "analysis=a&file=b"]].concat();
    refused(&view, "a model of an analysis is in a database").await;
    refused(&[&args[3..], &["99"]].concat(), "one of the 9 trials of participant 1").await;
}
