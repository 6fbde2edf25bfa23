//! A predictor maps a row of numbers to a probability for each class. It knows nothing about the
//! meaning of features or classes. Each kind of model has its own source file, which also defines
//! its fields in predictor.json. The table below combines the kinds into the file format
//! (`predict/file.rs`).

mod kind;
pub mod scale;
pub mod logistic;
pub mod tree;
pub mod boosting;
pub mod svm;
mod constant;
mod file;

use crate::features::FeatureSet;
use crate::invalid::{Invalid, all_moderate, length};
use boosting::{Boosted, BoostedFields};
use constant::Constant;
pub use file::PredictorFile;
use kind::{Kind, kinds};
use logistic::{Logistic, LogisticFile};
use scale::Scale;
use svm::{Svm, SvmFile};
use tree::{Tree, TreeFields};

kinds! {
    /// `"kind": "boosted"`: gradient-boosted trees.
    Boosted: Boosted = BoostedFields,
    /// `"kind": "logistic"`: logistic regression.
    Logistic: (Scale, Logistic) = LogisticFile,
    /// `"kind": "svm"`: support vector machines, one for each pair of classes.
    Svm: (Scale, Svm) = SvmFile,
    /// `"kind": "tree"`: a decision tree.
    Tree: Tree = TreeFields,
    /// `"kind": "constant"`: constant probabilities that do not depend on the features.
    Constant: Constant = Constant,
}

/// A trained model with its features.
#[derive(Clone, Debug, PartialEq)]
pub struct Predictor {
    features: FeatureSet,
    classes: Vec<i8>,
    actions: Option<Vec<f64>>,
    model: Model,
}

impl Predictor {
    fn new(features: FeatureSet, classes: Vec<i8>, model: Model) -> Self {
        Self { features, classes, actions: None, model }
    }

    /// Sets the turn rate of each class (rad/s). The classes of a predictor without turn rates are
    /// turn directions: −1 right, 0 straight, 1 left.
    ///
    /// # Errors
    /// [`Invalid`] if there is not exactly one finite rate per class, in strictly ascending order.
    pub fn with_actions(self, actions: Vec<f64>) -> Result<Self, Invalid> {
        length("actions", self.classes.len(), actions.len())?;
        all_moderate("actions", &actions)?;
        if !actions.is_sorted_by(|a, b| a < b) {
            let expected = "turn rates in rising order";
            return Err(Invalid::new("actions", expected, format!("{actions:?}")));
        }
        Ok(Self { actions: Some(actions), ..self })
    }

    /// The turn rate of each class (rad/s), if the predictor has turn rates.
    #[must_use]
    pub fn actions(&self) -> Option<&[f64]> {
        self.actions.as_deref()
    }

    /// The features that the model needs.
    #[must_use]
    pub fn features(&self) -> &FeatureSet {
        &self.features
    }

    /// The classes, in ascending order.
    #[must_use]
    pub fn classes(&self) -> &[i8] {
        &self.classes
    }

    /// The predicted class for a row of raw features: the most probable class, or for an SVM the
    /// class with the most votes. Ties go to the first class.
    #[must_use]
    pub fn class(&self, row: &[f64]) -> i8 {
        let class = self.model.class(row, self.classes.len());
        self.classes.get(class).copied().unwrap_or(0)
    }

    /// Writes the probability of each class to `out`, given a row of raw features.
    pub fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        self.model.probabilities_into(row, out);
    }
}

/// Checks that each row has `width` finite numbers, and concatenates the rows.
fn flat(field: &str, width: usize, rows: &[Vec<f64>]) -> Result<Vec<f64>, Invalid> {
    for (i, row) in rows.iter().enumerate() {
        length(&format!("{field}[{i}]"), width, row.len())?;
        all_moderate(&format!("{field}[{i}]"), row)?;
    }
    Ok(rows.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::from_value;
    use serde_json::{Value, json};

    /// One file of each kind, and for SVMs one file of each kernel. Numbers are in serde_json's
    /// format.
    fn files() -> [Value; 6] {
        let logistic = r#"{"format":"sidestep-predictor/1","kind":"logistic",
            "features":["distance","v_h"],"classes":[-1,0,1],"actions":[-0.3,0.1,0.6],
            "mean":[10.0,1.0],"scale":[2.0,1.0],
            "coefficients":[[0.0,1.0],[1.0,0.0],[0.0,-1.0]],"intercepts":[0.0,0.5,0.0]}"#;
        let linear = r#"{"format":"sidestep-predictor/1","kind":"svm","experiment":1,
            "features":["distance","v_h"],"classes":[-1,0,1],"mean":[10.0,1.0],"scale":[2.0,1.0],
            "coefficients":[[1.0,2.0],[0.0,1.0],[3.0,-1.0]],"intercepts":[0.0,0.5,0.0],
            "kernel":"linear","sigmoids":[[-1.0,0.0],[-2.0,0.1],[-1.0,0.2]]}"#;
        let rbf = r#"{"format":"sidestep-predictor/1","kind":"svm",
            "features":["distance","v_h"],"classes":[-1,0,1],"mean":[10.0,1.0],"scale":[2.0,1.0],
            "intercepts":[0.0,0.5,0.0],"kernel":"rbf","gamma":0.5,
            "support_vectors":[[0.0,1.0],[1.0,0.5]],
            "dual_coefficients":[[1.0,-1.0],[0.5,0.0],[0.0,-2.0]],
            "sigmoids":[[-1.0,0.0],[-2.0,0.1],[-1.0,0.2]]}"#;
        let boosted = r#"{"format":"sidestep-predictor/1","kind":"boosted","features":["v_h"],
            "classes":[0,1],"boosted":{"intercepts":[0.0],"trees":[{"feature":[0,0,0],
            "threshold":[0.5,0.0,0.0],"left":[1,0,0],"right":[2,0,0],"value":[0.0,1.0,-1.0]}]}}"#;
        let tree = r#"{"format":"sidestep-predictor/1","kind":"tree",
            "features":["distance","v_h"],"classes":[-1,0,1],"tree":{"feature":[1,0,0],
            "threshold":[0.5,0.0,0.0],"left":[1,0,0],"right":[2,0,0],
            "counts":[[2,3,1],[2,0,1],[0,3,0]]}}"#;
        let constant = r#"{"format":"sidestep-predictor/1","kind":"constant","features":[],
            "classes":[-1,0,1],"probabilities":[0.2,0.5,0.3]}"#;
        let texts = [logistic, linear, rbf, boosted, tree, constant];
        texts.map(|text| {
            // The serializer writes the fields in this order, without whitespace.
            let text: String = text.split_whitespace().collect();
            let file: PredictorFile = serde_json::from_str(&text).unwrap();
            assert_eq!(serde_json::to_string(&file).unwrap(), text);
            serde_json::from_str(&text).unwrap()
        })
    }

    fn read(document: &Value) -> Result<Predictor, Invalid> {
        from_value::<PredictorFile>(document)?.try_into()
    }

    fn probabilities<const N: usize>(document: &Value, row: &[f64]) -> [f64; N] {
        let mut p = [0.0; N];
        read(document).unwrap().probabilities_into(row, &mut p);
        p
    }

    /// Sets the value at `pointer`, or removes it if `value` is `None`. Returns the field that the
    /// error names.
    fn field(document: &Value, pointer: &str, value: impl Into<Option<Value>>) -> String {
        let mut document = document.clone();
        match value.into() {
            Some(value) => match document.pointer_mut(pointer) {
                Some(place) => *place = value,
                None => document[&pointer[1..]] = value,
            },
            None => drop(document.as_object_mut().unwrap().remove(&pointer[1..])),
        }
        read(&document).unwrap_err().field
    }

    #[test]
    fn a_file_survives_a_round_trip() {
        for document in files() {
            let mut file: PredictorFile = from_value(&document).unwrap();
            let predictor = Predictor::try_from(file.clone()).unwrap();
            file.experiment = None;
            assert_eq!(PredictorFile::from(&predictor), file);
        }
    }

    #[test]
    fn each_kind_is_a_predictor() {
        let [logistic, linear, rbf, boosted, tree, constant] = files();
        assert_eq!(read(&logistic).unwrap().actions(), Some(&[-0.3, 0.1, 0.6][..]));
        let p: [f64; 3] = probabilities(&logistic, &[10.0, 1.0]);
        assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        assert!((p[1] / p[0] - crate::math::exp(0.5)).abs() < 1e-12);
        for svm in [linear, rbf] {
            let p: [f64; 3] = probabilities(&svm, &[10.0, 1.0]);
            assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
        let p: [f64; 2] = probabilities(&boosted, &[0.4]);
        assert!((p[1] / p[0] - crate::math::exp(1.0)).abs() < 1e-14);
        assert_eq!(probabilities(&tree, &[9.0, 0.4]), [0.5, 1.0 / 6.0, 2.0 / 6.0]);
        assert_eq!(probabilities(&constant, &[]), [0.2, 0.5, 0.3]);
    }

    #[test]
    fn fields_of_other_kinds_and_unknown_fields_are_ignored() {
        let [logistic, .., constant] = files();
        let mut document = constant.clone();
        document["mean"] = json!([1, 2]);
        document["trained_by"] = json!("R");
        assert_eq!(read(&document), read(&constant));
        let mut document = logistic.clone();
        (document["experiment"], document["tree"]) = (Value::Null, Value::Null);
        assert_eq!(read(&document), read(&logistic));
    }

    #[test]
    fn complaints_name_the_field() {
        let [logistic, _, _, boosted, tree, constant] = files();
        let complain = |pointer: &str, value: Value| field(&logistic, pointer, value);
        assert_eq!(complain("/format", json!("x")), "format");
        assert_eq!(complain("/kind", json!("oracle")), "kind");
        assert_eq!(complain("/kind", json!("tree")), "tree");
        assert_eq!(complain("/features/1", json!("speed")), "features[1]");
        assert_eq!(complain("/features/1", json!(2)), "features[1]");
        assert_eq!(complain("/features", json!([])), "features");
        assert_eq!(complain("/classes", json!([1, 0, -1])), "classes");
        assert_eq!(complain("/scale/1", json!(0)), "scale[1]");
        assert_eq!(complain("/mean", Value::Null), "mean");
        assert_eq!(field(&logistic, "/mean", None), "mean");
        assert_eq!(complain("/actions", json!([0, 0.5])), "actions");
        assert_eq!(complain("/actions", json!([0, 0.5, 0.5])), "actions");
        assert_eq!(complain("/actions/1", json!("left")), "actions[1]");
        assert_eq!(complain("/intercepts", json!([0])), "intercepts");
        assert_eq!(complain("/coefficients", json!([[0, 0], [0, 0]])), "coefficients");
        assert_eq!(complain("/coefficients/0/1", json!("x")), "coefficients[0][1]");
        let scaled = complain("/mean", json!([10.0]));
        assert_eq!(scaled, "scale");
        assert_eq!(field(&boosted, "/boosted", None), "boosted");
        assert_eq!(field(&boosted, "/classes", json!([-1, 0, 1])), "boosted.intercepts");
        let bad = field(&boosted, "/boosted/trees/0/left/0", json!(7));
        assert_eq!(bad, "boosted.trees[0].left[0]");
        assert_eq!(field(&tree, "/tree", None), "tree");
        assert_eq!(field(&tree, "/classes", json!([0, 1])), "tree.counts[0]");
        assert_eq!(field(&tree, "/features", json!(["v_h"])), "tree.feature[0]");
        assert_eq!(field(&constant, "/probabilities", json!([0.5, 0.5])), "probabilities");
        assert_eq!(field(&constant, "/classes", json!([])), "classes");
        let said = read(&json!("model.json")).unwrap_err().to_string();
        let expected = "expected an object, {…}, as in a predictor.json, found \"model.json\"";
        assert_eq!(said, expected);
    }

    /// JSON has no NaN and no infinity, but the library's types can hold them.
    #[test]
    fn numbers_that_are_not_finite_are_refused() {
        let complain = |document: &Value, change: fn(&mut ModelFile)| {
            let mut file: PredictorFile = from_value(document).unwrap();
            change(&mut file.model);
            Predictor::try_from(file).unwrap_err().field
        };
        let [logistic, _, rbf, ..] = files();
        let nan = |model: &mut ModelFile| {
            if let ModelFile::Logistic(model) = model {
                model.coefficients[0][1] = f64::NAN;
            }
        };
        assert_eq!(complain(&logistic, nan), "coefficients[0][1]");
        let infinite = |model: &mut ModelFile| {
            if let ModelFile::Svm(svm::SvmFile::Rbf(model)) = model {
                model.sigmoids[0][1] = f64::INFINITY;
            }
        };
        assert_eq!(complain(&rbf, infinite), "sigmoids[0][1]");
        let mut file: PredictorFile = from_value(&logistic).unwrap();
        file.actions = Some(vec![0.0, f64::NAN, 0.5]);
        assert_eq!(Predictor::try_from(file).unwrap_err().field, "actions[1]");
    }

    #[test]
    fn complaints_about_support_vector_machines_name_the_field() {
        let [_, linear, rbf, ..] = files();
        let complain = |pointer: &str, value: Value| field(&rbf, pointer, value);
        assert_eq!(field(&rbf, "/kernel", None), "kernel");
        assert_eq!(complain("/kernel", json!("poly")), "kernel");
        assert_eq!(complain("/kernel", json!("linear")), "coefficients");
        assert_eq!(field(&linear, "/kernel", json!("rbf")), "gamma");
        assert_eq!(complain("/gamma", json!(0)), "gamma");
        assert_eq!(complain("/mean", json!([0])), "scale");
        assert_eq!(field(&rbf, "/support_vectors", None), "support_vectors");
        let uneven = json!([[0, 0], [0, 0, 0]]);
        assert_eq!(complain("/support_vectors", uneven), "support_vectors[1]");
        assert_eq!(field(&rbf, "/dual_coefficients", None), "dual_coefficients");
        assert_eq!(complain("/dual_coefficients", json!([[0, 0], [0, 0]])), "dual_coefficients");
        assert_eq!(complain("/dual_coefficients/0/1", json!([])), "dual_coefficients[0][1]");
        assert_eq!(complain("/intercepts", json!([0, 0])), "intercepts");
        assert_eq!(field(&rbf, "/sigmoids", None), "sigmoids");
        assert_eq!(complain("/sigmoids", json!([[0, 0], [0, 0]])), "sigmoids");
        let mut alone = rbf.clone();
        for name in ["intercepts", "sigmoids", "dual_coefficients"] {
            alone[name] = json!([]);
        }
        assert_eq!(field(&alone, "/classes", json!([0])), "classes");
    }
}
