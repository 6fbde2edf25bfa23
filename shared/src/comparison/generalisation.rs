//! Accuracy with fewer training tasks, and on people whose data the models have not seen.

use super::cell::{Cell, Experiment};
use super::gains::{Gain, Paired, corrected};
use super::models::{CURVE_MODELS, ModelName, UNSEEN_MODELS};
use super::plan::{COMPARED_SETS, FIRST_TASKS};
use super::run::FewTasks;
use super::tables::{Comparison, Metric, mean};
use crate::invalid::Invalid;
use serde::Serialize;

/// A point of a learning curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearningPoint {
    /// The model.
    pub model: ModelName,
    /// The experiment.
    pub experiment: Experiment,
    /// The name of the feature set.
    pub features: String,
    /// The number of training tasks. At the point with all tasks, it is the mean over participants.
    pub tasks: f64,
    /// The number of participants in the means. The other participants have fewer tasks, or their
    /// first tasks do not contain both turns and straight driving.
    pub people: usize,
    /// Mean test accuracy, in per cent.
    pub accuracy: f64,
    /// Mean balanced test accuracy, in per cent.
    pub balanced: f64,
}

impl LearningPoint {
    /// Every point of every curve, by model, experiment, feature set and number of tasks.
    pub(super) fn all(comparison: &Comparison, few: &[FewTasks]) -> Vec<Self> {
        let mut points = Vec::new();
        for model in CURVE_MODELS {
            for experiment in Experiment::ALL {
                for features in COMPARED_SETS {
                    let point = |tasks: f64, cells: &[&Cell]| Self {
                        model,
                        experiment,
                        features: features.to_owned(),
                        tasks,
                        people: cells.len(),
                        accuracy: mean(cells.iter().map(|cell| 100.0 * cell.test.accuracy())),
                        balanced: mean(
                            cells.iter().map(|cell| 100.0 * cell.test.balanced_accuracy()),
                        ),
                    };
                    for tasks in FIRST_TASKS {
                        let is = |of: &&FewTasks| {
                            (of.tasks, of.cell.model, of.cell.experiment, &of.cell.features[..])
                                == (tasks, model, experiment, features)
                        };
                        let cells: Vec<&Cell> = few.iter().filter(is).map(|of| &of.cell).collect();
                        points.push(point(tasks as f64, &cells));
                    }
                    let all: Vec<&Cell> = comparison.of(model, experiment, features).collect();
                    let people = comparison.participants.iter();
                    points
                        .push(point(mean(people.map(|of| of.training_trials.len() as f64)), &all));
                }
            }
        }
        // Without points for fewer tasks, each curve would be a single point, the one with all
        // tasks.
        if few.is_empty() {
            return Vec::new();
        }
        points.retain(|point| point.people > 0);
        points
    }
}

/// Models trained on other people's data, compared with each person's own models.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Unseen {
    /// The name of the feature set.
    pub features: String,
    /// For each participant, the test accuracy of the model trained on other people (per cent).
    pub accuracies: Vec<f64>,
    /// The mean of these accuracies.
    pub mean: f64,
    /// The mean test accuracy of each person's own model, in per cent.
    pub own_mean: f64,
    /// The mean balanced accuracy of the models trained on other people, in per cent.
    pub balanced: f64,
    /// The gain of each person's own model over the model trained on other people. It is in
    /// percentage points of accuracy on the same test tasks.
    pub own: Gain,
}

impl Unseen {
    /// One entry per model, experiment and feature set. The tests of all entries are corrected
    /// together. Empty if there is only one participant.
    ///
    /// # Errors
    /// [`Invalid`] if there is no participant.
    pub(super) fn all(comparison: &Comparison, unseen: &[Cell]) -> Result<Vec<Self>, Invalid> {
        let (mut found, mut pairs) = (Vec::new(), Vec::new());
        for model in UNSEEN_MODELS {
            for experiment in Experiment::ALL {
                for features in COMPARED_SETS {
                    let is = |cell: &&Cell| {
                        (cell.model, cell.experiment, &cell.features[..])
                            == (model, experiment, features)
                    };
                    let mut cells: Vec<&Cell> = unseen.iter().filter(is).collect();
                    cells.sort_by_key(|cell| cell.participant);
                    let own = comparison.person_accuracies(model, experiment, features);
                    if cells.is_empty() || cells.len() != own.len() {
                        continue;
                    }
                    let accuracies: Vec<f64> =
                        cells.iter().map(|cell| 100.0 * cell.test.accuracy()).collect();
                    let balanced = cells.iter().map(|cell| 100.0 * cell.test.balanced_accuracy());
                    let paired = Paired::of(&own, &accuracies)?;
                    pairs.push((model, experiment, Metric::Accuracy, paired));
                    found.push((features.to_owned(), mean(balanced), accuracies, mean(own)));
                }
            }
        }
        let all = found.into_iter().zip(corrected(pairs));
        let row = |((features, balanced, accuracies, own_mean), own): ((_, _, Vec<f64>, _), _)| {
            let mean = mean(accuracies.iter().copied());
            Self { features, accuracies, mean, own_mean, balanced, own }
        };
        Ok(all.map(row).collect())
    }
}
