//! Metrics of the store's commits.

use prometheus_client::metrics::histogram::Histogram;
use std::time::Duration;

/// Histogram bounds of durations (s), from a fast commit to the request timeout.
pub const SECONDS: [f64; 13] =
    [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 30.0];

/// Histogram bounds of the number of writes in a commit.
const WRITES: [f64; 8] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];

/// How many writes each commit stored, and how long it took.
#[derive(Clone, Debug)]
pub struct Commits {
    writes: Histogram,
    seconds: Histogram,
}

impl Default for Commits {
    fn default() -> Self {
        Self { writes: Histogram::new(WRITES), seconds: Histogram::new(SECONDS) }
    }
}

impl Commits {
    /// Records a commit: the number of writes, and how long it took.
    pub(super) fn note(&self, writes: usize, took: Duration) {
        self.writes.observe(writes as f64);
        self.seconds.observe(took.as_secs_f64());
    }

    /// Histograms of the number of writes per commit, and of the duration of a commit (s).
    #[must_use]
    pub fn histograms(&self) -> [Histogram; 2] {
        [self.writes.clone(), self.seconds.clone()]
    }
}
