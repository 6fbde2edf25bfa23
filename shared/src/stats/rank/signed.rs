//! Wilcoxon's signed-rank test with the effect size, the estimate and the interval that belong to it.
//!
//! Pairs without a difference are dropped **everywhere**, as in R's `wilcox.test`: the test, the effect
//! size, the estimate and the interval are all of the differences that are not zero. The interval is the
//! inversion of the test with one null distribution, that of the ranks at zero. With W(x) the number of
//! means of pairs above x, and half the number of those at x, W(0) is the statistic of the test, also
//! with ties. W falls as x grows, so the x whose W the null distribution does not reject are an interval
//! between two of these means.

use super::{MOST_COUNTED, TIE, check, doubled_ranks, is_shown, normal_two_sided};
use super::{tie_term, two_sided, ways_to_sign};
use crate::invalid::{Invalid, length};

/// Wilcoxon's signed-rank test of whether differences tend to be positive or negative.
///
/// Nothing here contradicts the rest: the interval contains the estimate; it contains 0 exactly if the
/// test does not reject at [`LEVEL`](super::LEVEL); and if the test rejects, the estimate and the whole
/// interval have the sign of the effect size.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SignedRank {
    /// How many differences are not zero. Everything else is of these.
    pub differing: usize,
    /// The p-value, as of [`wilcoxon`].
    pub p: f64,
    /// The effect size, as of [`rank_biserial`].
    pub rank_biserial: f64,
    /// The typical difference: [`hodges_lehmann`] of the differences that are not zero.
    pub typical: f64,
    /// The shifts that the test does not reject; none where it could not reject any. If the test rejects
    /// 0, but no shift beside it, the interval begins or ends beside 0, with
    /// [`f64::MIN_POSITIVE`] or its negative; so does the typical difference.
    pub interval: Option<[f64; 2]>,
}

impl SignedRank {
    /// Of these differences.
    ///
    /// # Errors
    /// [`Invalid`] if there is none, or one is not finite.
    pub fn of(differences: &[f64]) -> Result<Self, Invalid> {
        check("differences", differences)?;
        let of = Signed::of(differences.iter().copied());
        let null = Null::of(&of.ranks);
        let (p, rank_biserial) = (null.p(of.positive()), of.balance());
        let means = sorted_means(&of.differences);
        let (mut typical, mut interval) = (median(&means), null.kept(&means));
        // A mean of a pair at 0 belongs to the interval as a whole, but the test takes half of it.
        if is_shown(p) {
            let beside = if rank_biserial > 0.0 {
                |x: f64| x.max(f64::MIN_POSITIVE)
            } else {
                |x: f64| x.min(-f64::MIN_POSITIVE)
            };
            typical = beside(typical);
            interval = interval.map(|ends| ends.map(beside));
        }
        Ok(Self { differing: of.ranks.len(), p, rank_biserial, typical, interval })
    }
}

/// The p-value of Wilcoxon's signed-rank test (Biometrics Bulletin 1, 1945) for pairs; equal pairs are
/// omitted. It is the probability that random signs give the differences' ranks a sum at least as far
/// from its mean. Exact up to 60 pairs; above, normal with the correction for ties. 1 if all pairs are
/// equal.
///
/// # Errors
/// [`Invalid`] if the lists are empty or differ in length, or a number is not finite.
pub fn wilcoxon(first: &[f64], second: &[f64]) -> Result<f64, Invalid> {
    check("first", first)?;
    check("second", second)?;
    length("second", first.len(), second.len())?;
    let of = Signed::of(first.iter().zip(second).map(|(a, b)| a - b));
    Ok(Null::of(&of.ranks).p(of.positive()))
}

/// The matched-pairs rank-biserial correlation, the effect size that belongs to [`wilcoxon`]: the sum of
/// ranks of the pairs in which `first` is larger, less that of the others, over the sum of all ranks
/// (Kerby, Comprehensive Psychology 3, 2014). From −1 (`second` is larger in every pair) to 1; equal
/// pairs are omitted, and 0 if all are.
#[must_use]
pub fn rank_biserial(first: &[f64], second: &[f64]) -> f64 {
    Signed::of(first.iter().zip(second).map(|(a, b)| a - b)).balance()
}

/// The Hodges–Lehmann estimate of a typical difference: the median of the means of all pairs of
/// differences, each paired with itself too (Annals of Mathematical Statistics 34, 1963). It belongs
/// to [`wilcoxon`] if no difference is zero; [`SignedRank`] leaves these out. 0 for an empty list.
#[must_use]
pub fn hodges_lehmann(differences: &[f64]) -> f64 {
    median(&sorted_means(differences))
}

/// The differences that are not zero.
struct Signed {
    /// Tied sizes are made equal, so that a mean of two opposite differences is 0 exactly where the
    /// ranks say so.
    differences: Vec<f64>,
    /// Twice the rank of the size of each.
    ranks: Vec<usize>,
}

impl Signed {
    fn of(differences: impl Iterator<Item = f64>) -> Self {
        let mut differences: Vec<f64> = differences.filter(|d| d.abs() > TIE).collect();
        let sizes: Vec<f64> = differences.iter().map(|d| d.abs()).collect();
        let ranks = doubled_ranks(&sizes);
        let mut order: Vec<usize> = (0..ranks.len()).collect();
        order.sort_by(|&i, &j| sizes[i].total_cmp(&sizes[j]));
        for tied in order.chunk_by(|&i, &j| ranks[i] == ranks[j]) {
            tied.iter().for_each(|&i| differences[i] = sizes[tied[0]].copysign(differences[i]));
        }
        Self { differences, ranks }
    }

    /// Twice the sum of the ranks of the positive differences.
    fn positive(&self) -> usize {
        let all = self.ranks.iter().zip(&self.differences);
        all.filter(|(_, d)| **d > 0.0).map(|(rank, _)| rank).sum()
    }

    /// The ranks of the positive differences less those of the others, over all ranks.
    fn balance(&self) -> f64 {
        let (all, positive) = (self.ranks.iter().sum::<usize>(), self.positive());
        (2.0 * positive as f64 - all as f64) / all.max(1) as f64
    }
}

/// The distribution of twice the sum of the ranks of positive differences, if signs are random.
enum Null {
    /// In how many ways it has each value.
    Exact(Vec<f64>),
    /// Mean and variance of the sum itself.
    Normal { mean: f64, variance: f64 },
}

impl Null {
    /// Of these doubled ranks.
    fn of(ranks: &[usize]) -> Self {
        if ranks.len() <= MOST_COUNTED {
            return Self::Exact(ways_to_sign(ranks));
        }
        let n = ranks.len() as f64;
        let variance = n * (n + 1.0) * (2.0 * n + 1.0) / 24.0 - tie_term(ranks) / 48.0;
        Self::Normal { mean: 0.25 * n * (n + 1.0), variance }
    }

    /// The two-sided p-value of a doubled sum.
    fn p(&self, sum: usize) -> f64 {
        match self {
            Self::Exact(ways) => two_sided(ways, sum),
            Self::Normal { mean, variance } => {
                normal_two_sided((0.5 * sum as f64 - mean).abs(), *variance)
            }
        }
    }

    /// From the least to the greatest shift that is not rejected, of `means` of pairs in order; none if
    /// no shift is rejected.
    fn kept(&self, means: &[f64]) -> Option<[f64; 2]> {
        // Doubled sums from 0 to all of the ranks, twice as many as there are means.
        let sums: Vec<usize> = (0..=means.len()).collect();
        let least = sums.partition_point(|sum| is_shown(self.p(*sum)));
        // As many means lie below every shift that is kept, and as many above, or at it.
        let place = least.div_ceil(2).checked_sub(1)?;
        Some([means[place], means[means.len() - 1 - place]])
    }
}

/// The means of all pairs, each paired with itself too, from the least.
fn sorted_means(numbers: &[f64]) -> Vec<f64> {
    let pairs = numbers.iter().enumerate();
    let mut means: Vec<f64> =
        pairs.flat_map(|(i, a)| numbers[i..].iter().map(move |b| 0.5 * (a + b))).collect();
    means.sort_by(f64::total_cmp);
    means
}

/// The median of sorted numbers; 0 of none.
fn median(sorted: &[f64]) -> f64 {
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

#[cfg(test)]
mod tests;
