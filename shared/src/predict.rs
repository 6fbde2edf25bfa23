//! Predictors: numbers in, a probability for each class out. Nothing here knows
//! what a feature or a class means.

pub mod boosting;
mod file;
pub mod logistic;
pub mod scale;
pub mod svm;
pub mod tree;

use crate::features::FeatureSet;
use crate::invalid::{Invalid, finite, length};
use boosting::Boosted;
pub use file::{FORMAT, PredictorFile};
use logistic::Logistic;
use scale::Scale;
use svm::Svm;
use tree::Tree;

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
