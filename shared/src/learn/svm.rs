//! Support vector machines with soft margins (C-SVC), one for each pair of classes, with
//! calibrated probabilities.
//!
//! The optimum is that of libsvm and scikit-learn's `SVC`. A pair's machine minimises
//! ½|w|² + C Σ max(0, 1 − y_i f(x_i)) over f(x) = w·φ(x) + b. Rows are put in an order of
//! their own (by label and features) before anything is computed, so that the caller's order
//! changes no bit.

mod gram;
mod grid;
mod linear;
mod newton;
mod pairwise;
mod platt;
mod smo;

use crate::invalid::{Invalid, finite, length, positive};
use crate::predict::scale::Scale;
use crate::predict::svm::{Kernel, Sigmoid, Svm, pair_count, pairs};
use gram::Gram;
pub use grid::{Cell, Grid, Kernels, best, cross_validate};
use pairwise::Dense;
use smo::Smo;

/// Hyper-parameters and stopping rule of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SvmSettings {
    /// Linear or radial basis functions.
    pub kernel: Kernel,
    /// What a unit of margin violation costs, C > 0.
    pub c: f64,
    /// Stop where the conditions of the optimum hold to this (radial basis functions).
    pub tolerance: f64,
    /// Pairwise steps at the most (radial basis functions).
    pub max_steps: usize,
}

impl SvmSettings {
    /// The usual stopping rule: 10⁻⁶, ten million steps.
    #[must_use]
    pub fn new(kernel: Kernel, c: f64) -> Self {
        Self { kernel, c, tolerance: 1e-6, max_steps: 10_000_000 }
    }
}

/// Labels that rows are told apart by.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// One a row, 0 … `classes` − 1.
    pub labels: &'a [usize],
    /// How many there are, at least 2.
    pub classes: usize,
}

/// The sigmoid of each pair, from held-out decision values (rows × pairs, row-major).
///
/// # Errors
/// [`Invalid`] if there is not one value a row and pair.
pub fn calibrate(task: Task<'_>, decisions: &[f64]) -> Result<Vec<Sigmoid>, Invalid> {
    let count = pair_count(task.classes);
    length("decisions", task.labels.len() * count, decisions.len())?;
    let of_pair = |(pair, (first, second)): (usize, (usize, usize))| {
        let rows = task.labels.iter().zip(decisions.chunks(count.max(1)));
        let mut mine: Vec<(f64, bool)> = rows
            .filter(|&(&label, _)| label == first || label == second)
            .map(|(&label, decisions)| (decisions[pair], label == first))
            .collect();
        mine.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        platt::sigmoid(&mine)
    };
    Ok(pairs(task.classes).enumerate().map(of_pair).collect())
}

/// Trains on `rows` (row-major, `width` raw features), which it standardises, with a sigmoid
/// for each pair of classes.
///
/// # Errors
/// [`Invalid`] if lengths do not fit, a number is not finite, C, γ or the tolerance not > 0,
/// a class does not occur, or the fit does not converge.
pub fn fit(
    width: usize,
    rows: &[f64],
    task: Task<'_>,
    settings: SvmSettings,
    sigmoids: Vec<Sigmoid>,
) -> Result<(Scale, Svm), Invalid> {
    check(width, rows, &[task])?;
    positive("c", settings.c)?;
    positive("tolerance", settings.tolerance)?;
    for class in 0..task.classes {
        if !task.labels.contains(&class) {
            let expected = format!("each of {} classes", task.classes);
            return Err(Invalid::new("labels", expected, format!("no {class}")));
        }
    }
    let order = order(width, rows, &[task]);
    let labels: Vec<usize> = order.iter().map(|&i| task.labels[i]).collect();
    let (scale, rows) = standardised(width, rows, &order, &order);
    match settings.kernel {
        Kernel::Linear => {
            let planes = pairs(task.classes).map(|(first, second)| {
                linear::fit(width, &rows, &sides(&labels, first, second), settings.c)
            });
            let planes = planes.collect::<Result<Vec<_>, _>>()?;
            let intercepts = planes.iter().map(|plane| plane.intercept).collect();
            let weights: Vec<_> = planes.into_iter().map(|plane| plane.weights).collect();
            let svm = Svm::linear(width, task.classes, &weights, intercepts, sigmoids)?;
            Ok((scale, svm))
        }
        Kernel::Rbf { gamma } => {
            positive("gamma", gamma)?;
            let mut gram = Gram::<f64>::empty(false);
            gram.set_data(width, &rows, labels.len());
            gram.set_gamma(gamma);
            let mut dense = Dense::new();
            let mut dual = Vec::new();
            let mut intercepts = Vec::new();
            for (first, second) in pairs(task.classes) {
                let sides = sides(&labels, first, second);
                let mut smo = Smo::new(&mut gram, &sides, settings.c, None, &mut dense);
                let machine = smo.solve(settings.c, settings.tolerance, settings.max_steps)?;
                intercepts.push(machine.intercept);
                dual.push(gram::entries(&machine.beta).copied().collect::<Vec<f64>>());
            }
            let supports = |&i: &usize| dual.iter().any(|dual| dual[i] != 0.0);
            let support: Vec<usize> = (0..labels.len()).filter(supports).collect();
            let vector = |&i: &usize| rows[i * width..(i + 1) * width].to_vec();
            let vectors: Vec<_> = support.iter().map(vector).collect();
            let kept = |dual: &Vec<f64>| support.iter().map(|&i| dual[i]).collect();
            let dual: Vec<Vec<f64>> = dual.iter().map(kept).collect();
            let svm = Svm::rbf(width, task.classes, gamma, &vectors, &dual, intercepts, sigmoids)?;
            Ok((scale, svm))
        }
    }
}

/// Trains as [`fit`] does, with sigmoids from held-out rows: each fold of `folds` (a number a
/// row; rows of one trajectory share it) is decided by machines of the others.
///
/// # Errors
/// As [`fit`], and if there are fewer than two folds.
pub fn fit_calibrated(
    width: usize,
    rows: &[f64],
    task: Task<'_>,
    folds: &[usize],
    settings: SvmSettings,
) -> Result<(Scale, Svm), Invalid> {
    let kernels = match settings.kernel {
        Kernel::Linear => Kernels::Linear,
        Kernel::Rbf { gamma } => Kernels::Rbf(vec![gamma]),
    };
    let grid = Grid { c: vec![settings.c], max_steps: settings.max_steps, ..Grid::new(kernels) };
    let cells = cross_validate(width, rows, folds, &[task], &grid)?;
    let decisions = cells.first().and_then(|cells| cells.first()).map(|cell| &cell.decisions[..]);
    let sigmoids = calibrate(task, decisions.unwrap_or_default())?;
    fit(width, rows, task, settings, sigmoids)
}

/// 1 for rows of the first class, −1 for the second, 0 for others.
fn sides(labels: &[usize], first: usize, second: usize) -> Vec<i8> {
    let side = |&label: &usize| i8::from(label == first) - i8::from(label == second);
    labels.iter().map(side).collect()
}

/// Lengths, labels and numbers.
fn check(width: usize, rows: &[f64], tasks: &[Task<'_>]) -> Result<(), Invalid> {
    for task in tasks {
        length("rows", width * task.labels.len(), rows.len())?;
        if task.classes < 2 {
            return Err(Invalid::new("classes", "at least 2", task.classes));
        }
        for (i, &label) in task.labels.iter().enumerate() {
            if label >= task.classes {
                let expected = format!("a label below {}", task.classes);
                return Err(Invalid::new(format!("labels[{i}]"), expected, label));
            }
        }
    }
    for (i, &value) in rows.iter().enumerate() {
        finite(&format!("rows[{}][{}]", i / width, i % width), value)?;
    }
    Ok(())
}

/// The order in which rows are computed with: by labels, then by features. Rows that are
/// equal in all of it may change places without any effect.
fn order(width: usize, rows: &[f64], tasks: &[Task<'_>]) -> Vec<usize> {
    let row = |i: usize| &rows[i * width..(i + 1) * width];
    let mut order: Vec<usize> = (0..rows.len() / width.max(1)).collect();
    order.sort_by(|&a, &b| {
        let labels = |i: usize| tasks.iter().map(move |task| task.labels[i]);
        let features = || {
            let pairs = row(a).iter().zip(row(b)).map(|(a, b)| a.total_cmp(b));
            pairs.fold(core::cmp::Ordering::Equal, core::cmp::Ordering::then)
        };
        labels(a).cmp(labels(b)).then_with(features)
    });
    order
}

/// The scale of the rows `fitted`, and the rows `wanted` on it.
fn standardised(
    width: usize,
    rows: &[f64],
    fitted: &[usize],
    wanted: &[usize],
) -> (Scale, Vec<f64>) {
    let row = |&i: &usize| rows[i * width..(i + 1) * width].iter().copied().enumerate();
    let raw: Vec<f64> = fitted.iter().flat_map(row).map(|(_, x)| x).collect();
    let scale = Scale::fit(width, &raw);
    let rows = wanted.iter().flat_map(row).map(|(j, x)| scale.apply(j, x)).collect();
    (scale, rows)
}

#[cfg(test)]
mod tests;
