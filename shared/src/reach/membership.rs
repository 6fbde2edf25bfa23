//! Is a full state (position and heading) reachable?
//!
//! The states after a step with one end heading ψ form a planar *slice* of the set. A path is
//! given by its heading over time; the paths that end with ψ form a convex set between a lowest
//! and a highest one. The slice's boundary consists of a few curves, each from the end of the
//! lowest to the end of the highest (`slice`): since the paths of one curve can be deformed into
//! those of another without leaving the convex set, every position that two curves surround is
//! reached. So a state is inside if the curves wind about it (`search`), also where the slice is
//! not convex, surrounds a hole, or headings pass ±π.
//!
//! # Accuracy
//! A state found inside is reachable, to 10⁻⁶ m. Reachable states are missed by rounding at most
//! where one may always turn both ways, or never right, or never left; steps without a choice
//! before the first and after the last with one do not matter for that. Otherwise rates change
//! between quarters of a step only, and the rear with more than two switches is a local optimum:
//! states along the boundary may be missed. At the paper's rates (at most 0.5 rad/s for 0.2 s, 0.1 rad
//! a step), of 3.6·10⁵ states that random inputs led to, under random bounds and bounds of
//! Algorithm 1, none was missed by 2 mm up to step 10 and none by 5 mm up to step 15; in steps 16
//! to 25, 2 of 9·10⁴ were, by less than 1 cm. **At larger turns per step more are missed**: at ±3
//! rad/s for 0.2 s, states of 79 of 10,562 random bounds, some by more than the default
//! tolerance.

mod buffer;
mod span;
mod parts;
mod search;
mod mixed_front;
mod multi_switch;
mod slice;
mod origins;

use super::paths::unit;
use super::set::ReachableSet;
use crate::math::TAU;
use crate::vehicle::Pose;
use nalgebra::Complex;
use origins::Origins;
use slice::Slice;

/// How far a state may be from a reachable one and still count as inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Between the positions, m, ≥ 0.
    pub position_m: f64,
    /// Between the headings, rad, ≥ 0.
    pub heading_rad: f64,
}

impl Default for Tolerance {
    /// 5 mm and 2 mrad.
    fn default() -> Self {
        Self { position_m: 0.005, heading_rad: 0.002 }
    }
}

/// How far inside the set a state is. Both numbers are positive inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateMargins {
    /// From the heading to the nearest end of the admissible range, rad.
    pub heading_rad: f64,
    /// From the position to the boundary of the positions that are reached with
    /// this heading, m. If the heading is outside its range, the nearest in it is
    /// taken. Inside, the true distance may be larger by a little where two
    /// curves of the rear cross.
    pub position_m: f64,
    /// Which part of that boundary is nearest.
    pub nearest: Side,
}

/// A part of the boundary of the positions reached with one heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The ends of the paths that get farthest.
    Front,
    /// The ends of the paths that stay farthest back.
    Rear,
}

/// Rounding errors may move inputs out of their bounds by this, rad/s.
const INPUT_ROUNDING: f64 = 1e-12;

/// A larger heading, rad, has too few digits: turns that are added to it would be lost.
const MOST_RAD: f64 = 1e6;

impl ReachableSet {
    /// Is `state` (world frame) reached after exactly `step` steps, or no farther
    /// than `tolerance` from a state that is? A state that is not finite, or has a heading beyond
    /// 10⁶ rad, is not.
    ///
    /// A state found inside is reachable to 10⁻⁶ m. Under bounds that admit both turns in some
    /// steps and only one in others, reachable states at the rear may be missed. At turns of
    /// at most 0.1 rad a step, none of 2.7·10⁵ random ones was missed by 2 mm up to step 10 or by
    /// 5 mm up to step 15. **At larger turns per step more are missed**: at ±3 rad/s for
    /// 0.2 s, 79 of 10,562 random bounds led to states reported outside, some more than the default
    /// tolerance of 5 mm away.
    ///
    /// If the start is a set, `state` is inside if some pose of it leads there, and may
    /// be if one leads to within 10⁻⁴ s of travel of it.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn contains_state(&self, step: usize, state: Pose, tolerance: Tolerance) -> bool {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        state.psi.abs() <= MOST_RAD && Origins::new(self, step, state, tolerance).any()
    }

    /// How far inside the states reached after exactly `step` steps `state`
    /// (world frame) is. Not a number for a state that is not finite, or has a heading beyond 10⁶ rad. If
    /// the start is a set, only from the pose in its middle.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn state_margins(&self, step: usize, state: Pose) -> StateMargins {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        let position = self.local(state);
        let (low, high) = self.end_headings(step);
        let mut best =
            StateMargins { heading_rad: f64::NAN, position_m: f64::NAN, nearest: Side::Front };
        if !(position.norm_sqr().is_finite() && state.psi.abs() <= MOST_RAD) {
            return best;
        }
        let rank = |margins: &StateMargins| (margins.heading_rad.min(0.0), margins.position_m);
        for heading in self.branches(step, state, TAU) {
            let slice = Slice::new(&self.paths, step, heading.clamp(low, high));
            let (margin, curve) = slice.margin(position);
            let margins = StateMargins {
                heading_rad: (heading - low).min(high - heading),
                position_m: margin * self.speed_mps,
                nearest: if curve == slice.front() { Side::Front } else { Side::Rear },
            };
            if best.heading_rad.is_nan() || rank(&margins) > rank(&best) {
                best = margins;
            }
        }
        best
    }

    /// Is a recorded trajectory inside at every step? `states` are those after
    /// each step (world frame), from the first on; `inputs`, if known, are
    /// the turn rates held in each step, rad/s. As long as they satisfy the
    /// bounds, the states are reachable by definition; from the first step on in
    /// which they do not, each state is tested with `tolerance`.
    ///
    /// # Panics
    /// If there are more states than [`Self::steps`], or fewer inputs than states.
    #[must_use]
    pub fn contains_trajectory(
        &self,
        states: &[Pose],
        inputs: Option<&[f64]>,
        tolerance: Tolerance,
    ) -> bool {
        let bounds = self.paths.lo.iter().zip(&self.paths.hi);
        let known = inputs.map_or(0, |inputs| {
            assert!(inputs.len() >= states.len(), "an input for each state");
            bounds
                .zip(inputs)
                .take_while(|&((lo, hi), input)| {
                    (lo - INPUT_ROUNDING..=hi + INPUT_ROUNDING).contains(input)
                })
                .count()
        });
        // Later states usually need the widest bounds, so that one test of the last is often enough.
        (known..states.len()).rev().all(|i| self.contains_state(i + 1, states[i], tolerance))
    }

    /// From the world frame, metres, to the human's, seconds of travel.
    fn local(&self, state: Pose) -> Complex<f64> {
        let moved = Complex::new(state.x - self.start.x, state.y - self.start.y);
        moved * unit(-self.start.psi) / self.speed_mps
    }

    /// Lowest and highest heading after `step` steps, human's frame, rad.
    fn end_headings(&self, step: usize) -> (f64, f64) {
        (self.paths.low.heading(step), self.paths.high.heading(step))
    }

    /// The headings, rad in the human's frame and not wrapped, that a state's
    /// heading may stand for and that are admissible to within `slack`.
    fn branches(&self, step: usize, state: Pose, slack: f64) -> impl Iterator<Item = f64> {
        let (low, high) = self.end_headings(step);
        let heading = state.psi - self.start.psi;
        let first = ((low - slack - heading) / TAU).ceil();
        (0..)
            .map(move |turns| heading + TAU * (first + f64::from(turns)))
            .take_while(move |heading| *heading <= high + slack)
    }
}
