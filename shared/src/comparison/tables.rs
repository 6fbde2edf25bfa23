//! The paper's tables from cells, and tests of the differences.

use super::avoidance::{Avoidance, Distances};
use super::cell::{Cell, Experiment, ModelName, PAPERS_SETS};
use super::metrics::Predictions;
use crate::invalid::Invalid;
use crate::stats::rank::{hodges_lehmann, holm, mann_whitney, wilcoxon};
use serde::Serialize;

/// A person whose models are compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Participant {
    /// As the data call them.
    pub name: String,
    /// The numbers of the tasks that test.
    pub test_trials: Vec<u64>,
    /// Steps of each of them.
    pub steps: usize,
}

/// All cells of all people.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Who is in it.
    pub participants: Vec<Participant>,
    /// In the order of models, experiments, feature sets and people.
    pub cells: Vec<Cell>,
}

/// Accuracy, or one of the two distances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Metric {
    /// Share of steps predicted right, in per cent; more is better.
    #[serde(rename = "accuracy")]
    Accuracy,
    /// Distance of the first steps of avoidance, penalised, in steps; less is better.
    #[serde(rename = "D_start")]
    Start,
    /// Distance of the last steps, penalised, in steps; less is better.
    #[serde(rename = "D_end")]
    End,
}

impl Metric {
    /// As files call it.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy",
            Self::Start => "D_start",
            Self::End => "D_end",
        }
    }

    /// Whether less of it is better.
    #[must_use]
    pub fn less_is_better(self) -> bool {
        self != Self::Accuracy
    }
}

/// How two feature sets differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Test {
    /// What predicts.
    pub model: ModelName,
    /// What is predicted.
    pub experiment: Experiment,
    /// What is compared.
    pub metric: Metric,
    /// The set that is said to be better.
    pub first: &'static str,
    /// The set that it is compared with.
    pub second: &'static str,
    /// Mean over people of how much better the first is: points of accuracy, or steps.
    pub gain: f64,
    /// The typical gain of a person (Hodges–Lehmann), which the paired test is about. A few people
    /// can turn the mean the other way.
    pub typical_gain: f64,
    /// p-value over people: one number each.
    pub mann_whitney_persons: f64,
    /// p-value over test trajectories of all people. These are not independent.
    pub mann_whitney_trajectories: f64,
    /// p-value over people, paired: the test that fits this design.
    pub wilcoxon_persons: f64,
    /// [`Self::mann_whitney_persons`] after Holm.
    pub mann_whitney_persons_holm: f64,
    /// [`Self::mann_whitney_trajectories`] after Holm.
    pub mann_whitney_trajectories_holm: f64,
    /// [`Self::wilcoxon_persons`] after Holm.
    pub wilcoxon_persons_holm: f64,
}

/// The comparisons that the paper's claims are about: each set with a safety level against
/// distance alone, both levels against both and distance, and the one level against the other.
pub const PAIRS: [(&str, &str); 8] = [
    ("hrd", "d"),
    ("hr", "d"),
    ("hd", "d"),
    ("rd", "d"),
    ("h", "d"),
    ("r", "d"),
    ("hrd", "hr"),
    ("h", "r"),
];

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

    /// The cells of one model, experiment and feature set, a person each, in order.
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

    /// One row of the paper's Table I: mean over people of the accuracy, in per cent.
    #[must_use]
    pub fn accuracies(&self, model: ModelName, experiment: Experiment, sets: &[&str]) -> Vec<f64> {
        let mean = |set: &&str| {
            mean(self.of(model, experiment, set).map(|cell| 100.0 * cell.test.accuracy()))
        };
        sets.iter().map(mean).collect()
    }

    /// One entry of the paper's Table II: both distances over all test trajectories.
    #[must_use]
    pub fn distances(&self, model: ModelName, features: &str) -> Distances {
        let cells = self.of(model, Experiment::Avoidance, features);
        let all: Vec<_> = cells.flat_map(|cell| self.avoidances(cell)).collect();
        Distances::of(self.steps(), &all)
    }

    /// The steps of a trajectory; all have the same number.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.participants.iter().map(|person| person.steps).max().unwrap_or(0)
    }

    /// Who avoids when, human and model, a test trajectory each.
    fn avoidances(&self, cell: &Cell) -> Vec<(Avoidance, Avoidance)> {
        let steps = self.participants[cell.participant].steps;
        let of = |classes: &[i8]| Avoidance::of(classes.iter().map(|&class| class != 0));
        let humans = cell.test.truth.chunks(steps).map(of);
        humans.zip(cell.test.predicted.chunks(steps).map(of)).collect()
    }

    /// The metric of each test trajectory of a cell.
    fn by_trajectory(&self, metric: Metric, cell: &Cell) -> Vec<f64> {
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
                distances.start_penalised
            } else {
                distances.end_penalised
            }
        };
        self.avoidances(cell).into_iter().map(distance).collect()
    }

    /// Tests of every model, experiment, metric and pair of [`PAIRS`]. Holm's correction is over
    /// all rows of a metric.
    ///
    /// # Errors
    /// [`Invalid`] if there is nobody to compare.
    pub fn tests(&self) -> Result<Vec<Test>, Invalid> {
        let mut tests = Vec::new();
        for metric in [Metric::Accuracy, Metric::Start, Metric::End] {
            let begin = tests.len();
            for model in ModelName::PAPERS {
                for experiment in Experiment::ALL {
                    if metric != Metric::Accuracy && experiment == Experiment::TurnDirection {
                        continue;
                    }
                    for (first, second) in PAIRS {
                        tests.push(self.test(model, experiment, metric, first, second)?);
                    }
                }
            }
            let family = &mut tests[begin..];
            let corrected = |p: fn(&Test) -> f64, family: &[Test]| {
                holm(&family.iter().map(p).collect::<Vec<f64>>())
            };
            let persons = corrected(|test| test.mann_whitney_persons, family);
            let trajectories = corrected(|test| test.mann_whitney_trajectories, family);
            let paired = corrected(|test| test.wilcoxon_persons, family);
            for (i, test) in family.iter_mut().enumerate() {
                test.mann_whitney_persons_holm = persons[i];
                test.mann_whitney_trajectories_holm = trajectories[i];
                test.wilcoxon_persons_holm = paired[i];
            }
        }
        Ok(tests)
    }

    fn test(
        &self,
        model: ModelName,
        experiment: Experiment,
        metric: Metric,
        first: &'static str,
        second: &'static str,
    ) -> Result<Test, Invalid> {
        let of = |set| -> Vec<Vec<f64>> {
            self.of(model, experiment, set).map(|cell| self.by_trajectory(metric, cell)).collect()
        };
        let (one, other) = (of(first), of(second));
        let persons = |of: &[Vec<f64>]| -> Vec<f64> {
            of.iter().map(|trajectories| mean(trajectories.iter().copied())).collect()
        };
        let (one_persons, other_persons) = (persons(&one), persons(&other));
        let higher = mean(one_persons.iter().copied()) - mean(other_persons.iter().copied());
        let pairs = one_persons.iter().zip(&other_persons);
        let differences: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
        let better = |difference: f64| {
            if metric.less_is_better() { -difference } else { difference }
        };
        Ok(Test {
            model,
            experiment,
            metric,
            first,
            second,
            gain: better(higher),
            typical_gain: better(hodges_lehmann(&differences)),
            mann_whitney_persons: mann_whitney(&one_persons, &other_persons)?,
            mann_whitney_trajectories: mann_whitney(&one.concat(), &other.concat())?,
            wilcoxon_persons: wilcoxon(&one_persons, &other_persons)?,
            mann_whitney_persons_holm: 1.0,
            mann_whitney_trajectories_holm: 1.0,
            wilcoxon_persons_holm: 1.0,
        })
    }

    /// The best of the paper's sets in a row of numbers, one each: its place.
    #[must_use]
    pub fn best(numbers: &[f64], less_is_better: bool) -> Option<usize> {
        let better = |a: f64, b: f64| if less_is_better { a < b } else { a > b };
        (0..numbers.len().min(PAPERS_SETS.len()))
            .filter(|&i| numbers[i].is_finite())
            .reduce(|best, i| if better(numbers[i], numbers[best]) { i } else { best })
    }
}

/// The mean; 0 of nothing.
pub(super) fn mean(numbers: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = numbers.fold((0.0, 0usize), |(sum, count), x| (sum + x, count + 1));
    sum / count.max(1) as f64
}
