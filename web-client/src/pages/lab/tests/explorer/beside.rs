//! Tests of comparing areas and of tuning, in parallel with counting.

use super::*;
use crate::evaluation::CONFIDENCE;
use sidestep::bounds::Rollout;
use sidestep::chart::fixed;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::pareto::{Compared, POINTS, ParetoSettings, pareto};
use sidestep::shfrs::tuning::{Tuned, TuningSettings, candidates, tune};

const ONE: WindowChoice = WindowChoice::RandomOne { seed: 0 };

/// Opens the explorer, and finishes counting and comparing.
fn compared(path: &str) -> Session {
    let mut session = opened(path);
    session.evaluate("comparer");
    session
}

/// The settings that the controls show.
fn settings(session: &mut Session) -> ShfrsFile {
    session.press("save");
    serde_json::from_slice(&session.files.pop().unwrap().1).unwrap()
}

#[test]
fn areas_are_those_of_the_command_line() {
    let session = compared("/lab/explorer/p");
    let twin = session.words("areas-twin").unwrap();
    let expected = at_the_command_line(|prediction, parts, trajectories| {
        let sample = parts.sample(trajectories);
        let choice = PRESETS[0].settings(3).settings(3).unwrap().choice().clone();
        let compared = [Compared::Shfrs(choice)].into_iter().chain(Compared::BASELINES);
        let family = |it: Compared| it.family(prediction, &sample.training, 10).unwrap();
        let mut families: Vec<_> = compared.map(family).collect();
        // Three tasks are for calibration, which is too few for the other default coverages.
        let settings = ParetoSettings::new(vec![0.75], CONFIDENCE, ONE, 10, POINTS).unwrap();
        pareto(&mut families, &sample.calibration, &sample.test, &settings).unwrap()
    });
    assert_eq!((expected.rows.len(), expected.curves.len()), (8, 8));
    for row in &expected.rows {
        let coverage = [row.coverage, row.coverage_low, row.coverage_high].map(|p| fixed(p, 2));
        let [value, low, high] = coverage;
        let [level, area] = [fixed(row.level, 3), fixed(row.mean_area_m2, 2)];
        let words = [&row.family[..], "0.75", &level, &value, &low, &high, &area];
        let mut rest = &twin[twin.find(&row.family).unwrap()..];
        for word in words {
            let place = rest.find(word).unwrap_or_else(|| panic!("{word} of {row:?} in {rest}"));
            assert!(place < 40, "{word} of {row:?} in {rest}");
            rest = &rest[place + word.len()..];
        }
    }
    // There is one chart and one name for each family.
    let panels = session.words("panels").unwrap();
    assert!(expected.curves.iter().all(|curve| panels.matches(&curve.family).count() == 1));
}

#[test]
fn only_moves_that_matter_compare_again() {
    let mut session = compared("/lab/explorer/p");
    let before = session.words("areas-twin");
    session.slide("epsilon-0", 0.1);
    session.choose("rollout", "paper");
    session.evaluate("evaluator");
    let idle = |session: &mut Session| {
        let (evaluation, _) = session.evaluators.get_mut("comparer").unwrap();
        !evaluation.work(&mut |_| {}) && evaluation.report().is_none()
    };
    assert!(idle(&mut session));
    assert_eq!(session.words("areas-twin"), before);
    // After hundreds of changes, only one question is asked. It is asked when the sets of the last
    // change have been counted.
    for i in 0..300_u32 {
        session.slide("steps", f64::from(4 + i % 6));
        assert!(idle(&mut session));
    }
    session.evaluate("evaluator");
    assert!(!idle(&mut session), "a new question");
    session.evaluate("comparer");
    assert_ne!(session.words("areas-twin"), before);
    // A question in progress is dropped when the settings change again.
    session.slide("up-to-2", 3.0);
    session.evaluate("evaluator");
    session.slide("up-to-2", 4.0);
    assert!(idle(&mut session));
    assert_eq!(session.evaluators.len(), 2);
}

fn tuned(p: f64, guarantee: Guarantee) -> Tuned {
    at_the_command_line(|prediction, parts, trajectories| {
        let candidates = candidates(3, 10);
        let settings = TuningSettings::new(p, guarantee, candidates)
            .with_windows(ONE)
            .with_confidence(CONFIDENCE);
        tune(&parts.sample(trajectories), prediction, &settings).unwrap()
    })
}

#[test]
fn tuning_is_that_of_the_command_line() {
    let mut session = compared("/lab/explorer/p");
    for (guarantee, word, p) in
        [(Guarantee::Conformal, "conformal", 0.6), (Guarantee::Pac { delta: 0.05 }, "pac", 0.5)]
    {
        session.choose("guarantee", word);
        session.slide("aim", p);
        if word == "pac" {
            // pⁿ ≤ 0.05 needs n = 5 tasks, but only three are for calibration.
            let said = session.words("lacking").unwrap();
            assert!(
                said.contains("takes 5 tasks") && said.contains("3 of those are for calibration"),
                "{said}"
            );
            continue;
        }
        session.press("tune");
        assert_eq!(session.evaluators.len(), 3);
        session.evaluate("tuner");
        assert_eq!(session.evaluators.len(), 2, "the tuner is gone");
        let expected = tuned(p, guarantee);
        assert_eq!(session.words("statement").unwrap(), expected.statement);
        let found = session.words("found").unwrap();
        for words in [
            expected.choice.to_string(),
            format!("{} rad/s", fixed(expected.epsilon, 4)),
            format!("{} m²", fixed(expected.mean_area_m2, 3)),
            format!("other tasks stayed inside: {} (95 %", fixed(expected.coverage.value, 2)),
            format!("which agrees with p ≥ {p}"),
            "5 tasks chose the actions, 3 others set ε, and 4 others measured".to_owned(),
        ] {
            assert!(found.contains(&words), "{words} in {found}");
        }
        // The controls get exactly the tuned settings.
        let settings = settings(&mut session).settings(3).unwrap();
        assert_eq!(settings.epsilon()[0], expected.epsilon);
        assert_eq!((settings.choice(), settings.rollout()), (&expected.choice, Rollout::Base));
        assert!(session.words("in-use").is_some());
    }
}

#[test]
fn a_move_stops_tuning_and_what_was_found_comes_back() {
    let mut session = compared("/lab/explorer/p");
    session.press("tune");
    session.press("stop-tuning");
    assert!(!session.evaluators.contains_key("tuner"));
    session.press("tune");
    session.slide("steps", 8.0);
    assert!(!session.evaluators.contains_key("tuner") && session.words("found").is_none());
    session.press("tune");
    session.evaluate("tuner");
    let found = settings(&mut session);
    session.press("preset-1");
    assert_eq!(session.words("in-use"), None);
    session.press("use-found");
    assert!(session.words("in-use").is_some() && settings(&mut session).begins_with(&found));
    // Another predictor needs its own tuning.
    session.choose("choose-predictor", "constant");
    assert_eq!(session.words("found"), None);
}

#[test]
fn too_few_tasks_are_told_in_a_sentence() {
    let mut session = signed_in("/lab/explorer/p");
    let drives = usual();
    let two = Drives { tasks: drives.tasks[..2].to_vec(), ..drives };
    session.send("drives", 200, &two);
    session.answer(of(Evader::Human), 200, &exact().encode());
    session.evaluate("evaluator");
    session.evaluate("evaluator");
    assert!(!session.evaluators.contains_key("comparer"));
    for place in ["not-comparable", "lacking"] {
        let said = session.words(place).unwrap();
        assert!(said.contains("takes 3 tasks") && said.contains("about 10 in all"), "{said}");
        assert!(said.contains("Of the 2 tasks") && said.contains("0 of those are for"), "{said}");
    }
    assert!(session.page.view().find("leave-tasks-aside").is_none());
    assert!(session.words("p-4").unwrap().contains("1.000"));
    // A predictor trained on almost all tasks leaves too few tasks for calibration. Another
    // predictor leaves enough.
    let mut session = arrived("/lab/explorer/p?trial=t11&predictor=earlier");
    let predictor = Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], vec![0.2, 0.5, 0.3]);
    let answer = TrainedPredictor {
        predictor: PredictorFile::from(&predictor.unwrap()),
        trials: 11,
        fallback: None,
        trained_on: (0..11).map(|i| format!("t{i}")).collect(),
        source: None,
    };
    session.send("predictor", 200, &answer);
    session.evaluate("evaluator");
    let said = session.words("not-comparable").unwrap();
    assert!(said.contains("1 did not train the predictor"), "{said}");
    session.press("leave-tasks-aside");
    session.evaluate("evaluator");
    session.evaluate("evaluator");
    session.evaluate("comparer");
    assert!(session.words("not-comparable").is_none() && session.words("lacking").is_none());
    assert!(session.words("areas-words").is_some());
    // Tuning also fails if it needs more steps than the tasks have.
    let mut session = compared("/lab/explorer/p");
    session.slide("steps", 100.0);
    session.evaluate("evaluator");
    session.press("tune");
    session.evaluate("tuner");
    let said = session.words("not-tuned").unwrap();
    assert!(said.contains("steps: expected at most 50"), "{said}");
}
