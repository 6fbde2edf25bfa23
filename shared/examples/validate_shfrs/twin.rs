//! The level-set solver as an independent twin: what a vehicle reaches within two seconds
//! from a small set of poses, on finer and finer grids.
//!
//! A level set on a grid needs an initial set of a few cells, so the start is a disc with
//! headings to both sides. What the twin finds is a function of (x, y, ψ); its shadow in
//! the plane is where V ≤ 0 for some ψ.

use std::error::Error;
use std::ops::ControlFlow;

use serde::Serialize;
use sidestep::math::{PI, hypot, wrap_angle};
use sidestep::reachability::cartesian::{
    Direction, Horizon, Kind, Problem, Region, Settings, Solution, solve,
};
use sidestep::reachability::{Axis, DubinsCar, Grid, Scheme};

use crate::{SPEED_MPS, STEP_S};

/// Radius, m, and half the range of headings, rad, of the start.
const START: (f64, f64) = (0.3, 0.2);
/// Steps ahead.
const STEPS: usize = 10;
/// Spacings, m, and nodes of a full turn.
const GRIDS: [(f64, usize); 4] = [(0.15, 40), (0.1, 60), (0.075, 80), (0.05, 120)];

/// One grid.
#[derive(Serialize)]
pub(crate) struct Twin {
    turn_rate: (f64, f64),
    spacing_m: f64,
    nodes: [usize; 3],
    /// Of the twin's shadow, and of the exact tube, m².
    area_m2: f64,
    exact_m2: f64,
    /// How far the twin's shadow sticks out of the exact tube at most, m.
    outside_m: f64,
}

/// The twin's shadow: positions of nodes, and the least V over the headings.
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

pub(crate) fn check() -> Result<Vec<Twin>, Box<dyn Error>> {
    let mut found = Vec::new();
    for turn_rate in [(-0.5, 0.5), (-0.15, 0.4), (0.1, 0.5)] {
        for (spacing_m, headings) in GRIDS {
            let nodes = |length: f64| (length / spacing_m).round() as usize + 1;
            let axes = [
                Axis::bounded(-1.0, 5.0, nodes(6.0)),
                Axis::bounded(-3.0, 3.0, nodes(6.0)),
                Axis::periodic(-PI, PI, headings),
            ];
            let (radius, half) = START;
            // Both in metres: the vehicle turns by a radian in about two metres.
            let start = |[x, y, psi]: [f64; 3]| {
                (hypot(x, y) - radius).max(2.0 * (wrap_angle(psi).abs() - half))
            };
            let problem = Problem {
                game: &DubinsCar { speed_mps: SPEED_MPS, turn_rate_radps: turn_rate },
                grid: Grid { axes },
                target: Region::Static(&start),
                obstacle: None,
                kind: Kind::Tube,
                direction: Direction::Forward,
                horizon: Horizon::Finite(STEPS as f64 * STEP_S),
            };
            let settings = Settings { threads: 2, ..Settings::of(Scheme::Eno2) };
            let solution =
                solve::<f32, 3, _>(&problem, &settings, &mut |_| ControlFlow::Continue(()))?;
            let area = shadow(&solution).iter().filter(|(_, v)| *v <= 0.0).count() as f64
                * spacing_m
                * spacing_m;
            eprintln!("{turn_rate:?} {spacing_m} {area}");
            found.push(Twin {
                turn_rate,
                spacing_m,
                nodes: axes.map(|axis| axis.nodes),
                area_m2: area,
                exact_m2: 0.0,
                outside_m: 0.0,
            });
        }
    }
    Ok(found)
}
