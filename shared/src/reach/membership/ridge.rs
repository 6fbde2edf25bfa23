//! The front of a slice where straight is admissible in some steps only.
//!
//! For each direction α, the path with ∫cos(θ − α) largest among those that turn
//! at one rate in each part of a step. The integrand is concave, so
//! dynamic programming needs no table: what can still be gained from part k on is
//! largest at one heading, the *ridge*, and the best path turns toward the next ridge
//! as far as it may. Backward, the ridge is where the gain's slope vanishes; below
//! it, the best path keeps the highest rate until it meets a ridge, above it
//! the lowest, so the slope there is a sum along that path.

use super::super::paths::{Paths, arc};
use super::search::Arc;
use super::slice::triangle;
use core::cell::RefCell;
use core::f64::consts::SQRT_2;
use nalgebra::Complex;

/// Parts of a step.
pub(super) const PARTS: usize = 4;

/// The front of the slice after `steps` steps with end heading `heading`.
pub(super) struct Ridge<'a> {
    paths: &'a Paths,
    /// After k parts: lowest and highest heading from which the end
    /// heading can be reached.
    tubes: Vec<(f64, f64)>,
    /// Scratch: the ridges of the direction looked at last.
    ridges: RefCell<Vec<f64>>,
}

/// A point of the front and the direction it belongs to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot {
    direction: f64,
    point: Complex<f64>,
}

impl<'a> Ridge<'a> {
    pub(super) fn new(paths: &'a Paths, steps: usize, heading: f64) -> Self {
        let parts = steps * PARTS;
        let mut tubes = vec![(heading, heading); parts + 1];
        for part in (0..parts).rev() {
            let (lo, hi) = turns(paths, part);
            let (lowest, highest) = tubes[part + 1];
            tubes[part] = (lowest - hi, highest - lo);
        }
        Self { paths, ridges: RefCell::new(vec![heading; parts + 1]), tubes }
    }

    /// The directions of the lowest and of the highest path.
    pub(super) fn directions(&self) -> (f64, f64) {
        let paths = self.paths;
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        let (mut lowest, mut highest) = (0.0_f64, 0.0_f64);
        for (part, tube) in self.tubes.iter().enumerate().skip(1) {
            let (lo, hi) = turns(paths, part - 1);
            low = (low + lo).max(tube.0);
            high = (high + hi).min(tube.1);
            lowest = lowest.min(low);
            highest = highest.max(high);
        }
        (lowest, highest)
    }

    fn parts(&self) -> usize {
        self.tubes.len() - 1
    }

    /// The headings at the ends of the parts that are best to have there.
    fn find_ridges(&self, direction: f64, ridges: &mut [f64]) {
        for part in (1..self.parts()).rev() {
            let later = &ridges[part..];
            let slope = |heading| self.slope(later, part, heading, direction);
            ridges[part] = zero(&slope, self.tubes[part], direction);
        }
    }

    /// How the gain from the end of part `part` − 1 on grows with the heading
    /// there. `ridges` begins there too.
    fn slope(&self, ridges: &[f64], part: usize, mut heading: f64, direction: f64) -> f64 {
        let mut sum = pull(heading - direction);
        for later in part..self.parts() - 1 {
            let (lo, hi) = turns(self.paths, later);
            let ridge = ridges[later + 1 - part];
            if heading + hi < ridge {
                heading += hi;
            } else if heading + lo > ridge {
                heading += lo;
            } else {
                break;
            }
            sum += pull(heading - direction);
        }
        sum
    }
}

impl Arc for Ridge<'_> {
    type Knot = Knot;

    fn knot(&self, direction: f64) -> Knot {
        let mut ridges = self.ridges.borrow_mut();
        self.find_ridges(direction, &mut ridges);
        let seconds = self.paths.step_s / PARTS as f64;
        let (mut point, mut heading) = (Complex::new(0.0, 0.0), 0.0);
        for (part, &ridge) in ridges.iter().skip(1).enumerate() {
            let (lo, hi) = turns(self.paths, part);
            let turn = (ridge - heading).clamp(lo, hi);
            point += arc(heading, turn / seconds, seconds);
            heading += turn;
        }
        Knot { direction, point }
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.direction, knot.point)
    }

    /// The curve turns one way, as its direction does.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        triangle(a.point, b.point, b.direction - a.direction)
    }
}

/// Least and greatest turn in a part, rad.
pub(super) fn turns(paths: &Paths, part: usize) -> (f64, f64) {
    let seconds = paths.step_s / PARTS as f64;
    (paths.lo[part / PARTS] * seconds, paths.hi[part / PARTS] * seconds)
}

/// How cos φ falls with φ, nearly: −sin φ to the third order, and constant from
/// where that has its extremes, so that what is maximised stays concave. It only
/// decides which admissible path is taken; that it is near the best is enough.
fn pull(phi: f64) -> f64 {
    let phi = phi.clamp(-SQRT_2, SQRT_2);
    phi * (phi * phi * (1.0 / 6.0) - 1.0)
}

/// Ridges are sought to so much, rad.
const PRECISE: f64 = 1e-8;

/// Where a falling function passes zero in a range, or the range's end if it does not.
/// `guess` is tried first.
fn zero(slope: &impl Fn(f64) -> f64, (mut low, mut high): (f64, f64), guess: f64) -> f64 {
    if high - low <= PRECISE {
        return 0.5 * (low + high);
    }
    let mut rises = (f64::NAN, f64::NAN);
    let mut trial = guess.clamp(low, high);
    let mut bisect = false;
    loop {
        let rise = slope(trial);
        if rise == 0.0 {
            return trial;
        }
        // What is not known of an end is found out when the zero seems to be there.
        if rise > 0.0 {
            (low, rises.0) = (trial, rise);
        } else {
            (high, rises.1) = (trial, rise);
        }
        if high - low < PRECISE {
            return 0.5 * (low + high);
        }
        trial = if rises.0.is_nan() {
            low
        } else if rises.1.is_nan() {
            high
        } else if bisect {
            0.5 * (low + high)
        } else {
            low + (high - low) * (rises.0 / (rises.0 - rises.1))
        };
        bisect = !bisect;
    }
}
