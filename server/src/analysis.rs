//! The paper's comparison of one study, and the files that tell of it.

mod best;
mod cache;
mod context;
mod excluded;
mod files;
mod latex;
mod report;

pub use cache::FolderCache;
pub use context::{Context, DecisionMap};
pub use excluded::Excluded;

use crate::features_csv::{self, FeatureRows};
use crate::trials_csv::{self, Fault, LineError};
use sidestep::comparison::ablation::{Ablation, ablation};
use sidestep::comparison::cell::{Experiment, ModelName};
use sidestep::comparison::metrics::Predictions;
use sidestep::comparison::tables::{Comparison, Test};
use sidestep::comparison::{Exclusion, Leakage, Person, Results, RolloutsOf};
use sidestep::features::SafetyFunctions;
use sidestep::invalid::Invalid;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::window::Trajectory;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Everything that is told.
#[derive(Clone, Debug, PartialEq)]
pub struct Analysis {
    /// The cells.
    pub comparison: Comparison,
    /// Tests of the differences between feature sets.
    pub tests: Vec<Test>,
    /// The baseline, and what a body frame explains.
    pub ablation: Vec<Ablation>,
    /// What the baseline says of each person's test rows: experiment I, then II.
    pub baselines: [Vec<Predictions>; 2],
    /// Predictors fed with what they said.
    pub rollouts: Vec<RolloutsOf>,
    /// What a split by time step would claim; empty unless asked for.
    pub leakage: Vec<Leakage>,
    /// Who was left out.
    pub exclusions: Vec<Exclusion>,
    /// Why the data are known to be synthetic, if they are.
    pub synthetic: Option<String>,
    /// What the cells do not tell.
    pub context: Context,
}

impl Analysis {
    /// Of these results.
    ///
    /// # Errors
    /// [`Invalid`] if there is nobody.
    pub fn of(
        results: Results,
        synthetic: Option<String>,
        context: Context,
    ) -> Result<Self, Invalid> {
        let ablation = ablation(&results)?;
        let tests = results.comparison.tests()?;
        let baselines = Experiment::ALL.map(|experiment| {
            let own = results.baselines.iter().filter(|of| of.experiment == experiment);
            own.map(|baseline| baseline.test.clone()).collect()
        });
        let Results { comparison, rollouts, leakage, exclusions, .. } = results;
        Ok(Self {
            comparison,
            tests,
            ablation,
            baselines,
            rollouts,
            leakage,
            exclusions,
            synthetic,
            context,
        })
    }

    /// All people's test rows together: for the baseline, then each model, experiment and
    /// feature set, with its name.
    pub fn predictions_by_table_entry(
        &self,
    ) -> impl Iterator<Item = (&str, Experiment, &str, Predictions)> {
        let baseline = Experiment::ALL.into_iter().zip(&self.baselines).map(|(experiment, of)| {
            let all = Predictions::together(experiment.classes(), of);
            ("constant", experiment, "none", all)
        });
        let sets = self.sets();
        let entries = ModelName::ALL.into_iter().flat_map(|model| {
            Experiment::ALL.into_iter().map(move |experiment| (model, experiment))
        });
        let models = entries.flat_map(move |(model, experiment)| {
            sets.clone().into_iter().map(move |set| {
                let cells = self.comparison.of(model, experiment, set);
                let all = Predictions::together(experiment.classes(), cells.map(|cell| &cell.test));
                (model.word(), experiment, set, all)
            })
        });
        baseline.chain(models)
    }

    /// The names of the feature sets, in order.
    #[must_use]
    pub fn sets(&self) -> Vec<&str> {
        let first = self.comparison.cells.first();
        let one = |cell: &&sidestep::comparison::cell::Cell| {
            first.is_some_and(|first| {
                (cell.model, cell.experiment, cell.participant)
                    == (first.model, first.experiment, first.participant)
            })
        };
        self.comparison.cells.iter().filter(one).map(|cell| cell.features.as_str()).collect()
    }

    /// Writes every file into `folder`, which is there.
    ///
    /// # Errors
    /// What the disk says.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        for (name, table) in files::TABLES {
            let mut out = BufWriter::new(File::create(folder.join(name))?);
            table(self, &mut out)?;
            out.flush()?;
        }
        std::fs::write(folder.join("report.html"), report::html(self))?;
        std::fs::write(folder.join("tables.tex"), latex::tables(self))?;
        let models = folder.join("models");
        std::fs::create_dir(&models)?;
        for cell in &self.comparison.cells {
            let person = files::file_name(&self.comparison.participants[cell.participant].name);
            let name = format!(
                "{}-{}-{}-{person}.json",
                cell.model.word(),
                cell.experiment.number(),
                cell.features
            );
            let out = BufWriter::new(File::create(models.join(name))?);
            serde_json::to_writer(out, &cell.predictor)?;
        }
        Ok(())
    }
}

/// People as the comparison takes them, with the features of `given` in place of computed ones,
/// and who is left out because their features are no numbers or do not go with their trials.
///
/// # Errors
/// [`PeopleError`] for a trial that cannot be one, or for features that go with nobody's trials.
pub fn people(
    file: &[trials_csv::Person],
    scene: &SceneParameters,
    safety: &SafetyFunctions,
    given: Option<&FeatureRows>,
) -> Result<(Vec<Person>, Vec<Excluded>), PeopleError> {
    let mut people = Vec::new();
    let mut excluded = Vec::new();
    let mut first = None;
    for person in file {
        let mut data = match features_csv::dataset(person, safety) {
            Ok(data) => data,
            Err(error) => {
                let participant = person.name.clone();
                excluded.push(Excluded::by_trials(Fault { participant, error }));
                continue;
            }
        };
        if let Some(Err(error)) = given.map(|given| given.replace(person, &mut data)) {
            excluded.push(Excluded::by_features(&person.name, &error));
            first.get_or_insert(error);
            continue;
        }
        let trajectory = |trial: &trials_csv::FileTrial| {
            let rates = trial.inputs.iter().map(|&input| scene.human.turn_rate(input));
            Trajectory::new(trial.states.clone(), rates.collect())
                .map_err(|what| PeopleError::Trials(LineError { line: trial.line, what }))
        };
        people.push(Person {
            name: person.name.clone(),
            numbers: person.trials.iter().map(|trial| trial.number).collect(),
            trajectories: person.trials.iter().map(trajectory).collect::<Result<_, _>>()?,
            data,
        });
    }
    match first {
        Some(error) if people.is_empty() => Err(PeopleError::Features(error)),
        _ => Ok((people, excluded)),
    }
}

/// Which file is wrong, and where.
#[derive(Debug)]
pub enum PeopleError {
    /// The trials.
    Trials(LineError),
    /// The features.
    Features(LineError),
}
