//! Branch and bound for the clearance from one set in one step. A *drive* is an admissible trajectory
//! of the human.

use super::headings::{Cuts, Moment, Piece, Pieces, Tube};
use super::interval::{Clearance, ClearanceSettings};
use super::plan::{Footprint, Leg, Placed, Plan};
use super::upper_bound::{Farthest, ahead, turns_away};
use crate::bounds::InputBounds;
use crate::math::{TAU, atan2, cos, hypot, sin_cos, sinc, wrap_angle};
use crate::vehicle::Pose;
use core::cmp::Ordering;
use std::collections::BinaryHeap;

/// The inputs that all sets and steps share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting<'a> {
    pub(super) start: Pose,
    /// The human's highest speed (m/s).
    pub(super) speed_mps: f64,
    /// The lowest speed as a share of the highest.
    pub(super) slow: f64,
    pub(super) step_s: f64,
    pub(super) plan: &'a Plan,
    pub(super) footprint: &'a Footprint,
    pub(super) settings: ClearanceSettings,
}

/// A subset of the drives in a time interval of the step: a node of the search.
#[derive(Clone, Copy, Debug)]
struct Part {
    cuts: Cuts,
    /// The time interval, as fractions of the step.
    from: f64,
    to: f64,
    /// The direction from human to robot (rad) that gave the bound `at_least_m`. It is the best of the
    /// directions tried.
    alpha: f64,
    /// Lower bound (m) on the distance of the part's drives from the robot.
    at_least_m: f64,
    /// Whether halving the drives is expected to raise the bound more than halving the time.
    halve_drives: bool,
    /// The knot and the heading at which the drives are split.
    knot: usize,
    heading: f64,
}

/// The heap returns the part with the smallest bound first.
impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        other.at_least_m.total_cmp(&self.at_least_m)
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

/// Largest number of directions tried for a part.
const MOST_DIRECTIONS: usize = 4;

/// The largest turn of a drive in one piece (rad) is clamped to this range.
const LEAST_TURN_RAD: f64 = 0.02;
const MOST_TURN_RAD: f64 = 0.5;

/// Largest number of pieces, unless a drive would turn by more than [`MOST_TURN_RAD`] in a piece.
const MOST_PIECES: f64 = 1000.0;

/// Directions that differ by less than this (rad) count as equal.
const SAME_RAD: f64 = 1e-6;

/// Time intervals of this length or less (as a fraction of the step) are not halved.
const LEAST_SHARE: f64 = 1.0 / 4096.0;

/// Upper bounds on rounding errors: absolute (m), and relative to the distance.
const ROUNDING_M: f64 = 1e-9;
const ROUNDING: f64 = 1e-12;

/// The buffers of a search.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    pieces: Pieces,
    tube: Tube,
    farthest: Farthest,
    open: BinaryHeap<Part>,
    /// Number of pieces evaluated in this step, over all parts and directions.
    work: usize,
    /// The direction with the best bound in the previous step.
    alpha: Option<f64>,
    /// The parts into which the drives were divided at the end of the previous step.
    seeds: Vec<Seed>,
}

/// A subset of the drives, and the direction that gives its best bound.
#[derive(Clone, Copy, Debug)]
struct Seed {
    cuts: Cuts,
    alpha: f64,
}

/// If a search ends with more parts than this, the next step starts without seeds.
const MOST_SEEDS: usize = 24;

impl Search {
    /// Prepares the search for the set with these bounds.
    pub(super) fn begin(&mut self, bounds: &InputBounds, on: &Setting<'_>) {
        // If a drive turns by an angle a in a piece, the line above the cosine exceeds it by a²/24 on
        // average. With the angle computed here, the total excess is at most a quarter of the accuracy.
        let length_m = on.speed_mps * on.step_s * bounds.steps() as f64;
        let turn_rad = (6.0 * on.settings.accuracy_m / length_m).sqrt();
        // Limit the number of pieces.
        let most =
            bounds.lo().iter().chain(bounds.hi()).fold(0.0, |most: f64, rate| most.max(rate.abs()));
        let turn_rad = turn_rad.max(most * on.step_s * bounds.steps() as f64 / MOST_PIECES);
        self.pieces.set(bounds, on.step_s, turn_rad.clamp(LEAST_TURN_RAD, MOST_TURN_RAD));
        self.alpha = None;
        self.seeds.clear();
        self.seeds.reserve(MOST_SEEDS + 1);
        self.open.clear();
        self.open.reserve(on.settings.most_parts + 2);
        self.tube.reserve(self.pieces.len());
        self.farthest.reserve(self.pieces.len(), on.slow);
    }

    /// Returns the clearance in step `step` (counted from 0) and the work spent on it. `at_least_m` is
    /// a known lower bound. Once the work exceeds `most_work`, no more parts are divided.
    pub(super) fn step(
        &mut self,
        on: &Setting<'_>,
        step: usize,
        at_least_m: f64,
        most_work: usize,
    ) -> (Clearance, usize) {
        let ClearanceSettings { accuracy_m, most_parts, .. } = on.settings;
        self.work = 0;
        self.open.clear();
        let leg = on.plan.leg(step);
        let alpha = self.alpha.unwrap_or_else(|| {
            let robot = leg.pose(0.5);
            atan2(robot.y - on.start.y, robot.x - on.start.x)
        });
        let whole = Part {
            cuts: Cuts::NONE,
            from: 0.0,
            to: 1.0,
            alpha,
            at_least_m,
            halve_drives: false,
            knot: 0,
            heading: 0.0,
        };
        let mut at_most_m = f64::INFINITY;
        // The smallest bound of the parts that are not divided further.
        let mut settled_m = f64::INFINITY;
        self.examine(on, step, &leg, whole, &mut at_most_m);
        self.alpha = self.open.peek().map(|part| part.alpha);
        let suffices = |part: &Part, at_most_m: f64| {
            part.at_least_m >= on.settings.goal(at_most_m) || at_most_m <= accuracy_m
        };
        let mut parts = 0;
        let again = (2..=MOST_SEEDS.min(most_parts)).contains(&self.seeds.len())
            && self.seeds.len() * self.work <= most_work;
        if again && !self.open.peek().is_some_and(|part| suffices(part, at_most_m)) {
            // Drives that had to be split in the previous step have to be split again.
            parts = self.seeds.len();
            self.open.clear();
            for i in 0..parts {
                let Seed { cuts, alpha } = self.seeds[i];
                self.examine(on, step, &leg, Part { cuts, alpha, ..whole }, &mut at_most_m);
            }
        }
        self.seeds.clear();
        while let Some(part) = self.open.pop() {
            if suffices(&part, at_most_m) || parts >= most_parts || self.work > most_work {
                settled_m = settled_m.min(part.at_least_m);
                self.open.push(part);
                break;
            }
            parts += 1;
            match self.halves(on, step, &part) {
                Some(halves) => {
                    for half in halves {
                        self.examine(on, step, &leg, half, &mut at_most_m);
                    }
                }
                None => {
                    settled_m = settled_m.min(part.at_least_m);
                    self.seed(&part);
                }
            }
        }
        let mut open = core::mem::take(&mut self.open);
        open.iter().for_each(|part| self.seed(part));
        open.clear();
        self.open = open;
        // The parts cover all drives and the whole step, so the smallest of their bounds is valid.
        (Clearance { at_least_m: settled_m.min(at_most_m), at_most_m }, self.work)
    }

    /// Saves the drives of a part as a seed if the part's time interval reaches the end of the step.
    /// Every drive belongs to such a part.
    fn seed(&mut self, part: &Part) {
        if part.to == 1.0 && self.seeds.len() <= MOST_SEEDS {
            self.seeds.push(Seed { cuts: part.cuts, alpha: part.alpha });
        }
    }

    /// Halves the drives of a part, or its time interval.
    fn halves(&mut self, on: &Setting<'_>, step: usize, part: &Part) -> Option<[Part; 2]> {
        let middle = 0.5 * (part.from + part.to);
        let in_time = [Part { to: middle, ..*part }, Part { from: middle, ..*part }];
        let in_time = (part.to - part.from > LEAST_SHARE).then_some(in_time);
        let by_drives = |search: &mut Self| {
            let moment = Moment { step, share: part.from };
            if !search.tube.set(on.start.psi, &search.pieces, moment, &part.cuts) {
                return None;
            }
            let [low, high] = search.tube.halves(part.knot, part.heading)?;
            let half = |cut| Some(Part { cuts: part.cuts.with(cut)?, ..*part });
            Some([half(low)?, half(high)?])
        };
        if part.halve_drives {
            by_drives(self).or(in_time)
        } else {
            in_time.or_else(|| by_drives(self))
        }
    }

    /// Raises the lower bound of a part and lowers the upper bound `at_most_m` for all drives. Queues
    /// the part unless it is empty.
    fn examine(
        &mut self,
        on: &Setting<'_>,
        step: usize,
        leg: &Leg,
        mut part: Part,
        at_most_m: &mut f64,
    ) {
        let moment = Moment { step, share: part.from };
        if !self.tube.set(on.start.psi, &self.pieces, moment, &part.cuts) {
            return;
        }
        self.farthest.begin();
        let look = Look::new(on, leg, &part, self.pieces.at(moment));
        let (mut alpha, mut bracket) = (part.alpha, [None; 2]);
        let (mut share, mut last) = (0.0, alpha);
        for _ in 0..MOST_DIRECTIONS {
            self.work += self.tube.pieces.len() + 1;
            let ends = look.along(alpha, &self.tube, &mut self.farthest);
            let least = ends[0].at_least_m.min(ends[1].at_least_m) - look.bulge_m;
            *at_most_m = at_most_m.min(ends[0].at_most_m).min(ends[1].at_most_m);
            if least > part.at_least_m {
                (part.at_least_m, part.alpha) = (least, alpha);
            }
            if part.at_least_m >= on.settings.goal(*at_most_m) {
                self.open.push(part);
                return;
            }
            let nearer = usize::from(ends[1].at_least_m < ends[0].at_least_m);
            let apart = ends[nearer].apart;
            last = alpha;
            // The bound grows when the direction rotates toward the line from human to robot.
            let (sin, cos) = sin_cos(alpha);
            let side = usize::from(cos * apart[1] - sin * apart[0] < 0.0);
            bracket[side] = Some((alpha, apart));
            self.farthest.keep(side);
            let aim = match bracket {
                [Some((low, a)), Some((high, b))] => {
                    let (between, aim) = nearest_to_origin(a, b);
                    share = between;
                    let most = look.between(share, &self.tube, &self.farthest);
                    *at_most_m = at_most_m.min(most);
                    // If the human can be anywhere between the two drives, no separating line can
                    // prove more than this.
                    let limit_m = hypot(aim[0], aim[1]) - on.footprint.margin_m();
                    if limit_m < on.settings.goal(*at_most_m) {
                        break;
                    }
                    let ahead = wrap_angle(atan2(aim[1], aim[0]) - low);
                    let inside = 0.0 < ahead && ahead < high - low;
                    low + if inside { ahead } else { 0.5 * (high - low) }
                }
                _ => {
                    share = side as f64;
                    alpha + wrap_angle(atan2(apart[1], apart[0]) - alpha)
                }
            };
            if (aim - alpha).abs() < SAME_RAD {
                break;
            }
            alpha = aim;
            if !self.pieces.straight() {
                self.farthest.touch_drive();
            }
        }
        for side in [0, 1] {
            if bracket[side].is_none() {
                self.farthest.keep(side);
            }
        }
        let looseness = self.farthest.looseness(&self.tube, last, share);
        (part.knot, part.heading) = (looseness.knot, looseness.heading);
        // Rough estimate of the loss that comes from the motion within the time interval.
        let moved_m = (part.to - part.from) * (on.speed_mps * on.step_s + leg.length_m);
        let time_m = moved_m * moved_m / (8.0 * at_most_m.max(0.25 * moved_m));
        part.halve_drives = on.speed_mps * looseness.seconds > time_m;
        self.open.push(part);
    }
}

/// The gap between human and robot at one end of a part's time interval.
#[derive(Clone, Copy, Debug)]
struct End {
    /// Lower bound (m) on how far the robot is ahead of the human along the direction.
    at_least_m: f64,
    /// Distance between the robot and the drive that was found (m).
    at_most_m: f64,
    /// Vector (m) from the end of the drive to the robot's corner with the smallest coordinate along
    /// the direction.
    apart: [f64; 2],
}

/// The data for finding separating lines in a part's time interval.
struct Look<'a> {
    on: &'a Setting<'a>,
    /// The robot at both ends of the interval.
    robot: [Placed<'a>; 2],
    /// Length of the interval (s).
    seconds: f64,
    /// Bounds on the human's turn rate in the interval (rad/s).
    rates: (f64, f64),
    /// Largest distance (m) of the robot's corners from the chords of their paths.
    bulge_m: f64,
}

impl<'a> Look<'a> {
    fn new(on: &'a Setting<'a>, leg: &Leg, part: &Part, piece: Piece) -> Self {
        let share = part.to - part.from;
        Self {
            on,
            robot: [part.from, part.to].map(|at| Placed::new(on.footprint, leg.pose(at))),
            seconds: share * on.step_s,
            rates: (piece.lo, piece.hi),
            bulge_m: leg.bulge_m(on.footprint.reach_m(), share),
        }
    }

    /// The gaps at both ends, along direction `alpha` from human to robot. In between, the human's velocity
    /// component along the direction is at most the best speed times the largest cosine of a heading. The true gap
    /// is therefore never below the linear interpolation of the two gaps by more than the bulge of the
    /// robot's path.
    fn along(&self, alpha: f64, tube: &Tube, farthest: &mut Farthest) -> [End; 2] {
        let (sin, cos) = sin_cos(alpha);
        let v = self.on.speed_mps;
        let far_m = v * farthest.bound(tube, alpha);
        let (lo, hi) = tube.end();
        let (lo, hi) =
            (lo + self.rates.0.min(0.0) * self.seconds, hi + self.rates.1.max(0.0) * self.seconds);
        let onward = ahead(most_cosine(lo - alpha, hi - alpha), self.on.slow);
        let onward_m = v * self.seconds * onward;
        let (place, heading) = farthest.end(tube);
        let toward = turns_away(alpha, (heading, heading)) - heading;
        let turn = toward.max(self.rates.0 * self.seconds).min(self.rates.1 * self.seconds);
        let speed = farthest.speed(heading + 0.5 * turn - alpha);
        let chord = speed * self.seconds * sinc(0.5 * turn);
        let (up, on) = sin_cos(heading + 0.5 * turn);
        let later = [place[0] + chord * on, place[1] + chord * up];
        let end = |robot: &Placed<'_>, place: [f64; 2], far_m: f64| {
            let start = [self.on.start.x, self.on.start.y];
            let human = [v * place[0], v * place[1]];
            let corner = robot.least_along(start, [cos, sin]);
            let margin_m = self.on.footprint.margin_m();
            let gap_m = corner[0] * cos + corner[1] * sin - margin_m - far_m;
            let rounding_m =
                ROUNDING_M + ROUNDING * (start[0].abs() + start[1].abs() + far_m.abs());
            let here = [start[0] + human[0], start[1] + human[1]];
            End {
                at_least_m: gap_m - rounding_m,
                at_most_m: robot.distance_m(here),
                apart: [corner[0] - human[0], corner[1] - human[1]],
            }
        };
        let [now, then] = &self.robot;
        [end(now, place, far_m), end(then, later, far_m + onward_m)]
    }

    /// Distance (m) from the robot, at the start of the interval, to the end of the drive that is
    /// interpolated between the two saved drives.
    fn between(&self, share: f64, tube: &Tube, farthest: &Farthest) -> f64 {
        let ([x, y], _) = farthest.end_between(tube, share);
        let Setting { start, speed_mps, .. } = self.on;
        self.robot[0].distance_m([start.x + speed_mps * x, start.y + speed_mps * y])
    }
}

/// The largest cosine of an angle in [lo, hi].
fn most_cosine(lo: f64, hi: f64) -> f64 {
    if (lo / TAU).ceil() <= (hi / TAU).floor() {
        return 1.0;
    }
    cos(lo).max(cos(hi))
}

/// The point nearest to the origin on the segment from a (share 0) to b (share 1); returns its share
/// and its coordinates.
fn nearest_to_origin(a: [f64; 2], b: [f64; 2]) -> (f64, [f64; 2]) {
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let share = if square > 0.0 { -(a[0] * d[0] + a[1] * d[1]) / square } else { 1.0 };
    let share = share.clamp(0.0, 1.0);
    (share, [a[0] + share * d[0], a[1] + share * d[1]])
}
