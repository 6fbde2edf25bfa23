//! The air3D game and the error measures of its solutions, shared by `air3d` and `validate`.

use std::error::Error;
use std::ops::ControlFlow;

use serde::Serialize;
use sidestep::invalid::Invalid;
use sidestep::math::TAU;
use sidestep::reachability::cartesian::{Problem, Settings, Solution, solve};
use sidestep::reachability::{
    Axis, ExactValue, Grid, Nodes, PursuitGame, RelativeDubins, SampledValue,
};
use sidestep::vehicle::VehicleModel;

/// *mitchell*: Mitchell, Bayen and Tomlin (2005).
pub(crate) const MITCHELL: PursuitGame = {
    let vehicle = VehicleModel { speed_mps: 5.0, turn_rate_radps: 1.0 };
    PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 5.0 }
};
/// Horizon of the game that peers solve, s. Optimal play ends within π s.
pub(crate) const HORIZON_S: f64 = 2.8;
/// Volume of {V ≤ 0} of the closed form, m²·rad.
pub(crate) const VOLUME: f64 = 885.81943;

/// The domain that peers solve on, with these numbers of nodes.
pub(crate) fn air3d_grid([x, y, psi]: [usize; 3]) -> Grid<3> {
    let axes = [
        Axis::bounded(-6.0, 20.0, x),
        Axis::bounded(-10.0, 10.0, y),
        Axis::periodic(0.0, TAU, psi),
    ];
    Grid { axes }
}

/// The tube after `horizon_s` s.
pub(crate) fn solve_over(
    grid: &Grid<3>,
    settings: &Settings,
    horizon_s: f64,
) -> Result<Solution<f32, 3>, Box<dyn Error>> {
    let target = |state| MITCHELL.target(state);
    let problem = Problem::reach(&RelativeDubins(MITCHELL), *grid, &target, horizon_s);
    Ok(solve(&problem, settings, &mut |_| ControlFlow::Continue(()))?)
}

/// Error of a set {V ≤ 0} on nodes against the closed form's.
#[derive(Serialize)]
pub(crate) struct Accuracy {
    /// Mean of |V| of the closed form at the zeros along the grid's lines of x and of y,
    /// in spacings of x. ∂V/∂(x, y) is a unit vector, so |V| is about a distance.
    pub(crate) mean_dx: f64,
    /// The largest of these.
    pub(crate) max_dx: f64,
    /// Volume of the set ([`SampledValue::volume`]), in percent more than the closed form's.
    pub(crate) volume_percent: f64,
}

impl Accuracy {
    /// Traces the zero level of every slice of equal ψ, cell by cell.
    pub(crate) fn new(exact: &ExactValue, grid: &Grid<3>, values: &[f32]) -> Result<Self, Invalid> {
        let [x, y, psi] = grid.axes;
        let value =
            |i: usize, j: usize, k: usize| f64::from(values[(i * y.nodes + j) * psi.nodes + k]);
        let mut off = Vec::new();
        for (i, j, k) in (0..grid.len()).map(|at| grid.index(at).into()) {
            let here = value(i, j, k);
            for [di, dj] in [[1, 0], [0, 1]] {
                if i + di == x.nodes || j + dj == y.nodes {
                    continue;
                }
                let there = value(i + di, j + dj, k);
                if (here <= 0.0) != (there <= 0.0) {
                    let share = here / (here - there);
                    let [px, py, ppsi] = grid.node([i, j, k]);
                    let [dx, dy] = [di as f64 * x.spacing(), dj as f64 * y.spacing()];
                    off.push(exact.value([px + share * dx, py + share * dy, ppsi]).abs());
                }
            }
        }
        let deficit = |(at, v): (usize, &f32)| {
            (f64::from(*v) - MITCHELL.target(grid.node(grid.index(at)))) as f32
        };
        let deficit: Vec<f32> = values.iter().enumerate().map(deficit).collect();
        let samples =
            SampledValue::new(MITCHELL, Nodes::Cartesian { x, y, psi }, HORIZON_S, &deficit, None)?;
        let dx = x.spacing();
        Ok(Self {
            mean_dx: off.iter().sum::<f64>() / off.len() as f64 / dx,
            max_dx: off.iter().copied().fold(0.0, f64::max) / dx,
            volume_percent: 100.0 * (samples.volume() / VOLUME - 1.0),
        })
    }
}
