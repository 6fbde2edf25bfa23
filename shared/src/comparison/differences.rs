//! Tests of the differences between feature sets.

use super::cell::{Experiment, ModelName};
use super::gains::{Gain, Paired};
use super::tables::{Comparison, Metric, mean};
use crate::invalid::Invalid;
use crate::stats::rank::{hodges_lehmann, holm, mann_whitney, wilcoxon};

/// How two feature sets differ in one model, experiment and metric.
#[derive(Clone, Debug, PartialEq)]
pub struct Test {
    /// The set whose gain it is.
    pub first: &'static str,
    /// The set that it is compared with.
    pub second: &'static str,
    /// The gain with the paired test over participants, the one that fits this design. Holm's
    /// correction is over all tests of the metric.
    pub gain: Gain,
    /// p-value of the Mann–Whitney test over participants.
    pub mann_whitney_persons: f64,
    /// p-value of the Mann–Whitney test over the test trajectories of all participants, which are
    /// not independent.
    pub mann_whitney_trajectories: f64,
    /// [`Self::mann_whitney_persons`] after Holm.
    pub mann_whitney_persons_holm: f64,
    /// [`Self::mann_whitney_trajectories`] after Holm.
    pub mann_whitney_trajectories_holm: f64,
}

/// The pairs of sets that the paper's claims are about: each set with a safety level against
/// distance alone, both levels against both and distance, and the one level against the other.
pub const PAIRS: [(&str, &str); 8] = [
    ("hrd", "d"),
    ("hr", "d"),
    ("hd", "d"),
    ("rd", "d"),
    ("h", "d"),
    ("r", "d"),
    ("hrd", "hr"),
    ("h", "r"),
];

/// Tests of every model, experiment, metric and pair of [`PAIRS`].
///
/// # Errors
/// [`Invalid`] if there is no participant.
pub fn tests(comparison: &Comparison) -> Result<Vec<Test>, Invalid> {
    let mut tests = Vec::new();
    for metric in [Metric::Accuracy, Metric::Start, Metric::End] {
        let begin = tests.len();
        for model in ModelName::PAPERS {
            for experiment in Experiment::ALL {
                if metric != Metric::Accuracy && experiment == Experiment::TurnDirection {
                    continue;
                }
                for pair in PAIRS {
                    tests.push(test(comparison, model, experiment, metric, pair)?);
                }
            }
        }
        let family = &mut tests[begin..];
        let corrected = |p: fn(&Test) -> f64, family: &[Test]| {
            holm(&family.iter().map(p).collect::<Vec<f64>>())
        };
        let paired = corrected(|test| test.gain.paired.p, family);
        let persons = corrected(|test| test.mann_whitney_persons, family);
        let trajectories = corrected(|test| test.mann_whitney_trajectories, family);
        for (i, test) in family.iter_mut().enumerate() {
            test.gain.holm = paired[i];
            test.mann_whitney_persons_holm = persons[i];
            test.mann_whitney_trajectories_holm = trajectories[i];
        }
    }
    Ok(tests)
}

fn test(
    comparison: &Comparison,
    model: ModelName,
    experiment: Experiment,
    metric: Metric,
    (first, second): (&'static str, &'static str),
) -> Result<Test, Invalid> {
    let trajectories = |set| -> Vec<Vec<f64>> {
        let cells = comparison.of(model, experiment, set);
        cells.map(|cell| comparison.by_trajectory(metric, cell)).collect()
    };
    let [one, other] = [first, second].map(trajectories);
    let persons = |of: &[Vec<f64>]| -> Vec<f64> {
        of.iter().map(|trajectories| mean(trajectories.iter().copied())).collect()
    };
    let (one_persons, other_persons) = (persons(&one), persons(&other));
    let higher = mean(one_persons.iter().copied()) - mean(other_persons.iter().copied());
    let pairs = one_persons.iter().zip(&other_persons);
    let differences: Vec<f64> = pairs.map(|(a, b)| a - b).collect();
    let better = |difference: f64| if metric.less_is_better() { -difference } else { difference };
    // The participants' gains over all their test rows at once, which differ from the means over
    // their trajectories in the last digits only.
    let pooled = |set| comparison.person_metric(metric, model, experiment, set);
    let (pooled_first, pooled_second) = (pooled(first), pooled(second));
    let pooled = match metric.less_is_better() {
        true => Paired::of(&pooled_second, &pooled_first),
        false => Paired::of(&pooled_first, &pooled_second),
    };
    let (gains, interval) = pooled.map_or((Vec::new(), None), |of| (of.gains, of.interval));
    let paired = Paired {
        gains,
        mean: better(higher),
        typical: better(hodges_lehmann(&differences)),
        interval,
        p: wilcoxon(&one_persons, &other_persons)?,
    };
    Ok(Test {
        first,
        second,
        gain: Gain { model, experiment, metric, paired, holm: 1.0 },
        mann_whitney_persons: mann_whitney(&one_persons, &other_persons)?,
        mann_whitney_trajectories: mann_whitney(&one.concat(), &other.concat())?,
        mann_whitney_persons_holm: 1.0,
        mann_whitney_trajectories_holm: 1.0,
    })
}
