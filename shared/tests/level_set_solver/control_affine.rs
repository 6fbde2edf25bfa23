//! Games that are defined by f and G, compared with the same games written by hand.

use super::*;
use sidestep::reachability::{ControlAffine, DubinsCar, Players, PursuitGame, RelativeDubins};
use sidestep::vehicle::VehicleModel;

/// Solves both games on the same grid. The solutions must be equal up to rounding errors.
fn compare<const D: usize>(
    axes: [Axis; D],
    by_hand: &impl Game<D>,
    affine: &impl Game<D>,
    seconds: f64,
) {
    let target = |x| bumpy(x, 0.0);
    for direction in [BACKWARD, FORWARD] {
        for scheme in [Scheme::Upwind, Scheme::Weno5] {
            let settings = settings(scheme);
            let way = (Kind::Tube, direction);
            let hand = problem(by_hand, axes, &target, way, seconds);
            let affine = problem(affine, axes, &target, way, seconds);
            let expected = solved::<f64, D, _>(&hand, &settings);
            let found = solved::<f64, D, _>(&affine, &settings);
            assert_eq!(found.steps, expected.steps);
            let worst = gap(&expected, &found);
            // The size of single-precision errors depends on the march, so it is measured with the
            // hand-written game.
            let hand_single = gap(&expected, &solved::<f32, D, _>(&hand, &settings));
            let single = gap(&expected, &solved::<f32, D, _>(&affine, &settings));
            let name = scheme.name();
            eprintln!(
                "{D}-D {direction:?} {name}: {worst:.1e}, f32 {single:.2e}, by hand {hand_single:.2e}"
            );
            assert!(worst < 1e-12, "{worst}");
            // The two games round differently, but their errors have the same size.
            assert!(single < 2.0 * hand_single, "{single} {hand_single}");
        }
    }
}

/// The maximum difference over all nodes.
fn gap<T: Real, const D: usize>(expected: &Solution<f64, D>, found: &Solution<T, D>) -> f64 {
    let pairs = expected.values.iter().zip(&found.values);
    pairs.fold(0.0, |worst, (a, b)| worst.max((a - b.to_f64()).abs()))
}

#[test]
fn a_double_integrator() {
    let axes = [Axis::bounded(-3.0, 3.0, 41), Axis::bounded(-2.0, 2.0, 31)];
    let affine = ControlAffine::new(Grid { axes }, |[_, v]| [v, 0.0])
        .unwrap()
        .minimiser(|_| [[0.0], [1.0]], [[-1.3, 1.3]])
        .unwrap();
    compare(axes, &DoubleIntegrator { acceleration_mps2: 1.3 }, &affine, 0.8);
}

/// The input range is not symmetric, one axis is periodic, and there is no maximising player.
#[test]
fn a_dubins_car() {
    let axes =
        [Axis::bounded(-3.0, 3.0, 25), Axis::bounded(-2.5, 2.0, 21), Axis::periodic(-PI, PI, 24)];
    let affine =
        ControlAffine::new(Grid { axes }, |[_, _, psi]| [1.5 * cos(psi), 1.5 * sin(psi), 0.0])
            .unwrap()
            .minimiser(|_| [[0.0], [0.0], [1.0]], [[-0.4, 0.9]])
            .unwrap();
    compare(axes, &DubinsCar { speed_mps: 1.5, turn_rate_radps: (-0.4, 0.9) }, &affine, 0.5);
}

fn pursuit() -> PursuitGame {
    let model = |speed_mps, turn_rate_radps| VehicleModel { speed_mps, turn_rate_radps };
    PursuitGame { evader: model(2.0, 0.5), pursuer: model(1.5, 0.8), radius_m: 1.0 }
}

fn affine_pursuit(axes: [Axis; 3]) -> ControlAffine<3, 1, 1> {
    ControlAffine::new(Grid { axes }, |[_, _, psi]| [1.5 * cos(psi) - 2.0, 1.5 * sin(psi), 0.0])
        .unwrap()
        .maximiser(|[x, y, _]| [[y], [-x], [-1.0]], [[-0.5, 0.5]])
        .unwrap()
        .minimiser(|_| [[0.0], [0.0], [1.0]], [[-0.8, 0.8]])
        .unwrap()
}

/// There are two players, and a matrix that depends on the state.
#[test]
fn a_pursuit() {
    let axes =
        [Axis::bounded(-3.0, 5.0, 25), Axis::bounded(-3.0, 3.0, 21), Axis::periodic(0.0, TAU, 24)];
    let affine = affine_pursuit(axes);
    compare(axes, &RelativeDubins(pursuit()), &affine, 0.4);
    let mut rng = SeededRng::new(4);
    for _ in 0..300 {
        let node = affine.grid().node([rng.below(25), rng.below(21), rng.below(24)]);
        let gradient = [0; 3].map(|_| rng.uniform(-1.0, 1.0));
        let by_hand = RelativeDubins(pursuit());
        let inputs = affine.optimal_inputs(node, gradient);
        assert_eq!(inputs, by_hand.optimal_inputs(node, gradient), "{node:?} {gradient:?}");
        let [a, b] = [&affine.velocity(node, &inputs), &by_hand.velocity(node, &inputs)];
        assert!((0..3).all(|d| (a[d] - b[d]).abs() < 1e-12), "{node:?}: {a:?} {b:?}");
    }
}

#[test]
fn arrays_are_functions_at_the_nodes() {
    let axes =
        [Axis::bounded(-3.0, 5.0, 9), Axis::bounded(-3.0, 3.0, 7), Axis::periodic(0.0, TAU, 8)];
    let grid = Grid { axes };
    let nodes = || (0..grid.len()).map(|position| grid.node(grid.index(position)));
    let drift: Vec<f64> =
        nodes().flat_map(|[_, _, psi]| [1.5 * cos(psi) - 2.0, 1.5 * sin(psi), 0.0]).collect();
    let evader: Vec<f64> = nodes().flat_map(|[x, y, _]| [y, -x, -1.0]).collect();
    let pursuer: Vec<f64> = nodes().flat_map(|_| [0.0, 0.0, 1.0]).collect();
    let of_arrays = ControlAffine::from_array(grid, &drift)
        .unwrap()
        .maximiser_from_array(&evader, [[-0.5, 0.5]])
        .unwrap()
        .minimiser_from_array(&pursuer, [[-0.8, 0.8]])
        .unwrap();
    assert_eq!(of_arrays, affine_pursuit(axes));
}

#[test]
fn bad_games_are_refused() {
    let axes = [Axis::bounded(-1.0, 1.0, 5); 2];
    let grid = Grid { axes };
    let still = || ControlAffine::new(grid, |_| [0.0; 2]).unwrap();
    let refused = |invalid: Invalid| invalid.to_string();
    assert_eq!(
        refused(ControlAffine::new(grid, |[x, y]| [1.0 / (x + 0.5), y]).unwrap_err()),
        "drift: expected finite rates at every node, found [inf, -1.0] at [-0.5, -1.0]"
    );
    assert_eq!(ControlAffine::from_array(grid, &[0.0; 49]).unwrap_err().field, "drift");
    assert_eq!(ControlAffine::from_array(grid, &[f64::NAN; 50]).unwrap_err().field, "drift[0]");
    assert_eq!(
        refused(still().minimiser(|_| [[1.0], [0.0]], [[0.5, -0.5]]).unwrap_err()),
        "minimiser.range[0][1]: expected 0.5 or more, the lower end, found -0.5"
    );
    let endless = still().maximiser(|_| [[1.0], [0.0]], [[0.0, f64::INFINITY]]).unwrap_err();
    assert_eq!(endless.field, "maximiser.range[0][1]");
    let broken = still().maximiser(|[x, _]| [[1.0 / x], [0.0]], [[0.0, 1.0]]).unwrap_err();
    assert!(refused(broken).starts_with("maximiser: expected finite rates at every node"));
    assert_eq!(
        still().minimiser_from_array(&[0.0; 51], [[0.0, 1.0]]).unwrap_err().field,
        "minimiser"
    );
    let one = Grid { axes: [Axis::bounded(0.0, 1.0, 1)] };
    assert_eq!(ControlAffine::new(one, |_| [0.0]).unwrap_err().field, "grid.axes[0].nodes");

    // The nodes of these grids differ from the nodes of the game's grid, or lie outside it.
    for other in [Axis::bounded(-1.0, 1.0, 6), Axis::bounded(-1.5, 1.5, 7)] {
        let (game, target) = (still(), |[x, _]: [f64; 2]| x);
        let problem = problem(&game, [other, axes[1]], &target, (Kind::Set, BACKWARD), 1.0);
        let settings = settings(Scheme::Upwind);
        let found = solve::<f64, 2, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()));
        let SolveError::Invalid(invalid) = found.unwrap_err() else { panic!("not cancelled") };
        assert!(invalid.to_string().starts_with("game: expected finite speed bounds"), "{invalid}");
    }
}
