//! Which models a comparison fits: one fit for each participant, feature set and family of models.

use super::cell::NamedSet;
use super::fit::{Grids, ModelFamily};
use super::settings::Settings;
use super::split::{LEAST_TASKS, Split, first_test_task};
use super::tables::ComparedParticipant;
use crate::dataset::{Dataset, GivenFeatures};
use crate::invalid::Invalid;
use crate::recording::{Exclusion, Fault, RecordedParticipant};
use crate::safety::SafetyLevels;
use crate::scene::SceneParameters;
use crate::shfrs::window::Trajectory;
use crate::vehicle::TurnInput;
use sha2::{Digest, Sha256};

/// A participant's tasks, ready to be learned from.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticipantData {
    /// The participant's name or number in the data.
    pub name: String,
    /// The line of their first row, in a file.
    pub line: Option<u64>,
    /// The number of each task, in order.
    pub numbers: Vec<u64>,
    /// The rows of the tasks, with every feature that is compared.
    pub data: Dataset,
    /// The tasks as they were driven.
    pub trajectories: Vec<Trajectory>,
}

/// Why a participant's data cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DataError {
    /// A trial is wrong.
    #[error("{0}")]
    Trials(Fault),
    /// The given features do not go with the trials.
    #[error("{0}")]
    Features(Fault),
}

impl DataError {
    /// As the reason to exclude the participant.
    pub(super) fn exclusion(&self, participant: &str) -> Exclusion {
        match self {
            Self::Trials(fault) => Exclusion::of_fault(participant, fault),
            Self::Features(fault) => Exclusion::new(participant, format!("features: {fault}")),
        }
    }
}

impl ParticipantData {
    /// The trials of `recorded`, which are tasks, with the features of `given` in place of
    /// computed ones.
    ///
    /// # Errors
    /// [`DataError`] if a trial is wrong, or features do not go with the trials.
    pub fn of(
        recorded: &RecordedParticipant,
        scene: &SceneParameters,
        safety: &SafetyLevels,
        given: Option<&GivenFeatures>,
    ) -> Result<Self, DataError> {
        let mut data = Dataset::of(recorded, safety).map_err(DataError::Trials)?;
        if let Some(given) = given {
            given.replace(recorded, &mut data).map_err(DataError::Features)?;
        }
        let trajectories = recorded.trials.iter().map(|trial| Trajectory::of(trial, scene));
        Ok(Self {
            name: recorded.name.clone(),
            line: recorded.line,
            numbers: recorded.trials.iter().map(|trial| trial.number).collect(),
            trajectories: trajectories.collect::<Result<_, _>>().map_err(DataError::Trials)?,
            data,
        })
    }

    /// The tasks that test.
    pub(super) fn test_trajectories(&self) -> &[Trajectory] {
        &self.trajectories[first_test_task(self.trajectories.len())..]
    }

    /// What the tables say about the participant.
    pub(super) fn compared(&self) -> ComparedParticipant {
        ComparedParticipant {
            name: self.name.clone(),
            test_trials: self.numbers[first_test_task(self.numbers.len())..].to_vec(),
            steps: self.trajectories.first().map_or(0, Trajectory::steps),
        }
    }

    pub(super) fn excluded(&self, reason: String) -> Exclusion {
        Exclusion { first_line: self.line, ..Exclusion::new(&self.name, reason) }
    }

    /// Why no model can be trained on these tasks, if so.
    fn reason_against(&self, split: &Split) -> Option<String> {
        let tasks = self.trajectories.len();
        if tasks < LEAST_TASKS {
            return Some(format!("{tasks} tasks, at least {LEAST_TASKS} are needed"));
        }
        let inputs = || split.training.iter().map(|&row| self.data.labels[row]);
        let first = inputs().next()?;
        if inputs().all(|input| input == first) {
            let word = first.word();
            return Some(format!("one kind of input only in the training tasks ({word})"));
        }
        let always = inputs().all(|input| input != TurnInput::Straight);
        always.then(|| "a turn in every step of the training tasks".to_owned())
    }
}

/// The order of names: numbers by size, then other names.
pub(super) fn order(name: &str) -> (bool, Option<u64>, &str) {
    let number = name.parse().ok();
    (number.is_none(), number, name)
}

/// Everything that is to be fitted.
pub(super) struct Plan<'a> {
    /// The participants in the order of their names, with their splits.
    pub(super) participants: Vec<Planned<'a>>,
    /// The fits, participant by participant. They take about equally long.
    pub(super) fits: Vec<Fit<'a>>,
    /// The participants whose data cannot be learned from.
    pub(super) exclusions: Vec<Exclusion>,
}

/// A participant of a plan.
pub(super) struct Planned<'a> {
    pub(super) data: &'a ParticipantData,
    /// Whole trials held back.
    pub(super) split: Split,
    /// Single steps held back, to show what leaks.
    leaking: Split,
}

/// One family of models to be fitted for one participant on one feature set.
pub(super) struct Fit<'a> {
    /// The participant's place in the plan.
    pub(super) participant: usize,
    pub(super) set: &'a NamedSet,
    pub(super) family: ModelFamily,
    pub(super) purpose: Purpose,
}

/// What a fit is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The tables.
    Tables,
    /// Roll-outs only: models beyond the paper.
    Rollouts,
    /// Showing what leaks.
    Leakage,
}

impl<'a> Plan<'a> {
    pub(super) fn new(participants: &'a [ParticipantData], settings: &'a Settings) -> Self {
        let mut ordered: Vec<&ParticipantData> = participants.iter().collect();
        ordered.sort_by(|a, b| order(&a.name).cmp(&order(&b.name)));
        let mut plan = Self { participants: Vec::new(), fits: Vec::new(), exclusions: Vec::new() };
        for data in ordered {
            let split = Split::grouped(&data.data);
            match data.reason_against(&split) {
                Some(reason) => plan.exclusions.push(data.excluded(reason)),
                None => plan.add(data, split, settings),
            }
        }
        plan
    }

    /// Plans the fits of one participant.
    fn add(&mut self, data: &'a ParticipantData, split: Split, settings: &'a Settings) {
        let participant = self.participants.len();
        self.participants.push(Planned { data, split, leaking: Split::leaking(&data.data) });
        let mut fit =
            |purpose, set, family| self.fits.push(Fit { participant, set, family, purpose });
        for set in &settings.sets {
            for family in ModelFamily::PAPERS {
                fit(Purpose::Tables, set, family);
            }
        }
        for (set, family) in settings.beyond() {
            fit(Purpose::Rollouts, set, family);
        }
        for family in ModelFamily::PAPERS.into_iter().filter(|_| settings.leakage) {
            fit(Purpose::Leakage, &settings.sets[0], family);
        }
    }

    /// The participant of a fit, and how their rows are split for it.
    pub(super) fn rows(&self, fit: &Fit<'_>) -> (&ParticipantData, &Split) {
        let planned = &self.participants[fit.participant];
        let split = match fit.purpose {
            Purpose::Leakage => &planned.leaking,
            Purpose::Tables | Purpose::Rollouts => &planned.split,
        };
        (planned.data, split)
    }
}

/// Results depend on what this names too: to be changed with anything that changes them.
const METHOD: &str = "sidestep-comparison/3";

/// A hash of everything that the cells of a fit depend on.
pub(super) fn key(family: ModelFamily, data: &Dataset, split: &Split, grids: &Grids) -> String {
    let mut hash = Sha256::new();
    hash.update(METHOD);
    hash.update(family.grid(grids));
    for name in Vec::<String>::from(data.features.clone()) {
        hash.update(name);
        hash.update([0]);
    }
    data.values.iter().for_each(|value| hash.update(value.to_bits().to_le_bytes()));
    data.labels.iter().for_each(|label| hash.update(label.sign().to_le_bytes()));
    for rows in [&split.training, &split.folds, &split.test] {
        hash.update((rows.len() as u64).to_le_bytes());
        rows.iter().for_each(|&row| hash.update((row as u64).to_le_bytes()));
    }
    hex::encode(hash.finalize())
}

/// Fails if no participant is left.
///
/// # Errors
/// [`Invalid`] with everybody's reason.
pub(super) fn somebody_left(left: usize, exclusions: &[Exclusion]) -> Result<(), Invalid> {
    if left > 0 {
        return Ok(());
    }
    let reasons: Vec<String> =
        exclusions.iter().map(|e| format!("{}: {}", e.participant, e.reason)).collect();
    let found = if reasons.is_empty() { "nobody".to_owned() } else { reasons.join("; ") };
    Err(Invalid::new("participants", "somebody whose data can be learned from", found))
}
