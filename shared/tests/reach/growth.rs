//! Conservative polygons, sets from uncertain starts, and Minkowski sums.

use super::{SPEED_MPS, STEP_S, origin, random_drive, random_pose, set};
use sidestep::math::{PI, SeededRng, TAU, hypot};
use sidestep::reach::polygon::{signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, PositionUncertainty, StartSet, minkowski_disc};
use sidestep::vehicle::{Pose, dubins};

fn settings() -> PolygonSettings {
    PolygonSettings::new(1e-3, 2).expect("settings")
}

/// Bounds of either sign. Some have zero width.
fn any_bounds(steps: usize, rng: &mut SeededRng) -> (Vec<f64>, Vec<f64>) {
    let straight = rng.below(3) == 0;
    let mut held = (0.0, 0.0);
    let mut bounds = Vec::new();
    for _ in 0..steps {
        if rng.below(2) == 0 || bounds.is_empty() {
            let (a, b) = (rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
            held = match rng.below(6) {
                _ if straight => (-a.abs(), b.abs()),
                0 => (a, a),
                1 => (-0.5, 0.5),
                2 => (0.0, 0.0),
                _ => (a.min(b), a.max(b)),
            };
        }
        bounds.push(held);
    }
    bounds.into_iter().unzip()
}

fn starts(pose: Pose, rng: &mut SeededRng) -> StartSet {
    let position = match rng.below(4) {
        0 | 1 => PositionUncertainty::None,
        2 => PositionUncertainty::Disc { radius_m: rng.uniform(0.0, 1.0) },
        _ => PositionUncertainty::Box {
            along_m: rng.uniform(0.0, 1.0),
            across_m: rng.uniform(0.0, 0.5),
        },
    };
    let heading = if rng.below(2) == 0 { 0.0 } else { rng.uniform(0.0, 0.5) };
    StartSet::new(pose, position, heading).expect("a start")
}

/// Tests 10⁵ drives. All their positions must be inside. Not even a rounding error is allowed.
#[test]
fn no_drive_leaves_a_conservative_polygon() {
    const PARTS: usize = 5;
    let mut rng = SeededRng::new(41);
    for case in 0..500 {
        let (lo, hi) = any_bounds(1 + rng.below(15), &mut rng);
        let start = starts(Pose::new(3.0, -2.0, rng.uniform(-3.0, 3.0)), &mut rng);
        let set = set(start, &lo, &hi);
        let steps = set.steps();
        let surely = settings().conservative();
        let (tube, middle, last) = (
            set.tube_polygon(surely),
            set.step_polygon(steps.div_ceil(2), surely),
            set.step_polygon(steps, surely),
        );
        for _ in 0..200 {
            let from = random_pose(&start, true, &mut rng);
            let drive = random_drive(from, &lo, &hi, PARTS, &mut rng);
            let positions: Vec<_> = drive.iter().map(Pose::position).collect();
            let at = |step: usize| positions[step * PARTS - 1];
            for (what, polygon, position) in [
                ("tube", &tube, positions[rng.below(positions.len())]),
                ("tube", &tube, at(steps)),
                ("middle", &middle, at(steps.div_ceil(2))),
                ("last", &last, at(steps)),
            ] {
                let margin = -signed_distance(polygon, position);
                assert!(margin >= 0.0, "case {case} {what}: {margin} {start:?} {lo:?} {hi:?}");
            }
        }
    }
}

/// Conservative polygons are at most 3 % larger than the set, for sets of 0.1 m² or more. At sharp
/// corners, they can stick out by a few times the accuracy.
#[test]
fn a_conservative_polygon_exceeds_little() {
    let mut rng = SeededRng::new(42);
    let fine = PolygonSettings::new(1e-6, 4).expect("settings").with_most_work(usize::MAX);
    let (mut largest, mut farthest) = (0.0_f64, 0.0_f64);
    for _ in 0..60 {
        let (lo, hi) = any_bounds(1 + rng.below(15), &mut rng);
        let start = starts(Pose::new(0.0, 0.0, 1.0), &mut rng);
        let set = set(start, &lo, &hi);
        for (exact, surely) in [
            (set.tube_polygon(fine), set.tube_polygon(settings().conservative())),
            (
                set.step_polygon(set.steps(), fine),
                set.step_polygon(set.steps(), settings().conservative()),
            ),
        ] {
            let area = signed_area(&exact);
            if area >= 0.1 {
                largest = largest.max(signed_area(&surely) / area - 1.0);
            }
            for &vertex in &surely {
                let margin = -signed_distance(&exact, vertex);
                farthest = farthest.max(-margin);
                // The fine polygon deviates from the boundary to both sides, and sticks out at
                // sharp corners.
                assert!(margin <= 10.0 * fine.accuracy_m(), "{margin}");
            }
        }
    }
    println!("{:.2} % larger, {:.2} mm beyond", 100.0 * largest, 1e3 * farthest);
    assert!(largest <= 0.03, "{largest}");
    assert!(farthest <= 10.0 * settings().accuracy_m(), "{farthest}");
}

/// For every boundary point, some input that switches between the bounds and straight driving ends
/// nearby. These inputs are enumerated with 6 sub-steps per step, over three steps.
#[test]
fn enumerated_inputs_reach_every_boundary_point() {
    const PARTS: usize = 6;
    let cases: [[(f64, f64); 3]; 4] = [
        [(-0.5, 0.5); 3],
        [(0.1, 0.5), (-0.3, 0.2), (-0.5, -0.4)],
        [(-0.5, 0.0), (0.2, 0.2), (-0.1, 0.5)],
        [(0.3, 0.5), (-0.5, 0.5), (-0.5, -0.2)],
    ];
    for case in cases {
        let (lo, hi): (Vec<f64>, Vec<f64>) = case.into_iter().unzip();
        let set = set(origin(), &lo, &hi);
        let mut ends = vec![];
        // An input has at most two switches, between the two bounds and the admissible rate nearest
        // to 0.
        let parts = 3 * PARTS;
        for (first, second) in (0..=parts).flat_map(|i| (i..=parts).map(move |j| (i, j))) {
            for code in 0..27 {
                let kinds = [code % 3, code / 3 % 3, code / 9];
                let mut pose = set.start();
                for part in 0..parts {
                    let kind = kinds[usize::from(part >= first) + usize::from(part >= second)];
                    let (low, high) = case[part / PARTS];
                    let rate = [low, 0.0_f64.clamp(low, high), high][kind];
                    pose = dubins::arc(pose, SPEED_MPS, rate, STEP_S / PARTS as f64);
                }
                ends.push(pose.position());
            }
        }
        for [x, y] in set.step_polygon(3, settings()) {
            let nearest =
                ends.iter().map(|end| hypot(end[0] - x, end[1] - y)).fold(f64::INFINITY, f64::min);
            assert!(nearest <= 5e-3, "{nearest} {x} {y} {case:?}");
        }
    }
}

#[test]
fn an_uncertain_start_gives_the_union_of_its_starts() {
    let mut rng = SeededRng::new(43);
    for _ in 0..40 {
        let (lo, hi) = any_bounds(1 + rng.below(12), &mut rng);
        let start = starts(Pose::new(1.0, 2.0, 0.5), &mut rng);
        let all = set(start, &lo, &hi);
        let grown = [all.tube_polygon(settings()), all.step_polygon(all.steps(), settings())];
        // The exact set of every start is inside.
        let exact: Vec<_> = (0..300)
            .map(|_| {
                let one = set(random_pose(&start, true, &mut rng), &lo, &hi);
                [one.tube_polygon(settings()), one.step_polygon(one.steps(), settings())]
            })
            .collect();
        for one in &exact {
            for (around, polygon) in grown.iter().zip(one) {
                for &vertex in polygon {
                    let margin = -signed_distance(around, vertex);
                    assert!(margin >= -1e-3, "{margin} {start:?}");
                }
            }
        }
        assert!(signed_area(&grown[0]) >= -1e-9);
    }
}

#[test]
fn a_turned_path_sweeps_a_sector() {
    // There is no choice, so the set is an arc of ±0.4 rad around the start.
    let start = StartSet::new(origin(), PositionUncertainty::None, 0.4);
    let set = set(start.expect("a start"), &[0.0; 5], &[0.0; 5]);
    let fine = PolygonSettings::new(1e-5, 1).expect("settings");
    let tube = set.tube_polygon(fine);
    assert!((signed_area(&tube) - 0.4 * 4.0).abs() < 1e-4, "{}", signed_area(&tube));
    for [x, y] in set.step_polygon(5, fine) {
        assert!((hypot(x, y) - 2.0).abs() < 1e-4);
    }
}

#[test]
fn sums_with_a_disc() {
    let square = [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]];
    let area = |polygon: &[[f64; 2]], radius: f64| {
        signed_area(&minkowski_disc(polygon, radius, 1e-3).expect("a sum"))
    };
    let disc = PI * 9.0;
    // The excess is up to 10⁻³ m all along the perimeter.
    let excess =
        |found: f64, exact: f64| found >= exact && found - exact < 1e-3 * (8.0 + 3.0 * TAU);
    assert!(excess(area(&square, 3.0), 4.0 + 8.0 * 3.0 + disc));
    assert!(excess(area(&square[..1], 3.0), disc));
    assert!(excess(area(&square[..2], 3.0), 2.0 * 2.0 * 3.0 + disc));
    assert!(excess(area(&square, 0.0), 4.0));
    // The sum fills a bay of the polygon that is narrower than the disc.
    let bay = [[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [1.5, 0.5], [1.0, 2.0], [0.0, 2.0]];
    let grown = minkowski_disc(&bay, 1.0, 1e-3).expect("a sum");
    assert!(signed_distance(&grown, [1.5, 2.0]) < 0.0);
    let mut rng = SeededRng::new(5);
    for _ in 0..2000 {
        let position = [rng.uniform(-2.0, 5.0), rng.uniform(-2.0, 4.0)];
        let from_bay = -signed_distance(&bay, position) + 1.0;
        if from_bay >= 0.0 {
            assert!(signed_distance(&grown, position) <= 0.0);
        } else if from_bay < -1e-3 {
            assert!(signed_distance(&grown, position) > 0.0);
        }
    }
}

#[test]
fn bad_input_is_refused() {
    let field =
        |position, heading| StartSet::new(origin(), position, heading).expect_err("refused").field;
    assert_eq!(field(PositionUncertainty::Disc { radius_m: -1.0 }, 0.0), "radius_m");
    assert_eq!(field(PositionUncertainty::Disc { radius_m: f64::NAN }, 0.0), "radius_m");
    let wide = PositionUncertainty::Box { along_m: 1.0, across_m: f64::INFINITY };
    assert_eq!(field(wide, 0.0), "across_m");
    assert_eq!(field(PositionUncertainty::None, -0.1), "heading_rad");
    assert_eq!(field(PositionUncertainty::None, 4.0), "heading_rad");
    let field = |polygon: &[[f64; 2]], radius, accuracy| {
        minkowski_disc(polygon, radius, accuracy).expect_err("refused").field
    };
    assert_eq!(field(&[], 1.0, 1e-3), "polygon");
    assert_eq!(field(&[[0.0, f64::NAN]], 1.0, 1e-3), "polygon");
    assert_eq!(field(&[[0.0, 0.0]], -1.0, 1e-3), "radius_m");
    assert_eq!(field(&[[0.0, 0.0]], 1.0, 0.0), "accuracy_m");
}
