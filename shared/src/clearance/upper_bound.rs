//! An upper bound on how far the human can get in a direction, and a drive that comes close to it.
//!
//! The distance along direction α is ∫v·cos(θ − α), where θ(t) is the heading. If the speed v is chosen from a
//! range, the best speed is the highest where the cosine is positive, and the lowest elsewhere. Per second of travel
//! at the highest speed, the human gets ahead by [`ahead`]. In each piece, this function
//! is replaced by a line that is nowhere below it for all headings possible in the piece. The result is
//! linear in the headings at the ends of the pieces, apart from a concave gain per turn. Dynamic
//! programming finds its maximum, because the value function (the remaining gain) is concave and
//! piecewise linear in the heading. The maximum is an upper bound **for any choice of lines** above the
//! cosine. Good lines touch the cosine at the best drive.

use super::headings::{Piece, Tube};
use crate::math::{PI, TAU, cos, sin_cos, sinc};
use core::f64::consts::FRAC_PI_2;

/// How far the human gets ahead per second of travel at the highest speed, from the cosine of the angle between
/// heading and direction. `slow` is the lowest speed as a share of the highest.
pub(super) fn ahead(cosine: f64, slow: f64) -> f64 {
    if cosine > 0.0 { cosine } else { slow * cosine }
}

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

    /// The tangent to the cosine at x.
    fn tangent(x: f64) -> Self {
        let (sin, cos) = sin_cos(x);
        Self::through(x, cos, -sin)
    }

    fn at(self, x: f64) -> f64 {
        self.at_zero + self.slope * x
    }

    /// A line that is nowhere below [`ahead`] in [lo, hi]; if possible, the tangent at `touch`.
    fn above(lo: f64, hi: f64, touch: f64, slow: f64) -> Self {
        if hi - lo >= PI || (lo <= 0.0 && 0.0 <= hi && touch == 0.0) {
            return Self { at_zero: 1.0, slope: 0.0 };
        }
        if lo + hi < 0.0 {
            let mirrored = Self::above(-hi, -lo, -touch, slow);
            return Self { slope: -mirrored.slope, ..mirrored };
        }
        // Now −π/2 < lo and hi < 3π/2, since the middle is at most π. Up to π/2 the function is the cosine,
        // which is concave and lies below its tangents. From π/2 on it is convex, also at π/2, where its
        // slope rises from −1 to −`slow`. So a tangent to the concave part is above the function everywhere
        // if it is above the function at the upper end.
        let nearest = 0.0_f64.clamp(lo, hi);
        for place in [touch.clamp(lo, hi), nearest] {
            if place.abs() <= FRAC_PI_2 {
                let line = Self::tangent(place);
                if hi <= FRAC_PI_2 || line.at(hi) >= ahead(cos(hi), slow) {
                    return line;
                }
            }
        }
        // Here `nearest` is the lower end, and the chord from the lower end is above the function.
        let (at_lo, at_hi) = (ahead(cos(lo), slow), ahead(cos(hi), slow));
        let width = hi - lo;
        if width < NO_WIDTH_RAD {
            return Self { at_zero: at_lo + width, slope: 0.0 };
        }
        Self::through(lo, at_lo, (at_hi - at_lo) / width)
    }
}

/// In a range narrower than this (rad), the cosine counts as constant.
const NO_WIDTH_RAD: f64 = 1e-9;

/// A linear segment of a concave function. The stored slope excludes the function's tilt.
#[derive(Clone, Copy, Debug)]
struct Segment {
    slope: f64,
    length: f64,
}

/// A concave, piecewise linear function on an interval. The slopes of its segments decrease.
#[derive(Clone, Debug, Default)]
struct Concave {
    from: f64,
    to: f64,
    /// Value at `from`.
    value: f64,
    /// Slope to add to the slopes of all segments.
    tilt: f64,
    /// Segments before index `first` are no longer used.
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

    /// Adds the linear function slope · θ.
    fn tilt(&mut self, slope: f64) {
        self.value += slope * self.from;
        self.tilt += slope;
    }

    /// Replaces f(θ) by the maximum, over the turn δ, of f(θ + δ) plus the gain of the turn. The gain
    /// is a parabola in δ that is 0 at both ends of [least, most], with slopes ±`gain` per rad there.
    /// It is approximated from above by the lower envelope of some of its tangents.
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
            // The first and the last segment of the envelope are half as long as the others.
            let weight = if i == 0 || i + 1 == TANGENTS { 0.5 } else { 1.0 };
            let slope = gain * (1.0 - 2.0 * i as f64 / last) - self.tilt;
            Segment { slope, length: (most - least) * weight / last }
        }));
    }

    /// Merges `further`, whose slopes decrease, into the segments. Works from the last segment back.
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

    /// Restricts the function to [from, to], which lies in the domain up to rounding errors.
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

    /// The interval in which the function has its maximum.
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

/// Number of equally spaced tangents that approximate a parabola.
const TANGENTS: usize = 3;

/// Slopes of at most this magnitude count as 0.
const SAME_SLOPE: f64 = 1e-12;

/// Computes upper bounds on how far drives get in a direction. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Farthest {
    gain: Concave,
    lines: Vec<Line>,
    /// The headings with the largest gain, after each piece.
    best: Vec<(f64, f64)>,
    /// The drive that comes close to the bound.
    drive: Drive,
    /// Two saved drives.
    kept: [Drive; 2],
    /// The headings at which lines should touch the cosine; empty at first.
    touch: Vec<f64>,
    /// The lowest speed as a share of the highest.
    slow: f64,
}

/// A trajectory of the human with a constant turn rate and speed in each piece.
#[derive(Clone, Debug, Default)]
struct Drive {
    /// Headings at the start and after each piece (rad).
    headings: Vec<f64>,
    /// The speed in each piece, as a share of the highest.
    speeds: Vec<f64>,
}

impl Drive {
    fn clear(&mut self) {
        self.headings.clear();
        self.speeds.clear();
    }
}

/// The angle to subtract from headings to make them relative to direction `alpha`. The middle of
/// their range is then in (−π, π].
pub(super) fn turns_away(alpha: f64, (lo, hi): (f64, f64)) -> f64 {
    let middle = 0.5 * (lo + hi) - alpha;
    alpha + TAU * ((middle - PI) / TAU).ceil()
}

/// The end of the drive with these headings at the knots and a constant turn rate and speed in each piece
/// (s of travel), and its last heading.
fn follow(
    pieces: &[Piece],
    mut headings: impl Iterator<Item = f64>,
    speeds: impl Iterator<Item = f64>,
) -> ([f64; 2], f64) {
    let mut place = [0.0; 2];
    let mut from = headings.next().unwrap_or(0.0);
    for ((piece, to), speed) in pieces.iter().zip(headings).zip(speeds) {
        let chord = speed * piece.seconds * sinc(0.5 * (to - from));
        let (sin, cos) = sin_cos(0.5 * (from + to));
        place = [place[0] + chord * cos, place[1] + chord * sin];
        from = to;
    }
    (place, from)
}

impl Farthest {
    /// Reserves capacity for this number of pieces. `slow` is the lowest speed as a share of the highest.
    pub(super) fn reserve(&mut self, pieces: usize, slow: f64) {
        self.slow = slow;
        self.gain.segments.clear();
        self.gain.segments.reserve(TANGENTS * pieces + 1);
        self.lines.clear();
        self.lines.reserve(pieces);
        self.best.clear();
        self.best.reserve(pieces + 1);
        let [first, second] = &mut self.kept;
        for drive in [&mut self.drive, first, second] {
            drive.clear();
            drive.headings.reserve(pieces + 1);
            drive.speeds.reserve(pieces);
        }
        self.touch.clear();
        self.touch.reserve(pieces);
    }

    /// Resets the headings at which lines should touch the cosine.
    pub(super) fn begin(&mut self) {
        self.touch.clear();
    }

    /// Moves the points where lines touch the cosine toward the headings of the last drive.
    pub(super) fn touch_drive(&mut self) {
        let headings = &self.drive.headings;
        let middles = headings.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        if self.touch.len() == headings.len() - 1 {
            self.touch
                .iter_mut()
                .zip(middles)
                .for_each(|(touch, middle)| *touch += 0.5 * (middle - *touch));
        } else {
            self.touch.clear();
            self.touch.extend(middles);
        }
    }

    /// An upper bound on the integral of [`ahead`] over the drives in the tube (s of travel). Also finds a
    /// drive that comes close to the bound.
    pub(super) fn bound(&mut self, tube: &Tube, alpha: f64) -> f64 {
        let pieces = &tube.pieces;
        self.lines.clear();
        for (k, &(lo, hi)) in tube.within.iter().enumerate() {
            let shift = turns_away(alpha, (lo, hi));
            let touch = match self.touch.get(k) {
                Some(touch) => touch - shift,
                // The drive is assumed to stay as near to the direction as possible. In the middle of
                // the piece, its heading is about the mean of its headings at the two ends.
                None => {
                    let nearest = |knot: usize| shift.max(tube.lo[knot]).min(tube.hi[knot]);
                    0.5 * (nearest(k) + nearest(k + 1)) - shift
                }
            };
            let line = Line::above(lo - shift, hi - shift, touch, self.slow);
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
            // The integral of the heading is the integral of the chord between its end values, plus
            // a gain from turning first to one side. The largest gain is a parabola in the turn.
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

    /// Follows the headings with the largest gain from the start. Of several best headings, it takes
    /// the one nearest to the direction. The speed is the best one for the middle of each piece.
    fn find_drive(&mut self, tube: &Tube, alpha: f64) {
        self.drive.clear();
        let mut heading = tube.lo[0];
        self.drive.headings.push(heading);
        for (k, piece) in tube.pieces.iter().enumerate() {
            let (least, most) = self.best[k + 1];
            let toward = turns_away(alpha, (least, most));
            let aim = toward.max(least).min(most);
            let lo = tube.lo[k + 1].max(heading + piece.lo * piece.seconds);
            let hi = tube.hi[k + 1].min(heading + piece.hi * piece.seconds);
            let before = heading;
            heading = aim.max(lo).min(hi);
            self.drive.headings.push(heading);
            self.drive.speeds.push(self.speed(0.5 * (before + heading) - alpha));
        }
    }

    /// The speed, as a share of the highest, with which a heading gets farthest in a direction at this angle.
    pub(super) fn speed(&self, angle: f64) -> f64 {
        if self.slow < 1.0 && cos(angle) < 0.0 { self.slow } else { 1.0 }
    }

    /// The end of the drive, relative to its start (s of travel, world axes), and its last heading.
    pub(super) fn end(&self, tube: &Tube) -> ([f64; 2], f64) {
        let Drive { headings, speeds } = &self.drive;
        follow(&tube.pieces, headings.iter().copied(), speeds.iter().copied())
    }

    /// Saves the drive as the first (0) or the second (1) saved drive.
    pub(super) fn keep(&mut self, place: usize) {
        let Self { drive, kept, .. } = self;
        kept[place].headings.clone_from(&drive.headings);
        kept[place].speeds.clone_from(&drive.speeds);
    }

    /// The end of a drive that is interpolated between the first (share 0) and the second (share 1)
    /// saved drive. Both are in this tube. The constraints on headings, rates and speeds are convex, so they
    /// admit every interpolated drive.
    pub(super) fn end_between(&self, tube: &Tube, share: f64) -> ([f64; 2], f64) {
        let [first, second] = &self.kept;
        let speeds = mixed(&first.speeds, &second.speeds, share);
        follow(&tube.pieces, self.between(share), speeds)
    }

    /// The headings of the interpolated drive.
    fn between(&self, share: f64) -> impl Iterator<Item = f64> {
        let [first, second] = &self.kept;
        mixed(&first.headings, &second.headings, share)
    }

    /// How far the last lines are above the cosine along the interpolated drive.
    pub(super) fn looseness(&self, tube: &Tube, alpha: f64, share: f64) -> Looseness {
        let mut found = Looseness { seconds: 0.0, knot: 0, heading: 0.0 };
        let mut most = 0.0;
        for (knot, heading) in self.between(share).enumerate() {
            let most_ahead = ahead(cos(heading - alpha), self.slow);
            let beside = |piece: Option<usize>| {
                let (line, piece) =
                    piece.and_then(|k| self.lines.get(k).zip(tube.pieces.get(k)))?;
                Some(0.5 * piece.seconds * (line.at(heading) - most_ahead))
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

/// Interpolates between two lists of numbers.
fn mixed(first: &[f64], second: &[f64], share: f64) -> impl Iterator<Item = f64> {
    first.iter().zip(second).map(move |(a, b)| a + share * (b - a))
}

/// An estimate of how much too large a bound is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Looseness {
    /// The excess of the bound in total (s of travel).
    pub(super) seconds: f64,
    /// The knot that contributes most, and the drive's heading there. The knot is 0 if no knot
    /// contributes.
    pub(super) knot: usize,
    pub(super) heading: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;

    #[test]
    fn lines_are_above_the_function_and_touch_it() {
        let mut rng = SeededRng::new(1);
        for _ in 0..20_000 {
            let width = if rng.below(8) == 0 { 0.0 } else { rng.uniform(0.0, 3.5) };
            let lo = rng.uniform(-PI, PI) - 0.5 * width;
            let hi = lo + width;
            let touch = rng.uniform(lo - 1.0, hi + 1.0);
            let slow = if rng.below(2) == 0 { 1.0 } else { rng.unit() };
            let line = Line::above(lo, hi, touch, slow);
            let over = |x: f64| line.at(x) - ahead(cos(x), slow);
            let gaps = (0..=200).map(|i| over(lo + width * f64::from(i) / 200.0));
            let least = gaps.fold(f64::INFINITY, f64::min);
            assert!(least >= -1e-12, "{lo} {hi} {touch}: {least}");
            assert!(width > 3.0 || least < 1e-3, "{lo} {hi} {touch}: {least}");
        }
    }

    /// Compares the maximum over turns with every turn on a fine grid.
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
