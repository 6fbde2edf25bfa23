//! The ordered family of extremals that form the front if driving straight is not always admissible.
//!
//! Traced backward from the end, the extremals start side by side (φ rising, p = 0) and keep their
//! order. Where driving straight is admissible, one of them can run with φ = 0 and p = 0. It is the
//! *singular* extremal. At each instant, another extremal can leave the singular one to either side,
//! so a *fan* of extremals emanates from it. Traced backward, the singular extremal begins at the last
//! instant at which an extremal reaches φ = 0 and p = 0 while driving straight is admissible. It stops
//! where driving straight is not admissible.

use super::super::budget::Budget;
use super::super::paths::Paths;
use super::TRACING;
use super::divergence::{MOST_DIVERGENCES, Neighbours};
use super::extremal::{Costate, PathTime};
use crate::math::cos;
use nalgebra::Complex;

/// A part of the ordered family. Its parameter runs from `from` to `to` as φ rises.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) from: f64,
    pub(super) to: f64,
    /// The instant at which the parameter defines the extremals.
    origin: PathTime,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// The extremal ends with φ = parameter.
    End,
    /// The extremal turns at `rate` for the first `parameter` seconds, and then runs straight along the
    /// singular extremal. `rest` is the remaining distance at the origin if the whole step is straight.
    Fan { rate: f64, rest: f64 },
    /// Between two extremals that are about to diverge. The parameter is the interpolation fraction.
    Between { first: Costate, last: Costate },
}

impl Piece {
    /// The extremal with this parameter, at the origin.
    fn at_origin(&self, parameter: f64) -> Costate {
        match self.kind {
            Kind::End => Costate::end(parameter),
            Kind::Fan { rate, rest } => {
                let mut leaving = Costate::end(0.0);
                leaving.rest = Complex::new(rest - parameter, 0.0);
                leaving.before(rate, parameter)
            }
            Kind::Between { first, last } => first.between(&last, parameter),
        }
    }

    /// The extremal with this parameter, at an instant not after the origin.
    fn at(&self, paths: &Paths, instant: PathTime, parameter: f64) -> Costate {
        self.at_origin(parameter).back(paths, self.origin, instant)
    }

    /// The extremal with this parameter, at the start.
    pub(super) fn start(&self, paths: &Paths, parameter: f64) -> Costate {
        self.at_origin(parameter).to_start(paths, self.origin)
    }

    /// The extremals with these two parameters, at the origin.
    pub(super) fn between(&self, from: f64, to: f64) -> Neighbours {
        let [first, last] = [from, to].map(|parameter| self.at_origin(parameter));
        Neighbours { first, last, at: self.origin }
    }

    /// The first extremal of this piece and the last one of the piece to its left, at the earlier of
    /// the two origins.
    pub(super) fn neighbours(&self, left: &Self, paths: &Paths) -> Neighbours {
        let at = if self.origin < left.origin { self.origin } else { left.origin };
        Neighbours { first: self.at(paths, at, self.from), last: left.at(paths, at, left.to), at }
    }
}

/// Replaces `family` by the front's extremals for a horizon of `steps` steps, with φ rising (left to
/// right). If the budget is spent, some are missing.
pub(super) fn pieces(paths: &Paths, steps: usize, family: &mut Vec<Piece>, budget: &Budget<'_>) {
    let (left, right) = paths.end_phi_range(steps);
    let end = |from, to| Piece { from, to, origin: PathTime::beginning(steps), kind: Kind::End };
    family.clear();
    if left < -GAP {
        family.push(end(left, -GAP));
    }
    // Index of the singular extremal in the family, and the remaining distance along it from the
    // end of the current step.
    let mut singular = Some((family.len(), 0.0));
    if right > GAP {
        family.push(end(GAP, right));
    }
    for step in (0..steps).rev() {
        if !paths.straight_admissible(step) {
            singular = None;
            continue;
        }
        let (place, rest, last) = match singular {
            Some((place, rest)) => (place, rest + paths.step_s, paths.step_s),
            None => {
                let traces = 2 * family.len() + MOST_BISECTIONS as usize;
                budget.spend(TRACING * traces * (steps - step));
                if budget.is_spent() {
                    return;
                }
                let Some(onset) = onset(paths, step, family) else {
                    continue;
                };
                (onset.place, onset.rest, onset.seconds)
            }
        };
        singular = Some((place, rest));
        // The earlier an extremal leaves the singular one, the closer it stays to φ = 0.
        let (lo, hi) = (paths.lo[step], paths.hi[step]);
        let origin = PathTime::beginning(step);
        let fan = |from, to, rate| Piece { from, to, origin, kind: Kind::Fan { rate, rest } };
        if lo < 0.0 {
            family.insert(place, fan(GAP, last, lo));
        }
        if hi > 0.0 {
            family.insert(place, fan(last, GAP, hi));
            singular = Some((place + 1, rest));
        }
    }
}

/// The extremal that becomes singular in some step.
struct Onset {
    /// Index in the family of the first piece to its right.
    place: usize,
    /// Seconds from the beginning of the step to the onset.
    seconds: f64,
    /// The remaining distance at the beginning of the step, if the path is straight until the onset.
    rest: f64,
}

/// Half the width of the gap (rad, s or a fraction) that is left around a singular extremal in the
/// family. The gap prevents rounding errors from moving a neighbour to the wrong side.
const GAP: f64 = 1e-12;

/// If |p| is at least this (s), rounding errors move no neighbour of a singular extremal to the wrong
/// side.
const CLEAR: f64 = 1e-12;

/// The extremal that becomes singular in `step`, if any. Splits the family there. Driving straight
/// must be admissible in this step, and no extremal is allowed to be singular at its end.
fn onset(paths: &Paths, step: usize, family: &mut Vec<Piece>) -> Option<Onset> {
    let bounds = (paths.lo[step], paths.hi[step]);
    let end = PathTime::beginning(step + 1);
    let value = |piece: &Piece, parameter| p_at_zero(piece.at(paths, end, parameter), bounds);
    let inside = family
        .iter()
        .position(|piece| value(piece, piece.from) >= 0.0 && value(piece, piece.to) < 0.0);
    let mut place = match inside {
        Some(place) => split(paths, step, family, place),
        // The extremal lies in the gap between two pieces.
        None => {
            1 + family.windows(2).position(|pair| {
                value(&pair[0], pair[0].to) >= 0.0 && value(&pair[1], pair[1].from) < 0.0
            })?
        }
    };
    // If the two neighbours of the gap have diverged, there are other extremals between them.
    for _ in 0..MOST_DIVERGENCES {
        let gap = family[place].neighbours(&family[place - 1], paths);
        if gap.back(paths, end).are_one() {
            break;
        }
        let Some(close) = gap.before_divergence(paths, end) else {
            break;
        };
        // The piece runs from left to right.
        let kind = Kind::Between { first: close.last, last: close.first };
        family.insert(place, Piece { from: 0.0, to: 1.0, origin: close.at, kind });
        place = split(paths, step, family, place);
    }
    let (left, right) = (&family[place - 1], &family[place]);
    let [above, below] = [left.at(paths, end, left.to), right.at(paths, end, right.from)];
    // If the bound on one side is zero, `p_at_zero` jumps there, and possibly no extremal becomes
    // singular.
    let [more, less] = [above, below].map(|costate| p_at_zero(costate, bounds).abs());
    if more.min(less) > NEAR && more.max(less) == f64::INFINITY {
        return None;
    }
    let met = if more <= less { above } else { below };
    let rate = if met.phi > 0.0 { bounds.1 } else { bounds.0 };
    let turning = if rate == 0.0 { 0.0 } else { met.phi / rate };
    let seconds = paths.step_s - turning;
    let rest = met.before(rate, turning).rest.re + seconds;
    (seconds > 0.0).then_some(Onset { place, seconds, rest })
}

/// Splits a piece at the extremal that becomes singular in `step`. Returns the index of the right part.
fn split(paths: &Paths, step: usize, family: &mut Vec<Piece>, place: usize) -> usize {
    let bounds = (paths.lo[step], paths.hi[step]);
    let end = PathTime::beginning(step + 1);
    let left = &mut family[place];
    let (mut from, mut to) = (left.from, left.to);
    for _ in 0..MOST_BISECTIONS {
        let middle = 0.5 * (from + to);
        if p_at_zero(left.at(paths, end, middle), bounds) >= 0.0 {
            from = middle;
        } else {
            to = middle;
        }
    }
    let mut right = *left;
    let clear = |bound: f64, end_of_piece: f64| {
        let mut gap = GAP.copysign(end_of_piece - bound);
        while gap.abs() < (end_of_piece - bound).abs() {
            if p_at_zero(right.at(paths, end, bound + gap), bounds).abs() >= CLEAR {
                return bound + gap;
            }
            gap *= 4.0;
        }
        end_of_piece
    };
    left.to = clear(from, right.from);
    right.from = clear(to, right.to);
    family.insert(place + 1, right);
    place + 1
}

/// Costates closer to zero than this (s) cannot be distinguished from zero.
const NEAR: f64 = 1e-9;

const MOST_BISECTIONS: u32 = 60;

/// The value of p when an extremal, traced back from the end of a step that admits straight driving,
/// reaches φ = 0. It falls as φ rises.
fn p_at_zero(costate: Costate, (lo, hi): (f64, f64)) -> f64 {
    let p = -costate.rest.im;
    let (phi, rate) = (costate.phi, if costate.phi > 0.0 { hi } else { lo });
    if phi == 0.0 {
        p
    } else if rate == 0.0 {
        f64::INFINITY.copysign(-phi)
    } else {
        p - (1.0 - cos(phi)) / rate
    }
}
