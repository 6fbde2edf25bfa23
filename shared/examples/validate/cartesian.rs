//! The solver on rectangular grids: air3D, and the order of convergence of each scheme.

use core::f64::consts::LN_2;
use std::error::Error;
use std::ops::ControlFlow;

use serde::Serialize;
use sidestep::math::{TAU, cos, ln};
use sidestep::reachability::cartesian::{Kind, Problem, Settings, solve};
use sidestep::reachability::{Axis, Grid, Scheme};

#[path = "../../tests/level_set_solver/steepening.rs"]
mod steepening;

use self::steepening::{SECONDS, Steepening, exact};
use crate::measure::{self, Accuracy, HORIZON_S, MITCHELL};

/// The schemes, and their names on the page.
const SCHEMES: [(&str, Scheme); 4] = [
    ("upwind", Scheme::Upwind),
    ("ENO2", Scheme::Eno2),
    ("ENO3", Scheme::Eno3),
    ("WENO5", Scheme::Weno5),
];
/// Name of the closed form in the list of schemes. Its values on the nodes are measured like those
/// of a scheme.
pub(crate) const EXACT: &str = "closed form";
/// 25, 50, 75 and 100 intervals along x, and intervals of the same length along y.
const GRIDS: [[usize; 3]; 4] = [[26, 20, 25], [51, 40, 50], [76, 59, 75], [101, 79, 100]];
/// Numbers of nodes for the smooth problem.
const NODES: [usize; 5] = [80, 160, 320, 640, 1280];

/// The results.
#[derive(Serialize)]
pub(crate) struct Check {
    horizon_s: f64,
    pub(crate) air3d: Vec<Air3d>,
    /// For WENO5 on 51×40×50 nodes: excess of the volume over the closed form's volume (percent),
    /// after the horizon and after π s.
    converged: [f64; 2],
    pub(crate) orders: Vec<Order>,
}

/// One solve of air3D, or the closed form's values on the same nodes, measured in the same way.
#[derive(Serialize)]
pub(crate) struct Air3d {
    pub(crate) scheme: &'static str,
    nodes: [usize; 3],
    pub(crate) dx_m: f64,
    /// `None` for the closed form, like `steps`.
    cfl: Option<f64>,
    steps: Option<usize>,
    pub(crate) accuracy: Accuracy,
}

/// Errors of a scheme on grids of increasing resolution.
#[derive(Serialize)]
pub(crate) struct Order {
    pub(crate) scheme: &'static str,
    /// CFL number of the time step. `advised` is true if it is the library's default for the
    /// scheme.
    cfl: f64,
    pub(crate) advised: bool,
    /// Spacing (rad) and mean error on each grid.
    pub(crate) errors: Vec<(f64, f64)>,
    /// Observed orders: log₂ of the ratio of the errors on consecutive grids.
    orders: Vec<f64>,
}

/// Measures the Cartesian solver.
pub(crate) fn check() -> Result<Check, Box<dyn Error>> {
    let truth = MITCHELL.exact()?;
    let mut air3d = Vec::new();
    for nodes in GRIDS {
        let grid = measure::air3d_grid(nodes);
        let dx_m = grid.axes[0].spacing();
        for (scheme, of) in SCHEMES {
            let settings = Settings::new(of);
            let solution = measure::solve_over(&grid, &settings, HORIZON_S)?;
            let accuracy = Accuracy::new(&truth, &grid, &solution.values)?;
            let (cfl, steps) = (Some(settings.cfl), Some(solution.steps));
            air3d.push(Air3d { scheme, nodes, dx_m, cfl, steps, accuracy });
        }
        let value = |at| truth.value(grid.node(grid.index(at))) as f32;
        let values: Vec<f32> = (0..grid.len()).map(value).collect();
        let accuracy = Accuracy::new(&truth, &grid, &values)?;
        air3d.push(Air3d { scheme: EXACT, nodes, dx_m, cfl: None, steps: None, accuracy });
    }

    let grid = measure::air3d_grid(GRIDS[1]);
    let longer = measure::solve_over(&grid, &Settings::new(Scheme::Weno5), 0.5 * TAU)?;
    let longer = Accuracy::new(&truth, &grid, &longer.values)?;
    let shorter = air3d.iter().find(|of| of.scheme == "WENO5" && of.nodes == GRIDS[1]);
    let shorter = shorter.ok_or("no such solve")?.accuracy.volume_percent;

    let mut orders = Vec::new();
    for (name, scheme) in SCHEMES {
        orders.push(order(name, scheme, scheme.cfl())?);
    }
    for (name, scheme) in &SCHEMES[1..3] {
        orders.push(order(name, *scheme, 0.75)?);
    }
    let converged = [shorter, longer.volume_percent];
    Ok(Check { horizon_s: HORIZON_S, air3d, converged, orders })
}

/// Mean errors of the smooth problem on grids of increasing resolution.
fn order(name: &'static str, scheme: Scheme, cfl: f64) -> Result<Order, Box<dyn Error>> {
    let target = |[x]: [f64; 1]| cos(x);
    let mut errors: Vec<(f64, f64)> = Vec::new();
    for nodes in NODES {
        let grid = Grid { axes: [Axis::periodic(0.0, TAU, nodes)] };
        let problem = Problem::reach(&Steepening, grid, &target, SECONDS).with_kind(Kind::Set);
        let settings = Settings::new(scheme).with_cfl(cfl).with_threads(1);
        let solution = solve::<f64, 1, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()))?;
        let axis = solution.grid.axes[0];
        let off = |(i, v): (usize, &f64)| (v - exact(axis.node(i as isize))).abs();
        let mean = solution.values.iter().enumerate().map(off).sum::<f64>() / nodes as f64;
        errors.push((axis.spacing(), mean));
    }
    let orders = errors.windows(2).map(|two| ln(two[0].1 / two[1].1) / LN_2).collect();
    Ok(Order { scheme: name, cfl, advised: cfl == scheme.cfl(), errors, orders })
}
