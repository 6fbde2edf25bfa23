//! Extremal paths, traced backward from their end (Pontryagin's principle).
//!
//! Take a path whose end is the farthest in a direction θ, and the line through its end in this
//! direction. To the left of the line, the path turns at the highest rate, and to the right of it at
//! the lowest rate, because a turn moves the end perpendicular to the remaining displacement. Let φ = ψ
//! − θ for the heading ψ, and let `rest` be the remaining displacement in the frame rotated by θ. Then
//! the costate of the heading is p = −Im(rest), so p > 0 requires the highest rate and p < 0 the
//! lowest. At the end p = 0. Backward along an arc, φ and `rest` have closed forms, so each extremal is
//! exact. The value of φ at the end identifies it. An arc with p = 0 throughout is a *singular arc*,
//! which is straight with φ = 0.

use super::super::paths::{Paths, Turn, unit};
use super::super::sampling::Sample;
use crate::math::{PI, atan2};
use nalgebra::Complex;

/// The state of an extremal at one instant, relative to its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Costate {
    /// Heading minus the direction θ (rad).
    pub(super) phi: f64,
    /// e^{iφ}.
    facing: Complex<f64>,
    /// The remaining displacement, in the frame rotated by θ (s of travel).
    pub(super) rest: Complex<f64>,
    /// Number of switches between the bounds from this instant to the end.
    pub(super) switches: usize,
    /// The bound that the rate takes just after this instant. It is `Side::Straight` at the end, and
    /// before a straight arc.
    side: Side,
    /// The switch traced last, which is the earliest in time.
    switch: Switch,
    /// The smallest second variation so far, at most 0. Two neighbouring switches can be shifted so
    /// that the end stays on its line along θ. This shift moves the end back by at least the second
    /// variation (times the square of the shift). If the second variation is negative, the path is not
    /// even locally the farthest on this line.
    pub(super) second_variation: f64,
    /// The step of the second-to-last switch.
    pub(super) before_last: Option<usize>,
    /// Cost of tracing this extremal so far, in units of a budget.
    pub(super) work: usize,
}

/// Where the rate switches from one bound to the other.
#[derive(Clone, Copy, Debug)]
struct Switch {
    /// The remaining distance along θ (s).
    rest: f64,
    /// The loss along θ per squared angle of a shift (s): |sin φ| divided by the width of the bounds.
    cost: f64,
}

/// An instant, `seconds` after the beginning of a step. Instants are ordered by time.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct PathTime {
    pub(super) step: usize,
    pub(super) seconds: f64,
}

impl PathTime {
    /// The beginning of a step. For the step after the last one, this is the end of the path.
    pub(super) fn beginning(step: usize) -> Self {
        Self { step, seconds: 0.0 }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Side {
    Low,
    Straight,
    High,
}

/// Costates closer to zero than this (s) are rounding errors and count as zero.
const ZERO_COSTATE: f64 = 1e-15;

/// Costs of a turn, in units of a budget. The first one applies if p keeps its sign. Otherwise, the
/// second one applies to turns below [`BRIEF`] and the third one to longer turns.
const KEEPING: usize = 3;
const CROSSING_BRIEFLY: usize = 8;
const CROSSING: usize = 24;

/// Only a path that chatters about φ = π has more switches than this per step. It is then traced no
/// further.
const MOST_SWITCHES: usize = 8;

impl Costate {
    /// The end of the extremal that arrives with heading θ + `phi`.
    pub(super) fn end(phi: f64) -> Self {
        let rest = Complex::new(0.0, 0.0);
        let switch = Switch { rest: 0.0, cost: 0.0 };
        let facing = unit(phi);
        Self {
            phi,
            facing,
            rest,
            switches: 0,
            side: Side::Straight,
            switch,
            second_variation: 0.0,
            before_last: None,
            work: 0,
        }
    }

    /// The state `seconds` earlier, if the path turns at `rate`.
    pub(super) fn before(mut self, rate: f64, seconds: f64) -> Self {
        (self.facing, self.rest) = self.seen_before(&Turn::new(rate, seconds));
        self.phi -= rate * seconds;
        self
    }

    /// `facing` and `rest` before a turn.
    fn seen_before(&self, turn: &Turn) -> (Complex<f64>, Complex<f64>) {
        // Backward, an arc turns the other way, hence the conjugates.
        let rest = self.rest + self.facing * turn.moved.conj();
        (self.facing * turn.turned.conj(), rest)
    }

    /// The extremal at the earlier instant `to`, if `self` is at `from`.
    pub(super) fn back(mut self, paths: &Paths, from: PathTime, to: PathTime) -> Self {
        let most = MOST_SWITCHES * paths.steps();
        for step in (to.step..=from.step).rev() {
            let begin = if step == to.step { to.seconds } else { 0.0 };
            let end = if step == from.step { from.seconds } else { paths.step_s };
            if begin < end {
                self.through(paths, step, end - begin, most);
            }
        }
        self
    }

    /// Traces the extremal back from the end of `step` to its beginning.
    pub(super) fn back_a_step(&mut self, paths: &Paths, step: usize) {
        self.through(paths, step, paths.step_s, MOST_SWITCHES * paths.steps());
    }

    /// The extremal at the start, if `self` is at `from`.
    pub(super) fn to_start(self, paths: &Paths, from: PathTime) -> Self {
        self.back(paths, from, PathTime::beginning(0))
    }

    /// Traces the extremal back by `left` seconds within `step`. The result is meaningless after more
    /// than `most` switches.
    fn through(&mut self, paths: &Paths, step: usize, mut left: f64, most: usize) {
        loop {
            if self.rest.im.abs() < ZERO_COSTATE {
                self.rest.im = 0.0;
            }
            let side = self.side_before(paths.lo[step], paths.hi[step]);
            let switches = side != self.side && self.side != Side::Straight;
            if switches {
                self.note_switch(step, paths.hi[step] - paths.lo[step]);
                if self.switches > most {
                    return;
                }
            }
            self.side = side;
            let whole = match side {
                Side::Low => paths.low.turn(step),
                Side::Straight => Turn::straight(paths.step_s),
                Side::High => paths.high.turn(step),
            };
            let rate = whole.rate;
            let turn = if left == paths.step_s { whole } else { Turn::new(rate, left) };
            let (facing, rest) = self.seen_before(&turn);
            let kept = (rate * left).abs() < 1.5 && self.keeps_sign(facing, rest);
            let brief = (rate * left).abs() < BRIEF;
            self.work += if kept {
                KEEPING
            } else if brief {
                CROSSING_BRIEFLY
            } else {
                CROSSING
            };
            let crossing = if kept { None } else { self.back_to_zero(rate, left) };
            let Some((seconds, turn)) = crossing else {
                (self.facing, self.rest) = (facing, rest);
                self.phi -= rate * left;
                return;
            };
            (self.facing, self.rest) = self.seen_before(&turn);
            self.phi -= rate * seconds;
            self.rest.im = 0.0;
            left -= seconds;
        }
    }

    /// Records a switch in `step` between bounds that differ by `width`.
    fn note_switch(&mut self, step: usize, width: f64) {
        let switch = Switch { rest: self.rest.re, cost: self.facing.im.abs() / width };
        self.switches += 1;
        if self.switches == 2 {
            self.before_last = Some(step);
        }
        if self.switches > 1 {
            // The path between the switches rotates by 1/(before − after), and the path after the later
            // switch by −1/after. `variation` is the true value multiplied by the squares of both
            // denominators.
            let (before, after) = (switch.rest, self.switch.rest);
            let variation = switch.cost * after * after
                + self.switch.cost * before * before
                + (before - after) * after * before;
            self.second_variation = self.second_variation.min(variation);
        }
        self.switch = switch;
    }

    /// Whether p certainly keeps its sign back to the instant with these `facing` and `rest`, which
    /// must be less than half a turn away. If it does, Im(rest) is monotonic between the two instants,
    /// or first moves away from zero and then back.
    fn keeps_sign(&self, facing: Complex<f64>, rest: Complex<f64>) -> bool {
        let (im, growth, before) = (self.rest.im, self.facing.im, facing.im);
        if im == 0.0 {
            growth * before > 0.0
        } else {
            im * rest.im > 0.0 && (im * growth >= 0.0 || im * before < 0.0)
        }
    }

    /// Whether two extremals at the same instant differ by less than `by` (rad and s).
    pub(super) fn is_near(&self, other: &Self, by: f64) -> bool {
        (self.phi - other.phi).abs() < by && (self.rest - other.rest).norm_sqr() < by * by
    }

    /// Interpolates between two close extremals, at the fraction `share` of the way to the other.
    pub(super) fn between(&self, other: &Self, share: f64) -> Self {
        let phi = self.phi + share * (other.phi - self.phi);
        let rest = self.rest + (other.rest - self.rest) * share;
        Self { phi, facing: unit(phi), rest, work: 0, ..*self }
    }

    /// The end of the extremal relative to its start, if `self` is at the start. The normal of the
    /// boundary at the end is θ = −φ.
    pub(super) fn sample(self) -> Sample {
        let direction = self.facing.conj();
        Sample { point: direction * self.rest, direction }
    }

    /// The bound that holds just before this instant.
    fn side_before(&self, lo: f64, hi: f64) -> Side {
        let p = -self.rest.im;
        if p > 0.0 {
            return Side::High;
        }
        if p < 0.0 {
            return Side::Low;
        }
        // p is 0 here and its time derivative is sin φ, so p had the opposite sign just before.
        let growth = self.facing.im;
        if growth > 0.0 || (growth == 0.0 && hi < 0.0) {
            Side::Low
        } else if growth < 0.0 || lo > 0.0 {
            Side::High
        } else {
            Side::Straight
        }
    }

    /// The time (s) since p was last zero, if the path turns at `rate`, and the turn in between.
    /// Returns `None` unless this time is below `left`.
    ///
    /// With z = (2/rate)·tan(rate·seconds/2), Im(rest) vanishes where a·z² − b·z − Im(rest) = 0, with
    /// a = (rate/2)·(cos φ − rate·Im(rest)/2) and b = sin φ. Unlike a difference of two arc cosines,
    /// the roots of this equation keep all their digits if φ and the rate are close to zero.
    fn back_to_zero(&self, rate: f64, left: f64) -> Option<(f64, Turn)> {
        let im = self.rest.im;
        if im.abs() >= left {
            return None;
        }
        let (b, cos) = (self.facing.im, self.facing.re);
        let a = 0.5 * rate * (cos - 0.5 * rate * im);
        let discriminant = b * b + 4.0 * a * im;
        if discriminant < 0.0 {
            return None;
        }
        let q = b + discriminant.sqrt().copysign(b);
        // If Im(rest) = 0, the root z = 0 is this instant itself.
        let roots = [0.5 * q / a, if im == 0.0 { f64::NAN } else { -2.0 * im / q }];
        if rate.abs() * left < BRIEF {
            let nearest = |z: f64, other: f64| if 0.0 < other && other < z { other } else { z };
            let z = roots.into_iter().fold(f64::INFINITY, nearest);
            // For such a short turn, z exceeds the time by less than 5 %.
            if z > 1.05 * left {
                return None;
            }
            let seconds = z * brief_atan(0.5 * rate * z);
            return (seconds < left).then(|| (seconds, Turn::of_tangent(rate, z)));
        }
        let seconds = roots.map(|z| seconds(z, rate)).into_iter().fold(f64::INFINITY, f64::min);
        (seconds < left).then(|| (seconds, Turn::new(rate, seconds)))
    }
}

/// For turns by less than this (rad), a series replaces the arc tangent. Negative roots z can then be
/// ignored, because they lie beyond half a turn.
const BRIEF: f64 = 0.3;

/// atan(x)/x for |x| < 0.16, to full precision.
fn brief_atan(x: f64) -> f64 {
    let x2 = x * x;
    let mut sum = 0.0;
    for odd in [1.0 / 19.0, 1.0 / 17.0, 1.0 / 15.0, 1.0 / 13.0, 1.0 / 11.0, 1.0 / 9.0, 1.0 / 7.0] {
        sum = odd - x2 * sum;
    }
    1.0 - x2 * (1.0 / 3.0 - x2 * (1.0 / 5.0 - x2 * sum))
}

/// The first time > 0 (s) at which (2/rate)·tan(rate·time/2) is `z`. Infinite if there is no such time.
fn seconds(z: f64, rate: f64) -> f64 {
    let half = 0.5 * rate.abs();
    let turned = if half * z.abs() < 1e-8 { z } else { atan2(half * z, 1.0) / half };
    if turned > 0.0 {
        turned
    } else if turned < 0.0 && half > 0.0 {
        turned + PI / half
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::paths::arc;
    use super::*;
    use crate::bounds::InputBounds;
    use crate::math::SeededRng;

    /// The farthest that random sequences of rates get in a direction.
    fn best_of_many(paths: &Paths, direction: Complex<f64>, rng: &mut SeededRng) -> f64 {
        let mut best = f64::NEG_INFINITY;
        for _ in 0..3000 {
            let (mut end, mut heading) = (Complex::new(0.0, 0.0), 0.0);
            for step in 0..paths.steps() {
                let rate = rng.uniform(paths.lo[step], paths.hi[step]);
                end += arc(heading, rate, paths.step_s);
                heading += rate * paths.step_s;
            }
            best = best.max((end * direction.conj()).re);
        }
        best
    }

    #[test]
    fn a_brief_arc_tangent_has_all_digits() {
        for i in 1..1600 {
            let x = f64::from(i) * 1e-4;
            assert!((brief_atan(x) * x / atan2(x, 1.0) - 1.0).abs() < 5e-16, "{x}");
        }
    }

    #[test]
    fn no_random_path_gets_farther_along_the_normal() {
        let mut rng = SeededRng::new(11);
        for _ in 0..40 {
            let mut lo: Vec<f64> = (0..6).map(|_| rng.uniform(-0.5, 0.5)).collect();
            let mut hi: Vec<f64> = (0..6).map(|_| rng.uniform(-0.5, 0.5)).collect();
            for (a, b) in lo.iter_mut().zip(&mut hi) {
                if *a > *b {
                    core::mem::swap(a, b);
                }
            }
            let bounds = InputBounds::new(lo, hi, (-0.5, 0.5)).unwrap();
            let paths = Paths::new(&bounds, 0.2);
            for phi in [-0.2, -0.05, 0.02, 0.1, 0.3] {
                let start = Costate::end(phi).to_start(&paths, PathTime::beginning(6));
                let Sample { point, direction } = start.sample();
                let reached = (point * direction.conj()).re;
                assert!(reached >= best_of_many(&paths, direction, &mut rng) - 1e-12);
            }
        }
    }
}
