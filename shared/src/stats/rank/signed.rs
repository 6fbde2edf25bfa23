//! Wilcoxon's signed-rank test with its effect size, estimate and interval.
//!
//! Pairs without a difference are dropped **everywhere**, as in R's `wilcox.test`. The test, the
//! effect size, the estimate and the interval all use only nonzero differences. The interval
//! inverts the test with a single null distribution, which belongs to the ranks of the unshifted
//! differences. Let W(x) be the number of pairwise means above x, plus half the number of pairwise
//! means equal to x. Then W(0) is the test statistic, even with ties. W decreases as x grows, so
//! the values of x that the test does not reject form an interval between two of these means.

use super::{MOST_COUNTED, TIE, check, doubled_ranks, is_shown, normal_two_sided};
use super::{tie_term, two_sided, ways_to_sign};
use crate::invalid::{Invalid, length};

/// Wilcoxon's signed-rank test of whether differences tend to be positive or negative.
///
/// The results are consistent: the interval contains the estimate, and it contains 0 if and only if
/// the test does not reject at [`LEVEL`](super::LEVEL). If the test rejects, the estimate and the
/// whole interval have the sign of the effect size.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SignedRank {
    /// The number of nonzero differences. All other fields use only these differences.
    pub differing: usize,
    /// The p-value of [`wilcoxon`].
    pub p: f64,
    /// The effect size of [`rank_biserial`].
    pub rank_biserial: f64,
    /// The typical difference: [`hodges_lehmann`] of the nonzero differences.
    pub typical: f64,
    /// The shifts that the test does not reject. `None` if the test could not reject any shift. It
    /// is possible that the test rejects 0 but no shift next to 0. The interval then begins or ends
    /// at [`f64::MIN_POSITIVE`] or at its negative. A typical difference of 0 is replaced in the
    /// same way.
    pub interval: Option<[f64; 2]>,
}

impl SignedRank {
    /// Tests these differences.
    ///
    /// # Errors
    /// [`Invalid`] if there are no differences, or if one is not finite.
    pub fn of(differences: &[f64]) -> Result<Self, Invalid> {
        check("differences", differences)?;
        let of = Signed::of(differences.iter().copied());
        let null = Null::of(&of.ranks);
        let (p, rank_biserial) = (null.p(of.positive()), of.balance());
        let means = sorted_means(&of.differences);
        let (mut typical, mut interval) = (median(&means), null.kept(&means));
        // If a pairwise mean is 0, the interval would include 0, but the test counts only half of
        // this mean.
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

/// The p-value of Wilcoxon's signed-rank test (Biometrics Bulletin 1, 1945) for pairs. Equal pairs
/// are dropped. The p-value is the probability that random signs give a rank sum at least as far
/// from the mean rank sum. It is exact for up to 60 pairs. For more pairs, the normal approximation
/// with the correction for ties is used. The p-value is 1 if all pairs are equal.
///
/// # Errors
/// [`Invalid`] if the lists are empty or differ in length, or if a number is not finite.
pub fn wilcoxon(first: &[f64], second: &[f64]) -> Result<f64, Invalid> {
    check("first", first)?;
    check("second", second)?;
    length("second", first.len(), second.len())?;
    let of = Signed::of(first.iter().zip(second).map(|(a, b)| a - b));
    Ok(Null::of(&of.ranks).p(of.positive()))
}

/// The matched-pairs rank-biserial correlation, which is the effect size of [`wilcoxon`] (Kerby,
/// Comprehensive Psychology 3, 2014). It is the rank sum of the pairs in which `first` is larger,
/// minus the rank sum of the pairs in which `second` is larger, divided by the sum of all ranks. It
/// ranges from −1 (`second` is larger in every pair) to 1. Equal pairs are omitted. It is 0 if all
/// pairs are equal.
#[must_use]
pub fn rank_biserial(first: &[f64], second: &[f64]) -> f64 {
    Signed::of(first.iter().zip(second).map(|(a, b)| a - b)).balance()
}

/// The Hodges–Lehmann estimate of a typical difference (Annals of Mathematical Statistics 34,
/// 1963). It is the median of the means of all pairs of differences, including each difference with
/// itself. It matches [`wilcoxon`] if no difference is zero. [`SignedRank`] omits zeros, but this
/// function does not. Returns 0 for an empty list.
#[must_use]
pub fn hodges_lehmann(differences: &[f64]) -> f64 {
    median(&sorted_means(differences))
}

/// The nonzero differences and their ranks.
struct Signed {
    /// Tied absolute values are made equal, so that the mean of two opposite differences is 0 if
    /// and only if their ranks are tied.
    differences: Vec<f64>,
    /// Twice the rank of each difference by absolute value.
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

    /// The rank sum of the positive differences minus the rank sum of the negative differences,
    /// divided by the sum of all ranks.
    fn balance(&self) -> f64 {
        let (all, positive) = (self.ranks.iter().sum::<usize>(), self.positive());
        (2.0 * positive as f64 - all as f64) / all.max(1) as f64
    }
}

/// The null distribution, under random signs, of the rank sum of the positive differences.
enum Null {
    /// The number of ways to obtain each value of the doubled rank sum.
    Exact(Vec<f64>),
    /// Mean and variance of the rank sum, which is not doubled.
    Normal { mean: f64, variance: f64 },
}

impl Null {
    /// The distribution for these doubled ranks.
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

    /// The smallest and the largest shift that are not rejected, given the sorted pairwise `means`.
    /// Returns `None` if no shift is rejected.
    fn kept(&self, means: &[f64]) -> Option<[f64; 2]> {
        // Doubled sums from 0 to the middle of their range. The number of means is half the largest
        // doubled sum.
        let sums: Vec<usize> = (0..=means.len()).collect();
        let least = sums.partition_point(|sum| is_shown(self.p(*sum)));
        // Index of the lower end among the means. The upper end is at the mirrored index.
        let place = least.div_ceil(2).checked_sub(1)?;
        Some([means[place], means[means.len() - 1 - place]])
    }
}

/// The means of all pairs, including each number with itself, sorted.
fn sorted_means(numbers: &[f64]) -> Vec<f64> {
    let pairs = numbers.iter().enumerate();
    let mut means: Vec<f64> =
        pairs.flat_map(|(i, a)| numbers[i..].iter().map(move |b| 0.5 * (a + b))).collect();
    means.sort_by(f64::total_cmp);
    means
}

/// The median of sorted numbers; 0 for an empty list.
fn median(sorted: &[f64]) -> f64 {
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

#[cfg(test)]
mod tests;
