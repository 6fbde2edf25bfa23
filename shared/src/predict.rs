//! Predictors: numbers in, a probability for each class out. Nothing here knows
//! what a feature or a class means.

pub mod boosting;
pub mod logistic;
pub mod scale;
pub mod svm;
pub mod tree;

use crate::features::FeatureSet;
use crate::invalid::{Invalid, finite, length};
use boosting::{Boosted, BoostedFile};
use logistic::Logistic;
use scale::Scale;
use serde::{Deserialize, Serialize};
use svm::{Sigmoid, Svm};
use tree::{Tree, TreeFile};

/// A trained model with the features it wants.
#[derive(Clone, Debug, PartialEq)]
pub struct Predictor {
    features: FeatureSet,
    classes: Vec<i8>,
    actions: Option<Vec<f64>>,
    model: Model,
}

/// The kinds of predictor.
#[derive(Clone, Debug, PartialEq)]
enum Model {
    Boosted(Boosted),
    Logistic(Scale, Logistic),
    Svm(Scale, Svm),
    Tree(Tree),
    Constant(Vec<f64>),
}

impl Predictor {
    /// A multinomial logistic regression on standardised features.
    #[must_use]
    pub fn logistic(features: FeatureSet, classes: Vec<i8>, scale: Scale, model: Logistic) -> Self {
        Self { features, classes, actions: None, model: Model::Logistic(scale, model) }
    }

    /// Support vector machines on standardised features.
    #[must_use]
    pub fn svm(features: FeatureSet, classes: Vec<i8>, scale: Scale, model: Svm) -> Self {
        Self { features, classes, actions: None, model: Model::Svm(scale, model) }
    }

    /// Boosted trees on features as they are ([`Boosted::unscaled`]).
    #[must_use]
    pub fn boosted(features: FeatureSet, classes: Vec<i8>, model: Boosted) -> Self {
        Self { features, classes, actions: None, model: Model::Boosted(model) }
    }

    /// A decision tree on features as they are ([`Tree::unscaled`]).
    #[must_use]
    pub fn tree(features: FeatureSet, classes: Vec<i8>, model: Tree) -> Self {
        Self { features, classes, actions: None, model: Model::Tree(model) }
    }

    /// The same probabilities whatever the features.
    ///
    /// # Errors
    /// [`Invalid`] if there is not one probability ≥ 0 a class, summing to 1.
    pub fn constant(
        features: FeatureSet,
        classes: Vec<i8>,
        probabilities: Vec<f64>,
    ) -> Result<Self, Invalid> {
        length("probabilities", classes.len(), probabilities.len())?;
        let total: f64 = probabilities.iter().sum();
        if probabilities.iter().any(|p| !(0.0..=1.0).contains(p)) || (total - 1.0).abs() > 1e-9 {
            let expected = "numbers from 0 to 1 that sum to 1";
            return Err(Invalid::new("probabilities", expected, format!("{probabilities:?}")));
        }
        Ok(Self { features, classes, actions: None, model: Model::Constant(probabilities) })
    }

    /// The same predictor with the turn rate of each class, rad/s. Without them the
    /// classes are turns: −1 right, 0 straight, 1 left.
    ///
    /// # Errors
    /// [`Invalid`] if there is not one finite rate a class, in rising order.
    pub fn with_actions(self, actions: Vec<f64>) -> Result<Self, Invalid> {
        length("actions", self.classes.len(), actions.len())?;
        for (i, &rate) in actions.iter().enumerate() {
            finite(&format!("actions[{i}]"), rate)?;
        }
        if !actions.is_sorted_by(|a, b| a < b) {
            let expected = "turn rates in rising order";
            return Err(Invalid::new("actions", expected, format!("{actions:?}")));
        }
        Ok(Self { actions: Some(actions), ..self })
    }

    /// The turn rate of each class, rad/s, if they were given.
    #[must_use]
    pub fn actions(&self) -> Option<&[f64]> {
        self.actions.as_deref()
    }

    /// What it looks at.
    #[must_use]
    pub fn features(&self) -> &FeatureSet {
        &self.features
    }

    /// What it tells apart, in rising order.
    #[must_use]
    pub fn classes(&self) -> &[i8] {
        &self.classes
    }

    /// The class that the model names, given a row of raw features: the likeliest, the first on a
    /// tie; of an SVM the one with the most votes.
    #[must_use]
    pub fn class(&self, row: &[f64]) -> i8 {
        if let Model::Svm(scale, model) = &self.model {
            return self.classes[model.class(scale, row)];
        }
        let mut p = vec![0.0; self.classes.len()];
        self.probabilities_into(row, &mut p);
        let likelier = |best: usize, k: usize| if p[k] > p[best] { k } else { best };
        (0..p.len()).reduce(likelier).map_or(0, |k| self.classes[k])
    }

    /// Writes the probability of each class to `out`, given a row of raw features.
    pub fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        match &self.model {
            Model::Boosted(model) => model.probabilities_into(row, out),
            Model::Logistic(scale, model) => model.probabilities_into(scale, row, out),
            Model::Svm(scale, model) => model.probabilities_into(scale, row, out),
            Model::Tree(model) => model.probabilities_into(row, out),
            Model::Constant(probabilities) => out.copy_from_slice(probabilities),
        }
    }
}

/// A predictor's file form, `predictor.json`. A logistic model that was trained
/// elsewhere can be written so and used everywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> PredictorFile {
        let text = r#"{"format":"sidestep-predictor/1","kind":"logistic",
            "features":["distance","v_h"],"mean":[10,1],"scale":[2,1],"classes":[-1,0,1],
            "coefficients":[[0,1],[1,0],[0,-1]],"intercepts":[0,0.5,0]}"#;
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn a_file_survives_a_round_trip() {
        let predictor = Predictor::try_from(file()).unwrap();
        assert_eq!(PredictorFile::from(&predictor), file());
        let mut p = [0.0; 3];
        predictor.probabilities_into(&[10.0, 1.0], &mut p);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert!((p[1] / p[0] - crate::math::exp(0.5)).abs() < 1e-12);
    }

    #[test]
    fn actions_survive_too() {
        let mut file = file();
        file.actions = Some(vec![-0.3, 0.1, 0.6]);
        let predictor = Predictor::try_from(file.clone()).unwrap();
        assert_eq!(predictor.actions(), file.actions.as_deref());
        assert_eq!(PredictorFile::from(&predictor), file);
    }

    #[test]
    fn boosted_trees_are_a_predictor() {
        let text = r#"{"format":"sidestep-predictor/1","kind":"boosted","features":["v_h"],
            "classes":[0,1],"boosted":{"intercepts":[0],"trees":[{"feature":[0,0,0],
            "threshold":[0.5,0,0],"left":[1,0,0],"right":[2,0,0],"value":[0,1,-1]}]}}"#;
        let file: PredictorFile = serde_json::from_str(text).unwrap();
        let predictor = Predictor::try_from(file.clone()).unwrap();
        assert_eq!(PredictorFile::from(&predictor), file);
        let mut p = [0.0; 2];
        predictor.probabilities_into(&[0.4], &mut p);
        assert!((p[1] / p[0] - crate::math::exp(1.0)).abs() < 1e-14);
        let complain = |change: fn(&mut PredictorFile)| {
            let mut file = file.clone();
            change(&mut file);
            Predictor::try_from(file).unwrap_err().field
        };
        assert_eq!(complain(|f| f.boosted = None), "boosted");
        assert_eq!(complain(|f| f.classes = vec![-1, 0, 1]), "boosted.intercepts");
        let bad = |f: &mut PredictorFile| {
            if let Some(boosted) = &mut f.boosted {
                boosted.trees[0].questions.left[0] = 7;
            }
        };
        assert_eq!(complain(bad), "boosted.trees[0].left[0]");
    }

    #[test]
    fn a_tree_is_a_predictor() {
        let text = r#"{"format":"sidestep-predictor/1","kind":"tree","features":["distance","v_h"],
            "classes":[-1,0,1],"tree":{"feature":[1,0,0],"threshold":[0.5,0,0],"left":[1,0,0],
            "right":[2,0,0],"counts":[[2,3,1],[2,0,1],[0,3,0]]}}"#;
        let file: PredictorFile = serde_json::from_str(text).unwrap();
        let predictor = Predictor::try_from(file.clone()).unwrap();
        assert_eq!(PredictorFile::from(&predictor), file);
        let mut p = [0.0; 3];
        predictor.probabilities_into(&[9.0, 0.4], &mut p);
        assert_eq!(p, [0.5, 1.0 / 6.0, 2.0 / 6.0]);
        let complain = |change: fn(&mut PredictorFile)| {
            let mut file = file.clone();
            change(&mut file);
            Predictor::try_from(file).unwrap_err().field
        };
        assert_eq!(complain(|f| f.tree = None), "tree");
        assert_eq!(complain(|f| f.classes = vec![0, 1]), "tree.counts[0]");
        assert_eq!(complain(|f| f.features = vec!["v_h".into()]), "tree.feature[0]");
    }

    #[test]
    fn complaints_name_the_field() {
        let complain = |change: fn(&mut PredictorFile)| {
            let mut file = file();
            change(&mut file);
            Predictor::try_from(file).unwrap_err().field
        };
        assert_eq!(complain(|f| f.format = "x".into()), "format");
        assert_eq!(complain(|f| f.kind = "oracle".into()), "kind");
        assert_eq!(complain(|f| f.features[1] = "speed".into()), "features[1]");
        assert_eq!(complain(|f| f.classes = vec![1, 0, -1]), "classes");
        assert_eq!(complain(|f| f.scale = Some(vec![1.0, 0.0])), "scale[1]");
        assert_eq!(complain(|f| f.mean = None), "mean");
        assert_eq!(complain(|f| f.actions = Some(vec![0.0, 0.5])), "actions");
        assert_eq!(complain(|f| f.actions = Some(vec![0.0, 0.5, 0.5])), "actions");
        assert_eq!(complain(|f| f.actions = Some(vec![0.0, f64::NAN, 0.5])), "actions[1]");
        assert_eq!(complain(|f| f.intercepts = Some(vec![0.0])), "intercepts");
        assert_eq!(complain(|f| f.coefficients = Some(vec![vec![0.0; 2]; 2])), "coefficients");
        assert_eq!(
            complain(|f| f.coefficients = Some(vec![vec![0.0, f64::NAN]; 3])),
            "coefficients[0][1]"
        );
    }

    fn rbf() -> PredictorFile {
        let text = r#"{"format":"sidestep-predictor/1","kind":"svm","features":["distance","v_h"],
            "mean":[10,1],"scale":[2,1],"classes":[-1,0,1],"kernel":"rbf","gamma":0.5,
            "support_vectors":[[0,1],[1,0.5]],"dual_coefficients":[[1,-1],[0.5,0],[0,-2]],
            "intercepts":[0,0.5,0],"sigmoids":[[-1,0],[-2,0.1],[-1,0.2]]}"#;
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn support_vector_machines_survive_a_round_trip() {
        let mut linear = rbf();
        (linear.kernel, linear.coefficients) =
            (Some("linear".into()), Some(vec![vec![1.0, 2.0], vec![0.0, 1.0], vec![3.0, -1.0]]));
        (linear.gamma, linear.support_vectors, linear.dual_coefficients) = (None, None, None);
        for file in [rbf(), linear] {
            let predictor = Predictor::try_from(file.clone()).unwrap();
            assert_eq!(PredictorFile::from(&predictor), file);
            let mut p = [0.0; 3];
            predictor.probabilities_into(&[10.0, 1.0], &mut p);
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn complaints_about_support_vector_machines_name_the_field() {
        let complain = |change: fn(&mut PredictorFile)| {
            let mut file = rbf();
            change(&mut file);
            Predictor::try_from(file).unwrap_err().field
        };
        assert_eq!(complain(|f| f.kernel = None), "kernel");
        assert_eq!(complain(|f| f.kernel = Some("poly".into())), "kernel");
        assert_eq!(complain(|f| f.kernel = Some("linear".into())), "coefficients");
        assert_eq!(complain(|f| f.gamma = None), "gamma");
        assert_eq!(complain(|f| f.gamma = Some(0.0)), "gamma");
        assert_eq!(complain(|f| f.mean = Some(vec![0.0])), "scale");
        assert_eq!(complain(|f| f.support_vectors = None), "support_vectors");
        assert_eq!(
            complain(|f| f.support_vectors = Some(vec![vec![0.0; 2], vec![0.0; 3]])),
            "support_vectors[1]"
        );
        assert_eq!(complain(|f| f.dual_coefficients = None), "dual_coefficients");
        assert_eq!(
            complain(|f| f.dual_coefficients = Some(vec![vec![0.0; 2]; 2])),
            "dual_coefficients"
        );
        assert_eq!(
            complain(|f| f.dual_coefficients = Some(vec![vec![0.0, f64::NAN]; 3])),
            "dual_coefficients[0][1]"
        );
        assert_eq!(complain(|f| f.intercepts = Some(vec![0.0; 2])), "intercepts");
        assert_eq!(complain(|f| f.sigmoids = None), "sigmoids");
        assert_eq!(complain(|f| f.sigmoids = Some(vec![[0.0, 0.0]; 2])), "sigmoids");
        assert_eq!(
            complain(|f| f.sigmoids = Some(vec![[0.0, f64::INFINITY]; 3])),
            "sigmoids[0][1]"
        );
        assert_eq!(
            complain(|f| {
                f.classes = vec![0];
                f.intercepts = Some(vec![]);
                f.sigmoids = Some(vec![]);
                f.dual_coefficients = Some(vec![]);
            }),
            "classes"
        );
    }
}
