//! Support vector machines.

use super::{Chosen, Problem, Training};
use crate::comparison::models::Grids;
use crate::invalid::Invalid;
use crate::learn::svm::{self, Grid, Kernels, SvmSettings, Target};
use crate::math::pow;
use crate::predict::Predictor;
use crate::predict::svm::Kernel;
use serde_json::{Value, json};

pub(super) struct Rbf;

impl Training for Rbf {
    fn grid(&self, grids: &Grids) -> Value {
        json!([grids.rbf_c, grids.rbf_gamma])
    }

    fn strengths<'a>(&self, grids: &'a Grids) -> Option<&'a [f64]> {
        Some(&grids.rbf_c)
    }

    fn fit(&self, problems: &[Problem<'_>], grids: &Grids) -> Result<Vec<Chosen>, Invalid> {
        svms(problems, Kernels::Rbf(grids.rbf_gamma.clone()), &grids.rbf_c)
    }

    fn cost_s(&self, grids: &Grids, thousands: f64) -> f64 {
        // The larger γ is, the more rows become support vectors.
        let slower = |gamma: &f64| pow(gamma / 0.3, 0.57).clamp(1.0, 7.5);
        let gammas: f64 = grids.rbf_gamma.iter().map(slower).sum();
        (0.014 + 0.0016 * grids.rbf_c.len() as f64) * gammas * pow(thousands, 2.1)
    }
}

pub(super) struct Linear;

impl Training for Linear {
    fn grid(&self, grids: &Grids) -> Value {
        json!(grids.linear_c)
    }

    fn strengths<'a>(&self, grids: &'a Grids) -> Option<&'a [f64]> {
        Some(&grids.linear_c)
    }

    fn fit(&self, problems: &[Problem<'_>], grids: &Grids) -> Result<Vec<Chosen>, Invalid> {
        svms(problems, Kernels::Linear, &grids.linear_c)
    }

    fn cost_s(&self, grids: &Grids, thousands: f64) -> f64 {
        0.0037 * grids.linear_c.len() as f64 * thousands
    }
}

/// Trains the SVMs of both experiments, which share their kernel matrices.
fn svms(
    problems: &[Problem<'_>],
    kernels: Kernels,
    strengths: &[f64],
) -> Result<Vec<Chosen>, Invalid> {
    let Some(Problem { data, split, .. }) = problems.first() else { return Ok(Vec::new()) };
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
