//! The fits of a comparison: one for each participant, feature set and model.

use super::models::{CURVE_MODELS, Grids, ModelName, UNSEEN_MODELS};
use super::sets::NamedSet;
use super::settings::Settings;
use super::split::{FOLDS, LEAST_TASKS, Split, first_test_task, fold_of};
use super::tables::ComparedParticipant;
use crate::dataset::{Dataset, GivenFeatures};
use crate::invalid::Invalid;
use crate::recording::{Exclusion, Fault, RecordedParticipant};
use crate::safety::SafetyLevels;
use crate::scene::SceneParameters;
use crate::shfrs::window::Trajectory;
use crate::vehicle::TurnInput;
use sha2::{Digest, Sha256};
use std::borrow::Cow;

/// A participant's tasks, ready for learning.
#[derive(Clone, Debug, PartialEq)]
pub struct ParticipantData {
    /// The participant's name or number in the data.
    pub name: String,
    /// Line of the participant's first row in the file; `None` if there is no file.
    pub line: Option<u64>,
    /// The number of each task, in order.
    pub numbers: Vec<u64>,
    /// The rows of the tasks, with every compared feature.
    pub data: Dataset,
    /// The tasks as they were driven.
    pub trajectories: Vec<Trajectory>,
}

/// The reason why a participant's data cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DataError {
    /// A trial is invalid.
    #[error("{0}")]
    Trials(Fault),
    /// The given features do not match the trials.
    #[error("{0}")]
    Features(Fault),
}

impl DataError {
    /// The error as a reason to exclude the participant.
    pub(super) fn exclusion(&self, participant: &str) -> Exclusion {
        match self {
            Self::Trials(fault) => Exclusion::of_fault(participant, fault),
            Self::Features(fault) => Exclusion::new(participant, format!("features: {fault}")),
        }
    }
}

impl ParticipantData {
    /// Prepares the trials of `recorded`, all of which must be tasks. Features in `given` replace
    /// the computed features.
    ///
    /// # Errors
    /// [`DataError`] if a trial is invalid, or if features do not match the trials.
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

    /// The test tasks.
    pub(super) fn test_trajectories(&self) -> &[Trajectory] {
        &self.trajectories[first_test_task(self.trajectories.len())..]
    }

    /// The participant's entry in the tables.
    pub(super) fn compared(&self) -> ComparedParticipant {
        let (training, test) = self.numbers.split_at(first_test_task(self.numbers.len()));
        ComparedParticipant {
            name: self.name.clone(),
            training_trials: training.to_vec(),
            test_trials: test.to_vec(),
            steps: self.trajectories.first().map_or(0, Trajectory::steps),
        }
    }

    pub(super) fn excluded(&self, reason: String) -> Exclusion {
        Exclusion { first_line: self.line, ..Exclusion::new(&self.name, reason) }
    }

    /// The reason why no model can be trained on these tasks. `None` if models can be trained.
    fn reason_against(&self, split: &Split) -> Option<String> {
        let tasks = self.trajectories.len();
        if tasks < LEAST_TASKS {
            return Some(format!("{tasks} tasks, at least {LEAST_TASKS} are needed"));
        }
        let inputs = || split.training.iter().map(|&row| self.data.labels[row]);
        let first = inputs().next()?;
        if inputs().all(|input| input == first) {
            let word = first.word();
            return Some(format!("only one kind of input in the training tasks ({word})"));
        }
        let always = inputs().all(|input| input != TurnInput::Straight);
        always.then(|| "a turn in every step of the training tasks".to_owned())
    }
}

/// Sort key for names. Numbers come first, sorted by value. The other names follow.
pub(super) fn order(name: &str) -> (bool, Option<u64>, &str) {
    let number = name.parse().ok();
    (number.is_none(), number, name)
}

/// All fits of a comparison.
pub(super) struct Plan<'a> {
    /// The participants in the order of their names, with their splits.
    pub(super) participants: Vec<Planned<'a>>,
    /// The fits: first the models trained on other people, then the fits of each participant.
    pub(super) fits: Vec<Fit<'a>>,
    /// The data for training and testing the models of [`Purpose::Unseen`].
    pub(super) everybody: Option<Everybody>,
    /// The participants with unusable data.
    pub(super) exclusions: Vec<Exclusion>,
}

/// A participant of a plan.
pub(super) struct Planned<'a> {
    pub(super) data: &'a ParticipantData,
    /// The split by whole trials.
    pub(super) split: Split,
    /// The split by time step, which demonstrates leakage.
    leaking: Split,
}

/// One model to fit for one participant on one feature set.
pub(super) struct Fit<'a> {
    /// The participant's index in the plan; for [`Purpose::Unseen`], the index of the group.
    pub(super) participant: usize,
    pub(super) set: &'a NamedSet,
    pub(super) model: ModelName,
    pub(super) purpose: Purpose,
}

/// The purpose of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// A fit for the tables.
    Tables,
    /// A fit of a model beyond the paper, for roll-outs only.
    Rollouts,
    /// A fit that demonstrates the leakage of a split by time step.
    Leakage,
    /// A fit for learning curves. It is trained only on the participant's first tasks. The value is
    /// the number of these tasks.
    Learning(usize),
    /// A fit for predictions of unseen people. It is trained on the tasks of all groups of people
    /// except one, and tested on this group.
    Unseen,
}

/// The numbers of training tasks for which learning curves have a point. Each curve also has a
/// point with all training tasks.
pub(super) const FIRST_TASKS: [usize; 3] = [5, 10, 20];

/// The feature sets of models that are trained on fewer tasks or on other people.
pub(super) const COMPARED_SETS: [&str; 3] = ["hrd", "d", "hrd_body"];

/// Maximum number of groups in [`Purpose::Unseen`]. Up to this number of people, each person is a
/// group. With more people, some groups contain several people.
pub(super) const MOST_GROUPS: usize = 20;

/// The rows of all participants of a plan, concatenated.
pub(super) struct Everybody {
    data: Dataset,
    /// For each group, a split: train on the other groups' rows, test on the group's test tasks.
    splits: Vec<Split>,
}

impl Everybody {
    fn of(participants: &[Planned<'_>]) -> Option<Self> {
        let first = participants.first()?;
        let columns = first.data.data.features.clone();
        let mut data = Dataset {
            features: columns,
            values: Vec::new(),
            labels: Vec::new(),
            trials: Vec::new(),
        };
        let mut offsets = Vec::new();
        for Planned { data: of, .. } in participants {
            let trials = data.trials.last().map_or(0, |last| last + 1);
            offsets.push(data.labels.len());
            data.values.extend_from_slice(&of.data.values);
            data.labels.extend_from_slice(&of.data.labels);
            data.trials.extend(of.data.trials.iter().map(|trial| trials + trial));
        }
        let groups = participants.len().min(MOST_GROUPS);
        let split = |group: usize| {
            let mut split = Split { training: Vec::new(), folds: Vec::new(), test: Vec::new() };
            let mut others = 0;
            for (i, (of, offset)) in participants.iter().zip(&offsets).enumerate() {
                if i % groups == group {
                    split.test.extend(of.split.test.iter().map(|row| offset + row));
                    continue;
                }
                let rows = of.data.data.labels.len();
                split.training.extend(*offset..offset + rows);
                // If there are enough people, all rows of a person are in the same fold.
                let fold = |row: usize| match participants.len() > FOLDS {
                    true => others % FOLDS,
                    false => fold_of(of.data.data.trials[row]),
                };
                split.folds.extend((0..rows).map(fold));
                others += 1;
            }
            split
        };
        let splits = if groups > 1 { (0..groups).map(split).collect() } else { Vec::new() };
        Some(Self { data, splits })
    }

    /// Number of groups; 0 for a single participant.
    pub(super) fn groups(&self) -> usize {
        self.splits.len()
    }
}

impl<'a> Plan<'a> {
    pub(super) fn new(participants: &'a [ParticipantData], settings: &'a Settings) -> Self {
        let mut ordered: Vec<&ParticipantData> = participants.iter().collect();
        ordered.sort_by(|a, b| order(&a.name).cmp(&order(&b.name)));
        let (mut planned, mut exclusions) = (Vec::new(), Vec::new());
        for data in ordered {
            let split = Split::grouped(&data.data);
            match data.reason_against(&split) {
                Some(reason) => exclusions.push(data.excluded(reason)),
                None => planned.push(Planned { data, split, leaking: Split::leaking(&data.data) }),
            }
        }
        let everybody = Everybody::of(&planned);
        let mut plan = Self { participants: planned, fits: Vec::new(), everybody, exclusions };
        let compared = || {
            let is =
                |set: &&NamedSet| !settings.paper_only && COMPARED_SETS.contains(&&set.name[..]);
            settings.sets.iter().filter(is)
        };
        // The slowest fits come first.
        for participant in 0..plan.everybody.as_ref().map_or(0, Everybody::groups) {
            for set in compared() {
                let fit = |model| Fit { participant, set, model, purpose: Purpose::Unseen };
                plan.fits.extend(UNSEEN_MODELS.map(fit));
            }
        }
        for participant in 0..plan.participants.len() {
            plan.add(participant, settings);
            let Planned { data, .. } = &plan.participants[participant];
            let all = first_test_task(data.trajectories.len());
            for tasks in FIRST_TASKS.into_iter().filter(|tasks| *tasks < all) {
                let split = Split::of_first_tasks(&data.data, tasks);
                if data.reason_against(&split).is_some() {
                    continue;
                }
                for set in compared() {
                    let purpose = Purpose::Learning(tasks);
                    let fit = |model| Fit { participant, set, model, purpose };
                    plan.fits.extend(CURVE_MODELS.map(fit));
                }
            }
        }
        plan
    }

    /// Plans the fits of the tables, roll-outs and leakage of one participant.
    fn add(&mut self, participant: usize, settings: &'a Settings) {
        let mut fit =
            |purpose, set, model| self.fits.push(Fit { participant, set, model, purpose });
        for set in &settings.sets {
            for model in ModelName::TRAINED {
                fit(Purpose::Tables, set, model);
            }
        }
        for (set, model) in settings.beyond() {
            fit(Purpose::Rollouts, set, model);
        }
        for model in ModelName::TRAINED.into_iter().filter(|_| settings.leakage) {
            fit(Purpose::Leakage, &settings.sets[0], model);
        }
    }

    /// The rows of a fit, and their split.
    pub(super) fn rows(&self, fit: &Fit<'_>) -> (&Dataset, Cow<'_, Split>) {
        if let (Purpose::Unseen, Some(everybody)) = (fit.purpose, &self.everybody) {
            return (&everybody.data, Cow::Borrowed(&everybody.splits[fit.participant]));
        }
        let Planned { data, split, leaking } = &self.participants[fit.participant];
        let split = match fit.purpose {
            Purpose::Leakage => Cow::Borrowed(leaking),
            Purpose::Learning(tasks) => Cow::Owned(Split::of_first_tasks(&data.data, tasks)),
            Purpose::Tables | Purpose::Rollouts | Purpose::Unseen => Cow::Borrowed(split),
        };
        (&data.data, split)
    }
}

/// Version of the method. Change it whenever a change of the code changes results.
const METHOD: &str = "sidestep-comparison/3";

/// A hash of everything that the cells of a fit depend on.
pub(super) fn key(model: ModelName, data: &Dataset, split: &Split, grids: &Grids) -> String {
    let mut hash = Sha256::new();
    hash.update(METHOD);
    if let Some(training) = model.training() {
        hash.update(format!("{} {}", model.word(), training.grid(grids)));
    }
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

/// Returns an error if no participant is left.
///
/// # Errors
/// [`Invalid`] with the reason for each participant.
pub(super) fn somebody_left(left: usize, exclusions: &[Exclusion]) -> Result<(), Invalid> {
    if left > 0 {
        return Ok(());
    }
    let reasons: Vec<String> =
        exclusions.iter().map(|e| format!("{}: {}", e.participant, e.reason)).collect();
    let found = if reasons.is_empty() { "nobody".to_owned() } else { reasons.join("; ") };
    Err(Invalid::new("participants", "a participant with usable data", found))
}
