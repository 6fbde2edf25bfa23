//! Behaviour at the ends of the grid.

use super::*;

/// Moore's mountain car: ẋ = v, v̇ = 0.0015 u − 0.0025 cos 3x, |u| ≤ 1. The car is in a valley, and
/// is too weak to drive straight out of it. Its goal is x ≥ 0.45, including everything beyond the
/// grid on that side.
struct Valley;

const PUSH: f64 = 0.0015;

fn slope(x: f64) -> f64 {
    -0.0025 * cos(3.0 * x)
}

impl Game<2> for Valley {
    fn terms(&self, axis: usize, x: f64) -> [f64; TERMS] {
        [if axis == 0 { slope(x) } else { x }, 0.0, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 2], p: [T; 2]) -> T {
        p[0] * terms[1][0] + p[1] * terms[0][0] - T::from_f64(PUSH) * p[1].abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 2]) -> [T; 2] {
        [terms[1][0].abs(), terms[0][0].abs() + T::from_f64(PUSH)]
    }
}

/// An upper bound on the minimum time: the time of a car that always pushes in its direction of
/// motion, except that it brakes on the far hill, where it would roll off the grid.
fn swinging([mut x, mut v]: [f64; 2]) -> f64 {
    let (step, mut elapsed) = (0.01, 0.0);
    while x < 0.45 && elapsed < 500.0 {
        v += step * (slope(x) + if v < 0.0 && x > -0.9 { -PUSH } else { PUSH });
        x += step * v;
        elapsed += step;
        assert!(x > -1.6 && v.abs() < 0.09, "it leaves the grid");
    }
    elapsed
}

#[test]
fn a_car_gets_out_of_a_valley() {
    let target = |[x, _]: [f64; 2]| 0.45 - x;
    let start = [-0.5, 0.0];
    let needed = swinging(start);
    assert!(needed < 150.0, "{needed}");
    for boundary in [Boundary::Extrapolate, Boundary::Constant] {
        let axes = [Axis::bounded(-1.6, 0.7, 70), Axis::bounded(-0.09, 0.09, 55)]
            .map(|axis| axis.with_boundary(boundary));
        for scheme in SCHEMES {
            let problem = problem(&Valley, axes, &target, (Kind::Tube, BACKWARD), 200.0);
            let solution: Solution<f32, 2> =
                solved(&problem, &Settings::new(scheme).with_threads(2).with_slices(40));
            let all = solution.earlier.iter().chain([&solution.values]).flatten();
            let least = all.copied().fold(f32::MAX, f32::min);
            // This is the minimum of the target, 0.45 − 0.7.
            assert!((least + 0.25).abs() < 1e-6, "{scheme:?} {boundary:?}: {least}");
            // Even at full power downhill, 0.004 m/s², the car does not move 0.95 m within 20 s.
            let early = solution.at_march_time(20.0).unwrap().value(start).unwrap();
            let late = solution.value(start).unwrap();
            let found = solution.time_to_reach(start).unwrap();
            eprintln!("{} {boundary:?}: {early:.3}, {late:.3}, {found:.1} s", scheme.name());
            // The upwind scheme smears the thin spirals that form in a hundred seconds.
            assert!(
                early > 0.0 && (late <= 0.0 && found < 1.2 * needed || scheme == Scheme::Upwind)
            );
        }
    }
}

/// For ẋ = −1, V(x, T) = l(x − T). Beyond the lower end, l = x is extrapolated or constant.
#[test]
fn values_continue_beyond_the_ends_as_the_axis_says() {
    let game = Drift { drift: [-1.0], speed: [0.0] };
    let target = |[x]: [f64; 1]| x;
    let axis = Axis::bounded(-1.0, 2.0, 61);
    for scheme in SCHEMES {
        for (boundary, kind, lowest) in [
            (Boundary::Extrapolate, Kind::Set, -1.6),
            (Boundary::Constant, Kind::Set, -1.0),
            // A tube has no value below the minimum of its target.
            (Boundary::Extrapolate, Kind::Tube, -1.0),
            (Boundary::Constant, Kind::Tube, -1.0),
        ] {
            let axes = [axis.with_boundary(boundary)];
            let problem = problem(&game, axes, &target, (kind, BACKWARD), 0.6);
            let solution: Solution<f64, 1> = solved(&problem, &settings(scheme));
            let exact = |[x]: [f64; 1]| (x - 0.6).max(lowest);
            let name = format!("{} {boundary:?} {kind:?}", scheme.name());
            let all = errors(&name, &solution, |_| true, exact);
            // A kink is smeared over one or two cells of 0.05.
            let most = if lowest == -1.6 { 1e-12 } else { 0.06 };
            assert!(all.max <= most, "{all:?}");
        }
    }
}

#[test]
fn it_says_which_values_depend_on_what_is_outside() {
    // At full speed, 1.5 m/s, trajectories from x = ±2.5 just reach the ends at ±4.
    let game = Drift { drift: [0.5, 0.0], speed: [1.0, 0.0] };
    let target = |[x, _]: [f64; 2]| x.abs() - 0.5;
    let axes = [Axis::bounded(-4.0, 4.0, 81), Axis::bounded(0.0, 1.0, 5)];
    let still = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 1.0);
    let solution: Solution<f32, 2> = solved(&still, &settings(Scheme::Eno2));
    let times = [[-3.25, 0.5], [0.0, 0.0], [4.0, 1.0], [2.5, 0.1]];
    let found = times.map(|state| solution.earliest_exit_s(state).unwrap().unwrap());
    for (found, expected) in found.into_iter().zip([0.5, 8.0 / 3.0, 0.0, 1.0]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    let marked = solution.depends_on_outside(1.0).unwrap().unwrap();
    for (at, marked) in marked.into_iter().enumerate() {
        let [x, _] = solution.grid.node(solution.grid.index(at));
        assert!(marked == (x.abs() > 2.5) || (x.abs() - 2.5).abs() < 1e-9, "{x}");
    }
    assert!(!solution.depends_on_outside(0.0).unwrap().unwrap().contains(&true));
    assert_eq!(solution.depends_on_outside(1.1).unwrap_err().field, "tau_s");
    // A circle has no ends.
    let circle = [Axis::periodic(0.0, TAU, 20)];
    let game = Drift { drift: [1.0], speed: [0.0] };
    let around = |[x]: [f64; 1]| cos(x);
    let round = problem(&game, circle, &around, (Kind::Set, BACKWARD), 1.0);
    let solution: Solution<f64, 1> = solved(&round, &settings(Scheme::Eno2));
    assert_eq!(solution.earliest_exit_s([3.0]).unwrap(), Some(f64::INFINITY));
}

/// For ẋ = −1, only nodes whose distance from the lower end is at most the horizon depend on values
/// beyond this end. The marks ignore the direction of velocities, so they include all these nodes,
/// and as many nodes at the upper end.
#[test]
fn marks_leave_no_node_out_and_are_the_same_at_both_ends() {
    let game = Drift { drift: [-1.0], speed: [0.0] };
    let target = |[x]: [f64; 1]| x;
    for boundary in [Boundary::Extrapolate, Boundary::Constant] {
        let axes = [Axis::bounded(-1.0, 2.0, 61).with_boundary(boundary)];
        let problem = problem(&game, axes, &target, (Kind::Set, BACKWARD), 0.62);
        let solution: Solution<f64, 1> = solved(&problem, &settings(Scheme::Weno5));
        let marked = solution.depends_on_outside(0.62).unwrap().unwrap();
        for (at, &marked) in marked.iter().enumerate() {
            let [x] = solution.grid.node([at]);
            let depends = x - 0.62 < -1.0;
            assert_eq!(marked, depends || x + 0.62 > 2.0, "{x}");
        }
    }
}

/// Values at unmarked nodes equal the values on a larger grid, except for the influence of
/// stencils, which are a few nodes wide.
#[test]
fn values_that_do_not_depend_on_the_outside_are_those_of_a_larger_grid() {
    let game = DoubleIntegrator { acceleration_mps2: 1.0 };
    let target = |[x, v]: [f64; 2]| hypot(x - 1.0, v - 0.4) - 0.4;
    for boundary in [Boundary::Extrapolate, Boundary::Constant] {
        let small = [Axis::bounded(-2.0, 2.0, 81), Axis::bounded(-1.0, 1.0, 41)]
            .map(|axis| axis.with_boundary(boundary));
        let large = [Axis::bounded(-6.0, 6.0, 241), Axis::bounded(-3.0, 3.0, 121)];
        let of = |axes| -> Solution<f64, 2> {
            let problem = problem(&game, axes, &target, (Kind::Tube, BACKWARD), 0.8);
            solved(&problem, &settings(Scheme::Weno5))
        };
        let (found, whole) = (of(small), of(large));
        let marked = found.depends_on_outside(0.8).unwrap().unwrap();
        let mut gaps = [0.0_f64; 2];
        for (at, marked) in marked.iter().enumerate() {
            let state = found.grid.node(found.grid.index(at));
            let gap = (found.values[at] - whole.value(state).unwrap()).abs();
            let most = &mut gaps[usize::from(*marked)];
            *most = most.max(gap);
        }
        let free = marked.iter().filter(|marked| !**marked).count();
        eprintln!("{boundary:?}: {free} free, gaps {gaps:?}");
        assert!(free > 300 && gaps[0] < 0.01 && gaps[1] > 0.1, "{gaps:?}");
    }
}
