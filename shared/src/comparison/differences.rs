//! Differences between feature sets: the paper's tests, and how much a body frame alone explains.

use super::cell::{Experiment, ModelName, PAPERS_SETS};
use super::gains::{Gain, Paired, corrected};
use super::tables::{Comparison, Metric, Pooled, mean};
use crate::invalid::Invalid;
use crate::stats::rank::{holm, mann_whitney};
use serde::Serialize;

/// How two feature sets differ in one model, experiment and metric.
#[derive(Clone, Debug, PartialEq, Serialize)]
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

/// Tests of every model, experiment, metric and pair of [`PAIRS`]. Those of a metric are corrected
/// together.
///
/// # Errors
/// [`Invalid`] if there is no participant.
pub fn tests(comparison: &Comparison) -> Result<Vec<Test>, Invalid> {
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

/// The paired test of `first` over `second`, with the difference of their means: tables show the
/// means beside it.
fn paired(first: &[f64], second: &[f64]) -> Result<Paired, Invalid> {
    let [one, other] = [first, second].map(|of| mean(of.iter().copied()));
    Ok(Paired { mean: one - other, ..Paired::of(first, second)? })
}

/// A model on a feature set, beside the same model on B_d; or the baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ablation {
    /// What predicts; none for the baseline.
    pub model: Option<ModelName>,
    /// What is predicted.
    pub experiment: Experiment,
    /// The set's name; `none` for the baseline.
    pub features: String,
    /// Mean over participants of the test accuracy, in per cent.
    pub accuracy: f64,
    /// Over all test rows, nats.
    pub log_loss: f64,
    /// Points of accuracy over the same model on B_d, and the paired p-value over people of that
    /// gain; nothing for the baseline and for B_d itself.
    pub over_d: Option<(f64, f64)>,
}

/// The baseline, then for each model and experiment B_d and B_hrd, each without and with the
/// robot's position in the human's body frame, and every set that was added. `accuracies` gives the
/// accuracy of each participant by model, experiment and set.
///
/// # Errors
/// [`Invalid`] if there is no participant.
pub(super) fn ablation(
    comparison: &Comparison,
    pooled: &[Pooled],
    accuracies: impl Fn(Option<ModelName>, Experiment, &str) -> Vec<f64>,
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
            log_loss: of.calibration.log_loss,
            over_d,
        })
    };
    told.iter().map(row).collect()
}
