//! Families of predicted sets on 400 recorded drives of **synthetic** participants.
#![allow(clippy::print_stdout, reason = "the table is worth reading")]

use crate::recorded;
use sidestep::bounds::ActionChoice;
use sidestep::safety::SafetyLevels;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::baselines::{
    Gaussian, Mode, Nominal, PerModeEmpirical, constant_velocity, hold_the_input,
    learned_disturbance, worst_case,
};
use sidestep::shfrs::family::Family;
use sidestep::shfrs::pareto::{Pareto, ParetoRow, ParetoSettings, pareto};
use sidestep::shfrs::scores::ShfrsFamily;
use sidestep::shfrs::widened::{tube_area_m2, widened};
use sidestep::shfrs::window::{Window, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;
use std::sync::OnceLock;

const STEPS: usize = 10;
const TARGETS: [f64; 3] = [0.75, 0.9, 0.95];

/// Compares all families on the split and the windows of `seed`.
fn compare(seed: u64, points: usize) -> Pareto {
    static SAFETY: OnceLock<SafetyLevels> = OnceLock::new();
    let parameters = SceneParameters::default();
    let safety = SAFETY.get_or_init(recorded::safety);
    let (predictor, sample) = recorded::split(&recorded::drives(), seed, safety);
    let human =
        || PredictedHuman::new(&predictor, safety, &parameters).expect("a model of three actions");
    let windows: Vec<Window<'_>> =
        WindowChoice::EveryStep.windows(&sample.training, STEPS).concat();
    let gaussian =
        |nominal| Gaussian::learn(nominal, &parameters, &windows).expect("enough windows");
    let empirical =
        |mode| PerModeEmpirical::learn(mode, &parameters, &windows).expect("enough windows");
    let model = human();
    let prediction = Prediction::new(&parameters, &model);
    let adaptive = |tau| {
        let choice = ActionChoice::Adaptive { tau, steps: STEPS };
        ShfrsFamily::new(prediction, &choice).expect("a choice")
    };
    let of_the_paper = ActionChoice::TopK(vec![2, 2, 1, 1, 1, 1, 1, 1, 1, 1]);
    let mut families: Vec<Box<dyn Family + Send + '_>> = vec![
        Box::new(adaptive(0.1)),
        Box::new(adaptive(0.2)),
        Box::new(ShfrsFamily::new(prediction, &of_the_paper).expect("a choice")),
        Box::new(worst_case(&parameters)),
        Box::new(constant_velocity(&parameters)),
        Box::new(hold_the_input(&parameters)),
        Box::new(learned_disturbance(&parameters, human())),
        Box::new(gaussian(Nominal::Straight)),
        Box::new(gaussian(Nominal::Held)),
        Box::new(empirical(Mode::MostLikely(human()))),
        Box::new(empirical(Mode::Held)),
    ];
    let choice = WindowChoice::RandomOne { seed };
    let settings =
        ParetoSettings::new(TARGETS.to_vec(), 0.95, choice, STEPS, points).expect("settings");
    pareto(&mut families, &sample.calibration, &sample.test, &settings).expect("a comparison")
}

/// The comparison that several tests use. It is computed only once.
fn compared() -> &'static Pareto {
    static COMPARED: OnceLock<Pareto> = OnceLock::new();
    COMPARED.get_or_init(|| compare(1, 60))
}

fn rows(family: &str) -> Vec<&'static ParetoRow> {
    let rows: Vec<_> = compared().rows.iter().filter(|row| row.family == family).collect();
    assert_eq!(rows.len(), TARGETS.len(), "{family}");
    rows
}

/// The worst-case set has an area of 16/3 m² (closed form of reference/shfrs), and contains every
/// trajectory.
#[test]
fn the_worst_case_holds_everything() {
    for row in rows("worst case") {
        assert_eq!((row.coverage, row.level), (1.0, 0.0));
        assert!((row.mean_area_m2 - 16.0 / 3.0).abs() < 1e-9);
    }
}

/// Conformal levels reach the target coverage on average. Over the splits of twelve seeds, the mean
/// coverage of a family is at most three standard errors below the target.
#[test]
fn calibrated_levels_cover_what_was_asked() {
    let splits: Vec<Pareto> = (0..12).map(|seed| compare(seed, 2)).collect();
    for (i, row) in splits[0].rows.iter().enumerate() {
        let mean = |value: &dyn Fn(&ParetoRow) -> f64| {
            splits.iter().map(|split| value(&split.rows[i])).sum::<f64>() / splits.len() as f64
        };
        let coverage = mean(&|row| row.coverage);
        let variance = mean(&|row| (row.coverage - coverage) * (row.coverage - coverage));
        let error = (variance / (splits.len() - 1) as f64).sqrt();
        let area = mean(&|row| row.mean_area_m2);
        println!(
            "{:32} p {:.2}  mean coverage {coverage:.3} ± {error:.3}  mean area {area:.2} m²",
            row.family, row.target
        );
        assert!(coverage >= row.target - 3.0 * error, "{row:?}: {coverage} ± {error}");
    }
}

/// The sets of each family are nested. More coverage therefore needs a higher level, and the area
/// does not decrease.
#[test]
fn areas_and_levels_grow_with_the_target() {
    let found = compared();
    for pair in found.rows.windows(2).filter(|pair| pair[0].family == pair[1].family) {
        assert!(pair[0].level <= pair[1].level, "{pair:?}");
        assert!(pair[0].mean_area_m2 <= pair[1].mean_area_m2 + 1e-9, "{pair:?}");
    }
    for curve in &found.curves {
        let covers: Vec<f64> = curve.points.iter().map(|point| point.coverage).collect();
        assert!(covers.is_sorted(), "{}: {covers:?}", curve.family);
    }
}

/// Nested sets have increasing areas. The bounds are a hard case for the front, because successive
/// steps exclude straight driving, with one bound that is close to 0 but not 0.
#[test]
fn areas_grow_with_the_level() {
    let rate = 0.5;
    let (right, left) = ((-rate, -rate), (rate, rate));
    let mut base = [right; 10];
    base[0] = (-rate, 0.0);
    (base[6], base[8], base[9]) = (left, left, left);
    let areas = [0.4, 0.45, 0.49, 0.494, 0.495, 0.4954, 0.498, 0.4999, 0.5].map(|epsilon| {
        let bounds = widened(&base, epsilon, (-rate, rate)).unwrap();
        tube_area_m2(&bounds, &SceneParameters::default()).unwrap()
    });
    for pair in areas.windows(2) {
        assert!(pair[0] <= pair[1] + 1e-3, "{areas:?}");
    }
    for curve in &compared().curves {
        for pair in curve.points.windows(2) {
            let (smaller, larger) = (pair[0].mean_area_m2, pair[1].mean_area_m2);
            assert!(smaller <= larger + 1e-3, "{}: {pair:?}", curve.family);
        }
    }
}

/// By the definition of a score, a window is inside at the level of its score. Therefore all
/// windows are inside at the level of the largest score.
#[test]
fn the_last_level_of_a_curve_holds_all() {
    for curve in &compared().curves {
        assert_eq!(curve.points.last().map(|point| point.coverage), Some(1.0), "{}", curve.family);
    }
}
