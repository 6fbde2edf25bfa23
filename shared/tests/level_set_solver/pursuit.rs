//! The pursuit game, compared with its exact value.

use super::measure::{Accuracy, HORIZON_S, MITCHELL, air3d_grid, solve_over};
use super::*;

/// The game air3D of Mitchell, Bayen and Tomlin (2005), with the settings that other packages use.
#[test]
fn the_pursuit_game_has_its_volume_and_its_zero_level() {
    let exact = MITCHELL.exact().expect("identical vehicles");
    let grid = air3d_grid([51, 40, 50]);
    let report = |name: &str, values: &[f32]| {
        let found = Accuracy::new(&exact, &grid, values).expect("finite values");
        let Accuracy { mean_dx, max_dx, volume_percent } = found;
        eprintln!(
            "air3D {name}: volume {volume_percent:+.3} %, zero level mean {mean_dx:.4} dx, max \
             {max_dx:.3} dx"
        );
        (volume_percent, mean_dx)
    };
    // Measure the exact values at the same nodes in the same way.
    let nodes = (0..grid.len()).map(|at| exact.value(grid.node(grid.index(at))) as f32);
    let (volume, level) = report("exact", &nodes.collect::<Vec<_>>());
    assert!(volume.abs() <= 0.05 && level <= 0.01, "{volume} {level}");
    let of = |scheme| {
        let solution = solve_over(&grid, &settings(scheme), HORIZON_S).expect("a solution");
        report(scheme.name(), &solution.values)
    };
    let (volume, level) = of(Scheme::Weno5);
    assert!(volume.abs() <= 0.1 && level <= 0.025, "{volume} {level}");
    for scheme in [Scheme::Upwind, Scheme::Eno2, Scheme::Eno3] {
        of(scheme);
    }
}
