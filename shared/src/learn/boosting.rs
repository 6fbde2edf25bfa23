//! Gradient-boosted trees for the multinomial deviance (Friedman 2001, with Newton steps and a
//! penalty on leaves as in Chen and Guestrin 2016).
//!
//! In each round a small tree for each class's score is fitted to the slope of the deviance
//! where the model stands, and a share (`rate`) of its Newton step is added. Columns are cut
//! into quantile bins first. Nothing is random.
//!
//! Slopes and curvatures are rounded to multiples of 2⁻⁴⁰ and added as integers, so that sums,
//! and with them every split, depend on sets of rows and not on their order: permuting rows
//! changes no bit of a model. Ties go as in [`tree`](super::tree).

mod bins;

use super::samples::Samples;
use super::tree::grower::{Columns, Criterion, Limits, grow};
use crate::invalid::{Invalid, length, positive};
use crate::math::{exp, ln};
use crate::predict::boosting::{Boosted, Summand, scores_of};
use crate::predict::tree::Questions;
use bins::Bins;

/// How trees are boosted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoostingSettings {
    /// Trees for each score, at the most.
    pub rounds: usize,
    /// Depth of the trees.
    pub depth: usize,
    /// Share of each Newton step that is taken.
    pub rate: f64,
    /// Rows at a leaf at the least.
    pub min_leaf: usize,
    /// λ ≥ 0 of the penalty ½ λ w² on the value w of each leaf.
    pub penalty: f64,
    /// Bins of each column at the most.
    pub bins: usize,
}

impl Default for BoostingSettings {
    fn default() -> Self {
        Self { rounds: 100, depth: 3, rate: 0.1, min_leaf: 10, penalty: 1.0, bins: 64 }
    }
}

impl BoostingSettings {
    fn check(&self) -> Result<(), Invalid> {
        positive("rate", self.rate)?;
        if !(self.penalty.is_finite() && self.penalty >= 0.0) {
            return Err(Invalid::new("penalty", "a finite number ≥ 0", self.penalty));
        }
        for (field, found, least) in
            [("depth", self.depth, 1), ("min_leaf", self.min_leaf, 1), ("bins", self.bins, 2)]
        {
            if found < least {
                return Err(Invalid::new(field, format!("at least {least}"), found));
            }
        }
        Ok(())
    }
}

/// What grouped cross-validation chose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen {
    /// Depth of the trees.
    pub depth: usize,
    /// Rounds.
    pub rounds: usize,
    /// Mean of −log P(class) over the rows that were left out.
    pub log_loss: f64,
}

/// Boosts trees for all of the settings' rounds. A class that does not occur is improbable, not
/// impossible: the first scores are logarithms of (n_c + 1) / (n + K).
///
/// # Errors
/// [`Invalid`] if there are fewer than two classes, a setting is out of range, there are more
/// than 2²¹ rows or a number is beyond single precision.
pub fn fit(samples: &Samples<'_>, settings: &BoostingSettings) -> Result<Boosted, Invalid> {
    boost(samples, settings, &mut |_| ())
}

/// Chooses depth and rounds by the log loss on rows left out, one fold after another, and
/// boosts with them on all rows. `folds` has the fold of each row, from 0; rows of one trial
/// must be in one fold. Ties go to fewer rounds, then to the depth that is named first.
///
/// # Errors
/// As for [`fit`], or if `folds` is not as long as the rows, there are fewer than two folds or
/// one is empty, or `depths` is.
pub fn fit_by_folds(
    samples: &Samples<'_>,
    folds: &[usize],
    depths: &[usize],
    settings: &BoostingSettings,
) -> Result<(Boosted, Chosen), Invalid> {
    length("folds", samples.labels().len(), folds.len())?;
    let count = folds.iter().max().map_or(0, |last| last + 1);
    if count < 2 {
        return Err(Invalid::new("folds", "at least 2", count));
    }
    let mut best: Option<Chosen> = None;
    for &depth in depths {
        let settings = BoostingSettings { depth, ..*settings };
        let mut losses = vec![0.0; settings.rounds + 1];
        for fold in 0..count {
            let part = |keep: &dyn Fn(usize) -> bool| -> (Vec<f64>, Vec<usize>) {
                let rows = samples.rows().zip(samples.labels()).zip(folds);
                let rows = rows.filter(|(_, fold)| keep(**fold)).map(|(row, _)| row);
                let (values, labels): (Vec<&[f64]>, Vec<usize>) =
                    rows.map(|(row, &label)| (row, label)).unzip();
                (values.concat(), labels)
            };
            let (values, labels) = part(&|f| f != fold);
            let (left_out, expected) = part(&|f| f == fold);
            if labels.is_empty() || expected.is_empty() {
                return Err(Invalid::new("folds", "rows in each", format!("none in {fold}")));
            }
            let kept = Samples::new(samples.width(), &values, &labels, samples.classes())?;
            let mut running = LogLoss::new(&left_out, &expected, samples);
            let mut round = 0;
            boost(&kept, &settings, &mut |step| {
                losses[round] += running.after(step);
                round += 1;
            })?;
        }
        for (rounds, loss) in losses.iter().enumerate() {
            let log_loss = loss / samples.labels().len() as f64;
            if best.is_none_or(|best| log_loss < best.log_loss) {
                best = Some(Chosen { depth, rounds, log_loss });
            }
        }
    }
    let chosen = best.ok_or_else(|| Invalid::new("depths", "at least one", "none"))?;
    let settings = BoostingSettings { depth: chosen.depth, rounds: chosen.rounds, ..*settings };
    Ok((fit(samples, &settings)?, chosen))
}

/// What boosting reports: the first scores, then the trees of each round.
enum Step<'a> {
    Start(&'a [f64]),
    Round(&'a [Summand]),
}

fn boost(
    samples: &Samples<'_>,
    settings: &BoostingSettings,
    report: &mut impl FnMut(Step<'_>),
) -> Result<Boosted, Invalid> {
    settings.check()?;
    let classes = samples.classes();
    if classes < 2 {
        return Err(Invalid::new("classes", "at least 2", classes));
    }
    let n = samples.labels().len();
    let bins = Bins::new(samples, settings.bins)?;
    let limits = Limits::new(Some(settings.depth), &[settings.min_leaf])?;
    let intercepts = first_scores(&samples.counts());
    report(Step::Start(&intercepts));
    let mut scores: Vec<f64> = intercepts.repeat(n);
    let mut newton = Newton { slopes: vec![[0; 2]; n], penalty: settings.penalty };
    let mut shares = vec![0.0; intercepts.len()];
    let mut probabilities = vec![0.0; scores.len()];
    let mut trees = Vec::with_capacity(settings.rounds * intercepts.len());
    let mut leaf_of = vec![0; n];
    for _ in 0..settings.rounds {
        for (scores, row) in
            scores.chunks_exact(shares.len()).zip(probabilities.chunks_exact_mut(shares.len()))
        {
            shares.copy_from_slice(scores);
            log_total(&mut shares);
            row.copy_from_slice(&shares);
        }
        let begin = trees.len();
        for output in 0..intercepts.len() {
            // With two classes, the one score is the second's.
            let class = output + classes - intercepts.len();
            for (i, (slopes, &label)) in newton.slopes.iter_mut().zip(samples.labels()).enumerate()
            {
                let p = probabilities[i * intercepts.len() + output];
                let own = if label == class { 1.0 } else { 0.0 };
                *slopes = [in_quanta(p - own), in_quanta(p * (1.0 - p))];
            }
            let tree = newton_tree(&bins, &newton, &limits, settings.rate, &mut leaf_of);
            for (i, &leaf) in leaf_of.iter().enumerate() {
                scores[i * intercepts.len() + output] += tree.values[leaf];
            }
            trees.push(tree);
        }
        report(Step::Round(&trees[begin..]));
    }
    Ok(Boosted::new(intercepts, trees))
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
fn log_total(scores: &mut [f64]) -> f64 {
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

/// The log loss of rows that take no part, round after round.
struct LogLoss<'a> {
    rows: &'a [f64],
    width: usize,
    labels: &'a [usize],
    outputs: usize,
    scores: Vec<f64>,
}

impl<'a> LogLoss<'a> {
    fn new(rows: &'a [f64], labels: &'a [usize], like: &Samples<'_>) -> Self {
        let outputs = scores_of(like.classes());
        Self { rows, width: like.width(), labels, outputs, scores: Vec::new() }
    }

    /// Σ of −log P(class) after this step.
    fn after(&mut self, step: Step<'_>) -> f64 {
        match step {
            Step::Start(first) => self.scores = first.repeat(self.labels.len()),
            Step::Round(trees) => {
                for (row, scores) in self
                    .rows
                    .chunks_exact(self.width)
                    .zip(self.scores.chunks_exact_mut(self.outputs))
                {
                    for (score, tree) in scores.iter_mut().zip(trees) {
                        *score += tree.value(row);
                    }
                }
            }
        }
        let mut shares = vec![0.0; self.outputs];
        let mut loss = 0.0;
        for (scores, &label) in self.scores.chunks_exact(self.outputs).zip(self.labels) {
            let own = match self.outputs {
                1 if label == 0 => 0.0,
                1 => scores[0],
                _ => scores[label],
            };
            shares.copy_from_slice(scores);
            loss += log_total(&mut shares) - own;
        }
        loss
    }
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

/// A tree of Newton steps, times `rate`, for features as they are; and the leaf of each row.
fn newton_tree(
    bins: &Bins,
    newton: &Newton,
    limits: &Limits,
    rate: f64,
    leaf_of: &mut [usize],
) -> Summand {
    let columns: &Columns = bins.columns();
    let mut grown = grow(columns, newton, limits, &mut |_, leaf, rows| {
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
            *value = rate * newton.step(total);
        } else {
            node.threshold = bins.threshold(node.feature as usize, node.threshold);
        }
    }
    Summand { questions: Questions::new(nodes), values }
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
            let whole = log_total(&mut p);
            let direct = scores.iter().map(|s| exp(*s)).sum::<f64>();
            assert!((whole - ln(direct + if count == 1 { 1.0 } else { 0.0 })).abs() < 1e-15);
            for i in 0..count {
                let h = 1e-5;
                let at = |sign: f64| {
                    let mut moved = scores.clone();
                    moved[i] += sign * h;
                    let total = log_total(&mut moved);
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
