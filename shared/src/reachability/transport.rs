//! The bytes of a value function: few, and the same for the same function.
//!
//! The closed form is a line of JSON with its parameters. A sampled function is a
//! line of JSON (with `"bytes"`, the number of bytes that follow) and then its deficits in
//! whole [`QUANTUM_M`]: the difference to the prediction from the neighbours towards the
//! origin, as variable-length integers (7 bits a byte, low first, zigzag sign).

use super::exact::ExactValue;
use super::pursuit::PursuitGame;
use super::sampled::{Nodes, SampledValue};
use super::value_function::ValueFunction;
use crate::invalid::{Invalid, positive};
use serde::{Deserialize, Serialize};
#[cfg(feature = "study")]
use sha2::{Digest, Sha256};
use std::sync::Arc;

/// Deficits are stored in multiples of this, m, times [`PursuitGame::length_unit_m`] (1 for a
/// radius between 2.1 m and 4.2 m): an error of at most half of it.
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
    },
    Sampled {
        format: String,
        game: PursuitGame,
        nodes: Nodes,
        /// None for the converged value, since JSON has no infinity.
        horizon_s: Option<f64>,
        /// [`SampledValue::unsettled_m`]; absent where there is none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        unsettled_m: Option<f64>,
        /// Whether a sheet follows the deficits: its differences to them.
        sheet: bool,
        #[serde(rename = "octets")]
        bytes: usize,
    },
}

impl ValueFunction {
    /// The bytes in which this function is stored and served.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let format = FORMAT.to_owned();
        match self {
            Self::Exact(exact) => line(&Header::Exact {
                format,
                speed_mps: exact.speed_mps(),
                turn_rate_radps: exact.turn_rate_radps(),
                radius_m: exact.radius_m(),
            }),
            Self::Sampled(sampled) => {
                let quantum = QUANTUM_M * sampled.game().length_unit_m();
                let steps: Vec<i64> =
                    sampled.deficit().map(|w| (f64::from(w) / quantum).round() as i64).collect();
                let mut body = Vec::with_capacity(steps.len() + steps.len() / 4);
                let predicted = Predictor::new(sampled.nodes().shape());
                for position in 0..steps.len() {
                    put_signed(&mut body, steps[position] - predicted.at(&steps, position));
                }
                let mut sheet = false;
                if let Some(values) = sampled.sheet() {
                    sheet = true;
                    let mirror = Mirror(sampled.nodes().shape());
                    for (position, w) in values.enumerate() {
                        let step = (f64::from(w) / quantum).round() as i64;
                        put_signed(&mut body, step - steps[mirror.of(position)]);
                    }
                }
                let horizon_s = sampled.horizon_s();
                let mut bytes = line(&Header::Sampled {
                    format,
                    game: sampled.game(),
                    nodes: sampled.nodes(),
                    horizon_s: horizon_s.is_finite().then_some(horizon_s),
                    unsettled_m: sampled.unsettled_m(),
                    sheet,
                    bytes: body.len(),
                });
                bytes.push(b'\n');
                bytes.extend(body);
                bytes
            }
        }
    }

    /// The function that [`Self::encode`] wrote.
    ///
    /// # Errors
    /// [`Invalid`] if the bytes are no such function, truncated, or of another version.
    pub fn decode(bytes: &[u8]) -> Result<Self, Invalid> {
        let end = bytes.iter().position(|byte| *byte == b'\n').unwrap_or(bytes.len());
        let header: Header = serde_json::from_slice(&bytes[..end])
            .map_err(|e| Invalid::new("value function", FORMAT, e))?;
        let (Header::Exact { format, .. } | Header::Sampled { format, .. }) = &header;
        if format != FORMAT {
            return Err(Invalid::new("format", FORMAT, format));
        }
        match header {
            Header::Exact { speed_mps, turn_rate_radps, radius_m, .. } => {
                ExactValue::new(speed_mps, turn_rate_radps, radius_m).map(Self::Exact)
            }
            Header::Sampled {
                game, nodes, horizon_s, unsettled_m, sheet, bytes: length, ..
            } => {
                unsettled_m.map(|moved| positive("unsettled_m", moved)).transpose()?;
                nodes.check()?;
                let mut rest = bytes.get(end + 1..).unwrap_or_default();
                crate::invalid::length("value function bytes", length, rest.len())?;
                // Every value takes at least a byte, so this bounds what is allocated.
                if nodes.count() > rest.len() {
                    let expected = format!("at least {} bytes of values", nodes.count());
                    return Err(Invalid::new("value function", expected, rest.len()));
                }
                let predicted = Predictor::new(nodes.shape());
                let mut steps: Vec<i64> = Vec::with_capacity(nodes.count());
                for position in 0..nodes.count() {
                    let step = predicted.at(&steps, position);
                    steps.push(take_step(&mut rest, "value", position, step)?);
                }
                let quantum = QUANTUM_M * game.check()?.length_unit_m();
                let metres = |step: &i64| (*step as f64 * quantum) as f32;
                let deficit: Vec<f32> = steps.iter().map(metres).collect();
                let mirror = Mirror(nodes.shape());
                let sheet = if sheet {
                    let count = mirror.count();
                    if count > rest.len() {
                        let expected = format!("at least {count} bytes of the sheet");
                        return Err(Invalid::new("value function", expected, rest.len()));
                    }
                    let values = (0..count).map(|position| {
                        let base = steps[mirror.of(position)];
                        take_step(&mut rest, "sheet", position, base).map(|step| metres(&step))
                    });
                    Some(values.collect::<Result<Vec<f32>, _>>()?)
                } else {
                    None
                };
                if !rest.is_empty() {
                    let found = format!("{} bytes more", rest.len());
                    return Err(Invalid::new("value function", "its end", found));
                }
                let horizon_s = horizon_s.unwrap_or(f64::INFINITY);
                let sampled =
                    SampledValue::new(game, nodes, horizon_s, &deficit, sheet.as_deref())?;
                Ok(Self::Sampled(Arc::new(sampled.unsettled(unsettled_m))))
            }
        }
    }

    /// Content hash (SHA-256, hexadecimal) of the bytes: the function's address.
    #[cfg(feature = "study")]
    #[must_use]
    pub fn id(&self) -> String {
        hex::encode(Sha256::digest(self.encode()))
    }
}

/// Where a sheet's entry, over a full turn of bearings, has its deficit.
struct Mirror([usize; 3]);

impl Mirror {
    fn count(&self) -> usize {
        self.0[0] * self.0[2] * self.0[2]
    }

    fn of(&self, position: usize) -> usize {
        let [_, half, n] = self.0;
        let [i, j, k] = [position / (n * n), position / n % n, position % n];
        let (j, k) = if j < half { (j, k) } else { (n - j, (n - k) % n) };
        (i * half + j) * n + k
    }
}

fn line(header: &Header) -> Vec<u8> {
    // Finite numbers and strings always have a JSON form.
    serde_json::to_vec(header).unwrap_or_default()
}

/// The prediction of an entry from those before it: the corner of the parallelepiped.
struct Predictor {
    strides: [usize; 3],
    shape: [usize; 3],
}

impl Predictor {
    fn new(shape: [usize; 3]) -> Self {
        Self { strides: [shape[1] * shape[2], shape[2], 1], shape }
    }

    fn at(&self, known: &[i64], position: usize) -> i64 {
        let mut sum = 0_i64;
        for corner in 1..8_usize {
            let (mut back, mut exists) = (0, true);
            for d in 0..3 {
                if corner >> d & 1 == 1 {
                    exists &= !(position / self.strides[d]).is_multiple_of(self.shape[d]);
                    back += self.strides[d];
                }
            }
            if exists {
                let value = known[position - back];
                sum += if corner.count_ones() % 2 == 1 { value } else { -value };
            }
        }
        sum
    }
}

fn put(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn put_signed(bytes: &mut Vec<u8>, value: i64) {
    put(bytes, ((value << 1) ^ (value >> 63)) as u64);
}

/// `base` plus the next difference.
fn take_step(bytes: &mut &[u8], what: &str, position: usize, base: i64) -> Result<i64, Invalid> {
    let field = || format!("{what}[{position}]");
    let folded = take(bytes).ok_or_else(|| Invalid::new(field(), "a whole number", "its end"))?;
    let difference = (folded >> 1) as i64 ^ -((folded & 1) as i64);
    let step = base.wrapping_add(difference);
    // Far more than any deficit in metres.
    if step.unsigned_abs() > 1 << 40 {
        return Err(Invalid::new(field(), "a deficit", step));
    }
    Ok(step)
}

fn take(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..63).step_by(7) {
        let (first, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(first & 0x7f) << shift;
        if first & 0x80 == 0 {
            return Some(value);
        }
    }
    None
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
    fn whether_it_settled_is_stored() {
        let settled = sampled();
        let ValueFunction::Sampled(function) = &settled else { panic!("it is sampled") };
        let restless = SampledValue::clone(function).unsettled(Some(1.25e-3));
        let restless = ValueFunction::Sampled(Arc::new(restless));
        let again = |function: &ValueFunction| ValueFunction::decode(&function.encode()).unwrap();
        assert_eq!(again(&restless).unsettled_m(), Some(1.25e-3));
        assert_eq!(again(&settled).unsettled_m(), None);
        assert_ne!(restless.id(), settled.id());
        // Functions that settled keep their bytes, and so their id.
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
        // A header that promises more than follows must not cause an allocation of it.
        let text = String::from_utf8_lossy(&bytes[..120]).replace("\"range_nodes\":9", "");
        assert!(ValueFunction::decode(text.as_bytes()).is_err());
    }
}
