//! Adds Newton trees to a model, round by round.

use super::bins::Bins;
use super::grower::{Grower, Limits};
use super::newton::{Newton, Sums, in_quanta};
use super::settings::BoostingSettings;
use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::math::{exp, ln};
use crate::predict::boosting::{Boosted, Summand, scores_of};
use crate::predict::tree::{DEEPEST, Node, Questions};

/// A model that grows by one round of trees at a time.
pub(super) struct Booster<'a> {
    labels: &'a [usize],
    bins: Bins,
    grower: Grower,
    rate: f64,
    intercepts: Vec<f64>,
    trees: Vec<Summand>,
    /// Scores of all rows (rows × scores), and the corresponding probabilities.
    scores: Vec<f64>,
    shares: Vec<f64>,
    newton: Newton,
    /// The leaf of each row in the latest tree.
    leaf_of: Vec<usize>,
}

impl<'a> Booster<'a> {
    /// # Errors
    /// [`Invalid`] if there are fewer than two classes, too many rows or a number beyond single
    /// precision.
    pub(super) fn new(samples: &Samples<'a>, settings: &BoostingSettings) -> Result<Self, Invalid> {
        if samples.classes() < 2 {
            return Err(Invalid::new("classes", "at least 2", samples.classes()));
        }
        let n = samples.labels().len();
        let intercepts = first_scores(&samples.counts());
        Ok(Self {
            labels: samples.labels(),
            bins: Bins::new(samples, settings.bins)?,
            grower: Grower::new(Limits {
                depth: settings.depth.min(DEEPEST),
                leaf: settings.min_leaf,
            }),
            rate: settings.rate,
            trees: Vec::new(),
            scores: intercepts.repeat(n),
            shares: vec![0.0; n * intercepts.len()],
            newton: Newton { derivatives: vec![[0; 2]; n], penalty: settings.penalty },
            leaf_of: vec![0; n],
            intercepts,
        })
    }

    pub(super) fn intercepts(&self) -> &[f64] {
        &self.intercepts
    }

    pub(super) fn finish(self) -> Boosted {
        Boosted::new(self.intercepts, self.trees)
    }

    /// Adds a tree for each score. Returns the new trees.
    pub(super) fn round(&mut self) -> &[Summand] {
        let outputs = self.intercepts.len();
        self.shares.copy_from_slice(&self.scores);
        for shares in self.shares.chunks_exact_mut(outputs) {
            to_shares(shares);
        }
        let begin = self.trees.len();
        for output in 0..outputs {
            // With two classes, the only score belongs to the second class.
            let class = if outputs == 1 { 1 } else { output };
            let shares = self.shares.iter().skip(output).step_by(outputs);
            for ((derivatives, &label), p) in
                self.newton.derivatives.iter_mut().zip(self.labels).zip(shares)
            {
                let own = if label == class { 1.0 } else { 0.0 };
                *derivatives = [in_quanta(p - own), in_quanta(p * (1.0 - p))];
            }
            let tree = self.tree();
            let scores = self.scores.iter_mut().skip(output).step_by(outputs);
            for (score, &leaf) in scores.zip(&self.leaf_of) {
                *score += tree.values[leaf];
            }
            self.trees.push(tree);
        }
        &self.trees[begin..]
    }

    /// Grows a tree. Its leaf values are Newton steps, multiplied by the rate, and its thresholds
    /// apply to unbinned features. Also records the leaf of each row.
    fn tree(&mut self) -> Summand {
        let grown = self.grower.grow(&self.bins, &self.newton, &mut self.leaf_of);
        let value = |(node, sums): (&Node, Sums)| match node.is_leaf() {
            true => self.rate * self.newton.step(sums),
            false => 0.0,
        };
        let values = grown.nodes.iter().zip(grown.sums).map(value).collect();
        Summand { questions: Questions(grown.nodes), values }
    }
}

/// The initial scores: the logarithms of (n_c + 1) / (n + K). Two classes have a single score, the
/// second logarithm minus the first.
fn first_scores(counts: &[usize]) -> Vec<f64> {
    let whole = (counts.iter().sum::<usize>() + counts.len()) as f64;
    let logs: Vec<f64> = counts.iter().map(|&n| ln((n + 1) as f64 / whole)).collect();
    match scores_of(counts.len()) {
        1 => vec![logs[1] - logs[0]],
        _ => logs,
    }
}

/// Converts scores to probabilities. Returns the logarithm of the sum of e^score over all classes.
/// A single score belongs to the second of two classes, and the first class then has score 0.
pub(super) fn to_shares(scores: &mut [f64]) -> f64 {
    let two = scores.len() == 1;
    let top = scores.iter().copied().fold(if two { 0.0 } else { f64::NEG_INFINITY }, f64::max);
    let mut total = if two { exp(-top) } else { 0.0 };
    for score in scores.iter_mut() {
        *score = exp(*score - top);
        total += *score;
    }
    for score in scores.iter_mut() {
        *score /= total;
    }
    top + ln(total)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_deviance() {
        for count in [1, 3] {
            let mut scores = vec![0.3, -0.9, 0.4];
            scores.truncate(count);
            let mut p = scores.clone();
            let whole = to_shares(&mut p);
            let direct = scores.iter().map(|s| exp(*s)).sum::<f64>();
            assert!((whole - ln(direct + if count == 1 { 1.0 } else { 0.0 })).abs() < 1e-15);
            for i in 0..count {
                let h = 1e-5;
                let at = |sign: f64| {
                    let mut moved = scores.clone();
                    moved[i] += sign * h;
                    let total = to_shares(&mut moved);
                    (total, moved[i])
                };
                let ((high, p_high), (low, p_low)) = (at(1.0), at(-1.0));
                assert!(((high - low) / (2.0 * h) - p[i]).abs() < 1e-10);
                assert!(((p_high - p_low) / (2.0 * h) - p[i] * (1.0 - p[i])).abs() < 1e-10);
            }
        }
    }
}
