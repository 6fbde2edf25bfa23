//! The paper's comparison of one study, and the files that tell of it.

mod best;
mod context;
mod excluded;
mod latex;
mod page;
mod tables_csv;
mod tasks;

pub use context::{Context, DecisionMap};
pub use excluded::Excluded;
pub use tasks::{CompareError, Tasks};

use sidestep::comparison::ablation::{Ablation, ablation};
use sidestep::comparison::cell::{Experiment, ModelName};
use sidestep::comparison::metrics::Predictions;
use sidestep::comparison::tables::{Comparison, Test};
use sidestep::comparison::{Leakage, Results, RolloutsOf, Settings};
use sidestep::invalid::Invalid;
use sidestep::predict::PredictorFile;
use sidestep::safety::SafetyQuality;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes one file.
pub type Content<'a> = &'a dyn Fn(&mut dyn Write) -> io::Result<()>;

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
    pub exclusions: Vec<Excluded>,
    /// How many of the trials that are compared have a flag that casts doubt on them, by its word.
    pub flagged: BTreeMap<String, usize>,
    /// Who of those that are compared has the same trials as somebody else: one person under
    /// several names would count as so many.
    pub same_trials: Vec<String>,
    /// How both safety levels came about, and how much they differ over the steps that are
    /// compared; none where that was not looked at.
    pub safety: Option<SafetyQuality>,
    /// Why the data are known to be synthetic, if they are.
    pub synthetic: Option<String>,
    /// What the cells do not tell.
    pub context: Context,
    /// The sets and grids that were compared.
    pub settings: Settings,
}

impl Analysis {
    /// Of these results, found with `settings`.
    ///
    /// # Errors
    /// [`Invalid`] if there is nobody.
    pub fn of(
        results: Results,
        synthetic: Option<String>,
        context: Context,
        settings: Settings,
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
            exclusions: exclusions.into_iter().map(Excluded::from).collect(),
            flagged: BTreeMap::new(),
            same_trials: Vec::new(),
            safety: None,
            synthetic,
            context,
            settings,
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
        let sets = self.comparison.sets();
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

    /// Gives every file to `put`: its name, parts of which are joined by `/`, and what writes it.
    ///
    /// # Errors
    /// What `put` says.
    pub fn each_file(
        &self,
        put: &mut dyn FnMut(&str, Content<'_>) -> io::Result<()>,
    ) -> io::Result<()> {
        for (name, table) in tables_csv::tables(self) {
            put(name, &|out| table(self, out))?;
        }
        put("report.html", &|out| out.write_all(page::html(self).as_bytes()))?;
        put("tables.tex", &|out| out.write_all(latex::tables(self).as_bytes()))?;
        for cell in &self.comparison.cells {
            let person =
                tables_csv::file_name(&self.comparison.participants[cell.participant].name);
            let (model, experiment) = (cell.model.word(), cell.experiment.number());
            let name = format!("models/{model}-{experiment}-{}-{person}.json", cell.features);
            let predictor =
                PredictorFile { experiment: Some(experiment), ..cell.predictor.clone() };
            put(&name, &|out| Ok(serde_json::to_writer(out, &predictor)?))?;
        }
        Ok(())
    }

    /// Writes every file into `folder`, which is there.
    ///
    /// # Errors
    /// What the disk says.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir(folder.join("models"))?;
        self.each_file(&mut |name, write| {
            let mut out = BufWriter::new(File::create(folder.join(name))?);
            write(&mut out)?;
            out.flush()
        })
    }
}
