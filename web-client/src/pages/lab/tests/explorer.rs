//! Tests of the explorer of predicted sets, with an evaluator that runs in the test.

mod beside;

use super::*;
use sidestep::api::{Drive, Drives, PredictorSource, PredictorSummary, TrainedPredictor, TrialUse};
use sidestep::features::FeatureSet;
use sidestep::learn::participant;
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::scene::{EncounterRange, generate};
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::file::{PRESETS, ShfrsFile};
use sidestep::shfrs::probability::regions;
use sidestep::shfrs::tuning::{Parts, Split};
use sidestep::shfrs::window::{Trajectory, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;

/// Twelve tasks with one turn each, at different times and to different sides.
fn drives(parameters: SceneParameters, id: Option<String>) -> Drives {
    let scenes = generate(&parameters, &EncounterRange::default(), 12, 3).unwrap();
    let drive = |(i, (scene, _)): (usize, (Scene, _))| {
        let mut inputs = vec![TurnInput::Straight; parameters.steps];
        let turn = if i % 3 == 0 { TurnInput::Left } else { TurnInput::Right };
        inputs[6 + i..14 + 2 * i].fill(turn);
        let states = simulate(&parameters, &scene, &inputs);
        Drive::new(format!("t{i}"), format!("task {}", i + 1), scene, &inputs, &states)
    };
    Drives {
        study: "default".into(),
        number: 4,
        pilot: false,
        data_deleted: false,
        excluded: None,
        synthetic: false,
        parameters,
        value_function_hr: id.clone(),
        value_function_rh: id,
        tasks: scenes.into_iter().enumerate().map(drive).collect(),
    }
}

pub(super) fn exact() -> ValueFunction {
    let game = SceneParameters::default().game(Evader::Human);
    ValueFunction::Exact(game.exact().unwrap())
}

pub(super) fn usual() -> Drives {
    drives(SceneParameters::default(), Some(exact().id()))
}

/// Opens the explorer at this address, and loads the tasks and the value function.
fn arrived(path: &str) -> Session {
    let mut session = signed_in(path);
    session.send("drives", 200, &usual());
    session.answer(of(Evader::Human), 200, &exact().encode());
    session
}

/// Opens the explorer at this address, trains the predictor and counts all tasks.
fn opened(path: &str) -> Session {
    let mut session = arrived(path);
    session.evaluate("evaluator");
    session.evaluate("evaluator");
    session
}

impl Session {
    fn areas(&self) -> Vec<String> {
        let area = |j| self.words(&format!("area-{j}"));
        (0..).map_while(area).collect()
    }

    /// Updates the link and returns it.
    fn linked(&mut self) -> String {
        self.wake("link");
        self.visited.last().cloned().unwrap_or_default()
    }
}

/// Calls `work` with the predictor that the command line would train on the same tasks, and with
/// the tasks and their split.
fn at_the_command_line<T>(
    work: impl FnOnce(Prediction<'_, PredictedHuman<'_>>, &Parts, &[Trajectory]) -> T,
) -> T {
    let drives = usual();
    let safety = SafetyLevels { human: exact(), robot: exact() };
    let parts = Split::USUAL.parts(drives.tasks.len()).unwrap();
    let words = ["hrd", "robot_ahead", "robot_left"];
    let names = words.into_iter().flat_map(|word| match FeatureSet::subset(word) {
        Ok(set) => Vec::from(set),
        Err(_) => vec![word.to_owned()],
    });
    let features = FeatureSet::of(&names.collect::<Vec<_>>()).unwrap();
    let driven: Vec<_> = parts.training.iter().map(|&i| &drives.tasks[i]).collect();
    let driven: Vec<_> = driven.iter().map(|it| (it.inputs.0.clone(), it.states())).collect();
    let predictor = participant::train(&features, Some(&safety), &driven).unwrap().predictor;
    let human = PredictedHuman::new(&predictor, &safety, &drives.parameters).unwrap();
    let trajectory = |task: &Drive| task.trajectory(&drives.parameters).unwrap();
    let trajectories: Vec<Trajectory> = drives.tasks.iter().map(trajectory).collect();
    work(Prediction::new(&drives.parameters, &human), &parts, &trajectories)
}

/// How often the future is inside the sets, counted in the same way as on the command line.
fn counted_at_the_command_line(file: &ShfrsFile) -> Vec<String> {
    at_the_command_line(|prediction, parts, trajectories| {
        let sample = parts.sample(trajectories);
        let unseen = [sample.calibration, sample.test].concat();
        let settings = file.settings(3).unwrap();
        let every = WindowChoice::EveryStep;
        let found = regions(&unseen, every, prediction, &settings, 0.95).unwrap();
        found.probabilities.inside.iter().map(|p| format!("{:.3}", p.value)).collect()
    })
}

#[test]
fn the_numbers_are_those_of_the_command_line() {
    let mut session = opened("/lab/explorer/p");
    for (place, preset) in PRESETS.iter().enumerate() {
        session.press(&format!("preset-{place}"));
        session.evaluate("evaluator");
        let expected = counted_at_the_command_line(&preset.settings(3));
        for (j, expected) in expected.iter().enumerate() {
            let shown = session.words(&format!("p-{j}")).unwrap();
            assert!(shown.contains(expected), "{place} {j}: {shown}, {expected}");
        }
    }
    let words = session.words("counted-words").unwrap();
    assert!(words.contains("share of 287 windows of 7 tasks"), "{words}");
    assert!(session.words("predictor").unwrap().contains("trained on 5 of the 12 tasks"));
}

#[test]
fn sets_move_with_every_setting() {
    let mut session = opened("/lab/explorer/p?trial=t2&t=1.4");
    let mut before = session.areas();
    assert_eq!(before.len(), 5);
    let mut moved = |session: &Session, what: &str| {
        let areas = session.areas();
        assert_ne!(areas, before, "{what}");
        before = areas;
    };
    session.slide("epsilon-0", 0.12);
    moved(&session, "ε");
    session.slide("steps", 14.0);
    moved(&session, "T");
    session.slide("sets", 6.0);
    moved(&session, "F");
    session.slide("up-to-2", 9.0);
    moved(&session, "k");
    session.choose("by", "tau");
    session.slide("tau", 0.9);
    moved(&session, "τ");
    session.choose("by", "q");
    moved(&session, "the shortest interval");
    session.slide("q", 0.3);
    moved(&session, "q");
    session.choose("by", "tau");
    session.slide("tau", 0.9);
    session.choose("choose-predictor", "constant");
    moved(&session, "predictor");
    session.slide("time", 4.0);
    session.choose("task", "t9");
    assert_eq!(session.seen("data-trial"), "t9");
    assert_eq!(
        session.linked(),
        "/lab/explorer/p?trial=t9&T=14&eps=0.12,0.15,0.25,0.4,0.7,1&tau=0.9\
         &predictor=constant&t=4"
    );
}

#[test]
fn a_link_brings_everything_back() {
    let link = "/lab/explorer/p?trial=t5&T=3&eps=0.1,1&k=3,2,1&rollout=paper&features=hr&t=2&colours=safe&count=all";
    let mut session = opened(link);
    assert_eq!((session.areas().len(), session.seen("data-step").as_str()), (2, "10"));
    assert!(session.words("counted-words").unwrap().contains("of 12 tasks"));
    assert!(session.words("seen").unwrap().contains("trained the predictor"));
    session.slide("epsilon-0", 0.2);
    assert_eq!(session.linked(), link.replace("eps=0.1", "eps=0.2"));
    session.slide("epsilon-0", 0.1);
    assert_eq!(session.linked(), link);
}

#[test]
fn what_a_link_names_and_the_explorer_lacks_is_told() {
    let said = |query: &str| arrived(&format!("/lab/explorer/p?{query}")).words("misread");
    for (query, expected) in [
        ("predictor=nonsense", "no predictor nonsense: expected here, earlier, constant"),
        ("features=xyz", "no feature set xyz: expected one of usual, hrd, hr"),
        ("count=some", "count=some: expected count=all"),
        ("sets=99", "predictions cover 10 steps: showing those after step 10"),
        ("trial=none", "not a task of this participant"),
        ("epsilon=0,1", "does not use epsilon in its link: expected trial, count, T, eps, k, tau"),
        ("predictor=nonsense&count=some", "no predictor nonsense"),
        ("predictor=nonsense&count=some", "has count=some"),
    ] {
        let words = said(query).unwrap_or_default();
        assert!(words.contains(expected), "{query}: {words}");
    }
    for query in ["", "predictor=here", "predictor=earlier", "features=hr", "count=all", "sets=10"]
    {
        assert_eq!(said(query), None, "{query}");
    }
}

#[test]
fn wrong_settings_are_told_beside_the_control_and_have_no_numbers() {
    let mut session = opened("/lab/explorer/p");
    let before = (session.areas(), session.words("p-0"));
    let nothing = (vec!["—".to_owned(); 5], Some("—".to_owned()));
    for (k, expected, is_read) in [
        ("2,2,1,1,1,1,1,1,1,4", "k of step 10: expected a whole number from 1 to 3, found 4", true),
        ("2,2", "k: expected 10 entries, found 2 entries", true),
        ("2,2,1,1,1,1,1,1,1,1", "", true),
        // Input that cannot be read changes nothing.
        ("2;2", "k: expected whole numbers", false),
    ] {
        session.choose("k", k);
        session.evaluate("evaluator");
        let said = session.words("complaint").unwrap_or_default();
        assert!(said.contains(expected) && said.is_empty() == expected.is_empty(), "{said}");
        let is_valid = expected.is_empty() || !is_read;
        let numbers = (session.areas(), session.words("p-0"));
        assert_eq!(numbers, if is_valid { before.clone() } else { nothing.clone() }, "{k}");
        let view = session.page.view();
        assert_eq!(
            view.find("save").unwrap().attribute("disabled").is_none(),
            said.is_empty(),
            "{k}"
        );
    }
    // Settings in a link are checked in the same way as settings in the controls.
    let link = "/lab/explorer/p?T=20&eps=0.59,0.39,1";
    let mut session = opened(link);
    let said = session.words("complaint").unwrap();
    assert!(said.contains("ε of F₂: expected 0.59 rad/s or more"), "{said}");
    assert_eq!(session.areas(), ["—"; 3]);
    assert_eq!(
        session.words("counted-words").unwrap(),
        "Nothing is predicted with these settings."
    );
    assert!(session.page.view().find("tune").unwrap().attribute("disabled").is_some());
    // Moving a slider past the slider of a neighbouring set also moves that slider, which resolves
    // the conflict.
    session.slide("epsilon-1", 0.6);
    session.evaluate("evaluator");
    assert_eq!(session.words("complaint"), None);
    assert!(session.linked().contains("T=20&eps=0.59,0.6,1"));
    session.slide("epsilon-0", 0.8);
    session.evaluate("evaluator");
    assert!(session.linked().contains("eps=0.8,0.8,1"));
    assert!(session.words("p-0").unwrap().contains("0."));
    let mut session = opened("/lab/explorer/p");
    session.press("preset-0");
    assert_eq!((session.words("complaint"), session.areas()), (None, before.0));
    // Sets can be predicted for one step and for a hundred steps. However, a hundred steps cannot
    // be counted on tasks of fifty steps.
    session.slide("steps", 1.0);
    session.evaluate("evaluator");
    assert!(session.words("p-0").unwrap().contains("0."));
    session.slide("steps", 100.0);
    session.evaluate("evaluator");
    let said = session.words("not-counted").unwrap();
    assert!(said.contains("Steps ahead, T: expected at most 50"), "{said}");
    assert!(session.areas()[4].parse::<f64>().unwrap() > 100.0);
    // If the last set does not contain every reachable position, the sets cannot be counted either.
    session.slide("steps", 10.0);
    session.slide("epsilon-4", 0.5);
    session.evaluate("evaluator");
    let said = session.words("not-counted").unwrap();
    assert!(said.contains("ε of F₅: expected at least 1 rad/s"), "{said}");
}

#[test]
fn a_predictor_arrives_while_settings_are_not_valid() {
    let mut session = arrived("/lab/explorer/p");
    session.choose("k", "2,2");
    session.evaluate("evaluator");
    assert_eq!(session.areas(), ["—"; 5]);
    session.press("preset-0");
    session.evaluate("evaluator");
    assert!(session.words("p-0").unwrap().contains("0."));
}

#[test]
fn a_newer_question_takes_the_place_of_an_older_one() {
    let mut session = arrived("/lab/explorer/p");
    session.evaluate("evaluator");
    for hundredths in 1..=300 {
        session.slide("epsilon-0", f64::from(hundredths % 15) / 100.0);
    }
    // The evaluator answers only the last of three hundred questions, and the link is updated only
    // once.
    session.evaluate("evaluator");
    let (evaluation, _) = session.evaluators.get_mut("evaluator").unwrap();
    assert!(!evaluation.work(&mut |_| {}) && evaluation.report().is_none());
    assert_eq!(session.timers.len(), 1);
    let mut file = PRESETS[0].settings(3);
    file.epsilon[0] = 0.0;
    let expected = counted_at_the_command_line(&file);
    assert!(session.words("p-0").unwrap().contains(&expected[0]));
}

#[test]
fn settings_go_into_a_file_and_come_back() {
    let mut session = opened("/lab/explorer/p?T=2&eps=0.1,1&tau=0.3");
    session.press("save");
    let (name, content) = session.files[0].clone();
    assert_eq!(name, "shfrs-settings.json");
    let file: ShfrsFile = serde_json::from_slice(&content).unwrap();
    assert_eq!((file.steps, file.tau), (2, Some(0.3)));
    // A preset leaves the kind of roll-outs unchanged. Invalid settings cannot be saved.
    session.choose("rollout", "paper");
    session.press("preset-1");
    session.press("save");
    let middle: ShfrsFile = serde_json::from_slice(&session.files[1].1).unwrap();
    assert_eq!((middle.epsilon[0], middle.rollout.word()), (0.2, "paper"));
    for wrong in ["{\"format\":".to_owned(), "[".repeat(100_000)] {
        session.choose("json", &wrong);
        assert!(session.words("complaint").unwrap().contains("JSON: expected settings"));
        let view = session.page.view();
        assert!(view.find("save").unwrap().attribute("disabled").is_some());
    }
    session.choose("json", &String::from_utf8(content).unwrap());
    assert_eq!(session.areas().len(), 2);
    assert!(session.words("command").unwrap().contains(
        "--participant 4 --settings shfrs-settings.json --probability 0.75 --guarantee conformal"
    ));
}

#[test]
fn models_of_an_analysis_count_what_did_not_train_them() {
    let mut session = opened("/lab/explorer/p");
    let summary = PredictorSummary {
        file: "model.json".into(),
        participant: 4,
        model: "lr".into(),
        experiment: 1,
        features: "B_hrd".into(),
        columns: Vec::new(),
        cv_accuracy: 0.8,
        test_accuracy: 0.75,
        newest_task: None,
    };
    session.choose("choose-predictor", "a/model.json");
    let features = FeatureSet::subset("hrd").unwrap();
    let predictor = Predictor::constant(features, vec![-1, 0, 1], vec![0.2, 0.5, 0.3]).unwrap();
    let source = PredictorSource {
        analysis: "a".into(),
        study: "default".into(),
        summary,
        trial: TrialUse::Trained,
    };
    let trained_on: Vec<String> = (0..9).map(|i| format!("t{i}")).collect();
    let answer = TrainedPredictor {
        predictor: PredictorFile::from(&predictor),
        trials: 9,
        fallback: None,
        trained_on,
        source: Some(source),
    };
    session.send("predictor", 200, &answer);
    session.evaluate("evaluator");
    assert!(session.words("counted-words").unwrap().contains("of 3 tasks"));
    session.choose("count", "all");
    session.evaluate("evaluator");
    assert!(session.words("counted-words").unwrap().contains("of 12 tasks"));
    assert!(session.linked().contains("analysis=a&file=model.json"));
    // A model with other actions or features is refused as well.
    let five =
        Predictor::constant(FeatureSet::none(), vec![-2, -1, 0, 1, 2], vec![0.2; 5]).unwrap();
    let five = TrainedPredictor { predictor: PredictorFile::from(&five), ..answer.clone() };
    let mut text = serde_json::to_value(&answer).unwrap();
    text["predictor"]["features"] = serde_json::json!(["speed"]);
    for (model, words) in [
        (serde_json::to_value(&five).unwrap(), "classes[0]: expected -1 (right), 0 (straight)"),
        (text, "features[0]"),
    ] {
        session.choose("choose-predictor", "a/other.json");
        session.send("predictor", 200, &model);
        let said = session.words("refused").unwrap();
        assert!(said.contains(words), "{said}");
        assert!(session.areas().iter().all(|area| area == "—"));
    }
    // If a model does not exist, an error is shown, and the sets of the previous model disappear.
    session.choose("choose-predictor", "a/other.json");
    session.answer("predictor", 404, br#"{"code":"not_found","message":"there is no such model"}"#);
    assert!(session.words("refused").unwrap().contains("no such model"));
    assert!(session.areas().iter().all(|area| area == "—"));
}

#[test]
fn what_cannot_be_explored_is_told_in_a_sentence() {
    let stuck = |drives: &Drives| {
        let mut session = signed_in("/lab/explorer/p");
        session.send("drives", 200, drives);
        session.words("stuck").unwrap()
    };
    let none = Drives { tasks: Vec::new(), ..usual() };
    assert!(stuck(&none).contains("no tasks yet"));
    assert!(stuck(&Drives { data_deleted: true, ..none }).contains("were deleted"));
    let mut session = signed_in("/lab/explorer/p");
    session.answer("drives", 404, br#"{"code":"not_found","message":"no participant"}"#);
    assert!(session.words("stuck").unwrap().contains("no such participant"));
    let session = opened("/lab/explorer/p?trial=foreign&T=1000");
    let said = session.words("misread").unwrap();
    assert!(said.contains("T: expected a whole number from 1 to 100, found 1000"), "{said}");
    assert_eq!(session.seen("data-trial"), "t0");
    let session = opened("/lab/explorer/p?trial=foreign");
    assert!(session.words("misread").unwrap().contains("not a task of this participant"));
}

#[test]
fn without_a_value_function_the_browser_solves() {
    let mut session = signed_in("/lab/explorer/p");
    session.send("drives", 200, &drives(unequal(), None));
    assert_eq!(session.solving.len(), 2);
    session.press("stop-solving");
    assert!(session.words("unsolved").unwrap().contains("The solve was stopped."));
    assert_eq!(session.areas(), ["…"; 5]);
    session.press("solve-again");
    for evader in Evader::ALL {
        session.solver(of(evader), Solving::Solved(SOLVED.of(evader).encode()));
    }
    session.evaluate("evaluator");
    session.evaluate("evaluator");
    assert!(session.words("p-4").unwrap().contains("1.000"));
}

#[test]
fn keys_change_the_moment() {
    let mut session = opened("/lab/explorer/p");
    session.key("ArrowRight");
    session.key("PageDown");
    session.key("KeyN");
    assert_eq!((session.seen("data-step"), session.seen("data-trial")), ("6".into(), "t1".into()));
    session.key("KeyC");
    assert!(session.linked().ends_with("t=1.2&colours=safe"));
    assert!(!session.page.owns_key("Tab"));
}
