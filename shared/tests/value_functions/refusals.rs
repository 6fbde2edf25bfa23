//! Problems that are rejected, cancelled or marked as not converged.

use super::{game, paper, refused, unequal, unequal_polar};
use core::ops::ControlFlow;
use sidestep::reachability::polar;
use sidestep::reachability::{
    CartesianGrid, Method, Nodes, Options, Precision, PursuitGame, SampledValue, Scheme,
    SolveError, ValueFunction, solve,
};

/// The error message suggests a radius and a method, and both are accepted.
#[test]
fn a_radius_that_the_polar_grid_cannot_follow_is_refused_with_a_way_out() {
    let wide = game([2.0, 0.5], [1.5, 0.8], 300.0);
    let complaint = refused(wide, &Options::default());
    assert!(complaint.starts_with("turn_rate_radps: expected turn rates that"), "{complaint}");
    let (_, most_m) = complaint.split_once("a radius of at most ").unwrap();
    let (most_m, other) = most_m.split_once(" m, or method ").unwrap();
    assert!(other.starts_with("cartesian)"), "{complaint}");
    let radius_m = most_m.parse::<f64>().unwrap() - 1e-3;
    let cartesian = Options::default().with_method(Method::Cartesian);
    for (game, options) in
        [(PursuitGame { radius_m, ..wide }, Options::default()), (wide, cartesian)]
    {
        let begun = solve(game, &options, &mut |_| ControlFlow::Break(()));
        assert_eq!(begun.unwrap_err(), SolveError::Cancelled);
    }
}

#[test]
fn a_horizon_that_no_solve_gets_to_the_end_of_is_refused() {
    let complaint = refused(unequal(), &Options::default().with_horizon(1e300));
    assert!(complaint.starts_with("horizon_s: expected at most "), "{complaint}");
    assert!(complaint.ends_with(" s, 1e8 time steps of this grid, found 1e300"), "{complaint}");
}

/// The drift is finite even if there are fewer sweeps than the window over which the drift is
/// measured. It must be finite, because JSON cannot represent infinity.
#[test]
fn a_solve_of_few_sweeps_stays_marked_in_its_bytes() {
    let few = |most_sweeps| {
        let settings = polar::Settings::default()
            .with_range_nodes(33)
            .with_angle_nodes(48)
            .with_most_sweeps(most_sweeps);
        polar::solve::<f32>(&unequal(), &settings, &mut |_| ControlFlow::Continue(()))
    };
    for most_sweeps in [1, 5, polar::WINDOW - 1, polar::WINDOW] {
        let solution = few(most_sweeps).unwrap();
        assert!(!solution.converged && solution.drift_m.is_finite(), "{most_sweeps} sweeps");
        let sampled = SampledValue::from_polar(unequal(), &solution).unwrap();
        let function = ValueFunction::Sampled(sampled.into());
        let again = ValueFunction::decode(&function.encode()).unwrap();
        assert_eq!(again.unsettled_m(), Some(solution.drift_m), "{most_sweeps} sweeps");
    }
    let SolveError::Invalid(complaint) = few(0).unwrap_err() else { panic!("not cancelled") };
    assert_eq!(complaint.to_string(), "most_sweeps: expected at least 1, found 0");
    let endless = SampledValue::clone(&unequal_polar().samples).unsettled(Some(f64::INFINITY));
    let again = ValueFunction::decode(&ValueFunction::Sampled(endless.into()).encode()).unwrap();
    assert_eq!(again.unsettled_m(), Some(f64::MAX));
}

#[test]
fn any_solve_can_be_stopped() {
    for options in [
        Options::default().with_method(Method::Polar),
        Options::default().with_method(Method::Cartesian).with_horizon(1.0),
        Options::default().with_horizon(1.0),
    ] {
        let mut calls = 0;
        let mut last = 0.0;
        let answer = solve(paper(), &options, &mut |progress| {
            calls += 1;
            assert!(progress.done >= last && progress.done <= 1.0);
            last = progress.done;
            if calls == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(answer.unwrap_err(), SolveError::Cancelled);
        assert_eq!(calls, 5);
    }
}

#[test]
fn bad_requests_are_refused_by_name() {
    let options = Options::default();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let cases = [
            (game([bad, 0.5], [1.5, 0.8], 3.0), "evader.speed_mps"),
            (game([2.0, bad], [1.5, 0.8], 3.0), "evader.turn_rate_radps"),
            (game([2.0, 0.5], [bad, 0.8], 3.0), "pursuer.speed_mps"),
            (game([2.0, 0.5], [1.5, bad], 3.0), "pursuer.turn_rate_radps"),
            (game([2.0, 0.5], [1.5, 0.8], bad), "radius_m"),
        ];
        for (game, field) in cases {
            let complaint = refused(game, &options);
            assert!(complaint.starts_with(field), "{complaint}");
        }
    }
    for horizon_s in [0.0, -2.0, f64::NAN] {
        assert!(refused(paper(), &options.with_horizon(horizon_s)).starts_with("horizon_s"));
    }
    let timed = options.with_method(Method::Exact).with_horizon(2.0);
    assert!(refused(paper(), &timed).starts_with("horizon_s"));
    let exact = options.with_method(Method::Exact);
    assert!(refused(unequal(), &exact).starts_with("method"));
    assert!(refused(paper(), &options.with_threads(0)).starts_with("threads"));
    let near = options.with_method(Method::Polar).with_range(2.0);
    assert!(refused(paper(), &near).starts_with("range_m"));
    let huge = CartesianGrid::new([100_000, 100_000, 100_000], [-1.0, 1.0, -1.0, 1.0])
        .with_scheme(Scheme::Eno2)
        .with_precision(Precision::F64);
    for method in [Method::Cartesian, Method::Exact] {
        let options = options.with_method(method).with_grid(huge);
        let complaint = refused(paper(), &options);
        assert!(complaint.contains("memory") || complaint.contains("65536"), "{complaint}");
    }
    let small = CartesianGrid::new([3, 51, 50], huge.domain_m).with_precision(Precision::F64);
    let options = options.with_grid(small).with_horizon(1.0);
    assert!(refused(paper(), &options).starts_with("axes[0].nodes"));
}

#[test]
fn bad_tables_are_refused_by_name() {
    let nodes = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 9, angle_nodes: 12 };
    let good = vec![0.0_f32; nodes.count()];
    let new = |nodes, horizon, deficit: &[f32]| {
        SampledValue::new(unequal(), nodes, horizon, deficit, None).map(|_| ())
    };
    assert!(new(nodes, 1.0, &good).is_ok());
    assert_eq!(new(nodes, 0.0, &good).unwrap_err().field, "horizon_s");
    assert_eq!(new(nodes, 1.0, &good[1..]).unwrap_err().field, "value");
    let mut bad = good.clone();
    bad[17] = f32::NAN;
    assert_eq!(new(nodes, 1.0, &bad).unwrap_err().field, "value[17]");
    let odd = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 9, angle_nodes: 13 };
    assert_eq!(new(odd, 1.0, &good).unwrap_err().field, "angle_nodes");
    let sheet = SampledValue::new(unequal(), nodes, 1.0, &good, Some(&good)).unwrap_err();
    assert_eq!(sheet.field, "sheet");
}
