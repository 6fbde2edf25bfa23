//! How good predictions are, row by row.

use crate::math::ln;
use serde::{Deserialize, Serialize};

/// What a model says of some rows, and what was so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Predictions {
    /// What is told apart, in rising order.
    pub classes: Vec<i8>,
    /// The class of each row.
    pub truth: Vec<i8>,
    /// The class that the model names.
    pub predicted: Vec<i8>,
    /// Row after row, the probability of each class.
    pub probabilities: Vec<f64>,
}

/// Summaries over some rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Rows.
    pub rows: usize,
    /// Mean −ln of the probability of what was so, nats; probabilities below 10⁻¹⁵ count as that.
    pub log_loss: f64,
    /// Brier's score (Monthly Weather Review 78, 1950): the mean over rows of the sum over classes
    /// of (probability − what was so)², from 0 to 2.
    pub brier: f64,
    /// Expected calibration error: over ten bins of the highest probability, the mean of how far
    /// it is from the share of rows where that class was right, weighted by rows.
    pub calibration_error: f64,
}

/// One bin of a calibration curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Rows in it.
    pub rows: usize,
    /// Sum of their highest probabilities.
    pub confidence: f64,
    /// In how many of them that class was right.
    pub right: usize,
}

/// Bins of a calibration curve.
pub const BINS: usize = 10;

const LEAST_PROBABILITY: f64 = 1e-15;

impl Predictions {
    /// How many rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.truth.len()
    }

    /// Rows in which the predicted class was right.
    #[must_use]
    pub fn right(&self) -> usize {
        self.truth
            .iter()
            .zip(&self.predicted)
            .filter(|(truth, predicted)| truth == predicted)
            .count()
    }

    /// Their share, from 0 to 1; 0 without rows.
    #[must_use]
    pub fn accuracy(&self) -> f64 {
        self.right() as f64 / self.rows().max(1) as f64
    }

    /// The probabilities of each row.
    pub fn each(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.probabilities.chunks_exact(self.classes.len())
    }

    /// All of them as one.
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

    /// How good the probabilities are.
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
            // What cannot be predicted at all is missed as if with probability 0.
            brier += f64::from(u8::from(!self.classes.contains(truth)));
            loss -= ln(of_truth.max(LEAST_PROBABILITY));
        }
        let n = rows.max(1) as f64;
        let apart = |bin: &Bin| (bin.confidence - bin.right as f64).abs();
        let calibration_error = self.bins().iter().map(apart).sum::<f64>() / n;
        Calibration { rows, log_loss: loss / n, brier: brier / n, calibration_error }
    }

    /// The calibration curve: rows by their highest probability, in ten equal bins of (0, 1].
    #[must_use]
    pub fn bins(&self) -> [Bin; BINS] {
        let mut bins = [Bin::default(); BINS];
        for (row, truth) in self.each().zip(&self.truth) {
            let Some(top) = (0..row.len()).reduce(|a, b| if row[b] > row[a] { b } else { a })
            else {
                continue;
            };
            let bin = &mut bins[((row[top] * BINS as f64).ceil() as usize).clamp(1, BINS) - 1];
            bin.rows += 1;
            bin.confidence += row[top];
            bin.right += usize::from(self.classes[top] == *truth);
        }
        bins
    }

    /// How often each class (rows) was predicted as each (columns).
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

    /// By hand.
    #[test]
    fn summaries_of_four_rows() {
        let found =
            made(&[0, 1, 1, 0], &[0, 1, 0, 0], &[0.9, 0.1, 0.25, 0.75, 0.6, 0.4, 0.85, 0.15]);
        assert_eq!((found.right(), found.accuracy()), (3, 0.75));
        assert_eq!(found.confusion(), [[2, 0], [1, 1]]);
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
}
