//! The results of the comparison: a cell for each model, experiment, feature set and participant.

use super::metrics::Predictions;
use super::models::ModelName;
use super::split::Split;
use crate::dataset::Dataset;
use crate::invalid::Invalid;
use crate::predict::PredictorFile;
use crate::vehicle::TurnInput;
use serde::{Deserialize, Serialize};

/// What a model predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "u8", try_from = "u8")]
pub enum Experiment {
    /// Experiment I predicts the input: −1 right, 0 straight, 1 left.
    TurnDirection,
    /// Experiment II predicts whether the human turns: 0 straight, 1 right or left.
    Avoidance,
}

impl Experiment {
    /// Both experiments.
    pub const ALL: [Self; 2] = [Self::TurnDirection, Self::Avoidance];

    /// The experiment's number: 1 or 2.
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

    /// The predicted classes, in ascending order.
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

/// One participant's model, and its predictions for the test rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The name of the model.
    pub model: ModelName,
    /// The experiment.
    pub experiment: Experiment,
    /// The name of the feature set.
    pub features: String,
    /// Index of the participant.
    pub participant: usize,
    /// Mean over folds of the validation accuracy with the chosen hyper-parameters.
    pub cv_accuracy: f64,
    /// The hyper-parameters, as a JSON object.
    pub hyperparameters: String,
    /// The test predictions of the model after retraining on all training tasks.
    pub test: Predictions,
    /// The trained model.
    pub predictor: PredictorFile,
}

/// The reference that a model must beat. It always predicts the commonest class of the training
/// rows. Its probabilities are the class frequencies of the training rows plus one extra row of
/// each class, so that no probability is zero.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// The experiment.
    pub experiment: Experiment,
    /// Index of the participant.
    pub participant: usize,
    /// The baseline's predictions for the test rows.
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
        // A tie goes to the first class.
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
