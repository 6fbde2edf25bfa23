//! Paths of the rear whose rate jumps more than once.
//!
//! They zigzag about the direction back, φ = π. Where both jumps are between wide bounds, shifting them
//! together gets farther back, so such a path is no rear (the *firmness* of
//! [`Costate`]). Those left have a jump where bounds are narrow, and come in short stretches of end
//! headings φ. So that none is overlooked, the search is begun from where the last jump changes
//! its step, and goes on while the jump before leaves out a step.

use super::extremal::Costate;
use super::front::end_range;
use super::paths::{Path, Paths};
use super::sampling::{Curves, Sample, triangle_height};
use crate::math::{PI, TAU, atan2};

/// Bounds that always admit straight driving are wide if the rates span at most so many times
/// their width: no jump between them belongs to a rear with more than one. At 2.5
/// times, two jumps have been seen to gain 0.3 mm in 2 s; at 2 times, nothing.
const WIDE: f64 = 2.0;

/// More jumps than one gain at most this share of the time travelled, times the square of
/// what the highest rate turns by in it, rad. They have been seen to gain 0.0015.
const MOST_GAIN: f64 = 0.002;

/// Where straight driving is always admissible and bounds are less lopsided than this on average
/// (0: as wide to both sides; 1: no width to one), nothing has been seen to be gained up to 0.4.
const LOPSIDED: f64 = 0.3;

/// Beyond, gains have been seen to rise with how lopsided bounds are at most 1.35 times as
/// steeply as in proportion up to [`MOST_GAIN`].
const STEEPNESS: f64 = 1.5;

/// Extremals with more jumps than this, and one a step besides, are not looked at.
const MOST_JUMPS: usize = 3;

/// A stretch of end headings is halved at most this often. Where ends leap, more would
/// only come closer to the leap.
const MOST_HALVINGS: u32 = 20;

/// Where the extremals worth looking at stop, it is found to this much of the tolerance by
/// the time travelled, rad. Up to 8 nothing has been seen to be lost, at 32 the first places.
const EDGE: f64 = 3.0;

/// Nearer than this, rad, to φ = π at its end no extremal is traced: exactly
/// there, it may tremble without end.
const AT_REST: f64 = 1e-6;

/// Appends the ends of the extremals with more than one jump, so far as they may stay
/// farther back than those with one by more than half of `tolerance`.
pub(super) fn more_jumps(paths: &Paths, steps: usize, tolerance: f64, curves: &mut Curves) {
    let search = Search::new(paths, steps, tolerance);
    if search.gain() <= 0.5 * tolerance {
        return;
    }
    let (left, right) = end_range(paths, steps);
    let mut nodes = core::mem::take(&mut curves.nodes);
    let ends = [(&paths.low, right, PI - AT_REST), (&paths.high, left + TAU, PI + AT_REST)];
    for (path, far, near) in ends {
        last_jumps(path, steps, (far, near), &mut nodes);
        let mut start = search.trace(near);
        for &(phi, step) in &nodes {
            if (phi - start.phi).abs() < AT_REST {
                continue;
            }
            let end = search.trace(phi);
            let matters = search.narrow(step) || search.leaves_out(start, end);
            if matters || start.more || end.more {
                // Several times what a smooth curve as long as the horizon takes. Where the
                // ends of extremals that tremble run wild, there is no end to it.
                let mut traces = 64 + (2.0 * (search.seconds / tolerance).sqrt()) as usize;
                search.connect(start, end, (MOST_HALVINGS, &mut traces), curves);
            }
            start = end;
        }
    }
    curves.nodes = nodes;
}

/// The end headings to begin a search from, from near φ = π on, and the step of the last
/// jump before: until there it stays in that step. After it, `path` is followed.
fn last_jumps(path: &Path, steps: usize, (far, near): (f64, f64), nodes: &mut Vec<(f64, usize)>) {
    let (end, facing) = (path.point(steps), path.facing(steps));
    let side = (far - near).signum();
    let reach = |phi: f64| (phi - near) * side;
    nodes.clear();
    nodes.extend((0..steps).filter_map(|step| {
        // The way from the jump to the end leads straight back along θ.
        let back = (path.point(step) - end) * facing.conj();
        let phi = -atan2(back.im, back.re);
        let phi = if phi < 0.0 { phi + TAU } else { phi };
        (reach(phi) > 0.0 && reach(phi) < reach(far)).then_some((phi, step))
    }));
    nodes.extend([(0.5 * (far + near), 0), (far, 0)]);
    nodes.sort_unstable_by(|a, b| reach(a.0).total_cmp(&reach(b.0)));
}

/// An extremal traced to the start.
#[derive(Clone, Copy)]
struct Trace {
    /// At the end, rad.
    phi: f64,
    /// Whether it has few enough jumps, and may be the farthest back.
    tame: bool,
    /// Whether it has more than one besides.
    more: bool,
    /// One more than the step of the last jump but one; 0 without.
    before_last: usize,
    sample: Sample,
}

struct Search<'a> {
    paths: &'a Paths,
    steps: usize,
    seconds: f64,
    tolerance: f64,
    /// Whether straight driving is always admissible.
    straight: bool,
    /// The highest rate to the left and, without sign, to the right.
    rates: (f64, f64),
}

impl<'a> Search<'a> {
    fn new(paths: &'a Paths, steps: usize, tolerance: f64) -> Self {
        let left = paths.hi[..steps].iter().fold(0.0, |most: f64, hi| most.max(*hi));
        let right = paths.lo[..steps].iter().fold(0.0, |most: f64, lo| most.max(-lo));
        let seconds = steps as f64 * paths.step_s;
        let straight = paths.straight_always(steps);
        Self { paths, steps, seconds, tolerance, straight, rates: (left, right) }
    }

    /// May a jump between the bounds of this step belong to one of these paths? Where straight
    /// driving is not always admissible, any may.
    fn narrow(&self, step: usize) -> bool {
        let width = self.paths.hi[step] - self.paths.lo[step];
        !self.straight || WIDE * width < self.rates.0 + self.rates.1
    }

    /// At most so much, s, do these paths stay farther back.
    fn gain(&self) -> f64 {
        let turn = self.rates.0.max(self.rates.1) * self.seconds;
        let most = MOST_GAIN * self.seconds * turn * turn;
        if !self.straight {
            return most;
        }
        let bounds = self.paths.lo.iter().zip(&self.paths.hi).take(self.steps);
        let quarter = 0.25 * (self.rates.0 + self.rates.1);
        let lopsided: f64 = bounds.map(|(lo, hi)| (1.0 - hi.min(-lo) / quarter).max(0.0)).sum();
        let beyond = (lopsided / self.steps as f64 - LOPSIDED).max(0.0) / (1.0 - LOPSIDED);
        most * (STEEPNESS * beyond).min(1.0)
    }

    fn trace(&self, phi: f64) -> Trace {
        let mut costate = Costate::end(phi);
        let mut tame = true;
        for step in (0..self.steps).rev() {
            costate.back_a_step(self.paths, step);
            if costate.firmness < 0.0 || costate.switches > MOST_JUMPS + self.steps {
                tame = false;
                break;
            }
        }
        let more = tame && costate.switches > 1;
        let before_last = costate.before_last.map_or(0, |step| step + 1);
        Trace { phi, tame, more, before_last, sample: costate.sample() }
    }

    /// Whether between two the last jump but one passes over steps with narrow bounds.
    fn leaves_out(&self, start: Trace, end: Trace) -> bool {
        let (a, b) = (start.before_last, end.before_last);
        (a.min(b) + 1..a.max(b)).any(|place| self.narrow(place - 1))
    }

    /// Appends the ends of the extremals between two, without those with too many
    /// jumps, and without the places where the ends leap: there an extremal passes
    /// near a straight one, and its neighbours part. At most `traces` are made.
    fn connect(
        &self,
        start: Trace,
        end: Trace,
        (halvings, traces): (u32, &mut usize),
        curves: &mut Curves,
    ) {
        let edge = !(start.tame && end.tame)
            && (start.phi - end.phi).abs() * self.seconds < EDGE * self.tolerance;
        if edge || halvings == 0 || *traces == 0 {
            return;
        }
        *traces -= 1;
        let middle = self.trace(0.5 * (start.phi + end.phi));
        let three = [start, middle, end];
        let close = |a: Trace, b: Trace| triangle_height(a.sample, b.sample) <= self.tolerance;
        let any = three.iter().any(|trace| trace.more);
        // The ends of the extremals may run away and come back: the middle tells.
        if any
            && three.iter().all(|trace| trace.tame)
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
        for (a, b) in [(start, middle), (middle, end)] {
            if any || self.leaves_out(a, b) {
                self.connect(a, b, (halvings - 1, traces), curves);
            }
        }
    }
}
