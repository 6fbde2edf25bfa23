//! Extremals that part faster than the digits of a number can tell.
//!
//! Going back, two extremals that pass the switch from the highest to the lowest rate one
//! after the other drift apart, the faster the closer to straight they are there: where
//! bounds miss straight driving by 10⁻⁴ rad/s, several thousand times in one step. After a
//! few such steps the numbers that name two neighbours at the end differ in their last bit,
//! and metres of the front lie between where they came from. So such neighbours are followed back to
//! where they are just about to part, and those between them are named anew there, by how
//! far they are from one to the other.

use super::extremal::{Costate, PathTime};
use super::paths::Paths;
use super::sampling::{sample, triangle_height};
use nalgebra::Complex;

/// Two neighbouring extremals at the same instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbours {
    pub(super) first: Costate,
    pub(super) last: Costate,
    pub(super) at: PathTime,
}

/// Extremals this close, rad and s, are as good as any between them: an end moves by no more.
const CLOSE: f64 = 1e-9;

/// Closer than this they still are neighbours: they have been found to be so one by one.
const NEIGHBOURING: f64 = 1e-5;

/// Neighbours are followed from one parting to the next at most so often.
pub(super) const MOST_PARTINGS: u32 = 16;

/// The instant of parting is found to this, s: a parting takes longer.
const INSTANT: f64 = 1e-13;

impl Neighbours {
    /// The extremal at `share` of the way from the first to the last, where they are.
    pub(super) fn between(&self, share: f64) -> Costate {
        self.first.between(&self.last, share)
    }

    /// The two at an earlier instant.
    pub(super) fn back(&self, paths: &Paths, to: PathTime) -> Self {
        let [first, last] = [self.first, self.last].map(|one| one.back(paths, self.at, to));
        Self { first, last, at: to }
    }

    /// Whether there is nothing between them that matters.
    pub(super) fn are_one(&self) -> bool {
        self.first.is_near(&self.last, CLOSE)
    }

    /// The two just before they part, going back to `until` at the most; nothing if they
    /// have parted already.
    pub(super) fn before_parting(&self, paths: &Paths, until: PathTime) -> Option<Self> {
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

    /// Appends the ends of the extremals between the two, without theirs.
    pub(super) fn bridge(
        &self,
        paths: &Paths,
        tolerance: f64,
        partings: u32,
        points: &mut Vec<Complex<f64>>,
    ) {
        let Some(parting) = self.before_parting(paths, PathTime::beginning(0)) else {
            return;
        };
        let curve = |share: f64| parting.between(share).to_start(paths, parting.at).sample();
        let leap = |from: f64, to: f64, points: &mut Vec<Complex<f64>>| {
            let nearer =
                Self { first: parting.between(from), last: parting.between(to), at: parting.at };
            // Otherwise they part at once.
            if parting.at < self.at && partings > 0 {
                nearer.bridge(paths, tolerance, partings - 1, points);
            }
        };
        if triangle_height(curve(0.0), curve(1.0)) > tolerance {
            sample(&curve, (0.0, 1.0), 1, tolerance, &leap, points);
        }
    }
}
