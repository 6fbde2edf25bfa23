//! The exact value of the pursuit game.

use super::*;

/// Weights of the nodes 0, 1, 2 and 3 for the cubic through them at `t`.
pub(crate) fn cubic_weights(t: f64) -> [f64; 4] {
    let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
    [-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0]
}

/// Share of a triangle where the linear function with these corner values is ≤ 0.
pub(crate) fn negative_share(corners: [f64; 3]) -> f64 {
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
pub(crate) const SUB_CELLS: usize = 8;

/// Volume of {V ≤ 0} on a grid whose third axis is periodic, of sets that do not meet the
/// ends of the first two: in each slice the bicubic interpolant is taken on a mesh of
/// 8 × 8 to the cell and the area of its piecewise linear interpolant is exact (four
/// triangles to a mesh cell); slices are summed, which for a smooth periodic area
/// converges faster than any power. Chords cut a convex set short by their sagitta, 1/64
/// of that of whole cells.
pub(crate) fn negative_volume(grid: &Grid<3>, value: impl Fn([usize; 3]) -> f64) -> f64 {
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
pub(crate) fn zero_level_errors(
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
    let vehicle = VehicleModel { speed_mps: 5.0, turn_rate_radps: 1.0 };
    let game = PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 5.0 };
    let exact = game.exact().expect("identical vehicles");
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
