//! The array `meta`: a description of the file's values.

use crate::reachability::{Method, Nodes, PursuitGame, SampledValue};
use serde::{Deserialize, Serialize};

/// The name and version of the file format.
pub const FORMAT: &str = "sidestep-value-npz/1";

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
pub struct Meta {
    /// [`FORMAT`].
    pub format: String,
    /// [`Method::name`].
    pub method: String,
    /// `polar` or `cartesian`, the same as the entry `coordinates` in `nodes`.
    pub coordinates: String,
    /// The name of each axis.
    pub axes: [String; 3],
    /// The unit of each axis.
    pub units: [String; 3],
    /// Whether each axis is periodic, that is, covers a full turn.
    pub periodic: [bool; 3],
    /// A description of the values.
    pub stored: String,
    /// The game that was solved.
    pub game: PursuitGame,
    /// The horizon (s); `None` for the converged value, since JSON has no infinity.
    pub horizon: Option<f64>,
    /// The nodes.
    pub nodes: Nodes,
    /// Whether the archive contains an array `sheet`.
    pub sheet: bool,
    /// Whether the solve converged; null for a finite horizon, absent in older files.
    #[serde(default)]
    pub converged: Option<bool>,
    /// [`SampledValue::unsettled_m`], if the solve did not converge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unsettled_m: Option<f64>,
}

/// The content of `meta` for a value function.
#[must_use]
pub fn meta(samples: &SampledValue, method: Method) -> Meta {
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
