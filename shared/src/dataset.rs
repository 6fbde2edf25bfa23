//! Datasets: labelled rows from trials.

use crate::features::{FEATURES, FeatureSet};
use crate::invalid::Invalid;
use crate::parallel::parallel_map;
use crate::recording::{Fault, RecordedParticipant};
use crate::safety::SafetyLevels;
use crate::scene::JointState;
use crate::vehicle::TurnInput;
use std::collections::HashMap;

/// Upper bound on the absolute value of a feature, in the feature's unit. It keeps sums of many
/// squares from overflowing.
const LARGEST_FEATURE: f64 = 1e9;

fn is_usable(feature: f64) -> bool {
    (-LARGEST_FEATURE..=LARGEST_FEATURE).contains(&feature)
}

/// One row per step: the features of the state before the step, and the step's input as the label.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// The columns.
    pub features: FeatureSet,
    /// The rows, concatenated. Each row is as long as `features`.
    pub values: Vec<f64>,
    /// The label of each row.
    pub labels: Vec<TurnInput>,
    /// The index of each row's trial, from 0. The rows of one trial must never be split between
    /// training and test data.
    pub trials: Vec<usize>,
}

impl Dataset {
    /// The rows of a participant's trials, with all features.
    ///
    /// # Errors
    /// [`Fault`] for a trial with a feature beyond ±10⁹, which is impossible in a real drive.
    pub fn of(participant: &RecordedParticipant, safety: &SafetyLevels) -> Result<Self, Fault> {
        let trials = participant.trials.iter().map(|trial| (&trial.inputs[..], &trial.states[..]));
        let data = Self::from_trials(&FeatureSet::all(), safety, trials);
        let Some(place) = data.values.iter().position(|value| !is_usable(*value)) else {
            return Ok(data);
        };
        let (row, feature) = (place / FEATURES.len(), &FEATURES[place % FEATURES.len()]);
        let of_trial = data.trials[row];
        let step = data.trials[..row].iter().rev().take_while(|of| **of == of_trial).count();
        let trial = &participant.trials[of_trial];
        let found = format!("{} in step {step} of trial {}", data.values[place], trial.number);
        let what = Invalid::new(feature.name, "features of at most 1e9", found);
        Err(Fault { line: trial.line, what })
    }

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

    /// The same rows with only these features.
    ///
    /// # Errors
    /// [`Invalid`] for a feature without a column.
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

    /// The number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The number of rows with each label of [`TurnInput::ALL`].
    #[must_use]
    pub fn class_counts(&self) -> [usize; 3] {
        TurnInput::ALL.map(|class| self.labels.iter().filter(|&&label| label == class).count())
    }
}

/// A step of a participant's trial: the participant's name, the trial's number, and the step.
pub type StepKey = (String, u64, u64);

/// Features of one step that another program computed.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenRow {
    /// The row's line in its file.
    pub line: u64,
    /// The row's label.
    pub turn: TurnInput,
    /// The values of the features.
    pub values: Vec<f64>,
}

/// Features that another program computed. They replace the features that this library computes.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenFeatures {
    /// The features, in the order of the values in each row.
    pub features: FeatureSet,
    /// The row of each step.
    pub rows: HashMap<StepKey, GivenRow>,
    /// The first invalid row of each participant who has an invalid row.
    pub faults: HashMap<String, Fault>,
}

impl GivenFeatures {
    /// Overwrites the columns of these features in `data`, which contains the rows of `participant`.
    ///
    /// # Errors
    /// [`Fault`] for the participant's first invalid row, for a step without a row, or for a row
    /// whose label differs from the step's input.
    pub fn replace(
        &self,
        participant: &RecordedParticipant,
        data: &mut Dataset,
    ) -> Result<(), Fault> {
        if let Some(fault) = self.faults.get(&participant.name) {
            return Err(fault.clone());
        }
        let width = data.features.len();
        let known: Vec<&str> = data.features.features().map(|feature| feature.name).collect();
        let place = |name: &str| known.iter().position(|other| *other == name);
        let places: Vec<Option<usize>> =
            self.features.features().map(|feature| place(feature.name)).collect();
        let mut rows = data.values.chunks_exact_mut(width);
        for trial in &participant.trials {
            for ((step, &input), row) in (0..).zip(&trial.inputs).zip(&mut rows) {
                let key = (participant.name.clone(), trial.number, step);
                let given = self.rows.get(&key).ok_or_else(|| {
                    let expected =
                        format!("participant {}, trial {}, step {step}", key.0, trial.number);
                    Fault { line: None, what: Invalid::new("row", expected, "no such row") }
                })?;
                given.check(&self.features, input)?;
                for (place, value) in places.iter().zip(&given.values) {
                    if let Some(place) = place {
                        row[*place] = *value;
                    }
                }
            }
        }
        Ok(())
    }
}

impl GivenRow {
    fn check(&self, features: &FeatureSet, input: TurnInput) -> Result<(), Fault> {
        let fault = |what| Err(Fault { line: Some(self.line), what });
        if self.turn != input {
            let expected = format!("{}, as in the trials", input.sign());
            return fault(Invalid::new("turn", expected, self.turn.sign()));
        }
        for (feature, &value) in features.features().zip(&self.values) {
            if !is_usable(value) {
                return fault(Invalid::new(feature.name, "a number of at most 1e9", value));
            }
        }
        Ok(())
    }
}
