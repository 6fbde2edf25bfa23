//! Rank tests of the reference's accuracies, compared with SciPy's permutation distributions.

use super::lines;
use serde::{Deserialize, Serialize};
use sidestep::stats::rank::{mann_whitney, wilcoxon};

/// A cell of the reference's comparison.
#[derive(Deserialize)]
pub(crate) struct Reference {
    pub(crate) model: String,
    pub(crate) experiment: u8,
    pub(crate) features: String,
    pub(crate) participant: usize,
    pub(crate) cv_accuracy: f64,
    pub(crate) test_accuracy: f64,
    pub(crate) hyperparameters: String,
}

pub(crate) fn reference() -> Vec<Reference> {
    lines(include_str!("../../data/sklearn_cells.csv"))
}

/// Number of comparisons, and the largest differences of p-values.
#[derive(Default, Serialize)]
pub(crate) struct RanksApart {
    pub(crate) compared: usize,
    pub(crate) mann_whitney: f64,
    pub(crate) wilcoxon: f64,
}

/// SciPy's p-values for the eight accuracies of the reference, including ties.
#[derive(Deserialize)]
struct Scipy {
    model: String,
    experiment: u8,
    first: String,
    second: String,
    mann_whitney: f64,
    wilcoxon: f64,
}

pub(crate) fn ranks() -> RanksApart {
    let reference = reference();
    let accuracies = |model: &str, experiment: u8, features: &str| -> Vec<f64> {
        let own = |name: &str| -> Vec<&Reference> {
            let wanted = (name, experiment, features);
            reference
                .iter()
                .filter(|cell| (&*cell.model, cell.experiment, &*cell.features) == wanted)
                .collect()
        };
        // The test accuracy of the kernel that was more accurate in cross-validation.
        let better = |(rbf, linear): (&Reference, &Reference)| {
            let linear_wins = linear.cv_accuracy > rbf.cv_accuracy + 1e-12;
            if linear_wins { linear.test_accuracy } else { rbf.test_accuracy }
        };
        match model {
            "svm" => own("svm_rbf").into_iter().zip(own("svm_linear")).map(better).collect(),
            one => own(one).iter().map(|cell| cell.test_accuracy).collect(),
        }
    };
    let mut apart = RanksApart::default();
    for row in lines::<Scipy>(include_str!("../../data/scipy_ranks.csv")) {
        let first = accuracies(&row.model, row.experiment, &row.first);
        let second = accuracies(&row.model, row.experiment, &row.second);
        let found = mann_whitney(&first, &second).expect("a p-value");
        apart.mann_whitney = apart.mann_whitney.max((found - row.mann_whitney).abs());
        let found = wilcoxon(&first, &second).expect("a p-value");
        apart.wilcoxon = apart.wilcoxon.max((found - row.wilcoxon).abs());
        apart.compared += 1;
    }
    apart
}
