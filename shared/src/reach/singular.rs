//! Which extremals make up the front, in order, where driving straight is not
//! always admissible.
//!
//! Seen backward from the end, the extremals start side by side (φ rising, p = 0)
//! and keep their order. Where straight is admissible, one of them may run with
//! φ = 0 and p = 0: the *singular* one. At each instant an extremal may leave it to either
//! side, so a whole *fan* of extremals springs from it. It begins at the last
//! instant at which some extremal, coming backward, meets φ = 0 and p = 0 while
//! straight is admissible, and it stops where straight is not admissible.

use super::extremal::Costate;
use super::front::end_range;
use super::paths::Paths;
use crate::math::cos;
use nalgebra::Complex;

/// A stretch of the ordered family; its parameter runs from `from` to `to` as φ rises.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) from: f64,
    pub(super) to: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Ends with φ = parameter.
    End,
    /// Turned at `rate` in step `step` for the first `parameter` seconds of it,
    /// then ran straight along the singular extremal. What remained to be driven
    /// at the beginning of the step, had it been straight: `rest`.
    Fan { step: usize, rate: f64, rest: f64 },
}

impl Piece {
    /// The extremal named by `parameter`, at the beginning of step `first`; the
    /// horizon has `steps` steps.
    fn at(&self, paths: &Paths, steps: usize, first: usize, parameter: f64) -> Costate {
        let (costate, end) = match self.kind {
            Kind::End => (Costate::end(parameter), steps),
            Kind::Fan { step, rate, rest } => {
                let mut leaving = Costate::end(0.0);
                leaving.rest = Complex::new(rest - parameter, 0.0);
                (leaving.before(rate, parameter), step)
            }
        };
        if end > first { costate.back(paths, first, end - 1) } else { costate }
    }

    /// The extremal named by `parameter`, at the start.
    pub(super) fn start(&self, paths: &Paths, steps: usize, parameter: f64) -> Costate {
        self.at(paths, steps, 0, parameter)
    }
}

/// The front's extremals for a horizon of `steps` steps, φ rising (left to right).
/// They replace what is in `family`.
pub(super) fn pieces(paths: &Paths, steps: usize, family: &mut Vec<Piece>) {
    let (left, right) = end_range(paths, steps);
    family.clear();
    if left < -GAP {
        family.push(Piece { from: left, to: -GAP, kind: Kind::End });
    }
    // Where the singular extremal sits in the family, and what remains to be
    // driven along it from the end of the step looked at.
    let mut singular = Some((family.len(), 0.0));
    if right > GAP {
        family.push(Piece { from: GAP, to: right, kind: Kind::End });
    }
    for step in (0..steps).rev() {
        if !paths.straight_admissible(step) {
            singular = None;
            continue;
        }
        let (place, rest, last) = match singular {
            Some((place, rest)) => (place, rest + paths.step_s, paths.step_s),
            None => {
                let Some(onset) = onset(paths, steps, step, family) else {
                    continue;
                };
                (onset.split(family), onset.rest, onset.seconds)
            }
        };
        singular = Some((place, rest));
        // The earlier one leaves, the nearer to φ = 0.
        let (lo, hi) = (paths.lo[step], paths.hi[step]);
        let fan = |from, to, rate| Piece { from, to, kind: Kind::Fan { step, rate, rest } };
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
    piece: usize,
    /// In that piece; or between it and the next one.
    parameter: Option<f64>,
    /// Seconds from the beginning of the step to the onset.
    seconds: f64,
    /// What remains to be driven from the beginning of the step on, straight
    /// until the onset.
    rest: f64,
}

/// The family stops this far, rad or s, on both sides of a singular extremal, so
/// that rounding does not send a neighbour to the wrong side. The gap is bridged
/// by a chord. Only where a bound is so close to zero as `paths` allows does it span
/// more than 10⁻⁵ rad: at most 10⁻² rad, which is 10⁻⁵ of the way from the front.
const GAP: f64 = 1e-12;

impl Onset {
    /// By an extremal at the end of a step with these bounds, if φ vanishes in it.
    fn meeting(
        met: Costate,
        (lo, hi): (f64, f64),
        step_s: f64,
        piece: usize,
        parameter: Option<f64>,
    ) -> Option<Self> {
        let rate = if met.phi > 0.0 { hi } else { lo };
        let turning = if rate == 0.0 { 0.0 } else { met.phi / rate };
        let seconds = step_s - turning;
        let rest = met.before(rate, turning).rest.re + seconds;
        (seconds > 0.0).then_some(Self { piece, parameter, seconds, rest })
    }

    /// Splits the family at this extremal; answers the place between.
    fn split(&self, family: &mut Vec<Piece>) -> usize {
        let Some(parameter) = self.parameter else {
            return self.piece + 1;
        };
        let left = &mut family[self.piece];
        let gap = GAP.copysign(left.to - left.from);
        let mut right = *left;
        left.to = parameter - gap;
        right.from = parameter + gap;
        family.insert(self.piece + 1, right);
        self.piece + 1
    }
}

/// Which extremal of the family, if any, becomes singular in step `step`, where
/// straight is admissible, if none is at its end.
fn onset(paths: &Paths, steps: usize, step: usize, family: &[Piece]) -> Option<Onset> {
    let (lo, hi) = (paths.lo[step], paths.hi[step]);
    let at_end = |piece: &Piece, parameter| piece.at(paths, steps, step + 1, parameter);
    let value = |piece: &Piece, parameter| p_at_zero(at_end(piece, parameter), lo, hi);
    let inside = family
        .iter()
        .position(|piece| value(piece, piece.from) >= 0.0 && value(piece, piece.to) < 0.0);
    let (place, above, below, parameter) = if let Some(place) = inside {
        let piece = &family[place];
        let (mut from, mut to) = (piece.from, piece.to);
        for _ in 0..MOST_BISECTIONS {
            let middle = 0.5 * (from + to);
            if value(piece, middle) >= 0.0 {
                from = middle;
            } else {
                to = middle;
            }
        }
        (place, at_end(piece, from), at_end(piece, to), Some(from))
    } else {
        // In the gap between two pieces.
        let place = family.windows(2).position(|pair| {
            value(&pair[0], pair[0].to) >= 0.0 && value(&pair[1], pair[1].from) < 0.0
        })?;
        let (left, right) = (&family[place], &family[place + 1]);
        (place, at_end(left, left.to), at_end(right, right.from), None)
    };
    // Extremals may part by more than numbers can tell: the nearer one is as good. But
    // where the rate on its side is zero the value jumps, and none arrives.
    let [more, less] = [above, below].map(|costate| p_at_zero(costate, lo, hi).abs());
    if more.min(less) > NEAR && more.max(less) == f64::INFINITY {
        return None;
    }
    let met = if more <= less { above } else { below };
    Onset::meeting(met, (lo, hi), paths.step_s, place, parameter)
}

/// Costates closer to zero than this, s, may stand for zero.
const NEAR: f64 = 1e-9;

const MOST_BISECTIONS: u32 = 60;

/// The value of p with which an extremal, going back from the end of a step in
/// which straight is admissible, meets φ = 0. It falls as φ rises.
fn p_at_zero(costate: Costate, lo: f64, hi: f64) -> f64 {
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
