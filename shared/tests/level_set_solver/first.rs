//! The minimum time to reach a target, and the inputs that achieve it.

use super::*;
use sidestep::reachability::{DubinsCar, Players};

#[test]
fn the_time_to_reach_a_target_is_known() {
    // The car reaches |x| ≤ 0.5 at 1 m/s, with or against a drift of 0.25 m/s, so at 1.25 m/s or
    // 0.75 m/s.
    let game = Drift { drift: [0.25], speed: [1.0] };
    let target = |[x]: [f64; 1]| x.abs() - 0.5;
    let axes = [Axis::bounded(-4.0, 4.0, 161)];
    let tube = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 2.0);
    let solution: Solution<f64, 1> = solved(&tube, &settings(Scheme::Weno5).with_slices(20));
    for (x, expected) in [(0.3, 0.0), (-0.5, 0.0), (-2.0, 1.2), (1.7, 1.6), (-2.9, 1.92)] {
        let found = solution.time_to_reach([x]).unwrap();
        assert!((found - expected).abs() < 0.01, "{x}: {found} {expected}");
    }
    for x in [-3.2, 2.2, 4.0] {
        assert_eq!(solution.time_to_reach([x]).unwrap(), f64::INFINITY);
    }
    assert_eq!(solution.time_to_reach([4.1]).unwrap_err().field, "state[0]");
    let set = problem(&game, axes, &target, (Kind::Set, BACKWARD), 2.0);
    let set: Solution<f64, 1> = solved(&set, &settings(Scheme::Eno2).with_slices(2));
    assert_eq!(set.time_to_reach([0.0]).unwrap_err().field, "kind");
    let last: Solution<f64, 1> = solved(&tube, &settings(Scheme::Eno2));
    let complaint = last.time_to_reach([0.0]).unwrap_err().to_string();
    assert!(complaint.contains("several stored instants"), "{complaint}");
}

/// A car that needs 3.5 to 5 s arrives, although the horizon is 12 s.
#[test]
fn inputs_at_the_first_time_arrive() {
    let car = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
    let target = |[x, y, _]: [f64; 3]| hypot(x, y) - 0.5;
    let side = Axis::bounded(-6.0, 6.0, 41);
    let axes = [side, side, Axis::periodic(0.0, TAU, 32)];
    let tube = problem(&car, axes, &target, (Kind::Tube, BACKWARD), 12.0);
    let solution: Solution<f32, 3> = solved(&tube, &Settings::new(Scheme::Weno5).with_slices(48));
    for start in [[-4.5, 0.5, 0.1], [1.0, 4.2, -PI / 2.0], [3.0, -3.0, PI]] {
        let needed = solution.time_to_reach(start).unwrap();
        assert!((3.4..5.1).contains(&needed), "{needed}");
        let (mut state, mut elapsed, step) = (start, 0.0, 0.02);
        while target(state) > 0.0 && elapsed < 7.0 {
            let inputs = solution.first_inputs(&car, state).unwrap();
            let velocity = car.velocity(state, &inputs);
            state = core::array::from_fn(|d| state[d] + step * velocity[d]);
            elapsed += step;
        }
        eprintln!("{start:?}: {needed:.2} s promised, {elapsed:.2} s needed");
        assert!(target(state) <= 0.0 && elapsed < needed + 0.3, "{start:?}: {elapsed} {needed}");
    }
}
