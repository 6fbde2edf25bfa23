//! The Cartesian level-set solver against a plain twin of itself, against closed
//! forms in one to four dimensions, against the exact value of the pursuit game,
//! and against input that it must refuse.
//!
//! Games that exist only to be tested are at the end. Each test prints what it
//! measured (`cargo test --release -- --nocapture`).

use core::f64::consts::LN_2;
use core::ops::ControlFlow;
use sidestep::invalid::Invalid;
use sidestep::math::{PI, SeededRng, TAU, cos, hypot, ln, sin, sin_cos};
use sidestep::reachability::cartesian::{
    Direction, Horizon, Kind, Problem, Region, Settings, Solution, solve,
};
use sidestep::reachability::{
    Axis, Boundary, DoubleIntegrator, Game, Grid, Player, PursuitGame, Real, RelativeDubins,
    Scheme, SolveError, TERMS,
};

const SCHEMES: [Scheme; 4] = [Scheme::Upwind, Scheme::Eno2, Scheme::Eno3, Scheme::Weno5];

fn settings(scheme: Scheme) -> Settings {
    Settings { threads: 2, cfl: 0.75, ..Settings::of(scheme) }
}

fn solved<T: Real, const D: usize, G: Game<D>>(
    problem: &Problem<'_, D, G>,
    settings: &Settings,
) -> Solution<T, D> {
    solve(problem, settings, &mut |_| ControlFlow::Continue(())).expect("a solution")
}

/// The target of `region` within `seconds`, with no obstacle.
fn problem<'a, const D: usize, G: Game<D>>(
    game: &'a G,
    axes: [Axis; D],
    target: &'a (dyn Fn([f64; D]) -> f64 + Sync),
    (kind, direction): (Kind, Direction),
    seconds: f64,
) -> Problem<'a, D, G> {
    Problem {
        game,
        grid: Grid { axes },
        target: Region::Static(target),
        obstacle: None,
        kind,
        direction,
        horizon: Horizon::Finite(seconds),
    }
}

// ---- the plain twin ---------------------------------------------------------

/// The same method as the solver's, written down from the books: one node after
/// the other, in f64, with the printed formulas (Osher and Fedkiw 2003, sections
/// 3.2–3.5 and 5.3; Shu and Osher 1988).
struct Twin<'a, const D: usize, G> {
    problem: &'a Problem<'a, D, G>,
    scheme: Scheme,
    /// Steepest slope of the data, which WENO's ε is relative to.
    scale: f64,
}

impl<const D: usize, G: Game<D>> Twin<'_, D, G> {
    /// Value at `index`, moved by `offset` nodes along `axis`, ghosts included.
    fn at(&self, value: &[f64], mut index: [usize; D], axis: usize, offset: isize) -> f64 {
        let grid = &self.problem.grid;
        let Axis { nodes, boundary, .. } = grid.axes[axis];
        let moved = index[axis] as isize + offset;
        let mut inside = |i: isize| {
            index[axis] = i as usize;
            value[index.iter().enumerate().fold(0, |n, (d, i)| n * grid.axes[d].nodes + i)]
        };
        let last = nodes as isize - 1;
        let (end, before, distance) = match boundary {
            Boundary::Periodic => return inside(moved.rem_euclid(nodes as isize)),
            Boundary::Extrapolate if moved < 0 => (inside(0), inside(1), -moved),
            Boundary::Extrapolate if moved > last => (inside(last), inside(last - 1), moved - last),
            Boundary::Extrapolate => return inside(moved),
        };
        end + distance as f64 * (end - before).abs() * if end < 0.0 { -1.0 } else { 1.0 }
    }

    /// Left and right derivative along `axis`.
    fn slopes(&self, value: &[f64], index: [usize; D], axis: usize) -> [f64; 2] {
        let h = self.problem.grid.axes[axis].spacing();
        let v = |i: isize| self.at(value, index, axis, i);
        // Divided differences as the book counts them, with the node itself at 0.
        let d1 = |left: isize| (v(left + 1) - v(left)) / h;
        let d2 = |middle: isize| (d1(middle) - d1(middle - 1)) / (2.0 * h);
        let d3 = |left: isize| (d2(left + 1) - d2(left)) / (3.0 * h);
        let eno = |order: usize, mut k: isize| {
            let mut slope = d1(k);
            if order >= 2 {
                let to_left = d2(k).abs() < d2(k + 1).abs();
                let c = if to_left { d2(k) } else { d2(k + 1) };
                slope += c * (2 * -k - 1) as f64 * h;
                k -= isize::from(to_left);
            }
            if order == 3 {
                let c = if d3(k).abs() < d3(k + 1).abs() { d3(k) } else { d3(k + 1) };
                slope += c * (3 * k * k + 6 * k + 2) as f64 * h * h;
            }
            slope
        };
        match self.scheme {
            Scheme::Upwind => [eno(1, -1), eno(1, 0)],
            Scheme::Eno2 => [eno(2, -1), eno(2, 0)],
            Scheme::Eno3 => [eno(3, -1), eno(3, 0)],
            Scheme::Weno5 => {
                [self.weno([-3, -2, -1, 0, 1].map(d1)), self.weno([2, 1, 0, -1, -2].map(d1))]
            }
        }
    }

    fn weno(&self, [v1, v2, v3, v4, v5]: [f64; 5]) -> f64 {
        let square = |x: f64| x * x;
        let smoothness = [
            13.0 / 12.0 * square(v1 - 2.0 * v2 + v3) + 0.25 * square(v1 - 4.0 * v2 + 3.0 * v3),
            13.0 / 12.0 * square(v2 - 2.0 * v3 + v4) + 0.25 * square(v2 - v4),
            13.0 / 12.0 * square(v3 - 2.0 * v4 + v5) + 0.25 * square(3.0 * v3 - 4.0 * v4 + v5),
        ];
        let slopes = [
            v1 / 3.0 - 7.0 * v2 / 6.0 + 11.0 * v3 / 6.0,
            -v2 / 6.0 + 5.0 * v3 / 6.0 + v4 / 3.0,
            v3 / 3.0 + 5.0 * v4 / 6.0 - v5 / 6.0,
        ];
        let epsilon = 1e-6 * square(self.scale);
        let mut weights = [0.1, 0.6, 0.3];
        for (weight, s) in weights.iter_mut().zip(smoothness) {
            *weight /= square(s + epsilon);
        }
        let sum: f64 = weights.iter().sum();
        weights.iter().zip(slopes).map(|(weight, slope)| weight / sum * slope).sum()
    }

    fn terms(&self, index: [usize; D]) -> [[f64; TERMS]; D] {
        let x = self.problem.grid.node(index);
        core::array::from_fn(|d| self.problem.game.terms(d, x[d]))
    }

    /// value + seconds · (H + dissipation).
    fn moved(&self, value: &[f64], seconds: f64) -> Vec<f64> {
        let sign = if self.problem.direction == Direction::Forward { -1.0 } else { 1.0 };
        let node = |position: usize| {
            let index = self.problem.grid.index(position);
            let slopes: [[f64; 2]; D] = core::array::from_fn(|d| self.slopes(value, index, d));
            let terms = self.terms(index);
            let mean = slopes.map(|[left, right]| sign * 0.5 * (left + right));
            let speeds = self.problem.game.speed_bounds(&terms);
            let dissipation: f64 =
                (0..D).map(|d| speeds[d] * 0.5 * (slopes[d][1] - slopes[d][0])).sum();
            value[position] + seconds * (self.problem.game.hamiltonian(&terms, mean) + dissipation)
        };
        (0..value.len()).map(node).collect()
    }

    fn sampled(&self, region: &Region<'_, D>, time: f64) -> Vec<f64> {
        let grid = &self.problem.grid;
        let at = |position| match region {
            Region::Static(region) => region(grid.node(grid.index(position))),
            Region::Moving(region) => region(grid.node(grid.index(position)), time),
        };
        (0..grid.len()).map(at).collect()
    }

    /// keep · old + (1 − keep) · new, within the target and the obstacle at `time`.
    fn mixed(&self, keep: f64, old: &[f64], new: &[f64], time: f64) -> Vec<f64> {
        let mut value: Vec<f64> =
            old.iter().zip(new).map(|(old, new)| keep * old + (1.0 - keep) * new).collect();
        if self.problem.kind == Kind::Tube {
            for (value, ceiling) in value.iter_mut().zip(self.sampled(&self.problem.target, time)) {
                *value = value.min(ceiling);
            }
        }
        if let Some(obstacle) = &self.problem.obstacle {
            for (value, floor) in value.iter_mut().zip(self.sampled(obstacle, time)) {
                *value = value.max(floor);
            }
        }
        value
    }

    fn step(&self, value: &[f64], time: f64, dt: f64) -> Vec<f64> {
        let first = self.mixed(0.0, value, &self.moved(value, dt), time + dt);
        match self.scheme {
            Scheme::Upwind => first,
            Scheme::Eno2 => self.mixed(0.5, value, &self.moved(&first, dt), time + dt),
            Scheme::Eno3 | Scheme::Weno5 => {
                let half = self.mixed(0.75, value, &self.moved(&first, dt), time + 0.5 * dt);
                self.mixed(1.0 / 3.0, value, &self.moved(&half, dt), time + dt)
            }
        }
    }
}

/// V by the twin, with steps of the share `cfl` of the largest stable one.
fn by_twin<const D: usize, G: Game<D>>(
    problem: &Problem<'_, D, G>,
    scheme: Scheme,
    cfl: f64,
) -> Vec<f64> {
    let grid = &problem.grid;
    let mut twin = Twin { problem, scheme, scale: 1.0 };
    let target = twin.sampled(&problem.target, 0.0);
    let mut value = twin.mixed(1.0, &target, &target, 0.0);
    let (mut steepest, mut fastest) = (0.0_f64, 0.0_f64);
    for (position, here) in value.iter().enumerate() {
        let index = grid.index(position);
        let speeds = problem.game.speed_bounds(&twin.terms(index));
        fastest = fastest.max((0..D).map(|d| speeds[d] / grid.axes[d].spacing()).sum());
        for (d, axis) in grid.axes.iter().enumerate() {
            if index[d] + 1 < axis.nodes {
                let slope = (twin.at(&value, index, d, 1) - here) / axis.spacing();
                steepest = steepest.max(slope.abs());
            }
        }
    }
    twin.scale = steepest;
    let Horizon::Finite(seconds) = problem.horizon else { panic!("the twin stops on time") };
    let steps = (seconds * fastest / cfl).ceil();
    let dt = seconds / steps;
    for step in 0..steps as usize {
        value = twin.step(&value, step as f64 * dt, dt);
    }
    value
}

/// A bumpy function with a kink, periodic in 2π along every axis.
fn bumpy<const D: usize>(x: [f64; D], time: f64) -> f64 {
    let [mut bowl, mut waves] = [-0.4, 0.1];
    for (d, x) in x.into_iter().enumerate() {
        let d = d as f64;
        bowl += (1.0 + 0.2 * d) * (1.0 - cos(x - 0.37 + 0.11 * d + 0.9 * time));
        waves += 0.31 * sin(2.0 * x + 1.7 * d - time) - 0.1 * d;
    }
    bowl.max(waves)
}

/// Positive inside a ball that drifts.
fn ball<const D: usize>(x: [f64; D], time: f64) -> f64 {
    x.into_iter().fold(0.45, |depth, x| depth - (1.0 - cos(x - 1.13 - 0.8 * time)))
}

fn compare_with_twin<const D: usize>(axes: [Axis; D], seconds: f64) {
    let still_target = |x| bumpy(x, 0.0);
    let still_ball = |x| ball(x, 0.0);
    let target = Region::Static(&still_target);
    let cases = [
        (Kind::Set, Direction::Backward, target, None),
        (Kind::Tube, Direction::Backward, target, None),
        (Kind::Tube, Direction::Forward, target, Some(Region::Static(&still_ball))),
        (Kind::Set, Direction::Forward, target, Some(Region::Moving(&ball))),
        (Kind::Tube, Direction::Backward, Region::Moving(&bumpy), Some(Region::Moving(&ball))),
    ];
    for scheme in SCHEMES {
        let (mut worst, mut worst_single, mut mean_single) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (kind, direction, target, obstacle) in cases {
            let grid = Grid { axes };
            let horizon = Horizon::Finite(seconds);
            let problem =
                Problem { game: &Twisted, grid, target, obstacle, kind, direction, horizon };
            let settings = Settings { cfl: 0.6, ..settings(scheme) };
            let twin = by_twin(&problem, scheme, 0.6);
            let double = solved::<f64, D, _>(&problem, &settings);
            let single = solved::<f32, D, _>(&problem, &settings);
            assert!(double.steps >= 4, "{} steps", double.steps);
            let size = twin.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
            let mut sum = 0.0;
            for (position, expected) in twin.iter().enumerate() {
                let error = (double.values[position] - expected).abs() / size;
                let index = grid.index(position);
                assert!(error <= 1e-12, "{scheme:?} {kind:?} {direction:?}: {error} at {index:?}");
                worst = worst.max(error);
                let error = (f64::from(single.values[position]) - expected).abs() / size;
                worst_single = worst_single.max(error);
                sum += error;
            }
            mean_single = mean_single.max(sum / twin.len() as f64);
        }
        // ENO chooses between stencils: rounding decides a tie, and a derivative jumps.
        let [mean, max] = match scheme {
            Scheme::Upwind => [1e-7, 1e-6],
            Scheme::Weno5 => [1e-6, 5e-6],
            Scheme::Eno2 | Scheme::Eno3 => [1e-5, 1e-3],
        };
        assert!(mean_single <= mean && worst_single <= max, "{scheme:?}: {worst_single}");
        eprintln!(
            "twin {D}-D {}: f64 {worst:.1e}, f32 mean {mean_single:.1e} max {worst_single:.1e}",
            scheme.name()
        );
    }
}

#[test]
fn the_twin_agrees_in_one_dimension() {
    // More cells than a block of the solver's, and fewer.
    compare_with_twin([Axis::periodic(0.0, TAU, 601)], 0.1);
    compare_with_twin([Axis::bounded(-2.1, 2.4, 57)], 0.5);
}

#[test]
fn the_twin_agrees_in_two_dimensions() {
    compare_with_twin([Axis::bounded(-2.1, 2.4, 14), Axis::periodic(-PI, PI, 280)], 0.1);
    compare_with_twin([Axis::periodic(-PI, PI, 23), Axis::bounded(-1.9, 2.6, 31)], 0.5);
}

#[test]
fn the_twin_agrees_in_three_dimensions() {
    let [low, high] = [-2.1, 2.4];
    compare_with_twin(
        [Axis::bounded(low, high, 9), Axis::periodic(0.0, TAU, 15), Axis::bounded(low, high, 21)],
        0.4,
    );
    compare_with_twin(
        [Axis::periodic(0.0, TAU, 5), Axis::bounded(low, high, 7), Axis::periodic(0.0, TAU, 18)],
        0.4,
    );
}

#[test]
fn the_twin_agrees_in_four_dimensions() {
    let [low, high] = [-2.1, 2.4];
    compare_with_twin(
        [
            Axis::bounded(low, high, 5),
            Axis::periodic(0.0, TAU, 6),
            Axis::periodic(0.0, TAU, 8),
            Axis::bounded(low, high, 13),
        ],
        0.3,
    );
    compare_with_twin(
        [
            Axis::periodic(0.0, TAU, 4),
            Axis::bounded(low, high, 7),
            Axis::bounded(low, high, 9),
            Axis::periodic(0.0, TAU, 5),
        ],
        0.3,
    );
}

// ---- threads and number types -----------------------------------------------

/// The bits do not depend on the threads; f32 stays within `single` of f64, relative
/// to the largest |V|.
fn compare_threads<const D: usize>(axes: [Axis; D], seconds: f64, single: f64) {
    let grid = Grid { axes };
    assert!(grid.len() >= 50_000, "small grids use one thread whatever is asked for");
    let still_ball = |x| ball(x, 0.0);
    let problem = Problem {
        game: &Twisted,
        grid,
        target: Region::Moving(&bumpy),
        obstacle: Some(Region::Static(&still_ball)),
        kind: Kind::Tube,
        direction: Direction::Backward,
        horizon: Horizon::Finite(seconds),
    };
    for scheme in [Scheme::Upwind, Scheme::Eno2, Scheme::Weno5] {
        let with = |threads| Settings { threads, ..settings(scheme) };
        let one = solved::<f64, D, _>(&problem, &with(1));
        let one_single = solved::<f32, D, _>(&problem, &with(1));
        for threads in [0, 2, 3, 1_000_000] {
            let many = solved::<f64, D, _>(&problem, &with(threads));
            let same = one.values.iter().zip(&many.values).all(|(a, b)| a.to_bits() == b.to_bits());
            assert!(same && one.residual.to_bits() == many.residual.to_bits(), "{threads} threads");
            let many = solved::<f32, D, _>(&problem, &with(threads));
            let mut pairs = one_single.values.iter().zip(&many.values);
            assert!(pairs.all(|(a, b)| a.to_bits() == b.to_bits()), "{threads} threads, f32");
        }
        let size = one.values.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
        let gaps = one.values.iter().zip(&one_single.values);
        let worst = gaps.fold(0.0_f64, |worst, (a, b)| worst.max((a - f64::from(*b)).abs())) / size;
        eprintln!("threads {D}-D {}: f32 within {worst:.1e} of f64", scheme.name());
        assert!(worst <= single, "{worst}");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    compare_threads([Axis::periodic(0.0, TAU, 50_001)], 1e-3, 5e-6);
    compare_threads([Axis::bounded(-2.1, 2.4, 301), Axis::periodic(0.0, TAU, 203)], 0.03, 5e-6);
    compare_threads(
        [Axis::bounded(-2.1, 2.4, 37), Axis::periodic(0.0, TAU, 41), Axis::bounded(-1.0, 2.0, 43)],
        0.03,
        2e-6,
    );
    compare_threads(
        [
            Axis::periodic(0.0, TAU, 17),
            Axis::bounded(-2.1, 2.4, 13),
            Axis::bounded(-2.1, 2.4, 15),
            Axis::periodic(0.0, TAU, 16),
        ],
        0.03,
        2e-6,
    );
}

// ---- closed forms -----------------------------------------------------------

#[derive(Clone, Copy, Debug)]
struct Errors {
    nodes: usize,
    mean: f64,
    max: f64,
}

/// Errors of the nodes of `region` against `exact`.
fn errors<T: Real, const D: usize>(
    name: &str,
    solution: &Solution<T, D>,
    region: impl Fn([f64; D]) -> bool,
    exact: impl Fn([f64; D]) -> f64,
) -> Errors {
    let mut errors = Errors { nodes: 0, mean: 0.0, max: 0.0 };
    for (position, value) in solution.values.iter().enumerate() {
        let state = solution.grid.node(solution.grid.index(position));
        if region(state) {
            let error = (value.to_f64() - exact(state)).abs();
            errors.nodes += 1;
            errors.mean += error;
            errors.max = errors.max.max(error);
        }
    }
    errors.mean /= errors.nodes as f64;
    let Errors { nodes, mean, max } = errors;
    eprintln!("{name}: mean {mean:.2e}, max {max:.2e} over {nodes} nodes");
    errors
}

/// What may be wrong where V has a kink. Numerical diffusion of Δx (1 − cfl)/2 turns
/// max(y, 0) into √(diffusion · T/π) at y = 0 in T seconds at speed 1, and the bottom of
/// a valley rises by half a cell at first; schemes of higher order do better than that
/// in the end, and stay within two cells from the start.
fn kink_bound(dx: f64, cfl: f64, seconds: f64, scheme: Scheme) -> f64 {
    if scheme == Scheme::Upwind {
        0.5 * dx + (0.5 * dx * (1.0 - cfl) * seconds / PI).sqrt()
    } else {
        2.0 * dx
    }
}

const BACKWARD: Direction = Direction::Backward;
const FORWARD: Direction = Direction::Forward;

/// ẋ = u with |u| ≤ 1 reaches from x what is within T: the interval |x| ≤ r is reached
/// from |x| ≤ r + T, and V = max(|x| − T, 0) − r, forward as backward, tube as set,
/// since one may wait at the best place.
#[test]
fn an_interval_grows_at_full_speed() {
    let (game, radius) = (Drift { drift: [0.0], speed: [1.0] }, 0.5);
    let target = |[x]: [f64; 1]| x.abs() - radius;
    for kind in [Kind::Tube, Kind::Set] {
        for direction in [BACKWARD, FORWARD] {
            for scheme in SCHEMES {
                let axes = [Axis::bounded(-4.0, 4.0, 201)];
                let problem = problem(&game, axes, &target, (kind, direction), 1.5);
                // With more, two one-sided stencils of ENO2 together are not stable.
                let settings = Settings { cfl: 0.5, ..settings(scheme) };
                let solution = solved::<f64, 1, _>(&problem, &settings);
                let exact = |[x]: [f64; 1]| (x.abs() - 1.5).max(0.0) - radius;
                let name = format!("interval {kind:?} {direction:?} {}", scheme.name());
                let all = errors(&name, &solution, |_| true, exact);
                let bound = kink_bound(solution.grid.axes[0].spacing(), 0.5, 1.5, scheme);
                // The edge of the set, at |x| = 2, and all that is further out.
                let edge = |[x]: [f64; 1]| x.abs() > 1.99;
                let edge = errors(&format!("{name}, outside"), &solution, edge, exact);
                let edge_bound = if scheme == Scheme::Upwind { 2e-4 } else { 5e-6 };
                assert!(all.max <= bound && edge.max <= edge_bound, "{all:?} {edge:?}");
            }
        }
    }
}

/// ẋ = c, no players, on a circle: V(x, T) = l(x + cT) backward and l(x − cT) forward;
/// T is one and a third rounds.
#[test]
fn a_profile_travels_around_a_periodic_axis() {
    let game = Drift { drift: [1.5], speed: [0.0] };
    let target = |[x]: [f64; 1]| sin(x) + 0.3 * cos(2.0 * x);
    let seconds = 4.0 / 3.0 * TAU / 1.5;
    for (direction, shift) in [(BACKWARD, 1.5 * seconds), (FORWARD, -1.5 * seconds)] {
        let axes = [Axis::periodic(0.0, TAU, 200)];
        let problem = problem(&game, axes, &target, (Kind::Set, direction), seconds);
        let solution = solved::<f64, 1, _>(&problem, &settings(Scheme::Weno5));
        let exact = |[x]: [f64; 1]| target([x + shift]);
        let all = errors(&format!("travel {direction:?}"), &solution, |_| true, exact);
        assert!(all.max <= 5e-5, "{all:?}");
    }
}

/// Least |x + vt + (what u adds)| over |u| ≤ a at time t exactly: u moves the end by at
/// most at²/2 either way.
fn least_distance([x, v]: [f64; 2], a: f64, t: f64) -> f64 {
    ((x + v * t).abs() - 0.5 * a * t * t).max(0.0)
}

/// The double integrator ẋ = v, v̇ = u, |u| ≤ a, and the strip |x| ≤ r. At T exactly,
/// V = max(|x + vT| − aT²/2, 0) − r. Within T, V is the least of these over t ≤ T; as
/// long as x + vt keeps its sign |x + vt| − at²/2 is concave in t, so that its least
/// value is at t = 0, at T, or is 0 where x + vt changes sign. Forward, v → −v.
#[test]
fn a_double_integrator_reaches_a_strip() {
    let (a, radius, seconds) = (1.0, 0.5, 1.2);
    let game = DoubleIntegrator { acceleration_mps2: a };
    let target = |[x, _]: [f64; 2]| x.abs() - radius;
    for kind in [Kind::Set, Kind::Tube] {
        for (direction, sign) in [(BACKWARD, 1.0), (FORWARD, -1.0)] {
            let exact = |[x, v]: [f64; 2]| {
                let v = sign * v;
                let mut least = least_distance([x, v], a, seconds);
                if kind == Kind::Tube {
                    let crossing = -x / v;
                    let crosses = (0.0..=seconds).contains(&crossing);
                    least = if crosses { 0.0 } else { least.min(x.abs()) };
                }
                least - radius
            };
            // Where no path and no kink's wake comes near the ends.
            let inside = |[x, v]: [f64; 2]| x.abs() < 2.5 && v.abs() < 1.5;
            let mut coarse: Option<Errors> = None;
            for half in [40, 80] {
                let axes = [
                    Axis::bounded(-6.0, 6.0, 3 * half + 1),
                    Axis::bounded(-3.5, 3.5, 2 * half + 1),
                ];
                let problem = problem(&game, axes, &target, (kind, direction), seconds);
                let solution = solved::<f64, 2, _>(&problem, &settings(Scheme::Weno5));
                let name = format!("strip {kind:?} {direction:?} {half}");
                let all = errors(&name, &solution, inside, exact);
                let dx = solution.grid.axes[0].spacing();
                assert!(all.mean <= 0.15 * dx && all.max <= 1.5 * dx, "{all:?}");
                if let Some(coarse) = coarse {
                    assert!(all.mean <= 0.6 * coarse.mean && all.max <= 0.7 * coarse.max);
                }
                coarse = Some(all);
            }
        }
    }
}

/// Least |z(T)| of the double integrator: the greatest over unit vectors p of
/// p·Φz − a ∫₀ᵀ |p₁ s + p₂| ds (Hopf), or 0 if that is negative: the distance of Φz
/// from the convex set that the input can undo.
fn least_range([x, v]: [f64; 2], a: f64, t: f64) -> f64 {
    let margin = |angle: f64| {
        let (p2, p1) = sin_cos(angle);
        let antiderivative = |s: f64| {
            let w = p1 * s + p2;
            0.5 * w * w.abs() / p1
        };
        let undone =
            if p1.abs() < 1e-9 { p2.abs() * t } else { antiderivative(t) - antiderivative(0.0) };
        p1 * (x + v * t) + p2 * v - a * undone
    };
    let step = TAU / 90.0;
    let best =
        (0..90).map(|i| f64::from(i) * step).max_by(|p, q| margin(*p).total_cmp(&margin(*q)));
    let best = best.expect("an angle");
    let (mut low, mut high) = (best - step, best + step);
    for _ in 0..40 {
        let third = (high - low) / 3.0;
        if margin(low + third) < margin(high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    margin(0.5 * (low + high)).max(0.0)
}

/// The double integrator and the disc of radius r about the origin, at T exactly.
/// {V ≤ −r}, what reaches the origin itself, is what the textbook's minimum time to the
/// origin says (bang-bang with one switch on x = −v|v|/2a).
#[test]
fn a_double_integrator_reaches_a_disc() {
    let (a, radius, seconds) = (1.0, 0.5, 1.2);
    let minimum_time = |[x, v]: [f64; 2]| {
        let side = if x + 0.5 * v * v.abs() / a > 0.0 { 1.0 } else { -1.0 };
        let (x, v) = (side * x, side * v);
        (v + 2.0 * (0.5 * v * v + a * x).sqrt()) / a
    };
    let mut rng = SeededRng::new(1);
    let mut reached = 0;
    for _ in 0..2000 {
        let state = [rng.uniform(-1.0, 1.0), rng.uniform(-1.5, 1.5)];
        let time = minimum_time(state);
        if (time - seconds).abs() > 1e-3 {
            assert_eq!(least_range(state, a, seconds) <= 1e-9, time < seconds, "{state:?}");
            reached += usize::from(time < seconds);
        }
    }
    assert!(reached > 200, "{reached}");

    let game = DoubleIntegrator { acceleration_mps2: a };
    let target = |[x, v]: [f64; 2]| hypot(x, v) - radius;
    for (direction, sign) in [(BACKWARD, 1.0), (FORWARD, -1.0)] {
        let axes = [Axis::bounded(-6.0, 6.0, 161), Axis::bounded(-4.0, 4.0, 121)];
        let problem = problem(&game, axes, &target, (Kind::Set, direction), seconds);
        let solution = solved::<f64, 2, _>(&problem, &settings(Scheme::Weno5));
        let exact = |[x, v]: [f64; 2]| least_range([x, sign * v], a, seconds) - radius;
        let dx = solution.grid.axes[0].spacing();
        let inside = |[x, v]: [f64; 2]| x.abs() < 3.0 && v.abs() < 2.0;
        let all = errors(&format!("disc {direction:?}"), &solution, inside, exact);
        let edge = |state| inside(state) && exact(state).abs() < 0.2;
        let edge = errors(&format!("disc {direction:?}, at its edge"), &solution, edge, exact);
        assert!(all.max <= 1.5 * dx && edge.mean <= 0.1 * dx, "{all:?} {edge:?}");
    }
}

/// Four single integrators with drift, ẋ_d = c_d + u_d, |u_d| ≤ s_d, and a ball: at T,
/// V = |(max(|x_d + c_d T| − s_d T, 0))_d| − r; forward with −c_d.
#[test]
fn a_ball_is_reached_in_four_dimensions() {
    let (radius, seconds) = (0.6, 0.5);
    let game = Drift { drift: [0.6, -0.3, 0.0, 0.4], speed: [0.8, 0.5, 1.0, 0.0] };
    let norm = |x: [f64; 4]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
    let target = |x| norm(x) - radius;
    for (direction, sign) in [(BACKWARD, 1.0), (FORWARD, -1.0)] {
        let exact = |x: [f64; 4]| {
            let rest = core::array::from_fn(|d| {
                let end = x[d] + sign * game.drift[d] * seconds;
                (end.abs() - game.speed[d] * seconds).max(0.0)
            });
            norm(rest) - radius
        };
        let axes = [24, 26, 25, 27].map(|nodes| Axis::bounded(-2.4, 2.4, nodes));
        let problem = problem(&game, axes, &target, (Kind::Set, direction), seconds);
        let solution = solved::<f32, 4, _>(&problem, &settings(Scheme::Weno5));
        let dx = solution.grid.axes[0].spacing();
        let inside = |x: [f64; 4]| x.iter().all(|x| x.abs() < 1.7);
        let all = errors(&format!("4-D ball {direction:?}"), &solution, inside, exact);
        let edge = |x| inside(x) && exact(x).abs() < dx;
        let edge = errors(&format!("4-D ball {direction:?}, at its edge"), &solution, edge, exact);
        assert!(all.max <= dx && edge.mean <= 0.1 * dx, "{all:?} {edge:?}");
    }
}

/// Two double integrators at once, each to be in its strip at T: the inputs do not
/// share anything, so V is the larger of the two closed forms.
#[test]
fn two_double_integrators_reach_a_square() {
    let (a, radius, seconds) = (1.0, 0.4, 0.8);
    let game = TwoMasses(a);
    let target = |[x, _, y, _]: [f64; 4]| x.abs().max(y.abs()) - radius;
    for (direction, sign) in [(BACKWARD, 1.0), (FORWARD, -1.0)] {
        let exact = |[x, v, y, w]: [f64; 4]| {
            let first = least_distance([x, sign * v], a, seconds);
            first.max(least_distance([y, sign * w], a, seconds)) - radius
        };
        let axes = [(3.0, 31), (2.0, 21), (3.0, 31), (2.0, 21)]
            .map(|(end, nodes)| Axis::bounded(-end, end, nodes));
        let problem = problem(&game, axes, &target, (Kind::Set, direction), seconds);
        let solution = solved::<f32, 4, _>(&problem, &settings(Scheme::Weno5));
        let dx = solution.grid.axes[0].spacing();
        let inside =
            |[x, v, y, w]: [f64; 4]| x.abs().max(y.abs()) < 1.6 && v.abs().max(w.abs()) < 1.1;
        let all = errors(&format!("two masses {direction:?}"), &solution, inside, exact);
        let edge = |x| inside(x) && exact(x).abs() < dx;
        let edge =
            errors(&format!("two masses {direction:?}, at its edge"), &solution, edge, exact);
        assert!(all.max <= dx && edge.mean <= 0.1 * dx, "{all:?} {edge:?}");
    }
}

/// ẋ = u, |u| ≤ 1, the target |x| ≤ r and a wall of half width w about b, which nobody
/// can cross: with the height h(x) = w − |x − b| of the wall, V = max(max(|x| − T, 0) − r,
/// h(x)) before its middle; beyond, the way leads over its top: max(x − T − r, w) as
/// long as T suffices to get to the wall's top.
#[test]
fn a_wall_keeps_off_what_lies_behind_it() {
    let (radius, width, wall, seconds) = (0.5, 0.5, 2.0, 3.0);
    let game = Drift { drift: [0.0], speed: [1.0] };
    let target = |[x]: [f64; 1]| x.abs() - radius;
    let height = |[x]: [f64; 1]| width - (x - wall).abs();
    let exact = |[x]: [f64; 1]| {
        let free = (x.abs() - seconds).max(0.0) - radius;
        free.max(if x < wall { height([x]) } else { width })
    };
    for scheme in SCHEMES {
        let mut problem = problem(
            &game,
            [Axis::bounded(-5.0, 5.0, 251)],
            &target,
            (Kind::Tube, BACKWARD),
            seconds,
        );
        problem.obstacle = Some(Region::Static(&height));
        let solution = solved::<f64, 1, _>(&problem, &settings(scheme));
        let dx = solution.grid.axes[0].spacing();
        let inside = |[x]: [f64; 1]| x.abs() < 4.5;
        let all = errors(&format!("wall {}", scheme.name()), &solution, inside, exact);
        let within = |name: &str, low: f64, high: f64| {
            let name = format!("wall {} {name}", scheme.name());
            errors(&name, &solution, |[x]: [f64; 1]| low < x && x < high, exact).max
        };
        let bound = kink_bound(dx, settings(scheme).cfl, seconds, scheme);
        assert!(all.max <= bound, "{all:?}");
        // The set ends at −3.5, where nothing is in the way, and at the wall, at 1.5;
        // nothing comes through it.
        let edge_bound = if scheme == Scheme::Upwind { 2e-4 } else { 1e-4 };
        assert!(within("free edge", -4.5, -3.4) <= edge_bound);
        assert!(within("edge at the wall", 1.4, 1.9) <= 1e-12);
        assert!(within("behind", 2.4, 3.6) <= 0.5 * dx);
    }
}

/// ẋ = u, |u| ≤ 1 and an interval that moves at c > 1, faster than x can: l = |x − cτ| −
/// r at the time τ before the end. It is met now or, where it sweeps over x, met without
/// moving: V = max(−x − T, x − cT, 0) − r.
#[test]
fn a_moving_interval_is_met() {
    let (radius, speed, seconds) = (0.5, 1.25, 1.5);
    let game = Drift { drift: [0.0], speed: [1.0] };
    let target = |[x]: [f64; 1], time: f64| (x - speed * time).abs() - radius;
    let exact = |[x]: [f64; 1]| (-x - seconds).max(x - speed * seconds).max(0.0) - radius;
    for scheme in SCHEMES {
        let problem = Problem {
            game: &game,
            grid: Grid { axes: [Axis::bounded(-4.0, 5.0, 226)] },
            target: Region::Moving(&target),
            obstacle: None,
            kind: Kind::Tube,
            direction: BACKWARD,
            horizon: Horizon::Finite(seconds),
        };
        let solution = solved::<f64, 1, _>(&problem, &settings(scheme));
        let dx = solution.grid.axes[0].spacing();
        let all = errors(&format!("meeting {}", scheme.name()), &solution, |_| true, exact);
        let within = |name: &str, low: f64, high: f64| {
            let name = format!("meeting {} {name}", scheme.name());
            errors(&name, &solution, |[x]: [f64; 1]| low < x && x < high, exact).max
        };
        assert!(all.max <= kink_bound(dx, settings(scheme).cfl, seconds, scheme), "{all:?}");
        // Both edges of the set, at −2 and 2.375; ahead of the interval V is the target
        // itself, whatever the stages of a step do.
        assert!(within("behind", -4.5, -1.9) <= 5e-5);
        assert!(within("ahead", 2.275, 4.5) <= 1e-12);
    }
}

// ---- order of convergence ---------------------------------------------------

/// log₂ of the ratio of mean errors with `nodes` nodes to an axis and with twice as many.
fn observed_order(name: &str, nodes: usize, error: impl Fn(usize) -> Errors) -> f64 {
    let order = ln(error(nodes).mean / error(2 * nodes).mean) / LN_2;
    eprintln!("{name}: order {order:.2}");
    order
}

fn check_order(scheme: Scheme, order: f64) {
    let fits = match scheme {
        Scheme::Upwind => (0.9..1.1).contains(&order),
        Scheme::Eno2 => order >= 1.8,
        Scheme::Eno3 | Scheme::Weno5 => order >= 2.5,
    };
    assert!(fits, "{scheme:?}: order {order}");
}

/// V_τ = c·∇V on the torus: l moves unchanged.
#[test]
fn each_scheme_has_its_order_for_a_smooth_drift() {
    let game = Drift { drift: [1.0, -0.6], speed: [0.0; 2] };
    let target = |[x, y]: [f64; 2]| sin(x) * cos(y) + 0.5 * sin(x + 2.0 * y);
    let exact = |[x, y]: [f64; 2]| target([x + 1.0, y - 0.6]);
    for scheme in SCHEMES {
        let name = format!("drift {}", scheme.name());
        let nodes = if scheme == Scheme::Upwind { 160 } else { 80 };
        let order = observed_order(&name, nodes, |nodes| {
            let axes = [Axis::periodic(0.0, TAU, nodes); 2];
            let problem = problem(&game, axes, &target, (Kind::Set, BACKWARD), 1.0);
            let solution = solved::<f64, 2, _>(&problem, &settings(scheme));
            errors(&format!("{name} {nodes}"), &solution, |_| true, exact)
        });
        check_order(scheme, order);
    }
}

/// V_τ = −(∂V/∂x)²/2 from cos x, half the time until a kink forms at τ = 1. Slopes stay
/// the same along characteristics: with p = −sin x₀, x = x₀ + pτ and V = cos x₀ + p²τ/2.
fn steepening_order(scheme: Scheme, cfl: f64) -> f64 {
    let seconds = 0.5;
    let target = |[x]: [f64; 1]| cos(x);
    let exact = |[x]: [f64; 1]| {
        // x₀ − τ sin x₀ = x by bisection: its derivative is positive for τ < 1.
        let (mut low, mut high) = (x - 1.0, x + 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if middle - seconds * sin(middle) < x {
                low = middle;
            } else {
                high = middle;
            }
        }
        cos(low) + 0.5 * sin(low) * sin(low) * seconds
    };
    let name = format!("steepening {} cfl {cfl}", scheme.name());
    observed_order(&name, 160, |nodes| {
        let axes = [Axis::periodic(0.0, TAU, nodes)];
        let problem = problem(&Steepening, axes, &target, (Kind::Set, BACKWARD), seconds);
        let solution = solved::<f64, 1, _>(&problem, &Settings { cfl, ..settings(scheme) });
        errors(&format!("{name} {nodes}"), &solution, |_| true, exact)
    })
}

#[test]
fn each_scheme_has_its_order_before_a_kink_forms() {
    for scheme in SCHEMES {
        check_order(scheme, steepening_order(scheme, 0.375));
    }
    for scheme in [Scheme::Upwind, Scheme::Eno2, Scheme::Weno5] {
        check_order(scheme, steepening_order(scheme, 0.75));
    }
}

/// A known limit of the method, which the twin shares: where the dissipation exceeds the
/// slope, ENO3 may choose its outermost stencils on both sides, whose fastest mode decays
/// at 20/3 speeds a cell; TVD-RK3 is stable up to 2.51, that is for a share of 0.377.
#[test]
fn eno3_loses_its_order_with_long_steps() {
    let order = steepening_order(Scheme::Eno3, 0.75);
    assert!(order < 1.0, "order {order}: say so in the documentation of `Settings::cfl`");
}

// ---- the pursuit game -------------------------------------------------------

/// Weights of the nodes 0, 1, 2 and 3 for the cubic through them at `t`.
fn cubic_weights(t: f64) -> [f64; 4] {
    let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// Share of a triangle where the linear function with these corner values is ≤ 0.
fn negative_share(corners: [f64; 3]) -> f64 {
    let mut corners = corners;
    corners.sort_by(f64::total_cmp);
    let [a, b, c] = corners;
    if c <= 0.0 {
        1.0
    } else if a > 0.0 {
        0.0
    } else if b > 0.0 {
        a * a / ((b - a) * (c - a))
    } else {
        1.0 - c * c / ((c - a) * (c - b))
    }
}

/// How finely [`negative_volume`] divides the side of a cell.
const SUB_CELLS: usize = 8;

/// Volume of {V ≤ 0} on a grid whose third axis is periodic, of sets that do not meet the
/// ends of the first two: in each slice the bicubic interpolant is taken on a mesh of
/// 8 × 8 to the cell and the area of its piecewise linear interpolant is exact (four
/// triangles to a mesh cell); slices are summed, which for a smooth periodic area
/// converges faster than any power. Chords cut a convex set short by their sagitta, 1/64
/// of that of whole cells.
fn negative_volume(grid: &Grid<3>, value: impl Fn([usize; 3]) -> f64) -> f64 {
    let [nx, ny, npsi] = grid.axes.map(|axis| axis.nodes);
    let diagonal = hypot(grid.axes[0].spacing(), grid.axes[1].spacing());
    let mut cells = 0.0;
    for position in 0..(nx - 1) * (ny - 1) * npsi {
        let (i, j) = (position / npsi / (ny - 1), position / npsi % (ny - 1));
        let k = position % npsi;
        let corners = [[i, j], [i + 1, j], [i, j + 1], [i + 1, j + 1]];
        let corners = corners.map(|[i, j]| value([i, j, k]));
        // |∇V| is 1 in x and y: no sign changes within a cell further away than this.
        if corners.iter().all(|v| v.abs() > diagonal) {
            cells += f64::from(u8::from(corners[0] < 0.0));
            continue;
        }
        // The four nodes about the cell, or the last ones at an end.
        let (first_i, first_j) = (i.max(1).min(nx - 3) - 1, j.max(1).min(ny - 3) - 1);
        let weights = |cell: usize, first: usize| -> [[f64; 4]; SUB_CELLS + 1] {
            core::array::from_fn(|k| {
                cubic_weights((cell - first) as f64 + k as f64 / SUB_CELLS as f64)
            })
        };
        let (along_x, along_y) = (weights(i, first_i), weights(j, first_j));
        let patch: [[f64; 4]; 4] = core::array::from_fn(|a| {
            core::array::from_fn(|b| value([first_i + a, first_j + b, k]))
        });
        let at = |a: usize, b: usize| -> f64 {
            let row = |r: &[f64; 4]| (0..4).map(|n| along_y[b][n] * r[n]).sum::<f64>();
            (0..4).map(|n| along_x[a][n] * row(&patch[n])).sum()
        };
        let mesh: [[f64; SUB_CELLS + 1]; SUB_CELLS + 1] =
            core::array::from_fn(|a| core::array::from_fn(|b| at(a, b)));
        let mut quarters = 0.0;
        for a in 0..SUB_CELLS {
            for b in 0..SUB_CELLS {
                let ring = [mesh[a][b], mesh[a + 1][b], mesh[a + 1][b + 1], mesh[a][b + 1]];
                let middle = 0.25 * ring.iter().sum::<f64>();
                for n in 0..4 {
                    quarters += negative_share([ring[n], ring[(n + 1) % 4], middle]);
                }
            }
        }
        cells += 0.25 * quarters / (SUB_CELLS * SUB_CELLS) as f64;
    }
    cells * grid.cell_volume()
}

#[test]
fn the_volume_of_a_ball_is_measured_well() {
    // A torus of circles whose radius breathes: 2π·(r² + 1/2·0.5²)·π.
    let axes = [Axis::bounded(-7.0, 8.0, 31), Axis::bounded(-7.0, 7.0, 28)];
    let grid = Grid { axes: [axes[0], axes[1], Axis::periodic(0.0, TAU, 20)] };
    let volume = negative_volume(&grid, |index| {
        let [x, y, psi] = grid.node(index);
        hypot(x - 0.13, y + 0.21) - 5.0 - 0.5 * sin(psi)
    });
    let exact = TAU * PI * (25.0 + 0.125);
    eprintln!("volume of a breathing disc: {:+.1e}", volume / exact - 1.0);
    assert!((volume / exact - 1.0).abs() <= 1e-4, "{volume} {exact}");
}

/// Mean and largest |V exact| where the values of the nodes change sign along an edge
/// of the grid in x or y, at the zero of the linear interpolant, in units of `dx`.
fn zero_level_errors(
    grid: &Grid<3>,
    value: impl Fn([usize; 3]) -> f64,
    exact: impl Fn([f64; 3]) -> f64,
) -> Errors {
    let mut errors = Errors { nodes: 0, mean: 0.0, max: 0.0 };
    for position in 0..grid.len() {
        let index = grid.index(position);
        for axis in 0..2 {
            let mut next = index;
            next[axis] += 1;
            if next[axis] == grid.axes[axis].nodes {
                continue;
            }
            let (here, there) = (value(index), value(next));
            if (here <= 0.0) != (there <= 0.0) {
                let mut state = grid.node(index);
                state[axis] += grid.axes[axis].spacing() * here / (here - there);
                let error = exact(state).abs() / grid.axes[0].spacing();
                errors.nodes += 1;
                errors.mean += error;
                errors.max = errors.max.max(error);
            }
        }
    }
    errors.mean /= errors.nodes as f64;
    errors
}

/// Mitchell, Bayen and Tomlin 2005 (air3D), as peers solve it.
#[test]
fn the_pursuit_game_has_its_volume_and_its_zero_level() {
    let player = Player { speed_mps: 5.0, turn_rate_radps: 1.0 };
    let game = PursuitGame { evader: player, pursuer: player, radius_m: 5.0 };
    let exact = game.exact().expect("identical players");
    let axes = [
        Axis::bounded(-6.0, 20.0, 51),
        Axis::bounded(-10.0, 10.0, 40),
        Axis::periodic(0.0, TAU, 50),
    ];
    let target = |state| game.target(state);
    let dynamics = RelativeDubins(game);
    let problem = problem(&dynamics, axes, &target, (Kind::Tube, BACKWARD), 2.8);
    let grid = problem.grid;
    let report = |name: &str, value: &dyn Fn([usize; 3]) -> f64| {
        let volume = negative_volume(&grid, value) / 885.81943 - 1.0;
        let level = zero_level_errors(&grid, value, |state| exact.value(state));
        eprintln!(
            "air3D {name}: volume {:+.3} %, zero level mean {:.4} dx, max {:.3} dx, {} edges",
            100.0 * volume,
            level.mean,
            level.max,
            level.nodes
        );
        (volume, level)
    };
    let node = |index: [usize; 3]| (index[0] * axes[1].nodes + index[1]) * axes[2].nodes + index[2];
    // What the measures make of the exact values of the same nodes.
    let (volume, level) = report("exact", &|index| exact.value(grid.node(index)));
    assert!(volume.abs() <= 5e-4 && level.mean <= 0.01, "{volume} {level:?}");
    let of = |scheme| {
        let solution = solved::<f32, 3, _>(&problem, &settings(scheme));
        report(scheme.name(), &|index| f64::from(solution.values[node(index)]))
    };
    let (volume, level) = of(Scheme::Weno5);
    assert!(volume.abs() <= 1e-3 && level.mean <= 0.025, "{volume} {level:?}");
    for scheme in [Scheme::Upwind, Scheme::Eno2, Scheme::Eno3] {
        of(scheme);
    }
}

// ---- bad input --------------------------------------------------------------

/// A problem that can be solved in no time, to be spoilt by `spoil`.
fn refused(spoil: impl FnOnce(&mut Problem<'_, 2, Drift<2>>, &mut Settings)) -> Invalid {
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
    let start = std::time::Instant::now();
    let complaint = refused(|problem, settings| {
        for axis in &mut problem.grid.axes {
            axis.nodes = 10_000;
        }
        settings.memory_limit_bytes = 1 << 30;
    });
    // 10,006² nodes with ghosts, three stages and the target, four octets each.
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
    for limit in [0, Settings::of(Scheme::Upwind).memory_limit_bytes, u64::MAX - 1] {
        let settings = Settings { memory_limit_bytes: limit, ..settings(Scheme::Upwind) };
        let result = solve::<f64, 4, _>(&problem, &settings, &mut |_| ControlFlow::Break(()));
        let Err(SolveError::Invalid(complaint)) = result else { panic!("not refused") };
        eprintln!("{complaint}");
        assert!(complaint.found.contains("more than"), "{complaint}");
    }
    let waited = start.elapsed();
    assert!(waited.as_secs_f64() < 0.5, "{waited:?}");
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
    // The first node in the order of memory: x = −2 + 11·4/14, y = 7/3.
    let place = "[1.1428571428571428, 2.333333333333333]";
    let complaint = refused(|problem, _| problem.target = Region::Static(&hole));
    assert_eq!([&complaint.field, &complaint.found], ["target", &format!("NaN at {place}")]);
    let complaint = refused(|problem, _| problem.obstacle = Some(Region::Static(&hole)));
    assert_eq!([&complaint.field, &complaint.found], ["obstacle", &format!("NaN at {place}")]);
    // Beyond f32.
    let complaint = refused(|problem, _| problem.target = Region::Static(&huge));
    assert_eq!([&complaint.field, &complaint.found[..3]], ["target", "inf"]);
    let complaint = refused(|problem, _| problem.target = Region::Moving(&later));
    assert_eq!(complaint.field, "target");
    let complaint = refused(|problem, _| problem.obstacle = Some(Region::Moving(&later)));
    assert_eq!(complaint.field, "obstacle");
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
    ] {
        for kind in [Kind::Tube, Kind::Set] {
            let problem = problem(&game, axes, &target, (kind, BACKWARD), 0.2);
            let result = solve::<f64, 1, _>(&problem, &settings(Scheme::Eno2), &mut |_| {
                ControlFlow::Continue(())
            });
            let Err(SolveError::Invalid(complaint)) = result else { panic!("{game:?} solved") };
            assert_eq!(complaint.field, field, "{complaint}");
        }
    }
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

/// With |u| ≤ 1 all of [−2, 2] reaches the target's middle in 2 s; then nothing changes.
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

// ---- games that exist only here ---------------------------------------------

/// Speeds that turn from place to place, a minimising and a maximising player, and
/// a Hamiltonian that is neither convex nor concave; for the twin.
struct Twisted;

impl<const D: usize> Game<D> for Twisted {
    fn terms(&self, axis: usize, x: f64) -> [f64; TERMS] {
        let phase = 0.7 * axis as f64;
        [sin(x + phase), cos(2.0 * x - phase), 0.5 + 0.3 * sin(x - phase)]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        let mut sum = T::ZERO;
        let mut shared = T::ZERO;
        for (d, slope) in gradient.into_iter().enumerate() {
            let drift = terms[(d + 1) % D][0] + T::HALF * terms[d][1];
            sum += drift * slope - terms[d][2] * slope.abs();
            shared += terms[d][1] * slope;
        }
        sum + T::HALF * shared.abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; D]) -> [T; D] {
        core::array::from_fn(|d| {
            let drift = terms[(d + 1) % D][0] + T::HALF * terms[d][1];
            drift.abs() + terms[d][2] + T::HALF * terms[d][1].abs()
        })
    }
}

/// ẋ_d = drift_d + u_d with |u_d| ≤ speed_d; u minimises.
struct Drift<const D: usize> {
    drift: [f64; D],
    speed: [f64; D],
}

impl<const D: usize> Game<D> for Drift<D> {
    fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; D], gradient: [T; D]) -> T {
        let mut sum = T::ZERO;
        for (d, slope) in gradient.into_iter().enumerate() {
            let [drift, speed] = [self.drift[d], self.speed[d]].map(T::from_f64);
            sum += drift * slope - speed * slope.abs();
        }
        sum
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; D]) -> [T; D] {
        core::array::from_fn(|d| T::from_f64(self.drift[d].abs() + self.speed[d]))
    }
}

/// Two independent double integrators with accelerations up to `.0`: (x, v, y, w).
struct TwoMasses(f64);

impl Game<4> for TwoMasses {
    fn terms(&self, _axis: usize, x: f64) -> [f64; TERMS] {
        [x, 0.0, 0.0]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 4], p: [T; 4]) -> T {
        let a = T::from_f64(self.0);
        p[0] * terms[1][0] + p[2] * terms[3][0] - a * p[1].abs() - a * p[3].abs()
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 4]) -> [T; 4] {
        let a = T::from_f64(self.0);
        [terms[1][0].abs(), a, terms[3][0].abs(), a]
    }
}

/// H = −p²/2 with slopes up to 1.
struct Steepening;

impl Game<1> for Steepening {
    fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; 1], [p]: [T; 1]) -> T {
        -(T::HALF * p * p)
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; 1]) -> [T; 1] {
        [T::from_f64(1.0)]
    }
}

/// A game whose author made a mistake.
#[derive(Debug)]
struct Broken {
    bound: f64,
    rate: f64,
}

impl Game<1> for Broken {
    fn terms(&self, _axis: usize, _x: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }

    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _terms: &[[T; TERMS]; 1], [p]: [T; 1]) -> T {
        p * T::from_f64(self.rate)
    }

    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _terms: &[[T; TERMS]; 1]) -> [T; 1] {
        [T::from_f64(self.bound)]
    }
}
