//! The library against numbers that were found elsewhere (`tests/data/README.md`).

use sidestep::features::FeatureSet;
use sidestep::predict::logistic::{Logistic, LogisticSettings};
use sidestep::predict::scale::Scale;
use sidestep::reachability::ExactValue;

/// The rows of a CSV file without its header, as numbers.
fn numbers(text: &str) -> Vec<Vec<f64>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    reader.deserialize().map(|row| row.expect("a row of numbers")).collect()
}

fn check_states(game: ExactValue, text: &str) {
    let rows = numbers(text);
    assert_eq!(rows.len(), 2000);
    for row in rows {
        let (state, expected) = ([row[0], row[1], row[2]], row[3]);
        let found = game.value(state);
        assert!((found - expected).abs() <= 1e-9, "V{state:?} = {found}, not {expected}");
    }
}

#[test]
fn exact_values_of_the_papers_game() {
    let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
    check_states(game, include_str!("data/states_paper.csv"));
}

#[test]
fn exact_values_of_mitchells_game() {
    let game = ExactValue::new(5.0, 1.0, 5.0).unwrap();
    check_states(game, include_str!("data/states_mitchell.csv"));
}

#[derive(serde::Deserialize)]
struct ScikitLearn {
    mean: Vec<f64>,
    scale: Vec<f64>,
    lr: Fit,
}

#[derive(serde::Deserialize)]
struct Fit {
    coef: Vec<Vec<f64>>,
    intercept: Vec<f64>,
}

#[test]
fn logistic_regression_agrees_with_scikit_learn() {
    let width = FeatureSet::subset("hrd").unwrap().len();
    let rows = numbers(include_str!("data/features_participant0.csv"));
    let expected: ScikitLearn =
        serde_json::from_str(include_str!("data/sklearn_logistic.json")).unwrap();
    // Columns: trial, step, the features, exp. I label, exp. II label.
    let train: Vec<_> = rows.iter().filter(|row| row[0] < 40.0).collect();
    let values: Vec<f64> = train.iter().flat_map(|row| &row[2..2 + width]).copied().collect();
    let labels: Vec<usize> = train.iter().map(|row| (row[2 + width] + 1.0) as usize).collect();
    let scale = Scale::fit(width, &values);
    for j in 0..width {
        assert!((scale.mean()[j] - expected.mean[j]).abs() < 1e-9);
        assert!((scale.scale()[j] - expected.scale[j]).abs() < 1e-9);
    }
    let standard: Vec<f64> =
        values.iter().enumerate().map(|(i, &v)| scale.apply(i % width, v)).collect();
    let model = Logistic::fit(width, &standard, &labels, 3, LogisticSettings::default()).unwrap();
    // scikit-learn's solver leaves the sum of the intercepts where it began: at zero, as ours.
    for (class, row) in model.coefficients().iter().enumerate() {
        for (found, expected) in row.iter().zip(&expected.lr.coef[class]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        assert!((model.intercepts()[class] - expected.lr.intercept[class]).abs() < 1e-6);
    }
    let probabilities = numbers(include_str!("data/sklearn_logistic_probabilities.csv"));
    assert_eq!(probabilities.len(), 500);
    for expected in probabilities {
        let row = rows.iter().find(|row| row[..2] == expected[..2]).unwrap();
        let mut found = [0.0; 3];
        model.probabilities_into(&scale, &row[2..2 + width], &mut found);
        for (found, expected) in found.iter().zip(&expected[2..]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }
}
