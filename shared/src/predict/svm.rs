//! Support vector machines, one for each pair of classes.
//!
//! A pair (a, b), a < b, has a decision value f; f > 0 speaks for a. Pairs are in the order
//! (0, 1), (0, 2), …, (1, 2), …. The class with the most votes wins, the first of them on a
//! tie. Signs, order and votes are libsvm's.

mod coupling;
pub(crate) mod exponential;
mod support;

use super::scale::Scale;
use crate::invalid::{Invalid, finite, length, positive};
use crate::math::exp;
use support::Support;

/// What stands for the inner product of two standardised rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kernel {
    /// x·z.
    Linear,
    /// exp(−γ |x − z|²).
    Rbf {
        /// γ > 0.
        gamma: f64,
    },
}

/// A decision value as a probability, P = 1 / (1 + exp(a·f + b)): Platt's sigmoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigmoid {
    /// Slope; negative where greater decision values speak for the pair's first class.
    pub a: f64,
    /// Offset.
    pub b: f64,
}

impl Sigmoid {
    /// The probability of the pair's first class.
    #[must_use]
    pub fn probability(self, decision: f64) -> f64 {
        let z = self.a * decision + self.b;
        // Both forms are the same number; each is used where its exponential is below 1.
        if z >= 0.0 { exp(-z) / (1.0 + exp(-z)) } else { 1.0 / (1.0 + exp(z)) }
    }
}

/// A machine and a sigmoid for each pair of classes.
#[derive(Clone, Debug, PartialEq)]
pub struct Svm {
    width: usize,
    classes: usize,
    machines: Machines,
    /// One a pair.
    intercepts: Vec<f64>,
    /// One a pair.
    sigmoids: Vec<Sigmoid>,
}

#[derive(Clone, Debug, PartialEq)]
enum Machines {
    /// Row-major: pairs × features.
    Linear(Vec<f64>),
    Rbf(Support),
}

/// How many pairs there are of `classes` classes.
#[must_use]
pub fn pair_count(classes: usize) -> usize {
    classes * classes.saturating_sub(1) / 2
}

/// The pairs of classes in order.
pub fn pairs(classes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..classes).flat_map(move |a| (a + 1..classes).map(move |b| (a, b)))
}

/// The class with the most votes, the first of them on a tie, from one decision value a pair.
#[must_use]
pub fn vote(classes: usize, decisions: impl IntoIterator<Item = f64>) -> usize {
    let mut votes = vec![0usize; classes];
    for ((a, b), decision) in pairs(classes).zip(decisions) {
        votes[if decision > 0.0 { a } else { b }] += 1;
    }
    (0..classes).rev().max_by_key(|&class| votes[class]).unwrap_or(0)
}

impl Svm {
    /// Linear machines: for each pair of classes a row of `width` weights, an intercept and
    /// a sigmoid.
    ///
    /// # Errors
    /// [`Invalid`] if a length is wrong or a number is not finite.
    pub fn linear(
        width: usize,
        classes: usize,
        coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
        sigmoids: Vec<Sigmoid>,
    ) -> Result<Self, Invalid> {
        length("coefficients", pair_count(classes), coefficients.len())?;
        let weights = flat("coefficients", width, coefficients)?;
        Self::new(width, classes, Machines::Linear(weights), intercepts, sigmoids)
    }

    /// Machines with radial basis functions: f = Σ over support vectors of their dual
    /// coefficient times exp(−γ |x − vector|²), plus the intercept.
    /// `support_vectors` are rows of `width` standardised features, shared by all pairs;
    /// `dual_coefficients` has a row for each pair, with an entry for each vector.
    ///
    /// # Errors
    /// [`Invalid`] if a length is wrong, a number is not finite or γ not > 0.
    pub fn rbf(
        width: usize,
        classes: usize,
        gamma: f64,
        support_vectors: &[Vec<f64>],
        dual_coefficients: &[Vec<f64>],
        intercepts: Vec<f64>,
        sigmoids: Vec<Sigmoid>,
    ) -> Result<Self, Invalid> {
        positive("gamma", gamma)?;
        let vectors = flat("support_vectors", width, support_vectors)?;
        length("dual_coefficients", pair_count(classes), dual_coefficients.len())?;
        let dual = flat("dual_coefficients", support_vectors.len(), dual_coefficients)?;
        let support =
            Support::new(gamma, width, support_vectors.len(), &vectors, &dual, intercepts.len());
        Self::new(width, classes, Machines::Rbf(support), intercepts, sigmoids)
    }

    fn new(
        width: usize,
        classes: usize,
        machines: Machines,
        intercepts: Vec<f64>,
        sigmoids: Vec<Sigmoid>,
    ) -> Result<Self, Invalid> {
        if classes < 2 {
            return Err(Invalid::new("classes", "at least 2 classes", classes));
        }
        length("intercepts", pair_count(classes), intercepts.len())?;
        for (pair, &intercept) in intercepts.iter().enumerate() {
            finite(&format!("intercepts[{pair}]"), intercept)?;
        }
        length("sigmoids", intercepts.len(), sigmoids.len())?;
        for (pair, sigmoid) in sigmoids.iter().enumerate() {
            finite(&format!("sigmoids[{pair}][0]"), sigmoid.a)?;
            finite(&format!("sigmoids[{pair}][1]"), sigmoid.b)?;
        }
        Ok(Self { width, classes, machines, intercepts, sigmoids })
    }

    /// The kernel.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        match &self.machines {
            Machines::Linear(_) => Kernel::Linear,
            Machines::Rbf(support) => Kernel::Rbf { gamma: support.gamma() },
        }
    }

    /// Linear machines: weights, a row a pair. Empty for others.
    #[must_use]
    pub fn coefficients(&self) -> Vec<Vec<f64>> {
        match &self.machines {
            Machines::Linear(weights) => weights.chunks(self.width).map(<[f64]>::to_vec).collect(),
            Machines::Rbf(_) => Vec::new(),
        }
    }

    /// Standardised support vectors, one a row. Empty for linear machines, whose weights
    /// say all of it.
    #[must_use]
    pub fn support_vectors(&self) -> Vec<Vec<f64>> {
        match &self.machines {
            Machines::Linear(_) => Vec::new(),
            Machines::Rbf(support) => support.vectors(),
        }
    }

    /// Dual coefficients: a row a pair, an entry a support vector. Empty for linear machines.
    #[must_use]
    pub fn dual_coefficients(&self) -> Vec<Vec<f64>> {
        match &self.machines {
            Machines::Linear(_) => Vec::new(),
            Machines::Rbf(support) => support.dual(),
        }
    }

    /// An intercept a pair.
    #[must_use]
    pub fn intercepts(&self) -> &[f64] {
        &self.intercepts
    }

    /// A sigmoid a pair.
    #[must_use]
    pub fn sigmoids(&self) -> &[Sigmoid] {
        &self.sigmoids
    }

    /// Decision value of each pair for a row of raw features.
    #[must_use]
    pub fn decisions(&self, scale: &Scale, row: &[f64]) -> Vec<f64> {
        let row: Vec<f64> = row.iter().enumerate().map(|(j, &x)| scale.apply(j, x)).collect();
        let mut decisions = self.intercepts.clone();
        match &self.machines {
            Machines::Linear(weights) => {
                for (decision, weights) in decisions.iter_mut().zip(weights.chunks(self.width)) {
                    *decision = weights.iter().zip(&row).fold(*decision, |sum, (w, x)| sum + w * x);
                }
            }
            Machines::Rbf(support) => support.add_to(&row, &mut decisions),
        }
        decisions
    }

    /// The class, 0 … classes − 1, that most pairs vote for. It may differ from the most
    /// probable one.
    #[must_use]
    pub fn class(&self, scale: &Scale, row: &[f64]) -> usize {
        vote(self.classes, self.decisions(scale, row))
    }

    /// Writes the probability of each class to `out`, given a row of raw features.
    pub fn probabilities_into(&self, scale: &Scale, row: &[f64], out: &mut [f64]) {
        let decisions = self.decisions(scale, row);
        couple(&self.sigmoids, &decisions, out);
    }
}

/// Class probabilities from decision values, one a pair: each pair's sigmoid, then pairwise
/// coupling (Wu, Lin, Weng 2004, the second method).
pub fn couple(sigmoids: &[Sigmoid], decisions: &[f64], out: &mut [f64]) {
    let pairwise = sigmoids.iter().zip(decisions).map(|(sigmoid, &f)| sigmoid.probability(f));
    coupling::couple(&pairwise.collect::<Vec<_>>(), out);
}

/// The rows one behind the other.
fn flat(field: &str, width: usize, rows: &[Vec<f64>]) -> Result<Vec<f64>, Invalid> {
    let mut flat = Vec::with_capacity(rows.len() * width);
    for (i, row) in rows.iter().enumerate() {
        length(&format!("{field}[{i}]"), width, row.len())?;
        for (j, &value) in row.iter().enumerate() {
            flat.push(finite(&format!("{field}[{i}][{j}]"), value)?);
        }
    }
    Ok(flat)
}

#[cfg(test)]
mod tests;
