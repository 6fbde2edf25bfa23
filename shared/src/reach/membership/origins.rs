//! Does any pose of an uncertain start lead to a state?
//!
//! All poses of a range of headings and a box of positions are decided at once: from the pose in
//! the middle the state is some distance from the reachable ones. From a pose that is turned by δ
//! and shifted by s, paths to the same end heading end at most |s| + δ·(time travelled) away from
//! those, since their headings need not change by more than δ anywhere. So the whole range is
//! decided, or halved.

use super::super::paths::unit;
use super::super::set::ReachableSet;
use super::Tolerance;
use super::slice::Slice;
use crate::math::TAU;
use crate::vehicle::Pose;
use nalgebra::Complex;

/// Distances are sought this much farther than needed, s, so that rounding decides nothing.
const GUARD: f64 = 1e-6;

/// Poses whose paths end no farther apart than this, s, count as one.
const SAME_POSE: f64 = 1e-4;

/// The question whether a start leads to a state.
pub(super) struct Origins<'a> {
    set: &'a ReachableSet,
    step: usize,
    seconds: f64,
    /// Of the state, seen from the pose in the middle, s and rad.
    position: Complex<f64>,
    heading: f64,
    /// The tolerated distance, s, including the disc of positions in which the start may be, and
    /// the tolerated turn, rad.
    near: f64,
    turn: f64,
}

/// Start poses, relative to the one in the middle: s and rad.
#[derive(Clone, Copy, Debug)]
struct Cell {
    shift: Complex<f64>,
    half: [f64; 2],
    /// Lowest and highest.
    headings: (f64, f64),
}

impl<'a> Origins<'a> {
    pub(super) fn new(
        set: &'a ReachableSet,
        step: usize,
        state: Pose,
        tolerance: Tolerance,
    ) -> Self {
        Self {
            set,
            step,
            seconds: step as f64 * set.paths.step_s,
            position: set.local(state),
            heading: state.psi - set.start.psi,
            near: (tolerance.position_m + set.start_set.extents().0) / set.speed_mps,
            turn: tolerance.heading_rad,
        }
    }

    /// Whether any pose of the start leads to the state within the tolerance.
    pub(super) fn any(&self) -> bool {
        let half = self.set.start_set.extents().1.map(|length| length / self.set.speed_mps);
        let away = self.position.norm_sqr();
        let reach = self.seconds + self.near + half[0] + half[1];
        if away.is_nan() || away > reach * reach || !self.heading.is_finite() {
            return false;
        }
        let most = self.set.start_set.heading_rad;
        let (low, high) = self.set.end_headings(self.step);
        // The state's heading is known up to whole turns; each admits some headings at the start.
        let first = ((low - self.turn - most - self.heading) / TAU).ceil();
        let turns = (0..).map(|turns| TAU * (first + f64::from(turns)));
        turns.take_while(|turns| self.heading + turns <= high + self.turn + most).any(|turns| {
            let heading = self.heading + turns;
            let from = (heading - high - self.turn).max(-most);
            let to = (heading - low + self.turn).min(most);
            let cell = Cell { shift: Complex::new(0.0, 0.0), half, headings: (from, to) };
            from <= to && self.any_of(cell, heading)
        })
    }

    /// Whether any of these poses does, if the state's heading, not wrapped, is `heading`.
    fn any_of(&self, cell: Cell, heading: f64) -> bool {
        let (from, to) = cell.headings;
        let turned = self.seconds * 0.5 * (to - from);
        let [along, across] = cell.half;
        let spread = turned + along + across;
        let middle = 0.5 * (from + to);
        let position = (self.position - cell.shift) * unit(-middle);
        let distance = self.distance(position, heading - middle, self.near + spread);
        if distance <= self.near {
            return true;
        }
        if distance > self.near + spread {
            return false;
        }
        if spread <= SAME_POSE {
            return true;
        }
        let halves = if turned >= along.max(across) {
            [(from, middle), (middle, to)].map(|headings| Cell { headings, ..cell })
        } else if along >= across {
            let half = [0.5 * along, across];
            [-half[0], half[0]].map(|by| Cell { shift: cell.shift + by, half, ..cell })
        } else {
            let half = [along, 0.5 * across];
            [-half[1], half[1]].map(|by| {
                let shift = cell.shift + Complex::new(0.0, by);
                Cell { shift, half, ..cell }
            })
        };
        halves.into_iter().any(|cell| self.any_of(cell, heading))
    }

    /// Distance of a position from those reached from the pose in the middle with a heading, or
    /// with one that differs by what is tolerated; some number above `reach` if it is more.
    fn distance(&self, position: Complex<f64>, heading: f64, reach: f64) -> f64 {
        let (low, high) = self.set.end_headings(self.step);
        let to = |heading: f64, reach: f64| {
            let slice = Slice::new(&self.set.paths, self.step, heading.clamp(low, high));
            slice.outside_by(position, self.near, reach + GUARD)
        };
        // The end of a path moves by at most this when it is turned by what is tolerated.
        let turned = reach + self.turn * self.seconds;
        let distance = to(heading, turned);
        if distance <= self.near || distance > turned {
            return distance;
        }
        let others = [heading - self.turn, heading + self.turn];
        others.into_iter().map(|heading| to(heading, reach)).fold(distance, f64::min)
    }
}
