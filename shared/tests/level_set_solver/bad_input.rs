//! Input that must be rejected, and the ways in which a solve ends.

use super::*;

/// The error for a small problem that `spoil` has made invalid.
pub(crate) fn refused(spoil: impl FnOnce(&mut Problem<'_, 2, Drift<2>>, &mut Settings)) -> Invalid {
    let game = Drift { drift: [0.5, 0.0], speed: [1.0; 2] };
    let target = |[x, y]: [f64; 2]| hypot(x, y) - 0.5;
    let axes = [Axis::bounded(-2.0, 2.0, 15), Axis::periodic(0.0, 4.0, 12)];
    let mut problem = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 0.5);
    let mut settings = settings(Scheme::Weno5);
    spoil(&mut problem, &mut settings);
    let mut steps = 0;
    let result = solve::<f32, 2, _>(&problem, &settings, &mut |_| {
        steps += 1;
        ControlFlow::Continue(())
    });
    assert!(steps <= 50, "refused only after {steps} steps");
    match result {
        Err(SolveError::Invalid(complaint)) => {
            eprintln!("{complaint}");
            complaint
        }
        other => panic!("not refused: {:?}", other.map(|solution| solution.steps)),
    }
}

fn avoid<'a>(problem: &mut Problem<'a, 2, Drift<2>>, region: Region<'a, 2>) {
    let Problem { game, grid, target, horizon, .. } = *problem;
    *problem = Problem::new(game, grid, target, horizon).with_avoid(region);
}

#[test]
fn a_horizon_that_is_no_time_is_refused() {
    for seconds in [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY] {
        let complaint = refused(|problem, _| problem.horizon = Horizon::Finite(seconds));
        assert_eq!(complaint.field, "horizon_s");
        let complaint = refused(|problem, _| {
            problem.horizon = Horizon::Converged { tolerance: 1e-3, longest_s: seconds };
        });
        assert_eq!(complaint.field, "horizon_s");
    }
}

#[test]
fn a_grid_that_makes_no_sense_is_refused() {
    for (low, high, field) in [
        (2.0, -2.0, "axes[1].high"),
        (1.0, 1.0, "axes[1].high"),
        (f64::NAN, 1.0, "axes[1].low"),
        (0.0, f64::NAN, "axes[1].high"),
        (f64::NEG_INFINITY, 0.0, "axes[1].low"),
        (-1e308, 1e308, "axes[1].high - axes[1].low"),
    ] {
        let complaint = refused(|problem, _| {
            problem.grid.axes[1].low = low;
            problem.grid.axes[1].high = high;
        });
        assert_eq!(complaint.field, field);
    }
}

#[test]
fn an_axis_with_too_few_nodes_is_refused() {
    for (scheme, least) in SCHEMES.into_iter().zip([3, 3, 4, 4]) {
        for nodes in 0..least {
            let complaint = refused(|problem, settings| {
                settings.scheme = scheme;
                problem.grid.axes[0].nodes = nodes;
            });
            assert_eq!(complaint.field, "axes[0].nodes");
            assert_eq!(complaint.expected, format!("at least {least} nodes for this scheme"));
            assert_eq!(complaint.found, nodes.to_string());
        }
        for boundary in [Boundary::Periodic, Boundary::Extrapolate] {
            let game = Drift { drift: [0.5], speed: [1.0] };
            let target = |[x]: [f64; 1]| x - 0.1;
            let axis = Axis { low: -1.0, high: 1.0, nodes: least, boundary };
            let problem = problem(&game, [axis], &target, (Kind::Tube, BACKWARD), 0.5);
            let solution = solved::<f64, 1, _>(&problem, &settings(scheme));
            assert!(solution.values.iter().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn a_grid_beyond_the_memory_is_refused_at_once() {
    // Use the fastest of three runs, because a busy machine can delay a test.
    let waited = [(); 3].map(|()| {
        let start = std::time::Instant::now();
        refuse_grids_beyond_the_memory();
        start.elapsed()
    });
    assert!(waited.iter().any(|waited| waited.as_secs_f64() < 0.5), "{waited:?}");
}

fn refuse_grids_beyond_the_memory() {
    let complaint = refused(|problem, settings| {
        for axis in &mut problem.grid.axes {
            axis.nodes = 10_000;
        }
        settings.memory_limit_bytes = 1 << 30;
    });
    // The grid has 10,006² nodes, including ghost nodes. Each node needs four bytes for each of the
    // three stages and four for the target.
    let expected = "grid: expected at most 1024 MiB of memory, found 100120036 nodes, which need \
                    about 1528 MiB";
    assert_eq!(complaint.to_string(), expected);
    for nodes in [1_000_000, usize::MAX - 3, usize::MAX] {
        let complaint = refused(|problem, _| {
            for axis in &mut problem.grid.axes {
                axis.nodes = nodes;
            }
        });
        assert_eq!(complaint.field, "grid");
    }
    let target = |_: [f64; 4]| 1.0;
    let axes = [Axis::bounded(0.0, 1.0, 1_000_000); 4];
    let problem = problem(&Twisted, axes, &target, (Kind::Tube, BACKWARD), 1.0);
    for limit in [0, Settings::new(Scheme::Upwind).memory_limit_bytes, u64::MAX - 1] {
        let settings = settings(Scheme::Upwind).with_memory_limit(limit);
        let result = solve::<f64, 4, _>(&problem, &settings, &mut |_| ControlFlow::Break(()));
        let Err(SolveError::Invalid(complaint)) = result else { panic!("not refused") };
        eprintln!("{complaint}");
        assert!(complaint.found.contains("more than"), "{complaint}");
    }
}

#[test]
fn a_share_of_the_step_outside_0_to_1_is_refused() {
    for cfl in [0.0, -0.5, 1.0001, f64::NAN, f64::INFINITY] {
        assert_eq!(refused(|_, settings| settings.cfl = cfl).field, "cfl");
    }
}

#[test]
fn regions_without_a_value_are_refused() {
    fn hole([x, y]: [f64; 2]) -> f64 {
        if x > 1.0 && y > 2.0 { f64::NAN } else { x }
    }
    fn huge([x, _]: [f64; 2]) -> f64 {
        if x > 1.8 { 1e300 } else { x }
    }
    fn later([x, _]: [f64; 2], time: f64) -> f64 {
        if time > 0.3 { f64::NAN } else { x }
    }
    // In memory order, the first node at which `hole` is NaN has x = −2 + 11·4/14 and y = 7/3.
    let place = "[1.1428571428571428, 2.333333333333333]";
    let complaint = refused(|problem, _| problem.target = Region::Static(&hole));
    assert_eq!([&complaint.field, &complaint.found], ["target", &format!("NaN at {place}")]);
    let complaint = refused(|problem, _| avoid(problem, Region::Static(&hole)));
    assert_eq!([&complaint.field, &complaint.found], ["avoid", &format!("NaN at {place}")]);
    // The value of `huge` overflows f32.
    let complaint = refused(|problem, _| problem.target = Region::Static(&huge));
    assert_eq!([&complaint.field, &complaint.found[..3]], ["target", "inf"]);
    let complaint = refused(|problem, _| problem.target = Region::OfMarchTime(&later));
    assert_eq!(complaint.field, "target");
    let complaint = refused(|problem, _| avoid(problem, Region::OfMarchTime(&later)));
    assert_eq!(complaint.field, "avoid");
}

#[test]
fn a_game_without_a_value_is_refused() {
    let axes = [Axis::bounded(-1.0, 1.0, 20)];
    let target = |[x]: [f64; 1]| x;
    for (game, field) in [
        (Broken { bound: f64::NAN, rate: 0.0 }, "game"),
        (Broken { bound: f64::INFINITY, rate: 0.0 }, "game"),
        (Broken { bound: 1.0, rate: f64::NAN }, "value"),
        (Broken { bound: 1.0, rate: f64::NEG_INFINITY }, "value"),
        (Broken { bound: 1.0, rate: f64::INFINITY }, "value"),
        (Broken { bound: 1.0, rate: 1e3 }, "value"),
    ] {
        for kind in [Kind::Tube, Kind::Set] {
            // An excessive speed violates the bounds of V, which exist only for a tube.
            if kind == Kind::Set && game.rate == 1e3 {
                continue;
            }
            let problem = problem(&game, axes, &target, (kind, BACKWARD), 0.2);
            let result = solve::<f64, 1, _>(&problem, &settings(Scheme::Eno2), &mut |_| {
                ControlFlow::Continue(())
            });
            let Err(SolveError::Invalid(complaint)) = result else { panic!("{game:?} solved") };
            assert_eq!(complaint.field, field, "{complaint}");
        }
    }
}

/// V = max(l, −g), so V > 0 wherever g < 0. If an obstacle covers the target, the set is therefore
/// empty.
#[test]
fn an_obstacle_that_covers_the_target_is_refused() {
    let depth = |[x, y]: [f64; 2]| hypot(x, y) - 0.7;
    let positive_inside = |[x, y]: [f64; 2]| 0.3 - hypot(x - 1.2, y);
    let shared = |[x, _]: [f64; 2]| x;
    let game = Drift { drift: [0.5, 0.0], speed: [1.0; 2] };
    let target = |[x, y]: [f64; 2]| hypot(x, y) - 0.5;
    let grid = Grid { axes: [Axis::bounded(-2.0, 2.0, 21); 2] };
    let solve = |problem: Problem<'_, 2, Drift<2>>| {
        solve::<f32, 2, _>(&problem, &settings(Scheme::Eno2), &mut |_| ControlFlow::Continue(()))
    };
    let new = || Problem::new(&game, grid, Region::Static(&target), Horizon::Finite(0.1));
    let refused = |problem| match solve(problem) {
        Err(SolveError::Invalid(complaint)) => complaint.to_string(),
        other => panic!("not refused: {:?}", other.map(|solution| solution.steps)),
    };
    let say = |name: &str, inside: &str, what: &str| {
        format!(
            "{name}: expected a function that is {inside} in the obstacle (the target's is negative \
             inside), and an obstacle that leaves some of the target free, found one that covers all \
             of the {what}"
        )
    };
    let of = |region| refused(new().with_avoid(Region::Static(region)));
    assert_eq!(of(&depth), say("avoid", "negative", "target"));
    assert_eq!(of(&|_| -1.0), say("avoid", "negative", "grid"));
    // This function has the old sign convention, but `with_avoid` expects the new one.
    assert_eq!(of(&positive_inside), say("avoid", "negative", "target"));
    #[allow(deprecated, reason = "it still means what it meant")]
    let old = |region| new().with_obstacle(Region::Static(region));
    assert_eq!(refused(old(&|_| 1.0)), say("obstacle", "positive", "grid"));
    // The obstacle `shared` leaves half of the target free. A target outside the grid is not an
    // error.
    assert!(solve(new().with_avoid(Region::Static(&shared))).is_ok());
    let far = |_: [f64; 2]| 1.0;
    let nowhere = Problem::new(&game, grid, Region::Static(&far), Horizon::Finite(0.1));
    assert!(solve(nowhere.with_avoid(Region::Static(&depth))).is_ok());
    let twice = [new().with_avoid(Region::Static(&shared)), old(&|[x, _]| -x)];
    let [new, old] = twice.map(|problem| solve(problem).unwrap().values);
    assert_eq!(new, old);
}

#[test]
fn a_solve_stops_when_told_to() {
    let game = Drift { drift: [0.0], speed: [1.0] };
    let target = |[x]: [f64; 1]| x.abs() - 0.5;
    let axes = [Axis::bounded(-4.0, 4.0, 201)];
    let problem = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 1.5);
    let mut reports = Vec::new();
    let solution = solve::<f32, 1, _>(&problem, &settings(Scheme::Weno5), &mut |progress| {
        reports.push(progress.done);
        ControlFlow::Continue(())
    });
    let steps = solution.expect("a solution").steps;
    assert_eq!((reports.len(), reports.last()), (steps, Some(&1.0)));
    assert!(steps > 20 && reports.windows(2).all(|pair| pair[0] < pair[1]));
    let mut calls = 0;
    let stopped = solve::<f32, 1, _>(&problem, &settings(Scheme::Weno5), &mut |_| {
        calls += 1;
        if calls == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!((stopped.map(|s| s.steps), calls), (Err(SolveError::Cancelled), 3));
}

/// With |u| ≤ 1, every state in [−2, 2] reaches the target's centre within 2 s. After that, nothing
/// changes.
#[test]
fn a_march_ends_when_nothing_changes() {
    let game = Drift { drift: [0.0], speed: [1.0] };
    let target = |[x]: [f64; 1]| x.abs() - 0.5;
    let axes = [Axis::bounded(-2.0, 2.0, 101)];
    let mut problem = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 1.0);
    let of = |longest_s| Horizon::Converged { tolerance: 1e-3, longest_s };
    problem.horizon = of(20.0);
    let solution = solved::<f64, 1, _>(&problem, &settings(Scheme::Weno5));
    eprintln!("converged after {} s, residual {:.1e}", solution.horizon_s, solution.residual);
    assert!((2.0..4.0).contains(&solution.horizon_s) && solution.residual <= 1e-3);
    assert!(solution.values.iter().all(|v| (v + 0.5).abs() <= 0.02));
    problem.horizon = of(0.5);
    let solution = solved::<f64, 1, _>(&problem, &settings(Scheme::Weno5));
    assert!((solution.horizon_s - 0.5).abs() < 1e-12 && solution.residual > 0.5);
}
