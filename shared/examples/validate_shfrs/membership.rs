//! Random admissible drives: is the state in which they end found to be reachable?

use std::error::Error;

use serde::Serialize;
use sidestep::math::SeededRng;
use sidestep::reach::Tolerance;

use crate::drives::{KINDS, Kind, any_pose, drive, set};

/// Steps ahead.
const HORIZONS: [usize; 4] = [3, 10, 25, 50];
/// Bounds of a kind and horizon, drives under each, and parts of a step.
const BOUNDS: usize = 125;
const DRIVES: usize = 50;
const PARTS: usize = 4;

#[derive(Serialize)]
pub(crate) struct Check {
    tolerance_m: f64,
    tolerance_rad: f64,
    rows: Vec<Row>,
}

#[derive(Serialize)]
pub(crate) struct Row {
    kind: Kind,
    steps: usize,
    drives: usize,
    /// How many end in a state that is found outside, at the tolerance.
    outside: usize,
    /// How far outside such a state is found at most, m; 0 if none is.
    farthest_m: f64,
}

pub(crate) fn check() -> Result<Check, Box<dyn Error>> {
    let mut rng = SeededRng::new(64);
    let tolerance = Tolerance::default();
    let mut rows = Vec::new();
    for kind in KINDS {
        for steps in HORIZONS {
            let drives = BOUNDS * DRIVES;
            let mut row = Row { kind, steps, drives, outside: 0, farthest_m: 0.0 };
            for _ in 0..BOUNDS {
                let rates = kind.bounds(steps, &mut rng);
                let start = any_pose(&mut rng);
                let set = set(start, &rates)?;
                for _ in 0..DRIVES {
                    let states = drive(start, &rates, PARTS, &mut rng);
                    let end = states[states.len() - 1];
                    if !set.contains_state(steps, end, tolerance) {
                        row.outside += 1;
                        let margin = set.state_margins(steps, end).position_m;
                        row.farthest_m = row.farthest_m.max(-margin);
                    }
                }
            }
            rows.push(row);
        }
    }
    let Tolerance { position_m, heading_rad } = tolerance;
    Ok(Check { tolerance_m: position_m, tolerance_rad: heading_rad, rows })
}
