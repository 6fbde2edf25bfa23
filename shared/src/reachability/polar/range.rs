//! The range axis of polar coordinates.

use crate::math::{exp, ln};

/// The range axis r = c (eˢ − 1) with s = 0, h, 2h, …
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeAxis {
    /// c (m), the range at which the axis changes from linear to logarithmic.
    pub knee_m: f64,
    /// h, the spacing of s.
    pub step: f64,
    /// Number of nodes.
    pub nodes: usize,
}

impl RangeAxis {
    /// An axis of `nodes` nodes from 0 to `range_m`.
    #[must_use]
    pub fn new(knee_m: f64, range_m: f64, nodes: usize) -> Self {
        Self { knee_m, step: ln(1.0 + range_m / knee_m) / (nodes - 1) as f64, nodes }
    }

    /// Range of node `i` (m).
    #[must_use]
    pub fn node(&self, i: usize) -> f64 {
        self.at(i as f64)
    }

    /// Range at a fractional node index (m).
    #[must_use]
    pub fn at(&self, position: f64) -> f64 {
        self.knee_m * (exp(position * self.step) - 1.0)
    }

    /// Fractional node index of a range (m).
    #[must_use]
    pub fn position(&self, range_m: f64) -> f64 {
        ln(1.0 + range_m / self.knee_m) / self.step
    }
}
