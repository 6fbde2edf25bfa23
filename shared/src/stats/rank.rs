//! Rank tests of whether one list of numbers tends to be higher than another, and Holm's correction
//! for several tests.
//!
//! p-values are two-sided. For short lists they are exact, even with ties: dynamic programming
//! counts all assignments of the observed ranks. For long lists, the normal approximation with the
//! correction for ties is used, as in `scipy.stats`.

mod signed;

pub use signed::{SignedRank, hodges_lehmann, rank_biserial, wilcoxon};

use super::upper_tail;
use crate::invalid::{Invalid, all_finite};

/// The maximum total number of values for exact p-values. For more values, the normal approximation
/// is accurate to about 10⁻³, unless the p-value is tiny.
const MOST_COUNTED: usize = 60;

/// Numbers that differ by at most this are tied, and a difference of at most this counts as zero.
/// Therefore, rounding errors do not separate equal proportions.
pub(crate) const TIE: f64 = 1e-12;

/// The significance level: [`is_shown`] requires a p-value below this.
pub const LEVEL: f64 = 0.05;

/// Whether a test with this p-value rejects: p < [`LEVEL`]. Verdicts and intervals use only this
/// function.
#[must_use]
pub fn is_shown(p: f64) -> bool {
    p < LEVEL
}

/// The p-value of the Mann–Whitney test (Annals of Mathematical Statistics 18, 1947): the
/// probability that a random split of the numbers gives rank sums at least as far apart. The
/// p-value is exact for up to 60 numbers. For more numbers, the normal approximation with
/// corrections for ties and continuity is used. The p-value is 1 if all numbers are equal.
///
/// # Errors
/// [`Invalid`] if a list is empty or a number is not finite.
pub fn mann_whitney(first: &[f64], second: &[f64]) -> Result<f64, Invalid> {
    check("first", first)?;
    check("second", second)?;
    let all = [first, second].concat();
    let ranks = doubled_ranks(&all);
    let of_first: usize = ranks[..first.len()].iter().sum();
    if all.len() <= MOST_COUNTED {
        return Ok(two_sided(&ways_to_choose(&ranks, first.len()), of_first));
    }
    let (n, m, total) = (first.len() as f64, second.len() as f64, all.len() as f64);
    let (u, mean) = (0.5 * of_first as f64 - 0.5 * n * (n + 1.0), 0.5 * n * m);
    let variance = n * m / 12.0 * ((total + 1.0) - tie_term(&ranks) / (total * (total - 1.0)));
    Ok(normal_two_sided((u - mean).abs() - 0.5, variance))
}

/// The p-values after Holm's correction (Scandinavian Journal of Statistics 6, 1979), in the given
/// order. If they are compared with a level, the probability of any false rejection among all tests
/// is at most this level.
#[must_use]
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let n = p_values.len();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&i, &j| p_values[i].total_cmp(&p_values[j]));
    let mut corrected = vec![0.0; n];
    let mut highest = 0.0f64;
    for (place, i) in order.into_iter().enumerate() {
        highest = highest.max(((n - place) as f64 * p_values[i]).min(1.0));
        corrected[i] = highest;
    }
    corrected
}

fn check(field: &str, numbers: &[f64]) -> Result<(), Invalid> {
    if numbers.is_empty() {
        return Err(Invalid::new(field, "at least one number", "none"));
    }
    all_finite(field, numbers)
}

/// Twice the rank of each number, so the lowest value is 2. Tied numbers share their mean rank, and
/// doubling makes the mean an integer.
fn doubled_ranks(numbers: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..numbers.len()).collect();
    order.sort_by(|&i, &j| numbers[i].total_cmp(&numbers[j]));
    let mut ranks = vec![0; numbers.len()];
    let mut begin = 0;
    for group in order.chunk_by(|&i, &j| numbers[j] - numbers[i] <= TIE) {
        let end = begin + group.len();
        group.iter().for_each(|&i| ranks[i] = begin + end + 1);
        begin = end;
    }
    ranks
}

/// Σ (t³ − t) over groups of t tied numbers.
fn tie_term(ranks: &[usize]) -> f64 {
    let mut sorted = ranks.to_vec();
    sorted.sort_unstable();
    let groups = sorted.chunk_by(|a, b| a == b).map(|group| group.len() as f64);
    groups.map(|t| t * t * t - t).sum()
}

/// For each sum, the number of ways to choose `count` of the `ranks` with this sum. Counts below
/// 2⁵³ are exact, and larger counts have a relative error of 10⁻¹⁴. All counts stay far below the
/// largest double.
fn ways_to_choose(ranks: &[usize], count: usize) -> Vec<f64> {
    let most: usize = ranks.iter().sum();
    // Indexed by the number of chosen ranks, then by their sum.
    let mut ways = vec![vec![0.0; most + 1]; count + 1];
    ways[0][0] = 1.0;
    for &rank in ranks {
        for chosen in (1..=count).rev() {
            let (fewer, more) = ways.split_at_mut(chosen);
            for (sum, ways) in more[0].iter_mut().enumerate().skip(rank) {
                *ways += fewer[chosen - 1][sum - rank];
            }
        }
    }
    ways.swap_remove(count)
}

/// For each sum, the number of ways to choose signs such that the ranks with a positive sign have
/// this sum.
fn ways_to_sign(ranks: &[usize]) -> Vec<f64> {
    let mut ways = vec![0.0; ranks.iter().sum::<usize>() + 1];
    ways[0] = 1.0;
    for &rank in ranks {
        for sum in (rank..ways.len()).rev() {
            ways[sum] += ways[sum - rank];
        }
    }
    ways
}

/// The two-sided p-value of `found`: twice the smaller tail. Both tails include `found`.
fn two_sided(ways: &[f64], found: usize) -> f64 {
    let total: f64 = ways.iter().sum();
    let below: f64 = ways[..=found].iter().sum();
    let above: f64 = ways[found..].iter().sum();
    (2.0 * below.min(above) / total).min(1.0)
}

fn normal_two_sided(deviation: f64, variance: f64) -> f64 {
    if variance > 0.0 { (2.0 * upper_tail(deviation / variance.sqrt())).min(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    fn close(found: f64, expected: f64, relative: f64) {
        assert!((found / expected - 1.0).abs() < relative, "{found} {expected}");
    }

    /// Critical values from published tables, two-sided at 5 %: U for n = m (Mann and Whitney;
    /// Siegel's table K), and T for n pairs (Wilcoxon; Siegel's table G). The critical value itself
    /// is significant, but the next value is not.
    #[test]
    fn critical_values_are_those_of_the_tables() {
        for (n, critical) in
            [(4, 0), (5, 2), (6, 5), (7, 8), (8, 13), (10, 23), (12, 37), (20, 127)]
        {
            let ranks: Vec<usize> = (1..=2 * n).map(|rank| 2 * rank).collect();
            let ways = ways_to_choose(&ranks, n);
            let p = |u: usize| two_sided(&ways, 2 * u + n * (n + 1));
            assert!(p(critical) <= 0.05 && p(critical + 1) > 0.05, "{n}");
        }
        for (n, critical) in
            [(6, 0), (7, 2), (8, 3), (10, 8), (12, 13), (15, 25), (20, 52), (25, 89)]
        {
            let ranks: Vec<usize> = (1..=n).map(|rank| 2 * rank).collect();
            let ways = ways_to_sign(&ranks);
            let p = |t: usize| two_sided(&ways, 2 * t);
            assert!(p(critical) <= 0.05 && p(critical + 1) > 0.05, "{n}");
        }
    }

    /// Values from `scipy.stats` 1.17: `mannwhitneyu` (exact without ties), `wilcoxon` (exact), and
    /// the permutation distribution if there are ties. The long lists use the normal approximation.
    #[test]
    fn values_of_scipy() {
        let (a, b) = (
            [71.2, 68.4, 80.1, 75.5, 69.9, 77.3, 83.0, 72.8],
            [70.1, 66.0, 78.8, 76.1, 65.2, 74.4, 79.5, 70.4],
        );
        close(mann_whitney(&a, &b).unwrap(), 0.5053613053613053, 1e-12);
        close(wilcoxon(&a, &b).unwrap(), 0.015625, 1e-12);
        let (c, d) =
            ([3.0, 3.0, 5.0, 1.0, 2.0, 2.0, 7.0, 4.0], [2.0, 3.0, 1.0, 1.0, 2.0, 0.0, 4.0, 4.0]);
        close(mann_whitney(&c, &d).unwrap(), 0.2275058275058275, 1e-12);
        close(wilcoxon(&c, &d).unwrap(), 0.125, 1e-12);
        let x: Vec<f64> = (0..80).map(|i| f64::from(i * 37 % 50) / 50.0).collect();
        let shifted = |i: i32| f64::from((i * 29 + 7) % 50) / 50.0 + 0.08 * f64::from(i % 2);
        let y: Vec<f64> = (0..80).map(shifted).collect();
        close(mann_whitney(&x, &y).unwrap(), 0.466159263334458, 1e-9);
        close(wilcoxon(&x, &y).unwrap(), 0.459935289754249, 1e-9);
    }

    /// Compares with an enumeration of every split and every choice of signs.
    #[test]
    fn counting_is_enumeration() {
        let mut rng = SeededRng::new(7);
        for _ in 0..40 {
            let (n, m) = (1 + rng.below(5), 1 + rng.below(5));
            let numbers: Vec<f64> = (0..n + m).map(|_| rng.below(5) as f64).collect();
            let ranks = doubled_ranks(&numbers);
            let found: usize = ranks[..n].iter().sum();
            let sum = |chosen: usize, count: Option<usize>| {
                let bits = (0..n + m).filter(|bit| chosen >> bit & 1 == 1);
                (count.is_none_or(|count| bits.clone().count() == count))
                    .then(|| bits.map(|bit| ranks[bit]).sum::<usize>())
            };
            let p = |count: Option<usize>| {
                let sums: Vec<usize> = (0..1 << (n + m)).filter_map(|c| sum(c, count)).collect();
                let share = |tail: &dyn Fn(usize) -> bool| {
                    sums.iter().filter(|&&s| tail(s)).count() as f64 / sums.len() as f64
                };
                (2.0 * share(&|s| s <= found).min(share(&|s| s >= found))).min(1.0)
            };
            close(mann_whitney(&numbers[..n], &numbers[n..]).unwrap(), p(Some(n)), 1e-12);
            close(two_sided(&ways_to_sign(&ranks), found), p(None), 1e-12);
        }
    }

    #[test]
    fn order_and_sides_do_not_matter() {
        let (a, b) = ([3.0, 1.0, 4.0, 1.0, 5.0], [9.0, 2.0, 6.0, 5.0, 3.0]);
        let p = mann_whitney(&a, &b).unwrap();
        close(mann_whitney(&b, &a).unwrap(), p, 1e-12);
        let mut turned = a;
        turned.reverse();
        close(mann_whitney(&turned, &b).unwrap(), p, 1e-12);
        close(wilcoxon(&a, &b).unwrap(), wilcoxon(&b, &a).unwrap(), 1e-12);
        assert_eq!(mann_whitney(&[1.0; 70], &[1.0; 70]).unwrap(), 1.0);
        assert_eq!(wilcoxon(&a, &a).unwrap(), 1.0);
    }

    /// The differences are equal up to rounding errors.
    #[test]
    fn equal_differences_are_tied() {
        let first = [0.3, 0.8, 0.7, 0.2];
        let second = [0.1, 0.6, 0.5, 0.4];
        assert!(first[0] - second[0] != first[1] - second[1]);
        // Three of the four signs are the same, and all ranks are tied, so p = 2 · 5/16.
        close(wilcoxon(&first, &second).unwrap(), 0.625, 1e-12);
    }

    #[test]
    fn holms_example() {
        assert_eq!(holm(&[0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02]);
        assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
        assert!(holm(&[]).is_empty());
    }

    #[test]
    fn complaints_name_the_list() {
        assert_eq!(mann_whitney(&[], &[1.0]).unwrap_err().field, "first");
        assert_eq!(wilcoxon(&[1.0], &[1.0, 2.0]).unwrap_err().field, "second");
        assert_eq!(mann_whitney(&[1.0], &[0.0, f64::NAN]).unwrap_err().field, "second[1]");
    }
}
