//! Summary statistics of errors, and states at which errors are measured.

use serde::Serialize;
use sidestep::math::{PI, SeededRng, sin_cos};

/// Number, quantiles and maximum of errors.
#[derive(Clone, Serialize)]
pub(crate) struct Errors {
    pub(crate) count: usize,
    pub(crate) p50: f64,
    pub(crate) p90: f64,
    pub(crate) p99: f64,
    pub(crate) max: f64,
}

impl Errors {
    /// The statistics of a non-empty list.
    pub(crate) fn of(mut errors: Vec<f64>) -> Self {
        errors.sort_by(f64::total_cmp);
        let quantile = |share: f64| errors[((errors.len() - 1) as f64 * share) as usize];
        let [p50, p90, p99, max] = [0.5, 0.9, 0.99, 1.0].map(quantile);
        Self { count: errors.len(), p50, p90, p99, max }
    }
}

/// Poses of the pursuer with uniformly distributed range, bearing and heading.
pub(crate) fn random_states(seed: u64, count: usize, range_m: f64) -> Vec<[f64; 3]> {
    let mut rng = SeededRng::new(seed);
    let mut state = || {
        let (range, bearing) = (range_m * rng.unit(), rng.uniform(-PI, PI));
        let (sin, cos) = sin_cos(bearing);
        [range * cos, range * sin, rng.uniform(-PI, PI)]
    };
    (0..count).map(|_| state()).collect()
}

/// The rows of a CSV file without its header, as numbers.
pub(crate) fn numbers(text: &str) -> Result<Vec<Vec<f64>>, csv::Error> {
    csv::Reader::from_reader(text.as_bytes()).deserialize().collect()
}
