//! Quality of predictions: per row, and for the start and end of avoidance.

use crate::math::ln;
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// A model's predictions for some rows, and the true classes of these rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Predictions {
    /// The classes, in ascending order.
    pub classes: Vec<i8>,
    /// The true class of each row.
    pub truth: Vec<i8>,
    /// The predicted class of each row.
    pub predicted: Vec<i8>,
    /// The probabilities of the classes, row by row.
    pub probabilities: Vec<f64>,
}

/// Summary statistics over some rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Number of rows.
    pub rows: usize,
    /// Log loss (nats): the mean of −ln of the true class's probability. Probabilities are raised
    /// to at least 10⁻¹⁵.
    pub log_loss: f64,
    /// Brier's score (Monthly Weather Review 78, 1950): the mean over rows of the sum over classes
    /// of (probability − truth)². The truth is 1 for the true class and 0 for the other classes.
    /// The score ranges from 0 to 2.
    pub brier: f64,
    /// Expected calibration error. Rows are put into ten bins by their highest probability. The
    /// error of a bin is the absolute difference between the mean of these probabilities and the
    /// share of rows whose likeliest class is correct. The result is the mean over bins, weighted
    /// by the number of rows.
    pub calibration_error: f64,
}

/// One bin of a calibration curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Number of rows.
    pub rows: usize,
    /// Sum of the highest probability of each row.
    pub confidence: f64,
    /// The number of rows whose likeliest class is correct.
    pub right: usize,
}

/// Number of bins of a calibration curve.
pub const BINS: usize = 10;

const LEAST_PROBABILITY: f64 = 1e-15;

/// The index of the highest number, or the first such index on a tie. Returns `None` if there are
/// no numbers.
pub(super) fn highest(numbers: &[f64]) -> Option<usize> {
    (0..numbers.len()).reduce(|best, i| if numbers[i] > numbers[best] { i } else { best })
}

impl Predictions {
    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.truth.len()
    }

    /// Number of rows with a correct prediction.
    #[must_use]
    pub fn right(&self) -> usize {
        self.truth
            .iter()
            .zip(&self.predicted)
            .filter(|(truth, predicted)| truth == predicted)
            .count()
    }

    /// The share of correctly predicted rows, from 0 to 1; 0 if there are no rows.
    #[must_use]
    pub fn accuracy(&self) -> f64 {
        self.right() as f64 / self.rows().max(1) as f64
    }

    /// The mean recall over the classes that occur, from 0 to 1; 0 if there are no rows. A model
    /// that always predicts the same class reaches one half if two classes occur and one third if
    /// three occur, however common this class is.
    #[must_use]
    pub fn balanced_accuracy(&self) -> f64 {
        let confusion = self.confusion();
        let totals = confusion.iter().map(|row| row.iter().sum::<usize>());
        let recalls = confusion.iter().enumerate().zip(totals).filter(|(_, total)| *total > 0);
        // A class that the model does not know has no row in the confusion matrix, and is never
        // predicted.
        let mut unknown: Vec<i8> = self.truth.clone();
        unknown.retain(|class| !self.classes.contains(class));
        unknown.sort_unstable();
        unknown.dedup();
        let (mut sum, mut classes) = (0.0, unknown.len());
        for ((place, row), total) in recalls {
            sum += row[place] as f64 / total as f64;
            classes += 1;
        }
        sum / classes.max(1) as f64
    }

    /// The class probabilities of each row.
    pub fn each(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.probabilities.chunks_exact(self.classes.len())
    }

    /// The predictions of some of the rows.
    ///
    /// # Panics
    /// If `rows` exceeds the number of rows.
    #[must_use]
    pub fn part(&self, rows: Range<usize>) -> Self {
        let width = self.classes.len();
        Self {
            classes: self.classes.clone(),
            truth: self.truth[rows.clone()].to_vec(),
            predicted: self.predicted[rows.clone()].to_vec(),
            probabilities: self.probabilities[width * rows.start..width * rows.end].to_vec(),
        }
    }

    /// Concatenates predictions. If a part does not know a class, the class has probability 0 in
    /// the rows of this part.
    #[must_use]
    pub fn together<'a>(classes: &[i8], parts: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut all = Self {
            classes: classes.to_vec(),
            truth: Vec::new(),
            predicted: Vec::new(),
            probabilities: Vec::new(),
        };
        for part in parts {
            all.truth.extend_from_slice(&part.truth);
            all.predicted.extend_from_slice(&part.predicted);
            for row in part.each() {
                let of =
                    |class| part.classes.iter().position(|c| c == class).map_or(0.0, |k| row[k]);
                all.probabilities.extend(classes.iter().map(of));
            }
        }
        all
    }

    /// Quality of the probabilities.
    #[must_use]
    pub fn calibration(&self) -> Calibration {
        let rows = self.rows();
        let (mut loss, mut brier) = (0.0, 0.0);
        for (row, truth) in self.each().zip(&self.truth) {
            let mut of_truth = 0.0;
            for (p, class) in row.iter().zip(&self.classes) {
                let so = f64::from(u8::from(class == truth));
                brier += (p - so) * (p - so);
                of_truth += so * p;
            }
            // A class that the model does not know has probability 0.
            brier += f64::from(u8::from(!self.classes.contains(truth)));
            loss -= ln(of_truth.max(LEAST_PROBABILITY));
        }
        let n = rows.max(1) as f64;
        let apart = |bin: &Bin| (bin.confidence - bin.right as f64).abs();
        let calibration_error = self.bins().iter().map(apart).sum::<f64>() / n;
        Calibration { rows, log_loss: loss / n, brier: brier / n, calibration_error }
    }

    /// The calibration curve. Rows are put into ten equally wide bins of (0, 1] by their highest
    /// probability.
    #[must_use]
    pub fn bins(&self) -> [Bin; BINS] {
        let mut bins = [Bin::default(); BINS];
        for (row, truth) in self.each().zip(&self.truth) {
            let Some(top) = highest(row) else { continue };
            let bin = &mut bins[((row[top] * BINS as f64).ceil() as usize).clamp(1, BINS) - 1];
            bin.rows += 1;
            bin.confidence += row[top];
            bin.right += usize::from(self.classes[top] == *truth);
        }
        bins
    }

    /// The confusion matrix: rows are the true classes, columns the predicted classes.
    #[must_use]
    pub fn confusion(&self) -> Vec<Vec<usize>> {
        let count = |truth: &i8, predicted: &i8| {
            let pairs = self.truth.iter().zip(&self.predicted);
            pairs.filter(|(t, p)| *t == truth && *p == predicted).count()
        };
        let row = |truth| self.classes.iter().map(|predicted| count(truth, predicted)).collect();
        self.classes.iter().map(row).collect()
    }
}

/// First and last step of avoidance in one trajectory, by the human or predicted by a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Avoidance {
    /// The first step; `None` without avoidance.
    pub first: Option<usize>,
    /// The last step; `None` without avoidance.
    pub last: Option<usize>,
}

impl Avoidance {
    /// The avoidance in one trajectory. `avoids` yields, for each step, whether the human or the
    /// model avoids.
    #[must_use]
    pub fn of(avoids: impl Iterator<Item = bool>) -> Self {
        let mut steps = avoids.enumerate().filter_map(|(step, avoids)| avoids.then_some(step));
        let first = steps.next();
        Self { first, last: steps.last().or(first) }
    }
}

/// The error of the model's first or last step of avoidance, in steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distance {
    /// Mean over all trajectories. If there is no avoidance, the first step counts as one step past
    /// the end of the trajectory, and the last step counts as −1.
    pub penalised: f64,
    /// Mean over the trajectories in which both the human and the model avoid; `None` if there are
    /// none. Report it together with the number of these trajectories. Alone, it rewards a model
    /// that never predicts avoidance.
    pub both: Option<f64>,
}

/// The paper's D_start and D_end over some trajectories.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Distances {
    /// The error of the predicted first step, D_start.
    pub start: Distance,
    /// The error of the predicted last step, D_end.
    pub end: Distance,
    /// Number of trajectories in which both the human and the model avoid.
    pub both: usize,
    /// Number of trajectories.
    pub trajectories: usize,
}

impl Distances {
    /// The distances over trajectories of `steps` steps. Each trajectory is a pair: the human's
    /// avoidance and the model's.
    #[must_use]
    pub fn of(steps: usize, trajectories: &[(Avoidance, Avoidance)]) -> Self {
        let both: Vec<_> = trajectories
            .iter()
            .filter(|(human, model)| human.first.is_some() && model.first.is_some())
            .copied()
            .collect();
        let distance = |step: &dyn Fn(&Avoidance) -> f64| {
            let mean = |of: &[(Avoidance, Avoidance)]| {
                let apart = of.iter().map(|(human, model)| (step(human) - step(model)).abs());
                (!of.is_empty()).then(|| apart.sum::<f64>() / of.len() as f64)
            };
            Distance { penalised: mean(trajectories).unwrap_or(0.0), both: mean(&both) }
        };
        Self {
            start: distance(&|who| who.first.map_or(steps as f64, |step| step as f64)),
            end: distance(&|who| who.last.map_or(-1.0, |step| step as f64)),
            both: both.len(),
            trajectories: trajectories.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made(truth: &[i8], predicted: &[i8], probabilities: &[f64]) -> Predictions {
        Predictions {
            classes: vec![0, 1],
            truth: truth.to_vec(),
            predicted: predicted.to_vec(),
            probabilities: probabilities.to_vec(),
        }
    }

    /// Expected values computed by hand.
    #[test]
    fn summaries_of_four_rows() {
        let found =
            made(&[0, 1, 1, 0], &[0, 1, 0, 0], &[0.9, 0.1, 0.25, 0.75, 0.6, 0.4, 0.85, 0.15]);
        assert_eq!((found.right(), found.accuracy()), (3, 0.75));
        assert_eq!(found.confusion(), [[2, 0], [1, 1]]);
        assert_eq!(found.balanced_accuracy(), 0.75);
        assert_eq!(made(&[0, 0, 0, 1], &[0; 4], &[0.5; 8]).balanced_accuracy(), 0.5);
        assert_eq!(made(&[0, 0], &[0, 1], &[0.5; 4]).balanced_accuracy(), 0.5);
        let all = found.calibration();
        let log_loss = -(ln(0.9) + ln(0.75) + ln(0.4) + ln(0.85)) / 4.0;
        assert!((all.log_loss - log_loss).abs() < 1e-15);
        let brier = 2.0 * (0.01 + 0.0625 + 0.36 + 0.0225) / 4.0;
        assert!((all.brier - brier).abs() < 1e-15);
        // Two rows share the bin (0.8, 0.9].
        assert_eq!(found.bins()[8].rows, 2);
        let error = ((2.0 - 1.75) + (1.0 - 0.75) + 0.6) / 4.0;
        assert!((all.calibration_error - error).abs() < 1e-15);
    }

    #[test]
    fn what_cannot_be_predicted_is_missed() {
        let found = made(&[-1], &[0], &[1.0, 0.0]);
        assert_eq!(found.balanced_accuracy(), 0.0);
        assert_eq!(made(&[-1, 0], &[0, 0], &[0.5; 4]).balanced_accuracy(), 0.5);
        let all = found.calibration();
        assert!((all.brier - 2.0).abs() < 1e-15);
        assert!((all.log_loss - 15.0 * ln(10.0)).abs() < 1e-9);
        let three = Predictions::together(&[-1, 0, 1], [&found]);
        assert_eq!(
            (three.probabilities.as_slice(), three.accuracy()),
            ([0.0, 1.0, 0.0].as_slice(), 0.0)
        );
        assert_eq!(three.confusion(), [[0, 1, 0], [0, 0, 0], [0, 0, 0]]);
        assert_eq!(made(&[], &[], &[]).calibration().log_loss, 0.0);
    }

    fn avoidance(steps: &str) -> Avoidance {
        Avoidance::of(steps.chars().map(|step| step == 'a'))
    }

    #[test]
    fn both_forms_by_hand() {
        assert_eq!(avoidance("..a.a."), Avoidance { first: Some(2), last: Some(4) });
        assert_eq!(avoidance("...a.."), Avoidance { first: Some(3), last: Some(3) });
        assert_eq!(avoidance("......"), Avoidance { first: None, last: None });
        let found = Distances::of(
            6,
            &[
                (avoidance("..a.a."), avoidance(".aaa..")),
                (avoidance("..aa.."), avoidance("......")),
                (avoidance("......"), avoidance("......")),
            ],
        );
        assert_eq!((found.start.penalised, found.end.penalised), (5.0 / 3.0, 5.0 / 3.0));
        assert_eq!((found.start.both, found.end.both), (Some(1.0), Some(1.0)));
        assert_eq!((found.both, found.trajectories), (1, 3));
        assert_eq!(Distances::of(6, &[]).start.both, None);
    }
}
