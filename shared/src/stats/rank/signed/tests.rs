use super::*;
use crate::math::SeededRng;
use crate::stats::rank::LEVEL;
use proptest::prelude::*;

/// By hand: the differences are 3, −1 and 2, and the ranks of their absolute values are 3, 1 and 2.
#[test]
fn the_effect_size_is_the_balance_of_ranks() {
    assert!((rank_biserial(&[5.0, 1.0, 4.0], &[2.0, 2.0, 2.0]) - 4.0 / 6.0).abs() < 1e-15);
    assert_eq!(rank_biserial(&[1.0, 2.0], &[0.0, 0.0]), 1.0);
    assert_eq!(rank_biserial(&[0.0, 1.0], &[1.0, 2.0]), -1.0);
    assert_eq!(rank_biserial(&[1.0, 2.0], &[1.0, 2.0]), 0.0);
    assert_eq!(rank_biserial(&[], &[]), 0.0);
}

#[test]
fn the_typical_difference_is_no_mean() {
    assert_eq!(hodges_lehmann(&[]), 0.0);
    assert_eq!(hodges_lehmann(&[3.0]), 3.0);
    // The Walsh averages of 1, 2, 4 are 1, 1.5, 2, 2.5, 3, 4. The median is taken by hand.
    assert_eq!(hodges_lehmann(&[4.0, 1.0, 2.0]), 2.25);
    // A single large loss does not outweigh nineteen gains.
    let mut gains = vec![2.0; 19];
    gains.push(-100.0);
    assert!(gains.iter().sum::<f64>() < 0.0);
    assert_eq!(hodges_lehmann(&gains), 2.0);
}

/// The p-value of a shift by brute force. It counts the pairwise means above the shift, where a tie
/// counts one half. It compares this count with the rank sums for all choices of signs (`null`,
/// sorted). Both are doubled, so that halves become integers.
fn plain_p(differences: &[f64], null: &[usize], shift: f64) -> f64 {
    let mut sum = 0;
    for i in 0..differences.len() {
        for j in i..differences.len() {
            let beyond = differences[i] + differences[j] - 2.0 * shift;
            sum += if beyond.abs() <= 2.0 * TIE { 1 } else { 2 * usize::from(beyond > 0.0) };
        }
    }
    let (below, above) = (null.partition_point(|s| *s <= sum), null.partition_point(|s| *s < sum));
    let least = below.min(null.len() - above);
    (2.0 * least as f64 / null.len() as f64).min(1.0)
}

/// Twice the rank sum of the positive differences, for each choice of signs.
fn plain_null(differences: &[f64]) -> Vec<usize> {
    let doubled_rank = |d: &f64| {
        let size = |other: &&f64| other.abs() - d.abs();
        let below = differences.iter().filter(|other| size(other) < -TIE).count();
        let tied = differences.iter().filter(|other| size(other).abs() <= TIE).count();
        2 * below + tied + 1
    };
    let mut sums = vec![0];
    for rank in differences.iter().map(doubled_rank) {
        sums = sums.iter().flat_map(|sum| [*sum, sum + rank]).collect();
    }
    sums.sort_unstable();
    sums
}

/// Checks invariants that hold for every sample.
fn check_sample(all: &[f64]) -> SignedRank {
    let found = SignedRank::of(all).unwrap();
    let shown = found.p < LEVEL;
    assert_eq!(found.p, wilcoxon(all, &vec![0.0; all.len()]).unwrap(), "{all:?}");
    assert_eq!(found.differing, all.iter().filter(|d| d.abs() > TIE).count());
    let said = format!("{all:?}: {found:?}");
    if shown {
        assert!(found.rank_biserial * found.typical.signum() > 0.0, "{said}");
    } else {
        assert!(found.rank_biserial * found.typical >= 0.0, "{said}");
    }
    let Some([low, high]) = found.interval else {
        assert!(found.differing < 6 && !shown, "{said}");
        return found;
    };
    assert!(low <= found.typical && found.typical <= high, "{said}");
    assert_eq!((low..=high).contains(&0.0), !shown, "{said}");
    found
}

/// Differences in steps of 0.2 points, rounded like differences of percentages.
fn samples() -> impl Strategy<Value = Vec<f64>> {
    let sample = (4usize..=40, 0.0..0.8f64, 1i32..60, -30i32..30, any::<u64>());
    sample.prop_map(|(n, ties, spread, middle, seed)| {
        let mut rng = SeededRng::new(seed);
        let mut one = |_| {
            let steps = middle + rng.below(2 * spread as usize + 1) as i32 - spread;
            let steps = if rng.unit() < ties { 0 } else { steps };
            let second = rng.below(400) as i32;
            100.0 * (f64::from(steps + second) / 500.0) - 100.0 * (f64::from(second) / 500.0)
        };
        (0..n).map(&mut one).collect()
    })
}

/// Data of a study in which 18 of 24 people turned in only one step. Six people gain, and nobody
/// loses.
#[test]
fn those_who_tie_do_not_turn_those_who_gain() {
    let mut gains = vec![0.0; 24];
    gains[..6].copy_from_slice(&[10.0, 14.0, 8.0, 12.0, 20.0, 7.333_333_333_333_333]);
    let found = check_sample(&gains);
    assert_eq!((found.differing, found.p, found.rank_biserial), (6, 0.03125, 1.0));
    // The results are the same as for the six differences alone. The interval is their range, and
    // the typical difference is the median of 21 means, computed by hand.
    assert_eq!(found.interval, Some([7.333_333_333_333_333, 20.0]));
    assert!((found.typical - 11.0).abs() < 1e-9, "{found:?}");
    assert_eq!(SignedRank::of(&gains[..6]).unwrap(), found);
}

/// Of 60 people, 40 gain two points and 20 lose two. All ranks are tied, so the test is the sign
/// test, and most pairwise means are 0. The interval then begins just above 0.
#[test]
fn an_end_at_zero_is_on_the_side_of_the_test() {
    let gains: Vec<f64> = (0..60).map(|i| if i < 40 { 2.0 } else { -2.0 }).collect();
    let found = check_sample(&gains);
    // Twice the probability of at most 20 heads in 60 throws, computed by summing binomial
    // probabilities.
    assert!((found.p - 0.013_489_293_731_191_86).abs() < 1e-12, "{}", found.p);
    assert_eq!(
        (found.typical, found.interval),
        (f64::MIN_POSITIVE, Some([f64::MIN_POSITIVE, 2.0]))
    );
    let losses: Vec<f64> = gains.iter().map(|gain| -gain).collect();
    assert_eq!(check_sample(&losses).interval, Some([-2.0, -f64::MIN_POSITIVE]));
}

#[test]
fn extremes() {
    let all_equal = check_sample(&[0.4; 12]);
    assert_eq!((all_equal.typical, all_equal.interval), (0.4, Some([0.4, 0.4])));
    let nobody = check_sample(&[0.0; 30]);
    assert_eq!((nobody.differing, nobody.p, nobody.typical, nobody.interval), (0, 1.0, 0.0, None));
    assert_eq!(nobody.rank_biserial, 0.0);
    assert_eq!(check_sample(&[1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0]).interval, None);
    assert_eq!(SignedRank::of(&[]).unwrap_err().field, "differences");
    assert_eq!(SignedRank::of(&[1.0, f64::NAN]).unwrap_err().field, "differences[1]");
    // Above 60 differences, the test uses the normal approximation.
    let many: Vec<f64> = (0..200).map(|i| 0.2 * f64::from(i * 37 % 90 - 40)).collect();
    let found = check_sample(&many);
    assert!(found.differing < 200 && found.interval.is_some());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn test_estimate_and_interval_never_contradict_each_other(all in samples()) {
        check_sample(&all);
        let opposite: Vec<f64> = all.iter().map(|d| -d).collect();
        let (one, other) = (SignedRank::of(&all).unwrap(), SignedRank::of(&opposite).unwrap());
        prop_assert_eq!(one.p, other.p);
        prop_assert_eq!(one.rank_biserial, -other.rank_biserial);
        prop_assert!((one.typical + other.typical).abs() < 1e-12);
    }

    /// There are few distinct values, so nearly all values are tied.
    #[test]
    fn nor_where_hardly_any_two_numbers_differ(
        all in prop::collection::vec(-2i32..=2, 4..70).prop_map(|all| {
            all.into_iter().map(|step| 0.2 * f64::from(step)).collect::<Vec<f64>>()
        })
    ) {
        check_sample(&all);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// The interval contains exactly the shifts that the brute-force test does not reject, checked on
    /// a fine grid that avoids all pairwise means.
    #[test]
    fn the_interval_is_what_every_choice_of_signs_says(all in samples()) {
        let all: Vec<f64> = all.into_iter().take(13).collect();
        let found = check_sample(&all);
        let kept: Vec<f64> = all.iter().copied().filter(|d| d.abs() > TIE).collect();
        let null = plain_null(&kept);
        prop_assert!((found.p - plain_p(&kept, &null, 0.0)).abs() < 1e-12);
        if let Some([low, high]) = found.interval {
            let mut shift = low - 1.0125;
            while shift < high + 1.0 {
                let inside = low <= shift && shift <= high;
                prop_assert_eq!(plain_p(&kept, &null, shift) >= LEVEL, inside, "{} {:?}", shift, found);
                shift += 0.05;
            }
        }
    }
}
