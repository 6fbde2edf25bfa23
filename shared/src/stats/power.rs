//! The power of Wilcoxon's signed-rank test: the probability that the test shows an effect of a
//! given size.

use super::rank::is_shown;
use crate::math::{SeededRng, cos, ln, sin};
use core::f64::consts::TAU;

/// Number of samples. The estimated power has a standard error of at most 0.005.
const DRAWS: usize = 10_000;

/// The power of the test for each number of people, from 1 to a maximum. Differences are normally
/// distributed, and their mean is `effect` standard deviations. The power is estimated from samples
/// that are drawn with a fixed seed. For n people, the first n values of each sample are used. The
/// null distribution is exact.
#[derive(Clone, Debug, PartialEq)]
pub struct PowerCurve {
    /// For each number of people, starting at 1: the possible p-values below the level, in
    /// ascending order. Each p-value is paired with the share of samples whose p-value is not
    /// larger.
    by_people: Vec<Vec<(f64, f64)>>,
}

impl PowerCurve {
    /// Estimates the curve for up to `most_people` people. `effect` is d_z, the mean divided by the
    /// standard deviation.
    #[must_use]
    pub fn of(effect: f64, most_people: usize) -> Self {
        let found = rank_sums(effect, most_people);
        // The number of subsets of the ranks 1 to n, for each possible sum.
        let mut ways = vec![1.0];
        let by_people = found.into_iter().enumerate().map(|(i, counts)| {
            let rank = i + 1;
            ways.resize(ways.len() + rank, 0.0);
            for sum in (rank..ways.len()).rev() {
                ways[sum] += ways[sum - rank];
            }
            let total: f64 = ways.iter().sum();
            let greatest = ways.len() - 1;
            let (mut p, mut rejected) = (0.0, 0);
            let mut chances = Vec::new();
            for sum in 0..greatest.div_ceil(2) {
                p += 2.0 * ways[sum] / total;
                if !is_shown(p) {
                    break;
                }
                rejected += counts[sum] + counts[greatest - sum];
                chances.push((p, f64::from(rejected) / DRAWS as f64));
            }
            chances
        });
        Self { by_people: by_people.collect() }
    }

    /// The probability that this many people show the effect in a test whose p-value is multiplied
    /// by `family`, as Holm's correction does with the smallest p-value of `family` tests. For more
    /// people than the curve's maximum, returns the power at the maximum.
    #[must_use]
    pub fn power(&self, people: usize, family: usize) -> f64 {
        let Some(place) = people.min(self.by_people.len()).checked_sub(1) else { return 0.0 };
        let of = &self.by_people[place];
        let shown = of.partition_point(|(p, _)| is_shown(p * family as f64));
        shown.checked_sub(1).map_or(0.0, |last| of[last].1)
    }

    /// The smallest number of people with at least this power. `None` if even the curve's maximum
    /// does not suffice.
    #[must_use]
    pub fn people(&self, power: f64, family: usize) -> Option<usize> {
        (1..=self.by_people.len()).find(|people| self.power(*people, family) >= power)
    }
}

/// For each number of people, the number of samples with each rank sum of positive differences.
fn rank_sums(effect: f64, most_people: usize) -> Vec<Vec<u32>> {
    let mut counts: Vec<Vec<u32>> =
        (1..=most_people).map(|n| vec![0; n * (n + 1) / 2 + 1]).collect();
    let mut rng = SeededRng::new(1);
    let mut sample = Vec::with_capacity(most_people + 1);
    for _ in 0..DRAWS {
        sample.clear();
        let mut sum = 0;
        while sample.len() < most_people {
            // The Box–Muller transform (Annals of Mathematical Statistics 29, 1958) gives two
            // normal numbers.
            let (radius, angle) = ((-2.0 * ln(1.0 - rng.unit())).sqrt(), TAU * rng.unit());
            for normal in [radius * cos(angle), radius * sin(angle)] {
                if sample.len() == most_people {
                    break;
                }
                let new = effect + normal;
                sample.push(new);
                // The rank sum is the number of positive pairwise means (Tukey). Count the means
                // that include the new value.
                sum += sample.iter().map(|of| usize::from(of + new > 0.0)).sum::<usize>();
                counts[sample.len() - 1][sum] += 1;
            }
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{rank::wilcoxon, upper_tail};

    /// In these cases, an effect is shown only if all n people gain or all lose. The power is then
    /// Φ(d)ⁿ + (1 − Φ(d))ⁿ.
    #[test]
    fn the_least_sample_that_can_show_something_has_a_closed_form() {
        let curve = PowerCurve::of(0.8, 12);
        let gains = 1.0 - upper_tail(0.8);
        // 2/2⁵ is not below 0.05, but 2/2⁶ and 48 · 2/2¹¹ are.
        assert_eq!([curve.power(5, 1), curve.power(10, 48), curve.power(0, 1)], [0.0; 3]);
        for (people, family) in [(6, 1), (11, 48)] {
            let all = |chance: f64| (0..people).fold(1.0, |product, _| product * chance);
            let expected = all(gains) + all(1.0 - gains);
            let found = curve.power(people, family);
            assert!((found - expected).abs() < 0.01, "{people}: {found} {expected}");
        }
        assert_eq!(PowerCurve::of(0.8, 0).power(5, 1), 0.0);
    }

    /// Without an effect, the power equals the level of the test. For n = 8, P(W ≤ 3) = 5/256 per
    /// side.
    #[test]
    fn without_an_effect_it_is_the_level() {
        let curve = PowerCurve::of(0.0, 8);
        assert!((curve.power(8, 1) - 10.0 / 256.0).abs() < 0.006, "{}", curve.power(8, 1));
    }

    /// Compares the power with the share of other samples that [`wilcoxon`] rejects.
    #[test]
    fn it_is_the_share_of_samples_that_the_test_rejects() {
        let curve = PowerCurve::of(0.8, 30);
        let mut rng = SeededRng::new(99);
        let mut normal = || (0..12).map(|_| rng.unit()).sum::<f64>() - 6.0;
        for (people, family) in [(11, 1), (20, 48), (30, 6)] {
            let draws = 1000;
            let rejects = |_: &usize| {
                // A sum of twelve uniform numbers is nearly normal, with variance 1.
                let sample: Vec<f64> = (0..people).map(|_| 0.8 + normal()).collect();
                wilcoxon(&sample, &vec![0.0; people]).unwrap() * f64::from(family) < 0.05
            };
            let share = (0..draws).filter(rejects).count() as f64 / draws as f64;
            let found = curve.power(people, family as usize);
            assert!((share - found).abs() < 0.05, "{people}: {share} {found}");
        }
    }

    #[test]
    fn more_people_show_more() {
        let curve = PowerCurve::of(0.8, 60);
        assert!(curve.power(60, 48) > 0.95 && curve.power(90, 48) == curve.power(60, 48));
        let needed = curve.people(0.8, 48).unwrap();
        assert!(curve.power(needed, 48) >= 0.8 && curve.power(needed - 1, 48) < 0.8);
        assert_eq!(curve.people(1.1, 1), None);
    }
}
