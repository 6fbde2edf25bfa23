//! Proportions with confidence intervals, and tail probabilities of the beta, binomial and normal
//! distributions.
//!
//! The incomplete beta function comes from the crate `special` (Algorithms AS 63 and AS 109), which
//! computes with `libm` and therefore returns the same bits on every platform.

pub mod rank;
pub mod power;

use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};
use special::{Beta as _, Error as _};

/// A proportion with its confidence interval. All three numbers are from 0 to 1, and low ≤ value ≤
/// high.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Estimate {
    /// The observed proportion.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Estimate {
    /// A proportion without uncertainty.
    #[must_use]
    pub fn exactly(value: f64) -> Self {
        Self { value, low: value, high: value }
    }
}

/// The number of windows of one trajectory that have some property.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Number of windows with the property.
    pub hits: usize,
    /// Number of all windows of the trajectory.
    pub of: usize,
}

/// Returns `value` if it is strictly between 0 and 1.
///
/// # Errors
/// [`Invalid`] for any other number, and for NaN.
pub fn open_probability(field: &str, value: f64) -> Result<f64, Invalid> {
    if value > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        Err(Invalid::new(field, "a probability in (0, 1)", value))
    }
}

/// P(X ≤ x) of a beta distribution with parameters a, b > 0. It is 0 for x < 0 and 1 for x > 1. The
/// relative error is about 10⁻¹³ if the parameters are in the hundreds, and about 10⁻¹⁰ if they are
/// 10⁵.
#[must_use]
pub fn beta_cdf(x: f64, a: f64, b: f64) -> f64 {
    // Rounding can put the result slightly outside [0, 1].
    x.clamp(0.0, 1.0).inc_beta(a, b, a.ln_beta(b)).clamp(0.0, 1.0)
}

/// The quantile function: the x in [0, 1] at which [`beta_cdf`] equals `probability`.
#[must_use]
pub fn beta_quantile(probability: f64, a: f64, b: f64) -> f64 {
    let probability = probability.clamp(0.0, 1.0);
    if probability > 0.0 && probability < LEAST_OF_NEWTON {
        return bisected(|x| beta_cdf(x, a, b) >= probability);
    }
    probability.inv_inc_beta(a, b, a.ln_beta(b)).clamp(0.0, 1.0)
}

/// The smallest probability for which Algorithm AS 109 is used. It has an absolute error of 10⁻³⁰,
/// so it loses digits below this probability. At 10⁻²⁰⁰, it does not terminate.
const LEAST_OF_NEWTON: f64 = 1e-18;

/// The largest number in [0, 1] for which a monotone predicate is false, found by bisection.
fn bisected(holds: impl Fn(f64) -> bool) -> f64 {
    // Non-negative floats are ordered like their bit patterns. Bisecting the bit patterns keeps the
    // relative error small.
    let (mut no, mut yes) = (0.0_f64.to_bits(), 1.0_f64.to_bits());
    while yes - no > 1 {
        let middle = u64::midpoint(no, yes);
        if holds(f64::from_bits(middle)) {
            yes = middle;
        } else {
            no = middle;
        }
    }
    f64::from_bits(no)
}

/// P(X > x) of the standard normal distribution.
#[must_use]
pub fn upper_tail(x: f64) -> f64 {
    0.5 * (x * core::f64::consts::FRAC_1_SQRT_2).compl_error()
}

/// P(X ≥ `hits`) for a binomial X with `of` trials and success probability `probability`.
#[must_use]
pub fn binomial_at_least(hits: usize, of: usize, probability: f64) -> f64 {
    match hits {
        0 => 1.0,
        _ if hits > of => 0.0,
        _ => beta_cdf(probability, hits as f64, (of - hits + 1) as f64),
    }
}

/// The exact confidence interval of a proportion after `hits` in `of` independent trials (Clopper
/// and Pearson, Biometrika 1934). Its coverage is at least `confidence`, which must be in (0, 1).
/// The bound on the probability of error is the same on both sides. Counts can be fractional,
/// because effective sample sizes are fractional. `hits` must be from 0 to `of`. Without trials,
/// the interval is [0, 1].
#[must_use]
pub fn clopper_pearson(hits: f64, of: f64, confidence: f64) -> (f64, f64) {
    let tail = 0.5 * (1.0 - confidence);
    let misses = of - hits;
    let low = if hits > 0.0 { beta_quantile(tail, hits, misses + 1.0) } else { 0.0 };
    let high = if misses > 0.0 { beta_quantile(1.0 - tail, hits + 1.0, misses) } else { 1.0 };
    (low, high)
}

/// The proportion of windows with some property, given the tally of each trajectory. The interval
/// assumes that *trajectories* are independent, but assumes nothing about the windows within a
/// trajectory. It is [`clopper_pearson`] at the effective sample size n* = (Σw_i)²/Σw_i², where w_i
/// is the number of windows of trajectory i (Kish, Survey Sampling, 1965). This treats all windows
/// of a trajectory as if they agreed. If all trajectories have equally many windows, n* is the
/// number of trajectories. If each trajectory has one window, the interval is exact.
///
/// Korn and Graubard (Survey Methodology 24, 1998) give a narrower interval, which estimates the
/// agreement between windows from the variance between trajectories. It fails if a few trajectories
/// miss in all their windows and the others almost never miss, because samples contain too few of
/// the trajectories that miss. In simulations, its coverage was 0.75 instead of 0.90 with 30
/// trajectories, and still only 0.87 with 300. The interval of this function had its nominal
/// coverage in all simulations. However, it is wider than necessary if the windows of a trajectory
/// hardly agree.
///
/// Without windows, the proportion is unknown: the value is 0 and the interval is [0, 1].
///
/// # Errors
/// [`Invalid`] if `confidence` is not in (0, 1), or if a tally has more hits than windows.
pub fn share(tallies: &[Tally], confidence: f64) -> Result<Estimate, Invalid> {
    open_probability("confidence", confidence)?;
    if let Some(i) = tallies.iter().position(|tally| tally.hits > tally.of) {
        let expected = format!("at most {} windows", tallies[i].of);
        return Err(Invalid::new(format!("tallies[{i}].hits"), expected, tallies[i].hits));
    }
    let (hits, windows) =
        tallies.iter().fold((0, 0), |(hits, of), tally| (hits + tally.hits, of + tally.of));
    if windows == 0 {
        return Ok(Estimate { value: 0.0, low: 0.0, high: 1.0 });
    }
    let value = hits as f64 / windows as f64;
    let squares: f64 = tallies.iter().map(|tally| tally.of as f64 * tally.of as f64).sum();
    let effective = windows as f64 * windows as f64 / squares;
    let (low, high) = clopper_pearson(value * effective, effective, confidence);
    Ok(Estimate { value, low: low.min(value), high: high.max(value) })
}

/// The mean of people's shares, each from 0 to 1. The interval treats the people as drawn from a
/// population and assumes nothing else. To compute it, half a person with share 0 and half a person
/// with share 1 are added. Student's interval of the mean is then clamped to [0, 1].
///
/// Without these two halves, the interval would be too short if nearly all people have the same
/// small share. Coverage was simulated for 5 to 50 people with 10 or 50 tasks each, for mean shares
/// of 0.03 to 0.5, and for people with similar and with different shares. The coverage of Student's
/// 95 % interval was 84 to 94 % on average and 50 % at worst. The coverage of the bootstrap was 76
/// to 93 % on average and 48 % at worst. The coverage of Korn and Graubard's interval with their
/// degrees of freedom was 95 to 97 % on average and 73 % at worst. The coverage of this function's
/// interval was at least 95 % in each case. The interval is a fifth to a half shorter than the
/// interval of [`share`]. If all shares are 0 or 1, and few are 1, its coverage is lower: 91 % with
/// a mean of 0.1 and 24 people.
///
/// Without people, the share is unknown: the value is 0 and the interval is [0, 1].
///
/// # Errors
/// [`Invalid`] if `confidence` is not in (0, 1), or if a share is not in [0, 1].
pub fn mean_share(shares: &[f64], confidence: f64) -> Result<Estimate, Invalid> {
    open_probability("confidence", confidence)?;
    if let Some(i) = shares.iter().position(|share| !(0.0..=1.0).contains(share)) {
        return Err(Invalid::new(format!("shares[{i}]"), "a number from 0 to 1", shares[i]));
    }
    if shares.is_empty() {
        return Ok(Estimate { value: 0.0, low: 0.0, high: 1.0 });
    }
    let (n, sum) = (shares.len() as f64, shares.iter().sum::<f64>());
    let (value, middle) = (sum / n, (sum + 0.5) / (n + 1.0));
    let square = |share: f64| (share - middle) * (share - middle);
    let squares: f64 = shares.iter().map(|share| square(*share)).sum();
    let variance = (squares + 0.5 * (square(0.0) + square(1.0))) / n;
    let half = student(confidence, n) * (variance / (n + 1.0)).sqrt();
    let (low, high) = ((middle - half).max(0.0), (middle + half).min(1.0));
    Ok(Estimate { value, low: low.min(value), high: high.max(value) })
}

/// The t for which P(|T| ≤ t) = `probability`, if T is Student's T with `freedom` degrees of
/// freedom.
fn student(probability: f64, freedom: f64) -> f64 {
    // T²/(T² + freedom) has a beta distribution.
    let part = beta_quantile(probability, 0.5, 0.5 * freedom);
    (freedom * part / (1.0 - part)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{SeededRng, exp, ln};

    /// Values of `scipy.stats.t.ppf` 1.17, and the interval computed from them with NumPy.
    #[test]
    fn intervals_over_people_have_the_values_of_scipy() {
        let quantiles = [
            (1.0, 12.706_204_736_174_694),
            (5.0, 2.570_581_835_636_314),
            (30.0, 2.042_272_456_301_238),
        ];
        for (freedom, expected) in quantiles {
            assert!((student(0.95, freedom) / expected - 1.0).abs() < 1e-9, "{freedom}");
        }
        let found = mean_share(&[0.0, 0.1, 0.2, 0.1, 0.6, 0.0, 0.05, 0.15], 0.95).unwrap();
        assert!((found.value - 0.15).abs() < 1e-15 && found.low == 0.0, "{found:?}");
        assert!((found.high - 0.403_547_076_936_435).abs() < 1e-9, "{found:?}");
        assert_eq!(mean_share(&[], 0.95).unwrap(), Estimate { value: 0.0, low: 0.0, high: 1.0 });
        let one = mean_share(&[0.5], 0.95).unwrap();
        assert_eq!((one.low, one.value, one.high), (0.0, 0.5, 1.0));
        assert_eq!(mean_share(&[0.5, 1.5], 0.95).unwrap_err().field, "shares[1]");
        assert_eq!(mean_share(&[0.5], 1.0).unwrap_err().field, "confidence");
    }

    /// A fifth of the people are often in danger, the others rarely. The mean share is
    /// 0.2 · 0.6 + 0.8 · 0.05 = 0.16.
    #[test]
    fn the_interval_over_people_covers_where_few_differ_from_all_others() {
        let (mut rng, draws, truth) = (SeededRng::new(11), 2000, 0.16);
        for people in [5, 8, 20, 50] {
            let mut person = || {
                let share = if rng.unit() < 0.2 { 0.6 } else { 0.05 };
                (0..50).filter(|_| rng.unit() < share).count() as f64 / 50.0
            };
            let covers = |_: &usize| {
                let shares: Vec<f64> = (0..people).map(|_| person()).collect();
                let found = mean_share(&shares, 0.95).unwrap();
                found.low <= truth && truth <= found.high
            };
            let covered = (0..draws).filter(covers).count() as f64 / draws as f64;
            // 0.01 is two standard errors.
            assert!(covered > 0.95 - 0.01, "{people}: {covered}");
        }
    }

    /// Each quantile x and P(X ≤ x), computed by mpmath with 30 digits.
    #[test]
    fn beta_meets_values_of_thirty_digits() {
        let cases = [
            (8.0, 3.0, 0.443905, 0.025000174807712144),
            (8.0, 3.0, 0.741425, 0.4999991796881024),
            (0.5, 0.5, 0.00615583, 0.050000001210974955),
            (95.0, 6.0, 0.897747, 0.05000119227529461),
            (95.0, 6.0, 0.977665, 0.9749994581579778),
            (301.0, 100.0, 0.707181, 0.02500059950997507),
            (2.5, 70.3, 0.0301605, 0.5000002395636055),
            (2.5, 70.3, 9.07539e-05, 9.999988972669457e-07),
        ];
        for (a, b, x, expected) in cases {
            let found = beta_cdf(x, a, b);
            assert!((found / expected - 1.0).abs() < 1e-12, "{a} {b} {x}: {found}");
            let back = beta_quantile(expected, a, b);
            assert!((back / x - 1.0).abs() < 1e-12, "{a} {b} {expected}: {back}");
        }
    }

    #[test]
    fn beta_meets_its_closed_forms() {
        for n in [1.0, 2.0, 7.0, 50.0, 400.0] {
            for x in [1e-6, 0.01, 0.3, 0.5, 0.9, 0.999] {
                let powers = exp(n * ln(1.0 - x));
                assert!((beta_cdf(x, 1.0, n) - (1.0 - powers)).abs() < 1e-13);
                let power = exp(n * ln(x));
                assert!((beta_cdf(x, n, 1.0) - power).abs() <= 1e-13 * power);
            }
        }
        assert_eq!((beta_cdf(-0.1, 2.0, 3.0), beta_cdf(1.1, 2.0, 3.0)), (0.0, 1.0));
        assert_eq!((beta_quantile(0.0, 2.0, 3.0), beta_quantile(1.0, 2.0, 3.0)), (0.0, 1.0));
    }

    /// Compares with I(x; a, 1) = xᵃ and I(x; 1, b) ≈ bx, down to the smallest probabilities.
    #[test]
    fn quantiles_of_tiny_probabilities_have_their_closed_forms() {
        for exponent in [-307, -299, -200, -100, -40, -19, -18, -17, -9] {
            let probability = exp(f64::from(exponent) * core::f64::consts::LN_10);
            for n in [1.0, 2.0, 30.0, 400.0, 5000.0] {
                let root = exp(ln(probability) / n);
                let found = beta_quantile(probability, n, 1.0);
                assert!((found / root - 1.0).abs() < 1e-9, "{exponent} {n}: {found} {root}");
                let found = beta_quantile(probability, 1.0, n);
                let expected = probability / n;
                assert!(
                    (found / expected - 1.0).abs() < 1e-6,
                    "{exponent} {n}: {found} {expected}"
                );
                let back = beta_cdf(beta_quantile(probability, n, 7.0), n, 7.0);
                assert!((back / probability - 1.0).abs() < 1e-9, "{exponent} {n}: {back}");
            }
        }
        assert!(beta_quantile(5e-324, 3.0, 3.0) < 1e-100);
    }

    /// Compares the tail probabilities with sums of binomial probabilities, and checks both ends.
    #[test]
    fn binomial_tails_are_sums() {
        for (n, p) in [(1, 0.3), (12, 0.75), (40, 0.9), (100, 0.05)] {
            let mut mass: f64 = exp(f64::from(n) * ln(1.0 - p));
            let mut below = 0.0;
            for k in 0..=n {
                let found = binomial_at_least(k as usize, n as usize, p);
                assert!((found - (1.0 - below)).abs() < 1e-12, "{n} {p} {k}");
                below += mass;
                mass *= f64::from(n - k) / f64::from(k + 1) * p / (1.0 - p);
            }
            assert_eq!(binomial_at_least(n as usize + 1, n as usize, p), 0.0);
        }
    }

    /// For no hits in n trials, the upper end is 1 − (α/2)^{1/n}, which is about 3.7/n for α = 5 %
    /// (one-sided: 3/n). The expected intervals for 8 of 10 and for 15 of 20 are in every textbook.
    #[test]
    fn clopper_pearson_meets_its_tables() {
        for n in [1.0, 10.0, 100.0, 3000.0] {
            let (low, high) = clopper_pearson(0.0, n, 0.95);
            assert_eq!(low, 0.0);
            assert!((high - (1.0 - exp(ln(0.025) / n))).abs() < 1e-13);
            let (one_sided, _) = clopper_pearson(n, n, 0.9);
            assert!((1.0 - one_sided) * n <= 3.0, "rule of three");
        }
        let near = |(low, high): (f64, f64), expected: (f64, f64)| {
            assert!((low - expected.0).abs() < 5e-5 && (high - expected.1).abs() < 5e-5);
        };
        near(clopper_pearson(8.0, 10.0, 0.95), (0.4439, 0.9748));
        near(clopper_pearson(15.0, 20.0, 0.95), (0.5090, 0.9134));
        near(clopper_pearson(5.0, 10.0, 0.95), (0.1871, 0.8129));
        assert_eq!(clopper_pearson(0.0, 0.0, 0.95), (0.0, 1.0));
    }

    /// The coverage of [`share`]'s interval over seeded draws of `trajectories`. In a proportion
    /// `alike` of the trajectories, all windows agree; in the others, they are independent.
    fn coverage(draws: usize, trajectories: usize, truth: f64, alike: f64) -> f64 {
        let mut rng = SeededRng::new(5);
        let mut covered = 0;
        for _ in 0..draws {
            let mut tally = |_| {
                let of = 1 + rng.below(40);
                let same = f64::from(rng.unit() < truth);
                let p = if rng.unit() < alike { same } else { truth };
                Tally { hits: (0..of).filter(|_| rng.unit() < p).count(), of }
            };
            let tallies: Vec<Tally> = (0..trajectories).map(&mut tally).collect();
            let found = share(&tallies, 0.9).unwrap();
            covered += usize::from(found.low <= truth && truth <= found.high);
        }
        covered as f64 / draws as f64
    }

    #[test]
    fn the_interval_covers_however_alike_windows_are() {
        let draws = 2000;
        let error = 3.0 * (0.9 * 0.1 / draws as f64).sqrt();
        for trajectories in [10, 30, 100] {
            for truth in [0.5, 0.75, 0.9] {
                for alike in [0.0, 0.2, 0.5, 1.0] {
                    let found = coverage(draws, trajectories, truth, alike);
                    let case = (trajectories, truth, alike);
                    assert!(found >= 0.9 - error, "{case:?}: {found}");
                }
            }
        }
    }

    #[test]
    fn alike_windows_say_no_more_than_one() {
        let alike = |windows: usize| -> Vec<Tally> {
            (0..40).map(|i| Tally { hits: if i < 30 { windows } else { 0 }, of: windows }).collect()
        };
        let (one, many) = (share(&alike(1), 0.95).unwrap(), share(&alike(41), 0.95).unwrap());
        assert_eq!(one.value, 0.75);
        assert_eq!((one.low, one.high), clopper_pearson(30.0, 40.0, 0.95));
        assert_eq!(one, many);
        let all = share(&[Tally { hits: 41, of: 41 }; 40], 0.95).unwrap();
        assert_eq!((all.low, all.high), clopper_pearson(40.0, 40.0, 0.95));
        let none = share(&[], 0.95).unwrap();
        assert_eq!((none.low, none.high), (0.0, 1.0));
        let lone = share(&[Tally { hits: 3, of: 4 }], 0.95).unwrap();
        assert_eq!((lone.value, lone.high), (0.75, clopper_pearson(0.75, 1.0, 0.95).1));
    }

    #[test]
    fn complaints_name_the_field() {
        for confidence in [0.0, 1.0, -1.0, f64::NAN] {
            assert_eq!(share(&[], confidence).unwrap_err().field, "confidence");
        }
        let wrong = share(&[Tally::default(), Tally { hits: 2, of: 1 }], 0.9).unwrap_err();
        assert_eq!(wrong.to_string(), "tallies[1].hits: expected at most 1 windows, found 2");
    }
}
