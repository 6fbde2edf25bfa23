//! An analysis: a comparison and everything computed from it. Reports, tables and pages only print
//! its content.

use super::cell::{Baseline, Experiment};
use super::copies::{CopiedTrials, copied_trials, same_trials};
use super::decision_map::{DecisionMap, decision_maps};
use super::findings::Findings;
use super::gains::{Ablation, Gain, GainFamily, Test, ablation, papers_tests};
use super::generalisation::{LearningPoint, Unseen};
use super::importance::Importance;
use super::metrics::Predictions;
use super::models::ModelName;
use super::plan::{ParticipantData, order, somebody_left};
use super::run::{AnalysisError, Cache, Leakage, Progress, Results, RolloutsOf, run};
use super::settings::Settings;
use super::tables::{Comparison, Metric, Pooled};
use crate::behaviour::Behaviour;
use crate::dataset::GivenFeatures;
use crate::invalid::Invalid;
use crate::recording::{Exclusion, RecordedParticipant, Recording, flagged};
use crate::safety::{SafetyLevels, SafetyQuality};
use crate::scene::SceneParameters;
use crate::trial::is_right_clock;
use core::ops::ControlFlow;
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// A comparison and everything computed from it.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// Summary of the compared data.
    pub data: DataSummary,
    /// The compared feature sets and grids.
    pub settings: Settings,
    /// The cells of the comparison.
    pub comparison: Comparison,
    /// The paper's tests of differences between feature sets.
    pub tests: Vec<Test>,
    /// Families of tests beyond the paper's. They test the body frame against the safety levels,
    /// both together against the body frame alone, and B_hrd against the commonest input.
    pub families: [GainFamily; 3],
    /// The ablation: the baseline, and models on sets with and without the body frame.
    pub ablation: Vec<Ablation>,
    /// The pooled test rows of all participants, for the baseline and each cell of the tables.
    pub pooled: Vec<Pooled>,
    /// Roll-outs of predictors.
    pub rollouts: Vec<RolloutsOf>,
    /// The inflated accuracy of a split by time step. Empty unless requested.
    pub leakage: Vec<Leakage>,
    /// The participants' behaviour.
    pub behaviour: Behaviour,
    /// Accuracy with fewer training tasks.
    pub learning: Vec<LearningPoint>,
    /// Accuracy on people whose data the models have not seen.
    pub unseen: Vec<Unseen>,
    /// Loss of accuracy when each feature is permuted.
    pub importance: Vec<Importance>,
    /// Maps of the models' decisions, one for each feature set and relative heading.
    pub maps: Vec<DecisionMap>,
    /// The findings that a report puts into words.
    pub findings: Findings,
}

/// Summary of an analysis's data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DataSummary {
    /// Number of tasks of all compared participants, including training tasks.
    pub trials: usize,
    /// The vehicles, steps and danger radius of these tasks.
    pub scene: SceneParameters,
    /// Evidence that the data are synthetic, if there is any.
    pub synthetic: Option<String>,
    /// Whether some of the compared participants are known to be synthetic and others are not.
    pub is_mixed: bool,
    /// The excluded participants.
    pub exclusions: Vec<Exclusion>,
    /// Number of compared trials with each flag, by the flag's word. A flag marks a doubtful trial.
    pub flagged: BTreeMap<String, usize>,
    /// The compared participants whose trials are identical to the trials of another participant.
    /// They may be one person under several names, who would then count several times.
    pub same_trials: Vec<String>,
    /// The compared participants with copies among their own trials.
    pub copied_trials: Vec<CopiedTrials>,
    /// SHA-256 of the compared trials, in hexadecimal. Two analyses with the same hash used the
    /// same data.
    pub sha256: String,
    /// Start times of the first and the last compared trial (ms since 1970, on the participants'
    /// clocks). `None` if the data do not record them.
    pub driven_at_ms: Option<[f64; 2]>,
    /// Quality of both safety levels over the compared steps. `None` if it is unknown.
    pub safety: Option<SafetyQuality>,
}

/// Sizes of the data and of the comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Number of compared participants.
    pub participants: usize,
    /// Number of tasks that models are tested on.
    pub test_trials: usize,
    /// Number of steps in these tasks.
    pub test_steps: usize,
    /// Number of trained models. The better of the two SVMs is not counted a second time.
    pub models: usize,
}

/// Compares the participants of a recording. All trials of the recording must be tasks. Features in
/// `given` replace the computed features. Participants with unusable data are excluded.
///
/// # Errors
/// [`AnalysisError`] if no participant is left, or if `progress` cancels.
pub fn analyse(
    recording: &Recording,
    given: Option<&GivenFeatures>,
    safety: &SafetyLevels,
    settings: &Settings,
    cache: Option<&dyn Cache>,
    progress: &(dyn Fn(Progress) -> ControlFlow<()> + Sync),
) -> Result<Analysis, AnalysisError> {
    let scene = &recording.scene;
    let mut exclusions = recording.exclusions.clone();
    let (mut people, mut errors) = (Vec::new(), Vec::new());
    for participant in &recording.participants {
        match ParticipantData::of(participant, scene, safety, given) {
            Ok(person) => people.push(person),
            Err(error) => {
                exclusions.push(error.exclusion(&participant.name));
                errors.push(error);
            }
        }
    }
    if let (Some(error), true) = (errors.into_iter().next(), people.is_empty()) {
        return Err(error.into());
    }
    somebody_left(people.len(), &exclusions)?;
    let mut results = run(&people, scene, safety, settings, cache, progress)?;
    exclusions.append(&mut results.exclusions);
    let compared = |name: &str| results.comparison.participants.iter().any(|of| of.name == name);
    let mut recorded: Vec<&RecordedParticipant> =
        recording.participants.iter().filter(|of| compared(&of.name)).collect();
    recorded.sort_by(|a, b| order(&a.name).cmp(&order(&b.name)));
    people.retain(|person| compared(&person.name));
    let data = DataSummary {
        trials: people.iter().map(|person| person.numbers.len()).sum(),
        scene: *scene,
        synthetic: recording.provenance.synthetic.clone(),
        is_mixed: recording.provenance.is_mixed
            && recorded.iter().any(|person| !person.marked_synthetic)
            && recorded.iter().any(|person| person.marked_synthetic),
        exclusions,
        flagged: flagged(recorded.iter().copied()),
        same_trials: same_trials(&recorded, &results.comparison.participants),
        copied_trials: copied_trials(&recorded, &results.comparison.participants),
        sha256: hash(&recorded),
        driven_at_ms: driven_at_ms(&recorded),
        safety: Some(quality(&people, safety)),
    };
    let maps = decision_maps(&results.comparison, safety)?;
    let behaviour = Behaviour::of(scene, recorded.iter().copied());
    Ok(Analysis::of(data, settings.clone(), results, behaviour, maps)?)
}

impl Analysis {
    /// Computes the rest of an analysis from `results`, `behaviour` and `maps`. The caller must
    /// have computed these from `data` with `settings`. The exclusions are taken from `data`.
    ///
    /// # Errors
    /// [`Invalid`] if there is no participant.
    pub fn of(
        data: DataSummary,
        settings: Settings,
        results: Results,
        behaviour: Behaviour,
        maps: Vec<DecisionMap>,
    ) -> Result<Self, Invalid> {
        let Results { comparison, baselines, rollouts, leakage, few_tasks, unseen, .. } = results;
        // The baseline is the same for every model.
        let accuracies = |model: Option<ModelName>, experiment, set: &str| match model {
            Some(model) if set != "none" => comparison.person_accuracies(model, experiment, set),
            _ => baseline_accuracies(&baselines, experiment),
        };
        let families = [
            GainFamily::of(("d_body", "hrd"), accuracies)?,
            GainFamily::of(("hrd_body", "d_body"), accuracies)?,
            GainFamily::of(("hrd", "none"), accuracies)?,
        ];
        let tests = papers_tests(&comparison)?;
        let pooled = pooled(&comparison, &baselines);
        let balanced = |model: Option<ModelName>, experiment, set: &str| match model {
            Some(model) => {
                let cells = comparison.of(model, experiment, set);
                cells.map(|cell| 100.0 * cell.test.balanced_accuracy()).collect()
            }
            None => {
                let own = baselines.iter().filter(|of| of.experiment == experiment);
                own.map(|of| 100.0 * of.test.balanced_accuracy()).collect::<Vec<f64>>()
            }
        };
        let ablation = ablation(&comparison, &pooled, accuracies, balanced)?;
        let findings =
            Findings::of(&comparison, &tests, &families, &pooled, &rollouts, &settings.grids);
        let learning = LearningPoint::all(&comparison, &few_tasks);
        let unseen = Unseen::all(&comparison, &unseen)?;
        Ok(Self {
            data,
            settings,
            comparison,
            tests,
            families,
            ablation,
            pooled,
            rollouts,
            leakage,
            behaviour,
            learning,
            unseen,
            importance: results.importance,
            maps,
            findings,
        })
    }

    /// Sizes of the data and of the comparison.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let participants = &self.comparison.participants;
        let models = self.comparison.cells.iter().filter(|cell| cell.model != ModelName::Svm);
        Counts {
            participants: participants.len(),
            test_trials: participants.iter().map(|of| of.test_trials.len()).sum(),
            test_steps: participants.iter().map(|of| of.test_trials.len() * of.steps).sum(),
            models: models.count(),
        }
    }

    /// The pooled test rows of all participants for a model on a feature set. `model` is `None` for
    /// the baseline.
    #[must_use]
    pub fn pooled(
        &self,
        model: Option<ModelName>,
        experiment: Experiment,
        set: &str,
    ) -> Option<&Pooled> {
        self.pooled.iter().find(|of| of.is(model, experiment, set))
    }

    /// The gains in accuracy of the set `first` over the set `second`. Gains in experiment I come
    /// first. Empty if the two sets are not compared.
    #[must_use]
    pub fn gains(&self, first: &str, second: &str) -> Vec<&Gain> {
        let is = |a: &str, b: &str| (a, b) == (first, second);
        let tests = self.tests.iter().filter(|test| test.gain.metric == Metric::Accuracy);
        let tests = tests.filter(|test| is(test.first, test.second)).map(|test| &test.gain);
        let families = self.families.iter().filter(|family| is(family.first, family.second));
        let mut gains: Vec<&Gain> =
            tests.chain(families.flat_map(|family| &family.gains)).collect();
        gains.sort_by_key(|gain| gain.experiment);
        gains
    }

    /// The baseline's test accuracy, a mean over participants (per cent).
    #[must_use]
    pub fn baseline_accuracy(&self, experiment: Experiment) -> f64 {
        let is = |row: &&Ablation| row.model.is_none() && row.experiment == experiment;
        self.ablation.iter().find(is).map_or(0.0, |row| row.accuracy)
    }
}

fn baseline_accuracies(baselines: &[Baseline], experiment: Experiment) -> Vec<f64> {
    let own = baselines.iter().filter(|of| of.experiment == experiment);
    own.map(|baseline| 100.0 * baseline.test.accuracy()).collect()
}

/// Pools all participants' test rows, first for the baseline, then for each model, experiment and
/// feature set.
fn pooled(comparison: &Comparison, baselines: &[Baseline]) -> Vec<Pooled> {
    let mut pooled = Vec::new();
    for experiment in Experiment::ALL {
        let own = baselines.iter().filter(|of| of.experiment == experiment);
        let all = Predictions::together(experiment.classes(), own.map(|of| &of.test));
        pooled.push(Pooled::of(None, experiment, "none", &all));
    }
    for model in ModelName::ALL {
        for experiment in Experiment::ALL {
            for set in comparison.sets() {
                let cells = comparison.of(model, experiment, set);
                let tests = cells.map(|cell| &cell.test);
                let all = Predictions::together(experiment.classes(), tests);
                pooled.push(Pooled::of(Some(model), experiment, set, &all));
            }
        }
    }
    pooled
}

/// Hash of the trials of these participants, who are sorted by name.
fn hash(participants: &[&RecordedParticipant]) -> String {
    let mut hash = Sha256::new();
    for participant in participants {
        hash.update((participant.name.len() as u64).to_le_bytes());
        hash.update(&participant.name);
        hash.update((participant.trials.len() as u64).to_le_bytes());
        for trial in &participant.trials {
            hash.update(trial.number.to_le_bytes());
            hash.update((trial.inputs.len() as u64).to_le_bytes());
            trial.inputs.iter().for_each(|input| hash.update(input.sign().to_le_bytes()));
            for pose in trial.states.iter().flat_map(|state| [state.human, state.robot]) {
                let numbers = <[f64; 3]>::from(pose);
                numbers.iter().for_each(|number| hash.update(number.to_bits().to_le_bytes()));
            }
        }
    }
    hex::encode(hash.finalize())
}

/// Start times of the first and the last trial of these participants. Implausible times are
/// ignored.
fn driven_at_ms(participants: &[&RecordedParticipant]) -> Option<[f64; 2]> {
    let trials = participants.iter().flat_map(|participant| &participant.trials);
    let told = || trials.clone().filter_map(|trial| trial.started_at_ms);
    let started = || told().filter(|&ms| is_right_clock(ms));
    Some([started().reduce(f64::min)?, started().reduce(f64::max)?])
}

/// Quality of both safety levels over the steps of these participants.
fn quality(people: &[ParticipantData], safety: &SafetyLevels) -> SafetyQuality {
    let levels = |name: &str| -> Vec<f64> {
        let column = |person: &ParticipantData| {
            let features = &person.data.features;
            let place = features.features().position(|feature| feature.name == name);
            let values = person.data.values.chunks_exact(features.len());
            values.filter_map(|row| place.map(|place| row[place])).collect::<Vec<_>>()
        };
        people.iter().flat_map(column).collect()
    };
    SafetyQuality::of(safety, [&levels("v_h"), &levels("v_r")])
}
