//! Problems with mirror symmetry are solved on half of the nodes.

use super::*;
use sidestep::reachability::{PursuitGame, RelativeDubins};
use sidestep::vehicle::VehicleModel;

const GAME: PursuitGame = PursuitGame {
    evader: VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.7 },
    pursuer: VehicleModel { speed_mps: 2.4, turn_rate_radps: 0.4 },
    radius_m: 2.5,
};

/// The same game, with its left-right symmetry hidden from the solver.
struct Whole(RelativeDubins);

impl Game<3> for Whole {
    fn terms(&self, axis: usize, coordinate: f64) -> [f64; TERMS] {
        self.0.terms(axis, coordinate)
    }
    fn hamiltonian<T: Real>(&self, terms: &[[T; TERMS]; 3], gradient: [T; 3]) -> T {
        self.0.hamiltonian(terms, gradient)
    }
    fn speed_bounds<T: Real>(&self, terms: &[[T; TERMS]; 3]) -> [T; 3] {
        self.0.speed_bounds(terms)
    }
}

fn grid([x, y, psi]: [usize; 3], first: f64) -> Grid<3> {
    let [x, y] = [Axis::bounded(-6.0, 9.0, x), Axis::bounded(-7.0, 7.0, y)];
    Grid { axes: [x, y, Axis::periodic(first, first + TAU, psi)] }
}

/// V solved on half of the nodes, and V solved on the whole grid. Both are given at the end and at
/// two earlier instants.
fn both(grid: Grid<3>, scheme: Scheme, region: Region<'_, 3>, forward: bool) -> [Vec<f64>; 2] {
    let settings = Settings::new(scheme).with_threads(2).with_slices(2);
    let direction = if forward { Direction::Forward } else { Direction::Backward };
    let game = RelativeDubins(GAME);
    let obstacle = |[x, y, _]: [f64; 3]| hypot(x - 5.0, y) - 1.0;
    let all = |solution: Solution<f64, 3>| -> Vec<f64> {
        solution.earlier.iter().chain([&solution.values]).flatten().copied().collect()
    };
    let horizon = Horizon::Finite(0.8);
    let half = Problem::new(&game, grid, region, horizon)
        .with_direction(direction)
        .with_avoid(Region::Static(&obstacle));
    let whole = Whole(game);
    let whole = Problem::new(&whole, grid, region, horizon)
        .with_direction(direction)
        .with_avoid(Region::Static(&obstacle));
    [all(solved(&half, &settings)), all(solved(&whole, &settings))]
}

#[test]
fn half_of_the_nodes_give_all_values() {
    // With the plain target, two ENO2 stencils are equally smooth in the middle, so rounding errors
    // would decide between them.
    let target = |[x, y, psi]: [f64; 3]| {
        let (sin, cos) = sin_cos(psi);
        hypot(x, y) - 2.5 + 0.2 * y * sin + 0.3 * cos
    };
    for scheme in SCHEMES {
        for (nodes, first, forward) in
            [([31, 21, 24], 0.0, false), ([31, 20, 23], -PI, false), ([30, 27, 25], 0.0, true)]
        {
            let grid = grid(nodes, first);
            let [half, whole] = both(grid, scheme, Region::Static(&target), forward);
            assert_eq!(half.len(), 3 * grid.len());
            let gaps = half.iter().zip(&whole).map(|(a, b)| (a - b).abs());
            // With ENO3, ties between the third differences on both sides of the middle remain.
            let (found, most) = match scheme {
                Scheme::Eno3 => (gaps.sum::<f64>() / half.len() as f64, 1e-3),
                _ => (gaps.fold(0.0, f64::max), 1e-9),
            };
            eprintln!("{scheme:?} {nodes:?}: {found:e}");
            assert!(found < most, "{scheme:?} {nodes:?}: {found:e}");
            let image = |position: usize| {
                let [i, j, k] = grid.index(position % grid.len());
                let [_, ny, n] = nodes;
                (i * ny + ny - 1 - j) * n + (n - k) % n + position / grid.len() * grid.len()
            };
            let bits = |at: usize| half[at].to_bits();
            // The middle row of an odd number of rows is computed in full.
            let row = |at: usize| grid.index(at % grid.len())[1];
            let mut at = (0..half.len()).filter(|at| 2 * row(*at) + 1 != nodes[1]);
            assert!(at.all(|at| bits(at) == bits(image(at))));
        }
    }
}

/// A target on one side, or a target that moves to one side, is not symmetric. For such targets,
/// the result equals the result on the whole grid, bit for bit.
#[test]
fn problems_without_the_symmetry_are_solved_as_a_whole() {
    let aside = |[x, y, _]: [f64; 3]| hypot(x, y - 1e-6) - 2.5;
    let moving = |[x, y, _]: [f64; 3], seconds: f64| hypot(x, y - seconds) - 2.5;
    let even = grid([31, 20, 24], 0.0);
    let mut shifted = grid([31, 20, 24], 0.0);
    shifted.axes[2] = Axis::periodic(0.1, 0.1 + TAU, 24);
    let target = |state: [f64; 3]| GAME.target(state);
    for (grid, region) in [
        (even, Region::Static(&aside)),
        (even, Region::OfMarchTime(&moving)),
        (shifted, Region::Static(&target)),
    ] {
        let [half, whole] = both(grid, Scheme::Eno2, region, false);
        assert!(half.iter().zip(&whole).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}
