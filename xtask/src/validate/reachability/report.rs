//! What the library's example `validate` prints. Units and meanings are stated there.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::bench::peers::Accuracy;

#[derive(Deserialize)]
pub(super) struct Report {
    pub(super) closed_form: Vec<ClosedForm>,
    pub(super) polar: Vec<Polar>,
    pub(super) chase: Chase,
    pub(super) cartesian: Cartesian,
    pub(super) unequal: Unequal,
    pub(super) traced: Errors,
    pub(super) slices_deg: Vec<f64>,
    pub(super) error_map: ErrorMap,
    pub(super) figures: BTreeMap<String, String>,
}

#[derive(Deserialize)]
pub(super) struct Errors {
    pub(super) count: usize,
    pub(super) p50: f64,
    pub(super) p90: f64,
    pub(super) p99: f64,
    pub(super) max: f64,
}

#[derive(Deserialize)]
pub(super) struct Player {
    pub(super) speed_mps: f64,
    pub(super) turn_rate_radps: f64,
}

#[derive(Deserialize)]
pub(super) struct Game {
    pub(super) evader: Player,
    pub(super) pursuer: Player,
    pub(super) radius_m: f64,
}

#[derive(Deserialize)]
pub(super) struct ClosedForm {
    pub(super) game: String,
    pub(super) parameters: Game,
    pub(super) residual: Errors,
    pub(super) residual_of_differences: Errors,
    pub(super) closing: usize,
    pub(super) barrier: Errors,
    pub(super) reference: (usize, f64),
    pub(super) volume: f64,
    pub(super) reference_volume: f64,
}

#[derive(Deserialize)]
pub(super) struct Polar {
    pub(super) game: String,
    pub(super) accuracy: String,
    pub(super) nodes: [usize; 2],
    pub(super) range_m: f64,
    pub(super) sweeps: usize,
    pub(super) drift_m: f64,
    pub(super) random: Errors,
    pub(super) at_nodes: Errors,
    pub(super) volume_percent: f64,
}

#[derive(Deserialize)]
pub(super) struct Chase {
    pub(super) faster_percent: f64,
    pub(super) equal: (usize, f64),
    pub(super) chase: (usize, f64),
    pub(super) most_sweeps: usize,
}

#[derive(Deserialize)]
pub(super) struct Cartesian {
    pub(super) horizon_s: f64,
    pub(super) air3d: Vec<Air3d>,
    pub(super) exact: Vec<Air3d>,
    pub(super) converged: Accuracy,
    pub(super) orders: Vec<Order>,
}

#[derive(Deserialize)]
pub(super) struct Air3d {
    pub(super) scheme: String,
    pub(super) nodes: [usize; 3],
    pub(super) dx_m: f64,
    pub(super) cfl: f64,
    pub(super) steps: usize,
    pub(super) accuracy: Accuracy,
}

#[derive(Deserialize)]
pub(super) struct Order {
    pub(super) scheme: String,
    pub(super) cfl: f64,
    pub(super) advised: bool,
    pub(super) errors: Vec<(f64, f64)>,
}

#[derive(Deserialize)]
pub(super) struct Unequal {
    pub(super) parameters: Game,
    pub(super) horizon_s: f64,
    pub(super) nodes: [usize; 3],
    pub(super) states: usize,
    pub(super) within: usize,
    pub(super) differences: Errors,
    pub(super) standard_and_fine: Errors,
    pub(super) above_finite: f64,
}

#[derive(Deserialize)]
pub(super) struct ErrorMap {
    pub(super) origin: (f64, f64),
    pub(super) cell_m: f64,
    pub(super) rows: Vec<Vec<f64>>,
}
