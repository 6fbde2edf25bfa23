//! Is a full state (position and heading) reachable?
//!
//! The states after a step with one end heading ψ form a planar *slice* of the set. A path is
//! given by its heading over time; the paths that end with ψ form a convex set between a lowest
//! and a highest one. The slice's boundary consists of a few curves, each from the end of the
//! lowest to the end of the highest (`slice`): since the paths of one curve can be deformed into
//! those of another without leaving the convex set, every position that two curves surround is
//! reached. So a state is inside if the curves wind about it (`search`), also where the slice is
//! reached. So a state is inside if the curves wind about it (`search`), even where the slice is
//!
//! # Accuracy
//! A state found inside is reachable, to 10⁻⁶ m. It is not proven that the curves are complete: at
//! the rear, paths with more than two switches come from a local optimisation, and rates change
//! only between quarters of a step. So a state outside the curves needs a separate proof
//! (`body_point`), or stays open.

mod buffer;
mod span;
mod parts;
mod search;
mod mixed_front;
mod multi_switch;
mod slice;
mod body_point;
mod origins;

use super::budget::{Budget, Cancelled, Progress};
use super::paths::unit;
use super::set::ReachableSet;
use crate::math::TAU;
use crate::vehicle::Pose;
use core::ops::ControlFlow;
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

/// Whether a state is within a tolerance of a reachable one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Membership {
    /// It is.
    Inside,
    /// It is not: proven for all accepted bounds, up to rounding.
    Outside,
    /// Neither found to be inside nor proven to be outside.
    Open,
}

/// Default number of attempts to prove that a state is outside.
const MOST_TRIALS: usize = 24;

/// Limit on the work for one state, in the same units as for polygons.
const MOST_WORK: usize = 4_000_000;

/// How far inside the set a state is. Both numbers are positive inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateMargins {
    /// From the heading to the nearest end of the admissible range, rad.
    pub heading_rad: f64,
    /// From the position to the boundary of the positions that are reached with this heading, m. If
    /// the heading is outside its range, the nearest admissible one is used. Inside, the true
    /// distance may be slightly larger where two curves of the rear cross.
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

/// Larger headings, rad, have too few digits: turns added to them would be lost.
const MOST_RAD: f64 = 1e6;

impl ReachableSet {
    /// Whether `state` (world frame) is reached after exactly `step` steps, or is no farther than `tolerance`
    /// from a state that is. False for a state that is not finite, or has a heading beyond 10⁶ rad.
    ///
    /// For all bounds, it is never false for a reachable state: it is true unless the state is proven to be
    /// [outside](Membership::Outside). It can be true for a state farther away if the proof takes more than 24
    /// attempts or too much work: [`Self::state_membership`] distinguishes the two.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn contains_state(&self, step: usize, state: Pose, tolerance: Tolerance) -> bool {
        self.state_membership(step, state, tolerance, MOST_TRIALS) != Membership::Outside
    }

    /// Like [`Self::contains_state`], but with three answers, and at most `trials` attempts to
    /// prove that the state is outside. All attempts together took 30 to 230 µs per state at turns
    /// of 0.1 rad per step, over 10 to 15 steps. The work is bounded as for a polygon (by four
    /// million units, some hundredths of a second) for all bounds, starts and numbers of attempts:
    /// beyond that the state is [open](Membership::Open).
    ///
    /// A state found inside is reachable to 10⁻⁶ m beyond the tolerance. If the start is a set, the state is
    /// inside if some start pose leads there, and may be if one leads to within 10⁻⁴ s of travel of it.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn state_membership(
        &self,
        step: usize,
        state: Pose,
        tolerance: Tolerance,
        trials: usize,
    ) -> Membership {
        self.decide(step, state, tolerance, trials, &Budget::new(MOST_WORK))
    }

    /// [`Self::state_membership`] that the caller can cancel: it calls `progress` at the beginning
    /// and then every few tenths of a millisecond.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` returns [`Break`](core::ops::ControlFlow::Break).
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    pub fn try_state_membership(
        &self,
        step: usize,
        state: Pose,
        tolerance: Tolerance,
        trials: usize,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Membership, Cancelled> {
        Budget::reported(MOST_WORK, progress, |budget| {
            self.decide(step, state, tolerance, trials, budget)
        })
    }

    fn decide(
        &self,
        step: usize,
        state: Pose,
        tolerance: Tolerance,
        trials: usize,
        budget: &Budget<'_>,
    ) -> Membership {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        // Every state takes some work.
        budget.spend(1);
        if state.psi.abs() <= MOST_RAD {
            Origins::new(self, step, state, tolerance, budget).decide(trials)
        } else {
            Membership::Outside
        }
    }

    /// How far `state` (world frame) is inside the states reached after exactly `step` steps. If
    /// the start is a set, only the pose in its middle counts. NaN for a state that is not finite,
    /// or has a heading beyond 10⁶ rad, and if the work exceeds four million units (see
    /// [`Self::state_membership`]), as for some states after tens of steps of half a turn.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn state_margins(&self, step: usize, state: Pose) -> StateMargins {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        let position = self.local(state);
        let (low, high) = self.end_headings(step);
        let unknown =
            StateMargins { heading_rad: f64::NAN, position_m: f64::NAN, nearest: Side::Front };
        let mut best = unknown;
        if !(position.norm_sqr().is_finite() && state.psi.abs() <= MOST_RAD) {
            return best;
        }
        let rank = |margins: &StateMargins| (margins.heading_rad.min(0.0), margins.position_m);
        let budget = Budget::new(MOST_WORK);
        for heading in self.branches(step, state, TAU) {
            let slice = Slice::new(&self.paths, step, heading.clamp(low, high), &budget);
            let (margin, curve) = slice.margin(position);
            if budget.is_spent() {
                return unknown;
            }
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

    /// Whether each of the states after steps 1, 2 … (world frame) is reached after its step. Like
    /// [`Self::contains_state`] for each, but all states share the work limit of one: a state that
    /// is not decided within its share counts as inside.
    ///
    /// # Panics
    /// If there are more states than [`Self::steps`].
    #[must_use]
    pub fn contains_states(&self, states: &[Pose], tolerance: Tolerance) -> Vec<bool> {
        let found = self.decide_all(0..states.len(), states, tolerance, MOST_TRIALS);
        found.map(|membership| membership != Membership::Outside).collect()
    }

    /// Decides about the states at these indices of a trajectory, one after the other. Each gets an
    /// equal share of the remaining work, so that all together stay within the limit of one state.
    fn decide_all<'a>(
        &'a self,
        places: impl ExactSizeIterator<Item = usize> + 'a,
        states: &'a [Pose],
        tolerance: Tolerance,
        trials: usize,
    ) -> impl Iterator<Item = Membership> + 'a {
        let (mut left, mut undecided) = (MOST_WORK, places.len());
        places.map(move |place| {
            let budget = Budget::new(left / undecided);
            let found = self.decide(place + 1, states[place], tolerance, trials, &budget);
            left -= budget.done();
            undecided -= 1;
            found
        })
    }

    /// Whether a recorded trajectory is inside at every step. `states` are those after each step
    /// (world frame), from the first on; `inputs`, if known, are the turn rates held in each step,
    /// rad/s. As long as they satisfy the bounds, the states are reachable by definition; from the
    /// first step on in which they do not, each state must be [inside](Membership::Inside) within
    /// `tolerance`. An open state does not count, so that shares of contained trajectories are
    /// never too large. All states share the work limit of one.
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
        // Later states usually need the widest bounds, so testing the last one is often enough.
        self.decide_all((known..states.len()).rev(), states, tolerance, 0)
            .all(|membership| membership == Membership::Inside)
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
