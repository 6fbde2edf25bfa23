//! Value functions as NumPy archives.
//!
//! An archive contains `value` (float32, V in metres, row-major), `axis0`, `axis1`, `axis2`
//! (float64, the node coordinates) and `meta` (a JSON object as uint8). In polar coordinates the
//! axes are range, bearing and relative heading. The bearings cover the full turn, although the
//! library stores only half of it, because V(r, −bearing, −ψ) = V(r, bearing, ψ). An archive can
//! also contain `sheet` (float32, same shape as `value`): the function Q with
//! `V = max(Q(r, bearing, ψ), Q(r, −bearing, −ψ))`. Q is smooth where V has a kink.
//!
//! The archives are for other programs; this library cannot read them. To save and load a value
//! function, use [`ValueFunction::encode`](super::ValueFunction::encode) and
//! [`ValueFunction::decode`](super::ValueFunction::decode).
//!
//! The arrays are not compressed, so that programs in browsers need no compressor.

mod layout;
mod meta;
mod archive;
mod reading;
mod solution;

pub use layout::{Layout, check_axis, shape};
pub use meta::{FORMAT, Meta, meta};
pub use solution::SOLUTION_FORMAT;

use super::{Method, SampledValue};
use archive::Archive;

/// Encodes a value function as a NumPy archive. `method` is the method that computed it. Equal
/// functions give identical bytes. This library cannot read the archive; see
/// [`ValueFunction::encode`](super::ValueFunction::encode).
#[must_use]
pub fn npz(samples: &SampledValue, method: Method) -> Vec<u8> {
    let layout = Layout::new(samples.nodes());
    let game = samples.game();
    let deficit: Vec<f32> = samples.deficit().collect();
    let [_, kept_bearings, headings] = samples.nodes().shape();
    let value = |position: usize| {
        let [i, j, k] = layout.kept(layout.index(position));
        let w = deficit[(i * kept_bearings + j) * headings + k];
        (layout.margin(&game, [i, j, k]) + f64::from(w)) as f32
    };
    let count: usize = layout.shape.iter().product();
    let mut archive = Archive::default();
    archive.add("value", &layout.shape, (0..count).map(value));
    for (axis, name) in layout.axes.iter().zip(["axis0", "axis1", "axis2"]) {
        archive.add(name, &[axis.len()], axis.iter().copied());
    }
    if let Some(sheet) = samples.sheet() {
        let sheet = sheet.enumerate().map(|(position, q)| {
            (layout.margin(&game, layout.index(position)) + f64::from(q)) as f32
        });
        archive.add("sheet", &layout.shape, sheet);
    }
    let meta = serde_json::to_vec(&meta(samples, method)).unwrap_or_default();
    archive.add("meta", &[meta.len()], meta.into_iter());
    archive.finish()
}
