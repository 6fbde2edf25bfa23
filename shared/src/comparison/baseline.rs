//! What a model must beat: the person's commonest input, and how often there is which.

use super::cell::Experiment;
use super::metrics::Predictions;
use super::split::Split;
use crate::dataset::Dataset;
use serde::Serialize;

/// Always the commonest class of the training rows, with the classes' frequencies there (with
/// one more row of each, so that nothing is impossible) as probabilities.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// What is predicted.
    pub experiment: Experiment,
    /// Which person, by place.
    pub participant: usize,
    /// What it says of the test rows.
    pub test: Predictions,
}

impl Baseline {
    /// Of one person's rows.
    #[must_use]
    pub fn of(data: &Dataset, split: &Split, experiment: Experiment, participant: usize) -> Self {
        let classes = experiment.classes();
        let class = |row: &usize| experiment.class(data.labels[*row]);
        let count = |wanted: &i8| split.training.iter().filter(|row| class(row) == *wanted).count();
        let counts: Vec<usize> = classes.iter().map(count).collect();
        let total = (split.training.len() + classes.len()) as f64;
        let shares: Vec<f64> = counts.iter().map(|&count| (count + 1) as f64 / total).collect();
        // The first on a tie.
        let most = (0..counts.len()).reduce(|a, b| if counts[b] > counts[a] { b } else { a });
        let predicted = most.map_or(0, |most| classes[most]);
        let test = Predictions {
            classes: classes.to_vec(),
            truth: split.test.iter().map(class).collect(),
            predicted: vec![predicted; split.test.len()],
            probabilities: shares.repeat(split.test.len()),
        };
        Self { experiment, participant, test }
    }
}
