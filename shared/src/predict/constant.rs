//! A model with constant probabilities, which do not depend on the features.

use super::kind::{Kind, field};
use super::{Model, Predictor};
use crate::features::FeatureSet;
use crate::invalid::{Invalid, length};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A probability for each class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Constant {
    probabilities: Vec<f64>,
}

impl Predictor {
    /// A predictor with constant probabilities. The feature set may be empty.
    ///
    /// # Errors
    /// [`Invalid`] if there is not exactly one probability ≥ 0 per class, or the probabilities do
    /// not sum to 1.
    pub fn constant(
        features: FeatureSet,
        classes: Vec<i8>,
        probabilities: Vec<f64>,
    ) -> Result<Self, Invalid> {
        let model = Constant::of_file(Constant { probabilities }, features.len(), classes.len())?;
        Ok(Self::new(features, classes, Model::Constant(model)))
    }
}

impl Kind for Constant {
    type File = Self;
    const NEEDS_FEATURES: bool = false;

    fn read(document: &Value) -> Result<Self, Invalid> {
        Ok(Self { probabilities: field(document, "probabilities")? })
    }

    fn of_file(file: Self, _width: usize, classes: usize) -> Result<Self, Invalid> {
        let probabilities = &file.probabilities;
        length("probabilities", classes, probabilities.len())?;
        let total: f64 = probabilities.iter().sum();
        if probabilities.iter().any(|p| !(0.0..=1.0).contains(p)) || (total - 1.0).abs() > 1e-9 {
            let expected = "numbers from 0 to 1 that sum to 1";
            return Err(Invalid::new("probabilities", expected, format!("{probabilities:?}")));
        }
        Ok(file)
    }

    fn to_file(&self) -> Self {
        self.clone()
    }

    fn probabilities_into(&self, _row: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&self.probabilities);
    }
}
