//! Extremals that diverge beyond double precision.
//!
//! Consider two extremals that switch from the highest to the lowest rate at slightly different times.
//! Traced backward, they diverge. The closer to straight they are at the switch, the faster they
//! diverge. If bounds forbid driving straight by 10⁻⁴ rad/s, their distance grows several thousandfold
//! in one step. After a few such steps, metres of the front lie between two neighbours whose parameters
//! at the end differ only in the last bit. So such neighbours are traced back until just before they
//! diverge. There, the extremals between them get a new parameter, the interpolation fraction between
//! the two neighbours.

use super::super::budget::Budget;
use super::super::paths::Paths;
use super::super::sampling::{sample, triangle_height};
use super::TRACING;
use super::extremal::{Costate, PathTime};
use nalgebra::Complex;

/// Two neighbouring extremals at the same instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbours {
    pub(super) first: Costate,
    pub(super) last: Costate,
    pub(super) at: PathTime,
}

/// Two extremals closer together than this (rad and s) represent all extremals between them, because
/// their ends differ by no more than this.
const CLOSE: f64 = 1e-9;

/// Neighbours in the family that are closer together than this (rad and s) have not diverged.
const NEIGHBOURING: f64 = 1e-5;

/// A search for the instant of divergence costs about this many times as much as tracing to the start.
const SEARCH: usize = 2;

/// Maximum number of successive divergences through which neighbours are followed.
pub(super) const MOST_DIVERGENCES: u32 = 16;

/// Accuracy of the instant of divergence (s). The divergence itself takes longer than this.
const INSTANT: f64 = 1e-13;

impl Neighbours {
    /// The extremal interpolated at the fraction `share` from the first to the last, at the same
    /// instant.
    pub(super) fn between(&self, share: f64) -> Costate {
        self.first.between(&self.last, share)
    }

    /// Both extremals at the earlier instant `to`.
    pub(super) fn back(&self, paths: &Paths, to: PathTime) -> Self {
        let [first, last] = [self.first, self.last].map(|one| one.back(paths, self.at, to));
        Self { first, last, at: to }
    }

    /// Whether the two are close enough to represent all extremals between them.
    pub(super) fn are_one(&self) -> bool {
        self.first.is_near(&self.last, CLOSE)
    }

    /// Traces both extremals back to just before they diverge, but at most to `until`. Returns `None`
    /// if they have already diverged.
    pub(super) fn before_divergence(&self, paths: &Paths, until: PathTime) -> Option<Self> {
        if !self.first.is_near(&self.last, NEIGHBOURING) {
            return None;
        }
        let mut together = *self;
        for step in (until.step..=self.at.step).rev() {
            let begin = if step == until.step { until.seconds } else { 0.0 };
            let earlier = together.back(paths, PathTime { step, seconds: begin });
            if earlier.are_one() {
                together = earlier;
                continue;
            }
            let mut apart = begin;
            if together.at.step > step {
                together.at = PathTime { step, seconds: paths.step_s };
            }
            while together.at.seconds - apart > INSTANT {
                let middle = 0.5 * (together.at.seconds + apart);
                let halfway = together.back(paths, PathTime { step, seconds: middle });
                if halfway.are_one() {
                    together = halfway;
                } else {
                    apart = middle;
                }
            }
            break;
        }
        Some(together)
    }

    /// Appends the ends of the extremals strictly between the two. Follows them through at most
    /// `divergences` further divergences.
    pub(super) fn bridge(
        &self,
        paths: &Paths,
        tolerance: f64,
        divergences: u32,
        (points, budget): (&mut Vec<Complex<f64>>, &Budget<'_>),
    ) {
        budget.spend(SEARCH * TRACING * self.at.step);
        if budget.is_spent() {
            return;
        }
        let Some(close) = self.before_divergence(paths, PathTime::beginning(0)) else {
            return;
        };
        let curve = |share: f64| {
            let start = close.between(share).to_start(paths, close.at);
            budget.spend(start.work);
            start.sample()
        };
        let bridge = |from: f64, to: f64, points: &mut Vec<Complex<f64>>| {
            let nearer = Self { first: close.between(from), last: close.between(to), at: close.at };
            // If `close.at` is not earlier, the extremals diverge immediately, and the next search
            // would not advance.
            if close.at < self.at && divergences > 0 {
                nearer.bridge(paths, tolerance, divergences - 1, (points, budget));
            }
        };
        if triangle_height(curve(0.0), curve(1.0)) > tolerance {
            sample(&curve, (0.0, 1.0), 1, tolerance, &bridge, (points, budget));
        }
    }
}
