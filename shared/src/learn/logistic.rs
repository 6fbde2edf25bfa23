//! Logistic regression with an L2 penalty, trained by Newton's method.
//!
//! It minimises C · Σ over rows of −log P(class) + ½ · Σ over weights of w². Intercepts are not
//! penalised. This is the objective of scikit-learn's `LogisticRegression`. As in scikit-learn, two
//! classes have **one** weight vector, for the log-odds log P(second) − log P(first). (With two
//! vectors, the penalty would be half as large.) If there are three or more classes, each class has
//! a weight vector, and the penalty makes these vectors sum to zero. In this case, only differences
//! of intercepts matter, so the intercepts are made to sum to zero, too.
//!
//! The order of the rows changes the result only by rounding errors (less than 10⁻¹² on
//! standardised data).

mod objective;

use super::samples::Samples;
use crate::invalid::{Invalid, positive};
use crate::math::ln;
use crate::predict::logistic::Logistic;
use nalgebra::DVector;
use objective::{Objective, Point};

/// The stopping rule of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct LogisticSettings {
    /// The fit ends with the first Newton step whose squared decrement, gᵀ H⁻¹ g, is at most
    /// tolerance · (1 + C). Since H ⪰ 1 for the weights, the length of this step is at most
    /// √(tolerance · (1 + C)). The square of this bound, times the typical length of a row, bounds
    /// the remaining error.
    pub tolerance: f64,
    /// Maximum number of Newton steps for each C. The problem is strictly convex, and about ten
    /// steps suffice.
    pub max_steps: usize,
}

impl Default for LogisticSettings {
    fn default() -> Self {
        Self { tolerance: 1e-13, max_steps: 100 }
    }
}

impl LogisticSettings {
    /// Sets [`Self::tolerance`], the limit of the squared Newton decrement divided by 1 + C.
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance, ..self }
    }

    /// Sets [`Self::max_steps`], the maximum number of Newton steps for each C.
    #[must_use]
    pub fn with_max_steps(self, max_steps: usize) -> Self {
        Self { max_steps, ..self }
    }
}

/// Trains on standardised rows with inverse regularisation strength `c` > 0.
///
/// # Errors
/// [`Invalid`] if `c` is not positive, there are fewer than two classes, a class does not occur, or
/// the fit does not converge.
pub fn fit(samples: &Samples<'_>, c: f64, settings: LogisticSettings) -> Result<Logistic, Invalid> {
    let mut models = fit_path(samples, &[c], settings)?;
    models.pop().ok_or_else(|| Invalid::new("c", "at least one", "none"))
}

/// Trains one model for each inverse regularisation strength in `strengths`, in the given order.
/// Each fit starts from an extrapolation of the previous solution. If the strengths are sorted,
/// this saves about half of the work.
///
/// # Errors
/// The errors of [`fit`].
pub fn fit_path(
    samples: &Samples<'_>,
    strengths: &[f64],
    settings: LogisticSettings,
) -> Result<Vec<Logistic>, Invalid> {
    if samples.classes() < 2 {
        return Err(Invalid::new("classes", "at least 2", samples.classes()));
    }
    let counts = samples.counts();
    if let Some(absent) = counts.iter().position(|&count| count == 0) {
        let expected = format!("each of {} classes", samples.classes());
        return Err(Invalid::new("labels", expected, format!("no {absent}")));
    }
    let mut objective = Objective::new(samples);
    let mut theta = objective.intercepts_only(&counts);
    let mut before: Option<(f64, Point)> = None;
    let mut models = Vec::with_capacity(strengths.len());
    for &c in strengths {
        positive("c", c)?;
        if let Some((c_before, point)) = &before {
            theta = objective.carried_over(&theta, point, c / c_before).unwrap_or(theta);
        }
        let (found, last) = minimise(&mut objective, theta, c, settings)?;
        models.push(model(&objective, &found)?);
        theta = found;
        before = Some((c, last));
    }
    Ok(models)
}

/// Returns the minimum, and the loss, gradient and Hessian at the last iterate before the minimum.
fn minimise(
    objective: &mut Objective<'_>,
    mut theta: DVector<f64>,
    c: f64,
    settings: LogisticSettings,
) -> Result<(DVector<f64>, Point), Invalid> {
    let mut point = objective.at(&theta, c);
    for _ in 0..settings.max_steps {
        let factors =
            point.hessian.clone().cholesky().ok_or_else(|| {
                Invalid::new("rows", "a positive definite problem", "a singular one")
            })?;
        let step = factors.solve(&point.gradient);
        let decrement = point.gradient.dot(&step);
        if decrement <= settings.tolerance * (1.0 + c) {
            return Ok((theta - step, point));
        }
        // Near the solution, full steps converge. Farther away, steps are halved if necessary. The
        // slack is needed because near the solution, the decrease of the loss is below its rounding
        // error.
        let slack = 1e-12 * point.loss;
        let mut share = 1.0;
        loop {
            let next = &theta - &step * share;
            let there = objective.at(&next, c);
            if there.loss <= point.loss - 1e-4 * share * decrement + slack || share < 1e-10 {
                (theta, point) = (next, there);
                break;
            }
            share *= 0.5;
        }
    }
    let found = format!("loss {} after {} steps", point.loss, settings.max_steps);
    Err(Invalid::new("rows", "a problem that converges", found))
}

/// A row of weights and an intercept for each class. With two classes, the first class's weights
/// and intercept are zero.
fn model(objective: &Objective<'_>, theta: &DVector<f64>) -> Result<Logistic, Invalid> {
    let width = objective.width();
    let mut blocks: Vec<Vec<f64>> =
        theta.as_slice().chunks_exact(width + 1).map(<[f64]>::to_vec).collect();
    if objective.classes() == 2 {
        blocks.insert(0, vec![0.0; width + 1]);
    } else {
        let negated = |j| -blocks.iter().map(|block| block[j]).sum::<f64>();
        let last = (0..=width).map(negated).collect();
        blocks.push(last);
    }
    let intercepts = blocks.iter().map(|block| block[width]).collect();
    for block in &mut blocks {
        block.truncate(width);
    }
    Logistic::new(width, &blocks, intercepts)
}

impl Objective<'_> {
    /// The optimum if no feature is informative: zero weights, and intercepts from `counts`.
    fn intercepts_only(&self, counts: &[usize]) -> DVector<f64> {
        let logs: Vec<f64> = counts.iter().map(|&count| ln(count as f64)).collect();
        let mut theta = DVector::zeros(self.unknowns());
        let stride = self.width() + 1;
        if self.classes() == 2 {
            theta[stride - 1] = logs[1] - logs[0];
        } else {
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            for (block, log) in logs[..logs.len() - 1].iter().enumerate() {
                theta[block * stride + stride - 1] = log - mean;
            }
        }
        theta
    }
}
