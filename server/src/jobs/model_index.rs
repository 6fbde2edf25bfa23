//! The index of an analysis, used for lists of models and for replays.

use crate::report;
use crate::store::predictors::{NewPredictor, UsedTask};
use serde::{Deserialize, Serialize};
use sidestep::comparison::Analysis;
use sidestep::comparison::models::ModelName;
use sidestep::recording::Recording;
use std::collections::HashMap;

/// The ids of the trials of a study's recording, by the participant's name and the trial's number.
#[derive(Clone, Debug, Default)]
pub struct TrialIds(HashMap<(String, u64), String>);

impl TrialIds {
    /// The ids of this recording's trials.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let ids = recording.participants.iter().flat_map(|participant| {
            participant.trials.iter().filter_map(|trial| {
                Some(((participant.name.clone(), trial.number), trial.trial_id.clone()?))
            })
        });
        Self(ids.collect())
    }
}

/// A model of an analysis, as listed by the child process.
#[derive(Debug, Serialize, Deserialize)]
pub struct IndexedModel {
    file: String,
    participant: i64,
    place: usize,
    model: ModelName,
    experiment: u8,
    features: String,
    columns: Vec<String>,
    cv_accuracy: f64,
    test_accuracy: f64,
}

impl From<IndexedModel> for NewPredictor {
    fn from(model: IndexedModel) -> Self {
        Self {
            file: model.file,
            participant: model.participant,
            place: model.place,
            model: model.model.word(),
            experiment: model.experiment,
            features: model.features,
            columns: model.columns,
            cv_accuracy: model.cv_accuracy,
            test_accuracy: model.test_accuracy,
        }
    }
}

/// A task that an analysis used, as listed by the child process.
#[derive(Debug, Serialize, Deserialize)]
pub struct IndexedTask {
    trial_id: String,
    trains: bool,
}

impl From<IndexedTask> for UsedTask {
    fn from(IndexedTask { trial_id, trains }: IndexedTask) -> Self {
        Self { trial_id, trains }
    }
}

/// The models of an analysis, in the order of its tables.
pub fn models(analysis: &Analysis) -> impl Iterator<Item = IndexedModel> {
    let people = &analysis.comparison.participants;
    analysis.comparison.cells.iter().enumerate().filter_map(|(place, cell)| {
        Some(IndexedModel {
            file: report::model_file(analysis, cell),
            // A participant's name in a study's recording is the participant's number.
            participant: people[cell.participant].name.parse().ok()?,
            place,
            model: cell.model,
            experiment: cell.experiment.number(),
            features: cell.features.clone(),
            columns: cell.predictor.features.clone(),
            cv_accuracy: cell.cv_accuracy,
            test_accuracy: cell.test.accuracy(),
        })
    })
}

/// The tasks that trained and tested the models of an analysis, participant by participant. `ids` has
/// the ids of the trials in the analysis's recording.
pub fn tasks(analysis: &Analysis, ids: &TrialIds) -> impl Iterator<Item = IndexedTask> {
    analysis.comparison.participants.iter().flat_map(|person| {
        let training = person.training_trials.iter().map(|number| (number, true));
        let test = person.test_trials.iter().map(|number| (number, false));
        training.chain(test).filter_map(|(number, trains)| {
            let trial_id = ids.0.get(&(person.name.clone(), *number))?.clone();
            Some(IndexedTask { trial_id, trains })
        })
    })
}
