//! Logistic regression: probabilities in proportion to e to the power of linear scores.
//! [`learn::logistic`](crate::learn::logistic) trains it.

use super::scale::Scale;
use crate::invalid::{Invalid, finite, length};
use crate::math::exp;

/// A row of weights and an intercept for each class. Of two classes that were trained here,
/// the first has zeros and the second the weights of its log-odds.
#[derive(Clone, Debug, PartialEq)]
pub struct Logistic {
    width: usize,
    /// Row-major: classes × (weights …, intercept).
    weights: Vec<f64>,
    intercepts: Vec<f64>,
}

impl Logistic {
    /// A model from its numbers: one row of `width` weights and one intercept a class.
    ///
    /// # Errors
    /// [`Invalid`] if a length is wrong or a number is not finite.
    pub fn new(
        width: usize,
        coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
    ) -> Result<Self, Invalid> {
        length("intercepts", coefficients.len(), intercepts.len())?;
        let mut weights = Vec::with_capacity(coefficients.len() * width);
        for (class, row) in coefficients.iter().enumerate() {
            length(&format!("coefficients[{class}]"), width, row.len())?;
            for (j, &weight) in row.iter().enumerate() {
                weights.push(finite(&format!("coefficients[{class}][{j}]"), weight)?);
            }
            finite(&format!("intercepts[{class}]"), intercepts[class])?;
        }
        Ok(Self { width, weights, intercepts })
    }

    /// One row of weights a class.
    #[must_use]
    pub fn coefficients(&self) -> Vec<Vec<f64>> {
        self.weights.chunks_exact(self.width).map(<[f64]>::to_vec).collect()
    }

    /// One offset a class.
    #[must_use]
    pub fn intercepts(&self) -> &[f64] {
        &self.intercepts
    }

    /// Writes the probability of each class to `out`, given a row of raw features.
    pub fn probabilities_into(&self, scale: &Scale, row: &[f64], out: &mut [f64]) {
        let weights = self.weights.chunks_exact(self.width);
        for ((weights, &intercept), score) in weights.zip(&self.intercepts).zip(out.iter_mut()) {
            let terms = weights.iter().zip(row).enumerate();
            *score = terms.fold(intercept, |sum, (j, (w, &value))| sum + w * scale.apply(j, value));
        }
        softmax(out);
    }
}

/// Scores to probabilities.
pub(super) fn softmax(scores: &mut [f64]) {
    let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut total = 0.0;
    for score in scores.iter_mut() {
        *score = exp(*score - top);
        total += *score;
    }
    for score in scores.iter_mut() {
        *score /= total;
    }
}
