//! The values of a sampled function as bytes.

use super::QUANTUM_M;
use crate::invalid::Invalid;
use crate::reachability::sampled::{Nodes, SampledValue};

/// Upper bound on the number of quanta of a deficit: about 10⁹ m.
const MOST_STEPS: u64 = 1 << 40;

/// Encodes deficits and sheet as whole numbers of quanta, and stores the differences from
/// predictions.
pub(super) fn rounded(sampled: &SampledValue) -> Vec<u8> {
    let quantum = QUANTUM_M * sampled.game().length_unit_m();
    let steps: Vec<i64> =
        sampled.deficit().map(|w| (f64::from(w) / quantum).round() as i64).collect();
    let mut body = Vec::with_capacity(steps.len() + steps.len() / 4);
    let predicted = Predictor::new(sampled.nodes().shape());
    for position in 0..steps.len() {
        put_signed(&mut body, steps[position] - predicted.at(&steps, position));
    }
    let mirror = Mirror(sampled.nodes().shape());
    for (position, w) in sampled.sheet().into_iter().flatten().enumerate() {
        let step = (f64::from(w) / quantum).round() as i64;
        put_signed(&mut body, step - steps[mirror.of(position)]);
    }
    body
}

/// Deficits, and a sheet if there is one.
pub(super) type Values = (Vec<f32>, Option<Vec<f32>>);

/// Decodes the bytes of [`rounded`].
pub(super) fn take_rounded(
    mut rest: &[u8],
    nodes: Nodes,
    sheet: bool,
    quantum: f64,
) -> Result<Values, Invalid> {
    // Every value takes at least a byte, so this check bounds the allocation.
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
        let found = format!("{} more bytes", rest.len());
        return Err(Invalid::new("value function", "the end of the bytes", found));
    }
    Ok((deficit, sheet))
}

/// Encodes deficits and sheet as little-endian f32.
pub(super) fn floats(sampled: &SampledValue) -> Vec<u8> {
    let values = sampled.deficit().chain(sampled.sheet().into_iter().flatten());
    values.flat_map(f32::to_le_bytes).collect()
}

/// Decodes the bytes of [`floats`].
pub(super) fn take_floats(
    rest: &[u8],
    nodes: Nodes,
    sheet: bool,
    quantum: f64,
) -> Result<Values, Invalid> {
    let (values, _) = rest.as_chunks::<4>();
    let of_sheet = if sheet { Mirror(nodes.shape()).count() } else { 0 };
    let needed = nodes.count().saturating_add(of_sheet).saturating_mul(4);
    crate::invalid::length("value function bytes", needed, rest.len())?;
    let mut deficit: Vec<f32> = values.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let most = MOST_STEPS as f64 * quantum;
    // No range contains NaN, so NaN is rejected too.
    let fits = |w: &f32| (-most..=most).contains(&f64::from(*w));
    if let Some(position) = deficit.iter().position(|w| !fits(w)) {
        return Err(Invalid::new(format!("value[{position}]"), "a deficit", deficit[position]));
    }
    let sheet_values = deficit.split_off(nodes.count());
    Ok((deficit, sheet.then_some(sheet_values)))
}

/// Maps the index of a value in a sheet to the index of the deficit at the same state. A sheet covers
/// all bearings. The deficit covers half of them; the other half is its mirror image.
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

/// Predicts an entry from the entries before it, as the missing corner of a parallelepiped (Lorenzo
/// predictor).
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

/// Reads the next difference and returns `base` plus this difference.
fn take_step(bytes: &mut &[u8], what: &str, position: usize, base: i64) -> Result<i64, Invalid> {
    let field = || format!("{what}[{position}]");
    let folded = take(bytes).ok_or_else(|| Invalid::new(field(), "a whole number", "nothing"))?;
    let difference = (folded >> 1) as i64 ^ -((folded & 1) as i64);
    let step = base.wrapping_add(difference);
    if step.unsigned_abs() > MOST_STEPS {
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
