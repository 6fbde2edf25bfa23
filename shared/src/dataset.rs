//! Datasets: trials turned into labelled rows.

use crate::features::{FeatureSet, SafetyFunctions};
use crate::scene::JointState;
use crate::vehicle::TurnInput;

/// One row a step: the features of the state before it, and the input held in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// What the columns are.
    pub features: FeatureSet,
    /// Row after row, each as long as `features`.
    pub values: Vec<f64>,
    /// The label of each row.
    pub labels: Vec<TurnInput>,
    /// Which trial, from 0, each row comes from: rows of one trial must never be
    /// split between training and testing.
    pub trials: Vec<usize>,
}

impl Dataset {
    /// The rows of `trials`, each given by its inputs and its states.
    #[must_use]
    pub fn from_trials<'a>(
        features: &FeatureSet,
        safety: &SafetyFunctions,
        trials: impl IntoIterator<Item = (&'a [TurnInput], &'a [JointState])>,
    ) -> Self {
        let width = features.len();
        let mut dataset = Self {
            features: features.clone(),
            values: Vec::new(),
            labels: Vec::new(),
            trials: Vec::new(),
        };
        for (trial, (inputs, states)) in trials.into_iter().enumerate() {
            for (step, &input) in inputs.iter().enumerate().take(states.len()) {
                let begin = dataset.values.len();
                dataset.values.resize(begin + width, 0.0);
                features.compute_into(&states[..=step], safety, &mut dataset.values[begin..]);
                dataset.labels.push(input);
                dataset.trials.push(trial);
            }
        }
        dataset
    }

    /// How many rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// How often each of [`TurnInput::ALL`] is the label.
    #[must_use]
    pub fn class_counts(&self) -> [usize; 3] {
        TurnInput::ALL.map(|class| self.labels.iter().filter(|&&label| label == class).count())
    }
}
