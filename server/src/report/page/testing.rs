//! A small made-up analysis, for tests.

use sidestep::behaviour::Behaviour;
use sidestep::comparison::cell::{Baseline, Cell, Experiment};
use sidestep::comparison::decision_map::DecisionMap;
use sidestep::comparison::metrics::Predictions;
use sidestep::comparison::models::ModelName;
use sidestep::comparison::rollout::Horizon;
use sidestep::comparison::sets::NamedSet;
use sidestep::comparison::tables::{ComparedParticipant, Comparison};
use sidestep::comparison::{Analysis, DataSummary, Leakage, Results, RolloutsOf, Settings};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::recording::Exclusion;
use sidestep::scene::SceneParameters;
use std::collections::BTreeMap;

/// Number of steps of a trial.
const STEPS: usize = 10;
const TRIALS: usize = 2;

/// People who turn in steps 3 to 6 of each trial. Models miss two steps of each trial on the set d,
/// and one step on all other sets. For every second person, they miss one more step. Models always
/// find the first step of avoidance.
pub(super) fn made_up(people: usize, synthetic: Option<&str>) -> Analysis {
    made_up_but(people, synthetic, |_| {})
}

/// Like [`made_up`], with results modified by `change`.
pub(super) fn made_up_but(
    people: usize,
    synthetic: Option<&str>,
    change: impl FnOnce(&mut Results),
) -> Analysis {
    let sets = NamedSet::papers().unwrap().into_iter().chain(NamedSet::with_body_frame().unwrap());
    let sets: Vec<NamedSet> = sets.collect();
    let mut cells = Vec::new();
    for model in ModelName::ALL {
        for experiment in Experiment::ALL {
            for set in &sets {
                for participant in 0..people {
                    let missed = 1 + usize::from(set.name == "d") + participant % 2;
                    cells.push(cell(model, experiment, set, participant, missed));
                }
            }
        }
    }
    let participant = |i| ComparedParticipant {
        name: if i == 0 { "<script>alert(1)</script>".to_owned() } else { format!("person {i}") },
        test_trials: (40..).take(TRIALS).collect(),
        training_trials: (0..5).collect(),
        steps: STEPS,
    };
    let participants = (0..people).map(participant).collect();
    let baselines = Experiment::ALL.into_iter().flat_map(|experiment| {
        (0..people).map(move |participant| Baseline {
            experiment,
            participant,
            test: predictions(experiment, STEPS),
        })
    });
    let excluded = Exclusion::new(
        "<img src=x onerror=alert(2)> & \"co\"",
        "3 tasks, at least 5 are needed".to_owned(),
    );
    let mut results = Results {
        comparison: Comparison { participants, cells },
        baselines: baselines.collect(),
        rollouts: ["svm", "dt", "lr", "held_input", "straight"].map(rollouts).to_vec(),
        leakage: vec![Leakage {
            model: ModelName::Svm,
            experiment: Experiment::TurnDirection,
            grouped: 70.25,
            leaking: 91.5,
        }],
        few_tasks: Vec::new(),
        unseen: Vec::new(),
        importance: Vec::new(),
        exclusions: Vec::new(),
    };
    change(&mut results);
    let map = DecisionMap {
        features: "hrd",
        heading: 3.0,
        encounter: "head-on",
        probabilities: (0..DecisionMap::SIDE * DecisionMap::SIDE)
            .map(|cell| cell as f64 / (DecisionMap::SIDE * DecisionMap::SIDE) as f64)
            .collect(),
        boundary: vec![vec![[3.0, 0.0], [0.0, 3.0], [-3.0, 0.0], [0.0, -3.0]]],
    };
    let data = DataSummary {
        trials: 7 * people,
        scene: SceneParameters::default(),
        synthetic: synthetic.map(str::to_owned),
        is_mixed: false,
        exclusions: vec![excluded],
        flagged: BTreeMap::new(),
        same_trials: Vec::new(),
        copied_trials: Vec::new(),
        sha256: "0".repeat(64),
        driven_at_ms: Some([0.0, 90_000_000.0]),
        safety: None,
    };
    let behaviour = Behaviour::of(&data.scene, []);
    Analysis::of(data, Settings::new().unwrap(), results, behaviour, vec![map]).unwrap()
}

/// The predictions of a model that misses the last steps of the turn.
fn predictions(experiment: Experiment, missed: usize) -> Predictions {
    let turn = 1;
    let truth = |step: &usize| if (3..7).contains(step) { turn } else { 0 };
    let predicted =
        |step: &usize| if (3..7usize.saturating_sub(missed)).contains(step) { turn } else { 0 };
    let steps: Vec<usize> = (0..TRIALS).flat_map(|_| 0..STEPS).collect();
    let classes = experiment.classes().to_vec();
    let others = 0.3 / (classes.len() - 1) as f64;
    let of_step = |step: &usize| {
        let named = predicted(step);
        classes
            .iter()
            .map(move |class| if *class == named { 0.7 } else { others })
            .collect::<Vec<_>>()
    };
    Predictions {
        truth: steps.iter().map(truth).collect(),
        predicted: steps.iter().map(predicted).collect(),
        probabilities: steps.iter().flat_map(of_step).collect(),
        classes,
    }
}

fn cell(
    model: ModelName,
    experiment: Experiment,
    set: &NamedSet,
    participant: usize,
    missed: usize,
) -> Cell {
    let classes = experiment.classes().to_vec();
    let shares = vec![1.0 / classes.len() as f64; classes.len()];
    let constant = Predictor::constant(set.features.clone(), classes, shares).unwrap();
    Cell {
        model,
        experiment,
        features: set.name.clone(),
        participant,
        cv_accuracy: 0.5,
        hyperparameters: "{}".to_owned(),
        test: predictions(experiment, missed),
        predictor: PredictorFile::from(&constant),
    }
}

fn rollouts(driver: &str) -> RolloutsOf {
    let features = if driver.contains('_') || driver == "straight" { "" } else { "hrd" };
    let horizon = |i: usize| Horizon {
        windows: 100,
        right: 90 - i,
        log_loss: 50.0,
        distance_m: 0.5 * i as f64,
    };
    RolloutsOf {
        driver: driver.to_owned(),
        features: features.to_owned(),
        horizons: (1..=5).map(horizon).collect(),
    }
}
