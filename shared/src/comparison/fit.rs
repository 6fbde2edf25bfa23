//! The models of one participant on one feature set, with hyper-parameters chosen by
//! cross-validation.

use super::cell::{Cell, Experiment, ModelName};
use super::metrics::{Predictions, highest};
use super::split::{FOLDS, Split};
use crate::dataset::Dataset;
use crate::invalid::Invalid;
use crate::learn::boosting::{self, BoostingSettings};
use crate::learn::logistic::{LogisticSettings, fit_path};
use crate::learn::samples::Samples;
use crate::learn::svm::{self, Grid, Kernels, SvmSettings, Target};
use crate::learn::tree;
use crate::predict::boosting::Boosted;
use crate::predict::logistic::Logistic;
use crate::predict::scale::Scale;
use crate::predict::svm::Kernel;
use crate::predict::tree::Tree;
use crate::predict::{Predictor, PredictorFile};
use serde::{Deserialize, Serialize};
use serde_json::json;

/// The hyper-parameters to try. Ties go to the first in order: C before γ, depth before leaf size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(default, deny_unknown_fields)]
pub struct Grids {
    /// C of SVMs with radial basis functions.
    pub rbf_c: Vec<f64>,
    /// Their γ, per squared unit of standardised features.
    pub rbf_gamma: Vec<f64>,
    /// C of linear SVMs.
    pub linear_c: Vec<f64>,
    /// Maximum depth of trees; null for no limit.
    pub tree_depth: Vec<Option<usize>>,
    /// Minimum number of rows in a leaf.
    pub tree_leaf: Vec<usize>,
    /// C of logistic regression.
    pub logistic_c: Vec<f64>,
    /// Depth of boosted trees; the log loss of held-out rows determines the number of trees.
    pub boosted_depth: Vec<usize>,
}

impl Default for Grids {
    /// The protocol's grids.
    fn default() -> Self {
        Self {
            rbf_c: vec![0.1, 1.0, 10.0, 100.0],
            rbf_gamma: vec![0.01, 0.03, 0.1, 0.3],
            linear_c: vec![0.01, 0.1, 1.0, 10.0],
            tree_depth: vec![Some(2), Some(3), Some(4), Some(6), Some(8), None],
            tree_leaf: vec![1, 5, 10, 20],
            logistic_c: vec![1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2],
            boosted_depth: vec![2, 3],
        }
    }
}

/// Models that are trained together and stored together in a [`super::Cache`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFamily {
    /// Support vector machines with radial basis functions.
    Rbf,
    /// Linear support vector machines.
    Linear,
    /// Decision trees.
    Tree,
    /// Logistic regressions.
    Logistic,
    /// Gradient-boosted trees: beyond the paper, in experiment I only.
    Boosted,
}

impl ModelFamily {
    /// The paper's families.
    pub const PAPERS: [Self; 4] = [Self::Rbf, Self::Linear, Self::Tree, Self::Logistic];

    /// Its model in tables.
    #[must_use]
    pub fn model(self) -> ModelName {
        match self {
            Self::Rbf => ModelName::SvmRbf,
            Self::Linear => ModelName::SvmLinear,
            Self::Tree => ModelName::Dt,
            Self::Logistic => ModelName::Lr,
            Self::Boosted => ModelName::Boosted,
        }
    }

    /// The grids that it depends on, with its name.
    pub(super) fn grid(self, grids: &Grids) -> String {
        let own = match self {
            Self::Rbf => json!([grids.rbf_c, grids.rbf_gamma]),
            Self::Linear => json!(grids.linear_c),
            Self::Tree => json!([grids.tree_depth, grids.tree_leaf]),
            Self::Logistic => json!(grids.logistic_c),
            Self::Boosted => json!(grids.boosted_depth),
        };
        format!("{} {own}", self.model().word())
    }
}

/// The cells of both experiments, or of the only one that the family supports.
///
/// # Errors
/// [`Invalid`] if a grid is empty or contains an impossible value, or if a fit fails.
pub fn fit(
    family: ModelFamily,
    data: &Dataset,
    split: &Split,
    grids: &Grids,
    features: &str,
    participant: usize,
) -> Result<Vec<Cell>, Invalid> {
    let experiments = match family {
        ModelFamily::Boosted => &[Experiment::TurnDirection][..],
        _ => &Experiment::ALL,
    };
    let problems: Vec<Problem<'_>> =
        experiments.iter().map(|&experiment| Problem::new(data, split, experiment)).collect();
    let chosen: Result<Vec<Chosen>, Invalid> = match family {
        ModelFamily::Rbf => {
            svms(data, split, &problems, Kernels::Rbf(grids.rbf_gamma.clone()), &grids.rbf_c)
        }
        ModelFamily::Linear => svms(data, split, &problems, Kernels::Linear, &grids.linear_c),
        ModelFamily::Tree => problems.iter().map(|of| of.tree(grids)).collect(),
        ModelFamily::Logistic => problems.iter().map(|of| of.logistic(&grids.logistic_c)).collect(),
        ModelFamily::Boosted => {
            problems.iter().map(|of| of.boosted(&grids.boosted_depth)).collect()
        }
    };
    let cell = |(problem, chosen): (&Problem<'_>, Chosen)| Cell {
        model: family.model(),
        experiment: problem.experiment,
        features: features.to_owned(),
        participant,
        cv_accuracy: chosen.cv_accuracy,
        hyperparameters: chosen.hyperparameters,
        test: problem.predictions(&chosen.predictor),
        predictor: PredictorFile::from(&chosen.predictor),
    };
    Ok(problems.iter().zip(chosen?).map(cell).collect())
}

/// The best setting, and the model trained with it on all training rows.
struct Chosen {
    cv_accuracy: f64,
    hyperparameters: String,
    predictor: Predictor,
}

/// Training rows, with labels 0, 1, … for the classes that occur.
struct Rows {
    values: Vec<f64>,
    labels: Vec<usize>,
    /// The classes that occur, in ascending order.
    classes: Vec<i8>,
}

/// One experiment's labels on one participant's rows.
struct Problem<'a> {
    data: &'a Dataset,
    split: &'a Split,
    experiment: Experiment,
    training: Rows,
}

impl<'a> Problem<'a> {
    fn new(data: &'a Dataset, split: &'a Split, experiment: Experiment) -> Self {
        let training = rows(data, experiment, &split.training);
        Self { data, split, experiment, training }
    }

    /// The predictions of `predictor` for the test rows.
    fn predictions(&self, predictor: &Predictor) -> Predictions {
        let classes = predictor.classes();
        let width = self.data.features.len();
        let mut found = Predictions {
            classes: classes.to_vec(),
            truth: Vec::new(),
            predicted: Vec::new(),
            probabilities: Vec::new(),
        };
        let mut p = vec![0.0; classes.len()];
        for &row in &self.split.test {
            let values = &self.data.values[row * width..(row + 1) * width];
            predictor.probabilities_into(values, &mut p);
            found.truth.push(self.experiment.class(self.data.labels[row]));
            found.predicted.push(predictor.class(values));
            found.probabilities.extend_from_slice(&p);
        }
        found
    }

    /// The accuracy of several models on held-out rows, a mean over folds. `models` trains the
    /// models on the other rows of a fold, and `says` returns the index of the class that a model
    /// predicts. If the other rows have only one class, that class is predicted.
    fn validated<M>(
        &self,
        count: usize,
        models: impl Fn(&Rows) -> Result<Vec<M>, Invalid>,
        says: impl Fn(&M, &[f64]) -> usize,
    ) -> Result<Vec<f64>, Invalid> {
        let width = self.data.features.len();
        let mut accuracy = vec![0.0; count];
        let mut folds = 0.0;
        for fold in 0..FOLDS {
            let (learned, held) = self.split.fold(fold);
            if held.is_empty() || learned.is_empty() {
                continue;
            }
            folds += 1.0;
            let of = |places: &[usize]| -> Vec<usize> {
                places.iter().map(|&place| self.split.training[place]).collect()
            };
            let learned = rows(self.data, self.experiment, &of(&learned));
            let held = of(&held);
            let truth = |row: usize| self.experiment.class(self.data.labels[row]);
            let share = |class: &dyn Fn(&[f64]) -> i8| {
                let right = |row: &&usize| {
                    class(&self.data.values[**row * width..(**row + 1) * width]) == truth(**row)
                };
                held.iter().filter(right).count() as f64 / held.len() as f64
            };
            if let [only] = learned.classes[..] {
                let share = share(&|_| only);
                accuracy.iter_mut().for_each(|sum| *sum += share);
                continue;
            }
            for (sum, model) in accuracy.iter_mut().zip(models(&learned)?) {
                *sum += share(&|row| learned.classes[says(&model, row)]);
            }
        }
        Ok(accuracy.into_iter().map(|sum| sum / f64::max(folds, 1.0)).collect())
    }
}

/// The index of the best setting of a grid; on a tie the first.
fn best(accuracy: &[f64]) -> Result<usize, Invalid> {
    highest(accuracy).ok_or_else(|| Invalid::new("grid", "at least one setting", "none"))
}

fn rows(data: &Dataset, experiment: Experiment, rows: &[usize]) -> Rows {
    let width = data.features.len();
    let class = |row: &usize| experiment.class(data.labels[*row]);
    let occurs = |wanted: &&i8| rows.iter().any(|row| class(row) == **wanted);
    let classes: Vec<i8> = experiment.classes().iter().filter(occurs).copied().collect();
    let label = |row| classes.iter().position(|known| *known == class(row)).unwrap_or(0);
    Rows {
        values: rows
            .iter()
            .flat_map(|row| &data.values[row * width..(row + 1) * width])
            .copied()
            .collect(),
        labels: rows.iter().map(label).collect(),
        classes: classes.clone(),
    }
}

impl Problem<'_> {
    fn width(&self) -> usize {
        self.data.features.len()
    }

    fn logistic(&self, strengths: &[f64]) -> Result<Chosen, Invalid> {
        let train = |rows: &Rows, strengths: &[f64]| -> Result<Vec<(Scale, Logistic)>, Invalid> {
            let (scale, values) = Scale::standardised(self.width(), &rows.values);
            let samples = Samples::new(self.width(), &values, &rows.labels, rows.classes.len())?;
            let models = fit_path(&samples, strengths, LogisticSettings::default())?;
            Ok(models.into_iter().map(|model| (scale.clone(), model)).collect())
        };
        let says = |(scale, model): &(Scale, Logistic), row: &[f64]| {
            let mut p = vec![0.0; model.intercepts().len()];
            model.probabilities_into(scale, row, &mut p);
            highest(&p).unwrap_or(0)
        };
        let accuracy = self.validated(strengths.len(), |rows| train(rows, strengths), says)?;
        let best = best(&accuracy)?;
        let c = strengths[best];
        let mut models = train(&self.training, &[c])?;
        let (scale, model) = models.remove(0);
        let features = self.data.features.clone();
        Ok(Chosen {
            cv_accuracy: accuracy[best],
            hyperparameters: json!({ "C": c }).to_string(),
            predictor: Predictor::logistic(features, self.training.classes.clone(), scale, model),
        })
    }

    fn tree(&self, grids: &Grids) -> Result<Chosen, Invalid> {
        // Depth by depth, and within a depth by leaf size; one tree per leaf size serves all
        // depths.
        let grow = |rows: &Rows, depth, leaves: &[usize]| -> Result<Vec<Tree>, Invalid> {
            let (scale, values) = Scale::standardised(self.width(), &rows.values);
            let samples = Samples::new(self.width(), &values, &rows.labels, rows.classes.len())?;
            let grown = tree::grow_each(&samples, depth, leaves)?;
            Ok(grown.iter().map(|tree| tree.unscaled(&scale)).collect())
        };
        let settings: Vec<(Option<usize>, usize)> = (grids.tree_depth.iter())
            .flat_map(|&depth| (0..grids.tree_leaf.len()).map(move |leaf| (depth, leaf)))
            .collect();
        let models = |rows: &Rows| -> Result<Vec<Tree>, Invalid> {
            let grown = grow(rows, None, &grids.tree_leaf)?;
            let cut = |tree: &Tree, depth: Option<usize>| match depth {
                Some(depth) => tree.truncated(depth),
                None => tree.clone(),
            };
            Ok(settings.iter().map(|&(depth, leaf)| cut(&grown[leaf], depth)).collect())
        };
        let accuracy = self.validated(settings.len(), models, |tree, row| tree.class(row))?;
        let best = best(&accuracy)?;
        let (depth, leaf) = (settings[best].0, grids.tree_leaf[settings[best].1]);
        let tree = grow(&self.training, depth, &[leaf])?.remove(0);
        let (features, classes) = (self.data.features.clone(), self.training.classes.clone());
        Ok(Chosen {
            cv_accuracy: accuracy[best],
            hyperparameters: json!({ "max_depth": depth, "min_samples_leaf": leaf }).to_string(),
            predictor: Predictor::tree(features, classes, tree),
        })
    }

    fn boosted(&self, depths: &[usize]) -> Result<Chosen, Invalid> {
        let (scale, values) = Scale::standardised(self.width(), &self.training.values);
        let Rows { labels, classes, .. } = &self.training;
        let samples = Samples::new(self.width(), &values, labels, classes.len())?;
        let settings = BoostingSettings::default();
        let (model, chosen) =
            boosting::fit_by_folds(&samples, &self.split.folds, depths, &settings)?;
        // Depth and rounds are chosen by log loss; the table needs their accuracy.
        let settings = BoostingSettings { depth: chosen.depth, rounds: chosen.rounds, ..settings };
        let again = |rows: &Rows| -> Result<Vec<(Scale, usize, Boosted)>, Invalid> {
            let (scale, values) = Scale::standardised(self.width(), &rows.values);
            let samples = Samples::new(self.width(), &values, &rows.labels, rows.classes.len())?;
            Ok(vec![(scale, rows.classes.len(), boosting::fit(&samples, &settings)?)])
        };
        let says = |(scale, classes, model): &(Scale, usize, Boosted), row: &[f64]| {
            let mut p = vec![0.0; *classes];
            model.probabilities_into(&scale.row(row), &mut p);
            highest(&p).unwrap_or(0)
        };
        let accuracy = self.validated(1, again, says)?;
        let features = self.data.features.clone();
        Ok(Chosen {
            cv_accuracy: accuracy[0],
            hyperparameters: json!({ "max_depth": chosen.depth, "rounds": chosen.rounds })
                .to_string(),
            predictor: Predictor::boosted(features, classes.clone(), model.unscaled(&scale)),
        })
    }
}

/// SVMs of both experiments, which share their kernels.
fn svms(
    data: &Dataset,
    split: &Split,
    problems: &[Problem<'_>],
    kernels: Kernels,
    strengths: &[f64],
) -> Result<Vec<Chosen>, Invalid> {
    let width = data.features.len();
    let grid = Grid { c: strengths.to_vec(), ..Grid::new(kernels) };
    let tasks: Vec<Target<'_>> = problems
        .iter()
        .map(|problem| Target {
            labels: &problem.training.labels,
            classes: problem.training.classes.len(),
        })
        .collect();
    let values = &problems[0].training.values;
    let cells = svm::cross_validate(width, values, &split.folds, &tasks, &grid)?;
    let chosen = |((problem, task), cells): ((&Problem<'_>, &Target<'_>), &Vec<svm::GridCell>)| {
        let best = svm::best(cells).ok_or_else(|| Invalid::new("grid", "at least one", "none"))?;
        let sigmoids = svm::calibrate(*task, &best.decisions)?;
        let settings = SvmSettings::new(best.kernel, best.c);
        let (scale, model) = svm::fit(width, values, *task, settings, sigmoids)?;
        let hyperparameters = match best.kernel {
            Kernel::Linear => json!({ "C": best.c }),
            Kernel::Rbf { gamma } => json!({ "C": best.c, "gamma": gamma }),
        };
        let (features, classes) = (data.features.clone(), problem.training.classes.clone());
        Ok(Chosen {
            cv_accuracy: best.mean_accuracy(),
            hyperparameters: hyperparameters.to_string(),
            predictor: Predictor::svm(features, classes, scale, model),
        })
    };
    problems.iter().zip(&tasks).zip(&cells).map(chosen).collect()
}
