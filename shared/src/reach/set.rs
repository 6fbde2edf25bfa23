//! The set from a start, and the polygons around it.

use super::boundary::Workspace;
use super::minkowski::{self, Brush};
use super::outer::Request;
use super::paths::{Paths, unit};
use super::sampling::PolygonSettings;
use super::start::StartSet;
use crate::bounds::InputBounds;
use crate::invalid::{Invalid, positive};
use crate::math::PI;
use crate::vehicle::Pose;
use nalgebra::Complex;

/// Every position that a vehicle can reach from a start pose under
/// [`InputBounds`] at constant speed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachableSet {
    pub(super) start: Pose,
    pub(super) start_set: StartSet,
    pub(super) speed_mps: f64,
    pub(super) paths: Paths,
}

/// Start coordinates beyond this, m, leave too few digits for the set itself.
const MOST_M: f64 = 1e6;

/// The same for headings, rad.
const MOST_RAD: f64 = 1e4;

/// Longest step, m.
const MOST_STEP_M: f64 = 100.0;

/// Accepts starts whose coordinates leave enough digits for the set itself.
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

/// Accepts bounds under which the vehicle turns by at most half a turn in a step, which the
/// geometry of extremals assumes.
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

    /// Replaces this set by that from another start under other bounds, at the same speed and
    /// step, without allocating. After an error this set is unchanged.
    ///
    /// # Errors
    /// As [`Self::new`].
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

    /// The start pose, world frame; of an uncertain start, the pose in its middle.
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
    /// step 0, has one vertex. For [conservative](PolygonSettings::conservative) polygons see
    /// there.
    ///
    /// From headings that span more than 2π on, the set may surround positions
    /// that cannot be reached in exactly that time; such holes are filled.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn step_polygon(&self, step: usize, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let mut polygon = Vec::new();
        self.step_polygon_into(step, settings, &mut Workspace::default(), &mut polygon);
        polygon
    }

    /// The same as [`Self::step_polygon`], replacing the contents of `polygon`.
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
        if settings.is_conservative() {
            self.surround(step, false, settings, workspace, polygon);
            return;
        }
        let tolerance = self.tolerance(settings);
        workspace.draw_step(&self.paths, step, settings.least_pieces(), tolerance);
        self.finish(settings, workspace, polygon);
    }

    /// The positions reachable at any instant from the start to the last step,
    /// as a polygon in the world frame, m, counter-clockwise, the first vertex
    /// not repeated. Accuracy and holes as for [`Self::step_polygon`]. If the
    /// bounds leave no choice, it is the path, there and back.
    #[must_use]
    pub fn tube_polygon(&self, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let mut polygon = Vec::new();
        self.tube_polygon_into(settings, &mut Workspace::default(), &mut polygon);
        polygon
    }

    /// The same as [`Self::tube_polygon`], replacing the contents of `polygon`.
    pub fn tube_polygon_into(
        &self,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) {
        if settings.is_conservative() {
            self.surround(self.steps(), true, settings, workspace, polygon);
            return;
        }
        workspace.draw_tube(&self.paths, settings.least_pieces(), self.tolerance(settings));
        self.finish(settings, workspace, polygon);
    }

    /// The error, in seconds of travel, that the boundary from the start pose itself may have.
    fn tolerance(&self, settings: PolygonSettings) -> f64 {
        // Together with the arcs of an uncertain start and its disc: less than the accuracy.
        let share = if self.starts_at_a_pose() { 1.0 } else { 0.25 };
        share * settings.accuracy_m() / self.speed_mps
    }

    fn starts_at_a_pose(&self) -> bool {
        self.start_set == StartSet::from(self.start)
    }

    /// Turns the boundary in the workspace, which is that from the start pose itself, into the
    /// polygon.
    fn finish(
        &self,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) {
        if !self.starts_at_a_pose() {
            workspace.outliner.tidy(&mut workspace.boundary);
            if self.start_set.heading_rad > 0.0 {
                minkowski::rotate(self.start_set.heading_rad, self.tolerance(settings), workspace);
            }
            self.brush(0.0, false).sweep(0.25 * settings.accuracy_m() / self.speed_mps, workspace);
        }
        self.to_world(&workspace.boundary, polygon);
    }

    /// The uncertain position, with a disc around it grown by `margin`, s.
    fn brush(&self, margin: f64, outside: bool) -> Brush {
        let (radius, half) = self.start_set.extents();
        Brush {
            radius: radius / self.speed_mps + margin,
            half: half.map(|length| length / self.speed_mps),
            outside,
        }
    }

    /// Replaces the polygon by a conservative one.
    fn surround(
        &self,
        steps: usize,
        tube: bool,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) {
        let accuracy = settings.accuracy_m() / self.speed_mps;
        let request = Request {
            steps,
            tube,
            accuracy,
            most_pieces: settings.most_pieces(),
            heading: self.start_set.heading_rad,
            body_point: Complex::new(0.0, 0.0),
        };
        let Workspace { boundary, curve, outliner, outer, .. } = &mut *workspace;
        let margin = outer.draw(&self.paths, request, outliner, curve, boundary);
        outliner.tidy(boundary);
        self.brush(margin, true).sweep(0.125 * accuracy, workspace);
        self.to_world(&workspace.boundary, polygon);
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
