//! Problems whose value is known in closed form, in one to four dimensions.

use super::*;

/// Error bound where V has a kink. The upwind scheme at speed 1 has the numerical diffusion D = Δx
/// (1 − cfl)/2. After T seconds, diffusion has raised max(y, 0) at y = 0 to √(D · T/π). In
/// addition, the bottom of a valley initially rises by half a cell. Higher-order schemes have
/// smaller errors at the end, and errors of at most two cells at any time.
pub(crate) fn kink_bound(dx: f64, cfl: f64, seconds: f64, scheme: Scheme) -> f64 {
    if scheme == Scheme::Upwind {
        0.5 * dx + (0.5 * dx * (1.0 - cfl) * seconds / PI).sqrt()
    } else {
        2.0 * dx
    }
}

/// The system ẋ = u with |u| ≤ 1 moves by at most T. The interval |x| ≤ r is therefore reached from
/// |x| ≤ r + T, and V = max(|x| − T, 0) − r. This holds forward and backward, for tubes and sets,
/// because the system can wait at the best place.
#[test]
fn an_interval_grows_at_full_speed() {
    let (game, radius) = (Drift { drift: [0.0], speed: [1.0] }, 0.5);
    let target = |[x]: [f64; 1]| x.abs() - radius;
    for kind in [Kind::Tube, Kind::Set] {
        for direction in [BACKWARD, FORWARD] {
            for scheme in SCHEMES {
                let axes = [Axis::bounded(-4.0, 4.0, 201)];
                let problem = problem(&game, axes, &target, (kind, direction), 1.5);
                // With a larger CFL number, the combination of two one-sided ENO2 stencils is
                // unstable.
                let settings = settings(scheme).with_cfl(0.5);
                let solution = solved::<f64, 1, _>(&problem, &settings);
                let exact = |[x]: [f64; 1]| (x.abs() - 1.5).max(0.0) - radius;
                let name = format!("interval {kind:?} {direction:?} {}", scheme.name());
                let all = errors(&name, &solution, |_| true, exact);
                let bound = kink_bound(solution.grid.axes[0].spacing(), 0.5, 1.5, scheme);
                // The edge of the set, at |x| = 2, and everything beyond it.
                let edge = |[x]: [f64; 1]| x.abs() > 1.99;
                let edge = errors(&format!("{name}, outside"), &solution, edge, exact);
                let edge_bound = if scheme == Scheme::Upwind { 2e-4 } else { 5e-6 };
                assert!(all.max <= bound && edge.max <= edge_bound, "{all:?} {edge:?}");
            }
        }
    }
}

/// ẋ = c on a circle, without players. Backward, V(x, T) = l(x + cT). Forward, V(x, T) = l(x − cT).
/// The profile travels around the circle one and a third times.
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

/// The minimum of |x(t)| at exactly time t, over |u| ≤ a. The input u moves the final position by at
/// most at²/2 in either direction.
pub(crate) fn least_distance([x, v]: [f64; 2], a: f64, t: f64) -> f64 {
    ((x + v * t).abs() - 0.5 * a * t * t).max(0.0)
}

/// The double integrator ẋ = v, v̇ = u, |u| ≤ a, and the strip |x| ≤ r. At exactly T, V = max(|x +
/// vT| − aT²/2, 0) − r. Within T, V is the minimum of this expression over t ≤ T. While x + vt
/// keeps its sign, |x + vt| − at²/2 is concave in t, so its minimum is at t = 0 or t = T. Where x +
/// vt changes sign, the maximum is 0. Forward, v is replaced by −v.
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
            // In this region, neither trajectories nor the smearing of a kink come near the ends of
            // the grid.
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

/// The minimum of |z(T)| for the double integrator, by the Hopf formula: the maximum over unit
/// vectors p of p·Φz − a ∫₀ᵀ |p₁ s + p₂| ds, or 0 if this maximum is negative. It is the distance
/// of Φz from the convex set of displacements that the input can compensate.
pub(crate) fn least_range([x, v]: [f64; 2], a: f64, t: f64) -> f64 {
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

/// The double integrator and the disc of radius r around the origin, at exactly T. {V ≤ −r} is the
/// set of states that reach the origin itself. It agrees with the textbook's minimum time to the
/// origin (bang-bang with one switch on x = −v|v|/2a).
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

/// Four single integrators with drift, ẋ_d = c_d + u_d, |u_d| ≤ s_d, and a ball. At T, V =
/// |(max(|x_d + c_d T| − s_d T, 0))_d| − r. Forward, c_d is replaced by −c_d.
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

/// Two double integrators, each of which must be in its strip at T. The inputs are independent, so
/// V is the larger of the two closed forms.
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

/// ẋ = u, |u| ≤ 1, with the target |x| ≤ r and an impassable wall of half width w around b. The
/// height of the wall is h(x) = w − |x − b|. Before the middle of the wall, V = max(max(|x| − T, 0)
/// − r, h(x)). Beyond the middle, every path to the target crosses the top of the wall, so V =
/// max(x − T − r, w) if T is long enough to reach the top.
#[test]
fn a_wall_keeps_off_what_lies_behind_it() {
    let (radius, width, wall, seconds) = (0.5, 0.5, 2.0, 3.0);
    let game = Drift { drift: [0.0], speed: [1.0] };
    let target = |[x]: [f64; 1]| x.abs() - radius;
    let height = |[x]: [f64; 1]| width - (x - wall).abs();
    let depth = |state: [f64; 1]| -height(state);
    let exact = |[x]: [f64; 1]| {
        let free = (x.abs() - seconds).max(0.0) - radius;
        free.max(if x < wall { height([x]) } else { width })
    };
    for scheme in SCHEMES {
        let axes = [Axis::bounded(-5.0, 5.0, 251)];
        let problem = problem(&game, axes, &target, (Kind::Tube, BACKWARD), seconds)
            .with_avoid(Region::Static(&depth));
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
        // The set extends from −3.5, on the side without a wall, to the wall at 1.5. Nothing comes
        // through the wall.
        let edge_bound = if scheme == Scheme::Upwind { 2e-4 } else { 1e-4 };
        assert!(within("free edge", -4.5, -3.4) <= edge_bound);
        assert!(within("edge at the wall", 1.4, 1.9) <= 1e-12);
        assert!(within("behind", 2.4, 3.6) <= 0.5 * dx);
    }
}

/// ẋ = u, |u| ≤ 1, and an interval that moves at c > 1, faster than x can. At time τ before the
/// end, l = |x − cτ| − r. A state that the interval sweeps over meets it without moving. Any other
/// state is closest to the interval at the beginning or at the end. Therefore V = max(−x − T, x −
/// cT, 0) − r.
#[test]
fn a_moving_interval_is_met() {
    let (radius, speed, seconds) = (0.5, 1.25, 1.5);
    let game = Drift { drift: [0.0], speed: [1.0] };
    let target = |[x]: [f64; 1], time: f64| (x - speed * time).abs() - radius;
    let exact = |[x]: [f64; 1]| (-x - seconds).max(x - speed * seconds).max(0.0) - radius;
    for scheme in SCHEMES {
        let grid = Grid { axes: [Axis::bounded(-4.0, 5.0, 226)] };
        let target = Region::OfMarchTime(&target);
        let problem = Problem::new(&game, grid, target, Horizon::Finite(seconds));
        let solution = solved::<f64, 1, _>(&problem, &settings(scheme));
        let dx = solution.grid.axes[0].spacing();
        let all = errors(&format!("meeting {}", scheme.name()), &solution, |_| true, exact);
        let within = |name: &str, low: f64, high: f64| {
            let name = format!("meeting {} {name}", scheme.name());
            errors(&name, &solution, |[x]: [f64; 1]| low < x && x < high, exact).max
        };
        assert!(all.max <= kink_bound(dx, settings(scheme).cfl, seconds, scheme), "{all:?}");
        // The edges of the set are at −2 and 2.375. Ahead of the interval, V equals the target
        // function at every stage of a time step.
        assert!(within("behind", -4.5, -1.9) <= 5e-5);
        assert!(within("ahead", 2.275, 4.5) <= 1e-12);
    }
}
