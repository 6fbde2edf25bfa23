//! The paper's own numbers: J. C. Shih, "Predicting Stochastic Human Forward Reachable Sets Based
//! on Learned Human Behavior", 2019, Tables I and II.

use sidestep::comparison::cell::{Experiment, ModelName};
use sidestep::comparison::tables::Metric;

/// Where the numbers are from.
pub(in crate::report) const SOURCE: &str = "J. C. Shih, “Predicting Stochastic Human Forward Reachable Sets \
                                 Based on Learned Human Behavior” (2019)";

/// A row of Table I: accuracy in per cent on the sets hrd, hr, hd, rd, h, r, d.
pub(super) fn accuracies(model: ModelName, experiment: Experiment) -> Option<[f64; 7]> {
    use Experiment::{Avoidance, TurnDirection};
    match (model, experiment) {
        (ModelName::Svm, TurnDirection) => Some([78.67, 78.46, 76.56, 76.74, 75.11, 76.33, 69.75]),
        (ModelName::Dt, TurnDirection) => Some([75.77, 74.24, 73.65, 75.27, 71.37, 73.65, 68.68]),
        (ModelName::Lr, TurnDirection) => Some([77.73, 77.4, 74.71, 77.38, 73.31, 76.61, 69.15]),
        (ModelName::Svm, Avoidance) => Some([83.89, 83.15, 81.12, 82.85, 79.62, 82.15, 70.72]),
        (ModelName::Dt, Avoidance) => Some([81.29, 78.58, 79.26, 80.55, 79.15, 78.5, 68.0]),
        (ModelName::Lr, Avoidance) => Some([81.70, 81.61, 78.79, 81.62, 77.54, 80.88, 71.35]),
        (ModelName::SvmRbf | ModelName::SvmLinear | ModelName::Boosted, _) => None,
    }
}

/// A row of Table II: steps, on the same sets.
pub(super) fn distances(model: ModelName, metric: Metric) -> Option<[f64; 7]> {
    match (model, metric) {
        (ModelName::Svm, Metric::Start) => Some([2.02, 2.06, 2.23, 1.88, 2.3, 2.03, 4.22]),
        (ModelName::Dt, Metric::Start) => Some([1.48, 2.02, 1.98, 1.56, 2.44, 1.68, 2.92]),
        (ModelName::Lr, Metric::Start) => Some([2.43, 2.84, 2.6, 2.29, 2.93, 2.83, 7.3]),
        (ModelName::Svm, Metric::End) => Some([6.7, 7.38, 8.67, 7.03, 8.78, 8.07, 15.94]),
        (ModelName::Dt, Metric::End) => Some([8.77, 9.09, 8.43, 8.02, 9.45, 9.25, 14.5]),
        (ModelName::Lr, Metric::End) => Some([7.67, 7.35, 9.17, 7.72, 9.96, 8.09, 17.57]),
        (ModelName::SvmRbf | ModelName::SvmLinear | ModelName::Boosted, _)
        | (_, Metric::Accuracy) => None,
    }
}
