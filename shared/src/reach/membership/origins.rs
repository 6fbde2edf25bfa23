//! Decides whether any pose of an uncertain start leads to a state.
//!
//! The poses of a cell (a range of headings and a box of positions) are decided together. First, the
//! distance of the state from the states reachable from the cell's middle pose is computed. From a
//! pose that is turned by δ and shifted by s, paths to the same end heading end at most |s| +
//! δ·(travel time) away from the corresponding paths from the middle pose, because the headings differ
//! by at most δ at any time. So either the distance decides the whole cell, or the cell is halved.

use super::super::budget::Budget;
use super::super::paths::unit;
use super::super::set::ReachableSet;
use super::body_point::{Claim, Prover};
use super::slice::Slice;
use super::{Membership, Tolerance};
use crate::math::{PI, TAU, hypot};
use crate::vehicle::Pose;
use nalgebra::Complex;

/// The search radius exceeds the required distance by this much (s), so that rounding errors do not
/// determine the result.
const GUARD: f64 = 1e-6;

/// Poses whose paths end at most this far apart (s) count as one pose.
const SAME_POSE: f64 = 1e-4;

/// The query whether a start set leads to a state.
pub(super) struct Origins<'a> {
    set: &'a ReachableSet,
    step: usize,
    seconds: f64,
    /// The state, relative to the start pose in the middle (s and rad).
    position: Complex<f64>,
    heading: f64,
    /// The tolerated distance (s), which includes the disc of an uncertain start position, and the
    /// tolerated difference of the headings (rad).
    near: f64,
    turn: f64,
    budget: &'a Budget<'a>,
}

/// A cell of start poses, relative to the start pose in the middle (s and rad).
#[derive(Clone, Copy, Debug)]
struct Cell {
    shift: Complex<f64>,
    half: [f64; 2],
    /// Lowest and highest heading.
    headings: (f64, f64),
}

impl Cell {
    /// Upper bound on the distance (s) between the end of a path from any pose of the cell and the end
    /// of the corresponding path from its middle pose.
    fn spread(&self, seconds: f64) -> f64 {
        0.5 * seconds * (self.headings.1 - self.headings.0) + self.half[0] + self.half[1]
    }

    /// A state, relative to the cell's middle pose.
    fn seen_from(&self, position: Complex<f64>, heading: f64) -> (Complex<f64>, f64) {
        let middle = 0.5 * (self.headings.0 + self.headings.1);
        ((position - self.shift) * unit(-middle), heading - middle)
    }

    fn halves(self, seconds: f64) -> [Self; 2] {
        let ((from, to), [along, across]) = (self.headings, self.half);
        let middle = 0.5 * (from + to);
        if 0.5 * seconds * (to - from) >= along.max(across) {
            [(from, middle), (middle, to)].map(|headings| Self { headings, ..self })
        } else if along >= across {
            let half = [0.5 * along, across];
            [-half[0], half[0]].map(|by| Self { shift: self.shift + by, half, ..self })
        } else {
            let half = [along, 0.5 * across];
            [-half[1], half[1]].map(|by| {
                let shift = self.shift + Complex::new(0.0, by);
                Self { shift, half, ..self }
            })
        }
    }
}

impl<'a> Origins<'a> {
    pub(super) fn new(
        set: &'a ReachableSet,
        step: usize,
        state: Pose,
        tolerance: Tolerance,
        budget: &'a Budget<'a>,
    ) -> Self {
        Self {
            set,
            step,
            seconds: step as f64 * set.paths.step_s,
            position: set.local(state),
            heading: state.psi - set.start.psi,
            near: (tolerance.position_m + set.start_set.extents().0) / set.speed_mps,
            // A tolerance of half a turn to either side covers all headings.
            turn: tolerance.heading_rad.min(PI),
            budget,
        }
    }

    /// Whether a pose of the start set leads to the state within the tolerance. Tries at most `trials`
    /// body points to prove that no pose does.
    pub(super) fn decide(&self, mut trials: usize) -> Membership {
        let half = self.set.start_set.extents().1.map(|length| length / self.set.speed_mps);
        let away = self.position.norm_sqr();
        let reach = self.seconds + self.near + half[0] + half[1];
        if away.is_nan() || away > reach * reach || !self.heading.is_finite() {
            return Membership::Outside;
        }
        // Half of the budget is set aside for proofs.
        let rest = self.budget.set_aside(2);
        let found = self.cells(half).any(|(cell, heading)| self.any_of(cell, heading));
        self.budget.give_back(rest);
        if found {
            return Membership::Inside;
        }
        let mut prover = Prover::default();
        // A proof for all poses of the start set does not depend on the number of whole turns, so one
        // proof is enough.
        let all = self.set.start_set.heading_rad;
        let whole = Cell { shift: Complex::new(0.0, 0.0), half, headings: (-all, all) };
        let proven = self
            .cells(half)
            .any(|(_, heading)| self.proves(whole, heading, &mut prover, &mut trials));
        let outside = proven
            || self
                .cells(half)
                .all(|(cell, heading)| self.none_of(cell, heading, &mut prover, &mut trials));
        if outside { Membership::Outside } else { Membership::Open }
    }

    /// For each possible number of whole turns in the state's heading, returns a cell with the possible
    /// start headings, and the state's heading with these turns (not wrapped).
    fn cells(&self, half: [f64; 2]) -> impl Iterator<Item = (Cell, f64)> {
        let most = self.set.start_set.heading_rad;
        let (low, high) = self.set.end_headings(self.step);
        let first = ((low - self.turn - most - self.heading) / TAU).ceil();
        let turns = (0..).map(move |turns| TAU * (first + f64::from(turns)));
        turns
            .map(|turns| self.heading + turns)
            .take_while(move |heading| *heading <= high + self.turn + most)
            .filter_map(move |heading| {
                let from = (heading - high - self.turn).max(-most);
                let to = (heading - low + self.turn).min(most);
                let cell = Cell { shift: Complex::new(0.0, 0.0), half, headings: (from, to) };
                (from <= to).then_some((cell, heading))
            })
    }

    /// Whether any pose of the cell leads to the state. `heading` is the state's heading, not wrapped.
    fn any_of(&self, cell: Cell, heading: f64) -> bool {
        self.any_near(cell, self.distance_from(cell, heading), heading)
    }

    /// Like [`Self::any_of`], given the state's `distance` from the states that the cell's middle pose
    /// leads to. Searches the nearer half of the cell first.
    fn any_near(&self, cell: Cell, distance: f64, heading: f64) -> bool {
        let spread = cell.spread(self.seconds);
        if distance <= self.near {
            return true;
        }
        if distance > self.near + spread {
            return false;
        }
        if spread <= SAME_POSE {
            return true;
        }
        let [a, b] =
            cell.halves(self.seconds).map(|half| (half, self.distance_from(half, heading)));
        let (first, second) = if a.1 <= b.1 { (a, b) } else { (b, a) };
        self.any_near(first.0, first.1, heading) || self.any_near(second.0, second.1, heading)
    }

    /// Distance of the state from the states that the cell's middle pose leads to; see
    /// [`Self::distance`].
    fn distance_from(&self, cell: Cell, heading: f64) -> f64 {
        let (position, turned) = cell.seen_from(self.position, heading);
        self.distance(position, turned, self.near + cell.spread(self.seconds))
    }

    /// Whether it is proven that no pose of the cell leads to the state.
    fn none_of(&self, cell: Cell, heading: f64, prover: &mut Prover, trials: &mut usize) -> bool {
        if self.proves(cell, heading, prover, trials) {
            return true;
        }
        *trials > 0
            && !self.budget.is_spent()
            && cell.spread(self.seconds) > SAME_POSE
            && cell
                .halves(self.seconds)
                .into_iter()
                .all(|cell| self.none_of(cell, heading, prover, trials))
    }

    /// Whether one body point proves that no pose of the cell leads to the state.
    fn proves(&self, cell: Cell, heading: f64, prover: &mut Prover, trials: &mut usize) -> bool {
        let (position, turned) = cell.seen_from(self.position, heading);
        let claim = Claim {
            position,
            heading: turned,
            near: self.near + hypot(cell.half[0], cell.half[1]),
            turn: self.turn,
            start_heading: 0.5 * (cell.headings.1 - cell.headings.0),
        };
        prover.proves(&self.set.paths, self.step, claim, trials, self.budget)
    }

    /// Distance of a position from the positions reached from the middle pose with `heading`, or with a
    /// heading within the tolerance. If the distance exceeds `reach`, returns some number above `reach`.
    fn distance(&self, position: Complex<f64>, heading: f64, reach: f64) -> f64 {
        let (low, high) = self.set.end_headings(self.step);
        let to = |heading: f64, reach: f64| {
            let heading = heading.clamp(low, high);
            let slice = Slice::new(&self.set.paths, self.step, heading, self.budget);
            slice.outside_by(position, self.near, reach + GUARD)
        };
        // The second term bounds how far the end of a path moves if its heading changes by the
        // tolerance.
        let turned = reach + self.turn * self.seconds;
        let distance = to(heading, turned);
        if distance <= self.near || distance > turned {
            return distance;
        }
        let others = [heading - self.turn, heading + self.turn];
        others.into_iter().map(|heading| to(heading, reach)).fold(distance, f64::min)
    }
}
