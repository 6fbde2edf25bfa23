//! Reads value functions from NumPy archives, which [`sidestep::reachability::npz`] writes.

mod arrays;
mod meta;
#[cfg(test)]
mod tests;

use arrays::values;
use meta::read_meta;
use sidestep::invalid::{Invalid, positive};
use sidestep::reachability::npz::{Layout, check_axis, shape};
use sidestep::reachability::{MEMORY_LIMIT_BYTES, Method, SampledValue, ValueFunction};
use std::io::{Read, Seek};
use std::sync::Arc;
use zip::ZipArchive;

/// A value function from a file.
#[derive(Debug)]
pub struct Stored {
    /// The function.
    pub function: ValueFunction,
    /// Whether the solve converged. `None` for a finite horizon, or if the file does not state it.
    pub converged: Option<bool>,
}

/// Reads a file written by [`npz`](sidestep::reachability::npz::npz). Returns the closed form if the
/// file's method was exact, and otherwise the values with float32 accuracy.
///
/// # Errors
/// [`Invalid`] naming an array or a field of `meta` that is missing, truncated, of another version
/// or shape, or not a number.
pub fn read(file: impl Read + Seek) -> Result<Stored, Invalid> {
    let mut archive =
        ZipArchive::new(file).map_err(|e| Invalid::new("", "a NumPy archive (.npz), whole", e))?;
    let meta = read_meta(&mut archive)?;
    meta.nodes.check().map_err(|e| e.within("meta.nodes"))?;
    let game = meta.game.check().map_err(|e| e.within("meta.game"))?;
    let count = shape(&meta.nodes).iter().fold(1_u64, |n, m| n.saturating_mul(*m as u64));
    let needed = count.saturating_mul(6 * size_of::<f32>() as u64);
    if needed > MEMORY_LIMIT_BYTES {
        let expected = format!("nodes that fit {} MiB", MEMORY_LIMIT_BYTES >> 20);
        let found = format!("{count} nodes, which need about {} MiB", needed >> 20);
        return Err(Invalid::new("meta.nodes", expected, found));
    }
    let layout = Layout::new(meta.nodes);
    for (axis, name) in layout.axes.iter().zip(["axis0", "axis1", "axis2"]) {
        let found: Vec<f64> = values(&mut archive, name, Some(&[axis.len()]))?;
        check_axis(name, axis, &found)?;
    }
    let value: Vec<f32> = values(&mut archive, "value", Some(&layout.shape))?;
    if let Some((position, bad)) = value.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        let [i, j, k] = layout.index(position);
        return Err(Invalid::new(format!("value[{i},{j},{k}]"), "a finite number", bad));
    }
    let [n0, kept_bearings, n2] = meta.nodes.shape();
    let mut deficit = Vec::with_capacity(n0 * kept_bearings * n2);
    for (position, v) in value.iter().enumerate() {
        let index = layout.index(position);
        let kept = layout.kept(index);
        if kept == index {
            deficit.push((f64::from(*v) - layout.margin(&game, index)) as f32);
            continue;
        }
        let mirrored = value[layout.position(kept)];
        if *v != mirrored {
            let [i, j, k] = index;
            let expected = format!("{mirrored}, as at the mirror image");
            return Err(Invalid::new(format!("value[{i},{j},{k}]"), expected, v));
        }
    }
    let mut sheet: Option<Vec<f32>> = None;
    if meta.sheet {
        let found: Vec<f32> = values(&mut archive, "sheet", Some(&layout.shape))?;
        let deficit = |(position, v): (usize, &f32)| {
            (f64::from(*v) - layout.margin(&game, layout.index(position))) as f32
        };
        sheet = Some(found.iter().enumerate().map(deficit).collect());
    }
    let horizon_s = meta.horizon.unwrap_or(f64::INFINITY);
    let samples = SampledValue::new(game, meta.nodes, horizon_s, &deficit, sheet.as_deref())
        .map_err(|e| Invalid { field: e.field.replace("horizon_s", "meta.horizon"), ..e })?;
    if meta.method == Method::Exact.name() {
        return game
            .exact()
            .map(|exact| Stored { function: ValueFunction::Exact(exact), converged: Some(true) })
            .map_err(|e| Invalid { field: "meta.method".to_owned(), ..e });
    }
    let moved = meta.unsettled_m.map(|moved| positive("meta.unsettled_m", moved)).transpose()?;
    let function = ValueFunction::Sampled(Arc::new(samples.unsettled(moved)));
    Ok(Stored { function, converged: meta.converged })
}
