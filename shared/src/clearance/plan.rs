//! A robot's plan and footprint.

use crate::invalid::{Invalid, positive};
use crate::math::{PI, hypot, sin_cos, sinc, wrap_angle};
use crate::reach::polygon::signed_distance;
use crate::vehicle::{Pose, dubins};

/// Limits of the robot. A plan with a step that exceeds them is rejected.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PlanLimits {
    /// Maximum speed along the path, forward or backward (m/s).
    pub most_speed_mps: f64,
    /// Maximum turn rate (rad/s).
    pub most_turn_rate_radps: f64,
}

/// Tolerance of the limits, relative and absolute, for rounding errors of the poses.
const ROUNDING: f64 = 1e-9;

/// Largest turn in a step (rad). For a larger turn, rounding errors would decide its direction.
const MOST_TURN_RAD: f64 = PI - 1e-6;

impl PlanLimits {
    /// Limits with a maximum speed (m/s) and a maximum turn rate (rad/s).
    #[must_use]
    pub const fn new(most_speed_mps: f64, most_turn_rate_radps: f64) -> Self {
        Self { most_speed_mps, most_turn_rate_radps }
    }

    /// Checks that the limits are finite and > 0.
    ///
    /// # Errors
    /// [`Invalid`], which names the field.
    pub fn check(&self) -> Result<(), Invalid> {
        positive("most_speed_mps", self.most_speed_mps)?;
        positive("most_turn_rate_radps", self.most_turn_rate_radps)?;
        Ok(())
    }
}

/// The robot's planned trajectory: T + 1 poses (world frame), the present pose and the pose after each
/// step. (In Python a plan omits the present pose, which is taken from the last state.) An
/// [`OnlinePredictor`](super::OnlinePredictor) does not compare the first pose with the robot's pose.
///
/// # Between the poses
/// In each step the robot turns at a constant rate, by the smaller angle, and drives at a constant
/// speed along the circular arc (or the line) between the two positions. This is exact for a vehicle
/// that keeps speed and turn rate constant within a step. For any other robot, grow the footprint by
/// the largest deviation ([`Footprint::grown`]). A robot that drives straight between the positions
/// deviates by at most an eighth of the step's length times its turn in rad.
///
/// ```
/// use sidestep::clearance::{Plan, PlanLimits};
/// use sidestep::vehicle::Pose;
///
/// let limits = PlanLimits::new(1.5, 1.0);
/// // Straight on for two steps, then a turn to the left while slowing down.
/// let inputs = [(1.2, 0.0), (1.2, 0.0), (0.8, 0.6)];
/// let plan = Plan::driven(Pose::new(0.0, 0.0, 0.0), &inputs, 0.2, limits)?;
/// assert!((plan.pose_at(0.3).x - 0.36).abs() < 1e-12);
///
/// let jump = [Pose::new(0.0, 0.0, 0.0), Pose::new(1.0, 0.0, 0.0)];
/// let refused = Plan::new(jump.to_vec(), 0.2, limits).unwrap_err();
/// assert_eq!(refused.field, "poses[1]");
/// # Ok::<(), sidestep::invalid::Invalid>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    step_s: f64,
    limits: PlanLimits,
    poses: Vec<Pose>,
}

impl Plan {
    /// The plan through `poses`. The first is the robot's present pose, and each step takes `step_s`
    /// seconds.
    ///
    /// # Errors
    /// [`Invalid`] if
    /// * there are fewer than two poses, or a coordinate is not finite or beyond [`Pose::MOST`];
    /// * a step exceeds the limits (the error names the pose at its end) or turns by half a turn, so
    ///   that its direction is ambiguous; or
    /// * `step_s` or a limit is not > 0.
    pub fn new(poses: Vec<Pose>, step_s: f64, limits: PlanLimits) -> Result<Self, Invalid> {
        positive("step_s", step_s)?;
        limits.check().map_err(|invalid| invalid.within("limits"))?;
        check(&poses, step_s, &limits)?;
        Ok(Self { step_s, limits, poses })
    }

    /// The plan through `positions` (m) for a round robot. The heading stays 0, and the robot drives
    /// straight from each position to the next.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn of_positions(
        positions: &[[f64; 2]],
        step_s: f64,
        limits: PlanLimits,
    ) -> Result<Self, Invalid> {
        let poses = positions.iter().map(|&[x, y]| Pose { x, y, psi: 0.0 }).collect();
        Self::new(poses, step_s, limits)
    }

    /// The plan of a vehicle with a constant speed (m/s, negative: backward) and turn rate (rad/s) in
    /// each step.
    ///
    /// # Errors
    /// The errors of [`Self::new`]; and [`Invalid`] if the vehicle turns by half a turn or more in
    /// a step, since poses do not distinguish such a turn from one in the opposite direction.
    pub fn driven(
        start: Pose,
        inputs: &[(f64, f64)],
        step_s: f64,
        limits: PlanLimits,
    ) -> Result<Self, Invalid> {
        let mut poses = vec![start];
        let mut pose = start;
        for (i, &(speed, rate)) in inputs.iter().enumerate() {
            let turn_rad = rate * step_s;
            if turn_rad.is_nan() || turn_rad.abs() > MOST_TURN_RAD {
                let expected = format!("less than half a turn in a step of {step_s} s");
                let found = format!("{rate} rad/s");
                return Err(Invalid::new(format!("inputs[{i}].turn_rate"), expected, found));
            }
            pose = dubins::arc(pose, speed, rate, step_s);
            poses.push(pose);
        }
        Self::new(poses, step_s, limits)
    }

    /// Replaces the poses and keeps the step duration and the limits. Allocates only if there are more
    /// poses than in any earlier plan. After an error the plan is unchanged.
    ///
    /// # Errors
    /// The errors of [`Self::new`].
    pub fn replace(&mut self, poses: &[Pose]) -> Result<(), Invalid> {
        check(poses, self.step_s, &self.limits)?;
        self.poses.clear();
        self.poses.extend_from_slice(poses);
        Ok(())
    }

    /// Number of steps, ≥ 1. It is one less than the number of poses.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.poses.len() - 1
    }

    /// Duration of a step (s).
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The poses (world frame), beginning with the present pose.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The pose `seconds` from now. Times outside the plan are clamped to its start or end.
    #[must_use]
    pub fn pose_at(&self, seconds: f64) -> Pose {
        let steps = (seconds / self.step_s).clamp(0.0, self.steps() as f64);
        let step = (steps as usize).min(self.steps() - 1);
        self.leg(step).pose(steps - step as f64)
    }

    /// The arc of a step, counted from 0.
    pub(super) fn leg(&self, step: usize) -> Leg {
        Leg::new(self.poses[step], self.poses[step + 1])
    }
}

fn check(poses: &[Pose], step_s: f64, limits: &PlanLimits) -> Result<(), Invalid> {
    if poses.len() < 2 {
        return Err(Invalid::new("poses", "the present pose and one for each step", poses.len()));
    }
    for (i, pose) in poses.iter().enumerate() {
        pose.check().map_err(|invalid| invalid.within(&format!("poses[{i}]")))?;
    }
    for (i, pair) in poses.windows(2).enumerate() {
        let leg = Leg::new(pair[0], pair[1]);
        let most = |limit: f64| limit * step_s * (1.0 + ROUNDING);
        let to = || format!("poses[{}]", i + 1);
        if leg.length_m > most(limits.most_speed_mps) + ROUNDING {
            let metres = limits.most_speed_mps * step_s;
            let expected = format!("at most {metres} m after poses[{i}], as the limits allow");
            return Err(Invalid::new(to(), expected, format!("{} m", leg.length_m)));
        }
        if leg.turn_rad.abs() > MOST_TURN_RAD {
            let expected = format!(
                "less than half a turn after poses[{i}], since the direction would be ambiguous"
            );
            return Err(Invalid::new(to(), expected, format!("{} rad", leg.turn_rad)));
        }
        if leg.turn_rad.abs() > most(limits.most_turn_rate_radps) + ROUNDING {
            let rad = limits.most_turn_rate_radps * step_s;
            let expected = format!("a turn of at most {rad} rad after poses[{i}]");
            return Err(Invalid::new(to(), expected, format!("{} rad", leg.turn_rad)));
        }
    }
    Ok(())
}

/// One step of a plan: a circular arc.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    from: Pose,
    /// Vector from the first position to the last (m).
    chord: [f64; 2],
    pub(super) turn_rad: f64,
    /// Length along the arc.
    pub(super) length_m: f64,
}

impl Leg {
    fn new(from: Pose, to: Pose) -> Self {
        let chord = [to.x - from.x, to.y - from.y];
        let turn_rad = wrap_angle(to.psi - from.psi);
        let length_m = hypot(chord[0], chord[1]) / sinc(0.5 * turn_rad);
        Self { from, chord, turn_rad, length_m }
    }

    /// The pose after a fraction `share` of the step, from 0 to 1. The chord of this part of the arc
    /// has a length proportional to share · sinc(share · turn/2). Relative to the full chord, it is
    /// rotated back by half of the remaining turn.
    pub(super) fn pose(&self, share: f64) -> Pose {
        let half = 0.5 * self.turn_rad;
        let scale = share * sinc(share * half) / sinc(half);
        let (sin, cos) = sin_cos((share - 1.0) * half);
        let [x, y] = self.chord;
        Pose {
            x: self.from.x + scale * (cos * x - sin * y),
            y: self.from.y + scale * (sin * x + cos * y),
            psi: self.from.psi + share * self.turn_rad,
        }
    }

    /// Upper bound (m) on the distance between the path of a point and the chord of this path, during a
    /// fraction `part` of the step. The point is fixed to the robot, `reach_m` from its position. The
    /// bound is an eighth of the acceleration times the time squared.
    pub(super) fn bulge_m(&self, reach_m: f64, part: f64) -> f64 {
        let turn = self.turn_rad.abs();
        turn * (self.length_m + turn * reach_m) * part * part / 8.0
    }
}

/// The area that a robot covers: all points within a margin of a convex polygon that is fixed to the
/// robot. A disc is a polygon with a single corner and a margin.
///
/// ```
/// use sidestep::clearance::Footprint;
/// use sidestep::vehicle::Pose;
///
/// let corners = [[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]; // m, x ahead, y to the left
/// let footprint = Footprint::polygon(&corners)?.grown(0.25)?; // and a person's body
/// let ahead = footprint.distance_m(Pose::new(1.0, 2.0, 0.0), [3.0, 2.0]);
/// assert!((ahead - 1.35).abs() < 1e-12);
/// # Ok::<(), sidestep::invalid::Invalid>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// Counter-clockwise, in the robot's frame (x ahead, y to the left; m).
    corners: Vec<[f64; 2]>,
    margin_m: f64,
    /// Distance of the farthest corner from the robot's position (m).
    reach_m: f64,
}

/// The largest length that a footprint accepts (m).
const MOST_M: f64 = 1e4;

impl Footprint {
    /// A disc about the robot's position.
    ///
    /// # Errors
    /// [`Invalid`] if the radius is not from 0 to 10⁴ m.
    pub fn disc(radius_m: f64) -> Result<Self, Invalid> {
        let point = Self { corners: vec![[0.0; 2]], margin_m: 0.0, reach_m: 0.0 };
        Ok(Self { margin_m: length("radius_m", radius_m)?, ..point })
    }

    /// The convex hull of points in the robot's frame (x ahead, y to the left; m).
    ///
    /// # Errors
    /// [`Invalid`] if there is no point, or a point is not within 10⁴ m of the robot's position.
    pub fn polygon(points: &[[f64; 2]]) -> Result<Self, Invalid> {
        if points.is_empty() {
            return Err(Invalid::new("points", "at least one", "none"));
        }
        let mut reach_m = 0.0_f64;
        for (i, &[x, y]) in points.iter().enumerate() {
            reach_m = reach_m.max(length(&format!("points[{i}]"), hypot(x, y))?);
        }
        Ok(Self { corners: hull(points), margin_m: 0.0, reach_m })
    }

    /// Adds to the margin, for example the radius of a person's body, or the robot's largest deviation
    /// from its plan.
    ///
    /// # Errors
    /// [`Invalid`] if the added or the resulting margin is not from 0 to 10⁴ m.
    pub fn grown(mut self, margin_m: f64) -> Result<Self, Invalid> {
        self.margin_m = length("margin_m", self.margin_m + length("margin_m", margin_m)?)?;
        Ok(self)
    }

    /// The corners of the polygon, counter-clockwise in the robot's frame (m).
    #[must_use]
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners
    }

    /// The margin: how far the footprint extends beyond the polygon (m).
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        self.margin_m
    }

    pub(super) fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Distance (m) of a position (world frame) from the robot at `pose`; ≤ 0 if the robot covers it.
    #[must_use]
    pub fn distance_m(&self, pose: Pose, position: [f64; 2]) -> f64 {
        Placed::new(self, pose).distance_m(position)
    }
}

/// A footprint at a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed<'a> {
    footprint: &'a Footprint,
    pose: Pose,
    sin: f64,
    cos: f64,
}

impl<'a> Placed<'a> {
    pub(super) fn new(footprint: &'a Footprint, pose: Pose) -> Self {
        let (sin, cos) = sin_cos(pose.psi);
        Self { footprint, pose, sin, cos }
    }

    /// Distance (m) of a position (world frame) from the footprint; ≤ 0 if the footprint covers it.
    pub(super) fn distance_m(&self, [x, y]: [f64; 2]) -> f64 {
        let Self { footprint, pose, sin, cos } = self;
        let (dx, dy) = (x - pose.x, y - pose.y);
        let seen = [cos * dx + sin * dy, -sin * dx + cos * dy];
        let metres = match footprint.corners[..] {
            [[ahead, left]] => hypot(seen[0] - ahead, seen[1] - left),
            _ => signed_distance(&footprint.corners, seen),
        };
        metres - footprint.margin_m
    }

    /// The corner of the polygon with the smallest coordinate along a direction (unit vector, world
    /// frame), as a vector from `origin` (m).
    pub(super) fn least_along(&self, origin: [f64; 2], along: [f64; 2]) -> [f64; 2] {
        let Self { footprint, pose, sin, cos } = self;
        let (ahead, left) = (cos * along[0] + sin * along[1], cos * along[1] - sin * along[0]);
        let mut least = (f64::INFINITY, [0.0; 2]);
        for &[x, y] in &footprint.corners {
            let far = ahead * x + left * y;
            if far < least.0 {
                least = (far, [cos * x - sin * y, sin * x + cos * y]);
            }
        }
        [pose.x - origin[0] + least.1[0], pose.y - origin[1] + least.1[1]]
    }
}

fn length(field: &str, metres: f64) -> Result<f64, Invalid> {
    if (0.0..=MOST_M).contains(&metres) {
        return Ok(metres);
    }
    Err(Invalid::new(field, format!("a length from 0 to {MOST_M} m"), metres))
}

/// The convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let left = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    };
    let mut hull: Vec<[f64; 2]> = Vec::new();
    let there_and_back = sorted.iter().chain(sorted.iter().rev().skip(1));
    let mut least = 2;
    for (i, &point) in there_and_back.enumerate() {
        while hull.len() >= least && !left(hull[hull.len() - 2], hull[hull.len() - 1], point) {
            hull.pop();
        }
        hull.push(point);
        if i + 1 == sorted.len() {
            least = hull.len() + 1;
        }
    }
    hull.pop();
    hull
}
