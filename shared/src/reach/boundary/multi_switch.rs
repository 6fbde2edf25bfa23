//! Extremals of the rear whose rate switches more than once.
//!
//! They switch back and forth around the backward direction, φ = π. If two neighbouring switches are in
//! steps with wide bounds, shifting both moves the end farther back. Such a path does not bound the
//! set, and its second variation ([`Costate`]) is negative. The other paths switch in steps with narrow
//! bounds, and exist only for short ranges of the end heading φ. To find them all, the search starts at
//! the end headings where the last switch moves to another step. It continues as long as the
//! second-to-last switch skips a step from one extremal to the next.

use super::super::budget::Budget;
use super::super::paths::{Path, Paths};
use super::super::sampling::{Curves, Sample, triangle_height};
use super::extremal::Costate;
use crate::math::{PI, TAU, atan2};

/// If driving straight is always admissible, the bounds of a step are wide if the range of all rates is
/// at most this many times their width. No rear path with more than one switch has a switch in a step
/// with wide bounds. Measured: at 2.5 times, two switches gain 0.3 mm in 2 s; at 2 times, they gain
/// nothing.
const WIDE: f64 = 2.0;

/// Upper bound on the gain of more than one switch (s), divided by the travel time (s) and by the
/// square of the angle (rad) through which the highest rate turns in this time. The largest measured
/// value is 0.0015.
const MOST_GAIN: f64 = 0.002;

/// If driving straight is always admissible and the mean asymmetry of the bounds is below this, more
/// than one switch gains nothing. The asymmetry of a step is 0 if the narrower side of its bounds has
/// at least a quarter of the range of all rates, and 1 if this side has no width. Measured: no gain up
/// to 0.4.
const ASYMMETRY: f64 = 0.3;

/// Above [`ASYMMETRY`], the gain rises at most this many times as steeply as a straight line that
/// reaches [`MOST_GAIN`] at an asymmetry of 1. Measured: 1.35.
const STEEPNESS: f64 = 1.5;

/// Extremals with more switches than this plus the number of steps are ignored.
const MOST_SWITCHES: usize = 3;

/// Maximum depth of halving a range of end headings. Where the ends of paths jump, further halving
/// would only approach the jump.
const MOST_HALVINGS: u32 = 20;

/// Accuracy (rad) of the limits of a range of end headings, as a multiple of the tolerance divided by
/// the travel time. Measured: up to 8, no position is lost; at 32, the first positions are lost.
const EDGE: f64 = 3.0;

/// Extremals that end closer to φ = π than this (rad) are not traced, because at φ = π they can
/// chatter without end.
const AT_REST: f64 = 1e-6;

/// Appends the ends of the extremals with more than one switch, unless they gain at most half of
/// `tolerance`.
pub(super) fn append(
    paths: &Paths,
    steps: usize,
    tolerance: f64,
    curves: &mut Curves,
    budget: &Budget<'_>,
) {
    let search = Search::new(paths, steps, tolerance, budget);
    if search.gain() <= 0.5 * tolerance {
        return;
    }
    let (left, right) = paths.end_phi_range(steps);
    let mut nodes = core::mem::take(&mut curves.nodes);
    let ends = [(&paths.low, right, PI - AT_REST), (&paths.high, left + TAU, PI + AT_REST)];
    for (path, far, near) in ends {
        last_switches(path, steps, (far, near), &mut nodes);
        let mut start = search.trace(near);
        for &(phi, step) in &nodes {
            if (phi - start.phi).abs() < AT_REST {
                continue;
            }
            let end = search.trace(phi);
            let matters = search.narrow(step) || search.skips(start, end);
            if matters || start.more || end.more {
                // This is several times as many traces as a smooth curve of the horizon's length needs.
                // Where the ends chatter, no number would be enough.
                let mut traces = 64 + (2.0 * (search.seconds / tolerance).sqrt()) as usize;
                search.connect(start, end, (MOST_HALVINGS, &mut traces), curves);
            }
            start = end;
        }
    }
    curves.nodes = nodes;
}

/// Replaces `nodes` by the end headings at which a search begins, from `near` to `far`. Each node also
/// has a step: the last switch is in this step for all end headings between the previous node and this
/// one. After the last switch, the extremals follow `path`.
fn last_switches(
    path: &Path,
    steps: usize,
    (far, near): (f64, f64),
    nodes: &mut Vec<(f64, usize)>,
) {
    let (end, facing) = (path.point(steps), path.facing(steps));
    let side = (far - near).signum();
    let reach = |phi: f64| (phi - near) * side;
    nodes.clear();
    nodes.extend((0..steps).filter_map(|step| {
        // The displacement from the switch to the end is opposite to θ.
        let back = (path.point(step) - end) * facing.conj();
        let phi = -atan2(back.im, back.re);
        let phi = if phi < 0.0 { phi + TAU } else { phi };
        (reach(phi) > 0.0 && reach(phi) < reach(far)).then_some((phi, step))
    }));
    nodes.extend([(0.5 * (far + near), 0), (far, 0)]);
    nodes.sort_unstable_by(|a, b| reach(a.0).total_cmp(&reach(b.0)));
}

/// An extremal, traced back to the start.
#[derive(Clone, Copy)]
struct Trace {
    /// φ at the end (rad).
    phi: f64,
    /// Whether it has few enough switches and its second variation is not negative.
    candidate: bool,
    /// Whether it is a candidate with more than one switch.
    more: bool,
    /// One more than the step of the second-to-last switch; 0 if there is none.
    before_last: usize,
    sample: Sample,
}

struct Search<'a> {
    paths: &'a Paths,
    steps: usize,
    seconds: f64,
    tolerance: f64,
    /// Whether driving straight is always admissible.
    straight: bool,
    /// The highest rates to the left and to the right, both ≥ 0.
    rates: (f64, f64),
    budget: &'a Budget<'a>,
}

impl<'a> Search<'a> {
    fn new(paths: &'a Paths, steps: usize, tolerance: f64, budget: &'a Budget<'a>) -> Self {
        let left = paths.hi[..steps].iter().fold(0.0, |most: f64, hi| most.max(*hi));
        let right = paths.lo[..steps].iter().fold(0.0, |most: f64, lo| most.max(-lo));
        let seconds = steps as f64 * paths.step_s;
        let straight = paths.straight_always(steps);
        Self { paths, steps, seconds, tolerance, straight, rates: (left, right), budget }
    }

    /// Whether the bounds of this step are so narrow that a rear path with more than one switch can
    /// have a switch in this step.
    fn narrow(&self, step: usize) -> bool {
        let width = self.paths.hi[step] - self.paths.lo[step];
        !self.straight || WIDE * width < self.rates.0 + self.rates.1
    }

    /// Upper bound (s of travel) on how much farther back a path with more than one switch can end.
    fn gain(&self) -> f64 {
        let turn = self.rates.0.max(self.rates.1) * self.seconds;
        let most = MOST_GAIN * self.seconds * turn * turn;
        if !self.straight {
            return most;
        }
        let bounds = self.paths.lo.iter().zip(&self.paths.hi).take(self.steps);
        let quarter = 0.25 * (self.rates.0 + self.rates.1);
        let asymmetry: f64 = bounds.map(|(lo, hi)| (1.0 - hi.min(-lo) / quarter).max(0.0)).sum();
        let beyond = (asymmetry / self.steps as f64 - ASYMMETRY).max(0.0) / (1.0 - ASYMMETRY);
        most * (STEEPNESS * beyond).min(1.0)
    }

    fn trace(&self, phi: f64) -> Trace {
        let mut costate = Costate::end(phi);
        let mut candidate = true;
        for step in (0..self.steps).rev() {
            costate.back_a_step(self.paths, step);
            if costate.second_variation < 0.0 || costate.switches > MOST_SWITCHES + self.steps {
                candidate = false;
                break;
            }
        }
        self.budget.spend(costate.work);
        let more = candidate && costate.switches > 1;
        let before_last = costate.before_last.map_or(0, |step| step + 1);
        Trace { phi, candidate, more, before_last, sample: costate.sample() }
    }

    /// Whether a step with narrow bounds lies between the second-to-last switches of the two
    /// extremals.
    fn skips(&self, start: Trace, end: Trace) -> bool {
        let (a, b) = (start.before_last, end.before_last);
        (a.min(b) + 1..a.max(b)).any(|place| self.narrow(place - 1))
    }

    /// Appends the ends of the extremals between `start` and `end`. Omits extremals that are not
    /// candidates, and extremals at jumps, where an extremal passes near a singular one and its
    /// neighbours diverge. Traces at most `traces` extremals.
    fn connect(
        &self,
        start: Trace,
        end: Trace,
        (halvings, traces): (u32, &mut usize),
        curves: &mut Curves,
    ) {
        let edge = !(start.candidate && end.candidate)
            && (start.phi - end.phi).abs() * self.seconds < EDGE * self.tolerance;
        if edge || halvings == 0 || *traces == 0 || self.budget.is_spent() {
            return;
        }
        *traces -= 1;
        let middle = self.trace(0.5 * (start.phi + end.phi));
        let three = [start, middle, end];
        let close = |a: Trace, b: Trace| triangle_height(a.sample, b.sample) <= self.tolerance;
        let any = three.iter().any(|trace| trace.more);
        // The ends of the extremals can move away and come back, so the middle is checked as well.
        if any
            && three.iter().all(|trace| trace.candidate)
            && close(start, end)
            && close(start, middle)
            && close(middle, end)
        {
            let [from, through, to] = three.map(|trace| trace.sample.point);
            if curves.last() != Some(from) {
                curves.begin().push(from);
            }
            curves.points().extend([through, to]);
            return;
        }
        // If only one of two neighbours is a candidate, extremals between them can still bound the
        // set.
        let differ = |a: Trace, b: Trace| a.candidate != b.candidate;
        for (a, b) in [(start, middle), (middle, end)] {
            if any || differ(a, b) || self.skips(a, b) {
                self.connect(a, b, (halvings - 1, traces), curves);
            }
        }
    }
}
