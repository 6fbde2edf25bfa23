//! Throw-away: counts wrong nodes, accuracy, bits, speed.
use core::ops::ControlFlow;
use sidestep::math::{SeededRng, TAU, hypot};
use sidestep::reachability::cartesian::{Kind, Problem, Region, Settings, Solution, solve};
use sidestep::reachability::{
    Axis, Boundary, DoubleIntegrator, DubinsCar, Game, Grid, Real, Scheme, TERMS,
};

const SCHEMES: [Scheme; 4] = [Scheme::Upwind, Scheme::Eno2, Scheme::Eno3, Scheme::Weno5];

struct Free {
    drift: [f64; 2],
    speed: [f64; 2],
}
impl Game<2> for Free {
    fn terms(&self, _: usize, _: f64) -> [f64; TERMS] {
        [0.0; TERMS]
    }
    #[inline(always)]
    fn hamiltonian<T: Real>(&self, _: &[[T; TERMS]; 2], p: [T; 2]) -> T {
        let mut sum = T::ZERO;
        for d in 0..2 {
            sum += T::from_f64(self.drift[d]) * p[d] - T::from_f64(self.speed[d]) * p[d].abs();
        }
        sum
    }
    #[inline(always)]
    fn speed_bounds<T: Real>(&self, _: &[[T; TERMS]; 2]) -> [T; 2] {
        core::array::from_fn(|d| T::from_f64(self.drift[d].abs() + self.speed[d]))
    }
}

fn run<T: Real, const D: usize, G: Game<D>>(
    p: &Problem<'_, D, G>,
    s: &Settings,
) -> Option<Solution<T, D>> {
    match solve(p, s, &mut |_| ControlFlow::Continue(())) {
        Ok(solution) => Some(solution),
        Err(e) => {
            let e = e.to_string();
            if !e.contains("covers all") {
                eprintln!("ERR {e}");
            }
            None
        }
    }
}

/// Convex, separable about a centre.
fn targets(k: usize, [x, y]: [f64; 2]) -> f64 {
    match k {
        0 => x.abs() - 0.5,
        1 => hypot(x, y) - 0.5,
        2 => (x + 1.0) * (x + 1.0) + y * y - 0.16,
        3 => (10.0 * x).abs() - 5.0,
        4 => (x + 1.0) * (x + 1.0) + 0.04 * y * y - 0.16,
        5 => (x + 1.0) * (x + 1.0) + 9.0 * y * y - 0.16,
        6 => (0.2 * (x + 0.5)).abs().max(3.0 * y.abs()) - 0.3,
        7 => {
            let r = hypot(x, y);
            r * r * r * r * 0.1 - 0.05
        }
        _ => unreachable!(),
    }
}
const CENTRES: [[f64; 2]; 8] =
    [[0.0; 2], [0.0; 2], [-1.0, 0.0], [0.0; 2], [-1.0, 0.0], [-1.0, 0.0], [-0.5, 0.0], [0.0; 2]];

fn free_value(k: usize, game: &Free, [x, y]: [f64; 2], seconds: f64, kind: Kind) -> f64 {
    let at = |t: f64| {
        let c = CENTRES[k];
        let near = |d: usize, z: f64| {
            let m = z + game.drift[d] * t;
            c[d].clamp(m - game.speed[d] * t, m + game.speed[d] * t)
        };
        targets(k, [near(0, x), near(1, y)])
    };
    let waits = game.drift.iter().zip(game.speed).all(|(c, s)| c.abs() <= s);
    if kind == Kind::Set || waits && false {
        return at(seconds);
    }
    (0..=100).map(|i| at(seconds * f64::from(i) / 100.0)).fold(f64::INFINITY, f64::min)
}

fn exact_room(k: usize, x: [f64; 2], r: f64) -> f64 {
    let near = |d: usize| CENTRES[k][d].clamp(x[d] - r, x[d] + r);
    targets(k, [near(0), near(1)])
}

#[derive(Default, Clone, Copy, Debug)]
struct Count {
    solves: usize,
    bad: usize,
    nodes: usize,
    clear_bad: usize,
    clear: usize,
    edge: usize,
    room: usize,
    low: f64,
}

fn hunt(seed: u64, fields: usize) {
    let mut rng = SeededRng::new(seed);
    let mut counts = [[Count::default(); 8]; 4];
    let mut by_height = [[0usize; 6]; 4];
    let heights = [0.3, 1.0, 2.5, 10.0, 1e5, 1e30];
    for field in 0..fields {
        let n = [[61, 41], [41, 61], [50, 30]][rng.below(3) as usize];
        let axes = [Axis::bounded(-3.0, 3.0, n[0]), Axis::bounded(-2.0, 2.0, n[1])];
        let grid = Grid { axes };
        let h = axes.map(|a| a.spacing());
        let k = field % 8;
        let kind = [Kind::Tube, Kind::Set][rng.below(2) as usize];
        let moving = rng.below(3) == 0;
        let v = if moving { [rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8)] } else { [0.0; 2] };
        let drifts = rng.below(3) == 0;
        let game = Free {
            drift: if drifts { [rng.uniform(-0.7, 0.7), rng.uniform(-0.7, 0.7)] } else { [0.0; 2] },
            speed: [[1.0, 1.0], [1.0, 0.3], [0.3, 1.0], [1.0, 0.0]][rng.below(4) as usize],
        };
        let seconds = [0.2, 0.4, 0.8][rng.below(3) as usize];
        // walls: shape
        let shape = rng.below(6);
        let center = [rng.uniform(-2.6, 2.6), rng.uniform(-1.7, 1.7)];
        let gap = 1.0 + rng.below(4) as f64;
        let thick = 1.0 + rng.below(4) as f64;
        let long = rng.uniform(3.0, 14.0);
        let salt: Vec<bool> = (0..4000).map(|_| rng.uniform(0.0, 1.0) < 0.35).collect();
        let angle = rng.uniform(0.0, TAU);
        let inside = |[x, y]: [f64; 2], tau: f64| {
            let (x, y) = (x - v[0] * tau, y - v[1] * tau);
            let a = [(x - center[0]) / h[0], (y - center[1]) / h[1]];
            match shape {
                // corridors along x and y
                0 => a[0].abs() < long && a[1].abs() > 0.5 * gap && a[1].abs() <= 0.5 * gap + thick,
                1 => a[1].abs() < long && a[0].abs() > 0.5 * gap && a[0].abs() <= 0.5 * gap + thick,
                2 => hypot(a[0], a[1]) < 0.5 * long,
                // a cell with 4 walls
                3 => {
                    a[0].abs() <= 0.5 * gap + thick
                        && a[1].abs() <= 0.5 * gap + thick
                        && !(a[0].abs() < 0.5 * gap && a[1].abs() < 0.5 * gap)
                }
                // salt
                4 => {
                    let i = (a[0].round() + 200.0) as usize;
                    let j = (a[1].round() + 200.0) as usize;
                    a[0].abs() < long && a[1].abs() < long && salt[(i * 61 + j * 7) % 4000]
                }
                // slanted corridor
                _ => {
                    let (c, s) = (libm::cos(angle), libm::sin(angle));
                    let (p, q) = (c * a[0] + s * a[1], -s * a[0] + c * a[1]);
                    p.abs() < long && q.abs() > 0.5 * gap && q.abs() <= 0.5 * gap + thick
                }
            }
        };
        let target = |state: [f64; 2]| targets(k, state);
        let exact: Vec<f64> = (0..grid.len())
            .map(|at| free_value(k, &game, grid.node(grid.index(at)), seconds, kind))
            .collect();
        for (s, scheme) in SCHEMES.into_iter().enumerate() {
            let settings = Settings::new(scheme).with_threads(1);
            let base = Problem::reach(&game, grid, &target, seconds).with_kind(kind);
            let free = run::<f32, 2, _>(&base, &settings).unwrap();
            for (hi, height) in heights.into_iter().enumerate() {
                let wall =
                    |state: [f64; 2], tau: f64| if inside(state, tau) { -height } else { height };
                let still = |state: [f64; 2]| wall(state, 0.0);
                let region =
                    if moving { Region::OfMarchTime(&wall) } else { Region::Static(&still) };
                let problem = Problem::reach(&game, grid, &target, seconds)
                    .with_kind(kind)
                    .with_avoid(region);
                let Some(found) = run::<f32, 2, _>(&problem, &settings) else { continue };
                let c = &mut counts[s][k];
                c.solves += 1;
                let (mut wrong, mut clear) = (0, 0);
                for at in 0..grid.len() {
                    let index = grid.index(at);
                    let (v, e, f) =
                        (f64::from(found.values[at]), exact[at], f64::from(free.values[at]));
                    let near = |d: usize, up: bool| {
                        let mut i = index;
                        if up {
                            if i[d] + 1 >= n[d] {
                                return exact[at];
                            }
                            i[d] += 1
                        } else {
                            if i[d] == 0 {
                                return exact[at];
                            }
                            i[d] -= 1
                        }
                        exact[i[0] * n[1] + i[1]]
                    };
                    let cell = [near(0, true), near(0, false), near(1, true), near(1, false)]
                        .into_iter()
                        .fold(0.0_f64, |m, x| m.max((x - e).abs()));
                    c.low = c.low.max((e.min(f) - v) / cell.max(0.02));
                    // A closed room that does not move, from which nobody gets out.
                    let a = [0, 1].map(|d| ((grid.node(index)[d] - center[d]) / h[d]).abs());
                    if shape == 3 && !moving && a[0] < 0.5 * gap && a[1] < 0.5 * gap {
                        let r = gap * hypot(h[0], h[1]);
                        let least = exact_room(k, grid.node(index), r);
                        if v <= 0.0 && least > 0.0 {
                            c.room += 1;
                        }
                    }
                    if v <= 0.0 && e > 0.0 && f > 0.0 {
                        wrong += 1;
                    }
                    if v <= 0.0 && e > 0.5 * cell && f > 0.0 {
                        clear += 1;
                        let out = (0..2).any(|d| index[d] < 4 || index[d] + 5 > n[d]);
                        c.edge += usize::from(out);
                    }
                }
                c.bad += usize::from(wrong > 0);
                c.nodes += wrong;
                c.clear += clear;
                c.clear_bad += usize::from(clear > 0);
                by_height[s][hi] += usize::from(clear > 0);
                if clear > 0 && std::env::var("SHOW").is_ok() {
                    println!(
                        "field {field} {} k{k} {kind:?} shape {shape} height {height:e} moving {moving} drift {drifts} gap {gap} thick {thick} T {seconds}: {clear} clear",
                        scheme.name()
                    );
                }
            }
        }
    }
    for (s, scheme) in SCHEMES.into_iter().enumerate() {
        let all = counts[s].iter().fold(Count::default(), |a, b| Count {
            solves: a.solves + b.solves,
            bad: a.bad + b.bad,
            nodes: a.nodes + b.nodes,
            clear_bad: a.clear_bad + b.clear_bad,
            clear: a.clear + b.clear,
            edge: a.edge + b.edge,
            room: a.room + b.room,
            low: a.low.max(b.low),
        });
        println!("{:7} {all:?} by height {:?}", scheme.name(), by_height[s]);
        for (k, c) in counts[s].iter().enumerate() {
            println!(
                "        k{k}: solves {} wrong solves {} nodes {} | clear solves {} nodes {} edge {} | low {:.2} cells",
                c.solves, c.bad, c.nodes, c.clear_bad, c.clear, c.edge, c.low
            );
        }
    }
}

fn accuracy() {
    // A disc as a distance, single integrator with a drift; a small disc; a double integrator.
    for case in 0..5 {
        let avoid = |[x, y]: [f64; 2]| match case {
            0 => hypot(x - 1.2, y - 0.2) - 0.6,
            1 => hypot(x - 1.2, y - 0.2) - 0.2,
            2 => hypot(x + 1.0, y - 0.3) - 0.5,
            3 => ((x - 1.2).abs() - 0.3).max((y - 0.2).abs() - 0.5),
            _ => {
                2.0 * (1.0 - (-3.0 * hypot(x - 1.2, y - 0.2) * hypot(x - 1.2, y - 0.2)).exp()) - 1.0
            }
        };
        let target = |[x, y]: [f64; 2]| hypot(x, y) - 0.4;
        let at = |nodes: usize, scheme: Scheme, with: bool| -> Solution<f32, 2> {
            let axes = [Axis::bounded(-3.0, 3.0, nodes), Axis::bounded(-3.0, 3.0, nodes)];
            let settings = Settings::new(scheme).with_threads(2);
            if case == 2 {
                let game = DoubleIntegrator { acceleration_mps2: 1.0 };
                let p = Problem::reach(&game, Grid { axes }, &target, 1.0);
                let p = if with { p.with_avoid(Region::Static(&avoid)) } else { p };
                run(&p, &settings).unwrap()
            } else {
                let game = Free { drift: [0.2, -0.1], speed: [1.0, 1.0] };
                let p = Problem::reach(&game, Grid { axes }, &target, 1.5);
                let p = if with { p.with_avoid(Region::Static(&avoid)) } else { p };
                run(&p, &settings).unwrap()
            }
        };
        let fine = at(481, Scheme::Weno5, true);
        for scheme in SCHEMES {
            for nodes in [31, 61, 121] {
                let coarse = at(nodes, scheme, true);
                let step = 480 / (nodes - 1);
                let (mut max, mut sum, mut signs) = (0.0_f64, 0.0, 0);
                for i in 0..nodes {
                    for j in 0..nodes {
                        let (a, b): (f32, f32) =
                            (coarse.values[i * nodes + j], fine.values[i * step * 481 + j * step]);
                        let (a, b) = (f64::from(a), f64::from(b));
                        max = max.max((a - b).abs());
                        sum += (a - b).abs();
                        signs += usize::from((a <= 0.0) != (b <= 0.0));
                    }
                }
                println!(
                    "case {case} {:7} {nodes:4}: max {max:.4e} mean {:.4e} signs {signs}",
                    scheme.name(),
                    sum / (nodes * nodes) as f64
                );
            }
        }
    }
    // 1-D wall with a closed form
}

fn fold<T: Real>(hash: &mut u64, values: &[T]) {
    for v in values {
        *hash = (*hash ^ v.to_f64().to_bits()).wrapping_mul(0x0100_0000_01b3).rotate_left(23);
    }
}

fn bits() {
    for scheme in SCHEMES {
        let mut hash = 0xcbf2_9ce4_8422_2325;
        let settings = Settings::new(scheme).with_threads(2).with_slices(2);
        for kind in [Kind::Tube, Kind::Set] {
            for boundary in [Boundary::Extrapolate, Boundary::Constant] {
                let axes = [Axis::bounded(-3.0, 2.7, 73), Axis::bounded(-2.0, 2.0, 41)]
                    .map(|a| a.with_boundary(boundary));
                for k in 0..8 {
                    let target = |state: [f64; 2]| targets(k, state);
                    let game = Free { drift: [0.2, -0.6], speed: [1.0, 0.4] };
                    let p = Problem::reach(&game, Grid { axes }, &target, 1.1).with_kind(kind);
                    fold(&mut hash, &run::<f32, 2, _>(&p, &settings).unwrap().values);
                    fold(&mut hash, &run::<f64, 2, _>(&p, &settings).unwrap().values);
                    let game = DoubleIntegrator { acceleration_mps2: 1.0 };
                    let p = Problem::reach(&game, Grid { axes }, &target, 1.1).with_kind(kind);
                    fold(&mut hash, &run::<f32, 2, _>(&p, &settings).unwrap().values);
                }
            }
        }
        let car = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
        let side = Axis::bounded(-3.0, 3.0, 31);
        let target = |[x, y, _]: [f64; 3]| hypot(x, y) - 0.45;
        let p = Problem::reach(
            &car,
            Grid { axes: [side, side, Axis::periodic(0.0, TAU, 20)] },
            &target,
            2.0,
        );
        fold(&mut hash, &run::<f32, 3, _>(&p, &settings).unwrap().values);
        println!("{:7} {hash:016x}", scheme.name());
    }
}

fn speed(nodes: usize) {
    let car = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
    let side = Axis::bounded(-3.0, 3.0, nodes);
    let target = |[x, y, _]: [f64; 3]| hypot(x, y) - 0.45;
    let far = |[x, y, _]: [f64; 3]| hypot(x - 1.3, y) - 0.5;
    for scheme in [Scheme::Weno5, Scheme::Eno2, Scheme::Eno3] {
        for with in [false, true] {
            let p = Problem::reach(
                &car,
                Grid { axes: [side, side, Axis::periodic(0.0, TAU, nodes)] },
                &target,
                0.35,
            );
            let p = if with { p.with_avoid(Region::Static(&far)) } else { p };
            let settings = Settings::new(scheme).with_threads(1);
            let begin = std::time::Instant::now();
            let steps = run::<f32, 3, _>(&p, &settings).unwrap().steps;
            let s = begin.elapsed().as_secs_f64();
            println!(
                "{} {} {:.4}",
                scheme.name(),
                if with { "with" } else { "without" },
                s / (steps * scheme.stages()) as f64
            );
        }
    }
}

fn heights(nodes: usize) {
    let car = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
    let side = Axis::bounded(-3.0, 3.0, nodes);
    let axes = [side, side, Axis::periodic(0.0, TAU, 2 * nodes / 3)];
    let grid = Grid { axes };
    let dx = 6.0 / (nodes - 1) as f64;
    let target = |[x, y, _]: [f64; 3]| hypot(x, y) - 0.45;
    let depth = |[x, y, _]: [f64; 3], more: f64| hypot(x - 1.3, y) - 0.5 - more;
    let mut best: Option<Solution<f32, 3>> = None;
    for scheme in [Scheme::Weno5, Scheme::Upwind, Scheme::Eno2, Scheme::Eno3] {
        let tube = |avoid: &(dyn Fn([f64; 3]) -> f64 + Sync)| {
            let p = Problem::reach(&car, grid, &target, 3.0).with_avoid(Region::Static(avoid));
            run::<f32, 3, _>(&p, &Settings::new(scheme).with_threads(2)).unwrap()
        };
        let distance = tube(&|s| depth(s, 0.0));
        if best.is_none() {
            best = Some(tube(&|s| depth(s, 0.0)));
        }
        let best = best.as_ref().unwrap();
        let larger = tube(&|s| depth(s, 3.0 * dx));
        for height in [1.0, 10.0] {
            let found = tube(&|s| if depth(s, 0.0) < 0.0 { -height } else { height });
            let (mut wrong, mut outside, mut more, mut less) = (0_i32, 0, 0_i32, 0_i32);
            for at in 0..grid.len() {
                let s = grid.node(grid.index(at));
                let [v, low, high] =
                    [&found, &distance, &larger].map(|of| f64::from(of.values[at]));
                outside += usize::from(v <= 0.0 && low > dx || v > dx && high <= 0.0);
                let b = f64::from(best.values[at]);
                if depth(s, 0.5) > 0.0 {
                    more += i32::from(v <= 0.0 && b > 0.0);
                    less += i32::from(v > 0.0 && b <= 0.0);
                }
                wrong += i32::from((v <= 0.0) != (low <= 0.0) && depth(s, 0.5) > 0.0);
            }
            let share = |n: i32| f64::from(n) / grid.len() as f64;
            println!(
                "{} {height}: {:.4} outside {outside} against weno5 distance: more {:.4} less {:.4}",
                scheme.name(),
                share(wrong),
                share(more),
                share(less)
            );
        }
    }
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let number = |i: usize, default: u64| args.get(i).map_or(default, |a| a.parse().unwrap());
    match args[1].as_str() {
        "hunt" => hunt(number(2, 1), number(3, 200) as usize),
        "accuracy" => accuracy(),
        "bits" => bits(),
        "heights" => heights(number(2, 31) as usize),
        "speed" => speed(number(2, 101) as usize),
        _ => panic!("?"),
    }
}
