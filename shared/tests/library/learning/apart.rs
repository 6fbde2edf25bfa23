//! Differences between our models and scikit-learn's models, fitted with the same settings to the
//! same rows (B_hrd of all people). Tests bound these numbers; `cargo xtask validate learning`
//! prints them.

use super::{Lr, PEOPLE, WIDTH, classes, lines, lowest_class, peer, peer_by_newton, person, said};
use serde::{Deserialize, Serialize};
use sidestep::learn::logistic::{LogisticSettings, fit};
use sidestep::learn::svm::{self, SvmSettings, Target};
use sidestep::learn::tree::{TreeSettings, grow};
use sidestep::predict::logistic::Logistic;
use sidestep::predict::svm::{Kernel, Sigmoid, pair_count};
use std::collections::HashSet;

pub(crate) fn furthest<'a>(
    found: impl IntoIterator<Item = &'a f64>,
    expected: impl IntoIterator<Item = &'a f64>,
) -> f64 {
    found.into_iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Largest differences between the logistic regressions.
#[derive(Default, Serialize)]
pub(crate) struct LogisticApart {
    /// Means and standard deviations for scaling.
    pub(crate) scale: f64,
    /// Weights and intercepts for C = 0.001, 1 and 100, compared with scikit-learn's Newton solver.
    pub(crate) newton: f64,
    /// Weights and intercepts for C = 1, compared with the reference's L-BFGS solver.
    pub(crate) lbfgs: f64,
    /// Probabilities of test rows, compared with the reference.
    pub(crate) probability: f64,
    /// Number of probabilities compared.
    pub(crate) probabilities: usize,
}

pub(crate) fn logistic(experiment: usize) -> LogisticApart {
    let mut apart = LogisticApart::default();
    let (mut newton, mut lbfgs) = (0.0_f64, 0.0_f64);
    for participant in 0..PEOPLE {
        let (training, test) = person(participant, experiment);
        let peer = peer(participant, experiment);
        let (scale, standard) = training.standardised();
        let of_scale =
            f64::max(furthest(scale.mean(), &peer.mean), furthest(scale.scale(), &peer.scale));
        apart.scale = apart.scale.max(of_scale);
        let samples = standard.samples(experiment);
        let of_weights = |model: &Logistic, expected: &Lr| {
            // For two classes, scikit-learn outputs only the weights of the second class.
            let skip = classes(experiment) - expected.coef.len();
            let found = model.coefficients()[skip..].concat();
            let weights = furthest(&found, expected.coef.iter().flatten());
            weights.max(furthest(&model.intercepts()[skip..], &expected.intercept))
        };
        for c in [1e-3, 1.0, 1e2] {
            let model = fit(&samples, c, LogisticSettings::default()).expect("a fit");
            let expected = peer_by_newton(participant, experiment, c);
            newton = newton.max(of_weights(&model, &expected));
        }
        let model = fit(&samples, 1.0, LogisticSettings::default()).expect("a fit");
        lbfgs = lbfgs.max(of_weights(&model, &peer.lr));

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
                let from = (p - row[&format!("lr_p{class}")]).abs();
                apart.probability = apart.probability.max(from);
                apart.probabilities += 1;
            }
        }
    }
    LogisticApart { newton, lbfgs, ..apart }
}

/// Differences between the support vector machines with an RBF kernel and C = 1.
#[derive(Default, Serialize)]
pub(crate) struct SvmsApart {
    /// Number of test rows.
    pub(crate) rows: usize,
    /// Number of rows predicted differently.
    pub(crate) different: usize,
    /// Largest difference of the decision values.
    pub(crate) decision: f64,
}

pub(crate) fn svms(experiment: usize) -> SvmsApart {
    let mut apart = SvmsApart::default();
    let k = classes(experiment);
    for participant in 0..PEOPLE {
        let (training, test) = person(participant, experiment);
        let kernel = Kernel::Rbf { gamma: peer(participant, experiment).svc.gamma };
        let target = Target { labels: &training.labels, classes: k };
        // Probabilities are not used.
        let sigmoids = vec![Sigmoid { a: -1.0, b: 0.0 }; pair_count(k)];
        let settings = SvmSettings::new(kernel, 1.0);
        let (scale, svm) =
            svm::fit(WIDTH, &training.values, target, settings, sigmoids).expect("an SVM");
        for (values, row) in test.values.chunks_exact(WIDTH).zip(said(participant, experiment)) {
            // For two classes, scikit-learn flips the sign, so that it is positive for the second
            // class.
            let sign = if k == 2 { -1.0 } else { 1.0 };
            for (pair, decision) in svm.decisions(&scale, values).iter().enumerate() {
                let expected = row[&format!("svc_dec{pair}")];
                apart.decision = apart.decision.max((sign * decision - expected).abs());
            }
            let class = svm.class(&scale, values) as f64 + lowest_class(experiment);
            apart.rows += 1;
            apart.different += usize::from(class != row["svc_pred"]);
        }
    }
    apart
}

/// Differences between the decision trees with depth 6 and at least 5 rows per leaf.
#[derive(Default, Serialize)]
pub(crate) struct TreesApart {
    /// Number of test rows.
    pub(crate) rows: usize,
    /// Number of rows that the reference flags as ambiguous, because scikit-learn's trees with six
    /// different seeds do not all agree.
    pub(crate) flagged: usize,
    /// Number of rows on which scikit-learn's trees with a thousand different seeds do not all agree.
    pub(crate) ties: usize,
    /// Number of tied rows predicted differently.
    pub(crate) different_ties: usize,
    /// Number of other rows predicted differently.
    pub(crate) different: usize,
    /// Largest difference of a class share in a leaf, over the rows without ties.
    pub(crate) share: f64,
}

#[derive(Deserialize, PartialEq, Eq, Hash)]
struct Place {
    participant: usize,
    exp: usize,
    trial: usize,
    step: usize,
}

pub(crate) fn trees(experiment: usize) -> TreesApart {
    let ties = lines::<Place>(include_str!("../../data/sklearn_tree_ties.csv"));
    let ties: HashSet<Place> = ties.into_iter().collect();
    let settings = TreeSettings::default().with_max_depth(6).with_min_leaf(5);
    let mut apart = TreesApart::default();
    for participant in 0..PEOPLE {
        let (training, test) = person(participant, experiment);
        let (scale, standard) = training.standardised();
        let tree = grow(&standard.samples(experiment), settings).expect("a tree").unscaled(&scale);
        let mut p = vec![0.0; classes(experiment)];
        let rows = said(participant, experiment);
        for (values, row) in test.values.chunks_exact(WIDTH).zip(&rows) {
            tree.probabilities_into(values, &mut p);
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let (trial, step) = (row["trial"] as usize, row["step"] as usize);
            let tied = ties.contains(&Place { participant, exp: experiment, trial, step });
            let flagged = row["dt_tie_ambiguous"] != 0.0;
            assert!(tied || !flagged, "a thousand states find less than six");
            let class = tree.class(values) as f64 + lowest_class(experiment);
            let differs = usize::from(class != row["dt_pred"]);
            apart.rows += 1;
            apart.flagged += usize::from(flagged);
            apart.ties += usize::from(tied);
            if tied {
                apart.different_ties += differs;
                continue;
            }
            apart.different += differs;
            let counts = tree.counts_at(values);
            let n = f64::from(counts.iter().sum::<u32>());
            for (class, &count) in counts.iter().enumerate() {
                let expected = row[&format!("dt_p{class}")];
                apart.share = apart.share.max((f64::from(count) / n - expected).abs());
            }
        }
    }
    apart
}
