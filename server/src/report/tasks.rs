//! What is compared: people's tasks, from a file or a study.

use super::{Analysis, Context, Excluded};
use crate::formats::csv_lines::LineError;
use crate::formats::features_csv::{self, FeatureRows};
use crate::formats::trials_csv::{self, Fault, FileTrial};
use crate::store::studies::StoredStudy;
use crate::store::trials::StoredTrial;
use crate::store::{Store, StoreError};
use crate::synthetic;
use sidestep::comparison::{self, Cache, Person, Progress, RunError, Settings};
use sidestep::invalid::Invalid;
use sidestep::safety::{SafetyLevels, SafetyQuality};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::window::Trajectory;
use sidestep::trial::{Flag, Phase};
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// Everybody's tasks.
#[derive(Clone, Debug)]
pub struct Tasks {
    /// With all their tasks; who has too few for a comparison is left out by it.
    pub people: Vec<trials_csv::Person>,
    /// Who is not among them though they drove, and why.
    pub exclusions: Vec<Excluded>,
    /// What was driven with.
    pub scene: SceneParameters,
    /// Why the data are known to be synthetic, if they are.
    pub synthetic: Option<String>,
}

/// Why there is no analysis.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A trial cannot be one.
    #[error("{0}")]
    Trials(LineError),
    /// The features do not go with the trials.
    #[error("{0}")]
    Features(LineError),
    /// Something else in the data, or the settings.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// It was broken off.
    #[error("stopped")]
    Stopped,
}

impl CompareError {
    /// As a reason to leave somebody out.
    fn exclusion(&self, participant: &str) -> Excluded {
        match self {
            Self::Trials(error) => {
                let (participant, error) = (participant.to_owned(), error.clone());
                Excluded::from(Fault { participant, error })
            }
            Self::Features(error) => Excluded::new(participant, format!("features: {error}")),
            other => Excluded::new(participant, other.to_string()),
        }
    }
}

impl From<RunError> for CompareError {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Invalid(invalid) => Self::Invalid(invalid),
            RunError::Stopped => Self::Stopped,
        }
    }
}

impl Tasks {
    /// Of everybody in a study whose data are not deleted. Who enrolled under other parameters
    /// than the study's present ones is left out: their trials are not those of the others.
    ///
    /// # Errors
    /// If the database cannot be read.
    pub async fn of_study(store: &Store, study: &StoredStudy) -> Result<Self, StoreError> {
        let scene = study.config.parameters;
        let (mut people, mut exclusions) = (Vec::new(), Vec::new());
        // Participant by participant: a long read would keep the log from being written back.
        for id in store.participant_ids(study.id).await? {
            let driven = store.trials_of(&id).await?;
            let Some(first) = driven.first() else { continue };
            let name = first.head.participant_number.to_string();
            let own = store.config(&first.config_hash).await?.parameters;
            if own != scene {
                let reason = "enrolled under other parameters than the study's present ones";
                exclusions.push(Excluded::new(&name, reason.to_owned()));
                continue;
            }
            // Numbers count all phases, as in exports.
            let numbered = (0..).zip(driven);
            let tasks = numbered.filter(|(_, trial)| trial.head.phase == Phase::Task);
            let mut synthetic = false;
            let trials: Vec<FileTrial> = tasks
                .inspect(|(_, trial)| synthetic |= trial.is_synthetic())
                .map(|(number, trial)| file_trial(number, trial))
                .collect();
            people.push(trials_csv::Person { name, line: None, trials, synthetic });
        }
        let synthetic = synthetic::recognised(&people);
        Ok(Self { people, exclusions, scene, synthetic })
    }

    /// Compares, with the features of `given` in place of computed ones. Who has no features, or
    /// others than their trials, is left out.
    ///
    /// # Errors
    /// [`CompareError`] if the data cannot be compared, or `progress` breaks it off.
    pub fn compare(
        &self,
        safety: &SafetyLevels,
        given: Option<&FeatureRows>,
        settings: &Settings,
        cache: &dyn Cache,
        progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
    ) -> Result<Analysis, CompareError> {
        let mut exclusions = self.exclusions.clone();
        let mut people = Vec::new();
        let mut first = None;
        for file in &self.people {
            match self.person(file, safety, given) {
                Ok(person) => people.push(person),
                Err(error) => {
                    exclusions.push(error.exclusion(&file.name));
                    first.get_or_insert(error);
                }
            }
        }
        if let (Some(error), true) = (first, people.is_empty()) {
            return Err(error);
        }
        let results =
            comparison::run(&people, &self.scene, safety, settings, Some(cache), progress)?;
        let context = Context::of(&results, &people, &self.scene, safety)?;
        let mut analysis =
            Analysis::of(results, self.synthetic.clone(), context, settings.clone())?;
        for unfit in &mut analysis.exclusions {
            let file = self.people.iter().find(|person| person.name == unfit.participant);
            unfit.first_line = file.and_then(|person| person.line);
        }
        analysis.exclusions.splice(0..0, exclusions);
        analysis.flagged = self.flagged(&analysis);
        analysis.same_trials = self.same_trials(&analysis);
        analysis.safety = Some(quality(&analysis, &people, safety));
        Ok(analysis)
    }

    /// Flags of the trials that `analysis` compares. That a trial was imported casts no doubt on it.
    fn flagged(&self, analysis: &Analysis) -> BTreeMap<String, usize> {
        let compared = &analysis.comparison.participants;
        let kept = |file: &&trials_csv::Person| compared.iter().any(|who| who.name == file.name);
        let trials = self.people.iter().filter(kept).flat_map(|person| &person.trials);
        let mut flagged = BTreeMap::new();
        for flag in trials.flat_map(|trial| &trial.flags).filter(|flag| **flag != Flag::Imported) {
            *flagged.entry(flag.word().to_owned()).or_insert(0) += 1;
        }
        flagged
    }

    /// Who of those that `analysis` compares has the same trials as somebody else, to the last bit.
    fn same_trials(&self, analysis: &Analysis) -> Vec<String> {
        let trials = |name: &str| {
            let mut all = Vec::new();
            let person = self.people.iter().find(|person| person.name == name);
            for trial in person.iter().flat_map(|person| &person.trials) {
                all.extend(trial.inputs.iter().map(|input| f64::from(input.sign()).to_bits()));
                for JointState { human, robot } in &trial.states {
                    let numbers = [human.x, human.y, human.psi, robot.x, robot.y, robot.psi];
                    all.extend(numbers.map(f64::to_bits));
                }
            }
            all
        };
        let mut who: BTreeMap<Vec<u64>, Vec<usize>> = BTreeMap::new();
        let compared = &analysis.comparison.participants;
        for (place, participant) in compared.iter().enumerate() {
            who.entry(trials(&participant.name)).or_default().push(place);
        }
        let mut several: Vec<usize> =
            who.into_values().filter(|places| places.len() > 1).flatten().collect();
        several.sort_unstable();
        several.into_iter().map(|place| compared[place].name.clone()).collect()
    }

    fn person(
        &self,
        person: &trials_csv::Person,
        safety: &SafetyLevels,
        given: Option<&FeatureRows>,
    ) -> Result<Person, CompareError> {
        let mut data = features_csv::dataset(person, safety).map_err(CompareError::Trials)?;
        if let Some(given) = given {
            given.replace(person, &mut data).map_err(CompareError::Features)?;
        }
        let trajectory = |trial: &FileTrial| {
            let rates = trial.inputs.iter().map(|&input| self.scene.human.turn_rate(input));
            Trajectory::new(trial.states.clone(), rates.collect())
                .map_err(|what| CompareError::Trials(LineError { line: trial.line, what }))
        };
        Ok(Person {
            name: person.name.clone(),
            numbers: person.trials.iter().map(|trial| trial.number).collect(),
            trajectories: person.trials.iter().map(trajectory).collect::<Result<_, _>>()?,
            data,
        })
    }
}

/// Of the levels that `analysis` compares.
fn quality(analysis: &Analysis, people: &[Person], safety: &SafetyLevels) -> SafetyQuality {
    let compared = &analysis.comparison.participants;
    let kept = |person: &&Person| compared.iter().any(|who| who.name == person.name);
    let levels = |name: &str| -> Vec<f64> {
        let column = |person: &Person| {
            let features = &person.data.features;
            let place = features.features().position(|feature| feature.name == name);
            let values = person.data.values.chunks_exact(features.len());
            values.filter_map(|row| place.map(|place| row[place])).collect::<Vec<_>>()
        };
        people.iter().filter(kept).flat_map(column).collect()
    };
    SafetyQuality::of(safety, [&levels("v_h"), &levels("v_r")])
}

/// A stored trial as an export of the study would have it, but for its line: it is in none.
fn file_trial(number: u64, trial: StoredTrial) -> FileTrial {
    FileTrial {
        line: 0,
        number,
        phase: trial.head.phase,
        trial_id: Some(trial.head.trial_id),
        inputs: trial.inputs,
        states: trial.states,
        started_at_ms: trial.started_at_ms,
        sampled_at_ms: trial.sampled_at_ms,
        flags: trial.head.flags,
    }
}
