//! Logistic regression against scikit-learn and against itself.

mod learning;

use learning::{Lr, PEOPLE, WIDTH, classes, peer, peer_by_newton, person, said};
use sidestep::learn::logistic::{LogisticSettings, fit, fit_path};
use sidestep::learn::samples::Samples;
use sidestep::math::SeededRng;
use sidestep::predict::logistic::Logistic;
use sidestep::predict::scale::Scale;

fn furthest<'a>(
    found: impl IntoIterator<Item = &'a f64>,
    expected: impl IntoIterator<Item = &'a f64>,
) -> f64 {
    found.into_iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn numbers(model: &Logistic) -> Vec<f64> {
    let weights = model.coefficients().concat();
    weights.into_iter().chain(model.intercepts().to_vec()).collect()
}

/// The models' own reference stops where its solver (L-BFGS) cannot see the loss fall any
/// more: up to 7·10⁻⁶ short in a weight. scikit-learn's Newton solver goes to the end.
const SOLVER_STOPS_SHORT: f64 = 7e-6;

fn agrees_with_scikit_learn(experiment: usize) {
    for participant in 0..PEOPLE {
        let (training, test) = person(participant, experiment);
        let peer = peer(participant, experiment);
        let scale = Scale::fit(WIDTH, &training.values);
        assert!(furthest(scale.mean(), &peer.mean) < 1e-9);
        assert!(furthest(scale.scale(), &peer.scale) < 1e-9);
        let standard = training.on(&scale);
        let samples = standard.samples(experiment);
        let check = |model: &Logistic, expected: &Lr, tolerance: f64| {
            // Of two classes, scikit-learn writes down the second's weights only.
            let skip = classes(experiment) - expected.coef.len();
            let found = model.coefficients()[skip..].concat();
            let apart = furthest(&found, expected.coef.iter().flatten());
            assert!(apart < tolerance, "{participant}: weights {apart:e} apart");
            let apart = furthest(&model.intercepts()[skip..], &expected.intercept);
            assert!(apart < tolerance, "{participant}: intercepts {apart:e} apart");
        };
        for c in [1e-3, 1.0, 1e2] {
            let model = fit(&samples, c, LogisticSettings::default()).expect("a fit");
            check(&model, &peer_by_newton(participant, experiment, c), 1e-9);
        }
        let model = fit(&samples, 1.0, LogisticSettings::default()).expect("a fit");
        check(&model, &peer.lr, SOLVER_STOPS_SHORT);

        let rows = said(participant, experiment);
        assert_eq!(rows.len(), 500);
        let mut found = vec![0.0; classes(experiment)];
        for ((place, values), row) in
            test.places.iter().zip(test.values.chunks_exact(WIDTH)).zip(&rows)
        {
            assert_eq!((place.0 as f64, place.1 as f64), (row["trial"], row["step"]));
            model.probabilities_into(&scale, values, &mut found);
            assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            for (class, p) in found.iter().enumerate() {
                assert!((p - row[&format!("lr_p{class}")]).abs() < 1e-6);
            }
        }
    }
}

#[test]
fn which_way_agrees_with_scikit_learn() {
    agrees_with_scikit_learn(1);
}

#[test]
fn whether_agrees_with_scikit_learn() {
    agrees_with_scikit_learn(2);
}

const STRENGTHS: [f64; 6] = [1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2];

#[test]
fn a_path_ends_where_fits_on_their_own_do() {
    for experiment in [1, 2] {
        let rows = person(3, experiment).0;
        let scale = Scale::fit(WIDTH, &rows.values);
        let rows = rows.on(&scale);
        let samples = rows.samples(experiment);
        let settings = LogisticSettings::default();
        let path = fit_path(&samples, &STRENGTHS, settings).unwrap();
        assert_eq!(path.len(), STRENGTHS.len());
        for (&c, model) in STRENGTHS.iter().zip(&path) {
            let alone = numbers(&fit(&samples, c, settings).unwrap());
            let apart = furthest(&numbers(model), &alone);
            assert!(apart < 1e-9, "C = {c}: {apart:e} apart");
        }
        // Backwards, and with repetitions and jumps.
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
        let rows = person(5, experiment).0;
        let scale = Scale::fit(WIDTH, &rows.values);
        let rows = rows.on(&scale);
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

    // A column of zeros, as a constant one is after standardising, gets no weight.
    let values = [[1.0, 0.0], [0.5, 0.0], [-1.0, 0.0], [0.2, 0.0]].concat();
    let samples = Samples::new(2, &values, &[0, 1, 2, 1], 3).unwrap();
    for model in fit_path(&samples, &[1.0, 1e6, 1e-6], LogisticSettings::default()).unwrap() {
        assert!(model.coefficients().iter().all(|row| row[1] == 0.0));
    }
}

#[test]
fn two_rows_are_enough() {
    // By symmetry the intercept is 0 and w solves w = C · 2 / (1 + e^w).
    let samples = Samples::new(1, &[-1.0, 1.0], &[0, 1], 2).unwrap();
    let model = fit(&samples, 1.0, LogisticSettings::default()).unwrap();
    let w = model.coefficients()[1][0];
    assert!((w - 2.0 / (1.0 + sidestep::math::exp(w))).abs() < 1e-12);
    assert!(model.intercepts()[1].abs() < 1e-12);
}

#[test]
fn weights_of_three_classes_sum_to_zero() {
    let rows = person(1, 1).0;
    let scale = Scale::fit(WIDTH, &rows.values);
    let rows = rows.on(&scale);
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
