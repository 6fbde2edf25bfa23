//! What lists and replays say of the models of an analysis.

use crate::report;
use crate::store::predictors::{NewPredictor, UsedTask};
use sidestep::comparison::Analysis;
use sidestep::recording::Recording;
use std::collections::HashMap;

/// The ids of the trials of a study's recording, by the participant's name and the trial's number.
#[derive(Clone, Debug, Default)]
pub struct TrialIds(HashMap<(String, u64), String>);

impl TrialIds {
    /// Those of this recording.
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

/// The models of an analysis of a study, and the tasks that trained and tested them.
#[derive(Clone, Debug, PartialEq)]
pub struct AnalysisIndex {
    /// In the order of the analysis's tables.
    pub predictors: Vec<NewPredictor>,
    /// Participant by participant.
    pub tasks: Vec<UsedTask>,
}

impl AnalysisIndex {
    /// That of this analysis of the recording with these ids.
    #[must_use]
    pub fn of(analysis: &Analysis, ids: &TrialIds) -> Self {
        let people = &analysis.comparison.participants;
        let predictors =
            analysis.comparison.cells.iter().enumerate().filter_map(|(place, cell)| {
                Some(NewPredictor {
                    file: report::model_file(analysis, cell),
                    // The participants of a study are named by their numbers.
                    participant: people[cell.participant].name.parse().ok()?,
                    place,
                    model: cell.model.word(),
                    experiment: cell.experiment.number(),
                    features: cell.features.clone(),
                    columns: cell.predictor.features.clone(),
                    cv_accuracy: cell.cv_accuracy,
                    test_accuracy: cell.test.accuracy(),
                })
            });
        let tasks = people.iter().flat_map(|person| {
            let training = person.training_trials.iter().map(|number| (number, true));
            let test = person.test_trials.iter().map(|number| (number, false));
            training.chain(test).filter_map(|(number, trains)| {
                let trial_id = ids.0.get(&(person.name.clone(), *number))?.clone();
                Some(UsedTask { trial_id, trains })
            })
        });
        Self { predictors: predictors.collect(), tasks: tasks.collect() }
    }
}
