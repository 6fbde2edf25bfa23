//! The solver, compared with a plain reimplementation (twin).

use super::*;
use core::cell::{Cell, RefCell};

/// The solver's method, written straight from the textbooks: node by node, in f64, with the printed
/// formulas (Osher and Fedkiw 2003, sections 3.2–3.5 and 5.3; Shu and Osher 1988).
pub(crate) struct Twin<'a, const D: usize, G> {
    pub(crate) problem: &'a Problem<'a, D, G>,
    /// The obstacle, whose function is negative inside.
    pub(crate) avoid: Option<Region<'a, D>>,
    pub(crate) scheme: Scheme,
    /// The minimum and the maximum of the target so far.
    pub(crate) seen: Cell<[f64; 2]>,
    /// The steepest slope of the target.
    pub(crate) slope: Cell<f64>,
    /// Whether the obstacle has had a jump so far.
    pub(crate) jumps: Cell<bool>,
    /// How close each node is to a jump whose height the slope hides: 8 at the jump, decreasing by
    /// one per cell. Empty if there are no such jumps.
    pub(crate) near: RefCell<Vec<f64>>,
}

impl<const D: usize, G: Game<D>> Twin<'_, D, G> {
    /// The value at `index`, shifted by `offset` nodes along `axis`. Includes ghost nodes.
    fn at(&self, value: &[f64], mut index: [usize; D], axis: usize, offset: isize) -> f64 {
        let grid = &self.problem.grid;
        let Axis { nodes, boundary, .. } = grid.axes[axis];
        let moved = index[axis] as isize + offset;
        let mut inside = |i: isize| {
            index[axis] = i as usize;
            value[index.iter().enumerate().fold(0, |n, (d, i)| n * grid.axes[d].nodes + i)]
        };
        let last = nodes as isize - 1;
        let ([end, before, deeper], distance) = match boundary {
            Boundary::Periodic => return inside(moved.rem_euclid(nodes as isize)),
            Boundary::Extrapolate if moved < 0 => ([0, 1, 2].map(inside), -moved),
            Boundary::Extrapolate if moved > last => {
                ([last, last - 1, last - 2].map(inside), moved - last)
            }
            Boundary::Constant => return inside(moved.clamp(0, last)),
            Boundary::Extrapolate => return inside(moved),
            _ => unreachable!("the twin has no {boundary:?}"),
        };
        let (mut slope, next) = ((end - before).abs(), before - deeper);
        if self.jumps.get() && end < 0.0 {
            // Use the smaller of the two slopes at the edge.
            slope = if (end > before) == (before > deeper) { slope.min(next.abs()) } else { 0.0 };
        }
        end + distance as f64 * slope * if end < 0.0 { -1.0 } else { 1.0 }
    }

    /// Whether the derivative at the face between the nodes `before` and `before` + 1, counted from
    /// `index`, is first order because V jumps there.
    fn is_plain(&self, value: &[f64], index: [usize; D], axis: usize, before: isize) -> bool {
        let v: [f64; 6] =
            core::array::from_fn(|k| self.at(value, index, axis, before + k as isize - 2));
        let differences = |v: &[f64]| v.windows(2).map(|v| v[1] - v[0]).collect::<Vec<_>>();
        let first = differences(&v);
        let second = differences(&first);
        let quarter = 0.25 * first.iter().fold(0.0_f64, |most, d| most.max(d.abs()));
        let has = |sign: f64| second.iter().any(|a| sign * a > quarter);
        let is_rough = differences(&second).iter().any(|a| a.abs() > quarter);
        let near = self.near.borrow();
        let is_near = |k| self.at(&near, index, axis, k) > 0.0;
        let in_stencil = match self.scheme {
            Scheme::Upwind => return false,
            Scheme::Eno2 => &first[1..4],
            _ => &first[..],
        };
        let is_steep = in_stencil.iter().any(|d| d.abs() > self.steep(axis));
        self.avoid.is_some() && is_steep
            || !near.is_empty()
                && (has(1.0) && has(-1.0)
                    || (is_near(before) || is_near(before + 1))
                        && first[2].abs() < quarter
                        && is_rough)
    }

    /// Differences along `axis` above this value are far steeper than the target.
    fn steep(&self, axis: usize) -> f64 {
        4.0 * self.slope.get() * self.problem.grid.axes[axis].spacing()
    }

    /// Finds jumps, and marks the jumps at passages. The obstacle at `time` is first clamped to the
    /// target's values. At a jump, the obstacle function changes between two neighbours by more
    /// than a quarter of its range, and by more than four times the changes on both sides.
    fn look(&self, time: f64) {
        let (grid, Some(avoid)) = (&self.problem.grid, &self.avoid) else { return };
        if self.problem.kind == Kind::Tube {
            self.see(&self.sampled(&self.problem.target, time));
        }
        let [low, high] = self.seen.get();
        let largest = low.abs().max(high.abs());
        let floor = self.sampled(avoid, time).into_iter().map(|g| (-g).min(largest).max(low));
        let floor: Vec<f64> = floor.collect();
        let range = floor.iter().fold(low, |most, g| most.max(*g))
            - floor.iter().fold(largest, |least, g| least.min(*g));
        let mut near = self.near.borrow_mut();
        let mut jumps = vec![0.0; grid.len()];
        for (position, jump) in jumps.iter_mut().enumerate() {
            for d in 0..D {
                let at = |k: isize| neighbour(grid, position, d, k).map(|at| floor[at]);
                let rise = |k: isize| at(k).zip(at(k + 1)).map_or(0.0, |(a, b)| b - a);
                let is_jump = |k: isize| {
                    let beside = [k - 1, k + 1].map(|beside| rise(beside) * rise(k).signum());
                    let is_steep = beside.iter().all(|beside| rise(k).abs() > 4.0 * beside);
                    rise(k).abs() > 0.25 * range && is_steep
                };
                // Whether another wall, or the end of the grid, is within six nodes of the foot of
                // this wall.
                let is_passage = |k: isize| {
                    (1..=6).any(|nodes| {
                        let other = if rise(k) > 0.0 { k - nodes } else { k + nodes };
                        let is_end = at(other).is_none() || at(other + 1).is_none();
                        is_end || is_jump(other) && rise(other) * rise(k) < 0.0
                    })
                };
                for k in [-1, 0] {
                    if is_jump(k) {
                        self.jumps.set(true);
                        let height = at(k).into_iter().chain(at(k + 1)).fold(low, f64::max);
                        if height <= self.steep(d) && is_passage(k) {
                            *jump = 8.0;
                        }
                    }
                }
            }
        }
        if near.is_empty() {
            if !jumps.contains(&8.0) {
                return;
            }
            near.resize(jumps.len(), 0.0);
        }
        for (near, jump) in near.iter_mut().zip(jumps) {
            *near = near.max(jump);
        }
        for _ in 0..8 {
            let last = near.clone();
            for (position, near) in near.iter_mut().enumerate() {
                for (d, k) in (0..D).flat_map(|d| [(d, -1), (d, 1)]) {
                    if let Some(at) = neighbour(grid, position, d, k) {
                        *near = near.max(last[at] - 1.0);
                    }
                }
            }
        }
    }

    fn see(&self, target: &[f64]) {
        let [low, high] = self.seen.get();
        let fold = |from: f64, pick: fn(f64, f64) -> f64| target.iter().copied().fold(from, pick);
        self.seen.set([fold(low, f64::min), fold(high, f64::max)]);
    }

    /// The left and the right derivative along `axis`.
    fn slopes(&self, value: &[f64], index: [usize; D], axis: usize) -> [f64; 2] {
        let h = self.problem.grid.axes[axis].spacing();
        let v = |i: isize| self.at(value, index, axis, i);
        // Divided differences in the book's numbering, with the node itself at 0.
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
        let slopes = match self.scheme {
            Scheme::Upwind => [eno(1, -1), eno(1, 0)],
            Scheme::Eno2 => [eno(2, -1), eno(2, 0)],
            Scheme::Eno3 => [eno(3, -1), eno(3, 0)],
            Scheme::Weno5 => {
                [Self::weno([-3, -2, -1, 0, 1].map(d1)), Self::weno([2, 1, 0, -1, -2].map(d1))]
            }
            scheme => unreachable!("the twin has no {scheme:?}"),
        };
        let either = |side: usize, before: isize| {
            if self.is_plain(value, index, axis, before) { d1(before) } else { slopes[side] }
        };
        [either(0, -1), either(1, 0)]
    }

    fn weno([v1, v2, v3, v4, v5]: [f64; 5]) -> f64 {
        let square = |x: f64| x * x;
        let squares = [v1, v2, v3, v4, v5].map(square);
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
        let epsilon = 1e-6 * squares.into_iter().fold(0.0, f64::max) + 1e-99;
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

    /// One Euler step: value + seconds · (H + dissipation).
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
            Region::OfMarchTime(region) => region(grid.node(grid.index(position)), time),
            _ => panic!("the twin knows only the time of the march"),
        };
        (0..grid.len()).map(at).collect()
    }

    /// keep · old + (1 − keep) · new, clamped to the target and the obstacle at `time`.
    fn mixed(&self, keep: f64, old: &[f64], new: &[f64], time: f64) -> Vec<f64> {
        let mut value: Vec<f64> =
            old.iter().zip(new).map(|(old, new)| keep * old + (1.0 - keep) * new).collect();
        if self.problem.kind == Kind::Tube {
            let target = self.sampled(&self.problem.target, time);
            self.see(&target);
            for (value, ceiling) in value.iter_mut().zip(target) {
                *value = value.max(self.seen.get()[0]).min(ceiling);
            }
        }
        if let Some(avoid) = &self.avoid {
            for (value, depth) in value.iter_mut().zip(self.sampled(avoid, time)) {
                *value = value.max(-depth);
            }
        }
        value
    }

    /// One Runge–Kutta stage: keep · old + (1 − keep) · (source moved by `dt`), clamped to the
    /// target and the obstacle at `time`.
    fn stage(&self, keep: f64, old: &[f64], source: &[f64], dt: f64, time: f64) -> Vec<f64> {
        self.look(time);
        self.mixed(keep, old, &self.moved(source, dt), time)
    }

    fn step(&self, value: &[f64], time: f64, dt: f64) -> Vec<f64> {
        let first = self.stage(0.0, value, value, dt, time + dt);
        match self.scheme {
            Scheme::Upwind => first,
            Scheme::Eno2 => self.stage(0.5, value, &first, dt, time + dt),
            Scheme::Eno3 | Scheme::Weno5 => {
                let half = self.stage(0.75, value, &first, dt, time + 0.5 * dt);
                self.stage(1.0 / 3.0, value, &half, dt, time + dt)
            }
            scheme => unreachable!("the twin has no {scheme:?}"),
        }
    }
}

/// The position `k` nodes away along an axis, if it is on the grid.
fn neighbour<const D: usize>(grid: &Grid<D>, position: usize, d: usize, k: isize) -> Option<usize> {
    let (mut index, axis) = (grid.index(position), grid.axes[d]);
    let (moved, nodes) = (index[d] as isize + k, axis.nodes as isize);
    let moved = if axis.is_periodic() { moved.rem_euclid(nodes) } else { moved };
    index[d] = usize::try_from(moved).ok().filter(|moved| *moved < axis.nodes)?;
    Some(index.iter().zip(grid.axes).fold(0, |n, (i, axis)| n * axis.nodes + i))
}

/// V computed by the twin, with the CFL number `cfl`.
pub(crate) fn by_twin<'a, const D: usize, G: Game<D>>(
    problem: &'a Problem<'a, D, G>,
    avoid: Option<Region<'a, D>>,
    scheme: Scheme,
    cfl: f64,
) -> Vec<f64> {
    let grid = &problem.grid;
    let seen = Cell::new([f64::INFINITY, f64::NEG_INFINITY]);
    let twin = Twin {
        problem,
        avoid,
        scheme,
        seen,
        slope: Cell::default(),
        jumps: Cell::new(false),
        near: RefCell::default(),
    };
    let target = twin.sampled(&problem.target, 0.0);
    for position in 0..target.len() {
        for (d, axis) in grid.axes.iter().enumerate() {
            let last = grid.index(position)[d] + 1 == axis.nodes;
            if let Some(at) = neighbour(grid, position, d, 1).filter(|_| !last) {
                let slope = (target[at] - target[position]).abs() / axis.spacing();
                twin.slope.set(twin.slope.get().max(slope));
            }
        }
    }
    twin.see(&target);
    twin.look(0.0);
    let mut value = twin.mixed(1.0, &target, &target, 0.0);
    let mut fastest = 0.0_f64;
    for position in 0..value.len() {
        let speeds = problem.game.speed_bounds(&twin.terms(grid.index(position)));
        fastest = fastest.max((0..D).map(|d| speeds[d] / grid.axes[d].spacing()).sum());
    }
    let Horizon::Finite(seconds) = problem.horizon else { panic!("the twin stops on time") };
    let steps = (seconds * fastest / cfl).ceil();
    let dt = seconds / steps;
    for step in 0..steps as usize {
        value = twin.step(&value, step as f64 * dt, dt);
    }
    value
}

pub(crate) fn compare_with_twin<const D: usize>(axes: [Axis; D], seconds: f64) {
    let still_target = |x| bumpy(x, 0.0);
    let still_ball = |x| ball(x, 0.0);
    // The wall is so low that it is nowhere above the target.
    let wall = |x| if ball(x, 0.0) < 0.0 { -0.3 } else { 0.3 };
    let target = Region::Static(&still_target);
    let cases = [
        (Kind::Set, Direction::Backward, target, None),
        (Kind::Tube, Direction::Backward, target, None),
        (Kind::Tube, Direction::Forward, target, Some(Region::Static(&still_ball))),
        (Kind::Set, Direction::Forward, target, Some(Region::OfMarchTime(&ball))),
        (Kind::Tube, Direction::Backward, target, Some(Region::Static(&wall))),
        (
            Kind::Tube,
            Direction::Backward,
            Region::OfMarchTime(&bumpy),
            Some(Region::OfMarchTime(&ball)),
        ),
    ];
    for scheme in SCHEMES {
        let (mut worst, mut worst_single, mut mean_single) = (0.0_f64, 0.0_f64, 0.0_f64);
        for (kind, direction, target, avoid) in cases {
            let grid = Grid { axes };
            let horizon = Horizon::Finite(seconds);
            let problem = Problem::new(&Twisted, grid, target, horizon)
                .with_avoid(avoid)
                .with_kind(kind)
                .with_direction(direction);
            let settings = settings(scheme).with_cfl(0.6);
            let twin = by_twin(&problem, avoid, scheme, 0.6);
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
        // ENO chooses between stencils. In a tie, rounding errors decide, and the derivative can
        // jump.
        let [mean, max] = match scheme {
            Scheme::Upwind => [1e-7, 1e-6],
            Scheme::Weno5 => [1e-6, 5e-6],
            _ => [1e-5, 1e-3],
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
    // Some axes have more cells than one of the solver's blocks, and others have fewer.
    compare_with_twin([Axis::periodic(0.0, TAU, 601)], 0.1);
    compare_with_twin([Axis::bounded(-2.1, 2.4, 57)], 0.5);
    compare_with_twin([Axis::bounded(-2.1, 2.4, 57).with_boundary(Boundary::Constant)], 0.5);
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
            Axis::bounded(low, high, 9).with_boundary(Boundary::Constant),
            Axis::periodic(0.0, TAU, 5),
        ],
        0.3,
    );
}
