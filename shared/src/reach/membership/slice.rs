//! The positions reached after some steps with one end heading: their boundary.
//!
//! Between the lowest and the highest path that end with heading ψ there are
//! three curves of paths, in seconds of travel and the human's frame:
//!
//! * **window of lo**: the highest rates, but the lowest between two jumps. The
//!   jumps' distance is fixed by ψ, so one number is free;
//! * **window of hi**: likewise with the bounds exchanged;
//! * **front**: turn toward a direction at full rate, go straight, turn to ψ at
//!   full rate; where straight is not always admissible, see `ridge`.
//!
//! If every step turns left, the windows of lo get farthest; if every step turns
//! right, those of hi. Otherwise both are rears. (Pontryagin: the rate is hi on the left of
//! some line, lo on its right; for constant bounds, Patsko, Pyatko and Fedotov
//! 2003, "Three-dimensional reachability set for a nonlinear control system".)

use super::super::paths::{Path, Paths, unit};
use super::parts::Parts;
use super::pocket::Pocket;
use super::ridge::Ridge;
use super::search::{Arc, Search};
use nalgebra::Complex;

/// The slice of end heading `heading`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slice<'a> {
    pub(super) paths: &'a Paths,
    pub(super) steps: usize,
    /// The first step with a choice, and the one after the last: those before and after them
    /// move and turn everything as one.
    pub(super) first: usize,
    pub(super) last: usize,
    heading: f64,
    /// How much lower than under the highest rates throughout, rad.
    below_high: f64,
    /// How much higher than under the lowest rates throughout, rad.
    above_low: f64,
    kind: Kind,
}

/// What the front consists of.
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
    Ridge,
    Pocket,
}

/// More jumps than two are looked into only so near the other curves: share of the time
/// travelled, times the square of what the highest rate turns by in it, rad. They have been
/// seen to gain 0.0018.
const SLIVER: f64 = 0.002;

/// A pocket is opened so wide, s.
const POCKET_S: f64 = 0.04;

const WINDOWS: [Curve; 2] = [Curve::LoWindow, Curve::HiWindow];

impl<'a> Slice<'a> {
    /// The slice after `steps` steps; `heading`, rad and not wrapped, must be
    /// admissible.
    pub(super) fn new(paths: &'a Paths, steps: usize, heading: f64) -> Self {
        let choice = |step: &usize| paths.lo[*step] < paths.hi[*step];
        let first = (0..steps).find(choice).unwrap_or(0);
        let last = (first..steps).rfind(choice).map_or(first, |step| step + 1);
        let bounds = || paths.lo[first..last].iter().zip(&paths.hi[first..last]);
        let kind = if bounds().all(|(lo, _)| *lo >= 0.0) {
            Kind::AlwaysLeft
        } else if bounds().all(|(_, hi)| *hi <= 0.0) {
            Kind::AlwaysRight
        } else if bounds().all(|(lo, hi)| *lo < 0.0 && 0.0 < *hi) {
            Kind::BothWays
        } else if bounds().all(|(lo, hi)| *lo <= 0.0 && 0.0 <= *hi) {
            Kind::StraightAdmissible
        } else {
            Kind::Mixed
        };
        Self {
            paths,
            steps,
            first,
            last,
            heading,
            below_high: (paths.high.heading(steps) - heading).max(0.0),
            above_low: (heading - paths.low.heading(steps)).max(0.0),
            kind,
        }
    }

    /// The curve that gets farthest.
    pub(super) fn front(&self) -> Curve {
        match self.kind {
            Kind::AlwaysLeft => Curve::LoWindow,
            Kind::AlwaysRight => Curve::HiWindow,
            Kind::BothWays | Kind::StraightAdmissible => Curve::Straight,
            Kind::Mixed => Curve::Ridge,
        }
    }

    /// The curves that matter in every case.
    fn curves(&self) -> impl Iterator<Item = Curve> {
        let front = match self.kind {
            Kind::AlwaysLeft | Kind::AlwaysRight => None,
            Kind::BothWays | Kind::StraightAdmissible => Some(Curve::Straight),
            Kind::Mixed => Some(Curve::Ridge),
        };
        WINDOWS.into_iter().chain(front)
    }

    /// May more jumps than two stay farther back?
    fn has_pockets(&self) -> bool {
        matches!(self.kind, Kind::StraightAdmissible | Kind::Mixed)
    }

    /// How far from the other curves, s, pockets are looked into.
    fn sliver(&self) -> f64 {
        let steps = self.first..self.last;
        let rates = self.paths.lo[steps.clone()].iter().chain(&self.paths.hi[steps.clone()]);
        let fastest = rates.fold(0.0, |most: f64, rate| most.max(rate.abs()));
        let seconds = steps.len() as f64 * self.paths.step_s;
        SLIVER * seconds * (fastest * seconds) * (fastest * seconds)
    }

    /// Distance of a position from the slice, s; 0 inside. Not searched for below
    /// `enough`; if it is at least `reach`, some number from there on.
    pub(super) fn outside_by(&self, position: Complex<f64>, enough: f64, reach: f64) -> f64 {
        let mut nearest = f64::INFINITY;
        let mut winding = None;
        let depth = enough + self.sliver();
        let reach = if self.has_pockets() { reach.max(depth) } else { reach };
        let mut windows = [None; 2];
        for (i, curve) in self.curves().enumerate() {
            let search = self.search(curve, position, enough, reach);
            if search.found() {
                return search.distance;
            }
            if *winding.get_or_insert(search.crossings) != search.crossings {
                return 0.0;
            }
            nearest = nearest.min(search.distance);
            if let Some(window) = windows.get_mut(i) {
                *window = Some(search);
            }
        }
        if self.has_pockets() {
            for (curve, window) in WINDOWS.into_iter().zip(windows) {
                let Some(window) = window.filter(|window| window.distance < depth) else {
                    continue;
                };
                let search = self.pocket(curve, &window, position, enough, reach);
                if search.found() {
                    return search.distance;
                }
                if search.crossings != 0 {
                    return 0.0;
                }
                nearest = nearest.min(search.distance);
            }
        }
        nearest
    }

    /// Signed distance of a position from the slice's boundary, s, positive
    /// inside, and the curve that is nearest.
    pub(super) fn margin(&self, position: Complex<f64>) -> (f64, Curve) {
        let mut found: [Option<(Curve, Search)>; 5] = [None; 5];
        for (place, curve) in found.iter_mut().zip(self.curves()) {
            *place = Some((curve, self.search(curve, position, 0.0, f64::INFINITY)));
        }
        if self.has_pockets() {
            for (i, curve) in WINDOWS.into_iter().enumerate() {
                let Some((_, window)) = found[i] else { continue };
                if window.distance < self.sliver() {
                    let mut pocket = self.pocket(curve, &window, position, 0.0, f64::INFINITY);
                    // The window with the pocket in it.
                    pocket.crossings += window.crossings;
                    found[3 + i] = Some((Curve::Pocket, pocket));
                }
            }
        }
        let found = || found.iter().flatten();
        let nearer = |a: (f64, Curve), b: (f64, Curve)| if b.0 < a.0 { b } else { a };
        // What two curves surround is inside, so far as neither is met.
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

    /// What is found about the pocket of a window near the position.
    fn pocket(
        &self,
        curve: Curve,
        found: &Search,
        position: Complex<f64>,
        enough: f64,
        reach: f64,
    ) -> Search {
        let mut search = Search::new(position, enough, reach);
        let (window, most) = match curve {
            Curve::LoWindow => (self.lo_window(), self.above_low),
            _ => (self.hi_window(), self.below_high),
        };
        let knot = window.knot(found.nearest);
        let apart = 0.5 * POCKET_S / (knot.to - knot.from).max(POCKET_S);
        let parameters = [-apart, 0.0, apart].map(|by| (found.nearest + by).clamp(0.0, most));
        let headings = |parameter: f64, path: &mut [f64]| window.headings(parameter, path);
        // In the middle of what is near enough, or far beyond if all of the distance matters.
        let beyond = if reach.is_finite() { -0.5 * enough } else { f64::INFINITY };
        let pocket = Pocket::new(self, headings, parameters, position, beyond);
        search.follow(&pocket, [0.0, 1.0, 2.0, 3.0]);
        search
    }

    fn search(&self, curve: Curve, position: Complex<f64>, enough: f64, reach: f64) -> Search {
        let mut search = Search::new(position, enough, reach);
        let paths = self.paths;
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
                let start = paths.low.heading(self.first);
                let mut directions = [lowest, start, self.last_heading(), highest];
                directions.sort_by(f64::total_cmp);
                for direction in &mut directions {
                    *direction = direction.clamp(lowest.min(highest), highest);
                }
                search.follow(&Straight { slice: self }, directions);
            }
            Curve::Ridge | Curve::Pocket => {
                let ridge = Ridge::new(self);
                let (lowest, highest) = ridge.directions();
                self.joined(&mut search, &ridge, [lowest, highest]);
            }
        }
        search
    }

    /// Follows a curve of paths that change their rate between parts of a step only: the
    /// lowest and the highest of these end beside the true ones.
    fn joined<A: Arc>(
        &self,
        search: &mut Search,
        arc: &A,
        parameters: impl IntoIterator<Item = f64> + Clone,
    ) {
        let mut ends = parameters.clone().into_iter();
        search.follow(arc, parameters);
        if let (Some(first), Some(last)) = (ends.next(), ends.last()) {
            let end = |parameter| A::place(arc.knot(parameter)).1;
            let window = self.lo_window();
            let tips = [0.0, self.above_low].map(|from| window.knot(from).point);
            search.join(tips[0], end(first));
            search.join(end(last), tips[1]);
        }
    }

    fn lo_window(&self) -> Window<'_> {
        let (outer, inner) = (&self.paths.high, &self.paths.low);
        Window { slice: self, outer, inner, width: self.below_high, sign: 1.0 }
    }

    fn hi_window(&self) -> Window<'_> {
        let (outer, inner) = (&self.paths.low, &self.paths.high);
        Window { slice: self, outer, inner, width: self.above_low, sign: -1.0 }
    }

    /// Heading after the last step with a choice, rad.
    pub(super) fn last_heading(&self) -> f64 {
        let low = &self.paths.low;
        self.heading - (low.heading(self.steps) - low.heading(self.last))
    }

    /// When the two outermost paths' headings have come to differ by `turn`.
    fn apart_by(&self, turn: f64) -> Instant {
        let (low, high) = (&self.paths.low, &self.paths.high);
        self.instant(turn, |step| high.heading(step) - low.heading(step))
    }

    /// When a quantity, given at the beginning of each step, linear between and
    /// never falling, reaches `value`; the limits of the horizon if it does not.
    fn instant(&self, value: f64, at: impl Fn(usize) -> f64) -> Instant {
        let (mut first, mut last) = (self.first, self.last);
        // at(first) ≤ value < at(last), as far as there are such.
        while first + 1 < last {
            let middle = usize::midpoint(first, last);
            if at(middle) <= value {
                first = middle;
            } else {
                last = middle;
            }
        }
        let step_s = self.paths.step_s;
        let (from, to) = (at(first), at(last));
        let share = if to > from { ((value - from) / (to - from)).clamp(0.0, 1.0) } else { 0.0 };
        Instant { step: first, seconds: share * step_s, time: (first as f64 + share) * step_s }
    }
}

/// A moment: `seconds` after the beginning of a step, `time` after the start.
#[derive(Clone, Copy, Debug)]
struct Instant {
    step: usize,
    seconds: f64,
    time: f64,
}

impl Path {
    /// Position and heading at an instant.
    fn at(&self, instant: Instant) -> (Complex<f64>, f64) {
        self.within(instant.step, instant.seconds)
    }
}

/// A point of a curve whose derivative is ±i·∫e^{iθ} over a stretch of the path.
#[derive(Clone, Copy, Debug)]
struct Knot {
    parameter: f64,
    point: Complex<f64>,
    /// The stretch, s after the start.
    from: f64,
    to: f64,
}

/// The rates of `outer`, but for a stretch with those of `inner`, in which the
/// heading comes to differ by `width` from that under `outer`. Parameter: how
/// much the headings of the outermost paths differ where the stretch begins.
struct Window<'a> {
    slice: &'a Slice<'a>,
    outer: &'a Path,
    inner: &'a Path,
    width: f64,
    /// 1 if `outer` is the highest path, −1 if it is the lowest.
    sign: f64,
}

impl Window<'_> {
    /// Fills in the headings after each part of the path named by the parameter.
    fn headings(&self, parameter: f64, path: &mut [f64]) {
        let parts = Parts::new(self.slice);
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
        let after = self.outer.point(slice.steps) - self.outer.at(to).0;
        let point =
            before + unit(self.sign * parameter) * stretch + unit(-self.sign * self.width) * after;
        Knot { parameter, point, from: from.time, to: to.time }
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.parameter, knot.point)
    }

    /// A chord deviates by a quarter of the parameter's range times the change of
    /// the derivative, which changes as the stretch moves and turns.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        let range = (b.parameter - a.parameter).abs();
        let moved = (b.from - a.from).abs() + (b.to - a.to).abs();
        let longest = a.to.max(b.to) - a.from.min(b.from);
        0.25 * range * (moved + range * longest)
    }
}

/// Headings closer than this, rad, differ by rounding errors only.
const SAME_HEADING: f64 = 1e-9;

/// Turn at full rate toward a direction (the parameter), go straight, turn at
/// full rate to the end heading.
struct Straight<'a> {
    slice: &'a Slice<'a>,
}

impl Arc for Straight<'_> {
    type Knot = Knot;

    fn knot(&self, direction: f64) -> Knot {
        let slice = self.slice;
        let (low, high) = (&slice.paths.low, &slice.paths.high);
        let falling = |heading: f64| slice.instant(-heading, |step| -low.heading(step));
        let rising = |heading: f64| slice.instant(heading, |step| high.heading(step));
        let start = low.heading(slice.first);
        let (mut from, toward) =
            if direction >= start { (rising(direction), high) } else { (falling(direction), low) };
        let (mut to, path, turn) = if direction >= slice.last_heading() {
            (falling(direction - slice.above_low), low, slice.above_low)
        } else {
            (rising(direction + slice.below_high), high, -slice.below_high)
        };
        // Where a full rate is zero its path is straight too, and its instant may come
        // out anywhere there.
        if to.time < from.time {
            if (toward.at(to).1 - direction).abs() < SAME_HEADING {
                from = to;
            } else {
                to = from;
            }
        }
        let first = toward.at(from).0;
        let last = unit(turn) * (path.point(slice.steps) - path.at(to).0);
        let straight_s = to.time - from.time;
        let point = first + unit(direction) * straight_s + last;
        Knot { parameter: direction, point, from: from.time, to: to.time }
    }

    fn place(knot: Knot) -> (f64, Complex<f64>) {
        (knot.parameter, knot.point)
    }

    /// The curve turns one way, as its parameter does.
    fn deviation(&self, a: Knot, b: Knot) -> f64 {
        triangle(a.point, b.point, b.parameter - a.parameter)
    }
}

/// How far a curve that turns one way, by `turn` rad, may be from its chord.
pub(super) fn triangle(a: Complex<f64>, b: Complex<f64>, turn: f64) -> f64 {
    if turn.abs() > 1.0 {
        return f64::INFINITY;
    }
    // tan(x/2)/2 ≤ 0.2732 x up to x = 1.
    0.2732 * (b - a).norm_sqr().sqrt() * turn.abs()
}
