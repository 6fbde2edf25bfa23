//! A value function as the rest of the program sees it, however it was found.

use super::exact::ExactValue;
use super::level_set::{CurveSettings, radial_level_curve};
use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The value of a pursuit game at any relative state.
#[derive(Clone, Debug, PartialEq)]
pub enum ValueFunction {
    /// Identical vehicles: the closed form.
    Exact(ExactValue),
}

/// The transport form. For the exact method the game says it all.
#[derive(Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "snake_case", deny_unknown_fields)]
enum Encoded {
    Exact { format: String, speed_mps: f64, turn_rate_radps: f64, radius_m: f64 },
}

const FORMAT: &str = "sidestep-value-function/1";

impl ValueFunction {
    /// V, m, at the pursuer's pose (x, y, ψ) in the evader's frame; ≤ 0 means
    /// that a capture can be forced.
    #[must_use]
    pub fn value(&self, relative: [f64; 3]) -> f64 {
        match self {
            Self::Exact(exact) => exact.value(relative),
        }
    }

    /// {V = `level`} at relative heading `psi`, as a closed counter-clockwise
    /// polygon in the evader's frame, m. `level` must be above −R.
    #[must_use]
    pub fn level_curve(&self, psi: f64, level: f64, settings: CurveSettings) -> Vec<[f64; 2]> {
        match self {
            Self::Exact(exact) => radial_level_curve(
                |x, y| exact.value([x, y, psi]),
                level,
                exact.radius_m() + level,
                exact.range_bound_m(level),
                settings,
            ),
        }
    }

    /// The octets under which this function is stored and served.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let Self::Exact(exact) = self;
        let encoded = Encoded::Exact {
            format: FORMAT.to_owned(),
            speed_mps: exact.speed_mps(),
            turn_rate_radps: exact.turn_rate_radps(),
            radius_m: exact.radius_m(),
        };
        // Four numbers and two strings always have a JSON form.
        serde_json::to_vec(&encoded).unwrap_or_default()
    }

    /// The function that [`Self::encode`] wrote.
    ///
    /// # Errors
    /// [`Invalid`] if the octets are no such function, or of another version.
    pub fn decode(octets: &[u8]) -> Result<Self, Invalid> {
        let Encoded::Exact { format, speed_mps, turn_rate_radps, radius_m } =
            serde_json::from_slice(octets)
                .map_err(|e| Invalid::new("value function", FORMAT, e))?;
        if format != FORMAT {
            return Err(Invalid::new("format", FORMAT, format));
        }
        ExactValue::new(speed_mps, turn_rate_radps, radius_m).map(Self::Exact)
    }

    /// Content hash (SHA-256, hexadecimal) of the octets: the function's address.
    #[must_use]
    pub fn id(&self) -> String {
        hex(&Sha256::digest(self.encode()))
    }
}

/// Lower-case hexadecimal digits.
#[must_use]
pub fn hex(octets: &[u8]) -> String {
    octets.iter().map(|octet| format!("{octet:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octets_survive_a_round_trip() {
        let value = ValueFunction::Exact(ExactValue::new(2.0, 0.3, 3.0).unwrap());
        let again = ValueFunction::decode(&value.encode()).unwrap();
        assert_eq!(value, again);
        assert_eq!(value.id(), again.id());
        assert_eq!(value.id().len(), 64);
    }

    #[test]
    fn other_octets_are_refused() {
        assert!(ValueFunction::decode(b"\x93NUMPY").is_err());
        let text = br#"{"method":"exact","format":"sidestep-value-function/9","speed_mps":2,"turn_rate_radps":1,"radius_m":3}"#;
        assert_eq!(ValueFunction::decode(text).unwrap_err().field, "format");
    }
}
