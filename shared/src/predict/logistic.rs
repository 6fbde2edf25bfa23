//! Multinomial logistic regression with an L2 penalty, trained by Newton's method.
//!
//! Minimises C · Σ over rows of −log P(label) + ½ · Σ over weights of w²,
//! intercepts unpenalised: the objective of scikit-learn's `LogisticRegression`.

use super::scale::Scale;
use crate::invalid::{Invalid, finite, length, positive};
use crate::math::{exp, ln};
use nalgebra::{DMatrix, DVector};

/// A row of weights and an intercept for each class.
#[derive(Clone, Debug, PartialEq)]
pub struct Logistic {
    width: usize,
    /// Row-major: classes × (weights …, intercept).
    weights: Vec<f64>,
    intercepts: Vec<f64>,
}

/// Hyper-parameter and stopping rule of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogisticSettings {
    /// Inverse strength of the penalty, C > 0.
    pub c: f64,
    /// Stop where no component of the gradient, divided by C times the number of
    /// rows, exceeds this.
    pub tolerance: f64,
    /// Newton steps at the most. The problem is strictly convex: about ten do.
    pub max_steps: usize,
}

impl Default for LogisticSettings {
    fn default() -> Self {
        Self { c: 1.0, tolerance: 1e-12, max_steps: 100 }
    }
}

impl Logistic {
    /// A model from its numbers: one row of `width` weights and one intercept a class.
    ///
    /// # Errors
    /// [`Invalid`] if a length is wrong or a number is not finite.
    pub fn new(
        width: usize,
        coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
    ) -> Result<Self, Invalid> {
        length("intercepts", coefficients.len(), intercepts.len())?;
        let mut weights = Vec::with_capacity(coefficients.len() * width);
        for (class, row) in coefficients.iter().enumerate() {
            length(&format!("coefficients[{class}]"), width, row.len())?;
            for (j, &weight) in row.iter().enumerate() {
                weights.push(finite(&format!("coefficients[{class}][{j}]"), weight)?);
            }
            finite(&format!("intercepts[{class}]"), intercepts[class])?;
        }
        Ok(Self { width, weights, intercepts })
    }

    /// Trains on `rows` (row-major, `width` columns, standardised) with labels
    /// 0 … `classes` − 1.
    ///
    /// # Errors
    /// [`Invalid`] if lengths do not fit, fewer than two classes occur, a number
    /// is not finite or the fit does not converge.
    pub fn fit(
        width: usize,
        rows: &[f64],
        labels: &[usize],
        classes: usize,
        settings: LogisticSettings,
    ) -> Result<Self, Invalid> {
        positive("c", settings.c)?;
        length("rows", width * labels.len(), rows.len())?;
        for (i, &value) in rows.iter().enumerate() {
            finite(&format!("rows[{}][{}]", i / width, i % width), value)?;
        }
        for class in 0..classes {
            if !labels.contains(&class) {
                return Err(Invalid::new(
                    "labels",
                    format!("each of {classes} classes"),
                    format!("no {class}"),
                ));
            }
        }
        if classes < 2 {
            return Err(Invalid::new("classes", "at least 2", classes));
        }
        let problem = Problem { width, rows, labels, classes, c: settings.c };
        let mut theta = DVector::zeros(classes * (width + 1));
        let (mut loss, mut gradient, mut hessian) = problem.second_order(&theta);
        let scale = settings.c * labels.len() as f64;
        for _ in 0..settings.max_steps {
            if gradient.amax() <= settings.tolerance * scale {
                return Ok(problem.model(&theta));
            }
            let step = hessian
                .cholesky()
                .ok_or_else(|| {
                    Invalid::new("rows", "a positive definite problem", "a singular one")
                })?
                .solve(&gradient);
            // Full steps converge near the solution; halving guards the way there.
            // Near it the decrease drowns in the rounding of the loss, which the
            // slack lets pass.
            let slope = gradient.dot(&step);
            let slack = 1e-12 * loss;
            let mut share = 1.0;
            let mut next = &theta - &step;
            while share > 1e-10 && problem.loss(&next) > loss - 1e-4 * share * slope + slack {
                share *= 0.5;
                next = &theta - &step * share;
            }
            theta = next;
            (loss, gradient, hessian) = problem.second_order(&theta);
        }
        let found =
            format!("gradient {:e} after {} steps", gradient.amax() / scale, settings.max_steps);
        Err(Invalid::new("rows", "a problem that converges", found))
    }

    /// One row of weights a class.
    #[must_use]
    pub fn coefficients(&self) -> Vec<Vec<f64>> {
        self.weights.chunks_exact(self.width).map(<[f64]>::to_vec).collect()
    }

    /// One offset a class.
    #[must_use]
    pub fn intercepts(&self) -> &[f64] {
        &self.intercepts
    }

    /// Writes the probability of each class to `out`, given a row of raw features.
    pub fn probabilities_into(&self, scale: &Scale, row: &[f64], out: &mut [f64]) {
        let weights = self.weights.chunks_exact(self.width);
        for ((weights, &intercept), score) in weights.zip(&self.intercepts).zip(out.iter_mut()) {
            let terms = weights.iter().zip(row).enumerate();
            *score = terms.fold(intercept, |sum, (j, (w, &value))| sum + w * scale.apply(j, value));
        }
        softmax(out);
    }
}

/// Scores to probabilities.
fn softmax(scores: &mut [f64]) -> f64 {
    let top = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut total = 0.0;
    for score in scores.iter_mut() {
        *score = exp(*score - top);
        total += *score;
    }
    for score in scores.iter_mut() {
        *score /= total;
    }
    top + ln(total)
}

struct Problem<'a> {
    width: usize,
    rows: &'a [f64],
    labels: &'a [usize],
    classes: usize,
    c: f64,
}

impl Problem<'_> {
    /// Score of each class for a row; returns nothing, fills `out`.
    fn scores(&self, theta: &DVector<f64>, row: &[f64], out: &mut [f64]) {
        let stride = self.width + 1;
        for (class, score) in out.iter_mut().enumerate() {
            let weights = &theta.as_slice()[class * stride..(class + 1) * stride];
            *score = row.iter().zip(weights).fold(weights[self.width], |sum, (x, w)| sum + x * w);
        }
    }

    fn penalty(&self, theta: &DVector<f64>) -> f64 {
        let blocks = theta.as_slice().chunks_exact(self.width + 1);
        0.5 * blocks.flat_map(|block| &block[..self.width]).map(|w| w * w).sum::<f64>()
    }

    fn loss(&self, theta: &DVector<f64>) -> f64 {
        let mut p = vec![0.0; self.classes];
        let mut loss = 0.0;
        for (row, &label) in self.rows.chunks_exact(self.width).zip(self.labels) {
            self.scores(theta, row, &mut p);
            let score = p[label];
            loss += softmax(&mut p) - score;
        }
        self.c * loss + self.penalty(theta)
    }

    /// Loss, gradient and Hessian.
    ///
    /// Adding one number to every intercept changes nothing, so the Hessian is
    /// singular in that direction; a rank-one term there makes it definite and,
    /// since the gradient has no part in that direction, leaves the step as the
    /// one that keeps the intercepts' sum at zero.
    fn second_order(&self, theta: &DVector<f64>) -> (f64, DVector<f64>, DMatrix<f64>) {
        let (k, stride) = (self.classes, self.width + 1);
        let mut gradient = DVector::zeros(k * stride);
        let mut hessian = DMatrix::zeros(k * stride, k * stride);
        let mut loss = 0.0;
        let mut p = vec![0.0; k];
        let mut x = vec![1.0; stride];
        for (row, &label) in self.rows.chunks_exact(self.width).zip(self.labels) {
            self.scores(theta, row, &mut p);
            let score = p[label];
            loss += softmax(&mut p) - score;
            x[..self.width].copy_from_slice(row);
            for a in 0..k {
                let residual = self.c * (p[a] - f64::from(u8::from(a == label)));
                for (i, &xi) in x.iter().enumerate() {
                    gradient[a * stride + i] += residual * xi;
                }
                for b in 0..=a {
                    let curvature = self.c * p[a] * (f64::from(u8::from(a == b)) - p[b]);
                    for (i, &xi) in x.iter().enumerate() {
                        let factor = curvature * xi;
                        // Lower triangle only: Cholesky reads no other.
                        let last = if a == b { i + 1 } else { stride };
                        for (j, &xj) in x[..last].iter().enumerate() {
                            hessian[(a * stride + i, b * stride + j)] += factor * xj;
                        }
                    }
                }
            }
        }
        for a in 0..k {
            for i in 0..self.width {
                gradient[a * stride + i] += theta[a * stride + i];
                hessian[(a * stride + i, a * stride + i)] += 1.0;
            }
            for b in 0..=a {
                hessian[(a * stride + self.width, b * stride + self.width)] += 1.0;
            }
        }
        (self.c * loss + self.penalty(theta), gradient, hessian)
    }

    fn model(&self, theta: &DVector<f64>) -> Logistic {
        let blocks = || theta.as_slice().chunks_exact(self.width + 1);
        Logistic {
            width: self.width,
            weights: blocks().flat_map(|block| &block[..self.width]).copied().collect(),
            intercepts: blocks().map(|block| block[self.width]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    fn data(n: usize, width: usize) -> (Vec<f64>, Vec<usize>) {
        let mut rng = SeededRng::new(11);
        let rows: Vec<f64> = (0..n * width).map(|_| rng.uniform(-1.5, 1.5)).collect();
        let label = |row: &[f64], noise: f64| match row[0] - 0.5 * row[1] + noise {
            s if s < -0.5 => 0,
            s if s < 0.6 => 1,
            _ => 2,
        };
        let labels =
            rows.chunks_exact(width).map(|row| label(row, rng.uniform(-0.5, 0.5))).collect();
        (rows, labels)
    }

    #[test]
    fn the_gradient_agrees_with_differences() {
        let (rows, labels) = data(60, 3);
        let problem = Problem { width: 3, rows: &rows, labels: &labels, classes: 3, c: 0.7 };
        let mut rng = SeededRng::new(2);
        let theta = DVector::from_fn(12, |_, _| rng.uniform(-1.0, 1.0));
        let (loss, gradient, hessian) = problem.second_order(&theta);
        assert!((loss - problem.loss(&theta)).abs() < 1e-10);
        for i in 0..12 {
            let h = 1e-5;
            let at = |sign: f64| {
                let mut moved = theta.clone();
                moved[i] += sign * h;
                moved
            };
            let slope = (problem.loss(&at(1.0)) - problem.loss(&at(-1.0))) / (2.0 * h);
            assert!((slope - gradient[i]).abs() < 1e-7 * (1.0 + slope.abs()));
            let slopes =
                (problem.second_order(&at(1.0)).1 - problem.second_order(&at(-1.0)).1) / (2.0 * h);
            for j in 0..=i {
                let fixed = f64::from(u8::from(i % 4 == 3 && j % 4 == 3));
                assert!((slopes[j] + fixed - hessian[(i, j)]).abs() < 1e-6, "{i} {j}");
            }
        }
    }

    #[test]
    fn a_fit_has_no_slope_left() {
        let (rows, labels) = data(300, 3);
        let model = Logistic::fit(3, &rows, &labels, 3, LogisticSettings::default()).unwrap();
        let problem = Problem { width: 3, rows: &rows, labels: &labels, classes: 3, c: 1.0 };
        let theta: Vec<f64> = model
            .coefficients()
            .into_iter()
            .zip(model.intercepts())
            .flat_map(|(row, &b)| row.into_iter().chain([b]))
            .collect();
        let (_, gradient, _) = problem.second_order(&DVector::from_vec(theta));
        assert!(gradient.amax() < 1e-8, "{}", gradient.amax());
        assert!(model.intercepts().iter().sum::<f64>().abs() < 1e-9);
    }

    #[test]
    fn separable_duplicated_and_constant_data_converge() {
        let rows = [[1.0, 2.0], [1.0, 2.0], [-1.0, 2.0], [-1.0, 2.0]].concat();
        let settings = LogisticSettings { c: 1e3, ..Default::default() };
        let model = Logistic::fit(2, &rows, &[0, 0, 1, 1], 2, settings).unwrap();
        assert!(model.coefficients()[0][0] > 1.0);
        assert_eq!(model.coefficients()[0].len(), 2);
    }

    #[test]
    fn one_class_is_refused() {
        let complaint = Logistic::fit(1, &[1.0, 2.0], &[0, 0], 2, LogisticSettings::default());
        assert_eq!(complaint.unwrap_err().field, "labels");
    }
}
