//! The headings that a human can have at each instant. They form a tube, which follows from the bounds
//! on the turn rate. Branch and bound narrows the tube.

use crate::bounds::InputBounds;

/// A time interval in which the bounds on the turn rate are constant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    pub(super) seconds: f64,
    /// Lower and upper bound on the turn rate (rad/s).
    pub(super) lo: f64,
    pub(super) hi: f64,
}

/// An instant of the plan: a number of whole steps and a fraction of the next step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    pub(super) step: usize,
    pub(super) share: f64,
}

/// The bounds of all steps, divided into pieces.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    all: Vec<Piece>,
    /// Pieces per step.
    count: usize,
    straight: bool,
}

impl Pieces {
    /// Divides the steps into pieces in which a drive turns by at most `most_turn_rad`.
    pub(super) fn set(&mut self, bounds: &InputBounds, step_s: f64, most_turn_rad: f64) {
        let rates = || bounds.lo().iter().zip(bounds.hi());
        let most = rates().map(|(lo, hi)| lo.abs().max(hi.abs())).fold(0.0, f64::max);
        self.count = ((most * step_s / most_turn_rad).ceil() as usize).max(1);
        self.straight = rates().all(|(lo, hi)| *lo <= 0.0 && 0.0 <= *hi);
        let seconds = step_s / self.count as f64;
        self.all.clear();
        for (&lo, &hi) in rates() {
            self.all.extend(core::iter::repeat_n(Piece { seconds, lo, hi }, self.count));
        }
    }

    /// Number of pieces in all steps.
    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether driving straight is admissible in every step.
    pub(super) fn straight(&self) -> bool {
        self.straight
    }

    /// The first piece of the step that contains an instant. All pieces of a step have the same bounds.
    pub(super) fn at(&self, moment: Moment) -> Piece {
        self.all[moment.step * self.count]
    }

    /// The number of whole pieces before an instant, and the elapsed time in the next piece (s).
    fn before(&self, moment: Moment) -> (usize, f64) {
        let pieces = moment.share * self.count as f64;
        let whole = (pieces as usize).min(self.count - 1);
        let rest = (pieces - whole as f64) * self.at(moment).seconds;
        (moment.step * self.count + whole, rest)
    }
}

/// A subset of the drives: their heading at a knot (the end of a piece) is in a range (rad).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cut {
    /// Number of pieces before the knot, ≥ 1.
    pub(super) knot: usize,
    pub(super) lo: f64,
    pub(super) hi: f64,
}

/// Largest number of cuts that define a part.
pub(super) const MOST_CUTS: usize = 16;

/// The cuts that define a part: its drives satisfy all of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cuts {
    list: [Cut; MOST_CUTS],
    len: usize,
}

impl Cuts {
    pub(super) const NONE: Self =
        Self { list: [Cut { knot: 0, lo: 0.0, hi: 0.0 }; MOST_CUTS], len: 0 };

    /// Adds a cut, or replaces the cut at the same knot. Returns `None` if there are too many cuts.
    pub(super) fn with(mut self, cut: Cut) -> Option<Self> {
        let same = self.list[..self.len].iter().position(|other| other.knot == cut.knot);
        let place = same.unwrap_or(self.len);
        *self.list.get_mut(place)? = cut;
        self.len = self.len.max(place + 1);
        Some(self)
    }
}

/// The headings that drives can have at the end of each piece, up to some instant (rad in the world
/// frame, not wrapped). From each heading in the tube, a drive inside the tube leads to the tube's end.
#[derive(Clone, Debug, Default)]
pub(super) struct Tube {
    pub(super) pieces: Vec<Piece>,
    /// Lowest and highest heading at each knot: at the start and after each piece.
    pub(super) lo: Vec<f64>,
    pub(super) hi: Vec<f64>,
    /// Lowest and highest heading within each piece.
    pub(super) within: Vec<(f64, f64)>,
    /// Whether the last piece ends between knots.
    rest: bool,
}

/// Ranges with a smaller gap (rad) between them count as touching.
const ROUNDING_RAD: f64 = 1e-12;

impl Tube {
    /// Reserves capacity for this number of pieces.
    pub(super) fn reserve(&mut self, pieces: usize) {
        self.pieces.clear();
        self.pieces.reserve(pieces);
        self.within.clear();
        self.within.reserve(pieces);
        for headings in [&mut self.lo, &mut self.hi] {
            headings.clear();
            headings.reserve(pieces + 1);
        }
    }

    /// Sets the tube to the drives that start with heading `psi`, satisfy the cuts and end at
    /// `moment`. Returns `false` if there is no such drive.
    pub(super) fn set(&mut self, psi: f64, pieces: &Pieces, moment: Moment, cuts: &Cuts) -> bool {
        let (whole, rest) = pieces.before(moment);
        self.pieces.clear();
        self.pieces.extend_from_slice(&pieces.all[..whole]);
        self.rest = rest > 0.0;
        if self.rest {
            self.pieces.push(Piece { seconds: rest, ..pieces.all[whole] });
        }
        self.lo.clear();
        self.hi.clear();
        let (mut lo, mut hi) = (psi, psi);
        for knot in 0..=self.pieces.len() {
            if let Some(piece) = knot.checked_sub(1).map(|before| self.pieces[before]) {
                (lo, hi) = (lo + piece.lo * piece.seconds, hi + piece.hi * piece.seconds);
            }
            let ends_between = self.rest && knot == self.pieces.len();
            for cut in &cuts.list[..cuts.len] {
                if cut.knot == knot && !ends_between {
                    (lo, hi) = (lo.max(cut.lo), hi.min(cut.hi));
                }
            }
            if lo > hi + ROUNDING_RAD {
                return false;
            }
            self.lo.push(lo.min(hi));
            self.hi.push(hi);
        }
        self.narrow();
        true
    }

    /// Removes headings from which no drive leads to the end.
    fn narrow(&mut self) {
        for (k, piece) in self.pieces.iter().enumerate().rev() {
            self.lo[k] = self.lo[k].max(self.lo[k + 1] - piece.hi * piece.seconds);
            self.hi[k] = self.hi[k].min(self.hi[k + 1] - piece.lo * piece.seconds);
            // If the lowest heading is above the highest one, they differ only by a rounding error.
            if self.lo[k] > self.hi[k] {
                self.lo[k] = self.hi[k];
            }
        }
        self.within.clear();
        for (k, piece) in self.pieces.iter().enumerate() {
            let highest = highest(piece, self.hi[k], self.hi[k + 1]);
            let mirrored = Piece { seconds: piece.seconds, lo: -piece.hi, hi: -piece.lo };
            let lowest = -self::highest(&mirrored, -self.lo[k], -self.lo[k + 1]);
            self.within.push((lowest, highest));
        }
    }

    /// The range of headings at the end.
    pub(super) fn end(&self) -> (f64, f64) {
        (self.lo[self.pieces.len()], self.hi[self.pieces.len()])
    }

    /// Whether the drives can be split by their heading at a knot.
    pub(super) fn halves_at(&self, knot: usize) -> bool {
        (1..=self.knots()).contains(&knot) && self.hi[knot] - self.lo[knot] > LEAST_WIDTH_RAD
    }

    /// Number of knots at the ends of whole pieces.
    fn knots(&self) -> usize {
        self.pieces.len() - usize::from(self.rest)
    }

    /// Splits the tube at `knot` into the headings below and above `heading`. Moves `heading` inward
    /// if one part would be too narrow. If `knot` is 0, halves the tube at its widest knot instead.
    pub(super) fn halves(&self, knot: usize, heading: f64) -> Option<[Cut; 2]> {
        let width = |&knot: &usize| self.hi[knot] - self.lo[knot];
        let widest = || (1..=self.knots()).max_by(|a, b| width(a).total_cmp(&width(b)));
        let at = if knot > 0 { knot } else { widest().filter(|&knot| self.halves_at(knot))? };
        let (lo, hi) = (self.lo[at], self.hi[at]);
        let heading = if knot > 0 { heading } else { 0.5 * (lo + hi) };
        let edge = 0.2 * (hi - lo);
        let heading = heading.max(lo + edge).min(hi - edge);
        Some([Cut { knot: at, lo, hi: heading }, Cut { knot: at, lo: heading, hi }])
    }
}

/// Headings that differ by less than this (rad) count as equal.
const LEAST_WIDTH_RAD: f64 = 1e-6;

/// The highest heading within a piece, for drives that start at `from` or below and end at `to` or
/// below. The extreme drive turns left as long as it can, then right.
fn highest(piece: &Piece, from: f64, to: f64) -> f64 {
    if piece.hi <= 0.0 {
        return from;
    }
    if piece.lo >= 0.0 {
        return to;
    }
    let left_s = (to - from - piece.lo * piece.seconds) / (piece.hi - piece.lo);
    from + piece.hi * left_s.clamp(0.0, piece.seconds)
}
