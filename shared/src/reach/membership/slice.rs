//! The boundary of the positions reached after a number of steps with one end heading ψ.
//!
//! Three curves of paths run from the lowest path that ends with heading ψ to the highest one:
//!
//! * **window of lo**: bang-bang paths with the lowest rates between two switches and the highest rates
//!   otherwise. ψ fixes the time between the switches, so one parameter is free;
//! * **window of hi**: the corresponding paths with the bounds exchanged;
//! * **front**: paths that turn toward a direction at full rate, go straight, and turn to ψ at full rate
//!   (if driving straight is not always admissible, see `mixed_front`).
//!
//! If every step turns left, the paths of the window of lo get farthest. If every step turns right,
//! the paths of the window of hi get farthest. Otherwise both windows are rears, and paths with more
//! switches can stay even farther back (`multi_switch`). By Pontryagin's principle the rate is hi on
//! the left of some line and lo on its right; for constant bounds see Patsko, Pyatko and Fedotov 2003,
//! "Three-dimensional reachability set for a nonlinear control system". Lengths are in seconds of
//! travel, in the human's frame.

use super::super::budget::Budget;
use super::super::paths::{Path, Paths, unit};
use super::mixed_front::MixedFront;
use super::multi_switch::Loop;
use super::parts::Parts;
use super::search::{Arc, Search, deviation_of_turn};
use super::span::Span;
use nalgebra::Complex;

/// The slice for one end heading.
#[derive(Clone, Copy)]
pub(super) struct Slice<'a> {
    budget: &'a Budget<'a>,
    span: Span<'a>,
    /// The end heading of the path with the highest rates, minus the end heading of the slice (rad).
    below_high: f64,
    /// The end heading of the slice, minus the end heading of the path with the lowest rates (rad).
    above_low: f64,
    kind: Kind,
}

/// The turns that the bounds admit. They determine the kind of front.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    AlwaysLeft,
    AlwaysRight,
    BothWays,
    StraightAdmissible,
    Mixed,
}

/// A curve of the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Curve {
    LoWindow,
    HiWindow,
    Straight,
    MixedFront,
    MultiSwitch,
}

/// Paths with more than two switches are searched only within a certain distance of the other curves.
/// The distance is this constant times the travel time (s), times the square of the angle (rad)
/// through which the fastest rate turns in this time. The largest measured gain corresponds to 0.0018.
const MOST_GAIN: f64 = 0.002;

/// Cost of a point of a window or of the front, in units of a [`Budget`].
const OF_KNOT: usize = 24;

/// Width of a loop of paths with more than two switches (s).
const LOOP_S: f64 = 0.04;

const WINDOWS: [Curve; 2] = [Curve::LoWindow, Curve::HiWindow];

impl<'a> Slice<'a> {
    /// The slice after `steps` steps. `heading` (rad, not wrapped) must be admissible. Once the budget
    /// is spent, the results of the slice's methods are meaningless.
    pub(super) fn new(
        paths: &'a Paths,
        steps: usize,
        heading: f64,
        budget: &'a Budget<'a>,
    ) -> Self {
        let span = Span::new(paths, steps, heading);
        let kind = if span.bounds().all(|(lo, _)| lo >= 0.0) {
            Kind::AlwaysLeft
        } else if span.bounds().all(|(_, hi)| hi <= 0.0) {
            Kind::AlwaysRight
        } else if span.bounds().all(|(lo, hi)| lo < 0.0 && 0.0 < hi) {
            Kind::BothWays
        } else if span.bounds().all(|(lo, hi)| lo <= 0.0 && 0.0 <= hi) {
            Kind::StraightAdmissible
        } else {
            Kind::Mixed
        };
        Self {
            budget,
            span,
            below_high: (paths.high.heading(steps) - heading).max(0.0),
            above_low: (heading - paths.low.heading(steps)).max(0.0),
            kind,
        }
    }

    /// The curve whose paths get farthest.
    pub(super) fn front(&self) -> Curve {
        match self.kind {
            Kind::AlwaysLeft => Curve::LoWindow,
            Kind::AlwaysRight => Curve::HiWindow,
            Kind::BothWays | Kind::StraightAdmissible => Curve::Straight,
            Kind::Mixed => Curve::MixedFront,
        }
    }

    /// All curves except the loops of `multi_switch`.
    fn curves(&self) -> impl Iterator<Item = Curve> {
        WINDOWS.into_iter().chain(Some(self.front()).filter(|front| !WINDOWS.contains(front)))
    }

    /// Whether paths with more than two switches can stay farther back than the windows.
    fn needs_more_switches(&self) -> bool {
        matches!(self.kind, Kind::StraightAdmissible | Kind::Mixed)
    }

    /// The distance (s) from the other curves within which paths with more switches are searched.
    fn most_gain(&self) -> f64 {
        let rates = self.span.bounds().flat_map(|(lo, hi)| [lo, hi]);
        let fastest = rates.fold(0.0, |most: f64, rate| most.max(rate.abs()));
        let seconds = (self.span.last - self.span.first) as f64 * self.span.paths.step_s;
        MOST_GAIN * seconds * (fastest * seconds) * (fastest * seconds)
    }

    /// Distance of a position from the slice (s); 0 if the position is inside. The search ends when it
    /// finds a distance of `enough` or less. If the distance is `reach` or more, or if the budget is
    /// spent, the result is some number ≥ `reach`.
    pub(super) fn outside_by(&self, position: Complex<f64>, enough: f64, reach: f64) -> f64 {
        let mut nearest = f64::INFINITY;
        let mut winding = None;
        let depth = enough + self.most_gain();
        let reach = if self.needs_more_switches() { reach.max(depth) } else { reach };
        let mut windows = [None; 2];
        if self.budget.is_spent() {
            return f64::INFINITY;
        }
        for (i, curve) in self.curves().enumerate() {
            let search = self.search(curve, position, enough, reach);
            if search.found() {
                return search.distance;
            }
            if self.budget.is_spent() {
                return f64::INFINITY;
            }
            if *winding.get_or_insert(search.crossings) != search.crossings {
                return 0.0;
            }
            nearest = nearest.min(search.distance);
            if let Some(window) = windows.get_mut(i) {
                *window = Some(search);
            }
        }
        if self.needs_more_switches() {
            for (curve, window) in WINDOWS.into_iter().zip(windows) {
                let Some(window) = window.filter(|window| window.distance < depth) else {
                    continue;
                };
                let search = self.more_switches(curve, &window, position, enough, reach);
                if search.found() {
                    return search.distance;
                }
                if self.budget.is_spent() {
                    return f64::INFINITY;
                }
                if search.crossings != 0 {
                    return 0.0;
                }
                nearest = nearest.min(search.distance);
            }
        }
        nearest
    }

    /// The point nearest to a position on all curves except the loops of `multi_switch`, and its distance
    /// (s).
    pub(super) fn nearest(&self, position: Complex<f64>) -> (Complex<f64>, f64) {
        let searches = self.curves().map(|curve| self.search(curve, position, 0.0, f64::INFINITY));
        let nearest = searches.min_by(|a, b| a.distance.total_cmp(&b.distance));
        nearest.map_or((position, 0.0), |search| (search.point, search.distance))
    }

    /// Signed distance of a position from the slice's boundary (s; positive inside), and the nearest
    /// curve.
    pub(super) fn margin(&self, position: Complex<f64>) -> (f64, Curve) {
        let mut found: [Option<(Curve, Search<'_>)>; 5] = [None; 5];
        for (place, curve) in found.iter_mut().zip(self.curves()) {
            *place = Some((curve, self.search(curve, position, 0.0, f64::INFINITY)));
        }
        if self.needs_more_switches() {
            for (i, curve) in WINDOWS.into_iter().enumerate() {
                let Some((_, window)) = found[i] else { continue };
                if window.distance < self.most_gain() {
                    let mut search =
                        self.more_switches(curve, &window, position, 0.0, f64::INFINITY);
                    // The curve is the window with the loop joined to it.
                    search.crossings += window.crossings;
                    found[3 + i] = Some((Curve::MultiSwitch, search));
                }
            }
        }
        let found = || found.iter().flatten();
        let nearer = |a: (f64, Curve), b: (f64, Curve)| if b.0 < a.0 { b } else { a };
        // A position that two curves surround is inside. Its margin is its distance from the nearer
        // curve.
        let pairs = found().flat_map(|(first, a)| {
            found()
                .filter(|(_, b)| a.crossings != b.crossings)
                .map(move |(second, b)| nearer((a.distance, *first), (b.distance, *second)))
        });
        let inside = pairs.reduce(|a, b| if b.0 > a.0 { b } else { a });
        inside.unwrap_or_else(|| {
            let (distance, curve) = found()
                .map(|(curve, search)| (search.distance, *curve))
                .fold((f64::INFINITY, self.front()), nearer);
            (-distance, curve)
        })
    }

    /// Searches the loop of paths with more switches that adjoins a window near the position.
    fn more_switches(
        &self,
        curve: Curve,
        found: &Search<'_>,
        position: Complex<f64>,
        enough: f64,
        reach: f64,
    ) -> Search<'a> {
        let mut search = Search::new(position, enough, reach, self.budget);
        let (window, most) = match curve {
            Curve::LoWindow => (self.lo_window(), self.above_low),
            _ => (self.hi_window(), self.below_high),
        };
        let knot = window.knot(found.nearest);
        let apart = 0.5 * LOOP_S / (knot.to - knot.from).max(LOOP_S);
        let parameters = [-apart, 0.0, apart].map(|by| (found.nearest + by).clamp(0.0, most));
        let headings = |parameter: f64, path: &mut [f64]| window.headings(parameter, path);
        // The middle path of the loop is improved until it ends in the middle of the range of
        // sufficient distances, or as far out as possible if the distance itself is needed.
        let beyond = if reach.is_finite() { -0.5 * enough } else { f64::INFINITY };
        let found = Loop::new(self.span, headings, parameters, (position, beyond), self.budget);
        search.follow(&found, [0.0, 1.0, 2.0, 3.0]);
        search
    }

    fn search(&self, curve: Curve, position: Complex<f64>, enough: f64, reach: f64) -> Search<'a> {
        let mut search = Search::new(position, enough, reach, self.budget);
        let paths = self.span.paths;
        match curve {
            Curve::LoWindow => {
                search.follow(&self.lo_window(), [0.0, self.above_low]);
            }
            Curve::HiWindow => {
                search.follow(&self.hi_window(), [self.below_high, 0.0]);
            }
            Curve::Straight => {
                let lowest = paths.low.at(self.apart_by(self.below_high)).1;
                let highest = paths.high.at(self.apart_by(self.above_low)).1;
                let start = paths.low.heading(self.span.first);
                let mut directions = [lowest, start, self.span.last_heading(), highest];
                directions.sort_by(f64::total_cmp);
                for direction in &mut directions {
                    *direction = direction.clamp(lowest.min(highest), highest);
                }
                search.follow(&Straight { slice: self }, directions);
            }
            Curve::MixedFront | Curve::MultiSwitch => {
                let front = MixedFront::new(self.span);
                let (lowest, highest) = front.directions();
                search.follow(&front, [lowest, highest]);
                // The ends of this front differ slightly from the ends of the windows.
                let window = self.lo_window();
                let tips = [0.0, self.above_low].map(|from| window.knot(from).point);
                let [first, last] =
                    [lowest, highest].map(|end| MixedFront::place(front.knot(end)).1);
                search.join(tips[0], first);
                search.join(last, tips[1]);
            }
        }
        search
    }

    fn lo_window(&self) -> Window<'_> {
        let (outer, inner) = (&self.span.paths.high, &self.span.paths.low);
        Window { slice: self, outer, inner, width: self.below_high, sign: 1.0 }
    }

    fn hi_window(&self) -> Window<'_> {
        let (outer, inner) = (&self.span.paths.low, &self.span.paths.high);
        Window { slice: self, outer, inner, width: self.above_low, sign: -1.0 }
    }

    /// The moment at which the difference between the headings of the two outermost paths reaches `turn`.
    fn apart_by(&self, turn: f64) -> Moment {
        let (low, high) = (&self.span.paths.low, &self.span.paths.high);
        self.instant(turn, |step| high.heading(step) - low.heading(step))
    }

    /// The moment at which a quantity reaches `value`, or the nearer end of the steps with a choice if
    /// it never reaches `value`. The quantity never decreases. It is linear between its values `at` the
    /// beginning of each step.
    fn instant(&self, value: f64, at: impl Fn(usize) -> f64) -> Moment {
        let (mut first, mut last) = (self.span.first, self.span.last);
        // Invariant: at(first) ≤ value < at(last), if there are such steps.
        while first + 1 < last {
            let middle = usize::midpoint(first, last);
            if at(middle) <= value {
                first = middle;
            } else {
                last = middle;
            }
        }
        let step_s = self.span.paths.step_s;
        let (from, to) = (at(first), at(last));
        let share = if to > from { ((value - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        Moment { step: first, seconds: share * step_s, time: (first as f64 + share) * step_s }
    }
}

/// A moment: `seconds` after the beginning of a step, `time` after the start.
#[derive(Clone, Copy, Debug)]
struct Moment {
    step: usize,
    seconds: f64,
    time: f64,
}

impl Path {
    /// Position and heading at an instant.
    fn at(&self, instant: Moment) -> (Complex<f64>, f64) {
        self.within(instant.step, instant.seconds)
    }
}

/// A point of a curve. The derivative of the curve is ±i·∫e^{iθ} over a stretch of the path.
#[derive(Clone, Copy, Debug)]
struct Knot {
    parameter: f64,
    point: Complex<f64>,
    /// Beginning and end of the stretch (s after the start).
    from: f64,
    to: f64,
}

/// Paths with the rates of `outer`, except for a stretch with the rates of `inner`. At the end of the
/// stretch, the heading differs by `width` from the heading of `outer`. The parameter is the difference
/// between the headings of the two outermost paths at the beginning of the stretch.
struct Window<'a> {
    slice: &'a Slice<'a>,
    outer: &'a Path,
    inner: &'a Path,
    width: f64,
    /// 1 if `outer` is the highest path, −1 if it is the lowest.
    sign: f64,
}

impl Window<'_> {
    /// Fills in the headings after each part, for the path with this parameter.
    fn headings(&self, parameter: f64, path: &mut [f64]) {
        let parts = Parts::new(self.slice.span);
        let (mut low, mut high) = (parts.heading, parts.heading);
        for (part, heading) in path.iter_mut().enumerate() {
            let (lo, hi) = parts.turns(part);
            (low, high) = (low + lo, high + hi);
            let inside = (high - low - parameter).clamp(0.0, self.width);
            *heading = if self.sign > 0.0 { high - inside } else { low + inside };
        }
    }
}

impl Arc for Window<'_> {
    type Knot = Knot;

    fn knot(&self, parameter: f64) -> Knot {
        let slice = self.slice;
        let (from, to) = (slice.apart_by(parameter), slice.apart_by(parameter + self.width));
        let before = self.outer.at(from).0;
        let stretch = self.inner.at(to).0 - self.inner.at(from).0;
        let after = self.outer.point(slice.span.steps) - self.outer.at(to).0;
        let point =
            before + unit(self.sign * parameter) * stretch + unit(-self.sign * self.width) * after;
        Knot { parameter, point, from: from.time, to: to.time }
    }

    fn work(&self) -> usize {
        OF_KNOT
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.parameter, knot.point)
    }

    /// The deviation from a chord is at most a quarter of the parameter range times the change of the
    /// derivative. The derivative changes because the stretch moves and turns.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        let range = (b.parameter - a.parameter).abs();
        let moved = (b.from - a.from).abs() + (b.to - a.to).abs();
        let longest = a.to.max(b.to) - a.from.min(b.from);
        0.25 * range * (moved + range * longest)
    }
}

/// Headings closer together than this (rad) differ only by rounding errors.
const SAME_HEADING: f64 = 1e-9;

/// Paths that turn at full rate toward a direction (the parameter), go straight, and turn at full rate
/// to the end heading.
struct Straight<'a> {
    slice: &'a Slice<'a>,
}

impl Arc for Straight<'_> {
    type Knot = Knot;

    fn knot(&self, direction: f64) -> Knot {
        let slice = self.slice;
        let (low, high) = (&slice.span.paths.low, &slice.span.paths.high);
        let falling = |heading: f64| slice.instant(-heading, |step| -low.heading(step));
        let rising = |heading: f64| slice.instant(heading, |step| high.heading(step));
        let start = low.heading(slice.span.first);
        let (mut from, toward) =
            if direction >= start { (rising(direction), high) } else { (falling(direction), low) };
        let (mut to, path, turn) = if direction >= slice.span.last_heading() {
            (falling(direction - slice.above_low), low, slice.above_low)
        } else {
            (rising(direction + slice.below_high), high, -slice.below_high)
        };
        // Where the full rate is zero, the turn is a straight line too, and the computed instant can
        // be anywhere on it.
        if to.time < from.time {
            if (toward.at(to).1 - direction).abs() < SAME_HEADING {
                from = to;
            } else {
                to = from;
            }
        }
        let first = toward.at(from).0;
        let last = unit(turn) * (path.point(slice.span.steps) - path.at(to).0);
        let straight_s = to.time - from.time;
        let point = first + unit(direction) * straight_s + last;
        Knot { parameter: direction, point, from: from.time, to: to.time }
    }

    fn work(&self) -> usize {
        OF_KNOT
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.parameter, knot.point)
    }

    /// The curve turns in one direction only, by as much as its parameter changes.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        deviation_of_turn(a.point, b.point, b.parameter - a.parameter)
    }
}
