//! Computes the paper's tables from cells.

use super::cell::{Cell, Experiment};
use super::metrics::{Avoidance, BINS, Bin, Calibration, Distances, Predictions};
use super::models::ModelName;
use serde::Serialize;

/// A compared participant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedParticipant {
    /// The participant's name or number in the data.
    pub name: String,
    /// The numbers of the test tasks.
    pub test_trials: Vec<u64>,
    /// The numbers of the training tasks.
    pub training_trials: Vec<u64>,
    /// Number of steps of each task.
    pub steps: usize,
}

/// All cells of all participants.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// The participants, in the order of their indices in cells.
    pub participants: Vec<ComparedParticipant>,
    /// The cells, ordered by model, experiment, feature set and participant.
    pub cells: Vec<Cell>,
}

/// Accuracy, or one of the two distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Metric {
    /// Share of steps predicted correctly, in per cent; higher is better.
    #[serde(rename = "accuracy")]
    Accuracy,
    /// Penalised distance between the first steps of avoidance, in steps; lower is better.
    #[serde(rename = "D_start")]
    Start,
    /// Penalised distance between the last steps of avoidance, in steps; lower is better.
    #[serde(rename = "D_end")]
    End,
}

impl Metric {
    /// The metric's name in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Start => "D_start",
            Self::End => "D_end",
        }
    }

    /// Whether lower is better.
    #[must_use]
    pub fn less_is_better(self) -> bool {
        self != Self::Accuracy
    }
}

impl Comparison {
    /// The names of the feature sets, in order.
    #[must_use]
    pub fn sets(&self) -> Vec<&str> {
        let first = self.cells.first();
        let one = |cell: &&Cell| {
            first.is_some_and(|first| {
                (cell.model, cell.experiment, cell.participant)
                    == (first.model, first.experiment, first.participant)
            })
        };
        self.cells.iter().filter(one).map(|cell| cell.features.as_str()).collect()
    }

    /// The cells of one model, experiment and feature set, one for each participant, in order.
    pub fn of<'a>(
        &'a self,
        model: ModelName,
        experiment: Experiment,
        features: &'a str,
    ) -> impl Iterator<Item = &'a Cell> {
        self.cells.iter().filter(move |cell| {
            cell.model == model && cell.experiment == experiment && cell.features == features
        })
    }

    /// The test accuracy of each participant's model, in per cent.
    #[must_use]
    pub fn person_accuracies(
        &self,
        model: ModelName,
        experiment: Experiment,
        set: &str,
    ) -> Vec<f64> {
        self.of(model, experiment, set).map(|cell| 100.0 * cell.test.accuracy()).collect()
    }

    /// Accuracy (per cent), `D_start` or `D_end` (penalised, steps) of each participant's model.
    /// `D_start` and `D_end` are always from experiment II.
    #[must_use]
    pub fn person_metric(
        &self,
        metric: Metric,
        model: ModelName,
        experiment: Experiment,
        set: &str,
    ) -> Vec<f64> {
        let distances = |cell: &Cell| {
            let steps = self.participants[cell.participant].steps.max(1);
            Distances::of(steps, &self.avoidances(cell))
        };
        let cells = || self.of(model, Experiment::Avoidance, set);
        match metric {
            Metric::Accuracy => self.person_accuracies(model, experiment, set),
            Metric::Start => cells().map(|cell| distances(cell).start.penalised).collect(),
            Metric::End => cells().map(|cell| distances(cell).end.penalised).collect(),
        }
    }

    /// The mean over participants of [`Self::person_metric`].
    #[must_use]
    pub fn person_mean(
        &self,
        metric: Metric,
        model: ModelName,
        experiment: Experiment,
        set: &str,
    ) -> f64 {
        mean(self.person_metric(metric, model, experiment, set))
    }

    /// One row of the paper's Table I: the mean accuracy over participants for each set (per cent).
    #[must_use]
    pub fn accuracies(&self, model: ModelName, experiment: Experiment, sets: &[&str]) -> Vec<f64> {
        sets.iter().map(|set| mean(self.person_accuracies(model, experiment, set))).collect()
    }

    /// One entry of the paper's Table II: `D_start` and `D_end` over all test trajectories.
    #[must_use]
    pub fn distances(&self, model: ModelName, features: &str) -> Distances {
        let cells = self.of(model, Experiment::Avoidance, features);
        let all: Vec<_> = cells.flat_map(|cell| self.avoidances(cell)).collect();
        Distances::of(self.steps(), &all)
    }

    /// Number of steps of a trajectory, which is the same for all trajectories.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.participants.iter().map(|person| person.steps).max().unwrap_or(0)
    }

    /// The avoidance of the human and of the model in each test trajectory.
    fn avoidances(&self, cell: &Cell) -> Vec<(Avoidance, Avoidance)> {
        let steps = self.participants[cell.participant].steps;
        let of = |classes: &[i8]| Avoidance::of(classes.iter().map(|&class| class != 0));
        let humans = cell.test.truth.chunks(steps).map(of);
        humans.zip(cell.test.predicted.chunks(steps).map(of)).collect()
    }

    /// The metric's value in each test trajectory of a cell.
    pub(super) fn by_trajectory(&self, metric: Metric, cell: &Cell) -> Vec<f64> {
        let steps = self.participants[cell.participant].steps;
        let Predictions { truth, predicted, .. } = &cell.test;
        if metric == Metric::Accuracy {
            let right = |(t, p): (&[i8], &[i8])| t.iter().zip(p).filter(|(t, p)| t == p).count();
            let pairs = truth.chunks(steps).zip(predicted.chunks(steps));
            return pairs.map(|pair| 100.0 * right(pair) as f64 / steps as f64).collect();
        }
        let distance = |pair| {
            let distances = Distances::of(steps, &[pair]);
            if metric == Metric::Start {
                distances.start.penalised
            } else {
                distances.end.penalised
            }
        };
        self.avoidances(cell).into_iter().map(distance).collect()
    }
}

/// A summary of a model's predictions for the test rows of all participants.
#[derive(Clone, Debug, PartialEq)]
pub struct Pooled {
    /// The model; `None` for the baseline.
    pub model: Option<ModelName>,
    /// The experiment.
    pub experiment: Experiment,
    /// The name of the feature set; `none` for the baseline.
    pub features: String,
    /// Quality of the probabilities.
    pub calibration: Calibration,
    /// The calibration curve.
    pub bins: [Bin; BINS],
    /// The confusion matrix: rows are the true classes, columns the predicted classes.
    pub confusion: Vec<Vec<usize>>,
}

impl Pooled {
    pub(super) fn of(
        model: Option<ModelName>,
        experiment: Experiment,
        features: &str,
        all: &Predictions,
    ) -> Self {
        Self {
            model,
            experiment,
            features: features.to_owned(),
            calibration: all.calibration(),
            bins: all.bins(),
            confusion: all.confusion(),
        }
    }

    /// Whether this is the summary for this model, experiment and feature set.
    pub(super) fn is(&self, model: Option<ModelName>, experiment: Experiment, set: &str) -> bool {
        (self.model, self.experiment, &self.features[..]) == (model, experiment, set)
    }
}

/// For each number of a row, whether it is the best. All numbers that tie for the best are best. A
/// missing number is never the best.
#[must_use]
pub fn are_best(numbers: &[Option<f64>], less_is_better: bool) -> Vec<bool> {
    let sign = if less_is_better { -1.0 } else { 1.0 };
    let of = |number: &Option<f64>| number.map(|number| sign * number).filter(|n| n.is_finite());
    let best = numbers.iter().filter_map(of).fold(f64::NEG_INFINITY, f64::max);
    // Because of rounding errors, means of equal shares can differ in their last digits.
    numbers.iter().map(|number| of(number).is_some_and(|number| best - number < 1e-9)).collect()
}

/// The mean; 0 if there are no numbers.
pub(super) fn mean(numbers: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) =
        numbers.into_iter().fold((0.0, 0usize), |(sum, count), x| (sum + x, count + 1));
    sum / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::are_best;

    #[test]
    fn the_best_and_all_its_equals() {
        assert_eq!(
            are_best(&[Some(1.0), Some(3.0), None, Some(3.0)], false),
            [false, true, false, true]
        );
        assert_eq!(are_best(&[Some(1.0), Some(3.0), None], true), [true, false, false]);
        assert_eq!(are_best(&[None, None], true), [false, false]);
    }
}
