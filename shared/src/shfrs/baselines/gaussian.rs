//! A normal distribution of the future pose at each step.

use super::simple_bounds::worst_case_area_m2;
use super::swept::swept_area;
use super::{Areas, LearnedFamily, Nominal, future_seen_from_now, nominal_poses, place};
use crate::invalid::{Invalid, length};
use crate::math::{TAU, sin_cos};
use crate::scene::SceneParameters;
use crate::shfrs::family::Family;
use crate::shfrs::window::Window;
use crate::vehicle::Pose;
use crate::vehicle::dubins::relative_state;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Ellipsoids of the future pose at each step. An ellipsoid follows from the mean and the
/// covariance of the pose's difference from a [`Nominal`] drive, in the frame of the nominal pose.
/// Both are estimated from recorded windows.
///
/// The level is a Mahalanobis radius. A trajectory is inside if, at every step, its pose (x, y, ψ)
/// is within this radius of the mean. Variances of (5 mm)² and (2 mrad)² are added to the
/// covariances, so that they are invertible even if all futures agree at a step. In the plane, the
/// set at a step is an ellipse, the projection of the ellipsoid. The area is the area of the union
/// of the convex hulls of consecutive ellipses, starting at the current position. For a human who
/// drives straight, this area reaches the area of the worst-case set at some radius. From this
/// radius on, the set is the worst-case set.
pub struct Gaussian {
    nominal: Nominal,
    parameters: SceneParameters,
    moments: Vec<Moments>,
    most: f64,
    areas: Areas,
    worst_case_area: f64,
}

/// The distribution at one step, in the frame of the nominal pose. The units are (m, m, rad).
struct Moments {
    mean: Vector3<f64>,
    /// The inverse covariance.
    precision: Matrix3<f64>,
    /// L, where L·Lᵀ is the covariance of the position.
    root: Matrix2<f64>,
}

/// Number of vertices of the polygon inscribed in an ellipse. The polygon's area is 0.3 % smaller.
const VERTICES: usize = 48;

/// Variances that are added to each covariance: the squares of the membership tolerance.
const TOLERANCE: [f64; 3] = [0.005 * 0.005, 0.005 * 0.005, 0.002 * 0.002];

impl Gaussian {
    /// Learns from `windows`, which must have the same number of steps.
    ///
    /// # Errors
    /// [`Invalid`] if there are fewer than two windows or their lengths differ.
    pub fn learn(
        nominal: Nominal,
        parameters: &SceneParameters,
        windows: &[Window<'_>],
    ) -> Result<Self, Invalid> {
        let [first, _, ..] = windows else {
            return Err(Invalid::new("windows", "at least 2", windows.len()));
        };
        let steps = first.steps();
        let mut differences = vec![Vec::with_capacity(windows.len()); steps];
        for (i, window) in windows.iter().enumerate() {
            length(&format!("windows[{i}]"), steps, window.steps())?;
            for (n, difference) in differences_from(nominal, parameters, window).enumerate() {
                differences[n].push(difference);
            }
        }
        let moments: Option<Vec<_>> = differences.iter().map(|all| Moments::of(all)).collect();
        let moments = moments.ok_or_else(|| {
            Invalid::new("windows", "poses with a positive definite covariance", "others")
        })?;
        let worst_case_area = worst_case_area_m2(parameters, steps)?;
        let mut family = Self {
            nominal,
            parameters: *parameters,
            moments,
            most: f64::INFINITY,
            areas: Areas::default(),
            worst_case_area,
        };
        family.most = radius_of_area(|radius| family.ellipses_area(0.0, radius), worst_case_area);
        Ok(family)
    }
}

/// The human's pose after each step, relative to the nominal pose.
fn differences_from(
    nominal: Nominal,
    parameters: &SceneParameters,
    window: &Window<'_>,
) -> impl Iterator<Item = Vector3<f64>> {
    let SceneParameters { human, step_s, .. } = *parameters;
    let poses = nominal_poses(human, nominal.turn_rate(window, human), window.steps(), step_s);
    let seen = |(from, pose): (Pose, Pose)| Vector3::from(relative_state(from, pose));
    poses.into_iter().zip(future_seen_from_now(window)).map(seen)
}

impl Moments {
    fn of(differences: &[Vector3<f64>]) -> Option<Self> {
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<Vector3<f64>>() / n;
        let square = |d: &Vector3<f64>| (d - mean) * (d - mean).transpose();
        let scatter: Matrix3<f64> = differences.iter().map(square).sum();
        let covariance = scatter / (n - 1.0) + Matrix3::from_diagonal(&TOLERANCE.into());
        let precision = covariance.cholesky()?.inverse();
        let root = covariance.fixed_view::<2, 2>(0, 0).into_owned().cholesky()?.l();
        Some(Self { mean, precision, root })
    }

    fn radius(&self, difference: Vector3<f64>) -> f64 {
        let d = difference - self.mean;
        d.dot(&(self.precision * d)).max(0.0).sqrt()
    }
}

impl Gaussian {
    /// The ellipses with Mahalanobis radius `radius` along the nominal drive at `turn_rate`, as
    /// polygons.
    fn ellipses(&self, turn_rate: f64, radius: f64) -> Vec<Vec<[f64; 2]>> {
        let SceneParameters { human, step_s, .. } = self.parameters;
        let poses = nominal_poses(human, turn_rate, self.moments.len(), step_s);
        let ellipse = |(pose, moments): (Pose, &Moments)| -> Vec<[f64; 2]> {
            let vertex = |i: usize| {
                let (sin, cos) = sin_cos(i as f64 * TAU / VERTICES as f64);
                let offset = moments.root * Vector2::new(cos, sin) * radius;
                place(pose, (moments.mean.xy() + offset).into())
            };
            (0..VERTICES).map(vertex).collect()
        };
        poses.into_iter().zip(&self.moments).map(ellipse).collect()
    }

    /// The area that the ellipses sweep.
    fn ellipses_area(&self, turn_rate: f64, radius: f64) -> f64 {
        swept_area(&self.ellipses(turn_rate, radius))
    }
}

/// The radius at which the increasing function `area` reaches `goal`, with a relative error of at
/// most 10⁻⁶.
fn radius_of_area(area: impl Fn(f64) -> f64, goal: f64) -> f64 {
    let mut high = 1.0;
    while area(high) < goal {
        high *= 2.0;
    }
    let mut low = 0.0;
    while high - low > 1e-6 * high {
        let middle = 0.5 * (low + high);
        if area(middle) < goal { low = middle } else { high = middle }
    }
    high
}

impl Family for Gaussian {
    fn name(&self) -> String {
        match self.nominal {
            Nominal::Straight => "Gaussian, straight on".to_owned(),
            Nominal::Held => "Gaussian, held input".to_owned(),
        }
    }

    fn level_name(&self) -> &'static str {
        "Mahalanobis radius"
    }

    fn most(&self) -> f64 {
        self.most
    }

    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid> {
        self.least_level(window)
    }

    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
        length("window", self.moments.len(), window.steps())?;
        if level >= self.most {
            return Ok(self.worst_case_area);
        }
        let turn_rate = self.nominal.turn_rate(window, self.parameters.human);
        let mut areas = core::mem::take(&mut self.areas);
        let area = areas.get(level, turn_rate.to_bits(), || self.ellipses_area(turn_rate, level));
        self.areas = areas;
        Ok(area)
    }
}

impl LearnedFamily for Gaussian {
    fn least_level(&self, window: &Window<'_>) -> Result<f64, Invalid> {
        length("window", self.moments.len(), window.steps())?;
        let differences = differences_from(self.nominal, &self.parameters, window);
        let radii = differences.zip(&self.moments).map(|(d, moments)| moments.radius(d));
        Ok(radii.fold(0.0, f64::max).min(self.most))
    }

    fn step_sets(&self, window: &Window<'_>, level: f64) -> Option<Vec<Vec<[f64; 2]>>> {
        let turn_rate = self.nominal.turn_rate(window, self.parameters.human);
        (level < self.most).then(|| self.ellipses(turn_rate, level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, acos};
    use crate::scene::JointState;
    use crate::shfrs::window::Trajectory;

    const OFFSETS: [[f64; 2]; 4] = [[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3]];

    /// A one-step drive that ends at `point`, in the frame of a pose far from the origin.
    fn drive([x, y]: [f64; 2]) -> Trajectory {
        let now = Pose::new(5.0, -3.0, 0.5 * PI);
        // Ahead is +y, to the left is −x.
        let end = Pose::new(now.x - y, now.y + x, now.psi);
        let states = [now, end].map(|human| JointState { human, robot: now });
        Trajectory::new(states.to_vec(), vec![0.0]).unwrap()
    }

    fn learned(nominal: Nominal) -> Gaussian {
        let drives: Vec<_> = OFFSETS.iter().map(|[x, y]| drive([1.0 + x, *y])).collect();
        let windows: Vec<_> =
            drives.iter().map(|drive| Window::new(drive, 0, 1).unwrap()).collect();
        Gaussian::learn(nominal, &SceneParameters::default(), &windows).unwrap()
    }

    #[test]
    fn the_radius_is_mahalanobis() {
        let family = learned(Nominal::Straight);
        // The sample variance 4 · 0.09/3 in both directions, plus the variance of the tolerance.
        let variance: f64 = 0.12 + 0.005 * 0.005;
        let mean = Vector3::new(1.0 - 0.4, 0.0, 0.0);
        let radius = |x: f64, y: f64| family.moments[0].radius(mean + Vector3::new(x, y, 0.0));
        assert!((radius(0.3, 0.0) - 0.3 / variance.sqrt()).abs() < 1e-12);
        assert!((radius(0.3, -0.4) - 0.5 / variance.sqrt()).abs() < 1e-12);
        let turned = family.moments[0].radius(mean + Vector3::new(0.0, 0.0, 0.01));
        assert!((turned - 0.01 / 0.002).abs() < 1e-9);
    }

    /// The hull of a point and a disc consists of a sector and two right-angled triangles.
    #[test]
    fn the_area_is_that_of_the_swept_ellipse() {
        let family = learned(Nominal::Held);
        let radius = 0.5;
        let rho = radius * (0.12_f64 + 0.005 * 0.005).sqrt();
        let expected = rho * rho * (PI - acos(rho)) + rho * (1.0 - rho * rho).sqrt();
        let found = family.ellipses_area(0.0, radius);
        assert!(found < expected && expected < 1.004 * found, "{found} {expected}");
    }

    #[test]
    fn the_largest_set_is_the_worst_case_set() {
        let mut family = learned(Nominal::Straight);
        let most = family.most();
        let worst = family.worst_case_area;
        assert!((family.ellipses_area(0.0, most) / worst - 1.0).abs() < 1e-4);
        let far = drive([9.0, 0.0]);
        let window = Window::new(&far, 0, 1).unwrap();
        assert_eq!(family.score(&window).unwrap(), most);
        assert_eq!(family.area_m2(&window, most).unwrap(), worst);
        let smaller = family.area_m2(&window, 0.5 * most).unwrap();
        assert!(0.0 < smaller && smaller < worst);
    }

    #[test]
    fn too_few_windows_are_refused() {
        let parameters = SceneParameters::default();
        let drive = drive([1.0, 0.0]);
        let one = [Window::new(&drive, 0, 1).unwrap()];
        let refused = Gaussian::learn(Nominal::Held, &parameters, &one).err();
        assert_eq!(
            refused.map(|invalid| invalid.to_string()).as_deref(),
            Some("windows: expected at least 2, found 1")
        );
    }
}
