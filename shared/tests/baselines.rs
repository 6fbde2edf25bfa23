//! Families of predicted sets on 400 recorded drives of **synthetic** people
//! (`data/README.md`): the numbers compare software, they say nothing about people.
#![allow(clippy::print_stdout, reason = "the table is worth reading")]

use sidestep::dataset::Dataset;
use sidestep::features::{FeatureSet, SafetyFunctions};
use sidestep::predict::Predictor;
use sidestep::predict::logistic::{Logistic, LogisticSettings};
use sidestep::predict::scale::Scale;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::baselines::{
    Gaussian, Mode, Nominal, PerModeEmpirical, constant_velocity, hold_the_input,
    learned_disturbance, worst_case,
};
use sidestep::shfrs::family::Family;
use sidestep::shfrs::pareto::{Pareto, ParetoSettings, pareto};
use sidestep::shfrs::window::{Trajectory, Window, WindowChoice};
use sidestep::vehicle::{Pose, TurnInput};
use std::ops::ControlFlow;
use std::sync::OnceLock;

const STEPS: usize = 10;
const TARGETS: [f64; 3] = [0.75, 0.9, 0.95];

/// One drive: the inputs and the states before each of them.
type Drive = (Vec<TurnInput>, Vec<JointState>);

/// The drives of the file, 50 of each of eight participants.
fn drives() -> Vec<Drive> {
    let mut reader = csv::Reader::from_reader(&include_bytes!("data/trials.csv")[..]);
    let mut drives: Vec<Drive> = Vec::new();
    let mut last = None;
    for row in reader.deserialize() {
        let row: [f64; 11] = row.expect("a row of numbers");
        if last != Some([row[0], row[1]]) {
            drives.push((Vec::new(), Vec::new()));
            last = Some([row[0], row[1]]);
        }
        let (inputs, states) = drives.last_mut().expect("a drive");
        inputs.push(TurnInput::try_from((2.0 * row[10]) as i64).expect("a turn rate"));
        let (human, robot) = (Pose::new(row[4], row[5], row[6]), Pose::new(row[7], row[8], row[9]));
        states.push(JointState { human, robot });
    }
    drives
}

/// The drive as a trajectory: its last input leads to no recorded state.
fn trajectory((inputs, states): &Drive) -> Trajectory {
    let human = SceneParameters::default().human;
    let rates = inputs[..inputs.len() - 1].iter().map(|&input| human.turn_rate(input));
    Trajectory::new(states.clone(), rates.collect()).unwrap()
}

/// Training, calibration and test: trials 0–19, 20–34 and 35–49 of each participant.
struct Split {
    training: Vec<Drive>,
    calibration: Vec<Trajectory>,
    test: Vec<Trajectory>,
}

fn split() -> Split {
    let mut parts = Split { training: Vec::new(), calibration: Vec::new(), test: Vec::new() };
    for (i, drive) in drives().into_iter().enumerate() {
        match i % 50 {
            0..20 => parts.training.push(drive),
            20..35 => parts.calibration.push(trajectory(&drive)),
            _ => parts.test.push(trajectory(&drive)),
        }
    }
    parts
}

fn train(safety: &SafetyFunctions, drives: &[Drive]) -> Predictor {
    let features = FeatureSet::subset("hrd").unwrap();
    let rows = drives.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
    let data = Dataset::from_trials(&features, safety, rows);
    let width = features.len();
    let scale = Scale::fit(width, &data.values);
    let values: Vec<f64> =
        data.values.iter().enumerate().map(|(i, &v)| scale.apply(i % width, v)).collect();
    let labels: Vec<usize> = data.labels.iter().map(|label| (label.sign() + 1) as usize).collect();
    let model = Logistic::fit(width, &values, &labels, 3, LogisticSettings::default()).unwrap();
    Predictor::logistic(features, vec![-1, 0, 1], scale, model)
}

/// The comparison of every family, done once.
fn compared() -> &'static Pareto {
    static COMPARED: OnceLock<Pareto> = OnceLock::new();
    COMPARED.get_or_init(|| {
        let parameters = SceneParameters::default();
        let progress = &mut |_| ControlFlow::Continue(());
        let safety = SafetyFunctions::solve(&parameters, progress).unwrap();
        let Split { training, calibration, test } = split();
        let predictor = train(&safety, &training);
        let human = || PredictedHuman::new(&predictor, &safety, &parameters);
        let training: Vec<Trajectory> = training.iter().map(trajectory).collect();
        let windows: Vec<Window<'_>> = WindowChoice::EveryStep.windows(&training, STEPS).concat();
        let gaussian = |nominal| Gaussian::learn(nominal, &parameters, &windows).unwrap();
        let empirical = |mode| PerModeEmpirical::learn(mode, &parameters, &windows).unwrap();
        let mut families: Vec<Box<dyn Family + Send + '_>> = vec![
            Box::new(worst_case(&parameters)),
            Box::new(constant_velocity(&parameters)),
            Box::new(hold_the_input(&parameters)),
            Box::new(learned_disturbance(&parameters, human())),
            Box::new(gaussian(Nominal::Straight)),
            Box::new(gaussian(Nominal::Held)),
            Box::new(empirical(Mode::MostLikely(human()))),
            Box::new(empirical(Mode::Held)),
        ];
        let choice = WindowChoice::RandomOne { seed: 1 };
        let settings = ParetoSettings::new(TARGETS.to_vec(), 0.95, choice, STEPS, 60).unwrap();
        pareto(&mut families, &calibration, &test, &settings).unwrap()
    })
}

#[test]
fn the_table() {
    let found = compared();
    for row in &found.rows {
        println!(
            "{:30} {:.2} level {:.3} coverage {:.3} [{:.3}, {:.3}] area {:.3}",
            row.family,
            row.target,
            row.level,
            row.coverage,
            row.coverage_low,
            row.coverage_high,
            row.mean_area_m2
        );
    }
    if let Some(file) = option_env!("PARETO_JSON") {
        std::fs::write(file, serde_json::to_string(found).unwrap()).unwrap();
    }
}
