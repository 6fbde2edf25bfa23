//! Solutions of the Cartesian solver as NumPy archives.
//!
//! - `value` (float32 or float64): V, row-major over the instants and then the axes of the grid.
//! - `tau` (float64): the march times of the instants (s). The last one is the horizon.
//! - `axis0`, `axis1`, … (float64): the coordinates of the nodes.
//! - `exit0`, `exit1`, … (float64): for each node of an axis, the time (s) before which no path
//!   from the node passes an end of the axis. Files of earlier versions lack these arrays.
//! - `meta` (uint8): a JSON object.

use super::archive::Archive;
use super::layout::check_axis;
use super::reading::Arrays;
use crate::invalid::{Invalid, length};
use crate::reachability::cartesian::{Direction, Kind, ShallowObstacle, Solution};
use crate::reachability::grid::{Axis, Grid};
use crate::real::Real;
use serde::{Deserialize, Serialize};

/// The name and version of the file format.
pub const SOLUTION_FORMAT: &str = "sidestep-solution-npz/1";

const STORED: &str = "value: V at the instants tau (s of the march, the last one the horizon) and the \
                      nodes of axis0, axis1, ...; the set or tube is V <= 0. A backward march begins at \
                      the end of the game: tau is the time left. A forward one begins at the initial set. \
                      Periodic axes leave out the node that repeats the first one";

/// The content of `meta`.
#[derive(Serialize, Deserialize)]
struct Meta {
    format: String,
    stored: String,
    direction: Direction,
    kind: Kind,
    axes: Vec<Axis>,
    steps: usize,
    horizon_s: f64,
    residual: f64,
    /// Whether the archive contains `exit0`, …. Files of earlier versions lack this field.
    #[serde(default)]
    exits: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shallow: Option<ShallowObstacle>,
}

impl<T: Real, const D: usize> Solution<T, D> {
    /// Encodes the solution as a NumPy archive, for `numpy.load` and [`Self::from_npz`]. Equal
    /// solutions give identical bytes.
    ///
    /// # Errors
    /// [`Invalid`] if the values need more than 4 GiB − 64 MiB, which the format does not support.
    pub fn npz(&self) -> Result<Vec<u8>, Invalid> {
        let instants = self.earlier.len() + 1;
        let needed = self.grid.len().saturating_mul(instants).saturating_mul(size_of::<T>());
        if needed > MOST_BYTES {
            let expected = format!("at most {MOST_BYTES} bytes of values");
            return Err(Invalid::new("solution", expected, needed));
        }
        let shape: Vec<usize> =
            [instants].into_iter().chain(self.grid.axes.map(|axis| axis.nodes)).collect();
        let mut archive = Archive::default();
        let values = self.earlier.iter().flatten().chain(&self.values).copied();
        if dtype::<T>() == "<f4" {
            archive.add("value", &shape, values.map(|value| value.to_f64() as f32));
        } else {
            archive.add("value", &shape, values.map(Real::to_f64));
        }
        archive.add("tau", &[instants], self.march_times_s().into_iter());
        for (d, axis) in self.grid.axes.iter().enumerate() {
            archive.add(&format!("axis{d}"), &[axis.nodes], axis.coordinates().into_iter());
        }
        for (d, times) in self.exit_s.iter().flatten().enumerate() {
            archive.add(&format!("exit{d}"), &[times.len()], times.iter().copied());
        }
        let meta = Meta {
            format: SOLUTION_FORMAT.to_owned(),
            stored: STORED.to_owned(),
            direction: self.direction,
            kind: self.kind,
            axes: self.grid.axes.to_vec(),
            steps: self.steps,
            horizon_s: self.horizon_s,
            // JSON has no infinity.
            residual: self.residual.min(f64::MAX),
            exits: self.exit_s.is_some(),
            shallow: self.shallow,
        };
        let meta = serde_json::to_vec(&meta).unwrap_or_default();
        archive.add("meta", &[meta.len()], meta.into_iter());
        Ok(archive.finish())
    }

    /// Decodes an archive from [`Self::npz`], even if `numpy.savez` has rewritten it.
    ///
    /// # Errors
    /// [`Invalid`] naming the invalid array or entry of `meta`.
    pub fn from_npz(bytes: &[u8]) -> Result<Self, Invalid> {
        let arrays = Arrays::read(bytes)?;
        let meta: Meta = serde_json::from_slice(arrays.get("meta")?.bytes)
            .map_err(|error| Invalid::new("meta", "the metadata of a solution as JSON", error))?;
        if meta.format != SOLUTION_FORMAT {
            return Err(Invalid::new("meta.format", SOLUTION_FORMAT, meta.format));
        }
        let axes = meta.axes.len();
        let axes = <[Axis; D]>::try_from(meta.axes)
            .map_err(|_| Invalid::new("meta.axes", format!("{D} axes"), axes))?;
        let grid = Grid { axes };
        grid.check(1).map_err(|invalid| invalid.within("meta"))?;
        let horizon_s = crate::invalid::positive("meta.horizon_s", meta.horizon_s)?;
        let stored = arrays.get("value")?;
        if stored.dtype != dtype::<T>() {
            return Err(Invalid::new("value", format!("dtype {}", dtype::<T>()), &stored.dtype));
        }
        let instants = stored.shape.first().copied().unwrap_or_default();
        let nodes = grid.axes.map(|axis| axis.nodes);
        if instants == 0 || stored.shape[1..] != nodes {
            let expected = format!("instants, at least one, of {nodes:?} nodes");
            return Err(Invalid::new("value", expected, format!("{:?}", stored.shape)));
        }
        let numbers = stored.numbers("value")?;
        length("value", grid.len().saturating_mul(instants), numbers.len())?;
        if let Some(i) = numbers.iter().position(|value| !value.is_finite()) {
            return Err(Invalid::new(format!("value[{i}]"), "a finite number", numbers[i]));
        }
        let mut slices: Vec<Vec<T>> = numbers
            .chunks(grid.len())
            .map(|slice| slice.iter().map(|value| T::from_f64(*value)).collect())
            .collect();
        let values = slices.pop().unwrap_or_default();
        let Meta { direction, kind, steps, residual, exits, shallow, .. } = meta;
        let stated = |name: &str| arrays.get(name)?.numbers(name);
        let mut exit_s = None;
        if exits {
            let mut by_axis = grid.axes.map(|_| Vec::new());
            for (d, times) in by_axis.iter_mut().enumerate() {
                let name = format!("exit{d}");
                *times = stated(&name)?;
                length(&name, grid.axes[d].nodes, times.len())?;
                if let Some(i) = times.iter().position(|time| time.is_nan() || *time < 0.0) {
                    let found = times[i];
                    return Err(Invalid::new(format!("{name}[{i}]"), "a time ≥ 0, s", found));
                }
            }
            exit_s = Some(by_axis);
        }
        let earlier = slices;
        let solution = Self {
            grid,
            values,
            earlier,
            direction,
            kind,
            steps,
            horizon_s,
            residual,
            exit_s,
            shallow,
        };
        check_axis("tau", &solution.march_times_s(), &stated("tau")?)?;
        for (d, axis) in solution.grid.axes.iter().enumerate() {
            let name = format!("axis{d}");
            check_axis(&name, &axis.coordinates(), &stated(&name)?)?;
        }
        Ok(solution)
    }
}

/// Largest total size of the values (bytes). Sizes and offsets in the archive have 32 bits. The
/// remaining 64 MiB are for axes and headers.
const MOST_BYTES: usize = (u32::MAX - (1 << 26)) as usize;

/// NumPy's dtype string for the number type `T`.
fn dtype<T: Real>() -> &'static str {
    if size_of::<T>() == size_of::<f32>() { "<f4" } else { "<f8" }
}
