//! Families of predicted sets on 400 recorded drives of **synthetic** people
//! (`data/README.md`): the numbers compare software, they say nothing about people.
#![allow(clippy::print_stdout, reason = "the table is worth reading")]

use sidestep::bounds::ActionChoice;
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
use sidestep::shfrs::pareto::{Pareto, ParetoRow, ParetoSettings, pareto};
use sidestep::shfrs::prediction::Prediction;
use sidestep::shfrs::scores::ShfrsFamily;
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
        let model = human();
        let prediction = Prediction::new(&parameters, &model);
        let shfrs = |choice| ShfrsFamily::new(prediction, &choice).unwrap();
        let mut families: Vec<Box<dyn Family + Send + '_>> = vec![
            Box::new(shfrs(ActionChoice::Adaptive { tau: 0.1, steps: STEPS })),
            Box::new(shfrs(ActionChoice::TopK(vec![2, 2, 1, 1, 1, 1, 1, 1, 1, 1]))),
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

fn rows(family: &str) -> Vec<&'static ParetoRow> {
    let rows: Vec<_> = compared().rows.iter().filter(|row| row.family == family).collect();
    assert_eq!(rows.len(), TARGETS.len(), "{family}");
    rows
}

#[test]
fn the_table() {
    for row in &compared().rows {
        println!(
            "{:32} p {:.2}  level {:.3}  coverage {:.3} [{:.3}, {:.3}]  {:.2} m²",
            row.family,
            row.target,
            row.level,
            row.coverage,
            row.coverage_low,
            row.coverage_high,
            row.mean_area_m2
        );
    }
}

/// The area of everything is 16/3 m² (reference/shfrs: closed form), and it holds all.
#[test]
fn the_worst_case_holds_everything() {
    for row in rows("worst case") {
        assert_eq!((row.coverage, row.level), (1.0, 0.0));
        assert!((row.mean_area_m2 - 16.0 / 3.0).abs() < 1e-9);
    }
}

/// Calibrated on 120 exchangeable trajectories and judged on as many: coverage falls short of
/// the target by chance only. The coverage of a conformal level is Beta(r, n + 1 − r), that
/// on the test part binomial about it: together a standard deviation of at most
/// √(2 p (1 − p)/120), and 8 families are looked at.
#[test]
fn calibrated_levels_cover_what_was_asked() {
    for row in &compared().rows {
        let deviation = (2.0 * row.target * (1.0 - row.target) / 120.0).sqrt();
        assert!(row.coverage >= row.target - 3.0 * deviation, "{row:?}");
        assert!(row.coverage_low <= row.coverage && row.coverage <= row.coverage_high);
    }
}

/// Every family is nested: more coverage needs a higher level and no less area.
#[test]
fn areas_and_levels_grow_with_the_target() {
    let found = compared();
    for pair in found.rows.windows(2).filter(|pair| pair[0].family == pair[1].family) {
        assert!(pair[0].level <= pair[1].level, "{pair:?}");
        assert!(pair[0].mean_area_m2 <= pair[1].mean_area_m2 + 1e-9, "{pair:?}");
    }
    for curve in &found.curves {
        for pair in curve.points.windows(2) {
            assert!(pair[0].coverage <= pair[1].coverage, "{}: {pair:?}", curve.family);
            let (smaller, larger) = (pair[0].mean_area_m2, pair[1].mean_area_m2);
            assert!(smaller <= larger + 1e-3, "{}: {pair:?}", curve.family);
        }
    }
}

/// What a score means: at that level the window is inside, so all windows of the largest
/// score's level are.
#[test]
fn the_last_level_of_a_curve_holds_all() {
    for curve in &compared().curves {
        assert_eq!(curve.points.last().map(|point| point.coverage), Some(1.0), "{}", curve.family);
    }
}
