//! predictor.json.

use super::boosting::BoostedFile;
use super::logistic::Logistic;
use super::scale::Scale;
use super::svm::{self, Sigmoid, Svm};
use super::tree::TreeFile;
use super::{Model, Predictor};
use crate::features::FeatureSet;
use crate::invalid::{Invalid, length};
use serde::{Deserialize, Serialize};

/// A predictor's file form, `predictor.json`; docs/predictor.md describes it for users. A
/// logistic model that was trained elsewhere can be written so and used everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(expecting = "an object, {…}, as in a predictor.json")]
pub struct PredictorFile {
    /// Always [`FORMAT`].
    pub format: String,
    /// `boosted`, `logistic`, `svm`, `tree` or `constant`.
    pub kind: String,
    /// What the classes tell, where the file says so: 1 which way somebody turns, 2 whether they
    /// turn at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub experiment: Option<u8>,
    /// Names of the features, in the order of the columns.
    pub features: Vec<String>,
    /// What is told apart: −1 right, 0 straight, 1 left.
    pub classes: Vec<i8>,
    /// The turn rate of each class, rad/s, in rising order; without it a class is
    /// multiplied by the vehicle's turn rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actions: Option<Vec<f64>>,
    /// Logistic, SVM: what is subtracted from each feature.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<Vec<f64>>,
    /// Logistic, SVM: what each feature is then divided by.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Vec<f64>>,
    /// Logistic: a row of weights a class. Linear SVM: a row a pair of classes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coefficients: Option<Vec<Vec<f64>>>,
    /// Logistic: an offset a class. SVM: an offset a pair of classes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intercepts: Option<Vec<f64>>,
    /// SVM: `linear` or `rbf`. Pairs of classes are in the order (first, second), (first,
    /// third), …, (second, third), …; a positive decision value speaks for the pair's first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kernel: Option<String>,
    /// SVM with kernel `rbf`: γ of exp(−γ |x − z|²), on standardised features.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f64>,
    /// SVM with kernel `rbf`: vectors × features, standardised.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support_vectors: Option<Vec<Vec<f64>>>,
    /// SVM with kernel `rbf`: pairs × support vectors, α times +1 or −1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dual_coefficients: Option<Vec<Vec<f64>>>,
    /// SVM: a and b of each pair; 1 / (1 + exp(a·f + b)) is the probability of the pair's
    /// first class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigmoids: Option<Vec<[f64; 2]>>,
    /// Boosted: first scores and trees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub boosted: Option<BoostedFile>,
    /// Tree: the nodes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tree: Option<TreeFile>,
    /// Constant: a probability a class.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probabilities: Option<Vec<f64>>,
}

/// The version of the file form that is read and written.
pub const FORMAT: &str = "sidestep-predictor/1";

impl From<&Predictor> for PredictorFile {
    fn from(predictor: &Predictor) -> Self {
        let mut file = Self {
            format: FORMAT.to_owned(),
            kind: String::new(),
            experiment: None,
            features: predictor.features.clone().into(),
            classes: predictor.classes.clone(),
            actions: predictor.actions.clone(),
            mean: None,
            scale: None,
            coefficients: None,
            intercepts: None,
            kernel: None,
            gamma: None,
            support_vectors: None,
            dual_coefficients: None,
            sigmoids: None,
            boosted: None,
            tree: None,
            probabilities: None,
        };
        match &predictor.model {
            Model::Boosted(model) => {
                file.kind = "boosted".to_owned();
                file.boosted = Some(model.into());
            }
            Model::Logistic(scale, model) => {
                file.kind = "logistic".to_owned();
                file.mean = Some(scale.mean().to_vec());
                file.scale = Some(scale.scale().to_vec());
                file.coefficients = Some(model.coefficients());
                file.intercepts = Some(model.intercepts().to_vec());
            }
            Model::Svm(scale, model) => {
                file.kind = "svm".to_owned();
                file.mean = Some(scale.mean().to_vec());
                file.scale = Some(scale.scale().to_vec());
                match model.kernel() {
                    svm::Kernel::Linear => {
                        file.kernel = Some("linear".to_owned());
                        file.coefficients = Some(model.coefficients());
                    }
                    svm::Kernel::Rbf { gamma } => {
                        file.kernel = Some("rbf".to_owned());
                        file.gamma = Some(gamma);
                        file.support_vectors = Some(model.support_vectors());
                        file.dual_coefficients = Some(model.dual_coefficients());
                    }
                }
                file.intercepts = Some(model.intercepts().to_vec());
                file.sigmoids = Some(model.sigmoids().iter().map(|s| [s.a, s.b]).collect());
            }
            Model::Tree(model) => {
                file.kind = "tree".to_owned();
                file.tree = Some(model.into());
            }
            Model::Constant(probabilities) => {
                file.kind = "constant".to_owned();
                file.probabilities = Some(probabilities.clone());
            }
        }
        file
    }
}

impl PredictorFile {
    /// The predictor, if its classes can be turns.
    ///
    /// # Errors
    /// [`Invalid`] for a file that says that they cannot, or one that is no predictor.
    pub fn of_turns(self) -> Result<Predictor, Invalid> {
        match self.experiment {
            None | Some(1) => self.try_into(),
            Some(2) => {
                let expected = "1, a model that tells which way somebody turns";
                Err(Invalid::new("experiment", expected, "2, one that tells only whether"))
            }
            Some(other) => Err(Invalid::new("experiment", "1 or 2, or nothing", other)),
        }
    }
}

impl TryFrom<PredictorFile> for Predictor {
    type Error = Invalid;

    fn try_from(file: PredictorFile) -> Result<Self, Invalid> {
        if file.format != FORMAT {
            return Err(Invalid::new("format", FORMAT, file.format));
        }
        let features = FeatureSet::of(&file.features)?;
        if file.classes.is_empty() || !file.classes.is_sorted_by(|a, b| a < b) {
            let expected = "at least one class, in rising order";
            return Err(Invalid::new("classes", expected, format!("{:?}", file.classes)));
        }
        let missing = |field: &str| {
            Invalid::new(field, format!("its contents, for kind {:?}", file.kind), "nothing")
        };
        let predictor = match file.kind.as_str() {
            "boosted" => {
                let model = file.boosted.ok_or_else(|| missing("boosted"))?;
                let model = model.check(features.len(), file.classes.len());
                Self::boosted(features, file.classes, model.map_err(|e| e.within("boosted"))?)
            }
            "logistic" => {
                let scale = Scale::new(
                    file.mean.ok_or_else(|| missing("mean"))?,
                    file.scale.ok_or_else(|| missing("scale"))?,
                )?;
                length("mean", features.len(), scale.mean().len())?;
                let coefficients = file.coefficients.ok_or_else(|| missing("coefficients"))?;
                let intercepts = file.intercepts.ok_or_else(|| missing("intercepts"))?;
                length("coefficients", file.classes.len(), coefficients.len())?;
                let model = Logistic::new(features.len(), &coefficients, intercepts)?;
                Self::logistic(features, file.classes, scale, model)
            }
            "svm" => {
                let scale = Scale::new(
                    file.mean.ok_or_else(|| missing("mean"))?,
                    file.scale.ok_or_else(|| missing("scale"))?,
                )?;
                length("mean", features.len(), scale.mean().len())?;
                let intercepts = file.intercepts.ok_or_else(|| missing("intercepts"))?;
                let sigmoids = file.sigmoids.ok_or_else(|| missing("sigmoids"))?;
                let sigmoids = sigmoids.into_iter().map(|[a, b]| Sigmoid { a, b }).collect();
                let (width, classes) = (features.len(), file.classes.len());
                let model = match file.kernel.as_deref() {
                    Some("linear") => {
                        let weights = file.coefficients.ok_or_else(|| missing("coefficients"))?;
                        Svm::linear(width, classes, &weights, intercepts, sigmoids)?
                    }
                    Some("rbf") => {
                        let gamma = file.gamma.ok_or_else(|| missing("gamma"))?;
                        let vectors =
                            file.support_vectors.ok_or_else(|| missing("support_vectors"))?;
                        let dual =
                            file.dual_coefficients.ok_or_else(|| missing("dual_coefficients"))?;
                        Svm::rbf(width, classes, gamma, &vectors, &dual, intercepts, sigmoids)?
                    }
                    other => {
                        let found = other.unwrap_or("nothing");
                        return Err(Invalid::new("kernel", "linear or rbf", found));
                    }
                };
                Self::svm(features, file.classes, scale, model)
            }
            "tree" => {
                let tree = file.tree.ok_or_else(|| missing("tree"))?;
                let tree = tree.check(features.len(), file.classes.len());
                Self::tree(features, file.classes, tree.map_err(|e| e.within("tree"))?)
            }
            "constant" => {
                let probabilities = file.probabilities.ok_or_else(|| missing("probabilities"))?;
                Self::constant(features, file.classes, probabilities)?
            }
            other => {
                let expected = "boosted, logistic, svm, tree or constant";
                return Err(Invalid::new("kind", expected, other));
            }
        };
        match file.actions {
            Some(actions) => predictor.with_actions(actions),
            None => Ok(predictor),
        }
    }
}
