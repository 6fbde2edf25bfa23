//! How much of the gain a body frame alone explains.

use super::cell::{BODY_FRAME_SETS, Cell, Experiment, ModelName, PAPERS_SETS};
use super::metrics::Predictions;
use super::run::Results;
use super::tables::mean;
use crate::invalid::Invalid;
use crate::stats::rank::wilcoxon;

/// A model on a feature set, beside the same model on B_d; or the baseline.
#[derive(Clone, Debug, PartialEq)]
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
/// robot's position in the human's body frame, and every set that was asked for beside.
///
/// # Errors
/// [`Invalid`] if there is no participant.
pub fn ablation(results: &Results) -> Result<Vec<Ablation>, Invalid> {
    let mut rows = Vec::new();
    for experiment in Experiment::ALL {
        let baselines = results.baselines.iter().filter(|of| of.experiment == experiment);
        let tests: Vec<&Predictions> = baselines.map(|baseline| &baseline.test).collect();
        rows.push(Ablation {
            model: None,
            experiment,
            features: "none".to_owned(),
            accuracy: mean(tests.iter().map(|test| 100.0 * test.accuracy())),
            log_loss: log_loss(experiment, tests),
            over_d: None,
        });
    }
    for model in ModelName::PAPERS {
        for experiment in Experiment::ALL {
            let cells =
                |set| -> Vec<&Cell> { results.comparison.of(model, experiment, set).collect() };
            let accuracies = |cells: &[&Cell]| -> Vec<f64> {
                cells.iter().map(|cell| 100.0 * cell.test.accuracy()).collect()
            };
            let of_d = accuracies(&cells("d"));
            let pairs = BODY_FRAME_SETS.into_iter().rev();
            let known = pairs.flat_map(|(with, without)| [without, with]);
            let further = results.comparison.sets().into_iter().filter(|set| {
                !PAPERS_SETS.contains(set) && BODY_FRAME_SETS.iter().all(|(body, _)| body != set)
            });
            for features in known.chain(further) {
                let cells = cells(features);
                let own = accuracies(&cells);
                rows.push(Ablation {
                    model: Some(model),
                    experiment,
                    features: features.to_owned(),
                    accuracy: mean(own.iter().copied()),
                    log_loss: log_loss(experiment, cells.iter().map(|cell| &cell.test)),
                    over_d: match features {
                        "d" => None,
                        _ => {
                            let gain = mean(own.iter().copied()) - mean(of_d.iter().copied());
                            Some((gain, wilcoxon(&own, &of_d)?))
                        }
                    },
                });
            }
        }
    }
    Ok(rows)
}

fn log_loss<'a>(experiment: Experiment, tests: impl IntoIterator<Item = &'a Predictions>) -> f64 {
    Predictions::together(experiment.classes(), tests).calibration().log_loss
}
