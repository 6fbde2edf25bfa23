//! Round after round of Newton trees.

use super::BoostingSettings;
use super::bins::Bins;
use crate::invalid::Invalid;
use crate::learn::samples::Samples;
use crate::learn::tree::grower::{Criterion, Limits, grow};
use crate::math::{exp, ln};
use crate::predict::boosting::{Boosted, Summand, scores_of};
use crate::predict::tree::Questions;

/// A model that gets better.
pub(super) struct Booster<'a> {
    labels: &'a [usize],
    bins: Bins,
    limits: Limits,
    rate: f64,
    intercepts: Vec<f64>,
    trees: Vec<Summand>,
    /// Rows × scores, and the probabilities that belong to them.
    scores: Vec<f64>,
    shares: Vec<f64>,
    newton: Newton,
    /// Of each row, in the tree that was grown last.
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
            limits: Limits::new(Some(settings.depth), &[settings.min_leaf])?,
            rate: settings.rate,
            trees: Vec::new(),
            scores: intercepts.repeat(n),
            shares: vec![0.0; n * intercepts.len()],
            newton: Newton { slopes: vec![[0; 2]; n], penalty: settings.penalty },
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

    /// Adds a tree to each score.
    pub(super) fn round(&mut self) -> &[Summand] {
        let outputs = self.intercepts.len();
        self.shares.copy_from_slice(&self.scores);
        for shares in self.shares.chunks_exact_mut(outputs) {
            to_shares(shares);
        }
        let begin = self.trees.len();
        for output in 0..outputs {
            // With two classes, the one score is the second's.
            let class = if outputs == 1 { 1 } else { output };
            let shares = self.shares.iter().skip(output).step_by(outputs);
            for ((slopes, &label), p) in self.newton.slopes.iter_mut().zip(self.labels).zip(shares)
            {
                let own = if label == class { 1.0 } else { 0.0 };
                *slopes = [in_quanta(p - own), in_quanta(p * (1.0 - p))];
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

    /// A tree of Newton steps, times the rate, for features as they are. Notes each row's leaf.
    fn tree(&mut self) -> Summand {
        let (bins, leaf_of) = (&self.bins, &mut self.leaf_of);
        let mut grown = grow(bins.columns(), &self.newton, &self.limits, &mut |_, leaf, rows| {
            for row in rows {
                leaf_of[row] = leaf;
            }
        });
        // One least leaf was asked for, so there is one tree.
        let grown = grown.remove(0);
        let mut nodes = grown.nodes;
        let mut values = vec![0.0; nodes.len()];
        for ((node, value), total) in nodes.iter_mut().zip(&mut values).zip(grown.totals) {
            if node.is_leaf() {
                *value = self.rate * self.newton.step(total);
            } else {
                node.threshold = bins.threshold(node.feature as usize, node.threshold);
            }
        }
        Summand { questions: Questions::new(nodes), values }
    }
}

/// Logarithms of (n_c + 1) / (n + K); of two classes, the second's less the first's.
fn first_scores(counts: &[usize]) -> Vec<f64> {
    let whole = (counts.iter().sum::<usize>() + counts.len()) as f64;
    let logs: Vec<f64> = counts.iter().map(|&n| ln((n + 1) as f64 / whole)).collect();
    match scores_of(counts.len()) {
        1 => vec![logs[1] - logs[0]],
        _ => logs,
    }
}

/// Scores to probabilities; the logarithm of the sum of all e^score. A single score is that of
/// the second of two classes.
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

/// One unit of a rounded slope.
const QUANTUM: f64 = 1.0 / (1u64 << 40) as f64;

/// With at most 2²¹ rows and slopes from −1 to 1, sums stay below 2⁶¹.
fn in_quanta(value: f64) -> i64 {
    (value / QUANTUM).round() as i64
}

/// How much a split lowers the deviance, to second order.
struct Newton {
    /// Slope and curvature of each row's deviance by the score, in quanta.
    slopes: Vec<[i64; 2]>,
    penalty: f64,
}

impl Newton {
    /// G² / (H + λ): twice what one leaf gains.
    fn gain(&self, [slope, curvature]: [i64; 2]) -> f64 {
        let slope = slope as f64 * QUANTUM;
        let whole = curvature as f64 * QUANTUM + self.penalty;
        if whole > 0.0 { slope * slope / whole } else { 0.0 }
    }

    /// −G / (H + λ): the Newton step of a leaf.
    fn step(&self, [slope, curvature]: [i64; 2]) -> f64 {
        let whole = curvature as f64 * QUANTUM + self.penalty;
        if whole > 0.0 { -(slope as f64 * QUANTUM) / whole } else { 0.0 }
    }
}

impl Criterion for Newton {
    type Total = [i64; 2];
    /// On the left, and in all.
    type Scan = ([i64; 2], [i64; 2]);
    type Score = f64;

    fn total(&self, rows: impl Iterator<Item = usize>) -> [i64; 2] {
        rows.fold([0; 2], |[g, h], row| [g + self.slopes[row][0], h + self.slopes[row][1]])
    }

    fn is_done(&self, _: &[i64; 2]) -> bool {
        false
    }

    fn begin(&self, total: &[i64; 2]) -> Self::Scan {
        ([0; 2], *total)
    }

    #[inline(always)]
    fn pass(&self, (left, _): &mut Self::Scan, row: usize) {
        let [slope, curvature] = self.slopes[row];
        left[0] += slope;
        left[1] += curvature;
    }

    #[inline(always)]
    fn score(&self, (left, all): &Self::Scan) -> f64 {
        self.gain(*left) + self.gain([all[0] - left[0], all[1] - left[1]])
    }

    #[inline(always)]
    fn is_better(&self, score: &f64, than: &f64) -> bool {
        score > than
    }

    fn is_worth_it(&self, score: &f64, total: &[i64; 2]) -> bool {
        *score > self.gain(*total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_deviance() {
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

    #[test]
    fn a_leaf_takes_the_newton_step() {
        let newton = Newton { slopes: vec![[in_quanta(0.25), in_quanta(0.5)]; 4], penalty: 1.0 };
        let total = newton.total(0..4);
        assert_eq!(newton.step(total), -1.0 / 3.0);
        assert_eq!(newton.gain(total), 1.0 / 3.0);
        assert!(!newton.is_worth_it(&newton.gain(total), &total));
    }
}
