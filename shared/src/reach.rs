//! Exact planar reachable sets of a vehicle at constant speed under bounds on
//! its turn rate that change from step to step.
//!
//! No grid and no level set: by Pontryagin's principle the boundary of the set
//! consists of a few families of explicit paths.
//!
//! * The **front** is reached by paths that get as far as possible in some
//!   direction: turn toward it, then go straight (`front`; where straight is not
//!   always admissible, the extremals of `singular`).
//! * The **rear** is reached by paths whose rate jumps between the bounds (`rear`).
//! * The **tube**, the union over all instants, lies between the path at the
//!   lowest rates, the final front, and the path at the highest rates.
//!
//! While all admissible headings lie within ±π/2 of a common direction (15 steps
//! of 0.2 s at ±0.5 rad/s), front and rear are graphs over the line across that
//! direction; the rear is the lower envelope of its families. Beyond, the set is
//! what the curves enclose (`outline`).

mod envelope;
mod extremal;
mod front;
mod outline;
mod paths;
pub mod polygon;
mod rear;
mod sampling;
mod singular;
mod membership;

pub use membership::{Side, StateMargins, Tolerance};
pub use sampling::PolygonSettings;

use crate::bounds::InputBounds;
use crate::invalid::{Invalid, positive};
use crate::math::PI;
use crate::vehicle::Pose;
use core::f64::consts::FRAC_PI_2;
use extremal::Costate;
use nalgebra::Complex;
use paths::{Path, Paths, unit};
use sampling::{Sample, sample, spaced};

/// Every position that a vehicle can reach from a start pose under
/// [`InputBounds`] at constant speed.
#[derive(Clone, Debug, PartialEq)]
pub struct ReachableSet {
    start: Pose,
    speed_mps: f64,
    paths: Paths,
}

impl ReachableSet {
    /// The set from `start` (world frame) under `bounds`, at `speed_mps` m/s,
    /// each step of the bounds lasting `step_s` s.
    ///
    /// # Errors
    /// [`Invalid`] if the start is not finite, or speed or step is not finite and > 0.
    pub fn new(
        start: Pose,
        bounds: &InputBounds,
        speed_mps: f64,
        step_s: f64,
    ) -> Result<Self, Invalid> {
        start.check().map_err(|invalid| invalid.within("start"))?;
        Ok(Self {
            start,
            speed_mps: positive("speed_mps", speed_mps)?,
            paths: Paths::new(bounds, positive("step_s", step_s)?),
        })
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.paths.steps()
    }

    /// Where the vehicle starts, world frame.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.start
    }

    /// The positions reachable after exactly `step` steps, as a polygon in the
    /// world frame, m, counter-clockwise, the first vertex not repeated. Its
    /// vertices lie on the boundary; its edges follow it within
    /// [`PolygonSettings::accuracy_m`]. A set that is a single position, as at
    /// step 0, has one vertex.
    ///
    /// From headings that span more than 2π on, the set may surround positions
    /// that cannot be reached in exactly that time; these holes are filled.
    ///
    /// # Panics
    /// If `step` > [`Self::steps`].
    #[must_use]
    pub fn step_polygon(&self, step: usize, settings: PolygonSettings) -> Vec<[f64; 2]> {
        assert!(step <= self.steps(), "step {step} of {}", self.steps());
        if step == 0 {
            return vec![self.start.position()];
        }
        let tolerance = settings.accuracy_m() / self.speed_mps;
        let least = settings.least_pieces();
        let mut front = front::front(&self.paths, step, least, tolerance);
        let mut curves = rear::candidates(&self.paths, step, least, tolerance);
        let boundary = match self.common_direction(step) {
            Some(direction) => {
                let turned = unit(-direction);
                for curve in &mut curves {
                    curve.iter_mut().for_each(|point| *point *= turned);
                }
                let back = unit(direction);
                let rear = rear::rear(&curves);
                let inner = rear.len().saturating_sub(1).max(1);
                front.extend(rear[1..inner].iter().rev().map(|point| point * back));
                front
            }
            None => {
                curves.push(front);
                outline::outline(&curves)
            }
        };
        self.to_world(&boundary)
    }

    /// The positions reachable at any instant from the start to the last step,
    /// as a polygon in the world frame, m, counter-clockwise, the first vertex
    /// not repeated. Accuracy and holes as for [`Self::step_polygon`]. If the
    /// bounds leave no choice it is the path, there and back.
    #[must_use]
    pub fn tube_polygon(&self, settings: PolygonSettings) -> Vec<[f64; 2]> {
        let tolerance = settings.accuracy_m() / self.speed_mps;
        let least = settings.least_pieces();
        let steps = self.steps();
        let mut boundary = path(&self.paths.low, steps, least, tolerance);
        boundary.extend(front::front(&self.paths, steps, least, tolerance));
        let left = path(&self.paths.high, steps, least, tolerance);
        boundary.extend(left.iter().rev());
        boundary.dedup();
        let common = self.common_direction(steps).is_some();
        if common && self.paths.straight_always(steps) {
            return self.to_world(&boundary);
        }
        let mut curves = vec![boundary];
        if !common {
            // Turning so far, one can get farther sideways than along the two
            // outermost paths.
            curves.extend(rear::candidates(&self.paths, steps, least, tolerance));
            curves.extend(
                [-FRAC_PI_2, FRAC_PI_2].map(|phi| sideways(&self.paths, phi, least, tolerance)),
            );
        }
        self.to_world(&outline::outline(&curves))
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
    fn to_world(&self, points: &[Complex<f64>]) -> Vec<[f64; 2]> {
        let turned = unit(self.start.psi) * self.speed_mps;
        let mut polygon: Vec<[f64; 2]> = points
            .iter()
            .map(|point| {
                let moved = point * turned;
                [self.start.x + moved.re, self.start.y + moved.im]
            })
            .collect();
        polygon.dedup();
        while polygon.len() > 1 && polygon.first() == polygon.last() {
            polygon.pop();
        }
        polygon
    }
}

/// One of the two outermost paths, from the start on.
fn path(path: &Path, steps: usize, least_pieces: usize, tolerance: f64) -> Vec<Complex<f64>> {
    let pieces = least_pieces.div_ceil(steps);
    let mut points = vec![path.point(0)];
    for step in 0..steps {
        let curve = |seconds: f64| {
            let (point, angle) = path.within(step, seconds);
            Sample { point, angle }
        };
        sample(&curve, (0.0, path.step_s()), pieces, tolerance, &mut points);
        points.pop();
        points.push(path.point(step + 1));
    }
    points
}

/// At every instant, the end of the extremal that arrives at a right angle to
/// its direction, φ = ±π/2: where the time is free, the boundary consists of these.
fn sideways(paths: &Paths, phi: f64, least_pieces: usize, tolerance: f64) -> Vec<Complex<f64>> {
    let pieces = least_pieces.div_ceil(paths.steps());
    let mut points = vec![Complex::new(0.0, 0.0)];
    for step in 0..paths.steps() {
        let curve = |seconds: f64| Costate::end(phi).back_from(paths, 0, step, seconds).sample();
        sample(&curve, (0.0, paths.step_s), pieces, tolerance, &mut points);
    }
    spaced(points)
}
