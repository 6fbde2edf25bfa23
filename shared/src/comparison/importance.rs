//! Permutation importance: the accuracy that a model loses when the values of a feature are
//! permuted (Breiman, Machine Learning 45, 2001; for any model: Fisher, Rudin and Dominici, JMLR
//! 20, 2019).

use super::cell::{Cell, Experiment};
use super::models::ModelName;
use super::plan::ParticipantData;
use super::split::Split;
use super::tables::{Comparison, mean};
use crate::dataset::Dataset;
use crate::invalid::Invalid;
use crate::math::SeededRng;
use crate::parallel::parallel_map;
use crate::predict::Predictor;
use serde::Serialize;

/// Feature sets whose features are permuted.
const SETS: [&str; 2] = ["hrd", "hrd_body"];

/// Number of permutations of each feature.
const TIMES: usize = 5;

/// These features carry the same information, so they are permuted together. If only one of them
/// were permuted, the other two would reveal its value.
const TOGETHER: [&str; 3] = ["dpsi", "cos_dpsi", "sin_dpsi"];

/// An arbitrary but fixed seed, so that the same data give the same permutations.
const SEED: u64 = 20_010_801;

/// The loss of accuracy when a feature, or a group of features, is permuted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Importance {
    /// The model.
    pub model: ModelName,
    /// The experiment.
    pub experiment: Experiment,
    /// The name of the feature set.
    pub features: String,
    /// The permuted features, joined by `+`.
    pub permuted: String,
    /// For each participant, the loss of test accuracy (percentage points) when the values of the
    /// features are permuted among the test rows. It is a mean over several permutations.
    pub losses: Vec<f64>,
    /// Mean over participants.
    pub mean: f64,
}

/// Computes the importance of features for the paper's models in both experiments.
///
/// # Errors
/// [`Invalid`] if the predictor of a cell cannot be read.
pub(super) fn importance(
    people: &[&ParticipantData],
    comparison: &Comparison,
) -> Result<Vec<Importance>, Invalid> {
    let mut cells: Vec<&Cell> = Vec::new();
    for set in SETS {
        for model in ModelName::PAPERS {
            for experiment in Experiment::ALL {
                cells.extend(comparison.of(model, experiment, set));
            }
        }
    }
    let losses = parallel_map(&cells, |cell| losses(&people[cell.participant].data, cell))?;
    let mut found: Vec<Importance> = Vec::new();
    for (cell, losses) in cells.into_iter().zip(losses) {
        for (permuted, loss) in losses {
            let is = |of: &&mut Importance| {
                (of.model, of.experiment, &of.features, &of.permuted)
                    == (cell.model, cell.experiment, &cell.features, &permuted)
            };
            match found.iter_mut().find(is) {
                Some(of) => of.losses.push(loss),
                None => found.push(Importance {
                    model: cell.model,
                    experiment: cell.experiment,
                    features: cell.features.clone(),
                    permuted,
                    losses: vec![loss],
                    mean: 0.0,
                }),
            }
        }
    }
    for of in &mut found {
        of.mean = mean(of.losses.iter().copied());
    }
    Ok(found)
}

/// The loss for each group of features, in the order of the set.
fn losses(data: &Dataset, cell: &Cell) -> Result<Vec<(String, f64)>, Invalid> {
    let predictor = Predictor::try_from(cell.predictor.clone())?;
    let data = data.select(predictor.features())?;
    let (width, test) = (data.features.len(), Split::grouped(&data).test);
    let row = |row: usize| &data.values[row * width..(row + 1) * width];
    let right = |values: &[f64], of: usize| {
        predictor.class(values) == cell.experiment.class(data.labels[of])
    };
    let accuracy = 100.0 * cell.test.accuracy();
    let mut rng = SeededRng::new(SEED);
    let mut found = Vec::new();
    for (name, columns) in groups(&data) {
        let mut hits = 0;
        for _ in 0..TIMES {
            for (&of, from) in test.iter().zip(rng.permutation(test.len())) {
                let mut values = row(of).to_vec();
                for &column in &columns {
                    values[column] = row(test[from])[column];
                }
                hits += usize::from(right(&values, of));
            }
        }
        let permuted = 100.0 * hits as f64 / (TIMES * test.len()).max(1) as f64;
        found.push((name, accuracy - permuted));
    }
    Ok(found)
}

/// The groups of columns that are permuted together, with their names.
fn groups(data: &Dataset) -> Vec<(String, Vec<usize>)> {
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    for (column, feature) in data.features.features().enumerate() {
        let is_one_of = |name: &str| TOGETHER.contains(&name);
        let group = groups
            .iter_mut()
            .find(|(name, _)| is_one_of(feature.name) && name.split('+').all(is_one_of));
        match group {
            Some((name, columns)) => {
                name.push('+');
                name.push_str(feature.name);
                columns.push(column);
            }
            None => groups.push((feature.name.to_owned(), vec![column])),
        }
    }
    groups
}
