//! The array `meta`: what the values of a file are.

use super::arrays::values;
use serde::{Deserialize, Serialize};
use sidestep::document::from_value;
use sidestep::invalid::Invalid;
use sidestep::reachability::{Method, Nodes, PursuitGame, SampledValue};
use std::io::{Read, Seek};
use zip::ZipArchive;

const FORMAT: &str = "sidestep-value-npz/1";

const STORED: &str = "value: V in metres, the largest range margin (range - radius) that the \
                      evader can keep for the horizon; V <= 0 where the pursuer can force a \
                      capture. Pursuer in the evader's frame: x ahead, y to the left, psi \
                      (relative heading) counter-clockwise; bearings from straight ahead, \
                      counter-clockwise; periodic axes leave out the node at 2 pi. horizon \
                      null is infinite. float32, row-major over axis0, axis1, axis2. sheet, \
                      where there is one: Q in metres, with V(r, b, psi) = max(Q(r, b, psi), \
                      Q(r, -b, -psi)); smooth where V has a kink, so interpolate Q, not V";

/// The content of `meta`.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Meta {
    format: String,
    pub(super) method: String,
    /// The name in `nodes`, repeated where it is easily found.
    coordinates: String,
    axes: [String; 3],
    units: [String; 3],
    periodic: [bool; 3],
    stored: String,
    pub(super) game: PursuitGame,
    /// Seconds; none for the converged value, since JSON has no infinity.
    pub(super) horizon: Option<f64>,
    pub(super) nodes: Nodes,
    /// Whether there is an array `sheet`.
    pub(super) sheet: bool,
    /// Whether the solve converged; null for a finite horizon, absent in older files.
    #[serde(default)]
    pub(super) converged: Option<bool>,
    /// If it did not: [`SampledValue::unsettled_m`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) unsettled_m: Option<f64>,
}

/// The content of `meta` for this function.
pub(super) fn meta(samples: &SampledValue, method: Method) -> Meta {
    let words = |words: [&str; 3]| words.map(str::to_owned);
    let (coordinates, axes, units, periodic) = match samples.nodes() {
        Nodes::Polar { .. } => {
            let axes = words(["range", "bearing", "psi"]);
            ("polar", axes, words(["m", "rad", "rad"]), [false, true, true])
        }
        Nodes::Cartesian { .. } => {
            let axes = words(["x", "y", "psi"]);
            ("cartesian", axes, words(["m", "m", "rad"]), [false, false, true])
        }
    };
    let horizon_s = samples.horizon_s();
    Meta {
        format: FORMAT.to_owned(),
        method: method.name().to_owned(),
        coordinates: coordinates.to_owned(),
        axes,
        units,
        periodic,
        stored: STORED.to_owned(),
        game: samples.game(),
        horizon: horizon_s.is_finite().then_some(horizon_s),
        nodes: samples.nodes(),
        sheet: samples.sheet().is_some(),
        converged: horizon_s.is_infinite().then(|| samples.unsettled_m().is_none()),
        unsettled_m: samples.unsettled_m(),
    }
}

/// Reads `meta`, of this version and consistent.
pub(super) fn read_meta<R: Read + Seek>(archive: &mut ZipArchive<R>) -> Result<Meta, Invalid> {
    let bytes: Vec<u8> = values(archive, "meta", None)?;
    let json: serde_json::Value =
        serde_json::from_slice(&bytes).map_err(|e| Invalid::new("meta", "JSON", e))?;
    let found = json.get("format").cloned().unwrap_or_default();
    if found != FORMAT {
        return Err(Invalid::new("meta.format", format!("{FORMAT:?}"), found));
    }
    let meta: Meta = from_value(&json).map_err(|e| e.within("meta"))?;
    let coordinates = match meta.nodes {
        Nodes::Polar { .. } => "polar",
        Nodes::Cartesian { .. } => "cartesian",
    };
    if meta.coordinates != coordinates {
        let expected = format!("{coordinates:?}, as meta.nodes says");
        return Err(Invalid::new("meta.coordinates", expected, meta.coordinates));
    }
    if ![Method::Exact, Method::Polar, Method::Cartesian].iter().any(|m| m.name() == meta.method) {
        return Err(Invalid::new("meta.method", "exact, polar or cartesian", meta.method));
    }
    Ok(meta)
}
