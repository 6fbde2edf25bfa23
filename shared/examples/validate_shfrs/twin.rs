//! Compares the reachable sets with the level-set solver, which is an independent twin. The solver
//! computes the set that a vehicle reaches within two seconds from a small set of poses, on grids
//! of increasing resolution.
//!
//! A level set on a grid needs an initial set of a few cells, so the start is a disc with an
//! interval of headings. The twin's result is a function V(x, y, ψ). Its shadow in the plane is the
//! set where V ≤ 0 for some ψ. The exact set is computed for the same uncertain start.

use std::error::Error;
use std::ops::ControlFlow;

use serde_json::json;
use sidestep::bounds::InputBounds;
use sidestep::math::{PI, hypot, wrap_angle};
use sidestep::reach::polygon::{signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, PositionUncertainty, ReachableSet, StartSet};
use sidestep::reachability::cartesian::{Direction, Problem, Settings, Solution, solve};
use sidestep::reachability::{Axis, DubinsCar, Grid, Scheme};
use sidestep::vehicle::Pose;

use crate::{Found, RATE_RADPS, SPEED_MPS, STEP_S};

/// Radius of the start (m), and half the width of its interval of headings (rad).
const START: (f64, f64) = (0.3, 0.2);
/// Number of steps ahead.
const STEPS: usize = 10;
/// Spacing (m), and number of nodes in a full turn.
const GRIDS: [(f64, usize); 4] = [(0.15, 40), (0.1, 60), (0.075, 80), (0.05, 120)];

/// Turn rates that are admitted in every step (rad/s).
const BOUNDS: [(f64, f64); 3] = [(-0.5, 0.5), (-0.15, 0.4), (0.1, 0.5)];

/// The twin's shadow: the position of each node in the plane, and the minimum of V over the
/// headings.
fn shadow(solution: &Solution<f32, 3>) -> Vec<([f64; 2], f64)> {
    let headings = solution.grid.axes[2].nodes;
    let least = |values: &[f32]| values.iter().copied().fold(f32::INFINITY, f32::min);
    let node = |i: usize| {
        let [x, y, _] = solution.grid.node(solution.grid.index(i * headings));
        [x, y]
    };
    let columns = solution.values.chunks(headings).enumerate();
    columns.map(|(i, values)| (node(i), f64::from(least(values)))).collect()
}

/// The exact tube for the same start and bounds.
fn exact(turn_rate: (f64, f64)) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
    let (radius_m, heading_rad) = START;
    let position = PositionUncertainty::Disc { radius_m };
    let start = StartSet::new(Pose::new(0.0, 0.0, 0.0), position, heading_rad)?;
    let (lo, hi) = (vec![turn_rate.0; STEPS], vec![turn_rate.1; STEPS]);
    let bounds = InputBounds::new(lo, hi, (-RATE_RADPS, RATE_RADPS))?;
    let set = ReachableSet::new(start, &bounds, SPEED_MPS, STEP_S)?;
    Ok(set.tube_polygon(PolygonSettings::default()))
}

fn twin(turn_rate: (f64, f64), tube: &[[f64; 2]], (spacing_m, headings): (f64, usize)) -> Found {
    let nodes = |length: f64| (length / spacing_m).round() as usize + 1;
    let axes = [
        Axis::bounded(-1.0, 5.0, nodes(6.0)),
        Axis::bounded(-3.0, 3.0, nodes(6.0)),
        Axis::periodic(-PI, PI, headings),
    ];
    let (radius, half) = START;
    // Both terms are in metres, because a radian counts as two metres.
    let start =
        |[x, y, psi]: [f64; 3]| (hypot(x, y) - radius).max(2.0 * (wrap_angle(psi).abs() - half));
    let car = DubinsCar { speed_mps: SPEED_MPS, turn_rate_radps: turn_rate };
    let problem = Problem::reach(&car, Grid { axes }, &start, STEPS as f64 * STEP_S)
        .with_direction(Direction::Forward);
    let settings = Settings::new(Scheme::Eno2).with_threads(2);
    let solution = solve::<f32, 3, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()))?;
    let reached: Vec<[f64; 2]> =
        shadow(&solution).into_iter().filter(|(_, v)| *v <= 0.0).map(|(node, _)| node).collect();
    let outside = reached.iter().map(|&node| signed_distance(tube, node));
    Ok(json!({
        "turn_rate_radps": turn_rate,
        "spacing_m": spacing_m,
        "nodes": axes.map(|axis| axis.nodes),
        // Areas of the twin's shadow and of the exact tube.
        "area_m2": reached.len() as f64 * spacing_m * spacing_m,
        "exact_m2": signed_area(tube),
        // Maximum distance of a node of the twin's shadow outside the exact tube. Negative if all
        // nodes are inside.
        "outside_m": outside.fold(f64::NEG_INFINITY, f64::max),
    }))
}

pub(crate) fn check() -> Found {
    let mut twins = Vec::new();
    for turn_rate in BOUNDS {
        let tube = exact(turn_rate)?;
        for grid in GRIDS {
            twins.push(twin(turn_rate, &tube, grid)?);
        }
    }
    Ok(json!({
        "start_radius_m": START.0,
        "start_heading_rad": START.1,
        "horizon_s": STEPS as f64 * STEP_S,
        "twins": twins,
    }))
}
