//! Properties of every reachable set.

use super::{RATE_RADPS, SPEED_MPS, STEP_S, origin, random_drive, set};
use proptest::prelude::*;
use sidestep::bounds::InputBounds;
use sidestep::math::{SeededRng, hypot, sin_cos};
use sidestep::reach::polygon::{bounding_box, signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, ReachableSet};
use sidestep::vehicle::{Pose, dubins};

/// Number of sub-steps of a step in random drives.
const PARTS: usize = 8;

/// Allowed distance of a reachable position outside a polygon (m), which is the requested accuracy.
fn accuracy() -> f64 {
    PolygonSettings::default().accuracy_m()
}

/// The positions after each sub-step of a random drive.
fn positions(start: Pose, lo: &[f64], hi: &[f64], rng: &mut SeededRng) -> Vec<[f64; 2]> {
    random_drive(start, lo, hi, PARTS, rng).iter().map(Pose::position).collect()
}

/// Bounds of either sign for each of `steps` steps. Some have zero width.
fn any_bounds(steps: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    let one =
        (-RATE_RADPS..RATE_RADPS, -RATE_RADPS..RATE_RADPS, 0..8).prop_map(
            |(a, b, kind)| match kind {
                0 => (a, a),
                1 => (0.0_f64.min(a), 0.0_f64.max(a)),
                2 => (-RATE_RADPS, RATE_RADPS),
                _ => (a.min(b), a.max(b)),
            },
        );
    prop::collection::vec(one, steps).prop_map(|bounds| bounds.into_iter().unzip())
}

/// Bounds that are constant over stretches of steps, like the bounds of Algorithm 1.
fn steady_bounds(steps: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    (any_bounds(4), prop::collection::vec(0..4_usize, steps)).prop_map(|((lo, hi), mut choice)| {
        choice.sort_unstable();
        choice.iter().map(|&i| (lo[i], hi[i])).unzip()
    })
}

fn bounds() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    prop_oneof![
        (1..=15_usize).prop_flat_map(any_bounds),
        (1..=15_usize).prop_flat_map(steady_bounds),
        any_bounds(25),
        steady_bounds(25),
    ]
}

fn pose() -> impl Strategy<Value = Pose> {
    (-20.0..20.0, -20.0..20.0, -3.1..3.1).prop_map(|(x, y, psi)| Pose::new(x, y, psi))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn no_admissible_input_leaves_the_polygons((lo, hi) in bounds(), start in pose(), seed: u64) {
        let set = set(start, &lo, &hi);
        let tube = set.tube_polygon(PolygonSettings::default());
        let polygons: Vec<_> = (0..=set.steps())
            .map(|step| set.step_polygon(step, PolygonSettings::default()))
            .collect();
        let mut rng = SeededRng::new(seed);
        for _ in 0..20 {
            let positions = positions(start, &lo, &hi, &mut rng);
            for (i, &position) in positions.iter().enumerate() {
                let margin = -signed_distance(&tube, position);
                prop_assert!(margin >= -1.1 * accuracy(), "tube: {margin}");
                if (i + 1) % PARTS == 0 {
                    let step = (i + 1) / PARTS;
                    let margin = -signed_distance(&polygons[step], position);
                    prop_assert!(margin >= -1.1 * accuracy(), "step {step}: {margin}");
                }
            }
        }
    }

    #[test]
    fn every_polygon_is_finite_and_counter_clockwise((lo, hi) in bounds(), start in pose()) {
        let set = set(start, &lo, &hi);
        let polygons = (0..=set.steps())
            .map(|step| set.step_polygon(step, PolygonSettings::default()))
            .chain([set.tube_polygon(PolygonSettings::default())]);
        for polygon in polygons {
            prop_assert!(!polygon.is_empty());
            prop_assert!(polygon.iter().flatten().all(|c| c.is_finite()));
            prop_assert!(polygon.len() == 1 || polygon.first() != polygon.last());
            // The polygon of a set that is thinner than the accuracy can cross itself.
            let [x0, y0, x1, y1] = bounding_box(&polygon).expect("a polygon");
            let slack = accuracy() * hypot(x1 - x0, y1 - y0);
            prop_assert!(signed_area(&polygon) >= -slack);
        }
    }

    #[test]
    fn narrower_bounds_give_a_set_within((lo, hi) in bounds(), (a, b) in (0.0..0.5, 0.0..0.5)) {
        let outer = set(origin(), &lo, &hi);
        let narrow: (Vec<f64>, Vec<f64>) = lo
            .iter()
            .zip(&hi)
            .map(|(low, high)| (low + a * (high - low), high - b * (high - low)))
            .map(|(low, high): (f64, f64)| (low, high.max(low)))
            .unzip();
        let inner = set(origin(), &narrow.0, &narrow.1);
        let settings = PolygonSettings::default();
        for step in [1, outer.steps().div_ceil(2), outer.steps()] {
            let around = outer.step_polygon(step, settings);
            for vertex in inner.step_polygon(step, settings) {
                let margin = -signed_distance(&around, vertex);
                prop_assert!(margin >= -1.1 * accuracy(), "step {step}: {margin}");
            }
        }
        let around = outer.tube_polygon(settings);
        for vertex in inner.tube_polygon(settings) {
            prop_assert!(signed_distance(&around, vertex) <= 1.1 * accuracy());
        }
    }

    #[test]
    fn the_set_moves_with_its_start((lo, hi) in bounds(), start in pose()) {
        let (fixed, moved) = (set(origin(), &lo, &hi), set(start, &lo, &hi));
        let settings = PolygonSettings::default();
        let (sin, cos) = sin_cos(start.psi);
        let step = fixed.steps();
        for (a, b) in [
            (fixed.step_polygon(step, settings), moved.step_polygon(step, settings)),
            (fixed.tube_polygon(settings), moved.tube_polygon(settings)),
        ] {
            prop_assert!((signed_area(&a) - signed_area(&b)).abs() < 1e-9);
            for [x, y] in a {
                let there = [start.x + cos * x - sin * y, start.y + sin * x + cos * y];
                prop_assert!(signed_distance(&b, there).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn where_straight_is_always_admissible_the_tube_has_a_known_area(
        widths in prop::collection::vec((0.0..=RATE_RADPS, 0.0..=RATE_RADPS), 1..=25)
    ) {
        let (lo, hi): (Vec<f64>, Vec<f64>) = widths.iter().map(|&(a, b)| (-a, b)).unzip();
        let tube = set(origin(), &lo, &hi).tube_polygon(PolygonSettings::default());
        let exact = tube_area(&lo, &hi);
        let [x0, y0, x1, y1] = bounding_box(&tube).expect("a polygon");
        let around = 2.0 * ((x1 - x0) + (y1 - y0));
        prop_assert!((signed_area(&tube) - exact).abs() <= accuracy() * around, "{exact}");
    }
}

/// Area (m²) of the tube if straight driving is admissible in every step. With a remaining time of
/// t, the front sweeps (v²/2)·t² per radian.
fn tube_area(lo: &[f64], hi: &[f64]) -> f64 {
    let cube = |seconds: f64| seconds * seconds * seconds;
    let left = |step: usize| (lo.len() - step) as f64 * STEP_S;
    (0..lo.len()).map(|i| (cube(left(i)) - cube(left(i + 1))) * (hi[i] - lo[i])).sum::<f64>()
        * (SPEED_MPS * SPEED_MPS / 6.0)
}

#[test]
fn the_worst_case_of_two_seconds() {
    let (lo, hi) = ([-0.5; 10], [0.5; 10]);
    let tube = set(origin(), &lo, &hi).tube_polygon(PolygonSettings::default());
    assert!((tube_area(&lo, &hi) - 16.0 / 3.0).abs() < 1e-12);
    assert!((signed_area(&tube) - 16.0 / 3.0).abs() < 1e-4);
}

#[test]
fn finer_settings_come_closer() {
    let exact = set(origin(), &[-0.5; 10], &[0.5; 10]);
    let perimeter = 12.0;
    for accuracy_m in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
        let settings = PolygonSettings::new(accuracy_m, 1).expect("settings");
        let error = (signed_area(&exact.tube_polygon(settings)) - 16.0 / 3.0).abs();
        assert!(error < accuracy_m * perimeter, "{accuracy_m}: {error}");
    }
}

#[test]
fn without_a_choice_the_set_is_a_path() {
    let rates = [0.3, -0.5, 0.0, 0.5];
    let start = Pose::new(1.0, 2.0, 3.0);
    let path = set(start, &rates, &rates);
    let tube = path.tube_polygon(PolygonSettings::default());
    let mut pose = start;
    for (i, &rate) in rates.iter().enumerate() {
        pose = dubins::arc(pose, SPEED_MPS, rate, STEP_S);
        let polygon = path.step_polygon(i + 1, PolygonSettings::default());
        for [x, y] in &polygon {
            assert!(hypot(x - pose.x, y - pose.y) < 1e-9);
        }
        assert_eq!(polygon.len(), 1);
        assert!(signed_distance(&tube, pose.position()) <= 1e-9);
    }
    // A path of 1.6 m, drawn with a width of 1/500 of the accuracy.
    let area = signed_area(&tube);
    assert!((0.0..1.1 * 1.6 * 0.002 * accuracy()).contains(&area), "{area}");
    assert!(signed_distance(&tube, [5.0, 5.0]) > 1e-3);
}

/// If a bound is close to zero, a long piece of the front belongs to extremals that hardly differ
/// at their ends, so their switching times must be accurate to all digits.
#[test]
fn a_tube_with_a_bound_close_to_zero() {
    let (mut lo, mut hi) = ([0.0; 25], [0.0; 25]);
    (lo[8], hi[8]) = (-0.469_978_237_911_217_6, -2.437_447_734_116_647_2e-5);
    (lo[9], hi[9]) = (-0.5, 0.5);
    hi[11] = 0.240_659_119_707_717_07;
    (lo[14], hi[14]) = (-0.311_951_714_759_249_1, -0.311_951_714_759_249_1);
    let set = set(origin(), &lo, &hi);
    let tube = set.tube_polygon(PolygonSettings::default());
    let mut rng = SeededRng::new(4_154_081_824);
    for _ in 0..20 {
        for position in positions(origin(), &lo, &hi, &mut rng) {
            let margin = -signed_distance(&tube, position);
            assert!(margin >= -1.1 * accuracy(), "{margin}");
        }
    }
}

#[test]
fn one_step_and_none() {
    let one = set(origin(), &[-0.5], &[0.5]);
    assert_eq!(one.step_polygon(0, PolygonSettings::default()), [[0.0, 0.0]]);
    let polygon = one.step_polygon(1, PolygonSettings::default());
    let area = signed_area(&polygon);
    // The area equals the area of the reference's case 0, up to its sampling error.
    assert!((area - 4.04e-6).abs() < 1e-7, "{area}");
}

#[test]
fn ten_seconds_of_full_turns() {
    let (lo, hi) = ([-0.5; 50], [0.5; 50]);
    let wide = set(origin(), &lo, &hi);
    let settings = PolygonSettings::new(1e-3, 16).expect("settings");
    let (last, tube) = (wide.step_polygon(50, settings), wide.tube_polygon(settings));
    let mut rng = SeededRng::new(3);
    for _ in 0..200 {
        let positions = positions(origin(), &lo, &hi, &mut rng);
        for &position in positions.iter().step_by(3) {
            let margin = -signed_distance(&tube, position);
            assert!(margin >= -1.1e-3, "{margin} {position:?}");
        }
        assert!(signed_distance(&last, positions[positions.len() - 1]) <= 1.1e-3);
    }
}

#[test]
fn bad_input_is_refused() {
    let bounds = InputBounds::new(vec![0.0], vec![0.5], (-0.5, 0.5)).expect("bounds");
    let field = |start: Pose, speed: f64, step: f64| {
        ReachableSet::new(start, &bounds, speed, step).map(|_| ()).expect_err("refused").field
    };
    let nowhere = Pose { x: f64::NAN, ..origin() };
    assert_eq!(field(nowhere, 2.0, 0.2), "start.x");
    assert_eq!(field(origin(), 0.0, 0.2), "speed_mps");
    assert_eq!(field(origin(), 2.0, f64::INFINITY), "step_s");
}
