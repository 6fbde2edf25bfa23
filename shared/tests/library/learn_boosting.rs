//! Gradient-boosted trees, compared with their definition and checked for consistency.

use crate::learning::{WIDTH, classes, person};
use proptest::prelude::*;
use sidestep::learn::boosting::{BoostingSettings, fit, fit_by_folds};
use sidestep::learn::samples::Samples;
use sidestep::math::{SeededRng, ln};
use sidestep::predict::boosting::{Boosted, BoostedFile};

fn log_loss(model: &Boosted, values: &[f64], labels: &[usize], classes: usize) -> f64 {
    let mut p = vec![0.0; classes];
    let rows = values.chunks_exact(values.len() / labels.len()).zip(labels);
    let loss = rows.map(|(row, &label)| {
        model.probabilities_into(row, &mut p);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        -ln(p[label])
    });
    loss.sum::<f64>() / labels.len() as f64
}

#[test]
fn the_deviance_falls_round_after_round() {
    for experiment in [1, 2] {
        let rows = person(4, experiment).0;
        let settings = BoostingSettings::default().with_rounds(100);
        let model = fit(&rows.samples(experiment), &settings).unwrap();
        assert_eq!(model.rounds(), 100);
        let loss = |rounds| {
            log_loss(&model.truncated(rounds), &rows.values, &rows.labels, classes(experiment))
        };
        for round in 1..=100 {
            assert!(loss(round) < loss(round - 1), "round {round}");
        }
        // Before the first round, the loss is the entropy of the classes, up to Laplace's rule.
        let n = rows.labels.len() as f64;
        let entropy: f64 = rows
            .samples(experiment)
            .counts()
            .iter()
            .map(|&count| {
                let p = count as f64 / n;
                -p * ln(p)
            })
            .sum();
        assert!((loss(0) - entropy).abs() < 1e-5);
    }
}

/// The first round, compared with its definition. The test tries every split of every column.
#[test]
fn the_first_round_is_the_best_stump() {
    let mut rng = SeededRng::new(3);
    let values: Vec<f64> = (0..60).map(|_| f64::from(rng.below(12) as u32)).collect();
    let labels: Vec<usize> = (0..30).map(|_| rng.below(2)).collect();
    let samples = Samples::new(2, &values, &labels, 2).unwrap();
    let settings = BoostingSettings::default().with_rounds(1).with_depth(1).with_min_leaf(3);
    let file = BoostedFile::from(&fit(&samples, &settings).unwrap());
    let ones = labels.iter().sum::<usize>() as f64;
    let score = ln((ones + 1.0) / (31.0 - ones));
    assert!((file.intercepts[0] - score).abs() < 1e-15);
    let p = (ones + 1.0) / 32.0;
    // Sums of the gradients and of the Hessians of some rows.
    let sums = |rows: &[usize]| {
        let gradient: f64 = rows.iter().map(|&i| p - labels[i] as f64).sum();
        (gradient, rows.len() as f64 * p * (1.0 - p) + settings.penalty)
    };
    let mut best = (f64::NEG_INFINITY, 0, 0.0, [0.0; 2]);
    for column in 0..2 {
        for threshold in (0..12).map(|k| f64::from(k) + 0.5) {
            let (left, right): (Vec<usize>, Vec<usize>) =
                (0..30).partition(|i| values[2 * i + column] <= threshold);
            if left.len().min(right.len()) >= 3 {
                let ((gl, hl), (gr, hr)) = (sums(&left), sums(&right));
                let gain = gl * gl / hl + gr * gr / hr;
                if gain > best.0 + 1e-9 {
                    best = (gain, column, threshold, [-0.1 * gl / hl, -0.1 * gr / hr]);
                }
            }
        }
    }
    let tree = &file.trees[0];
    assert_eq!(tree.questions.feature[0] as usize, best.1);
    let threshold = tree.questions.threshold[0];
    // The definition tries midpoints. All thresholds between two adjacent values split the rows
    // equally.
    let side = |t: f64| -> Vec<bool> { (0..30).map(|i| values[2 * i + best.1] <= t).collect() };
    assert_eq!(side(threshold), side(best.2));
    for (found, expected) in tree.value[1..].iter().zip(best.3) {
        assert!((found - expected).abs() < 1e-10, "{found} {expected}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn the_order_of_rows_changes_nothing(seed in 0..10_000u64, levels in 2..40u32, k in 2..4usize) {
        let mut rng = SeededRng::new(seed);
        let (n, width) = (80, 3);
        let values: Vec<f64> =
            (0..n * width).map(|_| f64::from(levels) * rng.unit()).map(f64::floor).collect();
        let labels: Vec<usize> = (0..n).map(|_| rng.below(k)).collect();
        let order = rng.permutation(n);
        let moved: Vec<f64> =
            order.iter().flat_map(|&i| &values[i * width..][..width]).copied().collect();
        let relabelled: Vec<usize> = order.iter().map(|&i| labels[i]).collect();
        let settings = BoostingSettings::default().with_rounds(5).with_bins(16);
        let model = |values: &[f64], labels: &[usize]| {
            fit(&Samples::new(width, values, labels, k).unwrap(), &settings).unwrap()
        };
        prop_assert_eq!(model(&values, &labels), model(&moved, &relabelled));
    }
}

#[test]
fn folds_choose_what_predicts_trials_that_were_not_seen() {
    for experiment in [1, 2] {
        let (rows, test) = person(6, experiment);
        let folds: Vec<usize> = rows.places.iter().map(|(trial, _)| trial % 5).collect();
        let (scale, rows) = rows.standardised();
        let samples = rows.samples(experiment);
        let settings = BoostingSettings::default();
        let (model, chosen) = fit_by_folds(&samples, &folds, &[2, 3], &settings).unwrap();
        assert_eq!(model.rounds(), chosen.rounds);
        assert!(chosen.rounds > 0 && chosen.rounds < settings.rounds);
        // Patience only stops the search early, so more patience chooses the same number of rounds.
        let patient = settings.with_patience(60).with_rounds(150);
        assert_eq!(fit_by_folds(&samples, &folds, &[2, 3], &patient).unwrap().1, chosen);
        // Compute the loss of the chosen number of rounds directly, with one fold after another
        // held out.
        let settings = settings.with_depth(chosen.depth).with_rounds(chosen.rounds);
        let mut loss = 0.0;
        for fold in 0..5 {
            let part = |keep: &dyn Fn(usize) -> bool| {
                let kept: Vec<usize> = (0..folds.len()).filter(|&i| keep(folds[i])).collect();
                let values: Vec<f64> = kept
                    .iter()
                    .flat_map(|&i| &rows.values[i * WIDTH..][..WIDTH])
                    .copied()
                    .collect();
                (values, kept.iter().map(|&i| rows.labels[i]).collect::<Vec<usize>>())
            };
            let (values, labels) = part(&|f| f != fold);
            let (left_out, expected) = part(&|f| f == fold);
            let samples = Samples::new(WIDTH, &values, &labels, classes(experiment)).unwrap();
            let model = fit(&samples, &settings).unwrap();
            let mean = log_loss(&model, &left_out, &expected, classes(experiment));
            loss += mean * expected.len() as f64;
        }
        let loss = loss / folds.len() as f64;
        assert!((loss - chosen.log_loss).abs() < 1e-12, "{loss} {}", chosen.log_loss);
        // The model generalizes to later trials.
        let model = model.unscaled(&scale);
        let prior = model.truncated(0);
        let loss = |model| log_loss(model, &test.values, &test.labels, classes(experiment));
        assert!(loss(&model) < 0.95 * loss(&prior), "{} {}", loss(&model), loss(&prior));
    }
}

#[test]
fn little_to_learn_from_gives_little_models() {
    let probabilities = |width, values: &[f64], labels: &[usize], classes, row: &[f64]| {
        let samples = Samples::new(width, values, labels, classes).unwrap();
        let settings = BoostingSettings::default().with_min_leaf(1);
        let model = fit(&samples, &settings).unwrap();
        let mut p = vec![0.0; classes];
        model.probabilities_into(row, &mut p);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        p
    };
    // If only one class occurs, it gets a high probability, but the other classes do not get 0.
    let p = probabilities(1, &[1.0, 2.0, 3.0], &[1, 1, 1], 3, &[2.0]);
    assert!(p[1] > 0.8 && p[0] > 0.0 && p[0] == p[2], "{p:?}");
    // The features are constant.
    let p = probabilities(1, &[2.0; 4], &[0, 1, 0, 1], 2, &[2.0]);
    assert!((p[0] - 0.5).abs() < 1e-12);
    // There are only two rows.
    let p = probabilities(1, &[1.0, 2.0], &[0, 1], 2, &[2.0]);
    assert!(p[1] > 0.6);
}

#[test]
fn what_cannot_be_learnt_is_refused() {
    let values: Vec<f64> = (0..8).map(f64::from).collect();
    let labels = [0, 1, 0, 1, 0, 1, 0, 1];
    let samples = Samples::new(1, &values, &labels, 2).unwrap();
    let complain = |change: fn(&mut BoostingSettings)| {
        let mut settings = BoostingSettings::default();
        change(&mut settings);
        fit(&samples, &settings).unwrap_err().field
    };
    assert_eq!(complain(|s| s.rate = 0.0), "rate");
    assert_eq!(complain(|s| s.penalty = -1.0), "penalty");
    assert_eq!(complain(|s| s.penalty = f64::NAN), "penalty");
    assert_eq!(complain(|s| s.depth = 0), "depth");
    assert_eq!(complain(|s| s.min_leaf = 0), "min_leaf");
    assert_eq!(complain(|s| s.bins = 1), "bins");
    let one = Samples::new(1, &values, &[0; 8], 1).unwrap();
    assert_eq!(fit(&one, &BoostingSettings::default()).unwrap_err().field, "classes");
    let by_folds = |folds: &[usize], depths: &[usize]| {
        fit_by_folds(&samples, folds, depths, &BoostingSettings::default()).unwrap_err().field
    };
    assert_eq!(by_folds(&[0, 1], &[2]), "folds");
    assert_eq!(by_folds(&[0; 8], &[2]), "folds");
    assert_eq!(by_folds(&[0, 2, 0, 2, 0, 2, 0, 2], &[2]), "folds");
    assert_eq!(by_folds(&[0, 1, 0, 1, 0, 1, 0, 1], &[]), "depths");
}
