//! Solves the air3D game of Mitchell, Bayen and Tomlin (2005) on a grid, measures the time and the
//! error against the closed form, and prints one line of JSON. `cargo xtask bench peers` calls this
//! program.
//!
//! ```text
//! air3d 51x40x50 weno5 THREADS RUNS [PEER.npy]
//! ```
//!
//! The environment variable `LANES` limits the SIMD width: `128-bit`, `avx2` or `avx512`. The game
//! is solved RUNS times, and the time of the fastest solve is reported. PEER.npy (`<f4`, C order)
//! contains the values of another solver on the same nodes. Their error is measured in the same
//! way.

#![allow(clippy::print_stdout, reason = "its answer is what it prints")]

mod measure;

use std::error::Error;
use std::time::Instant;
use std::{env, fs};

use serde::Serialize;
use sidestep::reachability::cartesian::{Settings, Solution};
use sidestep::reachability::{Grid, Lanes, Scheme};

use measure::{Accuracy, HORIZON_S, MITCHELL, solve_over};

const CFL: f64 = 0.75;
const USAGE: &str = "expected: air3d 51x40x50 weno5 THREADS RUNS [PEER.npy]";

/// The printed report.
#[derive(Serialize)]
struct Report {
    /// Time of the fastest solve (s).
    wall_s: f64,
    steps: usize,
    /// The SIMD lanes that the solver used.
    lanes: &'static str,
    /// For each axis: the first node, the last node, and the number of nodes.
    axes: [(f64, f64, usize); 3],
    accuracy: Accuracy,
    /// Accuracy of the peer's values.
    peer: Option<Accuracy>,
    /// Maximum difference between the peer's values and this solver's values (m).
    apart_m: Option<f64>,
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
    let most = env::var("LANES").map_or(Ok(Lanes::widest()), |name| Lanes::named(&name))?;
    let lanes = most.min(Lanes::widest());
    let threads = threads.parse()?;
    let settings = Settings::new(scheme).with_threads(threads).with_lanes(lanes).with_cfl(CFL);
    let exact = MITCHELL.exact()?;

    // The warm-up allocates memory and fills caches, just as the peer compiles before it is timed.
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
        lanes: lanes.name(),
        axes: grid.axes.map(|axis| (axis.node(0), axis.node(axis.nodes as isize - 1), axis.nodes)),
        accuracy: Accuracy::new(&exact, &grid, &values)?,
        apart_m: peer.as_ref().map(apart),
        peer: peer.map(|values| Accuracy::new(&exact, &grid, &values)).transpose()?,
    };
    println!("{}", serde_json::to_string(&report)?);
    Ok(())
}

/// The grid for a text such as `51x40x50`, which contains the number of nodes of each axis.
fn grid_of(nodes: &str) -> Result<Grid<3>, Box<dyn Error>> {
    let nodes = nodes.split('x').map(str::parse).collect::<Result<Vec<usize>, _>>()?;
    Ok(measure::air3d_grid(nodes.try_into().map_err(|_| USAGE)?))
}

/// The values of a NumPy file of 32-bit floats in C order, which must have this shape.
fn npy(bytes: &[u8], shape: &[usize; 3]) -> Result<Vec<f32>, String> {
    let version_1 = bytes.get(..10).filter(|start| start.starts_with(b"\x93NUMPY\x01"));
    let start = version_1.ok_or("expected a NumPy file of version 1")?;
    let end = 10 + usize::from(u16::from_le_bytes([start[8], start[9]]));
    let header = bytes.get(10..end).ok_or("expected the whole header")?;
    let header = String::from_utf8_lossy(header);
    let [x, y, psi] = shape;
    let expected =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({x}, {y}, {psi}), }}");
    if header.trim() != expected {
        return Err(format!("expected {expected}, found {}", header.trim()));
    }
    let values: Vec<f32> = bytes[end..]
        .chunks_exact(4)
        .map(|bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
        .collect();
    let nodes = shape.iter().product::<usize>();
    if values.len() != nodes {
        return Err(format!("expected {nodes} values, found {}", values.len()));
    }
    Ok(values)
}
