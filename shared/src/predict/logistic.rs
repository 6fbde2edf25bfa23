//! Logistic regression: probabilities are the softmax of linear scores.
//! [`learn::logistic`](crate::learn::logistic) trains it.

use super::kind::Kind;
use super::scale::Scale;
use super::{Model, Predictor};
use crate::document::from_value;
use crate::features::FeatureSet;
use crate::invalid::{Invalid, all_moderate, length};
use crate::math::exp;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A row of weights and an intercept for each class. With two classes, training in this crate sets
/// the first row to zeros and the second row to the weights of the second class's log-odds.
#[derive(Clone, Debug, PartialEq)]
pub struct Logistic {
    width: usize,
    /// Row-major: classes × features.
    weights: Vec<f64>,
    intercepts: Vec<f64>,
}

/// The fields of a [`Logistic`] on standardised features, in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogisticFile {
    /// The mean of each feature, which is subtracted from the feature.
    pub mean: Vec<f64>,
    /// The divisor of each feature, which is applied after the subtraction of the mean.
    pub scale: Vec<f64>,
    /// Weights: classes × features.
    pub coefficients: Vec<Vec<f64>>,
    /// An intercept for each class.
    pub intercepts: Vec<f64>,
}

impl LogisticFile {
    /// The fields of a model and its scale.
    fn of(scale: &Scale, model: &Logistic) -> Self {
        Self {
            mean: scale.mean().to_vec(),
            scale: scale.scale().to_vec(),
            coefficients: model.coefficients(),
            intercepts: model.intercepts().to_vec(),
        }
    }

    /// Checks the fields and builds the scale and the model, for `width` features and `classes`
    /// classes.
    ///
    /// # Errors
    /// [`Invalid`] if a length is wrong or a number is not finite.
    fn check(self, width: usize, classes: usize) -> Result<(Scale, Logistic), Invalid> {
        let scale = Scale::new(self.mean, self.scale)?;
        length("mean", width, scale.mean().len())?;
        length("coefficients", classes, self.coefficients.len())?;
        Ok((scale, Logistic::new(width, &self.coefficients, self.intercepts)?))
    }
}

impl Logistic {
    /// A model with a row of `width` weights and an intercept for each class.
    ///
    /// # Errors
    /// [`Invalid`] if lengths do not match or a number is not finite.
    pub fn new(
        width: usize,
        coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
    ) -> Result<Self, Invalid> {
        length("intercepts", coefficients.len(), intercepts.len())?;
        let weights = super::flat("coefficients", width, coefficients)?;
        all_moderate("intercepts", &intercepts)?;
        Ok(Self { width, weights, intercepts })
    }

    /// A row of weights for each class.
    #[must_use]
    pub fn coefficients(&self) -> Vec<Vec<f64>> {
        self.weights.chunks_exact(self.width).map(<[f64]>::to_vec).collect()
    }

    /// An intercept for each class.
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

/// Converts scores to probabilities, in place.
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

impl Predictor {
    /// A multinomial logistic regression on standardised features.
    #[must_use]
    pub fn logistic(features: FeatureSet, classes: Vec<i8>, scale: Scale, model: Logistic) -> Self {
        Self::new(features, classes, Model::Logistic((scale, model)))
    }
}

impl Kind for (Scale, Logistic) {
    type File = LogisticFile;

    fn read(document: &Value) -> Result<LogisticFile, Invalid> {
        from_value(document)
    }

    fn of_file(file: LogisticFile, width: usize, classes: usize) -> Result<Self, Invalid> {
        file.check(width, classes)
    }

    fn to_file(&self) -> LogisticFile {
        LogisticFile::of(&self.0, &self.1)
    }

    fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        self.1.probabilities_into(&self.0, row, out);
    }
}
