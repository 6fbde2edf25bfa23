//! How much better one feature set is than another for each participant, and how strong the
//! evidence for this is: the paper's tests, further families of tests, and the ablation.

use super::cell::Experiment;
use super::models::ModelName;
use super::sets::PAPERS_SETS;
use super::tables::{Comparison, Metric, Pooled, mean};
use crate::invalid::{Invalid, length};
use crate::stats::rank::{SignedRank, TIE, holm, is_shown, mann_whitney};
use serde::Serialize;

pub use super::power::Power;
pub use crate::stats::rank::LEVEL;

/// How much better the first of two lists is than the second. Each list has one number per
/// participant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Paired {
    /// The gain of each participant, in order. It is positive if the first list is better.
    pub gains: Vec<f64>,
    /// Mean over participants.
    pub mean: f64,
    /// The number of participants with a gain or a loss. The other participants do equally well
    /// with both lists. The paired test, the typical gain, its interval and the effect size ignore
    /// these other participants.
    pub differing: usize,
    /// The typical gain: the Hodges–Lehmann estimate, which matches the paired test.
    pub typical: f64,
    /// The interval of all typical gains that the paired test does not reject at 5 %. `None` if too
    /// few participants differ for the test to reject anything. The interval always contains
    /// [`Self::typical`]. It contains 0 if and only if the test does not reject.
    pub interval: Option<[f64; 2]>,
    /// Two-sided p-value of Wilcoxon's signed-rank test.
    pub p: f64,
    /// The test's effect size, from −1 to 1: the matched-pairs rank-biserial correlation.
    pub rank_biserial: f64,
    /// Number of participants with a gain.
    pub better: usize,
    /// Whether p is below [`LEVEL`], but the mean and the effect size have opposite signs. Large
    /// changes of a few participants can cause this.
    pub contrary: bool,
}

impl Paired {
    /// Compares two lists for the same participants; larger numbers are better.
    ///
    /// # Errors
    /// [`Invalid`] if there is no participant, or the lists differ in length.
    pub fn of(first: &[f64], second: &[f64]) -> Result<Self, Invalid> {
        length("second", first.len(), second.len())?;
        let gains: Vec<f64> = first.iter().zip(second).map(|(a, b)| a - b).collect();
        let test = SignedRank::of(&gains)?;
        let mean = untied(mean(gains.iter().copied()));
        let better = gains.iter().filter(|gain| **gain > TIE).count();
        let against = mean * test.rank_biserial < 0.0;
        Ok(Self {
            gains,
            mean,
            differing: test.differing,
            typical: test.typical,
            interval: test.interval,
            p: test.p,
            rank_biserial: test.rank_biserial,
            better,
            contrary: is_shown(test.p) && against,
        })
    }

    /// The test's conclusion for this p-value, which is either raw or corrected.
    fn direction(&self, p: f64) -> Direction {
        match is_shown(p) {
            true if self.rank_biserial > 0.0 => Direction::Better,
            true => Direction::Worse,
            false => Direction::Open,
        }
    }
}

/// A test's conclusion about a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// p is below [`LEVEL`], and the rank sum of the gains exceeds the rank sum of the losses.
    Better,
    /// p is below [`LEVEL`], and the rank sum of the losses exceeds the rank sum of the gains.
    Worse,
    /// p is not below [`LEVEL`].
    Open,
}

/// The gain of one feature set over another in one model and experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gain {
    /// The model.
    pub model: ModelName,
    /// The experiment.
    pub experiment: Experiment,
    /// The compared quantity: accuracy or a distance in steps.
    pub metric: Metric,
    /// The gains of the participants, with their paired test.
    pub paired: Paired,
    /// The test's p-value after Holm's correction over its family.
    pub holm: f64,
    /// The conclusion before correction.
    pub before: Direction,
    /// The conclusion after correction.
    pub after: Direction,
}

/// Corrects the p-values of these tests together.
pub(super) fn corrected(of: Vec<(ModelName, Experiment, Metric, Paired)>) -> Vec<Gain> {
    let p_values: Vec<f64> = of.iter().map(|(.., paired)| paired.p).collect();
    let gain = |((model, experiment, metric, paired), holm): ((_, _, _, Paired), f64)| {
        let (before, after) = (paired.direction(paired.p), paired.direction(holm));
        Gain { model, experiment, metric, paired, holm, before, after }
    };
    of.into_iter().zip(holm(&p_values)).map(gain).collect()
}

/// Tests of one feature set against another. They are corrected together.
#[derive(Clone, Debug, PartialEq)]
pub struct GainFamily {
    /// The set whose gain over the reference set is tested.
    pub first: &'static str,
    /// The reference set; `none` for the baseline.
    pub second: &'static str,
    /// One gain per experiment and model of the paper.
    pub gains: Vec<Gain>,
}

impl GainFamily {
    /// The gains in accuracy of `first` over `second`. `accuracies` returns the accuracy of each
    /// participant for a model, an experiment and a set.
    ///
    /// # Errors
    /// [`Invalid`] if there is no participant.
    pub(super) fn of(
        (first, second): (&'static str, &'static str),
        accuracies: impl Fn(Option<ModelName>, Experiment, &str) -> Vec<f64>,
    ) -> Result<Self, Invalid> {
        let mut all = Vec::new();
        for experiment in Experiment::ALL {
            for model in ModelName::PAPERS {
                let [first, second] =
                    [first, second].map(|set| accuracies(Some(model), experiment, set));
                let paired = Paired::of(&first, &second)?;
                all.push((model, experiment, Metric::Accuracy, paired));
            }
        }
        Ok(Self { first, second, gains: corrected(all) })
    }
}

/// The tests of two feature sets for one model, experiment and metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Test {
    /// The set whose gain over the reference set is tested.
    pub first: &'static str,
    /// The reference set.
    pub second: &'static str,
    /// The gain, with the paired test over participants. The paired test fits the design of the
    /// study. Holm's correction covers all tests of the metric.
    pub gain: Gain,
    /// p-value of the Mann–Whitney test over participants.
    pub mann_whitney_persons: f64,
    /// p-value of the Mann–Whitney test over the test trajectories of all participants. These
    /// trajectories are not independent.
    pub mann_whitney_trajectories: f64,
    /// [`Self::mann_whitney_persons`] after Holm's correction.
    pub mann_whitney_persons_holm: f64,
    /// [`Self::mann_whitney_trajectories`] after Holm's correction.
    pub mann_whitney_trajectories_holm: f64,
}

/// The pairs of sets in the paper's claims. They test each set that has a safety level against
/// distance alone, both levels and distance against both levels alone, and one level against the
/// other.
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

/// Tests each pair of [`PAIRS`] for every model, experiment and metric. The correction covers all
/// tests of one metric.
///
/// # Errors
/// [`Invalid`] if there is no participant.
pub fn papers_tests(comparison: &Comparison) -> Result<Vec<Test>, Invalid> {
    let mut tests = Vec::new();
    for metric in [Metric::Accuracy, Metric::Start, Metric::End] {
        let (mut pairs, mut differences) = (Vec::new(), Vec::new());
        let (mut persons, mut trajectories) = (Vec::new(), Vec::new());
        for model in ModelName::PAPERS {
            for experiment in Experiment::ALL {
                if metric != Metric::Accuracy && experiment == Experiment::TurnDirection {
                    continue;
                }
                for (first, second) in PAIRS {
                    let numbers = [first, second].map(|set| {
                        let cells = comparison.of(model, experiment, set);
                        cells.map(|cell| comparison.by_trajectory(metric, cell)).collect::<Vec<_>>()
                    });
                    let means = numbers.each_ref().map(|of| -> Vec<f64> {
                        of.iter().map(|numbers| mean(numbers.iter().copied())).collect()
                    });
                    let [better, worse] = match metric.less_is_better() {
                        true => [&means[1], &means[0]],
                        false => [&means[0], &means[1]],
                    };
                    pairs.push((first, second));
                    differences.push((model, experiment, metric, paired(better, worse)?));
                    persons.push(mann_whitney(&means[0], &means[1])?);
                    trajectories.push(mann_whitney(&numbers[0].concat(), &numbers[1].concat())?);
                }
            }
        }
        let (persons_holm, trajectories_holm) = (holm(&persons), holm(&trajectories));
        let gains = corrected(differences).into_iter().enumerate();
        tests.extend(gains.map(|(i, gain)| Test {
            first: pairs[i].0,
            second: pairs[i].1,
            gain,
            mann_whitney_persons: persons[i],
            mann_whitney_trajectories: trajectories[i],
            mann_whitney_persons_holm: persons_holm[i],
            mann_whitney_trajectories_holm: trajectories_holm[i],
        }));
    }
    Ok(tests)
}

/// The paired test of `first` over `second`. Its mean is computed as the difference of the two
/// means, so that it agrees with the means in tables.
fn paired(first: &[f64], second: &[f64]) -> Result<Paired, Invalid> {
    let [one, other] = [first, second].map(|of| mean(of.iter().copied()));
    Ok(Paired { mean: untied(one - other), ..Paired::of(first, second)? })
}

/// The mean, or 0 if it differs from 0 only by rounding errors.
fn untied(mean: f64) -> f64 {
    if mean.abs() > TIE { mean } else { 0.0 }
}

/// A row of the ablation: the baseline, or a model on one feature set, compared with the same model
/// on B_d.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablation {
    /// The model; `None` for the baseline.
    pub model: Option<ModelName>,
    /// The experiment.
    pub experiment: Experiment,
    /// The set's name; `none` for the baseline.
    pub features: String,
    /// Mean over participants of the test accuracy, in per cent.
    pub accuracy: f64,
    /// Mean over participants of the balanced test accuracy, in per cent.
    pub balanced: f64,
    /// Log loss over all test rows (nats).
    pub log_loss: f64,
    /// Gain in accuracy over the same model on B_d (percentage points), and its paired p-value over
    /// participants. `None` for the baseline and for B_d itself.
    pub over_d: Option<(f64, f64)>,
}

/// The rows of the ablation. The baseline comes first. Then there is a row for each of the paper's
/// models, each experiment and each of these feature sets: B_d and B_hrd, each without and with the
/// robot's position in the human's body frame, and every added set. `accuracies` and `balanced`
/// return the accuracies of each participant for a model, an experiment and a set.
///
/// # Errors
/// [`Invalid`] if there is no participant.
pub(super) fn ablation(
    comparison: &Comparison,
    pooled: &[Pooled],
    accuracies: impl Fn(Option<ModelName>, Experiment, &str) -> Vec<f64>,
    balanced: impl Fn(Option<ModelName>, Experiment, &str) -> Vec<f64>,
) -> Result<Vec<Ablation>, Invalid> {
    let known = ["none", "d", "d_body", "hrd", "hrd_body"];
    let added = comparison.sets().into_iter();
    let added = added.filter(|set| !PAPERS_SETS.contains(set) && !known.contains(set));
    let sets: Vec<&str> = known.into_iter().chain(added).collect();
    let place = |of: &Pooled| sets.iter().position(|set| *set == of.features);
    let is_papers = |model: ModelName| ModelName::PAPERS.contains(&model);
    let mut told: Vec<&Pooled> =
        pooled.iter().filter(|of| place(of).is_some() && of.model.is_none_or(is_papers)).collect();
    told.sort_by_key(|of| (of.model, of.experiment, place(of)));
    let row = |of: &&Pooled| {
        let own = accuracies(of.model, of.experiment, &of.features);
        let over_d = match of.features.as_str() {
            "none" | "d" => None,
            _ => {
                let paired = paired(&own, &accuracies(of.model, of.experiment, "d"))?;
                Some((paired.mean, paired.p))
            }
        };
        Ok(Ablation {
            model: of.model,
            experiment: of.experiment,
            features: of.features.clone(),
            accuracy: mean(own),
            balanced: mean(balanced(of.model, of.experiment, &of.features)),
            log_loss: of.calibration.log_loss,
            over_d,
        })
    };
    told.iter().map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::rank::wilcoxon;

    /// With six participants, none of the 21 pairwise means can be excluded, so the interval is the
    /// range of the gains.
    #[test]
    fn with_six_participants_the_interval_is_the_range() {
        let gains = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0];
        let found = Paired::of(&gains, &[0.0; 6]).unwrap();
        assert_eq!(found.interval, Some([1.0, 32.0]));
        assert_eq!((found.p, found.mean, found.better), (0.03125, 10.5, 6));
        assert_eq!(Paired::of(&gains[..5], &[0.0; 5]).unwrap().interval, None);
        assert!(Paired::of(&[], &[]).is_err());
    }

    #[test]
    fn a_few_participants_can_turn_the_mean() {
        let with_losses = |loss: f64| {
            let gains: Vec<f64> = (0..20).map(|i| if i < 2 { -loss } else { 1.0 }).collect();
            let found = Paired::of(&gains, &[0.0; 20]).unwrap();
            (found.p < LEVEL, found.typical > 0.0, found.contrary)
        };
        assert_eq!(with_losses(8.0), (true, true, false));
        assert_eq!(with_losses(9.0), (true, true, false), "a mean of 0 points nowhere");
        assert_eq!([9.5, 30.0].map(with_losses), [(true, true, true); 2]);
        assert!(!Paired::of(&[1.0, 1.0, -30.0], &[0.0; 3]).unwrap().contrary);
    }

    /// The interval contains exactly the shifts that the test does not reject.
    #[test]
    fn the_interval_is_what_the_test_does_not_reject() {
        let gains = [3.0, -1.0, 2.5, 7.0, 0.5, 4.2, 3.3, 1.9, -0.4, 6.1];
        let [low, high] = Paired::of(&gains, &[0.0; 10]).unwrap().interval.unwrap();
        let p = |shift: f64| wilcoxon(&gains.map(|gain| gain - shift), &[0.0; 10]).unwrap();
        for i in 0..400 {
            let shift = -3.0 + 0.0301 * f64::from(i);
            assert_eq!(p(shift) > LEVEL, (low..=high).contains(&shift), "{shift}: {low} to {high}");
        }
    }

    /// 18 of 24 people do equally well with both sets. The other six gain, so p = 2/2⁶.
    #[test]
    fn the_direction_is_that_of_the_test() {
        let gains: Vec<f64> =
            (0..24).map(|i| if i < 6 { 10.0 + f64::from(i) } else { 0.0 }).collect();
        let turned = |gains: &[f64]| {
            let paired = Paired::of(gains, &[0.0; 24]).unwrap();
            let all = vec![(ModelName::Lr, Experiment::Avoidance, Metric::Accuracy, paired)];
            corrected(all).remove(0)
        };
        let gain = turned(&gains);
        assert_eq!((gain.before, gain.paired.contrary), (Direction::Better, false));
        assert_eq!((gain.paired.differing, gain.paired.better), (6, 6));
        let losses: Vec<f64> = gains.iter().map(|gain| -gain).collect();
        assert_eq!(turned(&losses).after, Direction::Worse);
        assert_eq!(turned(&[0.0; 24]).before, Direction::Open);
    }
}
