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

/// The game *mitchell*, from Mitchell, Bayen and Tomlin (2005).
pub(crate) const MITCHELL: PursuitGame = {
    let vehicle = VehicleModel { speed_mps: 5.0, turn_rate_radps: 1.0 };
    PursuitGame { evader: vehicle, pursuer: vehicle, radius_m: 5.0 }
};
/// Horizon of the comparison with other solvers, the peers (s). Optimal play ends within π s.
pub(crate) const HORIZON_S: f64 = 2.8;
/// Volume of the closed form's set {V ≤ 0} (m²·rad).
pub(crate) const VOLUME: f64 = 885.81943;

/// A grid over the domain that is used in the comparison with the peers.
pub(crate) fn air3d_grid([x, y, psi]: [usize; 3]) -> Grid<3> {
    let axes = [
        Axis::bounded(-6.0, 20.0, x),
        Axis::bounded(-10.0, 10.0, y),
        Axis::periodic(0.0, TAU, psi),
    ];
    Grid { axes }
}

/// Solves for the backward reachable tube with a horizon of `horizon_s` s.
pub(crate) fn solve_over(
    grid: &Grid<3>,
    settings: &Settings,
    horizon_s: f64,
) -> Result<Solution<f32, 3>, Box<dyn Error>> {
    let target = |state| MITCHELL.target(state);
    let problem = Problem::reach(&RelativeDubins(MITCHELL), *grid, &target, horizon_s);
    Ok(solve(&problem, settings, &mut |_| ControlFlow::Continue(()))?)
}

/// Error of a set {V ≤ 0} on a grid, compared with the closed form.
#[derive(Serialize)]
pub(crate) struct Accuracy {
    /// At the zero crossings along the grid lines of x and of y: the mean of the closed form's |V|,
    /// in units of the spacing of x. The gradient ∂V/∂(x, y) is a unit vector, so |V| is
    /// approximately a distance.
    pub(crate) mean_dx: f64,
    /// The maximum of this |V|, in the same units.
    pub(crate) max_dx: f64,
    /// Excess of the set's volume ([`SampledValue::volume`]) over the closed form's volume
    /// (percent).
    pub(crate) volume_percent: f64,
}

impl Accuracy {
    /// Finds the zero crossings in every slice of equal ψ, cell by cell.
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
