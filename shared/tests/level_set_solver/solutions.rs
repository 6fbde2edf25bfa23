//! A solution as a function of state and time.

use super::*;
use sidestep::reachability::cartesian::Snapshot;
use sidestep::reachability::{DubinsCar, Inputs, Players, PursuitGame, RelativeDubins};
use sidestep::vehicle::VehicleModel;

/// A solution in which nothing moves, so that V is exactly the target at every node.
fn sampled<const D: usize>(
    axes: [Axis; D],
    function: &(dyn Fn([f64; D]) -> f64 + Sync),
) -> Solution<f64, D> {
    let game = Drift { drift: [0.0; D], speed: [0.0; D] };
    let still = problem(&game, axes, function, (Kind::Set, BACKWARD), 1e-9);
    solved(&still, &settings(Scheme::Upwind))
}

fn smooth([x, y, psi]: [f64; 3]) -> f64 {
    sin(x + 0.3 * y) + 0.4 * cos(1.3 * y - x) * (1.0 + 0.5 * sin(psi + 0.2)) + 0.2 * cos(2.0 * psi)
}

fn smooth_axes(half: usize) -> [Axis; 3] {
    [
        Axis::bounded(-2.0, 2.0, 2 * half + 1),
        Axis::bounded(-1.0, 2.0, 2 * half + 1),
        Axis::periodic(-1.0, TAU - 1.0, 4 * half),
    ]
}

/// Mean errors of the value and of the gradient, at random states outside the outermost cells.
fn interpolation_errors(half: usize) -> [f64; 2] {
    let solution = sampled(smooth_axes(half), &smooth);
    let mut rng = SeededRng::new(3);
    let mut errors = [0.0; 2];
    for _ in 0..4000 {
        let state = [rng.uniform(-1.7, 1.7), rng.uniform(-0.8, 1.8), rng.uniform(-9.0, 9.0)];
        let sample = solution.sample(state).unwrap();
        errors[0] += (sample.value - smooth(state)).abs() / 4000.0;
        for d in 0..3 {
            let at = |step: f64| {
                let mut beside = state;
                beside[d] += step;
                smooth(beside)
            };
            let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
            errors[1] += (sample.gradient[d] - slope).abs() / 12_000.0;
        }
    }
    errors
}

#[test]
fn between_nodes_it_has_its_order() {
    let [coarse, fine] = [12, 24].map(interpolation_errors);
    eprintln!(
        "value {:.2e} → {:.2e}, gradient {:.2e} → {:.2e}",
        coarse[0], fine[0], coarse[1], fine[1]
    );
    assert!(coarse[0] / fine[0] > 6.5 && coarse[1] / fine[1] > 3.3, "{coarse:?} {fine:?}");
    assert!(fine[0] < 1e-4, "{fine:?}");
}

#[test]
fn it_is_exact_at_nodes_and_its_gradient_is_its_own() {
    let solution = sampled(smooth_axes(5), &smooth);
    for (position, value) in solution.values.iter().enumerate() {
        let node = solution.grid.node(solution.grid.index(position));
        assert!((solution.value(node).unwrap() - value).abs() < 1e-14, "{node:?}");
    }
    let mut rng = SeededRng::new(8);
    let mut checked = 0;
    for _ in 0..2000 {
        let state = [rng.uniform(-1.99, 1.99), rng.uniform(-0.99, 1.99), rng.uniform(-9.0, 9.0)];
        let sample = solution.sample(state).unwrap();
        for d in 0..3 {
            let axis = solution.grid.axes[d];
            let place = (state[d] - axis.low) / axis.spacing();
            // Avoid differences across a face of a cell.
            if (place - place.round()).abs() < 1e-3 {
                continue;
            }
            let at = |step: f64| {
                let mut beside = state;
                beside[d] += step;
                solution.value(beside).unwrap()
            };
            let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
            assert!((sample.gradient[d] - slope).abs() < 1e-7, "{state:?} {d}");
            checked += 1;
        }
    }
    assert!(checked > 5500, "{checked}");
}

#[test]
fn at_a_kink_it_stays_between_the_nodes() {
    let ridge = |[x]: [f64; 1]| (x - 0.03).abs();
    let solution = sampled([Axis::bounded(-1.0, 1.0, 21)], &ridge);
    for i in 0..=1000 {
        let x = -1.0 + f64::from(i) / 500.0;
        let error = solution.value([x]).unwrap() - ridge([x]);
        // The bound is a quarter of the spacing (0.1) times the jump of the slope (2).
        assert!((-1e-12..=0.05).contains(&error), "{x}: {error}");
    }
}

/// Between two walls, V stays between the values at the nodes, for any height and position of the
/// walls.
#[test]
fn between_two_walls_it_stays_between_the_nodes() {
    for (height, free) in [(3.0, 1.5), (100.0, 1.5), (1e5, -0.4), (1e9, 1e-3)] {
        for (thick, wide) in [(1, 2), (2, 2), (3, 2), (2, 3), (4, 4)] {
            let walled = |[x]: [f64; 1]| {
                let node = (10.0 * (x + 1.0)).round() as usize;
                if node % (thick + wide) < thick { height } else { free }
            };
            let solution = sampled([Axis::bounded(-1.0, 1.0, 21)], &walled);
            for i in 0..=1000 {
                let value = solution.value([-1.0 + f64::from(i) / 500.0]).unwrap();
                let slack = 1e-12 * height;
                let is_between = free - slack <= value && value <= height + slack;
                assert!(is_between, "{height} {thick} {wide}: {value}");
            }
        }
    }
}

fn drifting() -> (Drift<1>, [Axis; 1]) {
    (Drift { drift: [1.5], speed: [0.4] }, [Axis::periodic(0.0, TAU, 100)])
}

/// The values at a stored instant equal the values of a shorter march, bit for bit. Between two
/// instants, they are linear in time.
#[test]
fn slices_are_shorter_marches() {
    let (game, axes) = drifting();
    let target = |x: [f64; 1], tau: f64| bumpy(x, tau);
    let march = |seconds: f64, slices: usize| {
        let base = |_: [f64; 1]| 0.0;
        let mut problem = problem(&game, axes, &base, (Kind::Tube, BACKWARD), seconds);
        problem.target = Region::OfMarchTime(&target);
        solved::<f64, 1, _>(&problem, &settings(Scheme::Weno5).with_slices(slices))
    };
    let whole = march(1.0, 4);
    assert_eq!(whole.march_times_s(), [0.0, 0.25, 0.5, 0.75, 1.0]);
    assert_eq!(whole.steps % 4, 0);
    let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect::<Vec<_>>();
    for part in 1..=4_u32 {
        let tau = 0.25 * f64::from(part);
        // Each quarter has the same number of steps.
        let shorter = bits(march(tau, part as usize).values);
        assert_eq!(bits(whole.at_march_time(tau).unwrap().values()), shorter, "τ = {tau}");
        assert_eq!(bits(whole.at_time(1.0 - tau).unwrap().values()), shorter, "t = 1 − {tau}");
    }
    let beginning = whole.at_time(1.0).unwrap();
    assert!(
        (beginning.value([0.4]).unwrap() - whole.at_march_time(0.0).unwrap().value([0.4]).unwrap())
            .abs()
            == 0.0
    );
    let value = |tau: f64| whole.at_march_time(tau).unwrap().value([2.0]).unwrap();
    let expected = 0.75 * value(0.25) + 0.25 * value(0.5);
    assert!((value(0.3125) - expected).abs() < 1e-14);
    let slope = |tau: f64| whole.at_march_time(tau).unwrap().sample([2.0]).unwrap().gradient[0];
    assert!((slope(0.3125) - (0.75 * slope(0.25) + 0.25 * slope(0.5))).abs() < 1e-12);
}

/// The clock time of a region runs forward in both directions of the march.
#[test]
fn regions_go_by_either_time() {
    let (game, axes) = drifting();
    for direction in [BACKWARD, FORWARD] {
        let by_march = |x: [f64; 1], tau: f64| bumpy(x, tau);
        let by_clock = |x: [f64; 1], t: f64| match direction {
            Direction::Backward => bumpy(x, 1.0 - t),
            Direction::Forward => bumpy(x, t),
        };
        let base = |_: [f64; 1]| 0.0;
        let with = |target| {
            let mut problem = problem(&game, axes, &base, (Kind::Tube, direction), 1.0);
            problem.target = target;
            solved::<f64, 1, _>(&problem, &settings(Scheme::Eno2)).values
        };
        let pairs = with(Region::OfMarchTime(&by_march));
        // 1 − (1 − τ) is not exactly τ.
        for (a, b) in pairs.iter().zip(with(Region::OfTime(&by_clock))) {
            assert!((a - b).abs() < 1e-13, "{direction:?} {a} {b}");
        }
    }
}

/// At the optimal inputs, p · f is the Hamiltonian, and neither player gains by another input.
fn check_players<const D: usize, const M: usize, const K: usize, G>(
    game: &G,
    ranges: (&[[f64; 2]; M], &[[f64; 2]; K]),
) where
    G: Players<D, Minimiser = [f64; M], Maximiser = [f64; K]>,
{
    let mut rng = SeededRng::new(5);
    for _ in 0..500 {
        let state: [f64; D] = core::array::from_fn(|_| rng.uniform(-2.0, 2.0));
        let gradient: [f64; D] = core::array::from_fn(|_| rng.uniform(-1.0, 1.0));
        let terms: [[f64; TERMS]; D] = core::array::from_fn(|d| game.terms(d, state[d]));
        let rate = |inputs: &Inputs<[f64; M], [f64; K]>| {
            let velocity = game.velocity(state, inputs);
            velocity.iter().zip(gradient).map(|(v, p)| v * p).sum::<f64>()
        };
        let best = game.optimal_inputs(state, gradient);
        let most = game.hamiltonian(&terms, gradient);
        assert!((rate(&best) - most).abs() < 1e-12, "{state:?} {gradient:?}");
        let minimiser = ranges.0.map(|[low, high]| rng.uniform(low, high));
        let maximiser = ranges.1.map(|[low, high]| rng.uniform(low, high));
        assert!(rate(&Inputs { minimiser, ..best }) >= most - 1e-12);
        assert!(rate(&Inputs { maximiser, ..best }) <= most + 1e-12);
    }
}

#[test]
fn the_games_know_their_optimal_inputs() {
    check_players(&DoubleIntegrator { acceleration_mps2: 1.5 }, (&[[-1.5, 1.5]], &[]));
    let car = DubinsCar { speed_mps: 2.0, turn_rate_radps: (-0.3, 0.7) };
    check_players(&car, (&[[-0.3, 0.7]], &[]));
    let model = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
    let game = PursuitGame { evader: model(2.0, 0.5), pursuer: model(1.5, 0.8), radius_m: 3.0 };
    check_players(&RelativeDubins(game), (&[[-0.8, 0.8]], &[[-0.5, 0.5]]));
}

/// A mass that applies the solution's inputs over time ends as close to the target as V predicts.
#[test]
fn its_inputs_steer_to_the_target() {
    let game = DoubleIntegrator { acceleration_mps2: 1.0 };
    let target = |[x, v]: [f64; 2]| hypot(x, v) - 0.5;
    let axes = [Axis::bounded(-4.0, 4.0, 161), Axis::bounded(-3.0, 3.0, 121)];
    let problem = problem(&game, axes, &target, (Kind::Set, BACKWARD), 1.2);
    let solution = solved::<f64, 2, _>(&problem, &settings(Scheme::Weno5).with_slices(24));
    let mut rng = SeededRng::new(21);
    let mut worst = 0.0_f64;
    for _ in 0..200 {
        let mut state = [rng.uniform(-1.5, 1.5), rng.uniform(-1.2, 1.2)];
        let promised = solution.value(state).unwrap();
        const STEPS: usize = 240;
        for step in 0..STEPS {
            let now: Snapshot<'_, f64, 2> =
                solution.at_time(1.2 * step as f64 / STEPS as f64).unwrap();
            let inputs = now.inputs(&game, state).unwrap();
            let velocity = game.velocity(state, &inputs);
            let seconds = 1.2 / STEPS as f64;
            // Move by the mean speed of the step.
            let [speed, rate] = velocity;
            state =
                [state[0] + seconds * (speed + 0.5 * seconds * rate), state[1] + seconds * rate];
        }
        worst = worst.max(target(state) - promised);
    }
    eprintln!("arrives {worst:.4} farther than promised at most");
    assert!(worst < 0.02, "{worst}");
}

#[test]
fn what_it_does_not_know_is_refused() {
    let (game, axes) = drifting();
    let target = |x| bumpy(x, 0.0);
    let problem1 = problem(&game, axes, &target, (Kind::Set, BACKWARD), 1.0);
    let solution = solved::<f64, 1, _>(&problem1, &settings(Scheme::Eno2));
    let refused = |invalid: Invalid| invalid.to_string();
    assert_eq!(
        refused(solution.value([f64::NAN]).unwrap_err()),
        "state[0]: expected a finite number, found NaN"
    );
    assert_eq!(
        refused(solution.at_time(0.5).unwrap_err()),
        "t_s: expected the end of the march, since no other instant was stored (Settings::slices), \
         found 0.5 s"
    );
    for time in [-0.1, 1.1, f64::NAN, f64::INFINITY] {
        let found = refused(solution.at_time(time).unwrap_err());
        assert!(found.starts_with("t_s: expected a time from 0 to the horizon, 1 s"), "{found}");
        assert_eq!(solution.at_march_time(time).unwrap_err().field, "tau_s");
    }
    let plane = sampled([Axis::bounded(-1.0, 1.0, 11); 2], &|[x, y]| x + y);
    assert_eq!(
        refused(plane.value([0.0, 1.01]).unwrap_err()),
        "state[1]: expected a number from -1 to 1, the ends of the grid, found 1.01"
    );
    assert!((plane.value([1.0, -1.0]).unwrap()).abs() < 1e-15);

    let converged = |region, slices| {
        let mut problem = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 1.0);
        problem.horizon = Horizon::Converged { tolerance: 1e-3, longest_s: 1.0 };
        problem.target = region;
        let settings = settings(Scheme::Eno2).with_slices(slices);
        let found = solve::<f64, 1, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()));
        let SolveError::Invalid(invalid) = found.unwrap_err() else { panic!("not cancelled") };
        invalid.field
    };
    assert_eq!(converged(Region::Static(&target), 3), "slices");
    assert_eq!(converged(Region::OfTime(&|x, t| bumpy(x, t)), 0), "target");
}
