//! Polygons that contain the whole set, by construction.
//!
//! The horizon is divided into time intervals (*pieces*), and each admissible path is compared with a
//! path that turns on the spot between pieces. In a piece of length h, let ū be the middle of the bounds
//! and g half their width, and let the heading be θ(t) = ūt + ϑ(t), so that |ϑ′| ≤ g. Replace ϑ by its
//! *mean* in every piece. The resulting path
//!
//! * ends near the end of the original path. The deviation d of ϑ from its mean has no first-order
//!   effect. Its second-order effect, with ∫d² ≤ g²h³/12, displaces the end by at most h³(g²/48 +
//!   |ū|g/12 + g³h/144), if every piece is shortened by h³g²/48 ([`Piece::error`]);
//! * turns on the spot by at most gh/2 of the previous piece plus gh/2 of the next piece, because the
//!   difference of two means is a weighted integral of ϑ′, whose weight rises from 0 to 1 and falls
//!   back to 0.
//!
//! Let Pⱼ be the positions at the end of the horizon, in the frame of the vehicle at the beginning of
//! piece j. Up to the sum of the errors, they follow from P_N = {0} and the recursion
//! Pⱼ = ⋃ e^{ia}·(Dⱼ + e^{iūh}·Pⱼ₊₁) over |a| ≤ αⱼ. P₀ is the set. Each step of the recursion applies one displacement,
//! which is the same for all paths, and one [sweep](Curve::sweep) about the vehicle. The construction
//! does not depend on which paths are extremal. Rigid motions preserve distances, so errors only add
//! up, for any number of pieces and any size of turns.
//!
//! The construction of the tube also adds, in each piece, the positions passed on the way
//! ([`Piece::add_passed`]).
//!
//! # Speeds from an interval
//! Let the speed be v(t) = v̄ + w(t) with |w| ≤ γ, where 1 is the highest speed of all steps. In the frame of the
//! mean heading of a piece, the heading is D with ∫D = 0 and |D′| ≤ W = |ū| + g. The speed v̄ moves the end as
//! above, and w adds ∫w + i∫wD, up to γ∫D²/2 ≤ γW²h³/24.
//!
//! How large can ∫wD be if ∫w = cγh? It is largest if w is γ where D is highest and −γ elsewhere. Sort the
//! values of D: the sorted function has the same bound on its derivative, so the mean of its highest
//! m = (1 + c)h/2 seconds exceeds the mean of the others by at most Wh/2. Because ∫D = 0, it follows that
//! ∫wD ≤ γWh²(1 − c²)/4 ≤ γWh²(1 − |c|)/2. So w adds a point of a rhombus with half-diagonals γh along the
//! mean heading and γWh²/2 across it. A rhombus is the sum of two line segments, so the recursion applies two
//! [stretches](Curve::stretch) per piece. The rhombus is as long as the set of the true displacements, so it
//! enlarges the result only where a boundary runs along the heading. It is made smaller in proportion to Dⱼ, which
//! adds at most γh³(ū²/24 + g²/48)·max(1, Wh/2) to the error. So a rhombus of speeds from 0 has a corner in the origin, not behind it.

mod edges;
mod swept;
mod lines;

use super::budget::Budget;
use super::outline::Outliner;
use super::paths::{Paths, unit};
use crate::math::{PI, cbrt};
use nalgebra::Complex;

use edges::{Corner, Edge, NOTHING, cross};
use lines::{coarsen, loosen, outside_by, polyline};
use swept::Curve;

type Point = Complex<f64>;

/// The pieces of one step, which are all identical.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Number of pieces in the step.
    count: usize,
    /// Length of a piece (s).
    seconds: f64,
    /// gh/2, the largest difference between ϑ at either end of a piece and the mean of ϑ (rad).
    half_turn: f64,
    /// e^{iūh}.
    turned: Point,
    /// Dⱼ.
    moved: Point,
    /// Half the sides of the rhombus that the choice of the speed adds, or 0 if the speed is constant.
    sides: [Point; 2],
    /// Upper bound on the error that one piece adds to the end of a path (s of travel).
    error: f64,
    /// ūh.
    turn: f64,
}

impl Piece {
    fn new(paths: &Paths, step: usize, count: usize) -> Self {
        let (rate, spread) = middle_and_spread(paths, step);
        let seconds = paths.step_s / count as f64;
        let turn = rate * seconds;
        let half = unit(0.5 * turn);
        let shorter = cube(seconds) * spread * spread / 48.0;
        let chord = if turn.abs() < 1e-4 {
            seconds * (1.0 - turn * turn / 24.0)
        } else {
            2.0 * half.im / rate
        };
        let (mean, range) = middle_and_range(paths, step);
        let along = half * (0.5 * range * (chord - shorter));
        let across = 0.5 * (rate.abs() + spread) * seconds;
        let side = |across: f64| along * Point::new(1.0, across);
        Self {
            count,
            seconds,
            half_turn: 0.5 * spread * seconds,
            turned: half * half,
            moved: half * (mean * (chord - shorter)),
            sides: [side(across), side(-across)],
            error: cube(seconds) * error_of(paths, step, seconds),
            turn,
        }
    }

    /// Whether the vehicle stands throughout the piece.
    fn stands(&self) -> bool {
        self.moved.norm_sqr() < NOTHING && !self.has_choice_of_speed()
    }

    /// Whether the speed can change in the piece.
    fn has_choice_of_speed(&self) -> bool {
        self.sides[0].norm_sqr() > 0.0
    }

    /// Adds to a curve the positions that paths pass in the piece. The curve, which began and ended at D,
    /// then begins and ends at the origin. Returns how far outside the curve a path can still be (s of
    /// travel).
    ///
    /// At a constant speed v̄, the integral ∫d vanishes at both ends of the piece, and its second derivative is
    /// at most g. So at time s a path is at most v̄·(±g − ū)·s(h − s)/2 to the side of the straight line. A circular arc
    /// with the height of this parabola lies outside it, and an arc with three quarters of the height
    /// lies inside.
    ///
    /// If the speed is chosen, a path is at most ∫max(D, 0) ≤ Wh²/8 to the side of its mean heading, and the curve
    /// begins at most γWh²/2 to the side of it. A straight line then replaces the arcs.
    fn add_passed(&self, spread: f64, (mean, range): (f64, f64), curve: &mut Curve) -> f64 {
        let (h, rate) = (self.seconds, self.turn / self.seconds);
        let fastest = spread + rate.abs();
        let shortened = cube(h) * fastest * fastest / 12.0 + FLAT * h;
        if self.has_choice_of_speed() {
            curve.begin_at_origin();
            return shortened + side_of_tube(fastest, range) * h * h;
        }
        let corners = &mut curve.corners;
        let height = |bend: f64, outward: bool| {
            let full = mean * bend * h * h / 8.0;
            if outward { full } else { 0.75 * full }
        };
        let (right, left) = (-(spread + rate), spread - rate);
        let (right, left) = (height(right, right < 0.0), height(left, left > 0.0));
        let origin = Point::new(0.0, 0.0);
        let along = self.moved;
        let edge = |height: f64, from: Point, to: Point| {
            // The height is measured from the chord from the origin to D, positive to the left.
            if height.abs() < FLAT * h {
                return Edge::Line;
            }
            let half2 = 0.25 * along.norm_sqr();
            let side = along * Point::new(0.0, 1.0 / (2.0 * half2.sqrt()));
            let centre = along * 0.5 + side * (0.5 * (height * height - half2) / height);
            let ccw = cross(to - from, centre - from) > 0.0;
            Edge::Arc { centre, left: ccw }
        };
        corners.insert(0, Corner { point: origin, edge: edge(right, origin, along) });
        corners.push(Corner { point: along, edge: edge(left, along, origin) });
        shortened
    }
}

fn cube(x: f64) -> f64 {
    x * x * x
}

/// Arcs whose height is below this fraction of their length count as straight lines.
const FLAT: f64 = 1e-7;

fn middle_and_spread(paths: &Paths, step: usize) -> (f64, f64) {
    let (lo, hi) = (paths.lo[step], paths.hi[step]);
    (0.5 * (lo + hi), 0.5 * (hi - lo))
}

/// v̄ and γ.
fn middle_and_range(paths: &Paths, step: usize) -> (f64, f64) {
    let [slow, fast] = paths.speeds[step];
    (0.5 * (slow + fast), 0.5 * (fast - slow))
}

/// The error of a piece of length `seconds`, divided by its third power.
fn error_of(paths: &Paths, step: usize, seconds: f64) -> f64 {
    let (rate, spread) = middle_and_spread(paths, step);
    let (mean, range) = middle_and_range(paths, step);
    let fastest = rate.abs() + spread;
    // The longer half-diagonal of the rhombus, divided by γh.
    let longest = (0.5 * fastest * seconds).max(1.0);
    let shortened = longest * (rate * rate + 0.5 * spread * spread);
    mean * spread * (spread / 48.0 + rate.abs() / 12.0 + spread * spread * seconds / 144.0)
        + range * (fastest * fastest + shortened) / 24.0
}

/// How far beside the line of [`Piece::add_passed`] a path can be in a piece, divided by the square of the
/// piece's length. `fastest` is W and `range` is γ.
fn side_of_tube(fastest: f64, range: f64) -> f64 {
    fastest * (0.125 + 0.5 * range)
}

/// A curve is simplified if it has more corners than this plus twice their number after the last
/// simplification. A coarser polygon around the curve then replaces it.
const MOST_CORNERS: usize = 1_500;

/// The corresponding limit on the number of extremes of the distance from the vehicle.
const MOST_EXTREMES: usize = 24;

/// Costs in units of a [`Budget`]: of sweeping a corner (in addition to one unit for moving it), and of
/// comparing two edges in a sweep.
const SWEEPING: usize = 3;
const COMPARING: usize = 8;

/// Cost per vertex of converting arcs to edges and of loosening the polygon, in units of a [`Budget`].
const LOOSENING: usize = 6;

/// Fractions of the accuracy that are allowed for the errors of the pieces, for replacing arcs by
/// edges, and for removing vertices.
const OF_PIECES: f64 = 0.2;
const OF_ARCS: f64 = 0.1;
const OF_VERTICES: f64 = 0.1;

/// A rotation by less than this (rad) is not carried out but added to the error, because the chains
/// that it separates would count as coincident.
const LEAST_ANGLE: f64 = 1e-8;

/// Upper bound on the rounding errors of a piece (s of travel).
const ROUNDING: f64 = 2e-9;

/// Computes polygons around sets and reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Outer {
    pieces: Vec<Piece>,
    curve: Curve,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Request {
    pub(super) steps: usize,
    /// Whether the tube is requested instead of the set after the last step.
    pub(super) tube: bool,
    /// Largest error that the caller accepts (s of travel).
    pub(super) accuracy: f64,
    /// Limit on the number of pieces, which takes precedence over the accuracy.
    pub(super) most_pieces: usize,
    /// Largest deviation of the start heading (rad).
    pub(super) heading: f64,
    /// The point of the vehicle whose reachable positions are requested, in the vehicle's frame (s of
    /// travel). It is 0 for the vehicle's position itself.
    pub(super) body_point: Point,
}

impl Outer {
    /// Replaces `boundary` by the boundary of a polygon. The polygon contains the set if it is grown
    /// by the returned distance (s of travel). If the budget is spent, the boundary is unfinished, and
    /// it does not necessarily contain the set.
    pub(super) fn draw(
        &mut self,
        paths: &Paths,
        request: Request,
        outliner: &mut Outliner,
        scratch: &mut Vec<Point>,
        boundary: &mut Vec<Point>,
        budget: &Budget<'_>,
    ) -> f64 {
        let error = self.surround(paths, request, (outliner, budget), scratch, boundary);
        if budget.is_spent() {
            return error;
        }
        polyline(&self.curve.corners, OF_ARCS * request.accuracy, boundary);
        budget.spend(LOOSENING * boundary.len());
        loosen(boundary, scratch, OF_VERTICES * request.accuracy);
        outliner.tidy(boundary, budget);
        // Removes the remaining teeth. Otherwise an uncertain position would be swept around each of
        // them.
        loosen(boundary, scratch, OF_VERTICES * request.accuracy);
        error
    }

    /// Lower bound on the distance between a line segment and the set (s of travel). It is not
    /// positive if the segment might touch the set, or if the budget is spent.
    pub(super) fn clearance(
        &mut self,
        paths: &Paths,
        request: Request,
        line: [Point; 2],
        outliner: &mut Outliner,
        budget: &Budget<'_>,
    ) -> f64 {
        let (mut scratch, mut boundary) = (Vec::new(), Vec::new());
        let drawing = (outliner, budget);
        let error = self.surround(paths, request, drawing, &mut scratch, &mut boundary);
        if budget.is_spent() {
            return 0.0;
        }
        polyline(&self.curve.corners, OF_ARCS * request.accuracy, &mut boundary);
        budget.spend(boundary.len());
        outside_by(&boundary, line) - error
    }

    /// Replaces the curve by one that contains the set if it is grown by the returned distance (s of
    /// travel).
    fn surround(
        &mut self,
        paths: &Paths,
        request: Request,
        (outliner, budget): (&mut Outliner, &Budget<'_>),
        scratch: &mut Vec<Point>,
        boundary: &mut Vec<Point>,
    ) -> f64 {
        self.cut(paths, request);
        self.curve.corners.clear();
        self.curve.corners.push(Corner { point: request.body_point, edge: Edge::Line });
        let farthest = paths.step_s * request.steps as f64 + request.body_point.norm_sqr().sqrt();
        let arcs = OF_ARCS * request.accuracy;
        let (mut error, mut outside, mut kept) = (0.0, 0.0_f64, (0, 0));
        // The angle of a sweep that was deferred.
        let mut carried = 0.0;
        // The last turn on the spot moves a body point unless this point is the vehicle's position.
        if let Some(last) = request.steps.checked_sub(1) {
            let angle = self.pieces[last].half_turn;
            if request.body_point.norm_sqr() > 0.0 && angle >= LEAST_ANGLE {
                self.curve.sweep(angle.min(PI));
            } else {
                error += angle * request.body_point.norm_sqr().sqrt();
            }
        }
        for step in (0..request.steps).rev() {
            let piece = self.pieces[step];
            let spread = middle_and_spread(paths, step).1;
            let before = match step.checked_sub(1) {
                Some(before) => self.pieces[before].half_turn,
                None => request.heading,
            };
            for place in (0..piece.count).rev() {
                error += piece.error + ROUNDING;
                let other = if place > 0 { piece.half_turn } else { before };
                let angle = (piece.half_turn + other + carried).min(PI);
                carried = 0.0;
                let corners = &mut self.curve.corners;
                corners.iter_mut().for_each(|corner| corner.place(piece.turned, piece.moved));
                if piece.has_choice_of_speed() {
                    budget.spend(2 * self.curve.corners.len());
                    piece.sides.into_iter().for_each(|side| self.curve.stretch(side));
                }
                if request.tube {
                    let speeds = middle_and_range(paths, step);
                    outside = outside.max(piece.add_passed(spread, speeds, &mut self.curve));
                }
                budget.spend(self.curve.corners.len());
                if budget.is_spent() {
                    return f64::INFINITY;
                }
                // A vehicle that stands only turns, and rotations commute. Two sweeps about the same point
                // would divide arcs about this point by rounding errors, so they are one sweep.
                let next = if place > 0 { Some(step) } else { step.checked_sub(1) };
                if next.is_some_and(|next| self.pieces[next].stands()) {
                    carried = angle;
                    continue;
                }
                if angle < LEAST_ANGLE {
                    error += angle * farthest;
                    continue;
                }
                budget.spend(SWEEPING * self.curve.corners.len());
                let extremes = self.curve.sweep(angle);
                budget.spend(COMPARING * self.curve.compared);
                let corners = self.curve.corners.len();
                if extremes > 2 * kept.0 + MOST_EXTREMES || corners > 2 * kept.1 + MOST_CORNERS {
                    self.simplify(arcs, (outliner, budget), scratch, boundary);
                    kept = (extremes, self.curve.corners.len());
                    if request.tube {
                        self.curve.begin_nearest();
                    }
                }
                if request.tube {
                    self.curve.begin_at_origin();
                }
                if budget.is_spent() {
                    return f64::INFINITY;
                }
            }
        }
        error + outside
    }

    /// Replaces the curve by a polygon around it.
    fn simplify(
        &mut self,
        tolerance: f64,
        (outliner, budget): (&mut Outliner, &Budget<'_>),
        scratch: &mut Vec<Point>,
        boundary: &mut Vec<Point>,
    ) {
        polyline(&self.curve.corners, tolerance, boundary);
        budget.spend(LOOSENING * boundary.len());
        loosen(boundary, scratch, tolerance);
        outliner.tidy(boundary, budget);
        budget.spend(LOOSENING * boundary.len());
        if budget.is_spent() {
            return;
        }
        coarsen(boundary, scratch, tolerance);
        let corners = boundary.iter().map(|&point| Corner { point, edge: Edge::Line });
        self.curve.corners.clear();
        self.curve.corners.extend(corners);
    }

    /// Divides the steps into the fewest pieces with a total error of at most [`OF_PIECES`] times the
    /// accuracy. For this, the lengths of the pieces are proportional to the inverse cube roots of the
    /// error rates. The limit on the number of pieces takes precedence.
    fn cut(&mut self, paths: &Paths, request: Request) {
        let budget = OF_PIECES * request.accuracy;
        let step_s = paths.step_s;
        let weight = |step| error_of(paths, step, step_s);
        let sum: f64 = (0..request.steps).map(|step| cbrt(weight(step))).sum();
        let scale = (budget / (step_s * sum)).sqrt();
        let fine = |step: usize| {
            let mut pieces = step_s * cbrt(weight(step)) / scale;
            if request.tube {
                // With this number of pieces, each piece adds at most a quarter of the accuracy at the
                // sides of the tube.
                let (rate, spread) = middle_and_spread(paths, step);
                let side = side_of_tube(spread + rate.abs(), middle_and_range(paths, step).1);
                pieces = pieces.max(step_s * (4.0 * side / request.accuracy).sqrt());
            }
            pieces
        };
        let wanted: f64 = (0..request.steps).map(|step| fine(step).max(1.0)).sum();
        let share = (request.most_pieces as f64 / wanted).min(1.0);
        self.pieces.clear();
        self.pieces.extend((0..request.steps).map(|step| {
            let count = (share * fine(step)).ceil().max(1.0);
            Piece::new(paths, step, count as usize)
        }));
    }
}
