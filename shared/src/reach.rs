//! Exact planar reachable sets of a vehicle at constant speed under bounds on
//! its turn rate that change from step to step.
//!
//! No grid and no level set: by Pontryagin's principle the boundary of the set
//! consists of a few families of explicit paths.
//!
//! * The **front** is reached by paths that get as far as possible in some
//!   direction: turn toward it, then go straight (`front`; where straight is not
//!   always admissible, the extremals of `singular`, and where they part too fast for numbers, `parting`).
//! * The **rear** is reached by paths whose rate jumps between the bounds (`rear`; more than
//!   once, `zigzag`).
//! * The **tube**, the union over all instants, lies between the path at the
//!   lowest rates, the final front, and the path at the highest rates. Where headings
//!   span more than π/2, so do the ends of extremals that arrive at a right angle.
//!
//! While all admissible headings lie within ±π/2 of a common direction (15 steps
//! of 0.2 s at ±0.5 rad/s), front and rear are graphs over the line across that
//! direction; the rear is the lower envelope of its families. Beyond, the set is
//! what the curves enclose (`outline`).
//!
//! A polygon follows the set to either side within the accuracy asked for, or, if conservative,
//! around it (`grow`). The start may be uncertain ([`StartSet`]). With a [`Workspace`]
//! and [`ReachableSet::reset`] nothing is allocated from the second time on.

mod envelope;
mod extremal;
mod front;
mod grow;
mod outline;
mod parting;
mod paths;
pub mod polygon;
mod rear;
mod sampling;
mod singular;
mod start;
mod zigzag;
mod membership;

pub use grow::{minkowski_disc, minkowski_disc_into};
pub use membership::{Side, StateMargins, Tolerance};
pub use sampling::PolygonSettings;
pub use start::{PositionUncertainty, StartSet};

use crate::bounds::InputBounds;
use crate::invalid::{Invalid, positive};
use crate::math::PI;
use crate::vehicle::Pose;
use core::f64::consts::FRAC_PI_2;
use envelope::Envelope;
use extremal::{Costate, PathTime};
use grow::Brush;
use nalgebra::Complex;
use outline::Outliner;
use paths::{Path, Paths, unit};
use sampling::{Curves, pieces, sample};
use singular::Piece;

/// Every position that a vehicle can reach from a start pose under
/// [`InputBounds`] at constant speed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachableSet {
    start: Pose,
    start_set: StartSet,
    speed_mps: f64,
    paths: Paths,
}

/// Memory that polygons are made in. Once it is large enough, nothing is allocated.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// What is being made, in the human's frame.
    boundary: Vec<Complex<f64>>,
    curve: Vec<Complex<f64>>,
    curves: Curves,
    family: Vec<Piece>,
    envelope: Envelope,
    outliner: Outliner,
    brush: Vec<Complex<f64>>,
}

/// Beyond this, m, double precision leaves too little of a set's own size.
const MOST_M: f64 = 1e6;

/// Likewise of headings, rad.
const MOST_RAD: f64 = 1e4;

/// Longest step, m.
const MOST_STEP_M: f64 = 100.0;

/// Accepts starts whose coordinates leave enough digits to what is added to them.
fn checked(start: StartSet) -> Result<StartSet, Invalid> {
    start.pose.check().map_err(|invalid| invalid.within("start"))?;
    let Pose { x, y, psi } = start.pose;
    for (name, value, most) in [("x", x, MOST_M), ("y", y, MOST_M), ("psi", psi, MOST_RAD)] {
        if value.abs() > most {
            let expected = format!("a number from -{most} to {most}");
            return Err(Invalid::new(format!("start.{name}"), expected, value));
        }
    }
    Ok(start)
}

/// Accepts bounds under which the vehicle turns by half a turn a step at most: what the geometry
/// of extremals is made for.
fn turns_little(bounds: &InputBounds, step_s: f64) -> Result<(), Invalid> {
    for (name, rates) in [("lo", bounds.lo()), ("hi", bounds.hi())] {
        if let Some(i) = rates.iter().position(|rate| rate.abs() * step_s > PI) {
            let expected = format!("at most half a turn in a step of {step_s} s");
            let found = format!("{} rad/s", rates[i]);
            return Err(Invalid::new(format!("{name}[{i}]"), expected, found));
        }
    }
    Ok(())
}

impl ReachableSet {
    /// The set from `start` (world frame; a [`Pose`] or a [`StartSet`]) under `bounds`,
    /// at `speed_mps` m/s, each step of the bounds lasting `step_s` s. Bounds that
    /// forbid to drive straight by less than 10⁻⁴ rad/s are taken to allow it.
    ///
    /// # Errors
    /// [`Invalid`] if speed or step is not > 0, the start is beyond 10⁶ m or 10⁴ rad, a step
    /// is longer than 100 m, or the vehicle can turn by more than half a turn in it.
    pub fn new(
        start: impl Into<StartSet>,
        bounds: &InputBounds,
        speed_mps: f64,
        step_s: f64,
    ) -> Result<Self, Invalid> {
        let start_set = checked(start.into())?;
        let step_m = positive("speed_mps", speed_mps)? * positive("step_s", step_s)?;
        if step_m > MOST_STEP_M {
            let expected = format!("a speed that makes steps of {MOST_STEP_M} m at most");
            return Err(Invalid::new("speed_mps", expected, format!("{step_m} m")));
        }
        turns_little(bounds, step_s)?;
        let paths = Paths::new(bounds, step_s);
        Ok(Self { start: start_set.pose, start_set, speed_mps, paths })
    }

    /// The set from another start under other bounds, speed and step as before, in the
    /// memory of this one. In case of an error this one stays.
    ///
    /// # Errors
    /// [`Invalid`] as of [`Self::new`].
    pub fn reset(
        &mut self,
        start: impl Into<StartSet>,
        bounds: &InputBounds,
    ) -> Result<(), Invalid> {
        let start_set = checked(start.into())?;
        turns_little(bounds, self.paths.step_s)?;
        (self.start, self.start_set) = (start_set.pose, start_set);
        self.paths.reset(bounds, self.paths.step_s);
        Ok(())
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.paths.steps()
    }

    /// Where the vehicle starts, or the middle of the set that it starts in, world frame.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.start
    }

    /// Every pose in which the vehicle may start.
    #[must_use]
    pub fn start_set(&self) -> StartSet {
        self.start_set
    }

    /// The positions reachable after exactly `step` steps, as a polygon in the
    /// world frame, m, counter-clockwise, the first vertex not repeated. Its
    /// vertices lie on the boundary; its edges follow it within
    /// [`PolygonSettings::accuracy_m`]. A set that is a single position, as at
    /// step 0, has one vertex. If conservative, the polygon contains the set and exceeds
    /// it by at most the accuracy.
    ///
    /// From headings that span more than 2π on, the set may surround positions
    /// that cannot be reached in exactly that time; these holes are filled.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn step_polygon(&self, step: usize, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let mut polygon = Vec::new();
        self.step_polygon_into(step, settings, &mut Workspace::default(), &mut polygon);
        polygon
    }

    /// The same as [`Self::step_polygon`], replacing what is in `polygon`.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    pub fn step_polygon_into(
        &self,
        step: usize,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        workspace.boundary.clear();
        if step == 0 {
            workspace.boundary.push(Complex::new(0.0, 0.0));
        } else {
            self.step_boundary(step, settings.least_pieces(), self.tolerance(settings), workspace);
        }
        self.finish(settings, workspace, polygon);
    }

    /// The positions reachable at any instant from the start to the last step,
    /// as a polygon in the world frame, m, counter-clockwise, the first vertex
    /// not repeated. Accuracy and holes as for [`Self::step_polygon`]. If the
    /// bounds leave no choice it is the path, there and back.
    #[must_use]
    pub fn tube_polygon(&self, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let mut polygon = Vec::new();
        self.tube_polygon_into(settings, &mut Workspace::default(), &mut polygon);
        polygon
    }

    /// The same as [`Self::tube_polygon`], replacing what is in `polygon`.
    pub fn tube_polygon_into(
        &self,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) {
        workspace.boundary.clear();
        self.tube_boundary(settings.least_pieces(), self.tolerance(settings), workspace);
        self.finish(settings, workspace, polygon);
    }

    /// The boundary after `step` ≥ 1 steps, from the start pose itself.
    fn step_boundary(&self, step: usize, least: usize, tolerance: f64, workspace: &mut Workspace) {
        let Workspace { boundary, curves, family, envelope, outliner, .. } = workspace;
        curves.clear();
        front::front(&self.paths, step, least, tolerance, family, boundary);
        rear::candidates(&self.paths, step, least, tolerance, curves);
        if let Some(direction) = self.common_direction(step) {
            let (turned, back) = (unit(-direction), unit(direction));
            envelope.clear();
            for curve in curves.iter() {
                envelope.add(curve.iter().map(|point| point * turned));
            }
            if let [_, inner @ .., _] = envelope.points() {
                boundary.extend(inner.iter().rev().map(|point| point * back));
            }
        } else {
            outliner.clear();
            outliner.add(boundary);
            curves.iter().for_each(|curve| outliner.add(curve));
            boundary.truncate(1);
            outliner.outline(boundary);
        }
    }

    /// The boundary of the tube from the start pose itself.
    fn tube_boundary(&self, least: usize, tolerance: f64, workspace: &mut Workspace) {
        let Workspace { boundary, curve, curves, family, outliner, .. } = workspace;
        let (paths, steps) = (&self.paths, self.steps());
        path(&paths.low, steps, least, tolerance, boundary);
        front::front(paths, steps, least, tolerance, family, boundary);
        curve.clear();
        path(&paths.high, steps, least, tolerance, curve);
        boundary.extend(curve.iter().rev());
        boundary.dedup();
        let common = self.common_direction(steps).is_some();
        if common && paths.straight_always(steps) {
            return;
        }
        outliner.clear();
        outliner.add(boundary);
        curves.clear();
        if !common {
            rear::candidates(paths, steps, least, tolerance, curves);
            curves.iter().for_each(|curve| outliner.add(curve));
        }
        let (low, high) = paths.heading_range(steps);
        if high - low > FRAC_PI_2 {
            // Turning so far, one can get farther sideways than along the two
            // outermost paths.
            for phi in [-FRAC_PI_2, FRAC_PI_2] {
                curve.clear();
                sideways(paths, phi, least, tolerance, curve);
                // The last of these is an end of the set after the last step as well. There
                // it must not stop short of the chords, or what it encloses is lost.
                let ends = core::iter::once(boundary.as_slice()).chain(curves.iter());
                let end = curve[curve.len() - 1];
                curve.extend(sampling::vertex_beside(end, ends, 2.0 * tolerance));
                outliner.add(curve);
            }
        }
        boundary.truncate(1);
        outliner.outline(boundary);
    }

    /// How far, in seconds of travel, the boundary from the start pose itself may be off.
    fn tolerance(&self, settings: PolygonSettings) -> f64 {
        let share = match (settings.is_conservative(), self.starts_at_a_pose()) {
            // With as much for the arcs of an uncertain start, half the margin.
            (true, _) => 0.125,
            // With the arcs of an uncertain start and its disc, less than the whole.
            (false, false) => 0.25,
            (false, true) => 1.0,
        };
        share * settings.accuracy_m() / self.speed_mps
    }

    fn starts_at_a_pose(&self) -> bool {
        self.start_set == StartSet::from(self.start)
    }

    /// From the boundary in the workspace, which is for the start pose itself, to the
    /// polygon.
    fn finish(
        &self,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) {
        if settings.is_conservative() || !self.starts_at_a_pose() {
            grow::tidy(&mut workspace.boundary, &mut workspace.outliner);
            if self.start_set.heading_rad > 0.0 {
                grow::turn(self.start_set.heading_rad, self.tolerance(settings), workspace);
            }
            let accuracy = settings.accuracy_m() / self.speed_mps;
            let margin = if settings.is_conservative() { 0.5 * accuracy } else { 0.0 };
            let (radius, half) = self.start_set.extents();
            let brush = Brush {
                radius: radius / self.speed_mps + margin,
                half: half.map(|length| length / self.speed_mps),
                outside: settings.is_conservative(),
            };
            brush.sweep(0.25 * accuracy, workspace);
        }
        self.to_world(&workspace.boundary, polygon);
    }

    /// Is `position` (world frame, m) reachable after exactly `step` steps, or no
    /// farther than `tolerance_m` from a position that is?
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn contains_at(
        &self,
        step: usize,
        position: [f64; 2],
        tolerance_m: f64,
        settings: PolygonSettings,
    ) -> bool {
        polygon::signed_distance(&self.step_polygon(step, settings), position) >= -tolerance_m
    }

    /// Is `position` (world frame, m) reachable at any instant up to the last
    /// step, or no farther than `tolerance_m` from a position that is?
    #[must_use]
    pub fn contains(
        &self,
        position: [f64; 2],
        tolerance_m: f64,
        settings: PolygonSettings,
    ) -> bool {
        polygon::signed_distance(&self.tube_polygon(settings), position) >= -tolerance_m
    }

    /// The middle of all admissible headings of the first `steps` steps, rad in
    /// the human's frame, if none of them is π/2 or more away from it.
    fn common_direction(&self, steps: usize) -> Option<f64> {
        let (low, high) = self.paths.heading_range(steps);
        (high - low < PI - 1e-6).then_some(0.5 * (low + high))
    }

    /// From the human's frame, seconds of travel, to the world frame, metres.
    fn to_world(&self, points: &[Complex<f64>], polygon: &mut Vec<[f64; 2]>) {
        let turned = unit(self.start.psi) * self.speed_mps;
        polygon.clear();
        polygon.extend(points.iter().map(|point| {
            let moved = point * turned;
            [self.start.x + moved.re, self.start.y + moved.im]
        }));
        polygon.dedup();
        while polygon.len() > 1 && polygon.first() == polygon.last() {
            polygon.pop();
        }
    }
}

/// Appends one of the two outermost paths, from the start on.
fn path(
    path: &Path,
    steps: usize,
    least_pieces: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let (step_s, least) = (path.step_s(), least_pieces.div_ceil(steps));
    for step in 0..steps {
        let rate = path.turn(step).rate;
        // Finer than the front: to the area both sides add what the front takes away.
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

/// Appends, at every instant, the end of the extremal that arrives at a right angle to
/// its direction, φ = ±π/2: where the time is free, the boundary consists of these.
fn sideways(
    paths: &Paths,
    phi: f64,
    least_pieces: usize,
    tolerance: f64,
    points: &mut Vec<Complex<f64>>,
) {
    let each = least_pieces.div_ceil(paths.steps());
    points.push(Complex::new(0.0, 0.0));
    for step in 0..paths.steps() {
        let curve =
            |seconds: f64| Costate::end(phi).to_start(paths, PathTime { step, seconds }).sample();
        sample(&curve, (0.0, paths.step_s), each, tolerance, &|_, _, _| {}, points);
    }
    sampling::space(points, 0);
}
