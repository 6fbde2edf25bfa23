//! Decides whether a full state (position and heading) is reachable.
//!
//! The states of the set that have the same heading ψ form a planar *slice*. A path is given by its
//! heading over time. The paths that end with heading ψ form a convex set between a lowest and a
//! highest path. The slice's boundary consists of a few curves, each from the end of the lowest path to
//! the end of the highest path (`slice`). The paths of one curve can be deformed into the paths of
//! another curve without leaving the convex set, so every position that two curves surround is reached.
//! A state is therefore inside if the curves wind around it (`search`). This also holds where the slice
//! is not convex or surrounds a hole, or where headings pass ±π.
//!
//! # Accuracy
//! A state found inside is reachable to within 10⁻⁶ m. It is not proven that the curves are complete.
//! At the rear, paths with more than two switches come from a local optimisation, in which rates change
//! only between quarters of a step. So a state outside the curves needs a separate proof
//! (`body_point`). Without a proof, it stays open.

mod buffer;
mod span;
mod parts;
mod search;
mod mixed_front;
mod multi_switch;
mod slice;
mod body_point;
mod origins;

use super::boundary::Workspace;
use super::budget::{Budget, Cancelled, Progress};
use super::paths::unit;
use super::polygon::signed_distance;
use super::sampling::PolygonSettings;
use super::set::ReachableSet;
use crate::math::TAU;
use crate::vehicle::Pose;
use core::ops::ControlFlow;
use nalgebra::Complex;
use origins::Origins;
use slice::Slice;

/// The largest distance from a reachable state at which a state still counts as inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Largest distance between the positions (m), ≥ 0.
    pub position_m: f64,
    /// Largest difference between the headings (rad), ≥ 0.
    pub heading_rad: f64,
}

impl Default for Tolerance {
    /// 5 mm and 2 mrad.
    fn default() -> Self {
        Self { position_m: 0.005, heading_rad: 0.002 }
    }
}

/// Whether a state is within a tolerance of a reachable state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Membership {
    /// The state is within the tolerance of a reachable state.
    Inside,
    /// The state is not within the tolerance. This is proven for all accepted bounds, up to rounding.
    Outside,
    /// The state was neither found to be inside nor proven to be outside.
    Open,
}

/// Default number of attempts to prove that a state is outside.
const MOST_TRIALS: usize = 24;

/// Limit on the work for one state, in units of a [`Budget`].
const MOST_WORK: usize = 4_000_000;

/// How far inside the set a state is. Both margins are positive inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateMargins {
    /// Distance of the heading from the nearest end of the admissible range (rad).
    pub heading_rad: f64,
    /// Distance (m) of the position from the boundary of the positions that are reached with this
    /// heading. If the heading is outside its range, the nearest admissible heading is used. Inside
    /// the set, the true distance can be slightly larger where two curves of the rear cross.
    pub position_m: f64,
    /// The part of the boundary that is nearest to the position.
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

/// Inputs are allowed to exceed their bounds by this much (rad/s), because of rounding errors.
const INPUT_ROUNDING: f64 = 1e-12;

/// Largest heading (rad). Beyond it, too few digits remain to add whole turns.
const MOST_RAD: f64 = 1e6;

impl ReachableSet {
    /// Whether `state` (world frame) is within `tolerance` of a state that is reached after exactly `step`
    /// steps. Returns `false` for a state that is not finite or has a heading beyond 10⁶ rad.
    ///
    /// The result is `true` unless the state is proven to be [outside](Membership::Outside). So for all
    /// bounds, it is never `false` for a reachable state. It can be `true` for a state farther away if a
    /// proof would take more than 24 attempts or too much work; [`Self::state_membership`] distinguishes
    /// these cases.
    ///
    /// If the speed is chosen from a range, the result is `true` for every state whose heading is admissible and
    /// whose position is within the tolerance of a conservative polygon.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn contains_state(&self, step: usize, state: Pose, tolerance: Tolerance) -> bool {
        self.state_membership(step, state, tolerance, MOST_TRIALS) != Membership::Outside
    }

    /// Like [`Self::contains_state`], but with three possible results, and with at most `trials`
    /// attempts to prove that the state is outside. All attempts together took 30 to 230 µs per state
    /// at turns of 0.1 rad per step, over 10 to 15 steps. As for a polygon, the work is limited to four
    /// million units (some hundredths of a second), whatever the bounds, the start and the number of
    /// attempts. If the limit is exceeded, the state is [open](Membership::Open).
    ///
    /// A state found inside is reachable to within 10⁻⁶ m beyond the tolerance. If the start is a set,
    /// the state is inside if some start pose leads to it. It can also be inside if a start pose leads
    /// to a position at most 10⁻⁴ s of travel away.
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

    /// Like [`Self::state_membership`], but the caller can cancel. The method calls `progress` at the
    /// beginning and then every few tenths of a millisecond.
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
        // Every state costs at least one unit.
        budget.spend(1);
        if state.psi.abs() > MOST_RAD || !state.psi.is_finite() {
            Membership::Outside
        } else if self.paths.have_one_speed(step) {
            Origins::new(self, step, state, tolerance, budget).decide(trials)
        } else {
            self.decide_by_position(step, state, tolerance, trials, budget)
        }
    }

    /// The curves of a slice assume a constant speed. With a choice of speeds, a state is outside if its heading
    /// is not admissible or if its position is outside a conservative polygon. Otherwise it is open.
    fn decide_by_position(
        &self,
        step: usize,
        state: Pose,
        tolerance: Tolerance,
        trials: usize,
        budget: &Budget<'_>,
    ) -> Membership {
        let slack = tolerance.heading_rad + self.start_set.heading_rad;
        if self.branches(step, state, slack).next().is_none() || !self.local(state).is_finite() {
            return Membership::Outside;
        }
        if trials == 0 {
            return Membership::Open;
        }
        let accuracy_m = tolerance.position_m.clamp(1e-3, 1.0);
        let settings = PolygonSettings::new(accuracy_m, 1).unwrap_or_default().conservative();
        let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
        self.draw((step, false), settings, &mut workspace, &mut polygon, budget);
        let is_outside = || signed_distance(&polygon, state.position()) > tolerance.position_m;
        if budget.is_cancelled() || !is_outside() { Membership::Open } else { Membership::Outside }
    }

    /// How far `state` (world frame) is inside the set of states reached after exactly `step` steps. If
    /// the start is a set, only the pose in its middle counts. The margins are NaN if the state is not
    /// finite, if the speed is chosen from a range, if its heading is beyond 10⁶ rad, or if the work exceeds four million units (see
    /// [`Self::state_membership`]). The last case occurs for some states after tens of steps of half a
    /// turn.
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
        let is_known = position.norm_sqr().is_finite() && state.psi.abs() <= MOST_RAD;
        if !is_known || !self.paths.have_one_speed(step) {
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

    /// For each of `states`, the states after steps 1, 2, … (world frame), returns whether it is
    /// reached after its step, as in [`Self::contains_state`]. The work limit for a single state is
    /// divided among all states. A state that is not decided within its share counts as inside.
    ///
    /// # Panics
    /// If there are more states than [`Self::steps`].
    #[must_use]
    pub fn contains_states(&self, states: &[Pose], tolerance: Tolerance) -> Vec<bool> {
        let found = self.decide_all(0..states.len(), states, tolerance, MOST_TRIALS);
        found.map(|membership| membership != Membership::Outside).collect()
    }

    /// Decides the membership of the states at the indices `places` of a trajectory, one after the other.
    /// Each state gets an equal share of the remaining work, so all states together stay within the
    /// limit for one state.
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

    /// Whether a recorded trajectory is inside at every step. `states` are the states after each step
    /// (world frame), from the first step on. `inputs`, if known, are the turn rates held in each step
    /// (rad/s). As long as the inputs satisfy the bounds, the states are reachable by definition. From
    /// the first step whose input violates the bounds, each state must be [inside](Membership::Inside)
    /// within `tolerance`. An open state counts as not inside, so the share of contained trajectories
    /// is never overestimated. In particular, no state is inside if the speed is chosen from a range. The work limit
    /// for a single state is divided among all states.
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
        // Turn rates alone do not tell whether the speeds were admissible.
        let inputs = inputs.filter(|_| self.paths.have_one_speed(self.steps()));
        let known = inputs.map_or(0, |inputs| {
            assert!(inputs.len() >= states.len(), "an input for each state");
            bounds
                .zip(inputs)
                .take_while(|&((lo, hi), input)| {
                    (lo - INPUT_ROUNDING..=hi + INPUT_ROUNDING).contains(input)
                })
                .count()
        });
        // Later states usually need the widest bounds, so a trajectory that leaves the set is often
        // rejected at its last state.
        self.decide_all((known..states.len()).rev(), states, tolerance, 0)
            .all(|membership| membership == Membership::Inside)
    }

    /// Converts a position from the world frame (m) to the human's frame (s of travel).
    fn local(&self, state: Pose) -> Complex<f64> {
        let moved = Complex::new(state.x - self.start.x, state.y - self.start.y);
        moved * unit(-self.start.psi) / self.speed_mps
    }

    /// Lowest and highest heading after `step` steps (rad, human's frame).
    fn end_headings(&self, step: usize) -> (f64, f64) {
        (self.paths.low.heading(step), self.paths.high.heading(step))
    }

    /// The headings (rad in the human's frame, not wrapped) that equal the state's heading up to whole
    /// turns and are admissible to within `slack`.
    fn branches(&self, step: usize, state: Pose, slack: f64) -> impl Iterator<Item = f64> {
        let (low, high) = self.end_headings(step);
        let heading = state.psi - self.start.psi;
        let first = ((low - slack - heading) / TAU).ceil();
        (0..)
            .map(move |turns| heading + TAU * (first + f64::from(turns)))
            .take_while(move |heading| *heading <= high + slack)
    }
}
