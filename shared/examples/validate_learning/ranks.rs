//! Tests of differences against scipy's permutation distributions.

use std::error::Error;

use serde::{Deserialize, Serialize};
use sidestep::stats::rank::{mann_whitney, wilcoxon};

use crate::cells::Reference;
use crate::lines;

/// Comparisons, and the largest differences of p-values.
#[derive(Default, Serialize)]
pub(crate) struct Check {
    compared: usize,
    mann_whitney: f64,
    wilcoxon: f64,
}

/// p-values by scipy over the eight accuracies of the reference, ties included.
#[derive(Deserialize)]
struct Scipy {
    model: String,
    experiment: u8,
    first: String,
    second: String,
    mann_whitney: f64,
    wilcoxon: f64,
}

pub(crate) fn check() -> Result<Check, Box<dyn Error>> {
    let reference: Vec<Reference> = crate::cells::reference()?;
    let accuracies = |model: &str, experiment: u8, features: &str| -> Vec<f64> {
        let own = |name: &str| -> Vec<&Reference> {
            let wanted = (name, experiment, features);
            reference
                .iter()
                .filter(|cell| (&*cell.model, cell.experiment, &*cell.features) == wanted)
                .collect()
        };
        // Of both machines the one that did better in cross-validation.
        let better = |(rbf, linear): (&Reference, &Reference)| {
            let linear_wins = linear.cv_accuracy > rbf.cv_accuracy + 1e-12;
            if linear_wins { linear.test_accuracy } else { rbf.test_accuracy }
        };
        match model {
            "svm" => own("svm_rbf").into_iter().zip(own("svm_linear")).map(better).collect(),
            one => own(one).iter().map(|cell| cell.test_accuracy).collect(),
        }
    };
    let mut check = Check::default();
    for row in lines::<Scipy>(include_str!("../../tests/data/scipy_ranks.csv"))? {
        let first = accuracies(&row.model, row.experiment, &row.first);
        let second = accuracies(&row.model, row.experiment, &row.second);
        let apart = (mann_whitney(&first, &second)? - row.mann_whitney).abs();
        check.mann_whitney = check.mann_whitney.max(apart);
        check.wilcoxon = check.wilcoxon.max((wilcoxon(&first, &second)? - row.wilcoxon).abs());
        check.compared += 1;
    }
    Ok(check)
}
