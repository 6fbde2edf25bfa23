//! Extremal paths, traced backward from where they end (Pontryagin's principle).
//!
//! A path whose end is the farthest in some direction θ turns at the highest
//! rate while it is left of the line through its end in that direction, and at
//! the lowest while it is right of it: turning a piece of the path moves its end
//! across the line of sight. Let φ = ψ − θ, and let `rest` be the remaining displacement, seen
//! along θ. Then the costate of the heading is p = −Im(rest): p > 0 requires the highest rate,
//! p < 0 the lowest. At the end p = 0, and going back along an arc both φ and rest have a closed
//! form, so each extremal is exact; one number (φ at the end) identifies it. An arc with p = 0 throughout
//! is straight, with φ = 0: a singular arc.

use super::super::paths::{Paths, Turn, unit};
use super::super::sampling::Sample;
use crate::math::{PI, atan2};
use nalgebra::Complex;

/// An extremal at some instant, seen from its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Costate {
    /// Heading less the direction θ, rad.
    pub(super) phi: f64,
    /// e^{iφ}.
    facing: Complex<f64>,
    /// The remaining displacement, in the frame turned by θ, seconds of travel.
    pub(super) rest: Complex<f64>,
    /// Number of switches between the bounds from here to the end.
    pub(super) switches: usize,
    /// Which bound holds just after this instant; at the end, and after a
    /// straight arc, `Side::Straight`.
    side: Side,
    /// The switch traced last, the earliest in time.
    switch: Switch,
    /// The second variation: shifting two neighbouring switching times so that the end stays on
    /// its line along θ moves it back by this (times a square), or less. Below 0 the path is not
    /// even locally the farthest on that line.
    pub(super) second_variation: f64,
    /// The step of the last switch but one.
    pub(super) before_last: Option<usize>,
    /// Cost of tracing it so far, in units of a budget.
    pub(super) work: usize,
}

/// Where the rate switches from one bound to the other.
#[derive(Clone, Copy, Debug)]
struct Switch {
    /// The remaining distance along θ, s.
    rest: f64,
    /// How much a shift by a given angle costs along θ, 1/s: |sin φ| by the width of the bounds.
    cost: f64,
}

/// An instant: `seconds` after the beginning of a step. The order is that of time.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct PathTime {
    pub(super) step: usize,
    pub(super) seconds: f64,
}

impl PathTime {
    /// The beginning of a step; for the step after the last one, the end.
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

/// Costates closer to zero than this, s, count as zero: they are rounding errors.
const ZERO_COSTATE: f64 = 1e-15;

/// Cost of a turn, in units of a budget: if p keeps its sign; otherwise, if the turn is short or long.
const KEEPING: usize = 3;
const CROSSING_BRIEFLY: usize = 8;
const CROSSING: usize = 24;

/// Paths with more switches than this for each step are not traced further: only a path that
/// chatters about φ = π has that many.
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

    /// `seconds` earlier, having turned at `rate`.
    pub(super) fn before(mut self, rate: f64, seconds: f64) -> Self {
        (self.facing, self.rest) = self.seen_before(&Turn::new(rate, seconds));
        self.phi -= rate * seconds;
        self
    }

    /// `facing` and `rest` before a turn.
    fn seen_before(&self, turn: &Turn) -> (Complex<f64>, Complex<f64>) {
        // An arc seen backward turns the other way: conjugates.
        let rest = self.rest + self.facing * turn.moved.conj();
        (self.facing * turn.turned.conj(), rest)
    }

    /// The same extremal at an earlier instant, if this is at `from`.
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

    /// The same extremal at the beginning of step `step`, if this is at its end.
    pub(super) fn back_a_step(&mut self, paths: &Paths, step: usize) {
        self.through(paths, step, paths.step_s, MOST_SWITCHES * paths.steps());
    }

    /// The same extremal at the start, if this is at `from`.
    pub(super) fn to_start(self, paths: &Paths, from: PathTime) -> Self {
        self.back(paths, from, PathTime::beginning(0))
    }

    /// `left` seconds earlier in step `step`; meaningless if there are more than `most` switches.
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

    /// Records that the rate switches here, in step `step`, between bounds of this width.
    fn note_switch(&mut self, step: usize, width: f64) {
        let switch = Switch { rest: self.rest.re, cost: self.facing.im.abs() / width };
        self.switches += 1;
        if self.switches == 2 {
            self.before_last = Some(step);
        }
        if self.switches > 1 {
            // The path between the switches turns by 1/(before − after), the path after the later
            // one by −1/after; these denominators are left out here.
            let (before, after) = (switch.rest, self.switch.rest);
            let variation = switch.cost * after * after
                + self.switch.cost * before * before
                + (before - after) * after * before;
            self.second_variation = self.second_variation.min(variation);
        }
        self.switch = switch;
    }

    /// Whether p certainly does not pass zero between this instant and an earlier
    /// one, less than half a turn away, with these `facing` and `rest`: Im(rest) is monotone
    /// between them, or bulges away from zero.
    fn keeps_sign(&self, facing: Complex<f64>, rest: Complex<f64>) -> bool {
        let (im, growth, before) = (self.rest.im, self.facing.im, facing.im);
        if im == 0.0 {
            growth * before > 0.0
        } else {
            im * rest.im > 0.0 && (im * growth >= 0.0 || im * before < 0.0)
        }
    }

    /// Whether two extremals at the same instant differ by less than `by`, rad and s.
    pub(super) fn is_near(&self, other: &Self, by: f64) -> bool {
        (self.phi - other.phi).abs() < by && (self.rest - other.rest).norm_sqr() < by * by
    }

    /// An extremal between two that are close, at `share` of the way to the other.
    pub(super) fn between(&self, other: &Self, share: f64) -> Self {
        let phi = self.phi + share * (other.phi - self.phi);
        let rest = self.rest + (other.rest - self.rest) * share;
        Self { phi, facing: unit(phi), rest, work: 0, ..*self }
    }

    /// Where the extremal ends, seen from its start, if this is its start. Its
    /// normal there is the direction θ = −φ.
    pub(super) fn sample(self) -> Sample {
        let direction = self.facing.conj();
        Sample { point: direction * self.rest, direction }
    }

    /// Which bound holds just before this instant.
    fn side_before(&self, lo: f64, hi: f64) -> Side {
        let p = -self.rest.im;
        if p > 0.0 {
            return Side::High;
        }
        if p < 0.0 {
            return Side::Low;
        }
        // p vanishes here, and grows by sin φ: before, it had the other sign.
        let growth = self.facing.im;
        if growth > 0.0 || (growth == 0.0 && hi < 0.0) {
            Side::Low
        } else if growth < 0.0 || lo > 0.0 {
            Side::High
        } else {
            Side::Straight
        }
    }

    /// Turning at `rate`: how many seconds before this instant p passes zero, if fewer than
    /// `left`, and the turn until then.
    ///
    /// With z = (2/rate)·tan(rate·seconds/2), Im(rest) vanishes where
    /// a·z² − b·z − Im(rest) = 0, a = (rate/2)·(cos φ − rate·Im(rest)/2), b = sin φ.
    /// Unlike the difference of two arc cosines, its roots keep all their digits
    /// where φ and the rate are close to zero.
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
        // At Im(rest) = 0 the root z = 0 is this instant itself.
        let roots = [0.5 * q / a, if im == 0.0 { f64::NAN } else { -2.0 * im / q }];
        if rate.abs() * left < BRIEF {
            let nearest = |z: f64, other: f64| if 0.0 < other && other < z { other } else { z };
            let z = roots.into_iter().fold(f64::INFINITY, nearest);
            // The tangent of half the turn is little more than half the turn.
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

/// Turns by less than this, rad, need no arc tangent, and none of their roots comes after half
/// a turn.
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

/// The first time > 0 at which (2/rate)·tan(rate·time/2) is `z`, s; infinite if
/// there is none.
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

    /// How far in a direction the ends of random sequences of rates get.
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
