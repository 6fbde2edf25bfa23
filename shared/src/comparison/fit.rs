//! Trains the models of one participant on one feature set. Hyper-parameters are chosen by
//! cross-validation.

mod svm;
mod tree;
mod logistic;
mod boosted;

use super::cell::{Cell, Experiment};
use super::metrics::{Predictions, highest};
use super::models::{Grids, ModelName};
use super::split::{FOLDS, Split};
use crate::dataset::Dataset;
use crate::invalid::Invalid;
use crate::math::log2;
use crate::predict::{Predictor, PredictorFile};
use serde_json::Value;

/// How one kind of model is trained. Each kind has a source file in `fit/`, and a line in
/// [`ModelName::training`].
pub(super) trait Training {
    /// The experiments in which the model is trained.
    fn experiments(&self) -> &'static [Experiment] {
        &Experiment::ALL
    }

    /// The hyper-parameter values to try. Results are cached under a hash that covers these values.
    fn grid(&self, grids: &Grids) -> Value;

    /// The values of the regularisation parameter C in the grid. `None` if the model has no C.
    fn strengths<'a>(&self, _grids: &'a Grids) -> Option<&'a [f64]> {
        None
    }

    /// Trains the best model of each problem.
    fn fit(&self, problems: &[Problem<'_>], grids: &Grids) -> Result<Vec<Chosen>, Invalid>;

    /// Estimated processor time (s) of all fits of this model, for `thousands` × 1000 training rows
    /// with the paper's largest feature set.
    fn cost_s(&self, grids: &Grids, thousands: f64) -> f64;
}

impl ModelName {
    /// How the model is trained. `None` for the better of the two SVMs.
    pub(super) fn training(self) -> Option<&'static dyn Training> {
        Some(match self {
            Self::Svm => return None,
            Self::SvmRbf => &svm::Rbf,
            Self::SvmLinear => &svm::Linear,
            Self::Dt => &tree::DecisionTree,
            Self::Lr => &logistic::Regression,
            Self::Boosted => &boosted::BoostedTrees,
        })
    }
}

/// The cells of all experiments in which `model` is trained. Empty for the better of the two SVMs.
///
/// # Errors
/// [`Invalid`] if a grid is empty or has an impossible value, or if a fit fails.
pub fn fit(
    model: ModelName,
    data: &Dataset,
    split: &Split,
    grids: &Grids,
    features: &str,
    participant: usize,
) -> Result<Vec<Cell>, Invalid> {
    let Some(training) = model.training() else { return Ok(Vec::new()) };
    let problems: Vec<Problem<'_>> = (training.experiments().iter())
        .map(|&experiment| Problem::new(data, split, experiment))
        .collect();
    let cell = |(problem, chosen): (&Problem<'_>, Chosen)| Cell {
        model,
        experiment: problem.experiment,
        features: features.to_owned(),
        participant,
        cv_accuracy: chosen.cv_accuracy,
        hyperparameters: chosen.hyperparameters,
        test: problem.predictions(&chosen.predictor),
        predictor: PredictorFile::from(&chosen.predictor),
    };
    Ok(problems.iter().zip(training.fit(&problems, grids)?).map(cell).collect())
}

/// Relative time for sorting `thousands` × 1000 rows.
fn sorted(thousands: f64) -> f64 {
    thousands * (1.0 + 0.4 * log2(thousands)).max(0.5)
}

/// The best setting, and the model that was trained with it on all training rows.
pub(super) struct Chosen {
    cv_accuracy: f64,
    hyperparameters: String,
    predictor: Predictor,
}

/// Training rows. The labels 0, 1, … number the classes that occur.
struct Rows {
    values: Vec<f64>,
    labels: Vec<usize>,
    /// The classes that occur, in ascending order.
    classes: Vec<i8>,
}

/// The rows of one participant with the labels of one experiment.
pub(super) struct Problem<'a> {
    data: &'a Dataset,
    split: &'a Split,
    experiment: Experiment,
    training: Rows,
}

impl<'a> Problem<'a> {
    fn new(data: &'a Dataset, split: &'a Split, experiment: Experiment) -> Self {
        let training = rows(data, experiment, &split.training);
        Self { data, split, experiment, training }
    }

    /// The number of features.
    fn width(&self) -> usize {
        self.data.features.len()
    }

    /// The predictions of `predictor` for the test rows.
    fn predictions(&self, predictor: &Predictor) -> Predictions {
        let classes = predictor.classes();
        let width = self.data.features.len();
        let mut found = Predictions {
            classes: classes.to_vec(),
            truth: Vec::new(),
            predicted: Vec::new(),
            probabilities: Vec::new(),
        };
        let mut p = vec![0.0; classes.len()];
        for &row in &self.split.test {
            let values = &self.data.values[row * width..(row + 1) * width];
            predictor.probabilities_into(values, &mut p);
            found.truth.push(self.experiment.class(self.data.labels[row]));
            found.predicted.push(predictor.class(values));
            found.probabilities.extend_from_slice(&p);
        }
        found
    }

    /// The validation accuracy of each of `count` models: the mean over folds of the accuracy on
    /// held-out rows. `models` trains the models on the rows outside a fold. `says` returns the
    /// index of the class that a model predicts. If the rows outside a fold have only one class,
    /// this class is the prediction.
    fn validated<M>(
        &self,
        count: usize,
        models: impl Fn(&Rows) -> Result<Vec<M>, Invalid>,
        says: impl Fn(&M, &[f64]) -> usize,
    ) -> Result<Vec<f64>, Invalid> {
        let width = self.data.features.len();
        let mut accuracy = vec![0.0; count];
        let mut folds = 0.0;
        for fold in 0..FOLDS {
            let (learned, held) = self.split.fold(fold);
            if held.is_empty() || learned.is_empty() {
                continue;
            }
            folds += 1.0;
            let of = |places: &[usize]| -> Vec<usize> {
                places.iter().map(|&place| self.split.training[place]).collect()
            };
            let learned = rows(self.data, self.experiment, &of(&learned));
            let held = of(&held);
            let truth = |row: usize| self.experiment.class(self.data.labels[row]);
            let share = |class: &dyn Fn(&[f64]) -> i8| {
                let right = |row: &&usize| {
                    class(&self.data.values[**row * width..(**row + 1) * width]) == truth(**row)
                };
                held.iter().filter(right).count() as f64 / held.len() as f64
            };
            if let [only] = learned.classes[..] {
                let share = share(&|_| only);
                accuracy.iter_mut().for_each(|sum| *sum += share);
                continue;
            }
            for (sum, model) in accuracy.iter_mut().zip(models(&learned)?) {
                *sum += share(&|row| learned.classes[says(&model, row)]);
            }
        }
        Ok(accuracy.into_iter().map(|sum| sum / f64::max(folds, 1.0)).collect())
    }
}

/// The index of the best setting of a grid. A tie goes to the first setting.
fn best(accuracy: &[f64]) -> Result<usize, Invalid> {
    highest(accuracy).ok_or_else(|| Invalid::new("grid", "at least one setting", "none"))
}

fn rows(data: &Dataset, experiment: Experiment, rows: &[usize]) -> Rows {
    let width = data.features.len();
    let class = |row: &usize| experiment.class(data.labels[*row]);
    let occurs = |wanted: &&i8| rows.iter().any(|row| class(row) == **wanted);
    let classes: Vec<i8> = experiment.classes().iter().filter(occurs).copied().collect();
    let label = |row| classes.iter().position(|known| *known == class(row)).unwrap_or(0);
    Rows {
        values: rows
            .iter()
            .flat_map(|row| &data.values[row * width..(row + 1) * width])
            .copied()
            .collect(),
        labels: rows.iter().map(label).collect(),
        classes: classes.clone(),
    }
}
