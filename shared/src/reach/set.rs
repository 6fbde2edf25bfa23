//! The reachable set from a start, and its polygons.

use super::boundary::{self, Workspace};
use super::budget::{Budget, Cancelled, Progress};
use super::hull;
use super::minkowski::{self, Brush};
use super::outer::Request;
use super::outline::thickness;
use super::paths::{Paths, unit};
use super::sampling::{Outline, PolygonSettings};
use super::start::StartSet;
use crate::bounds::InputBounds;
use crate::invalid::{Invalid, positive};
use crate::math::PI;
use crate::vehicle::{Pose, SpeedRange};
use core::ops::ControlFlow;
use nalgebra::Complex;

/// Every position that a vehicle can reach from a start pose under [`InputBounds`], at a constant speed or
/// with speeds from a range.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachableSet {
    pub(super) start: Pose,
    pub(super) start_set: StartSet,
    /// One range for all steps, or one for each step.
    speeds: Vec<SpeedRange>,
    /// The highest speed of all steps (m/s). Lengths in this module are in seconds of travel at this speed.
    pub(super) speed_mps: f64,
    pub(super) paths: Paths,
}

/// Largest start coordinate (m). Beyond it, too few digits remain for the set itself.
const MOST_M: f64 = 1e6;

/// Largest start heading (rad), for the same reason.
const MOST_RAD: f64 = 1e4;

/// Largest number of times that a boundary is widened. In practice, once was always enough.
const MOST_WIDENINGS: usize = 4;

/// Limit on the number of time intervals for a boundary that is constructed without extremals. The
/// limit for conservative polygons applies if it is higher.
const MOST_FINE_PIECES: usize = 10_000;

/// If a boundary without extremals exceeds the budget, its accuracy is made coarser by this factor.
const COARSER: f64 = 16.0;

/// Smallest tolerance with which extremals are sampled (s of travel).
const LEAST_TOLERANCE: f64 = 1e-7;

/// Longest step (m).
const MOST_STEP_M: f64 = 100.0;

/// Checks that the start coordinates leave enough digits for the set itself.
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

/// Checks that the vehicle turns by at most half a turn in a step. The geometry of extremals assumes
/// this.
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
    /// The set from `start` (world frame; a [`Pose`] or a [`StartSet`]) under `bounds`, with steps of `step_s`
    /// (s). `speed` is a constant speed (m/s) or a [`SpeedRange`]. If the bounds forbid driving straight by less than 10⁻⁵
    /// rad in all steps together, they count as bounds that allow it. This rule enlarges the set by at
    /// most 10⁻⁵ of the distance travelled.
    ///
    /// # Errors
    /// [`Invalid`] if the speed or the step is not > 0, the start is beyond 10⁶ m or 10⁴ rad, a step
    /// is longer than 100 m, or the vehicle can turn by more than half a turn in a step.
    pub fn new(
        start: impl Into<StartSet>,
        bounds: &InputBounds,
        speed: impl Into<SpeedRange>,
        step_s: f64,
    ) -> Result<Self, Invalid> {
        Self::with_speeds(start, bounds, vec![speed.into()], step_s)
    }

    /// Like [`Self::new`], with a range of speeds for each step. A vehicle that stands has the range from 0 to
    /// 0; at least one step must allow another speed.
    ///
    /// # Errors
    /// The errors of [`Self::new`], and [`Invalid`] if the number of ranges is neither 1 (for all steps) nor
    /// the number of steps.
    pub fn with_speeds(
        start: impl Into<StartSet>,
        bounds: &InputBounds,
        speeds: Vec<SpeedRange>,
        step_s: f64,
    ) -> Result<Self, Invalid> {
        let start_set = checked(start.into())?;
        for range in &speeds {
            range.check()?;
        }
        let speed_mps = speeds.iter().map(|range| range.hi_mps()).fold(0.0, f64::max);
        let step_m = positive("speed_mps", speed_mps)? * positive("step_s", step_s)?;
        if step_m > MOST_STEP_M {
            let expected = format!("a speed that makes steps of {MOST_STEP_M} m at most");
            return Err(Invalid::new("speed_mps", expected, format!("{step_m} m")));
        }
        let mut set =
            Self { start: start_set.pose, start_set, speeds, speed_mps, paths: Paths::default() };
        set.paths.step_s = step_s;
        set.reset(start_set, bounds)?;
        Ok(set)
    }

    /// Replaces this set by the set from another start under other bounds, with the same speeds and step.
    /// Allocates only if there are more steps than ever before. After an error this set is unchanged.
    ///
    /// # Errors
    /// The errors of [`Self::with_speeds`].
    pub fn reset(
        &mut self,
        start: impl Into<StartSet>,
        bounds: &InputBounds,
    ) -> Result<(), Invalid> {
        let start_set = checked(start.into())?;
        turns_little(bounds, self.paths.step_s)?;
        let (steps, given) = (bounds.steps(), self.speeds.len());
        if given != 1 && given != steps {
            return Err(Invalid::new("speeds", format!("1 or {steps}, as many as steps"), given));
        }
        (self.start, self.start_set) = (start_set.pose, start_set);
        self.paths.reset(bounds, self.paths.step_s);
        for (step, shares) in self.paths.speeds.iter_mut().enumerate() {
            let range = self.speeds[step % given];
            *shares = [range.lo_mps(), range.hi_mps()].map(|speed| speed / self.speed_mps);
        }
        Ok(())
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.paths.steps()
    }

    /// The start pose (world frame). For an uncertain start, this is the pose in its middle.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.start
    }

    /// The range of speeds of all steps, or of each step.
    #[must_use]
    pub fn speeds(&self) -> &[SpeedRange] {
        &self.speeds
    }

    /// All poses in which the vehicle can start.
    #[must_use]
    pub fn start_set(&self) -> StartSet {
        self.start_set
    }

    /// The positions reachable after exactly `step` steps, as a polygon (world frame, m,
    /// counter-clockwise, first vertex not repeated). Its edges follow the boundary within
    /// [`PolygonSettings::accuracy_m`] or enclose it: see [`Outline`] and the
    /// [guarantees](super#guarantees). [Conservative](PolygonSettings::conservative) polygons contain
    /// the set.
    ///
    /// The polygon neither crosses nor touches itself. Parts without width, for instance where the
    /// bounds leave no choice, are drawn with a width of a five-hundredth of the accuracy. The polygon
    /// of a single position, as at step 0, has one vertex.
    ///
    /// If headings span more than 2π, the set can surround positions that cannot be reached in exactly
    /// that time. Such holes are filled.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn step_polygon(&self, step: usize, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let mut polygon = Vec::new();
        self.step_polygon_into(step, settings, &mut Workspace::default(), &mut polygon);
        polygon
    }

    /// Like [`Self::step_polygon`], but replaces the contents of `polygon`. Returns the kind of polygon.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    pub fn step_polygon_into(
        &self,
        step: usize,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) -> Outline {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        let budget = Budget::new(settings.most_work());
        self.draw((step, false), settings, workspace, polygon, &budget)
    }

    /// Like [`Self::step_polygon_into`], but the caller can cancel. The method calls `progress` at the
    /// beginning and then every few tenths of a millisecond.
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` returns [`Break`](core::ops::ControlFlow::Break); `polygon` is
    /// then unchanged.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    pub fn try_step_polygon_into(
        &self,
        step: usize,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Outline, Cancelled> {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        Budget::reported(settings.most_work(), progress, |budget| {
            self.draw((step, false), settings, workspace, polygon, budget)
        })
    }

    /// The positions reachable at any instant from the start to the end of the last step, as a polygon
    /// (world frame, m, counter-clockwise, first vertex not repeated). Accuracy and holes are handled
    /// as in [`Self::step_polygon`]. If the bounds leave no choice, the polygon is a strip along the
    /// path.
    #[must_use]
    pub fn tube_polygon(&self, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let mut polygon = Vec::new();
        self.tube_polygon_into(settings, &mut Workspace::default(), &mut polygon);
        polygon
    }

    /// Like [`Self::tube_polygon`], but replaces the contents of `polygon`. Returns the kind of polygon.
    pub fn tube_polygon_into(
        &self,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
    ) -> Outline {
        let budget = Budget::new(settings.most_work());
        self.draw((self.steps(), true), settings, workspace, polygon, &budget)
    }

    /// Like [`Self::tube_polygon_into`], but the caller can cancel; see [`Self::try_step_polygon_into`].
    ///
    /// # Errors
    /// [`Cancelled`] if `progress` returns [`Break`](core::ops::ControlFlow::Break); `polygon` is
    /// then unchanged.
    pub fn try_tube_polygon_into(
        &self,
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Outline, Cancelled> {
        Budget::reported(settings.most_work(), progress, |budget| {
            self.draw((self.steps(), true), settings, workspace, polygon, budget)
        })
    }

    /// Replaces the polygon by the polygon of step `steps`, or of the tube up to that step. Leaves it
    /// unchanged if the caller cancels.
    pub(super) fn draw(
        &self,
        (steps, tube): (usize, bool),
        settings: PolygonSettings,
        workspace: &mut Workspace,
        polygon: &mut Vec<[f64; 2]>,
        budget: &Budget<'_>,
    ) -> Outline {
        // Every polygon costs at least one unit.
        budget.spend(1);
        let margin = if settings.is_conservative() {
            self.surround((steps, tube), settings, workspace, budget)
        } else {
            self.follow((steps, tube), settings, workspace, budget)
        };
        let margin_m = self.speed_mps * margin;
        // A polygon that need not be conservative has a margin only if it was drawn coarsely.
        let most_m = if settings.is_conservative() { settings.accuracy_m() } else { 0.0 };
        self.widen(settings, workspace, budget);
        if budget.is_cancelled() {
            return Outline::ConvexHull;
        }
        let outline = if budget.is_spent() {
            self.surround_hull((steps, tube), settings, workspace);
            Outline::ConvexHull
        } else if margin_m > most_m && self.hull_is_smaller((steps, tube), settings, workspace) {
            core::mem::swap(&mut workspace.boundary, &mut workspace.curve);
            Outline::ConvexHull
        } else {
            Outline::Refined { margin_m }
        };
        self.to_world(&workspace.boundary, polygon);
        outline
    }

    /// The tolerance for the boundary of the set from exactly the start pose (s of travel).
    fn tolerance(&self, settings: PolygonSettings) -> f64 {
        // For an uncertain start, the rotation arcs and the disc add errors. With this share, the total
        // stays below the accuracy.
        let share = if self.starts_at_a_pose() { 1.0 } else { 0.25 };
        share * settings.accuracy_m() / self.speed_mps
    }

    fn starts_at_a_pose(&self) -> bool {
        self.start_set == StartSet::from(self.start)
    }

    /// Replaces a boundary that touches itself by a slightly wider one that does not touch itself. This
    /// keeps polygons simple, even where the bounds leave no choice.
    fn widen(&self, settings: PolygonSettings, workspace: &mut Workspace, budget: &Budget<'_>) {
        let radius = thickness(self.tolerance(settings));
        for _ in 0..MOST_WIDENINGS {
            if !workspace.outliner.touches_itself() {
                return;
            }
            let brush = Brush { radius, half: [0.0; 2], outside: true };
            brush.sweep(radius, workspace, budget);
        }
    }

    /// Replaces the boundary in the workspace by one that follows the boundary of the set on either
    /// side, and returns 0. If that takes too much work, the new boundary encloses the set instead, and
    /// the method returns the margin by which it was grown (s of travel).
    fn follow(
        &self,
        (steps, tube): (usize, bool),
        settings: PolygonSettings,
        workspace: &mut Workspace,
        budget: &Budget<'_>,
    ) -> f64 {
        let extremals = boundary::is_of_extremals(&self.paths, steps);
        if !extremals || self.tolerance(settings) < LEAST_TOLERANCE {
            return self.follow_closely((steps, tube), settings, workspace, budget);
        }
        let (least, tolerance) = (settings.least_pieces(), self.tolerance(settings));
        if tube {
            workspace.draw_tube(&self.paths, least, tolerance, budget);
        } else {
            workspace.draw_step(&self.paths, steps, least, tolerance, budget);
        }
        if !self.starts_at_a_pose() {
            workspace.outliner.tidy(&mut workspace.boundary, budget);
            if self.start_set.heading_rad > 0.0 {
                minkowski::rotate(self.start_set.heading_rad, tolerance, workspace, budget);
            }
            let tolerance = 0.25 * settings.accuracy_m() / self.speed_mps;
            self.brush(0.0, false).sweep(tolerance, workspace, budget);
        }
        0.0
    }

    /// [`Self::follow`] without extremals. It uses the construction of conservative polygons, but omits
    /// the margin if it is within the accuracy. If the boundary would take more than three quarters of
    /// the budget, it is drawn more coarsely, with its margin.
    fn follow_closely(
        &self,
        what: (usize, bool),
        settings: PolygonSettings,
        workspace: &mut Workspace,
        budget: &Budget<'_>,
    ) -> f64 {
        let accuracy = settings.accuracy_m() / self.speed_mps;
        let pieces = MOST_FINE_PIECES.max(settings.most_pieces());
        let rest = budget.set_aside(4);
        let mut margin = self.enclose(what, accuracy, pieces, workspace, budget);
        let coarsely = budget.is_spent();
        budget.give_back(rest);
        if coarsely {
            let (accuracy, pieces) = (COARSER * accuracy, settings.most_pieces());
            margin = self.enclose(what, accuracy, pieces, workspace, budget);
        }
        let grown = if coarsely || margin > accuracy { margin } else { 0.0 };
        self.brush(grown, grown > 0.0).sweep(0.125 * accuracy, workspace, budget);
        grown
    }

    /// The uncertainty of the start position, with its disc grown by `margin` (s).
    fn brush(&self, margin: f64, outside: bool) -> Brush {
        let (radius, half) = self.start_set.extents();
        Brush {
            radius: radius / self.speed_mps + margin,
            half: half.map(|length| length / self.speed_mps),
            outside,
        }
    }

    /// Replaces the boundary in the workspace by one that encloses the set. Returns the margin by which
    /// it was grown (s of travel).
    fn surround(
        &self,
        what: (usize, bool),
        settings: PolygonSettings,
        workspace: &mut Workspace,
        budget: &Budget<'_>,
    ) -> f64 {
        let accuracy = settings.accuracy_m() / self.speed_mps;
        let margin = self.enclose(what, accuracy, settings.most_pieces(), workspace, budget);
        self.brush(margin, true).sweep(0.125 * accuracy, workspace, budget);
        margin
    }

    /// Replaces the boundary in the workspace by the boundary for the exact start position and all
    /// start headings. It misses no position by more than the returned distance (s of travel).
    fn enclose(
        &self,
        (steps, tube): (usize, bool),
        accuracy: f64,
        most_pieces: usize,
        workspace: &mut Workspace,
        budget: &Budget<'_>,
    ) -> f64 {
        let heading = self.start_set.heading_rad;
        let body_point = Complex::new(0.0, 0.0);
        let request = Request { steps, tube, accuracy, most_pieces, heading, body_point };
        let Workspace { boundary, curve, outliner, outer, .. } = workspace;
        let missed = outer.draw(&self.paths, request, outliner, curve, boundary, budget);
        outliner.tidy(boundary, budget);
        missed
    }

    /// Replaces the boundary in the workspace by a convex one that encloses the set.
    fn surround_hull(
        &self,
        (steps, tube): (usize, bool),
        settings: PolygonSettings,
        workspace: &mut Workspace,
    ) {
        let Workspace { boundary, instants, .. } = workspace;
        // The brush is large enough that rounding errors do not merge two corners.
        let brush = self.brush(0.01 * settings.accuracy_m() / self.speed_mps, true);
        let more = |direction| brush.support(direction);
        let heading = self.start_set.heading_rad;
        hull::surround(&self.paths, (steps, tube), heading, more, instants, boundary);
    }

    /// Computes a convex boundary in `workspace.curve` and keeps `workspace.boundary`. Returns whether
    /// the convex one encloses a smaller area.
    fn hull_is_smaller(
        &self,
        what: (usize, bool),
        settings: PolygonSettings,
        workspace: &mut Workspace,
    ) -> bool {
        core::mem::swap(&mut workspace.boundary, &mut workspace.curve);
        self.surround_hull(what, settings, workspace);
        core::mem::swap(&mut workspace.boundary, &mut workspace.curve);
        hull::twice_area(&workspace.curve) < hull::twice_area(&workspace.boundary)
    }

    /// Converts points from the human's frame (s of travel) to the world frame (m).
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
