//! Two lists of numbers, one each a person: how far they are apart, and how sure that is.

use crate::report::Analysis;
use sidestep::comparison::avoidance::{Avoidance, Distances};
use sidestep::comparison::cell::{Cell, Experiment, ModelName};
use sidestep::comparison::tables::Metric;
use sidestep::stats::rank::{hodges_lehmann, wilcoxon};

/// A difference is shown where the p-value is below this.
pub(super) const LEVEL: f64 = 0.05;

/// How much better the first of two is, person by person.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::report) struct Paired {
    /// A number each person, in order; more is better.
    pub(in crate::report) gains: Vec<f64>,
    /// Their mean.
    pub(in crate::report) mean: f64,
    /// The typical one (Hodges–Lehmann), which the test is about.
    pub(in crate::report) typical: f64,
    /// What the paired test at 5 % does not reject as the typical gain; none where people are too
    /// few for it to reject anything.
    pub(in crate::report) interval: Option<[f64; 2]>,
    /// Of Wilcoxon's signed-rank test.
    pub(in crate::report) p: f64,
}

impl Paired {
    /// Of these numbers of the same people; none if there are none.
    pub(in crate::report) fn of(first: &[f64], second: &[f64]) -> Option<Self> {
        let p = wilcoxon(first, second).ok()?;
        let gains: Vec<f64> = first.iter().zip(second).map(|(a, b)| a - b).collect();
        let mean = mean(&gains);
        Some(Self { interval: interval(&gains), typical: hodges_lehmann(&gains), gains, mean, p })
    }

    /// How many people gain.
    pub(super) fn better(&self) -> usize {
        self.gains.iter().filter(|gain| **gain > 1e-12).count()
    }
}

pub(super) fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len().max(1) as f64
}

/// The smallest p-value that the paired test can give with so many people.
pub(super) fn least_p(people: usize) -> f64 {
    (2.0 * 0.5f64.powi(people.min(1000) as i32)).min(1.0)
}

/// Whether no paired test of so many people can show anything.
pub(super) fn too_few(people: usize) -> bool {
    least_p(people) >= LEVEL
}

/// The fewest people with whom the smallest p-value, times `tests`, is below [`LEVEL`].
pub(super) fn people_needed(tests: usize) -> usize {
    (1..60).find(|n| least_p(*n) * tests.max(1) as f64 <= LEVEL).unwrap_or(60)
}

/// All shifts of the differences that the test does not reject (Hodges and Lehmann, Annals of
/// Mathematical Statistics 34, 1963): between two of the means of pairs of differences, where
/// alone the rank sums change.
fn interval(differences: &[f64]) -> Option<[f64; 2]> {
    let pairs = differences.iter().enumerate();
    let mut means: Vec<f64> =
        pairs.flat_map(|(i, a)| differences[i..].iter().map(move |b| 0.5 * (a + b))).collect();
    means.sort_by(f64::total_cmp);
    means.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    let rejected = |shift: f64| {
        let shifted: Vec<f64> = differences.iter().map(|d| d - shift).collect();
        wilcoxon(&shifted, &vec![0.0; shifted.len()]).is_ok_and(|p| p <= LEVEL)
    };
    let (first, last) = (*means.first()?, *means.last()?);
    if !rejected(first - 1.0) || !rejected(last + 1.0) {
        return None;
    }
    let between = |pair: &[f64]| rejected(0.5 * (pair[0] + pair[1]));
    let gaps: Vec<&[f64]> = means.windows(2).collect();
    // Rejected, then not, then rejected: only below and above the middle is it sorted.
    let (below, above) = gaps.split_at(gaps.len() / 2);
    let lowest = below.partition_point(|gap| between(gap));
    let highest = gaps.len() / 2 + above.partition_point(|gap| !between(gap));
    Some([means[lowest], means[highest]])
}

impl Analysis {
    /// Accuracy of each person's model, in per cent.
    pub(in crate::report) fn person_accuracies(
        &self,
        model: ModelName,
        experiment: Experiment,
        set: &str,
    ) -> Vec<f64> {
        let cells = self.comparison.of(model, experiment, set);
        cells.map(|cell| 100.0 * cell.test.accuracy()).collect()
    }

    /// Accuracy of each person's commonest input, in per cent.
    pub(super) fn person_baselines(&self, experiment: Experiment) -> Vec<f64> {
        let place = usize::from(experiment == Experiment::Avoidance);
        self.baselines[place].iter().map(|test| 100.0 * test.accuracy()).collect()
    }

    /// D_start or D_end of each person's model, penalised, in steps; or the accuracy.
    pub(in crate::report) fn person_metric(
        &self,
        metric: Metric,
        model: ModelName,
        set: &str,
    ) -> Vec<f64> {
        let of = |cell: &Cell| {
            let steps = self.comparison.participants[cell.participant].steps.max(1);
            let avoids = |classes: &[i8]| Avoidance::of(classes.iter().map(|&class| class != 0));
            let humans = cell.test.truth.chunks(steps).map(avoids);
            let both: Vec<_> = humans.zip(cell.test.predicted.chunks(steps).map(avoids)).collect();
            let found = Distances::of(steps, &both);
            match metric {
                Metric::Accuracy => 100.0 * cell.test.accuracy(),
                Metric::Start => found.start_penalised,
                Metric::End => found.end_penalised,
            }
        };
        self.comparison.of(model, Experiment::Avoidance, set).map(of).collect()
    }

    /// How many people are compared.
    pub(super) fn people(&self) -> usize {
        self.comparison.participants.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By scipy-independent hand: of 21 means of pairs none can be left out with six people, so
    /// that the interval is from the least to the greatest difference.
    #[test]
    fn with_six_people_the_interval_is_the_range() {
        let gains = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
        let found = Paired::of(&gains, &[0.0; 6]).unwrap();
        assert_eq!(found.interval, Some([1.0, 32.0]));
        assert_eq!((found.p, found.mean, found.better()), (0.03125, 10.5, 6));
        assert_eq!(Paired::of(&gains[..5], &[0.0; 5]).unwrap().interval, None);
        assert_eq!(Paired::of(&[], &[]), None);
    }

    /// The interval holds just what a test of each shift does not reject.
    #[test]
    fn the_interval_is_what_the_test_does_not_reject() {
        let gains = [3.0, -1.0, 2.5, 7.0, 0.5, 4.2, 3.3, 1.9, -0.4, 6.1];
        let [low, high] = interval(&gains).unwrap();
        let p = |shift: f64| wilcoxon(&gains.map(|gain| gain - shift), &[0.0; 10]).unwrap();
        for i in 0..400 {
            let shift = -3.0 + 0.0301 * f64::from(i);
            assert_eq!(p(shift) > LEVEL, (low..=high).contains(&shift), "{shift}: {low} to {high}");
        }
    }

    #[test]
    fn people_that_a_test_needs() {
        assert_eq!((least_p(5), least_p(6)), (0.0625, 0.03125));
        assert_eq!((people_needed(1), people_needed(48)), (6, 11));
    }
}
