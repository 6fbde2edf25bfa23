//! How far the human can get in a direction: an upper bound, and a drive that comes close to it.
//!
//! The distance along direction α is v∫cos(θ − α), where θ(t) is the heading. In each piece of
//! time, a line above the cosine, over all headings that are possible there, replaces it. The
//! result is linear in the headings at the ends of pieces, and dynamic programming finds its
//! maximum exactly: the value function (the remaining gain) is concave and piecewise linear in the
//! heading. The maximum is an upper bound **for any choice of lines** above the cosine; good lines
//! touch the cosine at the best drive.

use super::headings::{Piece, Tube};
use crate::math::{PI, TAU, cos, sin_cos, sinc};
use core::f64::consts::FRAC_PI_2;

/// A linear function of the heading.
#[derive(Clone, Copy, Debug)]
struct Line {
    at_zero: f64,
    slope: f64,
}

impl Line {
    fn through(x: f64, y: f64, slope: f64) -> Self {
        Self { at_zero: y - slope * x, slope }
    }

    /// The tangent of the cosine at x.
    fn tangent(x: f64) -> Self {
        let (sin, cos) = sin_cos(x);
        Self::through(x, cos, -sin)
    }

    fn at(self, x: f64) -> f64 {
        self.at_zero + self.slope * x
    }

    /// A line that is nowhere below the cosine in [lo, hi]; if possible, the tangent at `touch`.
    fn above_cosine(lo: f64, hi: f64, touch: f64) -> Self {
        if hi - lo >= PI || (lo <= 0.0 && 0.0 <= hi && touch == 0.0) {
            return Self { at_zero: 1.0, slope: 0.0 };
        }
        if lo + hi < 0.0 {
            let mirrored = Self::above_cosine(-hi, -lo, -touch);
            return Self { slope: -mirrored.slope, ..mirrored };
        }
        // Now −π/2 < lo and hi < 3π/2, since the middle is at most π. Up to π/2 the cosine is
        // concave and below its tangents; beyond, it is convex. So a tangent of the concave part is
        // above the cosine if it is above it at the upper end.
        let nearest = 0.0_f64.clamp(lo, hi);
        for place in [touch.clamp(lo, hi), nearest] {
            if place.abs() <= FRAC_PI_2 {
                let line = Self::tangent(place);
                if hi <= FRAC_PI_2 || line.at(hi) >= cos(hi) {
                    return line;
                }
            }
        }
        // The nearest place is the lower end here, and the chord from there is above the cosine.
        let (at_lo, at_hi) = (cos(lo), cos(hi));
        let width = hi - lo;
        if width < NO_WIDTH_RAD {
            return Self { at_zero: at_lo + width, slope: 0.0 };
        }
        Self::through(lo, at_lo, (at_hi - at_lo) / width)
    }
}

/// In a range this narrow the cosine is constant, rad.
const NO_WIDTH_RAD: f64 = 1e-9;

/// A linear part of a concave function. Slopes are stored minus the function's tilt.
#[derive(Clone, Copy, Debug)]
struct Segment {
    slope: f64,
    length: f64,
}

/// A concave, piecewise linear function on an interval: its slopes fall.
#[derive(Clone, Debug, Default)]
struct Concave {
    from: f64,
    to: f64,
    /// Its value at `from`.
    value: f64,
    /// To be added to all slopes.
    tilt: f64,
    /// Those before `first` are no longer used.
    segments: Vec<Segment>,
    first: usize,
}

impl Concave {
    fn set_zero(&mut self, from: f64, to: f64) {
        (self.from, self.to, self.value, self.tilt) = (from, to, 0.0, 0.0);
        self.first = 0;
        self.segments.clear();
        self.segments.push(Segment { slope: 0.0, length: to - from });
    }

    /// Adds slope · θ.
    fn tilt(&mut self, slope: f64) {
        self.value += slope * self.from;
        self.tilt += slope;
    }

    /// Replaces f(θ) by the maximum over a turn δ of f(θ + δ) plus the gain of the turn itself: a
    /// parabola that is 0 at both ends of [least, most], where its slopes are ±`gain` per rad. The
    /// envelope of tangents, which is above the parabola, replaces it.
    fn turn(&mut self, least: f64, most: f64, gain: f64) {
        self.from -= most;
        self.to -= least;
        if most <= least {
            return;
        }
        if gain <= 0.0 {
            return self.insert([Segment { slope: -self.tilt, length: most - least }]);
        }
        let last = (TANGENTS - 1) as f64;
        self.insert(core::array::from_fn::<_, TANGENTS, _>(|i| {
            // The tangents at both ends are half as long as the others.
            let weight = if i == 0 || i + 1 == TANGENTS { 0.5 } else { 1.0 };
            let slope = gain * (1.0 - 2.0 * i as f64 / last) - self.tilt;
            Segment { slope, length: (most - least) * weight / last }
        }));
    }

    /// Inserts segments with falling slopes, from the last one on.
    fn insert<const N: usize>(&mut self, further: [Segment; N]) {
        let mut end = self.segments.len();
        self.segments.extend_from_slice(&further);
        for (before, segment) in further.into_iter().enumerate().rev() {
            while end > self.first && self.segments[end - 1].slope <= segment.slope {
                self.segments[end + before] = self.segments[end - 1];
                end -= 1;
            }
            self.segments[end + before] = segment;
        }
    }

    /// Restricts the function to [from, to], which is in the domain up to rounding.
    fn clip(&mut self, from: f64, to: f64) {
        while let Some(segment) = self.segments.get_mut(self.first).filter(|_| from > self.from) {
            let cut = (from - self.from).min(segment.length);
            self.from += cut;
            self.value += (segment.slope + self.tilt) * cut;
            segment.length -= cut;
            if segment.length > 0.0 {
                break;
            }
            self.first += 1;
        }
        while let Some(segment) = self.segments.last_mut().filter(|_| self.to > to) {
            let cut = (self.to - to).min(segment.length);
            self.to -= cut;
            segment.length -= cut;
            if segment.length > 0.0 {
                break;
            }
            self.segments.pop();
        }
        self.first = self.first.min(self.segments.len());
    }

    /// The range of arguments at which it is largest.
    fn best(&self) -> (f64, f64) {
        let mut place = self.from;
        let mut best = (place, place);
        for segment in &self.segments[self.first..] {
            let slope = segment.slope + self.tilt;
            if slope < -SAME_SLOPE {
                break;
            }
            place += segment.length;
            best.1 = place;
            if slope > SAME_SLOPE {
                best.0 = place;
            }
        }
        best
    }
}

/// Number of tangents of a parabola, equally spaced.
const TANGENTS: usize = 3;

/// Slopes that differ by less count as equal.
const SAME_SLOPE: f64 = 1e-12;

/// Upper bounds on how far drives get in a direction; buffers are reused.
#[derive(Clone, Debug, Default)]
pub(super) struct Farthest {
    gain: Concave,
    lines: Vec<Line>,
    /// Where the gain is largest, after each piece.
    best: Vec<(f64, f64)>,
    /// The headings of the drive, at the start and after each piece.
    drive: Vec<f64>,
    /// Two saved drives.
    kept: [Vec<f64>; 2],
    /// Where lines should touch the cosine; empty at first.
    touch: Vec<f64>,
}

/// The angle to subtract from headings to see them relative to a direction, with the middle of
/// their range in (−π, π].
pub(super) fn turns_away(alpha: f64, (lo, hi): (f64, f64)) -> f64 {
    let middle = 0.5 * (lo + hi) - alpha;
    alpha + TAU * ((middle - PI) / TAU).ceil()
}

/// The end of the drive through headings, at a constant rate in each piece; and the last heading.
fn follow(pieces: &[Piece], mut headings: impl Iterator<Item = f64>) -> ([f64; 2], f64) {
    let mut place = [0.0; 2];
    let mut from = headings.next().unwrap_or(0.0);
    for (piece, to) in pieces.iter().zip(headings) {
        let chord = piece.seconds * sinc(0.5 * (to - from));
        let (sin, cos) = sin_cos(0.5 * (from + to));
        place = [place[0] + chord * cos, place[1] + chord * sin];
        from = to;
    }
    (place, from)
}

impl Farthest {
    /// Reserves capacity for this number of pieces.
    pub(super) fn reserve(&mut self, pieces: usize) {
        self.gain.segments.clear();
        self.gain.segments.reserve(TANGENTS * pieces + 1);
        self.lines.clear();
        self.lines.reserve(pieces);
        self.best.clear();
        self.best.reserve(pieces + 1);
        let [first, second] = &mut self.kept;
        for headings in [&mut self.drive, &mut self.touch, first, second] {
            headings.clear();
            headings.reserve(pieces + 1);
        }
    }

    /// Resets where lines should touch.
    pub(super) fn begin(&mut self) {
        self.touch.clear();
    }

    /// Moves the points where lines touch the cosine nearer to the last drive.
    pub(super) fn touch_drive(&mut self) {
        let middles = self.drive.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        if self.touch.len() == self.drive.len() - 1 {
            self.touch
                .iter_mut()
                .zip(middles)
                .for_each(|(touch, middle)| *touch += 0.5 * (middle - *touch));
        } else {
            self.touch.clear();
            self.touch.extend(middles);
        }
    }

    /// An upper bound on ∫cos(θ − α) over the drives in the tube, s of travel. It also finds a
    /// drive that comes close to the bound.
    pub(super) fn bound(&mut self, tube: &Tube, alpha: f64) -> f64 {
        let pieces = &tube.pieces;
        self.lines.clear();
        for (k, &(lo, hi)) in tube.within.iter().enumerate() {
            let shift = turns_away(alpha, (lo, hi));
            let touch = match self.touch.get(k) {
                Some(touch) => touch - shift,
                // A drive that keeps as near to the direction as possible has the mean of these
                // headings in the middle of the piece.
                None => {
                    let nearest = |knot: usize| shift.max(tube.lo[knot]).min(tube.hi[knot]);
                    0.5 * (nearest(k) + nearest(k + 1)) - shift
                }
            };
            let line = Line::above_cosine(lo - shift, hi - shift, touch);
            self.lines.push(Line { at_zero: line.at(-shift), ..line });
        }
        let n = pieces.len();
        self.gain.set_zero(tube.lo[n], tube.hi[n]);
        self.best.clear();
        self.best.resize(n + 1, (0.0, 0.0));
        let mut constant = 0.0;
        for k in (0..n).rev() {
            let Piece { seconds, lo, hi } = pieces[k];
            let line = self.lines[k];
            constant += line.at_zero * seconds;
            // The integral of a heading is that of the chord between its ends, plus at most the
            // gain from turning one way first: a parabola in the turn.
            let half = 0.5 * seconds * line.slope;
            self.gain.tilt(half);
            self.best[k + 1] = self.gain.best();
            self.gain.turn(lo * seconds, hi * seconds, half.abs());
            self.gain.tilt(half);
            self.gain.clip(tube.lo[k], tube.hi[k]);
        }
        self.find_drive(tube, alpha);
        constant + self.gain.value
    }

    /// Follows the largest gains from the start; among equal ones, the nearest to the direction.
    fn find_drive(&mut self, tube: &Tube, alpha: f64) {
        self.drive.clear();
        let mut heading = tube.lo[0];
        self.drive.push(heading);
        for (k, piece) in tube.pieces.iter().enumerate() {
            let (least, most) = self.best[k + 1];
            let toward = turns_away(alpha, (least, most));
            let aim = toward.max(least).min(most);
            let lo = tube.lo[k + 1].max(heading + piece.lo * piece.seconds);
            let hi = tube.hi[k + 1].min(heading + piece.hi * piece.seconds);
            heading = aim.max(lo).min(hi);
            self.drive.push(heading);
        }
    }

    /// Where the drive ends, s of travel from its start in the world's axes, and its last heading.
    pub(super) fn end(&self, tube: &Tube) -> ([f64; 2], f64) {
        follow(&tube.pieces, self.drive.iter().copied())
    }

    /// Saves the drive, as the first or the second.
    pub(super) fn keep(&mut self, place: usize) {
        self.kept[place].clone_from(&self.drive);
    }

    /// The end of a drive between the first (share 0) and the second (1) saved drive, both in this
    /// tube. Bounds on headings and rates are convex, so they admit every drive in between.
    pub(super) fn end_between(&self, tube: &Tube, share: f64) -> ([f64; 2], f64) {
        follow(&tube.pieces, self.between(share))
    }

    /// The headings of that drive.
    fn between(&self, share: f64) -> impl Iterator<Item = f64> {
        let [first, second] = &self.kept;
        first.iter().zip(second).map(move |(a, b)| a + share * (b - a))
    }

    /// How far the last lines are above the cosine along that drive.
    pub(super) fn looseness(&self, tube: &Tube, alpha: f64, share: f64) -> Looseness {
        let mut found = Looseness { seconds: 0.0, knot: 0, heading: 0.0 };
        let mut most = 0.0;
        for (knot, heading) in self.between(share).enumerate() {
            let cosine = cos(heading - alpha);
            let beside = |piece: Option<usize>| {
                let (line, piece) =
                    piece.and_then(|k| self.lines.get(k).zip(tube.pieces.get(k)))?;
                Some(0.5 * piece.seconds * (line.at(heading) - cosine))
            };
            let here =
                beside(knot.checked_sub(1)).unwrap_or(0.0) + beside(Some(knot)).unwrap_or(0.0);
            found.seconds += here;
            if here > most && tube.halves_at(knot) {
                most = here;
                (found.knot, found.heading) = (knot, heading);
            }
        }
        found
    }
}

/// By how much a bound may be too large.
#[derive(Clone, Copy, Debug)]
pub(super) struct Looseness {
    /// In total, s of travel.
    pub(super) seconds: f64,
    /// The knot that adds most, and the heading there; 0 if there is none.
    pub(super) knot: usize,
    pub(super) heading: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    #[test]
    fn lines_are_above_the_cosine_and_touch_it() {
        let mut rng = SeededRng::new(1);
        for _ in 0..20_000 {
            let width = if rng.below(8) == 0 { 0.0 } else { rng.uniform(0.0, 3.5) };
            let lo = rng.uniform(-PI, PI) - 0.5 * width;
            let hi = lo + width;
            let touch = rng.uniform(lo - 1.0, hi + 1.0);
            let line = Line::above_cosine(lo, hi, touch);
            let over = |x: f64| line.at(x) - sin_cos(x).1;
            let gaps = (0..=200).map(|i| over(lo + width * f64::from(i) / 200.0));
            let least = gaps.fold(f64::INFINITY, f64::min);
            assert!(least >= -1e-12, "{lo} {hi} {touch}: {least}");
            assert!(width > 3.0 || least < 1e-3, "{lo} {hi} {touch}: {least}");
        }
    }

    /// Compares the maximum over turns with all turns of a fine grid.
    #[test]
    fn a_turn_gains_at_least_its_parabola() {
        let mut rng = SeededRng::new(2);
        for _ in 0..200 {
            let mut gain = Concave::default();
            gain.set_zero(-1.0, 0.5);
            gain.tilt(rng.uniform(-1.0, 1.0));
            gain.turn(-0.3, rng.uniform(-0.3, 0.4), rng.uniform(0.0, 0.5));
            gain.tilt(rng.uniform(-1.0, 1.0));
            let before = gain.clone();
            let (least, most, per_rad) = (-0.2, rng.uniform(-0.2, 0.3), rng.uniform(0.0, 0.5));
            gain.turn(least, most, per_rad);
            let at = |function: &Concave, x: f64| {
                let mut clipped = function.clone();
                clipped.clip(x, x);
                clipped.value
            };
            let (from, to) = (before.from, before.from + length(&before));
            for i in 0..=20 {
                let x = from + (to - from) * f64::from(i) / 20.0;
                for j in 0..=20 {
                    let share = f64::from(j) / 20.0;
                    let turn = least + (most - least) * share;
                    let parabola = per_rad * (most - least) * share * (1.0 - share);
                    let start = x - turn;
                    let reached = at(&gain, start);
                    assert!(reached >= at(&before, x) + parabola - 1e-12, "{x} {turn}");
                }
            }
        }
    }

    fn length(function: &Concave) -> f64 {
        function.segments[function.first..].iter().map(|segment| segment.length).sum()
    }
}
