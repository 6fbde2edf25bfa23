//! The boundary of the planar set from one start pose, composed of families of extremal paths.
//!
//! * **Front**: the ends of the paths that get farthest in some direction. These paths turn toward this
//!   direction and then go straight (`front`). `singular` handles bounds that do not always admit
//!   driving straight, and `divergence` handles extremals that diverge beyond double precision.
//! * **Rear**: the ends of bang-bang paths, whose rate switches between the bounds once (`rear`) or
//!   more often (`multi_switch`).
//! * **Tube**: the union over all instants. It is bounded by the path with the lowest rates, the final
//!   front, and the path with the highest rates.
//!
//! These statements hold if [`is_of_extremals`] is true. Front and rear are then graphs over the line
//! perpendicular to the middle heading, and the rear is the lower `envelope` of its families.

mod extremal;
mod divergence;
mod singular;
mod front;
mod multi_switch;
mod rear;
mod envelope;

use super::budget::Budget;
use super::outer::Outer;
use super::outline::{Outliner, thickness};
use super::paths::{Path, Paths, unit};
use super::sampling::{self, Curves, pieces};
use core::f64::consts::FRAC_PI_2;
use envelope::Envelope;
use nalgebra::Complex;
use singular::Piece;

/// Buffers for polygons. Once they are large enough, nothing is allocated.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// The boundary under construction, in the human's frame (s of travel).
    pub(super) boundary: Vec<Complex<f64>>,
    pub(super) curve: Vec<Complex<f64>>,
    pub(super) brush: Vec<Complex<f64>>,
    pub(super) outliner: Outliner,
    pub(super) outer: Outer,
    /// Buffer for the convex hull.
    pub(super) instants: Vec<f64>,
    curves: Curves,
    family: Vec<Piece>,
    envelope: Envelope,
}

impl Workspace {
    /// Replaces the boundary by the boundary of the set after `step` steps. The polygon follows the
    /// true boundary within `tolerance` (s), and each of its curves gets at least `least` edges. If the
    /// budget is spent, the boundary is unfinished.
    pub(super) fn draw_step(
        &mut self,
        paths: &Paths,
        step: usize,
        least: usize,
        tolerance: f64,
        budget: &Budget<'_>,
    ) {
        let Self { boundary, curves, family, envelope, outliner, .. } = self;
        boundary.clear();
        outliner.clear();
        if step == 0 {
            boundary.push(Complex::new(0.0, 0.0));
            return;
        }
        curves.clear();
        front::front(paths, step, (least, tolerance), family, boundary, budget);
        rear::candidates(paths, step, (least, tolerance), curves, budget);
        if budget.is_spent() {
            return;
        }
        let (low, high) = paths.heading_range(step);
        let direction = 0.5 * (low + high);
        let (turned, back) = (unit(-direction), unit(direction));
        let rises = |two: &[Complex<f64>]| ((two[1] - two[0]) * turned).im > LEAST_RISE;
        let rises = boundary.windows(2).all(rises);
        envelope.clear();
        for curve in curves.iter() {
            envelope.add(curve.iter().map(|point| point * turned));
        }
        // Front and rear touch at their ends, and their chords can cross there. So the rear is kept
        // slightly behind the front.
        let behind = thickness(tolerance);
        envelope.add(boundary.iter().map(|point| point * turned - behind));
        envelope.straighten();
        let ends = [boundary[0], boundary[boundary.len() - 1]];
        let rear = envelope.points().iter().rev().map(|point| point * back);
        let front = boundary.len();
        boundary.extend(rear.filter(|point| {
            ends.iter().all(|end| (point - end).norm_sqr() > 0.25 * behind * behind)
        }));
        sampling::space(boundary, front);
        if !rises {
            // Where extremals nearly coincide, rounding errors can reverse edges of the front.
            outliner.tidy(boundary, budget);
        }
    }

    /// Replaces the boundary by the boundary of the tube over all steps; see [`Self::draw_step`].
    pub(super) fn draw_tube(
        &mut self,
        paths: &Paths,
        least: usize,
        tolerance: f64,
        budget: &Budget<'_>,
    ) {
        let Self { boundary, curve, family, outliner, .. } = self;
        let steps = paths.steps();
        boundary.clear();
        outliner.clear();
        outermost(&paths.low, steps, least, tolerance, boundary);
        front::front(paths, steps, (least, tolerance), family, boundary, budget);
        curve.clear();
        outermost(&paths.high, steps, least, tolerance, curve);
        boundary.extend(curve.iter().rev());
        boundary.dedup();
        if paths.lo[0] < paths.hi[0] && paths.straight_always(steps) {
            return;
        }
        outliner.add(boundary);
        boundary.truncate(1);
        outliner.outline(boundary, budget);
    }
}

/// Whether the curves drawn here bound the set after `steps` steps and the tube up to that step. For
/// this, the headings along each outermost path must be within a quarter turn of each other. In
/// addition, there must be no step whose bounds narrowly forbid driving straight, because extremals
/// would diverge too fast there.
///
/// For a tube this is proven. Because the end time is free, boundary paths arrive perpendicular to the
/// outward normal. They switch only where the displacement to the end is perpendicular to the end
/// heading. After their last switch, they turn like an outermost path. For a set at one instant, tests
/// found no missed position. If headings swing farther, tests found missed positions, because paths
/// with several switches then bound the set.
pub(super) fn is_of_extremals(paths: &Paths, steps: usize) -> bool {
    paths.have_one_speed(steps) && paths.swing(steps) <= FRAC_PI_2 && !paths.graze_straight(steps)
}

/// Along every edge, a front advances by more than this (s) to the left, as seen in the middle
/// heading. Only rounding errors can make an edge advance less.
const LEAST_RISE: f64 = 1e-12;

/// Approximate cost of tracing an extremal through a step, in units of a [`Budget`].
const TRACING: usize = 4;

/// Appends the points of an outermost path, from the start to the end of its last step.
fn outermost(
    path: &Path,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let (step_s, least) = (path.step_s(), least_pieces.div_ceil(steps));
    for step in 0..steps {
        let rate = path.turn(step).rate;
        // The pieces are shorter than those of the front, because chords of this path enlarge the area
        // and chords of the front reduce it.
        let count = pieces(step_s, rate.abs(), 0.5 * tolerance, least);
        let turn = path.piece(step, count);
        let (mut point, mut facing) = (path.point(step), path.facing(step));
        for _ in 0..count {
            points.push(point);
            point += facing * turn.moved;
            facing *= turn.turned;
        }
    }
    points.push(path.point(steps));
}
