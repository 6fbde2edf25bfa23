//! Convex hulls, which need little work, and the work limit.

use super::{any_drive, random_pose};
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, SeededRng, TAU, sin_cos};
use sidestep::reach::polygon::{signed_area, signed_distance};
use sidestep::reach::{
    Outline, PolygonSettings, PositionUncertainty, ReachableSet, StartSet, Workspace,
};
use sidestep::vehicle::{Pose, dubins};

/// Number of directions in which a hull touches the set.
const DIRECTIONS: usize = 128;

/// Bound on the growth of hulls (m) for an accuracy of 1 mm. It includes the rounding error, which
/// is the travel of a nanosecond for each second of the drive.
const GROWN_M: f64 = 1.1e-5;

fn settings() -> PolygonSettings {
    PolygonSettings::new(1e-3, 2).unwrap()
}

/// Speed (m/s), length of a step (s), maximum turn rate (rad/s) and number of steps of each class.
pub(super) const CLASSES: [(f64, f64, f64, usize); 6] = [
    (2.0, 0.2, 0.5, 15),
    (10.0, 0.5, 3.0, 12),
    (2.0, 0.2, 3.0, 25),
    (1.5, 0.1, 6.0, 50),
    (2.0, 0.2, 0.5, 100),
    (2.0, 1.0, PI, 100),
];

struct Case {
    speed_mps: f64,
    step_s: f64,
    bounds: Vec<(f64, f64)>,
    start: StartSet,
}

impl Case {
    /// Random bounds of a class, with a random start.
    fn any(class: usize, rng: &mut SeededRng) -> Self {
        let (speed_mps, step_s, most, steps) = CLASSES[class];
        let bound = |rng: &mut SeededRng| {
            let (a, b) = (rng.uniform(-most, most), rng.uniform(-most, most));
            match rng.below(4) {
                0 => (a, a),
                1 => (-most, most),
                _ => (a.min(b), a.max(b)),
            }
        };
        let bounds = (0..=rng.below(steps)).map(|_| bound(rng)).collect();
        let position = match rng.below(3) {
            0 => PositionUncertainty::None,
            1 => PositionUncertainty::Disc { radius_m: rng.uniform(0.0, 1.0) },
            _ => PositionUncertainty::Box {
                along_m: rng.uniform(0.0, 1.0),
                across_m: rng.uniform(0.0, 0.5),
            },
        };
        let heading = if rng.below(2) == 0 { 0.0 } else { rng.uniform(0.0, PI) };
        let start = StartSet::new(Pose::new(3.0, -2.0, rng.uniform(-3.0, 3.0)), position, heading);
        Self { speed_mps, step_s, bounds, start: start.unwrap() }
    }

    fn set(&self) -> ReachableSet {
        let (lo, hi) = self.bounds.iter().copied().unzip();
        let bounds = InputBounds::new(lo, hi, (-10.0, 10.0)).unwrap();
        ReachableSet::new(self.start, &bounds, self.speed_mps, self.step_s).unwrap()
    }

    /// Whether all admissible headings are within a quarter turn of each other.
    fn turns_little(&self) -> bool {
        let (mut low, mut high, mut range) = (0.0, 0.0, (0.0_f64, 0.0_f64));
        for (lo, hi) in &self.bounds {
            (low, high) = (low + lo * self.step_s, high + hi * self.step_s);
            range = (range.0.min(low), range.1.max(high));
        }
        range.1 - range.0 < 0.5 * PI
    }

    /// Extent of the set from the start's centre in direction `phi` (rad, world frame), at the end
    /// and at any instant. It is the integral of the largest admissible speed in this direction,
    /// computed with many small steps.
    fn support(&self, phi: f64) -> (f64, f64) {
        const PARTS: usize = 400;
        let part_s = self.step_s / PARTS as f64;
        let pose = self.start.pose();
        let (mut low, mut high) =
            (pose.psi - self.start.heading_rad() - phi, pose.psi + self.start.heading_rad() - phi);
        let (mut along, mut most) = (0.0, 0.0_f64);
        for &(lo, hi) in &self.bounds {
            for _ in 0..PARTS {
                let (from, to) = (low + 0.5 * lo * part_s, high + 0.5 * hi * part_s);
                // If `phi` is not an admissible heading, the admissible heading nearest to it is
                // best.
                let turns = (to / TAU).floor() * TAU;
                let best = if turns >= from { 1.0 } else { sin_cos(from).1.max(sin_cos(to).1) };
                along += best * self.speed_mps * part_s;
                most = most.max(along);
                (low, high) = (low + lo * part_s, high + hi * part_s);
            }
        }
        let (sin, cos) = sin_cos(phi - pose.psi);
        let more = match self.start.position() {
            PositionUncertainty::Disc { radius_m } => radius_m,
            PositionUncertainty::Box { along_m, across_m } => {
                along_m * cos.abs() + across_m * sin.abs()
            }
            _ => 0.0,
        };
        (along + more, most + more)
    }
}

/// Extent of a polygon in direction `phi`, from a given position.
fn farthest(polygon: &[[f64; 2]], [x, y]: [f64; 2], phi: f64) -> f64 {
    let (sin, cos) = sin_cos(phi);
    let along = polygon.iter().map(|p| (p[0] - x) * cos + (p[1] - y) * sin);
    along.fold(f64::NEG_INFINITY, f64::max)
}

/// Compares hulls with an independent computation, which uses quadrature instead of the closed
/// form. Includes uncertain starts.
#[test]
fn a_hull_gets_as_far_as_the_best_headings_do() {
    let mut rng = SeededRng::new(61);
    let hull = settings().with_most_work(0);
    let mut largest = 0.0_f64;
    for class in 0..CLASSES.len() {
        for _ in 0..8 {
            let case = Case::any(class, &mut rng);
            let set = case.set();
            let (step, tube) = (set.step_polygon(set.steps(), hull), set.tube_polygon(hull));
            let Pose { psi, .. } = case.start.pose();
            for _ in 0..8 {
                let phi = psi + TAU * rng.below(DIRECTIONS) as f64 / DIRECTIONS as f64;
                let (end, any) = case.support(phi);
                for (polygon, expected) in [(&step, end), (&tube, any)] {
                    let found = farthest(polygon, case.start.pose().position(), phi);
                    largest = largest.max((found - expected).abs());
                }
            }
        }
    }
    println!("{:.6} mm at most", 1e3 * largest);
    // Allows for the error of the quadrature with 400 parts per step, and for the growth of hulls.
    assert!(largest < 1e-4, "{largest}");
}

/// If straight driving is always admissible and bounds are symmetric, a drive that turns toward a
/// direction and then goes straight gets as far as the hull. This holds in every direction.
#[test]
fn a_drive_touches_the_hull_in_every_direction() {
    let mut rng = SeededRng::new(62);
    let hull = settings().with_most_work(0);
    for (speed_mps, step_s, most, steps) in CLASSES {
        let rates: Vec<f64> = (0..steps).map(|_| rng.uniform(0.0, most)).collect();
        let lo: Vec<f64> = rates.iter().map(|rate| -rate).collect();
        let bounds = InputBounds::new(lo, rates.clone(), (-most, most)).unwrap();
        let start = Pose::new(0.0, 0.0, 0.0);
        let set = ReachableSet::new(start, &bounds, speed_mps, step_s).unwrap();
        let (step, tube) = (set.step_polygon(steps, hull), set.tube_polygon(hull));
        for k in 0..DIRECTIONS {
            let phi = TAU * (k as f64 / DIRECTIONS as f64 - 0.5);
            let (sin, cos) = sin_cos(phi);
            let along = |pose: Pose| pose.x * cos + pose.y * sin;
            let (mut pose, mut turn, mut farthest_yet) = (start, 0.0, 0.0_f64);
            for rate in &rates {
                let turning_s = ((phi.abs() - turn) / rate).clamp(0.0, step_s);
                // Turn until the heading is perpendicular to the direction, where the vehicle stops
                // moving away, and then until the vehicle faces the direction.
                let across_s = ((phi.abs() - 0.5 * PI - turn) / rate).clamp(0.0, turning_s);
                for seconds in [across_s, turning_s - across_s] {
                    pose = dubins::arc(pose, speed_mps, rate * phi.signum(), seconds);
                    farthest_yet = farthest_yet.max(along(pose));
                }
                turn += rate * turning_s;
                pose = dubins::arc(pose, speed_mps, 0.0, step_s - turning_s);
                farthest_yet = farthest_yet.max(along(pose));
            }
            for (polygon, reached) in [(&step, along(pose)), (&tube, farthest_yet)] {
                let gap = farthest(polygon, [0.0; 2], phi) - reached;
                assert!((0.0..GROWN_M).contains(&gap), "{gap} m in direction {phi} of {rates:?}");
            }
        }
    }
}

/// The vertices of polygons of extremals are reachable, so a hull contains them. The test does not
/// use bounds that just exclude straight driving.
#[test]
fn a_hull_contains_what_follows_the_boundary() {
    let mut rng = SeededRng::new(63);
    let hull = settings().with_most_work(0);
    let (mut workspace, mut polygon, mut compared) = (Workspace::default(), Vec::new(), [0; 2]);
    for class in 0..CLASSES.len() {
        for _ in 0..10 {
            let mut case = Case::any(class, &mut rng);
            case.start = case.start.pose().into();
            for (lo, hi) in &mut case.bounds {
                (*lo, *hi) = (
                    if *lo < 0.01 { lo.min(0.0) } else { *lo },
                    if *hi > -0.01 { hi.max(0.0) } else { *hi },
                );
            }
            let set = case.set();
            let step = set.steps().div_ceil(2);
            for tube in [true, false] {
                let mut draw = |settings| {
                    let outline = if tube {
                        set.tube_polygon_into(settings, &mut workspace, &mut polygon)
                    } else {
                        set.step_polygon_into(step, settings, &mut workspace, &mut polygon)
                    };
                    (outline, polygon.clone())
                };
                let (around, (outline, fine)) = (draw(hull).1, draw(settings()));
                let Outline::Refined { margin_m } = outline else { continue };
                // A set of zero width is drawn with a width of 1/500 of the accuracy. Polygons that
                // do not consist of extremals stick out at sharp corners, and more so if they are
                // drawn more coarsely.
                let beyond = match margin_m {
                    _ if case.turns_little() => GROWN_M,
                    0.0 => 5e-3,
                    _ => margin_m + 1e-2,
                };
                let outside = fine.iter().map(|vertex| signed_distance(&around, *vertex));
                let most = outside.fold(f64::NEG_INFINITY, f64::max);
                assert!(most <= beyond, "{most} m outside: {:?}", case.bounds);
                compared[usize::from(case.turns_little())] += 1;
            }
        }
    }
    println!("{compared:?} compared");
    assert!(compared.iter().all(|count| *count >= 20));
}

#[test]
fn hulls_from_uncertain_starts_contain_every_drive() {
    const PARTS: usize = 4;
    let mut rng = SeededRng::new(64);
    let hull = settings().with_most_work(0);
    for class in 0..CLASSES.len() {
        for _ in 0..10 {
            let case = Case::any(class, &mut rng);
            let set = case.set();
            let (step, tube) = (set.step_polygon(set.steps(), hull), set.tube_polygon(hull));
            for _ in 0..100 {
                let mut pose = random_pose(&case.start, true, &mut rng);
                for (part, share) in
                    any_drive(PARTS * set.steps(), &mut rng).into_iter().enumerate()
                {
                    let (lo, hi) = case.bounds[part / PARTS];
                    let seconds = case.step_s / PARTS as f64;
                    pose = dubins::arc(pose, case.speed_mps, lo + (hi - lo) * share, seconds);
                    assert!(signed_distance(&tube, pose.position()) <= 0.0, "{:?}", case.bounds);
                }
                assert!(signed_distance(&step, pose.position()) <= 0.0, "{:?}", case.bounds);
            }
        }
    }
}

/// The kind of a polygon depends on the work that it takes. The paper's rates never exceed the
/// limit, a limit of 0 is always exceeded, and half a turn in each of 100 steps exceeds the default
/// limit. A hull is convex and counter-clockwise.
#[test]
fn the_limit_on_work_decides_between_the_kinds() {
    let mut rng = SeededRng::new(65);
    let (mut workspace, mut polygon) = (Workspace::default(), Vec::new());
    let mut kind = |set: &ReachableSet, settings, tube| {
        if tube {
            (set.tube_polygon_into(settings, &mut workspace, &mut polygon), polygon.clone())
        } else {
            let step = set.steps();
            (set.step_polygon_into(step, settings, &mut workspace, &mut polygon), polygon.clone())
        }
    };
    let all = [PolygonSettings::default(), settings().conservative()];
    for (settings, tube) in all.into_iter().flat_map(|it| [(it, true), (it, false)]) {
        for _ in 0..100 {
            let mut case = Case::any(0, &mut rng);
            if !settings.is_conservative() {
                case.start = case.start.pose().into();
            }
            let set = case.set();
            let (outline, _) = kind(&set, settings, tube);
            let Outline::Refined { margin_m } = outline else { panic!("{outline:?}") };
            assert_eq!(margin_m > 0.0, settings.is_conservative());
            let (outline, hull) = kind(&set, settings.with_most_work(0), tube);
            assert_eq!(outline, Outline::ConvexHull);
            assert_convex(&hull);
        }
        let bounds = InputBounds::new(vec![-PI; 100], vec![PI; 100], (-PI, PI)).unwrap();
        let set = ReachableSet::new(Pose::new(0.0, 0.0, 0.0), &bounds, 2.0, 1.0).unwrap();
        let (outline, hull) = kind(&set, settings, tube);
        assert_eq!(outline, Outline::ConvexHull);
        assert_convex(&hull);
        // The hull is nearly a disc: the vehicle turns around within about a second, and then goes
        // straight.
        let area = signed_area(&hull);
        assert!((PI * 198.0 * 198.0..PI * 200.0 * 200.0).contains(&area), "{area}");
    }
}

fn assert_convex(polygon: &[[f64; 2]]) {
    let n = polygon.len();
    let mut turned = 0.0;
    for i in 0..n {
        let [[ax, ay], [bx, by], [cx, cy]] = [i, i + 1, i + 2].map(|j| polygon[j % n]);
        let (ux, uy, vx, vy) = (bx - ax, by - ay, cx - bx, cy - by);
        let turn = sidestep::math::atan2(ux * vy - uy * vx, ux * vx + uy * vy);
        assert!(turn > 0.0, "{turn} at {bx}, {by}");
        turned += turn;
    }
    assert!((turned - TAU).abs() < 1e-6, "{turned}");
}
