//! A compact and deterministic encoding of value functions.
//!
//! A closed form is encoded as a line of JSON with its parameters. A sampled function is encoded as
//! a line of JSON, followed by its deficits as multiples of [`QUANTUM_M`]. `"octets"` is the number
//! of bytes after the line. Each deficit is stored as its difference from a prediction, which is
//! computed from the neighbours at lower indices. The differences are variable-length integers (7
//! bits per byte, low bits first, zigzag sign). With `"float32": true`, the deficits follow as
//! little-endian f32 instead.
//!
//! `"crc32"` in the first line of a file is the checksum of all bytes without this entry. It is not
//! part of the function's address ([`ValueFunction::id`]). Older files have no checksum.

mod body;

use super::checksum::checksum;
use super::exact::ExactValue;
use super::pursuit::PursuitGame;
use super::sampled::{Nodes, SampledValue};
use super::value_function::ValueFunction;
use crate::invalid::{Invalid, length, positive};
use body::{floats, rounded, take_floats, take_rounded};
use serde::{Deserialize, Serialize};
#[cfg(feature = "study")]
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// Deficits are rounded to multiples of a rounding step: this quantum (m) times
/// [`PursuitGame::length_unit_m`] (1 for a radius between 2.1 m and 4.2 m). The rounding error is
/// at most half a rounding step.
pub const QUANTUM_M: f64 = 0.001;

const FORMAT: &str = "sidestep-value-function/1";

#[derive(Serialize, Deserialize)]
#[serde(tag = "method", rename_all = "snake_case", deny_unknown_fields)]
enum Header {
    Exact {
        format: String,
        speed_mps: f64,
        turn_rate_radps: f64,
        radius_m: f64,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        crc32: Option<u32>,
    },
    Sampled {
        format: String,
        game: PursuitGame,
        nodes: Nodes,
        /// `None` for the converged value, since JSON has no infinity.
        horizon_s: Option<f64>,
        /// [`SampledValue::unsettled_m`]; absent if it is `None`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        unsettled_m: Option<f64>,
        /// Whether a sheet follows the deficits. Its values are stored as differences from the
        /// deficits, unless `float32` is set.
        sheet: bool,
        #[serde(rename = "octets")]
        bytes: usize,
        /// Whether the deficits and the sheet follow as f32.
        #[serde(default, skip_serializing_if = "core::ops::Not::not")]
        float32: bool,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        crc32: Option<u32>,
    },
}

impl Header {
    fn crc32(&mut self) -> &mut Option<u32> {
        let (Self::Exact { crc32, .. } | Self::Sampled { crc32, .. }) = self;
        crc32
    }

    /// The bytes of this header, followed by `body`.
    fn with(&self, body: &[u8]) -> Vec<u8> {
        // Finite numbers and strings always have a JSON form.
        let mut bytes = serde_json::to_vec(self).unwrap_or_default();
        if let Self::Sampled { .. } = self {
            bytes.push(b'\n');
            bytes.extend(body);
        }
        bytes
    }
}

impl ValueFunction {
    /// The bytes in which this function is stored and served. A solved function is rounded to [`QUANTUM_M`].
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let (header, body) = self.parts(false);
        header.with(&body)
    }

    /// Like [`Self::encode`], but with a checksum. It is meant for files, which have no other
    /// protection.
    #[must_use]
    pub fn encode_with_checksum(&self) -> Vec<u8> {
        summed(self.parts(false))
    }

    /// Like [`Self::encode_with_checksum`], but without rounding, so that [`Self::decode`] returns
    /// an equal function. It takes three to four times as many bytes.
    #[must_use]
    pub fn encode_unrounded(&self) -> Vec<u8> {
        summed(self.parts(true))
    }

    /// A header without a checksum, and the body after it.
    fn parts(&self, float32: bool) -> (Header, Vec<u8>) {
        let format = FORMAT.to_owned();
        let sampled = match self {
            Self::Exact(exact) => {
                let header = Header::Exact {
                    format,
                    speed_mps: exact.speed_mps(),
                    turn_rate_radps: exact.turn_rate_radps(),
                    radius_m: exact.radius_m(),
                    crc32: None,
                };
                return (header, Vec::new());
            }
            Self::Sampled(sampled) => sampled,
        };
        let body = if float32 { floats(sampled) } else { rounded(sampled) };
        let horizon_s = sampled.horizon_s();
        let header = Header::Sampled {
            format,
            game: sampled.game(),
            nodes: sampled.nodes(),
            horizon_s: horizon_s.is_finite().then_some(horizon_s),
            unsettled_m: sampled.unsettled_m(),
            sheet: sampled.sheet().is_some(),
            bytes: body.len(),
            float32,
            crc32: None,
        };
        (header, body)
    }

    /// Decodes the bytes of [`Self::encode`] or [`Self::encode_unrounded`].
    ///
    /// # Errors
    /// [`Invalid`] if the bytes are not a value function, are truncated or damaged, or are of
    /// another version.
    pub fn decode(bytes: &[u8]) -> Result<Self, Invalid> {
        let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
        let mut header: Header = serde_json::from_slice(&bytes[..end])
            .map_err(|e| Invalid::new("value function", FORMAT, e))?;
        let (Header::Exact { format, .. } | Header::Sampled { format, .. }) = &header;
        if format != FORMAT {
            return Err(Invalid::new("format", FORMAT, format));
        }
        let rest = bytes.get(end + 1..).unwrap_or_default();
        let expected = if let Header::Sampled { bytes, .. } = header { bytes } else { 0 };
        length("value function bytes", expected, rest.len())?;
        if let Some(stated) = header.crc32().take()
            && stated != checksum(&header.with(rest))
        {
            let expected = format!("bytes that match the checksum in the first line, {stated}");
            return Err(Invalid::new("value function", expected, "damaged bytes"));
        }
        match header {
            Header::Exact { speed_mps, turn_rate_radps, radius_m, .. } => {
                ExactValue::new(speed_mps, turn_rate_radps, radius_m).map(Self::Exact)
            }
            Header::Sampled { game, nodes, horizon_s, unsettled_m, sheet, float32, .. } => {
                unsettled_m.map(|moved| positive("unsettled_m", moved)).transpose()?;
                nodes.check()?;
                let quantum = QUANTUM_M * game.check()?.length_unit_m();
                let (deficit, sheet) = if float32 {
                    take_floats(rest, nodes, sheet, quantum)?
                } else {
                    take_rounded(rest, nodes, sheet, quantum)?
                };
                let horizon_s = horizon_s.unwrap_or(f64::INFINITY);
                let sampled =
                    SampledValue::new(game, nodes, horizon_s, &deficit, sheet.as_deref())?;
                Ok(Self::Sampled(Arc::new(sampled.unsettled(unsettled_m))))
            }
        }
    }

    /// The function's address: the content hash (SHA-256, hexadecimal) of its bytes without a
    /// checksum.
    #[cfg(feature = "study")]
    #[must_use]
    pub fn id(&self) -> String {
        hex::encode(Sha256::digest(self.encode()))
    }
}

/// The encoded bytes, with their checksum in the header.
fn summed((mut header, body): (Header, Vec<u8>)) -> Vec<u8> {
    let sum = checksum(&header.with(&body));
    *header.crc32() = Some(sum);
    header.with(&body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::VehicleModel;

    fn sampled() -> ValueFunction {
        let game = PursuitGame {
            evader: VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 },
            pursuer: VehicleModel { speed_mps: 1.5, turn_rate_radps: 0.8 },
            radius_m: 3.0,
        };
        let nodes = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 9, angle_nodes: 12 };
        let deficit: Vec<f32> = (0..nodes.count()).map(|i| -(i as f32 * 0.37) % 41.0).collect();
        let sheet: Vec<f32> = (0..9 * 12 * 12).map(|i| -(i as f32 * 0.61) % 41.0).collect();
        ValueFunction::Sampled(Arc::new(
            SampledValue::new(game, nodes, f64::INFINITY, &deficit, Some(&sheet)).unwrap(),
        ))
    }

    #[test]
    fn bytes_survive_a_round_trip() {
        let exact = ValueFunction::Exact(ExactValue::new(2.0, 0.3, 3.0).unwrap());
        assert_eq!(exact, ValueFunction::decode(&exact.encode()).unwrap());
        assert_eq!(exact.id().len(), 64);
        let function = sampled();
        let again = ValueFunction::decode(&function.encode()).unwrap();
        assert_eq!(function.id(), again.id());
        let (ValueFunction::Sampled(a), ValueFunction::Sampled(b)) = (&function, &again) else {
            panic!("both are sampled");
        };
        for (a, b) in a.deficit().zip(b.deficit()) {
            assert!(f64::from((a - b).abs()) <= 0.5 * QUANTUM_M + 1e-5, "{a} {b}");
        }
    }

    #[test]
    fn unrounded_bytes_are_of_an_equal_function() {
        let exact = ValueFunction::Exact(ExactValue::new(2.0, 0.3, 3.0).unwrap());
        let ValueFunction::Sampled(function) = sampled() else { panic!("it is sampled") };
        let restless = SampledValue::clone(&function).unsettled(Some(1.25e-3));
        for function in [exact, sampled(), ValueFunction::Sampled(Arc::new(restless))] {
            let bytes = function.encode_unrounded();
            let again = ValueFunction::decode(&bytes).unwrap();
            assert!(again == function && again.encode_unrounded() == bytes);
            assert!(ValueFunction::decode(&bytes[..bytes.len() - 1]).is_err());
        }
    }

    #[test]
    fn damage_is_noticed() {
        let exact = ValueFunction::Exact(ExactValue::new(2.0, 0.3, 3.0).unwrap());
        let summed = [exact.encode_with_checksum(), sampled().encode_with_checksum()];
        for bytes in summed.into_iter().chain([sampled().encode_unrounded()]) {
            for at in 0..bytes.len() {
                for bit in [0x01, 0x40] {
                    let mut damaged = bytes.clone();
                    damaged[at] ^= bit;
                    assert!(ValueFunction::decode(&damaged).is_err(), "byte {at}");
                }
            }
            assert!(ValueFunction::decode(&[&bytes[..], b"\nx"].concat()).is_err());
        }
    }

    /// Older files have no checksum, and their id is the hash of all their bytes.
    #[test]
    fn files_without_a_checksum_are_read() {
        for function in [ValueFunction::Exact(ExactValue::new(2.0, 0.3, 3.0).unwrap()), sampled()] {
            let (header, body) = function.parts(false);
            let older = header.with(&body);
            assert_eq!(hex::encode(Sha256::digest(&older)), function.id());
            assert_eq!(ValueFunction::decode(&older).unwrap().id(), function.id());
        }
    }

    #[test]
    fn whether_it_settled_is_stored() {
        let settled = sampled();
        let ValueFunction::Sampled(function) = &settled else { panic!("it is sampled") };
        let restless = SampledValue::clone(function).unsettled(Some(1.25e-3));
        let restless = ValueFunction::Sampled(Arc::new(restless));
        let again = |function: &ValueFunction| ValueFunction::decode(&function.encode()).unwrap();
        assert_eq!(again(&restless).unsettled_m(), Some(1.25e-3));
        assert_eq!(again(&settled).unsettled_m(), None);
        assert_ne!(restless.id(), settled.id());
        // Converged functions keep their bytes, and therefore their id.
        let header = settled.encode();
        assert!(!String::from_utf8_lossy(&header[..300]).contains("unsettled"));
    }

    #[test]
    fn other_bytes_are_refused() {
        assert!(ValueFunction::decode(b"\x93NUMPY").is_err());
        assert!(ValueFunction::decode(b"").is_err());
        let text = br#"{"method":"exact","format":"sidestep-value-function/9","speed_mps":2,"turn_rate_radps":1,"radius_m":3}"#;
        assert_eq!(ValueFunction::decode(text).unwrap_err().field, "format");
        let bytes = sampled().encode();
        for end in 0..bytes.len() {
            assert!(ValueFunction::decode(&bytes[..end]).is_err(), "{end} bytes");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(ValueFunction::decode(&longer).is_err());
        // A header that announces more bytes than follow must not cause an allocation of that size.
        let text = String::from_utf8_lossy(&bytes[..120]).replace("\"range_nodes\":9", "");
        assert!(ValueFunction::decode(text.as_bytes()).is_err());
    }
}
