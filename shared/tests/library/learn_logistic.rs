//! Logistic regression, compared with scikit-learn and checked for consistency.

use crate::learning::apart::{self, furthest};
use crate::learning::{PEOPLE, WIDTH, classes, person};
use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_logistic::{LogisticRegression, MultiLogisticRegression};
use ndarray::{Array1, Array2};
use sidestep::learn::logistic::{LogisticSettings, fit, fit_path};
use sidestep::learn::samples::Samples;
use sidestep::math::SeededRng;
use sidestep::predict::logistic::Logistic;

fn numbers(model: &Logistic) -> Vec<f64> {
    let weights = model.coefficients().concat();
    weights.into_iter().chain(model.intercepts().to_vec()).collect()
}

/// The reference's solver (L-BFGS) stops when it can no longer detect a decrease of the loss. Its
/// weights are then wrong by up to 7·10⁻⁶. scikit-learn's Newton solver converges fully.
const SOLVER_STOPS_SHORT: f64 = 7e-6;

fn agrees_with_scikit_learn(experiment: usize) {
    let apart = apart::logistic(experiment);
    assert!(apart.scale < 1e-9, "{:e}", apart.scale);
    assert!(apart.newton < 1e-9, "{:e}", apart.newton);
    assert!(apart.lbfgs < SOLVER_STOPS_SHORT, "{:e}", apart.lbfgs);
    assert!(apart.probability < 1e-6, "{:e}", apart.probability);
    assert_eq!(apart.probabilities, 500 * PEOPLE * classes(experiment));
}

#[test]
fn which_way_agrees_with_scikit_learn() {
    agrees_with_scikit_learn(1);
}

#[test]
fn whether_agrees_with_scikit_learn() {
    agrees_with_scikit_learn(2);
}

/// Compares with another library, linfa, on the same rows. It runs L-BFGS until the gradient is
/// 10⁻⁹ or the line search makes no more progress. Its penalty is 1/C and, like ours, does not
/// include the intercepts.
#[test]
fn linfa_finds_the_same_models() {
    let mut apart = 0.0_f64;
    for (participant, c) in [(0, 0.1), (3, 1.0), (6, 10.0)] {
        for experiment in [1, 2] {
            let (_, rows) = person(participant, experiment).0.standardised();
            let model = fit(&rows.samples(experiment), c, LogisticSettings::default()).unwrap();
            let shape = (rows.labels.len(), WIDTH);
            let values = Array2::from_shape_vec(shape, rows.values.clone()).unwrap();
            let data = DatasetBase::new(values, Array1::from(rows.labels.clone()));
            let (weights, intercepts) = if experiment == 1 {
                let other = MultiLogisticRegression::default()
                    .alpha(1.0 / c)
                    .max_iterations(10_000)
                    .gradient_tolerance(1e-9)
                    .fit(&data)
                    .unwrap();
                assert_eq!(other.classes(), [0, 1, 2]);
                // The shape is features × classes.
                let weights = other.params().t().iter().copied().collect();
                (weights, other.intercept().to_vec())
            } else {
                let other = LogisticRegression::default()
                    .alpha(1.0 / c)
                    .max_iterations(10_000)
                    .gradient_tolerance(1e-9)
                    .fit(&data)
                    .unwrap();
                let sign = if other.labels().pos.class == 1 { 1.0 } else { -1.0 };
                let weights: Vec<f64> = other.params().iter().map(|w| sign * w).collect();
                (weights, vec![sign * other.intercept()])
            };
            let skip = classes(experiment) - intercepts.len();
            let found = model.coefficients()[skip..].concat();
            apart = apart.max(furthest(&found, &weights));
            apart = apart.max(furthest(&model.intercepts()[skip..], &intercepts));
        }
    }
    assert!(apart < 1e-6, "{apart:e}");
}

const STRENGTHS: [f64; 6] = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2];

#[test]
fn a_path_ends_where_fits_on_their_own_do() {
    for experiment in [1, 2] {
        let (_, rows) = person(3, experiment).0.standardised();
        let samples = rows.samples(experiment);
        let settings = LogisticSettings::default();
        let path = fit_path(&samples, &STRENGTHS, settings).unwrap();
        assert_eq!(path.len(), STRENGTHS.len());
        for (&c, model) in STRENGTHS.iter().zip(&path) {
            let alone = numbers(&fit(&samples, c, settings).unwrap());
            let apart = furthest(&numbers(model), &alone);
            assert!(apart < 1e-9, "C = {c}: {apart:e} apart");
        }
        // The values of C can also be in any order, with repetitions and jumps.
        let order = [1e2, 1e2, 1e-3, 1.0];
        for (&c, model) in order.iter().zip(fit_path(&samples, &order, settings).unwrap()) {
            let alone = numbers(&fit(&samples, c, settings).unwrap());
            assert!(furthest(&numbers(&model), &alone) < 1e-9, "C = {c}");
        }
    }
}

#[test]
fn the_order_of_rows_changes_rounding_only() {
    for experiment in [1, 2] {
        let (_, rows) = person(5, experiment).0.standardised();
        let order = SeededRng::new(4).permutation(rows.labels.len());
        let values: Vec<f64> =
            order.iter().flat_map(|&i| &rows.values[i * WIDTH..][..WIDTH]).copied().collect();
        let labels: Vec<usize> = order.iter().map(|&i| rows.labels[i]).collect();
        let permuted = Samples::new(WIDTH, &values, &labels, classes(experiment)).unwrap();
        for c in STRENGTHS {
            let model = |samples| numbers(&fit(samples, c, LogisticSettings::default()).unwrap());
            let apart = furthest(&model(&rows.samples(experiment)), &model(&permuted));
            assert!(apart < 1e-12, "C = {c}: {apart:e} apart");
        }
    }
}

#[test]
fn separable_duplicated_and_constant_data_converge() {
    let values = [[1.0, 2.0], [1.0, 2.0], [-1.0, 2.0], [-1.0, 2.0]].concat();
    let samples = Samples::new(2, &values, &[0, 0, 1, 1], 2).unwrap();
    let model = fit(&samples, 1e3, LogisticSettings::default()).unwrap();
    assert!(model.coefficients()[1][0] < -1.0);
    assert_eq!(model.coefficients()[0], [0.0, 0.0]);

    // A column of zeros, such as a standardised constant column, gets no weight.
    let values = [[1.0, 0.0], [0.5, 0.0], [-1.0, 0.0], [0.2, 0.0]].concat();
    let samples = Samples::new(2, &values, &[0, 1, 2, 1], 3).unwrap();
    for model in fit_path(&samples, &[1.0, 1e6, 1e-6], LogisticSettings::default()).unwrap() {
        assert!(model.coefficients().iter().all(|row| row[1] == 0.0));
    }
}

#[test]
fn two_rows_are_enough() {
    // By symmetry, the intercept is 0, and w solves w = C · 2 / (1 + e^w).
    let samples = Samples::new(1, &[-1.0, 1.0], &[0, 1], 2).unwrap();
    let model = fit(&samples, 1.0, LogisticSettings::default()).unwrap();
    let w = model.coefficients()[1][0];
    assert!((w - 2.0 / (1.0 + sidestep::math::exp(w))).abs() < 1e-12);
    assert!(model.intercepts()[1].abs() < 1e-12);
}

#[test]
fn weights_of_three_classes_sum_to_zero() {
    let (_, rows) = person(1, 1).0.standardised();
    let model = fit(&rows.samples(1), 0.1, LogisticSettings::default()).unwrap();
    for j in 0..WIDTH {
        assert!(model.coefficients().iter().map(|row| row[j]).sum::<f64>().abs() < 1e-13);
    }
    assert!(model.intercepts().iter().sum::<f64>().abs() < 1e-13);
}

#[test]
fn what_cannot_be_learnt_is_refused() {
    let complain = |labels: &[usize], classes, c| {
        let samples = Samples::new(1, &[1.0, 2.0], labels, classes).unwrap();
        fit(&samples, c, LogisticSettings::default()).unwrap_err().field
    };
    assert_eq!(complain(&[0, 0], 1, 1.0), "classes");
    assert_eq!(complain(&[0, 0], 2, 1.0), "labels");
    assert_eq!(complain(&[0, 1], 3, 1.0), "labels");
    assert_eq!(complain(&[0, 1], 2, 0.0), "c");
    assert_eq!(complain(&[0, 1], 2, f64::NAN), "c");
}
