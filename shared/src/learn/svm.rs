//! Support vector machines with soft margins (C-SVC), one for each pair of classes, with
//! calibrated probabilities.
//!
//! The optimum is the same as in libsvm and scikit-learn's `SVC`. The SVM of a pair minimises
//! ½|w|² + C Σ max(0, 1 − y_i f(x_i)), where f(x) = w·φ(x) + b. Before any computation, rows are
//! sorted by label and features. The result is therefore bit-identical for every order of the
//! caller's rows.

mod rows;
mod gram;
mod dense;
mod newton;
mod pairwise;
mod smo;
mod linear;
mod platt;
mod grid;

use crate::invalid::{Invalid, length, positive};
use crate::predict::scale::Scale;
use crate::predict::svm::{Kernel, Sigmoid, Svm, pair_count, pairs};
use dense::Dense;
use gram::Gram;
pub use grid::{Grid, GridCell, Kernels, best, cross_validate};
pub use rows::Target;
use rows::{check, order, sides, standardised};
use smo::Smo;

/// Hyper-parameters and stopping rule of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SvmSettings {
    /// The kernel: linear or radial basis functions.
    pub kernel: Kernel,
    /// The cost of a unit of margin violation, C > 0.
    pub c: f64,
    /// The fit ends when the optimality conditions hold to this tolerance (radial basis functions
    /// only).
    pub tolerance: f64,
    /// Maximum number of pairwise steps (radial basis functions only).
    pub max_steps: usize,
}

impl SvmSettings {
    /// Settings with the default stopping rule: tolerance 10⁻⁶, at most ten million steps.
    #[must_use]
    pub fn new(kernel: Kernel, c: f64) -> Self {
        Self { kernel, c, tolerance: 1e-6, max_steps: 10_000_000 }
    }

    /// Sets [`Self::kernel`], the kernel.
    #[must_use]
    pub fn with_kernel(self, kernel: Kernel) -> Self {
        Self { kernel, ..self }
    }

    /// Sets [`Self::c`], the cost of a unit of margin violation.
    #[must_use]
    pub fn with_c(self, c: f64) -> Self {
        Self { c, ..self }
    }

    /// Sets [`Self::tolerance`], the tolerance of the optimality conditions.
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// Sets [`Self::max_steps`], the maximum number of pairwise steps.
    #[must_use]
    pub fn with_max_steps(self, max_steps: usize) -> Self {
        Self { max_steps, ..self }
    }
}

/// Fits the sigmoid of each pair to held-out decision values (rows × pairs, row-major).
///
/// # Errors
/// [`Invalid`] if `decisions` does not contain one value for each row and pair.
pub fn calibrate(target: Target<'_>, decisions: &[f64]) -> Result<Vec<Sigmoid>, Invalid> {
    let count = pair_count(target.classes);
    length("decisions", target.labels.len() * count, decisions.len())?;
    let of_pair = |(pair, (first, second)): (usize, (usize, usize))| {
        let rows = target.labels.iter().zip(decisions.chunks(count.max(1)));
        let mut mine: Vec<(f64, bool)> = rows
            .filter(|&(&label, _)| label == first || label == second)
            .map(|(&label, decisions)| (decisions[pair], label == first))
            .collect();
        mine.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        platt::sigmoid(&mine)
    };
    Ok(pairs(target.classes).enumerate().map(of_pair).collect())
}

/// Standardises `rows` (row-major, `width` raw features) and trains on the result. `sigmoids`
/// contains the sigmoid of each pair of classes.
///
/// # Errors
/// [`Invalid`] if lengths do not match, a number is not finite, C, γ or the tolerance is not
/// positive, a class does not occur, or the fit does not converge.
pub fn fit(
    width: usize,
    rows: &[f64],
    target: Target<'_>,
    settings: SvmSettings,
    sigmoids: Vec<Sigmoid>,
) -> Result<(Scale, Svm), Invalid> {
    check(width, rows, &[target])?;
    positive("c", settings.c)?;
    positive("tolerance", settings.tolerance)?;
    for class in 0..target.classes {
        if !target.labels.contains(&class) {
            let expected = format!("each of {} classes", target.classes);
            return Err(Invalid::new("labels", expected, format!("no {class}")));
        }
    }
    let order = order(width, rows, &[target]);
    let labels: Vec<usize> = order.iter().map(|&i| target.labels[i]).collect();
    let (scale, rows) = standardised(width, rows, &order, &order);
    match settings.kernel {
        Kernel::Linear => {
            let planes = pairs(target.classes).map(|(first, second)| {
                linear::fit(width, &rows, &sides(&labels, first, second), settings.c)
            });
            let planes = planes.collect::<Result<Vec<_>, _>>()?;
            let intercepts = planes.iter().map(|plane| plane.intercept).collect();
            let weights: Vec<_> = planes.into_iter().map(|plane| plane.weights).collect();
            let svm = Svm::linear(width, target.classes, &weights, intercepts, sigmoids)?;
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
            for (first, second) in pairs(target.classes) {
                let sides = sides(&labels, first, second);
                let mut smo = Smo::new(&mut gram, &sides, settings.c, None, &mut dense);
                let solution = smo.solve(settings.c, settings.tolerance, settings.max_steps)?;
                intercepts.push(solution.intercept);
                dual.push(gram::entries(&solution.beta).copied().collect::<Vec<f64>>());
            }
            let supports = |&i: &usize| dual.iter().any(|dual| dual[i] != 0.0);
            let support: Vec<usize> = (0..labels.len()).filter(supports).collect();
            let vector = |&i: &usize| rows[i * width..(i + 1) * width].to_vec();
            let vectors: Vec<_> = support.iter().map(vector).collect();
            let kept = |dual: &Vec<f64>| support.iter().map(|&i| dual[i]).collect();
            let dual: Vec<Vec<f64>> = dual.iter().map(kept).collect();
            let svm =
                Svm::rbf(width, target.classes, gamma, &vectors, &dual, intercepts, sigmoids)?;
            Ok((scale, svm))
        }
    }
}

#[cfg(test)]
mod tests;
