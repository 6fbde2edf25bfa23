//! Large and small numbers in one problem.

use super::*;
use sidestep::reachability::{DoubleIntegrator, DubinsCar};

const CAR: DubinsCar = DubinsCar { speed_mps: 1.0, turn_rate_radps: (-1.0, 1.0) };
const SECONDS: f64 = 3.0;
/// Radius of the obstacle (m), which is a disc around (1.3, 0). The car drives to the origin.
const RADIUS: f64 = 0.5;
const HALF_SIDE: f64 = 3.0;

fn axes() -> [Axis; 3] {
    let side = Axis::bounded(-HALF_SIDE, HALF_SIDE, 31);
    [side, side, Axis::periodic(0.0, TAU, 20)]
}

fn target([x, y, _]: [f64; 3]) -> f64 {
    hypot(x, y) - 0.45
}

fn depth([x, y, _]: [f64; 3], more: f64) -> f64 {
    hypot(x - 1.3, y) - RADIUS - more
}

fn tube<T: Real>(
    target: &(dyn Fn([f64; 3]) -> f64 + Sync),
    avoid: &(dyn Fn([f64; 3]) -> f64 + Sync),
    scheme: Scheme,
) -> Solution<T, 3> {
    let problem = problem(&CAR, axes(), target, (Kind::Tube, BACKWARD), SECONDS)
        .with_avoid(Region::Static(avoid));
    solved(&problem, &Settings::new(scheme).with_threads(2).with_slices(2))
}

/// Number of cells by which an obstacle can seem larger if V jumps at its edge.
const CELLS: f64 = 3.0;

/// For any height of the obstacle function, the tube lies between two reference tubes. One is the
/// tube for the signed distance of the obstacle. The other is the tube for an obstacle that is
/// larger by a few cells, the width of a jump of V. A larger obstacle only shrinks the tube.
fn check_heights<T: Real>(scheme: Scheme, epsilon: f64) {
    let grid = Grid { axes: axes() };
    let cell = grid.axes[0].spacing();
    let distance = tube::<T>(&target, &|state| depth(state, 0.0), scheme);
    let larger = tube::<T>(&target, &|state| depth(state, CELLS * cell), scheme);
    let least = (0..grid.len()).map(|at| target(grid.node(grid.index(at)))).fold(1.0, f64::min);
    for exponent in [-9, -6, -3, 0, 1, 3, 5, 6, 9, 12] {
        let height: f64 = format!("1e{exponent}").parse().expect("a number");
        let disc = |state: [f64; 3]| if depth(state, 0.0) < 0.0 { -height } else { height };
        let found = tube::<T>(&target, &disc, scheme);
        let (mut wrong, mut outside) = (0, 0);
        for at in 0..grid.len() {
            let state = grid.node(grid.index(at));
            let [value, low, high] = [&found, &distance, &larger].map(|of| of.values[at].to_f64());
            let bounds = least.max(-disc(state))..=target(state).max(-disc(state));
            let slack = 1e-6 * bounds.end().abs().max(0.5);
            assert!(bounds.start() - slack <= value && value <= bounds.end() + slack, "{state:?}");
            outside += usize::from(value <= 0.0 && low > cell || value > cell && high <= 0.0);
            wrong += usize::from((value <= 0.0) != (low <= 0.0) && depth(state, 0.5) > 0.0);
        }
        let share = wrong as f64 / grid.len() as f64;
        eprintln!("{} {epsilon:.0e} 1e{exponent}: {share:.4} {outside} outside", scheme.name());
        // The error that a low wall causes is at most the height of the wall.
        if height >= 1.0 {
            assert!(outside == 0, "{scheme:?} {height}: {outside}");
            assert!(share < 0.025, "{scheme:?} {height}: {share}");
        }
    }
}

#[test]
fn an_obstacle_may_have_any_height() {
    for scheme in SCHEMES {
        check_heights::<f32>(scheme, f32::EPSILON.into());
        check_heights::<f64>(scheme, f64::EPSILON);
    }
}

/// Solves a game in the plane, with an optional obstacle. The target function is −0.5 at its
/// lowest. If the solver warns that V has become too flat, returns the lowest V and the lowest
/// value of the target function.
fn shallow(kind: Kind, avoid: Option<&(dyn Fn([f64; 2]) -> f64 + Sync)>) -> Option<[f64; 2]> {
    let axes = [Axis::bounded(-3.0, 3.0, 61), Axis::bounded(-2.0, 2.0, 41)];
    let game = Drift { drift: [0.0; 2], speed: [1.0; 2] };
    let target = |[x, y]: [f64; 2]| hypot(x, y) - 0.5;
    let problem = problem(&game, axes, &target, (kind, BACKWARD), 0.2);
    let problem = problem.with_avoid(avoid.map(Region::Static));
    let found: Solution<f64, 2> = solved(&problem, &settings(Scheme::Weno5));
    assert_eq!(Solution::from_npz(&found.npz().unwrap()).unwrap(), found);
    found.shallow.map(|shallow| {
        assert!(shallow.to_string().contains("or as an indicator at least as high"), "{shallow}");
        [shallow.lowest, shallow.target]
    })
}

#[test]
fn an_obstacle_that_leaves_little_of_v_is_told() {
    let distance = |[x, y]: [f64; 2]| hypot(x - 1.3, y) - 0.5;
    // Two walls with a corridor between them, 0.3 m on each side of the axis.
    let corridor = |[_, y]: [f64; 2]| 0.3 - y.abs();
    for kind in [Kind::Tube, Kind::Set] {
        let indicator = |height: f64| {
            let avoid = move |state| if distance(state) < 0.0 { -height } else { height };
            shallow(kind, Some(&avoid))
        };
        let scaled = |scale: f64| shallow(kind, Some(&move |state| scale * distance(state)));
        assert_eq!(indicator(1e-3), Some([-1e-3, -0.5]));
        assert_eq!(indicator(0.4), Some([-0.4, -0.5]));
        assert_eq!(scaled(0.05).map(|[_, target]| target), Some(-0.5));
        for told in [indicator(0.5), indicator(1.0), indicator(1e9), scaled(1.0), scaled(0.5)] {
            assert_eq!(told, None);
        }
        assert_eq!((shallow(kind, None), shallow(kind, Some(&corridor))), (None, None));
    }
}

/// Without a passage between walls, V far from the walls is as accurate as with a distance
/// function.
#[test]
fn one_low_wall_turns_few_signs() {
    let axes =
        [Axis::bounded(-5.0, 5.0, 41), Axis::bounded(-5.0, 5.0, 41), Axis::periodic(0.0, TAU, 32)];
    let target = |[x, y, _]: [f64; 3]| hypot(x, y) - 0.5;
    let disc = |[x, y, _]: [f64; 3]| hypot(x - 2.0, y) - 1.0;
    let tube = |avoid: &(dyn Fn([f64; 3]) -> f64 + Sync)| -> Solution<f32, 3> {
        let problem = problem(&CAR, axes, &target, (Kind::Tube, BACKWARD), 6.0);
        let problem = problem.with_avoid(Region::Static(avoid));
        solved(&problem, &Settings::new(Scheme::Weno5).with_threads(2))
    };
    let expected = tube(&disc);
    for (height, most) in [(0.5, 320), (1.0, 600)] {
        let found = tube(&|state| if disc(state) < 0.0 { -height } else { height });
        let is_wrong = |at: &usize| {
            let is_far = disc(found.grid.node(found.grid.index(*at))) >= 0.5;
            is_far && (found.values[*at] <= 0.0) != (expected.values[*at] <= 0.0)
        };
        let wrong = (0..found.values.len()).filter(is_wrong).count();
        eprintln!("{height}: {wrong}");
        assert!(wrong < most, "{height}: {wrong}");
    }
}

/// Let M be the maximum of |l|. Inside a wall that is higher than M, V is the height of the wall.
/// Outside it, V is the same as for a wall of height M, bit for bit, because max(l, min(g, M)) =
/// min(max(l, g), M). In some cases, the wall or the target moves.
#[test]
fn a_wall_above_the_target_is_as_good_as_any_other() {
    let side = |nodes| Axis::bounded(-3.0, 3.0, nodes);
    let axes = [side(41), Axis::bounded(-2.0, 2.0, 31)];
    let game = Drift { drift: [0.3, -0.2], speed: [1.0, 0.8] };
    let target = |[x, _]: [f64; 2], tau: f64| (x - 0.5 * tau).abs() - 0.5;
    let inside = |[x, y]: [f64; 2], tau: f64| hypot(x + 1.7 - 0.4 * tau, y + 0.1) < 0.44;
    let march = |height: f64, scheme, kind, moves: [bool; 2]| -> Solution<f32, 2> {
        let wall = |state, tau: f64| if inside(state, tau) { -height } else { height };
        let still_target = |state| target(state, 0.0);
        let still_wall = |state| wall(state, 0.0);
        let mut problem = problem(&game, axes, &still_target, (kind, BACKWARD), 0.7);
        if moves[0] {
            problem.target = Region::OfMarchTime(&target);
        }
        let avoid = if moves[1] { Region::OfMarchTime(&wall) } else { Region::Static(&still_wall) };
        solved(&problem.with_avoid(avoid), &Settings::new(scheme).with_slices(2))
    };
    let grid = Grid { axes };
    let cases = [Kind::Tube, Kind::Set].into_iter().flat_map(|kind| {
        [[false; 2], [false, true], [true, false], [true; 2]].map(|moves| (kind, moves))
    });
    for (kind, moves) in cases {
        for scheme in SCHEMES {
            // The maximum magnitude of a static target is 2.5.
            let low = march(if moves[0] { 4.0 } else { 2.5 }, scheme, kind, moves);
            for height in [10.0, 1e3, 1e6, 1e9, 1e30] {
                let high = march(height, scheme, kind, moves);
                let stored = low.earlier.iter().chain([&low.values]);
                let pairs = stored.zip(high.earlier.iter().chain([&high.values]));
                for (part, (low, high)) in pairs.enumerate() {
                    let tau = if moves[1] { 0.35 * part as f64 } else { 0.0 };
                    for (at, (low, high)) in low.iter().zip(high).enumerate() {
                        let state = grid.node(grid.index(at));
                        let right = if inside(state, tau) { height as f32 } else { *low };
                        assert!(*high == right, "{scheme:?} {kind:?} {moves:?} {state:?}");
                    }
                }
            }
        }
    }
}

/// An obstacle only raises V. States that are unreachable without walls must therefore stay
/// unreachable beside walls, around them, and in passages between them. The walls include discs,
/// and passages that are one or more nodes wide along either axis.
#[test]
fn no_wall_opens_a_way() {
    let axes = [Axis::bounded(-3.0, 3.0, 61), Axis::bounded(-2.0, 2.0, 41)];
    let game = DoubleIntegrator { acceleration_mps2: 1.0 };
    let target = |[x, _]: [f64; 2]| x.abs() - 0.5;
    let mut rng = SeededRng::new(11);
    for field in 0..24 {
        let (kind, seconds) = ([Kind::Tube, Kind::Set][field % 2], [0.3, 0.5][field / 2 % 2]);
        let [x0, y0] = [2.5, 1.0].map(|most| rng.uniform(-most, most));
        let (half, gap) = (rng.uniform(0.2, 0.6), rng.uniform(0.02, 0.2));
        let inside = |[x, y]: [f64; 2]| {
            let [x, y] = [x - x0, y - y0].map(f64::abs);
            match field % 3 {
                0 => x < half && y < half && y > gap,
                1 => y < half && x > gap && x < gap + 0.3,
                _ => hypot(x, y) < half,
            }
        };
        for scheme in SCHEMES {
            let solve = |height: Option<f64>| -> Solution<f32, 2> {
                let wall = |state| match height {
                    Some(height) if inside(state) => -height,
                    Some(height) => height,
                    None => 1.0,
                };
                let problem = problem(&game, axes, &target, (kind, BACKWARD), seconds);
                let avoid = height.map(|_| Region::Static(&wall));
                solved(&problem.with_avoid(avoid), &Settings::new(scheme))
            };
            let free = solve(None);
            for height in [1.0, 2.5, 10.0, 1e5, 1e9] {
                let found = solve(Some(height));
                let pairs = found.values.iter().zip(&free.values);
                let wrong = pairs.filter(|(found, free)| **found <= 0.0 && **free > 0.05).count();
                let lower = found.values.iter().zip(&free.values).map(|(found, free)| free - found);
                let lower = lower.fold(0.0, f32::max);
                eprintln!(
                    "{field} {kind:?} {} {height:e}: {wrong} wrong, at most {lower} too low",
                    scheme.name()
                );
                assert_eq!(wrong, 0, "{field} {kind:?} {scheme:?} {height}");
            }
        }
    }
}

/// A target {l ≤ 0}, given by a function that returns the minimum of l over the rectangle with this
/// centre and these half sides.
type Least = fn([f64; 2], [f64; 2]) -> f64;

/// Distance of `centre` from the interval of half width `half` around `x`.
fn gap(x: f64, half: f64, centre: f64) -> f64 {
    ((x - centre).abs() - half).max(0.0)
}

fn square(x: f64) -> f64 {
    x * x
}

/// Targets with a slope of 1, targets whose slope increases or differs by axis, and targets with a
/// low slope at the target and a high slope elsewhere.
const TARGETS: [Least; 6] = [
    |[x, _], [a, _]| gap(x, a, 0.0) - 0.5,
    |[x, y], [a, b]| hypot(gap(x, a, 0.0), gap(y, b, 0.0)) - 0.5,
    |[x, y], [a, b]| square(gap(x, a, -1.0)) + square(gap(y, b, 0.0)) - 0.16,
    |[x, y], [a, b]| square(gap(x, a, -1.0)) + 9.0 * square(gap(y, b, 0.0)) - 0.16,
    |[x, _], [a, _]| 10.0 * gap(x, a, 0.0) - 5.0,
    |[x, y], [a, b]| 0.1 * square(square(gap(x, a, 0.0)) + square(gap(y, b, 0.0))) - 0.05,
];

/// Number of random fields of walls, each with a random game.
const FIELDS: usize = 72;

/// A field of walls around its centre, in units of grid cells: corridors of one to four nodes along
/// both axes and diagonally, closed rooms, discs and scattered blocks.
struct Walls {
    shape: usize,
    free: f64,
    thick: f64,
    half: f64,
    slant: [f64; 2],
    scattered: u64,
}

impl Walls {
    const SHAPES: usize = 6;

    fn random(rng: &mut SeededRng, shape: usize) -> Self {
        let mut whole = || 1.0 + rng.below(4) as f64;
        let (free, thick) = (whole(), whole());
        let (sin, cos) = sin_cos(rng.uniform(0.0, TAU));
        let scattered = rng.below(1 << 60) as u64;
        Self { shape, free, thick, half: rng.uniform(3.0, 14.0), slant: [sin, cos], scattered }
    }

    fn contain(&self, [x, y]: [f64; 2]) -> bool {
        let wall = |z: f64| z.abs() > 0.5 * self.free && z.abs() <= 0.5 * self.free + self.thick;
        let [sin, cos] = self.slant;
        let (along, across) = (cos * x + sin * y, cos * y - sin * x);
        match self.shape {
            0 => x.abs() < self.half && wall(y),
            1 => y.abs() < self.half && wall(x),
            2 => along.abs() < self.half && wall(across),
            3 => wall(x.abs().max(y.abs())),
            4 => hypot(x, y) < 0.5 * self.half,
            _ => {
                let block = (7.0 * x.round() + 3.0 * y.round()).rem_euclid(60.0) as u64;
                x.abs().max(y.abs()) < self.half && (self.scattered >> block) & 3 == 0
            }
        }
    }
}

/// Like `no_wall_opens_a_way`, but for low walls beside targets whose slope is arbitrary and can
/// vary in space. Some walls move. For ẋ = c + u with |u_d| ≤ s_d, the states that can be reached
/// after τ ≤ T are in a rectangle around x + cτ whose half sides are s_d τ. The minimum of l over
/// these rectangles is a lower bound on V.
#[test]
fn no_wall_opens_a_way_beside_a_steep_target() {
    let mut rng = SeededRng::new(11);
    let (mut solves, mut close) = (0, 0);
    for field in 0..FIELDS {
        let axes = [Axis::bounded(-3.0, 3.0, 61), Axis::bounded(-2.0, 2.0, 31 + 10 * (field % 2))];
        let (grid, cells) = (Grid { axes }, axes.map(|axis| axis.spacing()));
        let least = TARGETS[field % TARGETS.len()];
        let mut either = |most: f64| rng.uniform(-most, most);
        let (middle, drift, speed) =
            ([either(2.6), either(1.7)], [either(0.7), either(0.7)], [either(0.8), either(0.8)]);
        let [drift, moves] = [
            if rng.below(3) == 0 { drift } else { [0.0; 2] },
            if rng.below(3) == 0 { speed } else { [0.0; 2] },
        ];
        let walls = Walls::random(&mut rng, field / TARGETS.len() % Walls::SHAPES);
        let speed = [[1.0, 1.0], [1.0, 0.3], [0.3, 1.0], [1.0, 0.0]][rng.below(4)];
        let game = Drift { drift, speed };
        let (kind, seconds) =
            ([Kind::Tube, Kind::Set][rng.below(2)], [0.2, 0.4, 0.8][rng.below(3)]);
        let inside = |x: [f64; 2], tau: f64| {
            let place = |d: usize| (x[d] - middle[d] - moves[d] * tau) / cells[d];
            walls.contain([place(0), place(1)])
        };
        let at = |x: [f64; 2], tau: f64| {
            let moved = core::array::from_fn(|d| x[d] + drift[d] * tau);
            least(moved, speed.map(|speed| speed * tau))
        };
        let free: Vec<f64> = (0..grid.len())
            .map(|at_node| {
                let x = grid.node(grid.index(at_node));
                let instants = if kind == Kind::Set { 100..=100 } else { 0..=100 };
                instants.map(|k| at(x, 0.01 * f64::from(k) * seconds)).fold(f64::INFINITY, f64::min)
            })
            .collect();
        // A front is accurate to half a cell, so the bound is half of the maximum difference
        // between the node and its neighbours.
        let close_to = |at: usize| {
            let index = grid.index(at);
            let mut most = 0.0_f64;
            for (d, along) in [grid.axes[1].nodes, 1].into_iter().enumerate() {
                let neighbours = [
                    (index[d] > 0, at.wrapping_sub(along)),
                    (index[d] + 1 < grid.axes[d].nodes, at + along),
                ];
                for (_, near) in neighbours.into_iter().filter(|(is_one, _)| *is_one) {
                    most = most.max((free[near] - free[at]).abs());
                }
            }
            0.5 * most
        };
        let target = |x| least(x, [0.0; 2]);
        for scheme in SCHEMES {
            let without: Solution<f32, 2> = solved(
                &problem(&game, axes, &target, (kind, BACKWARD), seconds),
                &Settings::new(scheme),
            );
            for height in [0.3, 1.0, 2.5] {
                let wall = |x, tau: f64| if inside(x, tau) { -height } else { height };
                let problem = problem(&game, axes, &target, (kind, BACKWARD), seconds)
                    .with_avoid(Region::OfMarchTime(&wall));
                let found: Solution<f32, 2> = solved(&problem, &Settings::new(scheme));
                solves += 1;
                for (at, value) in found.values.iter().enumerate() {
                    if *value <= 0.0 && free[at] > 0.0 && without.values[at] > 0.0 {
                        close += 1;
                        assert!(
                            free[at] <= close_to(at),
                            "{field} {kind:?} {scheme:?} {height:e}: {value} at {:?}, {} without",
                            grid.node(grid.index(at)),
                            free[at]
                        );
                    }
                }
            }
        }
    }
    eprintln!("{close} nodes in {solves} solves at the front");
}

fn check_equivariance<T: Real>(exponents: [i32; 4]) {
    let distance = |state| depth(state, 0.0);
    for scheme in SCHEMES {
        let once = tube::<T>(&target, &distance, scheme);
        for exponent in exponents {
            let factor = libm::ldexp(1.0, exponent);
            let scaled = tube::<T>(
                &|state| factor * target(state),
                &|state| factor * distance(state),
                scheme,
            );
            let mut pairs = once.values.iter().zip(&scaled.values);
            assert!(
                pairs.all(|(a, b)| factor * a.to_f64() == b.to_f64()),
                "{scheme:?} times 2^{exponent}"
            );
        }
    }
}

/// V(s l, s g) = s V(l, g), bit for bit if s is a power of two.
#[test]
fn units_of_v_do_not_matter() {
    check_equivariance::<f32>([-60, -1, 13, 90]);
    check_equivariance::<f64>([-400, -30, 3, 900]);
}
