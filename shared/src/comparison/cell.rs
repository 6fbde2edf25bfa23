//! The results of the comparison: a cell for each model, experiment, feature set and participant.

use super::metrics::Predictions;
use super::split::Split;
use crate::dataset::Dataset;
use crate::features::{FeatureSet, HISTORY_SET};
use crate::invalid::Invalid;
use crate::predict::PredictorFile;
use crate::vehicle::TurnInput;
use serde::{Deserialize, Serialize};

/// The prediction task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "u8", try_from = "u8")]
pub enum Experiment {
    /// Experiment I: which input; −1 right, 0 straight, 1 left.
    TurnDirection,
    /// Experiment II: whether the human turns; 0 straight, 1 either turn.
    Avoidance,
}

impl Experiment {
    /// Both experiments.
    pub const ALL: [Self; 2] = [Self::TurnDirection, Self::Avoidance];

    /// 1 or 2.
    #[must_use]
    pub fn number(self) -> u8 {
        self.into()
    }

    /// The paper's numeral: I or II.
    #[must_use]
    pub fn numeral(self) -> &'static str {
        match self {
            Self::TurnDirection => "I",
            Self::Avoidance => "II",
        }
    }

    /// The classes, in ascending order.
    #[must_use]
    pub fn classes(self) -> &'static [i8] {
        match self {
            Self::TurnDirection => &[-1, 0, 1],
            Self::Avoidance => &[0, 1],
        }
    }

    /// The class of an input.
    #[must_use]
    pub fn class(self, input: TurnInput) -> i8 {
        match self {
            Self::TurnDirection => input.sign(),
            Self::Avoidance => input.sign().abs(),
        }
    }
}

impl From<Experiment> for u8 {
    fn from(experiment: Experiment) -> Self {
        match experiment {
            Experiment::TurnDirection => 1,
            Experiment::Avoidance => 2,
        }
    }
}

impl TryFrom<u8> for Experiment {
    type Error = Invalid;

    fn try_from(number: u8) -> Result<Self, Invalid> {
        match number {
            1 => Ok(Self::TurnDirection),
            2 => Ok(Self::Avoidance),
            _ => Err(Invalid::new("experiment", "1 or 2", number)),
        }
    }
}

/// Name of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ModelName {
    /// The better of the two SVMs below in cross-validation; on a tie the first.
    Svm,
    /// Support vector machine with radial basis functions.
    SvmRbf,
    /// Support vector machine with the linear kernel.
    SvmLinear,
    /// Decision tree.
    Dt,
    /// Multinomial logistic regression.
    Lr,
    /// Gradient-boosted trees: beyond the paper, and judged by roll-outs only.
    Boosted,
}

impl ModelName {
    /// The models of the comparison, in the order of tables.
    pub const ALL: [Self; 5] = [Self::Svm, Self::SvmRbf, Self::SvmLinear, Self::Dt, Self::Lr];

    /// The three models of the paper's tables.
    pub const PAPERS: [Self; 3] = [Self::Svm, Self::Dt, Self::Lr];

    /// Its name in files.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Svm => "svm",
            Self::SvmRbf => "svm_rbf",
            Self::SvmLinear => "svm_linear",
            Self::Dt => "dt",
            Self::Lr => "lr",
            Self::Boosted => "boosted",
        }
    }
}

/// A named feature set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NamedSet {
    /// Its name in tables.
    pub name: String,
    /// Its features.
    pub features: FeatureSet,
}

/// Letters of the paper's seven sets, in table order.
pub const PAPERS_SETS: [&str; 7] = ["hrd", "hr", "hd", "rd", "h", "r", "d"];

/// Sets that show how much the robot's position in the human's body frame explains. It contains the
/// side, which absolute differences in the world frame do not.
pub const BODY_FRAME_SETS: [(&str, &str); 2] = [("hrd_body", "hrd"), ("d_body", "d")];

impl NamedSet {
    /// The paper's seven sets.
    ///
    /// # Errors
    /// Never: the table has these names.
    pub fn papers() -> Result<Vec<Self>, Invalid> {
        let set =
            |name: &str| Ok(Self { name: name.to_owned(), features: FeatureSet::subset(name)? });
        PAPERS_SETS.into_iter().map(set).collect()
    }

    /// Two of the paper's sets, with the robot's position in the human's body frame.
    ///
    /// # Errors
    /// Never: the table has these names.
    pub fn with_body_frame() -> Result<Vec<Self>, Invalid> {
        let set = |(name, papers): (&str, _)| {
            let mut names: Vec<String> = FeatureSet::subset(papers)?.into();
            names.extend(["robot_ahead", "robot_left"].map(str::to_owned));
            Ok(Self { name: name.to_owned(), features: FeatureSet::of(&names)? })
        };
        BODY_FRAME_SETS.into_iter().map(set).collect()
    }
}

impl NamedSet {
    /// [`HISTORY_SET`].
    ///
    /// # Errors
    /// Never: the table has these names.
    pub fn with_history() -> Result<Self, Invalid> {
        Ok(Self { name: HISTORY_SET.to_owned(), features: FeatureSet::with_history()? })
    }
}

/// One participant's model and its predictions of the test rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The model.
    pub model: ModelName,
    /// The experiment.
    pub experiment: Experiment,
    /// The name of the feature set.
    pub features: String,
    /// Index of the participant.
    pub participant: usize,
    /// Mean over folds of the accuracy, with the chosen hyper-parameters.
    pub cv_accuracy: f64,
    /// The hyper-parameters, as a JSON object.
    pub hyperparameters: String,
    /// The test predictions of the model after retraining on all training tasks.
    pub test: Predictions,
    /// The model.
    pub predictor: PredictorFile,
}

/// The reference that a model must beat. It always predicts the commonest class of the training
/// rows; its probabilities are the class frequencies there, with one row of each class added so
/// that none is zero.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// The experiment.
    pub experiment: Experiment,
    /// Index of the participant.
    pub participant: usize,
    /// Its predictions of the test rows.
    pub test: Predictions,
}

impl Baseline {
    /// The baseline of one participant's rows.
    #[must_use]
    pub fn of(data: &Dataset, split: &Split, experiment: Experiment, participant: usize) -> Self {
        let classes = experiment.classes();
        let class = |row: &usize| experiment.class(data.labels[*row]);
        let count = |wanted: &i8| split.training.iter().filter(|row| class(row) == *wanted).count();
        let counts: Vec<usize> = classes.iter().map(count).collect();
        let total = (split.training.len() + classes.len()) as f64;
        let shares: Vec<f64> = counts.iter().map(|&count| (count + 1) as f64 / total).collect();
        // On a tie, the first class.
        let most = (0..counts.len()).reduce(|a, b| if counts[b] > counts[a] { b } else { a });
        let predicted = most.map_or(0, |most| classes[most]);
        let test = Predictions {
            classes: classes.to_vec(),
            truth: split.test.iter().map(class).collect(),
            predicted: vec![predicted; split.test.len()],
            probabilities: shares.repeat(split.test.len()),
        };
        Self { experiment, participant, test }
    }
}
