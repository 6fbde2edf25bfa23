//! The air3D game of Mitchell, Bayen and Tomlin (2005) on a grid, timed and measured
//! against the closed form; one JSON line. `cargo xtask bench peers` calls it.
//!
//! ```text
//! air3d 51x40x50 weno5 THREADS RUNS [PEER.npy]
//! ```
//!
//! The fastest of RUNS solves counts. PEER.npy (`<f4`, C order) has another solver's
//! values on the same nodes, which are then measured in the same way.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

use std::error::Error;
use std::ops::ControlFlow;
use std::time::Instant;
use std::{env, fs};

use serde::Serialize;
use sidestep::math::TAU;
use sidestep::reachability::cartesian::{
    Direction, Horizon, Kind, Problem, Region, Settings, Solution, solve,
};
use sidestep::reachability::{Axis, ExactValue, Grid, Player, PursuitGame, RelativeDubins, Scheme};

const GAME: PursuitGame = {
    let player = Player { speed_mps: 5.0, turn_rate_radps: 1.0 };
    PursuitGame { evader: player, pursuer: player, radius_m: 5.0 }
};
const HORIZON_S: f64 = 2.8;
const CFL: f64 = 0.75;
/// Volume of {V ≤ 0} of the closed form, m²·rad.
const VOLUME: f64 = 885.81943;
const USAGE: &str = "expected: air3d 51x40x50 weno5 THREADS RUNS [PEER.npy]";

/// What is printed.
#[derive(Serialize)]
struct Report {
    /// The fastest solve, s.
    wall_s: f64,
    steps: usize,
    /// First node, last node and their number, by axis.
    axes: [(f64, f64, usize); 3],
    accuracy: Accuracy,
    /// Of the other solver's values.
    peer: Option<Accuracy>,
    /// Largest difference of the two, m.
    apart_m: Option<f64>,
}

/// How far a set {V ≤ 0} on nodes is from the closed form's.
#[derive(Serialize)]
struct Accuracy {
    /// Mean of |V| of the closed form at the zeros along the grid's lines of x and of y,
    /// in spacings of x. ∂V/∂(x, y) is a unit vector, so |V| is about a distance.
    mean_dx: f64,
    /// The largest of these.
    max_dx: f64,
    /// Volume of the set, in percent more than the closed form's. Polygons cut corners: on
    /// 51×40×50 nodes the closed form itself has −0.14.
    volume_percent: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let (grid, scheme, threads, runs, peer) = match arguments.as_slice() {
        [grid, scheme, threads, runs] => (grid, scheme, threads, runs, None),
        [grid, scheme, threads, runs, peer] => (grid, scheme, threads, runs, Some(peer)),
        _ => return Err(USAGE.into()),
    };
    let grid = grid_of(grid)?;
    let scheme: Scheme = serde_json::from_value(scheme.as_str().into())?;
    let settings = Settings { threads: threads.parse()?, cfl: CFL, ..Settings::of(scheme) };
    let exact = GAME.exact()?;

    // Once for the memory and the caches, as the peer has compiled beforehand.
    solve_over(&grid, &settings, 1e-3)?;
    let mut wall_s = f64::INFINITY;
    let mut last = None;
    for _ in 0..runs.parse::<usize>()?.max(1) {
        let start = Instant::now();
        let solution = solve_over(&grid, &settings, HORIZON_S)?;
        wall_s = wall_s.min(start.elapsed().as_secs_f64());
        last = Some(solution);
    }
    let Solution { values, steps, .. } = last.ok_or(USAGE)?;

    let peer = match peer {
        Some(path) => Some(
            npy(&fs::read(path)?, &grid.axes.map(|axis| axis.nodes))
                .map_err(|complaint| format!("{path}: {complaint}"))?,
        ),
        None => None,
    };
    let apart = |peer: &Vec<f32>| {
        let apart = peer.iter().zip(&values).map(|(a, b)| f64::from((a - b).abs()));
        apart.fold(0.0, f64::max)
    };
    let report = Report {
        wall_s,
        steps,
        axes: grid.axes.map(|axis| (axis.node(0), axis.node(axis.nodes as isize - 1), axis.nodes)),
        accuracy: Accuracy::new(&exact, &grid, &values),
        apart_m: peer.as_ref().map(apart),
        peer: peer.map(|values| Accuracy::new(&exact, &grid, &values)),
    };
    println!("{}", serde_json::to_string(&report)?);
    Ok(())
}

/// The grid of so many nodes, as in `51x40x50`.
fn grid_of(nodes: &str) -> Result<Grid<3>, Box<dyn Error>> {
    let nodes = nodes.split('x').map(str::parse).collect::<Result<Vec<usize>, _>>()?;
    let [x, y, psi] = nodes.try_into().map_err(|_| USAGE)?;
    let axes = [
        Axis::bounded(-6.0, 20.0, x),
        Axis::bounded(-10.0, 10.0, y),
        Axis::periodic(0.0, TAU, psi),
    ];
    Ok(Grid { axes })
}

/// The tube after so many seconds.
fn solve_over(
    grid: &Grid<3>,
    settings: &Settings,
    horizon_s: f64,
) -> Result<Solution<f32, 3>, Box<dyn Error>> {
    let target = |state| GAME.target(state);
    let problem = Problem {
        game: &RelativeDubins(GAME),
        grid: *grid,
        target: Region::Static(&target),
        obstacle: None,
        kind: Kind::Tube,
        direction: Direction::Backward,
        horizon: Horizon::Finite(horizon_s),
    };
    Ok(solve(&problem, settings, &mut |_| ControlFlow::Continue(()))?)
}

impl Accuracy {
    /// Traces the zero level of every slice of equal ψ, cell by cell.
    fn new(exact: &ExactValue, grid: &Grid<3>, values: &[f32]) -> Self {
        let [x, y, psi] = grid.axes;
        let value =
            |i: usize, j: usize, k: usize| f64::from(values[(i * y.nodes + j) * psi.nodes + k]);
        let (mut off, mut cells) = (Vec::new(), 0.0);
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
            if i + 1 < x.nodes && j + 1 < y.nodes {
                let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
                cells += area_inside(corners.map(|[di, dj]| value(i + di, j + dj, k)));
            }
        }
        let dx = x.spacing();
        Self {
            mean_dx: off.iter().sum::<f64>() / off.len() as f64 / dx,
            max_dx: off.iter().copied().fold(0.0, f64::max) / dx,
            volume_percent: 100.0 * (cells * grid.cell_volume() / VOLUME - 1.0),
        }
    }
}

/// The part of a unit square where values are ≤ 0: the polygon of the corners inside and
/// the zeros on the edges. `values` are those at the corners, counter-clockwise.
fn area_inside(values: [f64; 4]) -> f64 {
    const CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mut polygon = Vec::with_capacity(8);
    for from in 0..4 {
        let to = (from + 1) % 4;
        if values[from] <= 0.0 {
            polygon.push(CORNERS[from]);
        }
        if (values[from] <= 0.0) != (values[to] <= 0.0) {
            let share = values[from] / (values[from] - values[to]);
            let along = |d: usize| CORNERS[from][d] + share * (CORNERS[to][d] - CORNERS[from][d]);
            polygon.push([along(0), along(1)]);
        }
    }
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
}

/// The values of a NumPy file of 32-bit floats in C order, which must have this shape.
fn npy(octets: &[u8], shape: &[usize; 3]) -> Result<Vec<f32>, String> {
    let version_1 = octets.get(..10).filter(|start| start.starts_with(b"\x93NUMPY\x01"));
    let start = version_1.ok_or("expected a NumPy file of version 1")?;
    let end = 10 + usize::from(u16::from_le_bytes([start[8], start[9]]));
    let header = octets.get(10..end).ok_or("expected the whole header")?;
    let header = String::from_utf8_lossy(header);
    let [x, y, psi] = shape;
    let expected =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({x}, {y}, {psi}), }}");
    if header.trim() != expected {
        return Err(format!("expected {expected}, found {}", header.trim()));
    }
    let values: Vec<f32> = octets[end..]
        .chunks_exact(4)
        .map(|octets| f32::from_le_bytes([octets[0], octets[1], octets[2], octets[3]]))
        .collect();
    let nodes = shape.iter().product::<usize>();
    if values.len() != nodes {
        return Err(format!("expected {nodes} values, found {}", values.len()));
    }
    Ok(values)
}
