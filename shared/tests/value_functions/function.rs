//! A value function, as the rest of the program uses it: values, gradients, level curves and
//! encoded bytes.

use super::{game, paper, paper_polar, quantile, solved, states, unequal, unequal_polar};
use sidestep::math::{PI, TAU, atan2, hypot, sin_cos};
use sidestep::reach::polygon::signed_area;
use sidestep::reachability::{
    Accuracy, CartesianGrid, CurveSettings, Nodes, Options, Scheme, ValueFunction,
};

/// −R ≤ V ≤ r − R, also between the nodes of a grid and on kinks. Far away, V is the distance from
/// the danger zone.
#[test]
fn values_are_from_minus_the_radius_to_the_distance_of_the_danger_zone() {
    let options = Options::default().with_accuracy(Accuracy::Draft);
    let ours = solved(unequal(), &options.with_horizon(6.0));
    let kinked = solved(game([1.0, 3.0], [5.0, 0.1], 1.0), &options);
    let radius_m = unequal().radius_m;
    let mut least = f64::INFINITY;
    for state in states(3, 200_000, 8.0) {
        let range_m = hypot(state[0], state[1]);
        let value = ours.function.value(state);
        assert!(value <= range_m - radius_m, "{state:?}: {value}");
        assert!(kinked.function.value(state) <= range_m - 1.0, "{state:?}");
        least = least.min(value);
    }
    assert!(-radius_m <= least && least < -0.99 * radius_m, "{least}");
    for far_m in [1e6, 1e155, 1e300] {
        let state = ours.function.state([-far_m, far_m, 1.0]);
        assert_eq!(state.value, hypot(far_m, far_m) - radius_m);
        assert!(!state.inside && state.gradient.iter().all(|slope| slope.is_finite()), "{state:?}");
    }
}

#[test]
fn what_is_no_state_has_no_value() {
    for f in [&paper_polar().function, &ValueFunction::Exact(paper().exact().unwrap())] {
        for psi in [f64::NAN, f64::INFINITY] {
            assert!(f.value([5.0, 5.0, psi]).is_nan());
            let refused = f.level_curves(psi, 0.0, CurveSettings::default()).unwrap_err();
            assert_eq!(refused.field, "psi");
        }
        assert!(f.value([f64::NAN, 5.0, 1.0]).is_nan());
        for level in [f64::NAN, f64::INFINITY, -3.0, -9.0] {
            let mut curves = vec![vec![[1.0, 2.0]]];
            let settings = CurveSettings::default();
            let refused = f.level_curves_into(1.0, level, settings, &mut curves).unwrap_err();
            assert_eq!((refused.field.as_str(), curves.len()), ("level", 0));
        }
        let spacing_m = f64::NAN;
        let settings = CurveSettings::default().with_spacing(spacing_m);
        assert_eq!(f.level_curves(1.0, 0.0, settings).unwrap_err().field, "spacing_m");
    }
}

#[test]
fn a_batch_gives_the_same_bits() {
    for f in [&paper_polar().function, &ValueFunction::Exact(paper().exact().unwrap())] {
        // The batch has three parts, and the last part is not full.
        let mut states = states(12, 10_000, 30.0);
        let mut values = vec![0.0; states.len()];
        f.values_into(&states, &mut values).unwrap();
        for (state, value) in states.iter().zip(&values) {
            assert_eq!(value.to_bits(), f.value(*state).to_bits(), "{state:?}");
        }
        states[9000][2] = f64::INFINITY;
        let mut untouched = vec![7.0; states.len()];
        let refused = f.values_into(&states, &mut untouched).unwrap_err();
        assert_eq!(refused.to_string(), "states[9000].psi: expected a finite number, found inf");
        let refused = f.values_into(&states[..9000], &mut untouched).unwrap_err();
        assert_eq!(refused.to_string(), "out: expected 9000 entries, found 10000 entries");
        assert_eq!(untouched, vec![7.0; states.len()]);
    }
}

#[test]
fn gradients_are_those_of_the_value() {
    for solved in [paper_polar(), unequal_polar()] {
        let f = &solved.function;
        let mut off = Vec::new();
        for state in states(4, 4000, 30.0) {
            let gradient = f.state(state).gradient;
            for d in 0..3 {
                let step = |h: f64| {
                    let mut moved = state;
                    moved[d] += h;
                    f.value(moved)
                };
                // Differences over smaller distances would be too inaccurate, because the table has
                // single precision.
                let slope = (step(2e-3) - step(-2e-3)) / 4e-3;
                off.push((slope - gradient[d]).abs() / (1.0 + slope.abs()));
            }
        }
        // At most 5 % of the differences are taken across a cell face or a kink.
        let p95 = quantile(&mut off, 0.95);
        assert!(p95 < 5e-3, "{p95}");
    }
}

#[test]
fn symmetric_and_periodic() {
    let f = &unequal_polar().function;
    for [x, y, psi] in states(6, 2000, 50.0) {
        let value = f.value([x, y, psi]);
        assert!((value - f.value([x, -y, -psi])).abs() < 1e-5);
        assert!((value - f.value([x, y, psi + 3.0 * TAU])).abs() < 1e-5);
        assert!(value <= hypot(x, y) - 3.0 + 1e-4, "never above the present range");
        // V is continuous where the bearing and the heading wrap.
        assert!((f.value([x, 1e-9, psi]) - f.value([x, -1e-9, psi])).abs() < 1e-5);
        assert!((f.value([x, y, 1e-9]) - f.value([x, y, -1e-9])).abs() < 1e-5);
    }
}

#[test]
fn a_bearing_is_continuous_around_the_evader() {
    // The table's own arctangent must not introduce a jump anywhere.
    let f = &paper_polar().function;
    let mut last = None;
    for step in 0..=20_000 {
        let angle = f64::from(step) * TAU / 20_000.0;
        let (sin, cos) = sin_cos(angle);
        let (x, y) = (10.0 * cos, 10.0 * sin);
        assert!((atan2(y, x) - angle).abs() < 1e-9 || angle > PI - 1e-9);
        let value = f.value([x, y, 2.0]);
        if let Some(last) = last {
            let jump: f64 = value - last;
            assert!(jump.abs() < 0.03, "{jump} at {angle}");
        }
        last = Some(value);
    }
}

#[test]
fn beyond_the_grid_the_deficit_is_that_of_its_edge() {
    let f = &unequal_polar().function;
    let Nodes::Polar { range_m, .. } = unequal_polar().samples.nodes() else { panic!("polar") };
    for [x, y, psi] in states(7, 500, 1.0) {
        let r = hypot(x, y);
        let at = |range: f64| f.state([x / r * range, y / r * range, psi]);
        let edge = at(range_m - 1e-9);
        let far = at(3.0 * range_m);
        assert!(edge.inside && !far.inside);
        assert!((far.value - 2.0 * range_m - edge.value).abs() < 1e-3, "{edge:?} {far:?}");
        let radial = far.gradient[0] * x / r + far.gradient[1] * y / r;
        assert!((radial - 1.0).abs() < 1e-9);
    }
    // Beyond a Cartesian grid, the deficit equals the deficit at the nearest point of the grid's
    // box.
    let grid =
        CartesianGrid::new([21, 21, 16], [-10.0, 10.0, -10.0, 10.0]).with_scheme(Scheme::Eno2);
    let options = Options::default().with_horizon(1.0).with_grid(grid);
    let f = solved(unequal(), &options).function;
    let (edge, far) = (f.state([10.0, 2.0, 1.0]), f.state([25.0, 2.0, 1.0]));
    assert!(edge.inside && !far.inside);
    let grown = hypot(25.0, 2.0) - hypot(10.0, 2.0);
    assert!((far.value - edge.value - grown).abs() < 1e-5);
}

#[test]
fn level_curves_lie_on_the_level_and_close() {
    let settings = CurveSettings::default();
    for solved in [paper_polar(), unequal_polar()] {
        for step in 0..24 {
            let psi = f64::from(step) * TAU / 24.0 + 0.03;
            for level in [0.0, 1.0] {
                let curves = solved.function.level_curves(psi, level, settings).unwrap();
                assert_eq!(curves.len(), 1, "psi {psi}");
                let mut off = Vec::new();
                for (a, b) in curves[0].iter().zip(curves[0].iter().cycle().skip(1)) {
                    off.push((solved.function.value([a[0], a[1], psi]) - level).abs());
                    assert!(hypot(b[0] - a[0], b[1] - a[1]) < 0.9, "a gap at {a:?}");
                }
                assert!(quantile(&mut off, 0.9) < 2e-3, "{}", quantile(&mut off, 0.9));
                assert!(quantile(&mut off, 1.0) < 0.05, "{}", quantile(&mut off, 1.0));
                if solved.function.game().identical() {
                    let exact = ValueFunction::Exact(paper().exact().unwrap());
                    let truth = signed_area(&exact.level_curves(psi, level, settings).unwrap()[0]);
                    let found = signed_area(&curves[0]);
                    assert!((found / truth - 1.0).abs() < 0.01, "psi {psi}: {found} {truth}");
                }
            }
        }
    }
}

#[test]
fn a_set_that_leaves_the_grid_closes_along_its_edge() {
    // Every state is lost against a pursuer that is twice as fast and turns twice as fast.
    let options = Options::default().with_range(6.0);
    let solved = solved(game([1.0, 0.5], [2.0, 1.0], 3.0), &options);
    let curves = solved.function.level_curves(0.4, 0.0, CurveSettings::default()).unwrap();
    let reach = curves.iter().flatten().map(|p| hypot(p[0], p[1])).fold(0.0, f64::max);
    assert!((reach - 6.0).abs() < 1e-6, "{reach}");
    let widest = curves.iter().map(|curve| signed_area(curve)).fold(0.0, f64::max);
    assert!(widest > 0.95 * PI * 36.0, "{widest}");
}

#[test]
fn transport_is_small_and_close() {
    for solved in [paper_polar(), unequal_polar()] {
        let f = ValueFunction::Sampled(solved.samples.clone());
        let bytes = f.encode();
        let again = ValueFunction::decode(&bytes).unwrap();
        assert_eq!(again.id(), f.id(), "the same bytes again");
        let off = states(8, 50_000, 45.0)
            .into_iter()
            .map(|state| (again.value(state) - f.value(state)).abs())
            .fold(0.0, f64::max);
        eprintln!("{} bytes, largest error {off:.5} m", bytes.len());
        assert!(off <= 2e-3, "{off}");
        // The bytes are also compressed for transport.
        assert!(bytes.len() <= 1_500_000, "{}", bytes.len());
    }
}
