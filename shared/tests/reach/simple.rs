//! Polygons neither cross nor touch themselves, as other libraries require. The test checks every
//! pair of edges.

use super::hull::CLASSES;
use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::{PolygonSettings, PositionUncertainty, ReachableSet, StartSet};
use sidestep::vehicle::Pose;

type Point = [f64; 2];

/// Twice the signed area of a triangle. Positive if it is counter-clockwise.
fn turn(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether two segments have a point in common.
fn meet(a: Point, b: Point, c: Point, d: Point) -> bool {
    let within = |a: f64, b: f64, c: f64, d: f64| a.min(b) <= c.max(d) && c.min(d) <= a.max(b);
    within(a[0], b[0], c[0], d[0])
        && within(a[1], b[1], c[1], d[1])
        && turn(a, b, c) * turn(a, b, d) <= 0.0
        && turn(c, d, a) * turn(c, d, b) <= 0.0
}

/// Describes a flaw of a polygon, if it has any. A single vertex is not a flaw.
fn flaw(polygon: &[Point]) -> Option<String> {
    let n = polygon.len();
    if n < 3 {
        return (n != 1).then(|| format!("{n} vertices"));
    }
    let at = |i: usize| polygon[i % n];
    for i in 0..n {
        let (a, b, c) = (at(i), at(i + 1), at(i + 2));
        let ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]);
        if a == b || (turn(a, b, c) == 0.0 && ahead < 0.0) {
            return Some(format!("a spike at {b:?}, vertex {} of {n}", (i + 1) % n));
        }
        for j in i + 2..n {
            if (j + 1) % n != i && meet(a, b, at(j), at(j + 1)) {
                return Some(format!("edges {i} and {j} of {n} meet at {a:?} to {b:?}"));
            }
        }
    }
    None
}

#[test]
fn flaws_are_found() {
    assert_eq!(flaw(&[[0., 0.], [2., 0.], [1., 1.]]), None);
    assert!(flaw(&[[0., 0.], [2., 0.]]).is_some());
    assert!(flaw(&[[0., 0.], [2., 0.], [4., 0.]]).is_some());
    assert!(flaw(&[[0., 0.], [2., 2.], [2., 0.], [0., 2.]]).is_some());
    // A vertex on another edge, and a repeated vertex.
    assert!(flaw(&[[0., 0.], [4., 0.], [4., 2.], [2., 0.], [0., 2.]]).is_some());
    assert!(flaw(&[[0., 0.], [1., 1.], [2., 0.], [2., 2.], [1., 1.], [0., 2.]]).is_some());
}

/// Checks a tube, and the first, middle and last step, each from a pose and from an uncertain
/// start.
fn check(lo: &[f64], hi: &[f64], (speed_mps, step_s): (f64, f64), rng: &mut SeededRng) {
    let bounds = InputBounds::new(lo.to_vec(), hi.to_vec(), (-10.0, 10.0)).unwrap();
    let pose = Pose::new(3.0, -2.0, rng.uniform(-3.0, 3.0));
    let disc = PositionUncertainty::Disc { radius_m: rng.uniform(0.0, 0.5) };
    let unsure = StartSet::new(pose, disc, rng.uniform(0.0, 0.5)).unwrap();
    let exact = PolygonSettings::new(1e-3, 4).unwrap();
    let surely = exact.conservative();
    for (start, settings) in [(pose.into(), exact), (pose.into(), surely), (unsure, exact)] {
        let set = ReachableSet::new(start, &bounds, speed_mps, step_s).unwrap();
        let found = flaw(&set.tube_polygon(settings));
        assert_eq!(found, None, "tube from {start:?}, {settings:?}, lo {lo:?} hi {hi:?}");
        for step in [1, set.steps().div_ceil(2), set.steps()] {
            let found = flaw(&set.step_polygon(step, settings));
            assert_eq!(found, None, "{step} from {start:?}, {settings:?}, lo {lo:?} hi {hi:?}");
        }
    }
}

/// Includes bounds without a choice. Their tubes begin as lines, and their sets are single
/// positions.
#[test]
fn no_polygon_meets_itself() {
    let mut rng = SeededRng::new(91);
    for (speed_mps, step_s, most, steps) in CLASSES {
        for _ in 0..if steps == 15 { 300 } else { 20 } {
            let bound = |rng: &mut SeededRng| {
                let (a, b) = (rng.uniform(-most, most), rng.uniform(-most, most));
                match rng.below(5) {
                    0 => (a, a),
                    1 => (-most, most),
                    2 => (0.0, 0.0),
                    3 => (a.min(0.0), a.max(0.0)),
                    _ => (a.min(b), a.max(b)),
                }
            };
            let bounds = (0..=rng.below(steps)).map(|_| bound(&mut rng));
            let (lo, hi): (Vec<_>, Vec<_>) = bounds.unzip();
            check(&lo, &hi, (speed_mps, step_s), &mut rng);
        }
    }
}

/// The polygons of steps 1 and 3 of this set once crossed themselves.
#[test]
fn a_polygon_that_met_itself_does_not_any_more() {
    let (lo, hi) = ([-2.79, 2.12, -2.85], [1.15, 2.86, -2.0]);
    check(&lo, &hi, (10.0, 0.5), &mut SeededRng::new(92));
}
