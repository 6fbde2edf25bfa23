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
//! A state found inside is reachable, to 10⁻⁶ m. Whether the curves are all there are is not proven: at the rear, paths
//! with more than two switches are sought by a local optimum, and rates change between quarters of a
//! step only. So that a state which the curves have outside is outside is proven otherwise, or left
//! open: `body_point`.

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
    /// It is not: that is proven for all bounds that are accepted, to rounding.
    Outside,
    /// It was not found to be, and no proof was found that it is not.
    Open,
}

/// Proofs that a state is outside are tried this often.
const MOST_TRIALS: usize = 24;

/// Most units of work on one state, as those of polygons.
const MOST_WORK: usize = 4_000_000;

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
    /// It is never false for such a state, whatever the bounds: it is true unless the state is proven to be
    /// [outside](Membership::Outside). It can be true for a state farther away, if that takes more than 24 trials or much work (see
    /// [`Self::state_membership`], which tells the two apart).
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn contains_state(&self, step: usize, state: Pose, tolerance: Tolerance) -> bool {
        self.state_membership(step, state, tolerance, MOST_TRIALS) != Membership::Outside
    }

    /// The same as [`Self::contains_state`], with three answers, and at most `trials` trials to prove that the
    /// state is outside. All of them together took 30 to 230 µs a state at turns of 0.1 rad a step,
    /// 10 to 15 steps. The work is bounded as that of a polygon is (by four million units, some hundredths of a second),
    /// whatever the bounds, the start and the number of trials: beyond that the state is [open](Membership::Open).
    ///
    /// A state found inside is reachable to 10⁻⁶ m beyond the tolerance. If the start is a set, it is
    /// inside if some pose of it leads there, and may be if one leads to within 10⁻⁴ s of travel of it.
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

    /// The same as [`Self::state_membership`], as long as `progress` lets it go on. It is asked at the beginning and after
    /// every few tenths of a millisecond.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` breaks off.
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
        // Whatever the state, it takes some.
        budget.spend(1);
        if state.psi.abs() <= MOST_RAD {
            Origins::new(self, step, state, tolerance, budget).decide(trials)
        } else {
            Membership::Outside
        }
    }

    /// How far inside the states reached after exactly `step` steps `state`
    /// (world frame) is. If the start is a set, only from the pose in its middle. Not a number for a state that is not finite,
    /// or has a heading beyond 10⁶ rad, and where finding out takes more than four million units of work (see
    /// [`Self::state_membership`]), as some states after tens of steps of half a turn do.
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

    /// Is each of the states after steps 1, 2 … (world frame) reached after its step? As [`Self::contains_state`] for each, but
    /// together they take no more work than one may: what is not decided within its share counts as inside.
    ///
    /// # Panics
    /// If there are more states than [`Self::steps`].
    #[must_use]
    pub fn contains_states(&self, states: &[Pose], tolerance: Tolerance) -> Vec<bool> {
        let found = self.decide_all(0..states.len(), states, tolerance, MOST_TRIALS);
        found.map(|membership| membership != Membership::Outside).collect()
    }

    /// Decides about the states at these places of a trajectory, one after the other. Each has an equal share of the work that is
    /// left, so that all together take no more than one state may.
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

    /// Is a recorded trajectory inside at every step? `states` are those after
    /// each step (world frame), from the first on; `inputs`, if known, are
    /// the turn rates held in each step, rad/s. As long as they satisfy the
    /// bounds, the states are reachable by definition; from the first step on in
    /// which they do not, each state must be [inside](Membership::Inside) with `tolerance`. What is open
    /// does not count, so that shares of contained trajectories are never too large. The work on all states together is
    /// bounded as that on one is.
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
