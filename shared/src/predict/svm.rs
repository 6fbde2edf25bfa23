//! Support vector machines, one for each pair of classes.
//!
//! Each pair (a, b) with a < b has a decision value f. The pair votes for a if f > 0, otherwise for
//! b. Pairs are in the order (0, 1), (0, 2), …, (1, 2), …. The class with the most votes wins. Ties
//! go to the first class. Signs, order and votes are the same as in libsvm.

mod pairs;
mod coupling;
pub(crate) mod exponential;
mod support;

use super::kind::Kind;
use super::scale::Scale;
use super::{Model, Predictor, flat};
use crate::document::from_value;
use crate::features::FeatureSet;
use crate::invalid::{Invalid, all_moderate, length, positive};
use crate::math::exp;
pub use pairs::{pair_count, pairs, vote};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use support::Support;

/// A kernel, which generalises the inner product of two standardised rows.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Kernel {
    /// x·z.
    Linear,
    /// exp(−γ |x − z|²).
    Rbf {
        /// γ > 0.
        gamma: f64,
    },
}

/// Platt's sigmoid, which maps a decision value f to the probability P = 1 / (1 + exp(a·f + b)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigmoid {
    /// Slope; negative if greater decision values favour the pair's first class.
    pub a: f64,
    /// Offset.
    pub b: f64,
}

impl Sigmoid {
    /// The probability of the pair's first class.
    #[must_use]
    pub fn probability(self, decision: f64) -> f64 {
        let z = self.a * decision + self.b;
        // Both forms are mathematically equal. Each is used where its exponential is at most 1.
        if z >= 0.0 { exp(-z) / (1.0 + exp(-z)) } else { 1.0 / (1.0 + exp(z)) }
    }
}

/// A binary SVM and a sigmoid for each pair of classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Svm {
    width: usize,
    classes: usize,
    pairwise: Pairwise,
    /// One intercept per pair.
    intercepts: Vec<f64>,
    /// One sigmoid per pair.
    sigmoids: Vec<Sigmoid>,
}

/// The SVMs of all pairs.
#[derive(Clone, Debug, PartialEq)]
enum Pairwise {
    /// Weights, row-major: pairs × features.
    Linear(Vec<f64>),
    Rbf(Support),
}

/// The fields of an [`Svm`] on standardised features, in a file. `kernel` selects the variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SvmFile {
    /// `"kernel": "linear"`.
    Linear(LinearSvmFile),
    /// `"kernel": "rbf"`.
    Rbf(RbfSvmFile),
}

/// Names of the kernels in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum KernelWord {
    Linear,
    Rbf,
}

/// The fields of a linear [`Svm`] in a file. Pairs of classes are in the order (first, second),
/// (first, third), …, (second, third), …. A positive decision value is a vote for the pair's first
/// class.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LinearSvmFile {
    /// The mean of each feature, which is subtracted from the feature.
    pub mean: Vec<f64>,
    /// The divisor of each feature, which is applied after the subtraction of the mean.
    pub scale: Vec<f64>,
    /// Weights: pairs × features.
    pub coefficients: Vec<Vec<f64>>,
    /// An intercept for each pair.
    pub intercepts: Vec<f64>,
    kernel: KernelWord,
    /// a and b of each pair: 1 / (1 + exp(a·f + b)) is the probability of the pair's first class.
    pub sigmoids: Vec<[f64; 2]>,
}

/// The fields of an [`Svm`] with radial basis functions, in a file. Pairs are in the same order as
/// in [`LinearSvmFile`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RbfSvmFile {
    /// The mean of each feature, which is subtracted from the feature.
    pub mean: Vec<f64>,
    /// The divisor of each feature, which is applied after the subtraction of the mean.
    pub scale: Vec<f64>,
    /// An intercept for each pair.
    pub intercepts: Vec<f64>,
    kernel: KernelWord,
    /// γ of exp(−γ |x − z|²), on standardised features.
    pub gamma: f64,
    /// Standardised support vectors: vectors × features.
    pub support_vectors: Vec<Vec<f64>>,
    /// Dual coefficients (α times +1 or −1): pairs × support vectors.
    pub dual_coefficients: Vec<Vec<f64>>,
    /// a and b of each pair, as in [`LinearSvmFile`].
    pub sigmoids: Vec<[f64; 2]>,
}

impl SvmFile {
    /// The fields of a model and its scale.
    fn of(scale: &Scale, model: &Svm) -> Self {
        let (mean, scale) = (scale.mean().to_vec(), scale.scale().to_vec());
        let intercepts = model.intercepts.clone();
        let sigmoids = model.sigmoids.iter().map(|sigmoid| [sigmoid.a, sigmoid.b]).collect();
        match &model.pairwise {
            Pairwise::Linear(weights) => Self::Linear(LinearSvmFile {
                mean,
                scale,
                coefficients: weights.chunks(model.width).map(<[f64]>::to_vec).collect(),
                intercepts,
                kernel: KernelWord::Linear,
                sigmoids,
            }),
            Pairwise::Rbf(support) => Self::Rbf(RbfSvmFile {
                mean,
                scale,
                intercepts,
                kernel: KernelWord::Rbf,
                gamma: support.gamma(),
                support_vectors: support.vectors(),
                dual_coefficients: support.dual(),
                sigmoids,
            }),
        }
    }

    /// Reads the fields of the kernel that the document names.
    fn read(document: &Value) -> Result<Self, Invalid> {
        let Some(kernel) = document.get("kernel") else {
            return Err(Invalid::new("kernel", "linear or rbf", "none"));
        };
        // The files of both kernels refuse other words.
        Ok(match kernel.as_str() {
            Some("rbf") => Self::Rbf(from_value(document)?),
            _ => Self::Linear(from_value(document)?),
        })
    }

    /// Checks the fields and builds the scale and the model, for `width` features and `classes`
    /// classes.
    ///
    /// # Errors
    /// [`Invalid`] if lengths do not match, a number is not finite or γ is not > 0.
    pub(super) fn check(self, width: usize, classes: usize) -> Result<(Scale, Svm), Invalid> {
        let scaled = |mean, scale| {
            let scale = Scale::new(mean, scale)?;
            length("mean", width, scale.mean().len())?;
            Ok(scale)
        };
        let sigmoids = |pairs: Vec<[f64; 2]>| pairs.into_iter().map(|[a, b]| Sigmoid { a, b });
        match self {
            Self::Linear(file) => {
                let scale = scaled(file.mean, file.scale)?;
                let sigmoids = sigmoids(file.sigmoids).collect();
                let svm =
                    Svm::linear(width, classes, &file.coefficients, file.intercepts, sigmoids)?;
                Ok((scale, svm))
            }
            Self::Rbf(file) => {
                let scale = scaled(file.mean, file.scale)?;
                let sigmoids = sigmoids(file.sigmoids).collect();
                let (vectors, dual) = (&file.support_vectors, &file.dual_coefficients);
                let (gamma, intercepts) = (file.gamma, file.intercepts);
                let svm = Svm::rbf(width, classes, gamma, vectors, dual, intercepts, sigmoids)?;
                Ok((scale, svm))
            }
        }
    }
}

impl Svm {
    /// Linear SVMs. Each pair of classes has a row of `width` weights, an intercept and a sigmoid.
    ///
    /// # Errors
    /// [`Invalid`] if lengths do not match or a number is not finite.
    pub fn linear(
        width: usize,
        classes: usize,
        coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
        sigmoids: Vec<Sigmoid>,
    ) -> Result<Self, Invalid> {
        length("coefficients", pair_count(classes), coefficients.len())?;
        let weights = flat("coefficients", width, coefficients)?;
        Self::new(width, classes, Pairwise::Linear(weights), intercepts, sigmoids)
    }

    /// SVMs with radial basis functions. A decision value f is the intercept plus the sum, over the
    /// support vectors, of the dual coefficient times exp(−γ |x − vector|²). `support_vectors` are
    /// rows of `width` standardised features, shared by all pairs. `dual_coefficients` has a row
    /// for each pair, with an entry for each vector.
    ///
    /// # Errors
    /// [`Invalid`] if lengths do not match, a number is not finite or γ is not > 0.
    pub fn rbf(
        width: usize,
        classes: usize,
        gamma: f64,
        support_vectors: &[Vec<f64>],
        dual_coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
        sigmoids: Vec<Sigmoid>,
    ) -> Result<Self, Invalid> {
        positive("gamma", gamma)?;
        let vectors = flat("support_vectors", width, support_vectors)?;
        length("dual_coefficients", pair_count(classes), dual_coefficients.len())?;
        let dual = flat("dual_coefficients", support_vectors.len(), dual_coefficients)?;
        let support =
            Support::new(gamma, width, support_vectors.len(), &vectors, &dual, intercepts.len());
        Self::new(width, classes, Pairwise::Rbf(support), intercepts, sigmoids)
    }

    fn new(
        width: usize,
        classes: usize,
        pairwise: Pairwise,
        intercepts: Vec<f64>,
        sigmoids: Vec<Sigmoid>,
    ) -> Result<Self, Invalid> {
        if classes < 2 {
            return Err(Invalid::new("classes", "at least 2 classes", classes));
        }
        length("intercepts", pair_count(classes), intercepts.len())?;
        all_moderate("intercepts", &intercepts)?;
        length("sigmoids", intercepts.len(), sigmoids.len())?;
        for (pair, sigmoid) in sigmoids.iter().enumerate() {
            all_moderate(&format!("sigmoids[{pair}]"), &[sigmoid.a, sigmoid.b])?;
        }
        Ok(Self { width, classes, pairwise, intercepts, sigmoids })
    }

    /// The decision value of each pair for a row of raw features.
    #[must_use]
    pub fn decisions(&self, scale: &Scale, row: &[f64]) -> Vec<f64> {
        let row = scale.row(row);
        let mut decisions = self.intercepts.clone();
        match &self.pairwise {
            Pairwise::Linear(weights) => {
                for (decision, weights) in decisions.iter_mut().zip(weights.chunks(self.width)) {
                    *decision = weights.iter().zip(&row).fold(*decision, |sum, (w, x)| sum + w * x);
                }
            }
            Pairwise::Rbf(support) => support.add_to(&row, &mut decisions),
        }
        decisions
    }

    /// The class with the most votes, as an index from 0 to classes − 1. It can differ from the
    /// most probable class.
    #[must_use]
    pub fn class(&self, scale: &Scale, row: &[f64]) -> usize {
        vote(self.classes, self.decisions(scale, row))
    }

    /// Writes the probability of each class to `out`, given a row of raw features.
    pub fn probabilities_into(&self, scale: &Scale, row: &[f64], out: &mut [f64]) {
        let decisions = self.decisions(scale, row);
        couple(&self.sigmoids, &decisions, out);
    }
}

/// Computes class probabilities from the decision value of each pair. The sigmoid of a pair gives a
/// pairwise probability. Pairwise coupling combines these probabilities (Wu, Lin, Weng 2004, the
/// second method).
pub fn couple(sigmoids: &[Sigmoid], decisions: &[f64], out: &mut [f64]) {
    let pairwise = sigmoids.iter().zip(decisions).map(|(sigmoid, &f)| sigmoid.probability(f));
    coupling::couple(&pairwise.collect::<Vec<_>>(), out);
}

impl Predictor {
    /// Support vector machines on standardised features.
    #[must_use]
    pub fn svm(features: FeatureSet, classes: Vec<i8>, scale: Scale, model: Svm) -> Self {
        Self::new(features, classes, Model::Svm((scale, model)))
    }
}

impl Kind for (Scale, Svm) {
    type File = SvmFile;

    fn read(document: &Value) -> Result<SvmFile, Invalid> {
        SvmFile::read(document)
    }

    fn of_file(file: SvmFile, width: usize, classes: usize) -> Result<Self, Invalid> {
        file.check(width, classes)
    }

    fn to_file(&self) -> SvmFile {
        SvmFile::of(&self.0, &self.1)
    }

    fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        self.1.probabilities_into(&self.0, row, out);
    }

    /// The class with the most votes.
    fn class(&self, row: &[f64], _classes: usize) -> usize {
        self.1.class(&self.0, row)
    }
}

#[cfg(test)]
mod tests;
