//! Datasets: trials turned into labelled rows.

use crate::features::FeatureSet;
use crate::invalid::Invalid;
use crate::parallel_map::parallel_map;
use crate::safety::SafetyLevels;
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
        safety: &SafetyLevels,
        trials: impl IntoIterator<Item = (&'a [TurnInput], &'a [JointState])>,
    ) -> Self {
        let width = features.len();
        let trials: Vec<_> = trials.into_iter().collect();
        let rows = |&(inputs, states): &(&[TurnInput], &[JointState])| {
            let mut values = vec![0.0; inputs.len().min(states.len()) * width];
            for (step, row) in values.chunks_exact_mut(width.max(1)).enumerate() {
                features.compute_into(&states[..=step], safety, row);
            }
            Ok::<_, core::convert::Infallible>(values)
        };
        let Ok(values) = parallel_map(&trials, rows);
        let labels = trials.iter().flat_map(|(inputs, states)| inputs.iter().take(states.len()));
        let of_trial = |(trial, &(inputs, states)): (usize, &(&[TurnInput], &[JointState]))| {
            [trial].repeat(inputs.len().min(states.len()))
        };
        Self {
            features: features.clone(),
            labels: labels.copied().collect(),
            trials: trials.iter().enumerate().flat_map(of_trial).collect(),
            values: values.concat(),
        }
    }

    /// The same rows with some of the features only.
    ///
    /// # Errors
    /// [`Invalid`] for a feature that is not among the columns.
    pub fn select(&self, features: &FeatureSet) -> Result<Self, Invalid> {
        let names: Vec<&str> = self.features.features().map(|feature| feature.name).collect();
        let place = |name: &str| {
            let expected = || format!("one of {}", names.join(", "));
            let found = names.iter().position(|known| *known == name);
            found.ok_or_else(|| Invalid::new("features", expected(), name))
        };
        let places: Vec<usize> =
            features.features().map(|feature| place(feature.name)).collect::<Result<_, _>>()?;
        let rows = self.values.chunks_exact(names.len());
        Ok(Self {
            features: features.clone(),
            values: rows.flat_map(|row| places.iter().map(|&j| row[j])).collect(),
            labels: self.labels.clone(),
            trials: self.trials.clone(),
        })
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
