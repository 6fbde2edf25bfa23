//! Gradient-boosted trees: a score is the sum of the values of many small trees.
//! [`learn::boosting`](crate::learn::boosting) trains them.

use super::kind::{Kind, field};
use super::logistic::softmax;
use super::scale::Scale;
use super::tree::{Questions, QuestionsFile};
use super::{Model, Predictor};
use crate::features::FeatureSet;
use crate::invalid::{Invalid, all_moderate, length};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A model of trees with numbers at their leaves.
#[derive(Clone, Debug, PartialEq)]
pub struct Boosted {
    /// The initial score of each class. With two classes, there is only the second class's score,
    /// because the first class's score is 0.
    intercepts: Vec<f64>,
    /// The trees. Tree i adds to the score with index i modulo the number of scores.
    trees: Vec<Summand>,
}

/// A tree, with the value that each node adds to a score. Only the values of leaves matter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Summand {
    pub(crate) questions: Questions,
    pub(crate) values: Vec<f64>,
}

impl Summand {
    /// The value added for `row`.
    pub(crate) fn value(&self, row: &[f64]) -> f64 {
        self.values[self.questions.leaf(row)]
    }
}

/// The fields of a [`Boosted`] in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoostedFile {
    /// The initial score of each class. With two classes, there is only the second class's score
    /// (the first class's score is 0).
    pub intercepts: Vec<f64>,
    /// The trees, round by round, with one tree per intercept in each round.
    pub trees: Vec<SummandFile>,
}

/// The fields of a predictor.json with boosted trees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BoostedFields {
    /// The initial scores and the trees.
    pub boosted: BoostedFile,
}

/// The fields of a tree that adds to a score, in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SummandFile {
    /// The questions (splits) of the tree.
    #[serde(flatten)]
    pub questions: QuestionsFile,
    /// One entry per node: at a leaf, the value that it adds to the score; at other nodes, 0.
    pub value: Vec<f64>,
}

impl From<&Boosted> for BoostedFile {
    fn from(model: &Boosted) -> Self {
        let tree = |tree: &Summand| SummandFile {
            questions: (&tree.questions).into(),
            value: tree.values.clone(),
        };
        Self { intercepts: model.intercepts.clone(), trees: model.trees.iter().map(tree).collect() }
    }
}

/// The number of scores for `classes` classes.
pub(crate) fn scores_of(classes: usize) -> usize {
    if classes == 2 { 1 } else { classes }
}

impl BoostedFile {
    /// Checks the fields and builds the model, for `width` features and `classes` classes.
    ///
    /// # Errors
    /// [`Invalid`] if there is not one intercept per score, the last round is incomplete, a tree is
    /// not valid (see [`QuestionsFile`]) or a number is not finite.
    pub fn check(&self, width: usize, classes: usize) -> Result<Boosted, Invalid> {
        let scores = scores_of(classes);
        length("intercepts", scores, self.intercepts.len())?;
        all_moderate("intercepts", &self.intercepts)?;
        if !self.trees.len().is_multiple_of(scores) {
            let expected = format!("{scores} trees per round");
            return Err(Invalid::new("trees", expected, format!("{} trees", self.trees.len())));
        }
        let check = |(i, tree): (usize, &SummandFile)| {
            let checked = tree.check(width);
            checked.map_err(|invalid| invalid.within(&format!("trees[{i}]")))
        };
        let trees = self.trees.iter().enumerate().map(check).collect::<Result<_, _>>()?;
        Ok(Boosted { intercepts: self.intercepts.clone(), trees })
    }
}

impl SummandFile {
    fn check(&self, width: usize) -> Result<Summand, Invalid> {
        let questions = self.questions.check(width)?;
        length("value", questions.0.len(), self.value.len())?;
        all_moderate("value", &self.value)?;
        Ok(Summand { questions, values: self.value.clone() })
    }
}

impl Boosted {
    /// A model of trained trees, with one tree per intercept in each round.
    #[cfg(feature = "learn")]
    pub(crate) fn new(intercepts: Vec<f64>, trees: Vec<Summand>) -> Self {
        Self { intercepts, trees }
    }

    /// Number of rounds: the number of trees per score.
    #[must_use]
    pub fn rounds(&self) -> usize {
        self.trees.len() / self.intercepts.len()
    }

    /// The model after its first `rounds` rounds.
    #[must_use]
    pub fn truncated(&self, rounds: usize) -> Self {
        let trees = self.trees.iter().take(rounds * self.intercepts.len()).cloned().collect();
        Self { intercepts: self.intercepts.clone(), trees }
    }

    /// Writes the probability of each class to `out`, given a row of features.
    pub fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        let first = out.len() - self.intercepts.len();
        out[..first].fill(0.0);
        let scores = &mut out[first..];
        scores.copy_from_slice(&self.intercepts);
        for round in self.trees.chunks_exact(scores.len()) {
            for (score, tree) in scores.iter_mut().zip(round) {
                *score += tree.value(row);
            }
        }
        softmax(out);
    }

    /// Converts a model for features that `scale` standardised to a model for raw features.
    #[must_use]
    pub fn unscaled(&self, scale: &Scale) -> Self {
        let unscale = |tree: &Summand| Summand {
            questions: tree.questions.unscaled(scale),
            values: tree.values.clone(),
        };
        Self {
            intercepts: self.intercepts.clone(),
            trees: self.trees.iter().map(unscale).collect(),
        }
    }
}

impl Predictor {
    /// Boosted trees on raw features (see [`Boosted::unscaled`]).
    #[must_use]
    pub fn boosted(features: FeatureSet, classes: Vec<i8>, model: Boosted) -> Self {
        Self::new(features, classes, Model::Boosted(model))
    }
}

impl Kind for Boosted {
    type File = BoostedFields;

    fn read(document: &Value) -> Result<BoostedFields, Invalid> {
        Ok(BoostedFields { boosted: field(document, "boosted")? })
    }

    fn of_file(file: BoostedFields, width: usize, classes: usize) -> Result<Self, Invalid> {
        file.boosted.check(width, classes).map_err(|invalid| invalid.within("boosted"))
    }

    fn to_file(&self) -> BoostedFields {
        BoostedFields { boosted: self.into() }
    }

    fn probabilities_into(&self, row: &[f64], out: &mut [f64]) {
        self.probabilities_into(row, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::exp;

    fn file() -> BoostedFile {
        let stump = |feature: u32, low: f64, high: f64| SummandFile {
            questions: QuestionsFile {
                feature: vec![feature, 0, 0],
                threshold: vec![1.0, 0.0, 0.0],
                left: vec![1, 0, 0],
                right: vec![2, 0, 0],
            },
            value: vec![0.0, low, high],
        };
        BoostedFile { intercepts: vec![0.5], trees: vec![stump(0, -1.0, 1.0), stump(1, -0.5, 0.0)] }
    }

    #[test]
    fn scores_are_sums() {
        let model = file().check(2, 2).unwrap();
        assert_eq!(model.rounds(), 2);
        let odds = |model: &Boosted, row: [f64; 2]| {
            let mut p = [0.0; 2];
            model.probabilities_into(&row, &mut p);
            p[1] / p[0]
        };
        assert!((odds(&model, [0.0, 0.0]) - exp(-1.0)).abs() < 1e-15);
        assert!((odds(&model, [2.0, 2.0]) - exp(1.5)).abs() < 1e-14);
        assert!((odds(&model.truncated(1), [0.0, 0.0]) - exp(-0.5)).abs() < 1e-15);
        assert_eq!(model.truncated(2), model);
        let scale = Scale::new(vec![10.0, 0.0], vec![2.0, 1.0]).unwrap();
        assert!((odds(&model.unscaled(&scale), [12.1, 2.0]) - exp(1.5)).abs() < 1e-14);
    }

    #[test]
    fn complaints_name_the_field() {
        let complain = |change: fn(&mut BoostedFile)| {
            let mut file = file();
            change(&mut file);
            file.check(2, 2).unwrap_err().field
        };
        assert_eq!(complain(|f| f.intercepts.push(0.0)), "intercepts");
        assert_eq!(complain(|f| f.intercepts[0] = f64::NAN), "intercepts[0]");
        assert_eq!(complain(|f| f.trees[1].value.truncate(2)), "trees[1].value");
        assert_eq!(complain(|f| f.trees[1].value[2] = f64::INFINITY), "trees[1].value[2]");
        assert_eq!(complain(|f| f.trees[1].questions.feature[0] = 2), "trees[1].feature[0]");
        assert_eq!(complain(|f| f.trees[0].questions.right[0] = 1), "trees[0].right[0]");
        let mut three = file();
        three.intercepts = vec![0.0; 3];
        assert_eq!(three.check(2, 3).unwrap_err().field, "trees");
    }
}
