//! Statistics of a distribution.

use serde_json::{Value, json};

/// The `share` quantile of `values`, which must not be empty.
pub(crate) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

/// The count, median, 95th and 99th percentiles and maximum of `values`.
pub(crate) fn distribution(values: &[f64]) -> Value {
    json!({
        "count": values.len(),
        "median": quantile(values, 0.5),
        "p95": quantile(values, 0.95),
        "p99": quantile(values, 0.99),
        "max": quantile(values, 1.0),
    })
}
