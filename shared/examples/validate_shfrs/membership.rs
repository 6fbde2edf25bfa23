//! Random admissible drives. Does the membership test accept the state at the end of each drive?

use serde_json::json;
use sidestep::math::SeededRng;
use sidestep::reach::Tolerance;

use crate::Found;
use crate::drives::{KINDS, any_pose, drive, set};

/// Numbers of steps ahead.
const HORIZONS: [usize; 4] = [3, 10, 25, 50];
/// Bounds per kind and horizon, drives per bounds, and parts per step.
const BOUNDS: usize = 125;
const DRIVES: usize = 50;
const PARTS: usize = 4;

pub(crate) fn check() -> Found {
    let mut rng = SeededRng::new(64);
    let tolerance = Tolerance::default();
    let mut rows = Vec::new();
    for kind in KINDS {
        for steps in HORIZONS {
            let (mut outside, mut farthest_m) = (0, 0.0_f64);
            for _ in 0..BOUNDS {
                let rates = kind.bounds(steps, &mut rng);
                let start = any_pose(&mut rng);
                let set = set(start, &rates)?;
                for _ in 0..DRIVES {
                    let states = drive(start, &rates, PARTS, &mut rng);
                    let end = states[states.len() - 1];
                    if !set.contains_state(steps, end, tolerance) {
                        outside += 1;
                        let margin = set.state_margins(steps, end).position_m;
                        farthest_m = farthest_m.max(-margin);
                    }
                }
            }
            rows.push(json!({
                "kind": kind,
                "steps": steps,
                "drives": BOUNDS * DRIVES,
                // Number of drives whose last state is found outside, and the maximum distance
                // outside.
                "outside": outside,
                "farthest_m": farthest_m,
            }));
        }
    }
    let Tolerance { position_m, heading_rad } = tolerance;
    Ok(json!({ "tolerance_m": position_m, "tolerance_rad": heading_rad, "rows": rows }))
}
