//! Random admissible drives, and the conservative polygons that must contain them.

use std::error::Error;

use serde::Serialize;
use serde_json::json;
use sidestep::math::SeededRng;
use sidestep::reach::polygon::{signed_area, signed_distance};
use sidestep::reach::{PolygonSettings, PositionUncertainty, StartSet};
use sidestep::vehicle::Pose;

use crate::Found;
use crate::drives::{KINDS, Kind, any_pose, drive, set};
use crate::starts::pose_at;

/// Accuracy of the conservative polygons (m), and of the exact polygons for comparison (m).
const ACCURACY_M: f64 = 1e-3;
const EXACT_M: f64 = 1e-4;
/// Every fifth polygon is compared, because exact polygons of uncertain starts are slow.
const COMPARED: usize = 5;
/// Bounds per kind, drives per bounds, and parts per step.
const BOUNDS: usize = 125;
const DRIVES: usize = 200;
const PARTS: usize = 5;
/// Maximum number of steps. Up to this number, the front and rear boundaries are graphs of
/// functions.
const STEPS: usize = 15;

/// Results for bounds of one kind, with poses and uncertain starts.
#[derive(Serialize)]
struct OfKind {
    kind: Kind,
    drives: usize,
    /// Number of positions that were tested against a polygon.
    positions: usize,
    /// Minimum distance of a position from the edge of its polygon (m). Negative if the position is
    /// outside.
    least_margin_m: f64,
    /// Number of polygons that were compared with exact polygons.
    compared: usize,
    /// Maximum distance by which a conservative polygon exceeds the exact polygon (m).
    excess_m: f64,
    /// Maximum excess area (m²), and maximum relative excess for exact areas of at least 0.1 m².
    excess_m2: f64,
    excess_share: f64,
}

impl OfKind {
    /// Compares a conservative polygon with the exact polygon.
    fn compare(&mut self, drawn: &[[f64; 2]], exact: &[[f64; 2]]) {
        self.compared += 1;
        let beyond = drawn.iter().map(|&vertex| signed_distance(exact, vertex));
        self.excess_m = beyond.fold(self.excess_m, f64::max);
        let area = signed_area(exact);
        let excess = signed_area(drawn) - area;
        self.excess_m2 = self.excess_m2.max(excess);
        if area >= 0.1 {
            self.excess_share = self.excess_share.max(excess / area);
        }
    }
}

/// A random start. Half of the starts are poses; the others are uncertain in position, heading or
/// both.
fn start(rng: &mut SeededRng) -> Result<StartSet, Box<dyn Error>> {
    let pose = any_pose(rng);
    if rng.below(2) == 0 {
        return Ok(pose.into());
    }
    let position = match rng.below(3) {
        0 => PositionUncertainty::None,
        1 => PositionUncertainty::Disc { radius_m: rng.uniform(0.0, 1.0) },
        _ => PositionUncertainty::Box {
            along_m: rng.uniform(0.0, 1.0),
            across_m: rng.uniform(0.0, 0.5),
        },
    };
    Ok(StartSet::new(pose, position, rng.uniform(0.0, 0.5))?)
}

/// A random pose in the start set. Each coordinate is extreme with probability ½.
fn begin(start: &StartSet, rng: &mut SeededRng) -> Pose {
    let mut signed = || {
        let share = rng.uniform(-1.0, 1.0);
        if rng.below(2) == 0 { share } else { share.signum() }
    };
    let shares = [signed(), signed(), signed()];
    pose_at(start, shares)
}

fn of_kind(kind: Kind, rng: &mut SeededRng) -> Result<OfKind, Box<dyn Error>> {
    let surely = PolygonSettings::new(ACCURACY_M, 2)?.conservative();
    let exact = PolygonSettings::new(EXACT_M, 4)?;
    let mut found = OfKind {
        kind,
        drives: BOUNDS * DRIVES,
        positions: 0,
        least_margin_m: f64::INFINITY,
        compared: 0,
        excess_m: 0.0,
        excess_m2: 0.0,
        excess_share: 0.0,
    };
    for i in 0..BOUNDS {
        let rates = kind.bounds(1 + rng.below(STEPS), rng);
        let start = start(rng)?;
        let set = set(start, &rates)?;
        let (steps, middle) = (set.steps(), set.steps().div_ceil(2));
        let polygons = |settings| {
            let step = |step| set.step_polygon(step, settings);
            [set.tube_polygon(settings), step(middle), step(steps)]
        };
        let drawn = polygons(surely);
        if i % COMPARED == 0 {
            drawn
                .iter()
                .zip(&polygons(exact))
                .for_each(|(drawn, truly)| found.compare(drawn, truly));
        }
        let [tube, at_middle, at_end] = &drawn;
        for _ in 0..DRIVES {
            let states = drive(begin(&start, rng), &rates, PARTS, rng);
            let after = |step: usize| states[step * PARTS - 1].position();
            for (polygon, position) in [
                (tube, states[rng.below(states.len())].position()),
                (tube, after(steps)),
                (at_middle, after(middle)),
                (at_end, after(steps)),
            ] {
                found.positions += 1;
                found.least_margin_m =
                    found.least_margin_m.min(-signed_distance(polygon, position));
            }
        }
    }
    Ok(found)
}

pub(crate) fn check() -> Found {
    let mut rng = SeededRng::new(61);
    let kinds = KINDS.into_iter().map(|kind| of_kind(kind, &mut rng));
    let kinds = kinds.collect::<Result<Vec<_>, _>>()?;
    Ok(json!({ "accuracy_m": ACCURACY_M, "kinds": kinds }))
}
