//! Value functions as NumPy archives.
//!
//! `value` (float32, V in metres, row-major), `axis0`, `axis1`, `axis2` (float64, the
//! coordinates of the nodes) and `meta` (a JSON object as uint8). In polar coordinates
//! the axes are range, bearing and relative heading, the bearings over the full turn,
//! although the library keeps one half of them: V(r, −bearing, −ψ) = V(r, bearing, ψ).
//! There may be `sheet` (float32, like `value`), Q with
//! V = max(Q(r, bearing, ψ), Q(r, −bearing, −ψ)): two smooth functions instead of one with a kink.

use npyz::WriterBuilder;
use serde::{Deserialize, Serialize};
use sidestep::document::from_value;
use sidestep::invalid::{Invalid, positive};
use sidestep::reachability::{
    MEMORY_LIMIT_BYTES, Method, Nodes, PursuitGame, SampledValue, ValueFunction,
};
use std::io::{self, Read, Seek, Write};
use std::sync::Arc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

const FORMAT: &str = "sidestep-value-npz/1";

const STORED: &str = "value: V in metres, the largest range margin (range - radius) that the \
                      evader can keep for the horizon; V <= 0 where the pursuer can force a \
                      capture. Pursuer in the evader's frame: x ahead, y to the left, psi \
                      (relative heading) counter-clockwise; bearings from straight ahead, \
                      counter-clockwise; periodic axes leave out the node at 2 pi. horizon \
                      null is infinite. float32, row-major over axis0, axis1, axis2. sheet, \
                      where there is one: Q in metres, with V(r, b, psi) = max(Q(r, b, psi), \
                      Q(r, -b, -psi)); smooth where V has a kink, so interpolate Q, not V";

/// Most entries of an array of unknown length.
const SHORT: usize = 1 << 16;

/// Most bytes before an array's values.
const HEADER_LIMIT: u64 = 1 << 16;

/// The content of `meta`.
#[derive(Debug, Serialize, Deserialize)]
struct Meta {
    format: String,
    method: String,
    /// The name in `nodes`, repeated where it is easily found.
    coordinates: String,
    axes: [String; 3],
    units: [String; 3],
    periodic: [bool; 3],
    stored: String,
    game: PursuitGame,
    /// Seconds; none for the converged value, since JSON has no infinity.
    horizon: Option<f64>,
    nodes: Nodes,
    /// Whether there is an array `sheet`.
    sheet: bool,
    /// Whether the solve converged; null for a finite horizon, absent in older files.
    #[serde(default)]
    converged: Option<bool>,
    /// If it did not: [`SampledValue::unsettled_m`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    unsettled_m: Option<f64>,
}

/// A value function from a file.
#[derive(Debug)]
pub struct Stored {
    /// The function.
    pub function: ValueFunction,
    /// Whether its solve converged; none for a finite horizon, or if the file does not say.
    pub converged: Option<bool>,
}

/// The nodes of a file, and the order of their values.
struct Layout {
    nodes: Nodes,
    shape: [usize; 3],
    axes: [Vec<f64>; 3],
}

impl Layout {
    fn new(nodes: Nodes) -> Self {
        let [first, second, third] = nodes.coordinates();
        let second = match nodes {
            // Both angles have the same nodes.
            Nodes::Polar { .. } => third.clone(),
            Nodes::Cartesian { .. } => second,
        };
        let axes = [first, second, third];
        Self { nodes, shape: shape(&nodes), axes }
    }

    /// r − R at a node, m.
    fn margin(&self, game: &PursuitGame, [i, j, k]: [usize; 3]) -> f64 {
        match self.nodes {
            Nodes::Polar { .. } => self.axes[0][i] - game.radius_m,
            Nodes::Cartesian { .. } => {
                game.target([self.axes[0][i], self.axes[1][j], self.axes[2][k]])
            }
        }
    }

    /// The node that the library keeps for this one.
    fn kept(&self, [i, j, k]: [usize; 3]) -> [usize; 3] {
        match self.nodes {
            Nodes::Polar { angle_nodes: n, .. } if j > n / 2 => [i, n - j, (n - k) % n],
            _ => [i, j, k],
        }
    }

    fn index(&self, position: usize) -> [usize; 3] {
        let [_, n1, n2] = self.shape;
        [position / (n1 * n2), position / n2 % n1, position % n2]
    }

    fn position(&self, [i, j, k]: [usize; 3]) -> usize {
        (i * self.shape[1] + j) * self.shape[2] + k
    }
}

/// The numbers of a file's nodes by axis; bearings cover a full turn.
#[must_use]
pub fn shape(nodes: &Nodes) -> [usize; 3] {
    match *nodes {
        Nodes::Polar { range_nodes, angle_nodes, .. } => [range_nodes, angle_nodes, angle_nodes],
        Nodes::Cartesian { .. } => nodes.shape(),
    }
}

fn meta(samples: &SampledValue, method: Method) -> Meta {
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

/// Writes the archive; the same function gives the same bytes.
///
/// # Errors
/// The error of `out`.
pub fn write(out: impl Write + Seek, samples: &SampledValue, method: Method) -> io::Result<()> {
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
    let mut archive = ZipWriter::new(out);
    array(&mut archive, "value", &layout.shape, (0..count).map(value))?;
    for (axis, name) in layout.axes.iter().zip(["axis0", "axis1", "axis2"]) {
        array(&mut archive, name, &[axis.len()], axis.iter().copied())?;
    }
    if let Some(sheet) = samples.sheet() {
        let sheet = sheet.enumerate().map(|(position, q)| {
            (layout.margin(&game, layout.index(position)) + f64::from(q)) as f32
        });
        array(&mut archive, "sheet", &layout.shape, sheet)?;
    }
    let meta = serde_json::to_vec(&meta(samples, method))?;
    array(&mut archive, "meta", &[meta.len()], meta.iter().copied())?;
    archive.finish()?.flush()
}

fn array<T: npyz::AutoSerialize>(
    archive: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    shape: &[usize],
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let bytes = shape.iter().product::<usize>() as u64 * size_of::<T>() as u64;
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(bytes > u64::from(u32::MAX) / 2);
    archive.start_file(format!("{name}.npy"), options)?;
    let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(archive).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

/// Reads a file of [`write()`]: the closed form if the method was exact, otherwise the values to the
/// accuracy of float32.
///
/// # Errors
/// [`Invalid`] naming the array or the field of `meta` that is missing, truncated, of
/// another version or shape, or not a number.
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
        let largest = axis.iter().fold(1.0, |m: f64, a| m.max(a.abs()));
        for (i, (a, b)) in axis.iter().zip(&found).enumerate() {
            let differs = (a - b).abs() > 1e-9 * largest;
            if differs || !b.is_finite() {
                let expected = format!("{a}, as meta.nodes says");
                return Err(Invalid::new(format!("{name}[{i}]"), expected, b));
            }
        }
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

fn read_meta<R: Read + Seek>(archive: &mut ZipArchive<R>) -> Result<Meta, Invalid> {
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

/// The values of an array with this type and shape (a short list without a shape). No more bytes are read
/// from the archive than needed.
fn values<R: Read + Seek, T: npyz::AutoSerialize + npyz::Deserialize>(
    archive: &mut ZipArchive<R>,
    name: &str,
    shape: Option<&[usize]>,
) -> Result<Vec<T>, Invalid> {
    let broken = |e: io::Error| Invalid::new(name, "a NumPy array, whole", e);
    let file = archive
        .by_name(&format!("{name}.npy"))
        .map_err(|e| Invalid::new(name, "an array of that name", e))?;
    let count = shape.map_or(SHORT, |shape| shape.iter().product());
    let limit = (count * size_of::<T>()) as u64 + HEADER_LIMIT;
    let mut bytes = Vec::new();
    // Read to the end, where the checksum is compared.
    file.take(limit).read_to_end(&mut bytes).map_err(broken)?;
    let mut rest = &bytes[..];
    let array = npyz::NpyFile::new(&mut rest).map_err(broken)?;
    let wanted = T::default_dtype().descr();
    let found = array.dtype().descr();
    if found != wanted {
        return Err(Invalid::new(name, format!("dtype {wanted}"), found));
    }
    let found = array.shape().to_vec();
    let fits = match shape {
        Some(shape) => shape.iter().map(|n| *n as u64).eq(found.iter().copied()),
        None => found.len() == 1 && found[0] <= SHORT as u64,
    };
    if !fits {
        let expected = shape.map_or(format!("[up to {SHORT}]"), |shape| format!("{shape:?}"));
        return Err(Invalid::new(format!("{name}.shape"), expected, format!("{found:?}")));
    }
    if array.order() != npyz::Order::C && found.len() > 1 {
        return Err(Invalid::new(name, "row-major order", "Fortran order"));
    }
    let values = array.into_vec().map_err(broken)?;
    if !rest.is_empty() {
        return Err(Invalid::new(name, "its end", format!("{} bytes more", rest.len())));
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::reachability::{CartesianGrid, Options, Precision, Scheme, solve};
    use sidestep::vehicle::VehicleModel;
    use std::io::Cursor;
    use std::ops::ControlFlow;

    fn game(pursuer_turn_rate_radps: f64) -> PursuitGame {
        let evader = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
        let pursuer = VehicleModel { speed_mps: 2.0, turn_rate_radps: pursuer_turn_rate_radps };
        PursuitGame { evader, pursuer, radius_m: 3.0 }
    }

    fn polar() -> SampledValue {
        let nodes = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 17, angle_nodes: 12 };
        SampledValue::sampled(game(0.75), nodes, |[x, y, psi]| {
            let asymmetric = 0.3 * (psi + 0.4).sin() * y;
            x.hypot(y) - 3.0 - (asymmetric.abs() + 0.1 * psi.cos()) * x.hypot(y) / 40.0
        })
        .unwrap()
    }

    fn bytes(samples: &SampledValue, method: Method) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        write(&mut bytes, samples, method).unwrap();
        bytes.into_inner()
    }

    fn close(a: &SampledValue, b: &SampledValue) {
        assert_eq!((a.game(), a.nodes(), a.horizon_s()), (b.game(), b.nodes(), b.horizon_s()));
        for (a, b) in a.deficit().zip(b.deficit()) {
            assert!((a - b).abs() <= 4e-6, "{a} {b}");
        }
    }

    #[test]
    fn polar_values_come_back() {
        let samples = polar();
        let again = read(Cursor::new(bytes(&samples, Method::Polar))).unwrap();
        let ValueFunction::Sampled(again) = again.function else { panic!("sampled") };
        close(&samples, &again);
        assert_eq!(bytes(&samples, Method::Polar), bytes(&again, Method::Polar), "a fixed point");
    }

    #[test]
    fn bearings_are_a_full_turn() {
        let samples = polar();
        let file = bytes(&samples, Method::Polar);
        let mut archive = ZipArchive::new(Cursor::new(file)).unwrap();
        let axes: Vec<Vec<f64>> = [("axis0", 17), ("axis1", 12), ("axis2", 12)]
            .map(|(name, n)| values(&mut archive, name, Some(&[n])).unwrap())
            .into();
        let value: Vec<f32> = values(&mut archive, "value", Some(&[17, 12, 12])).unwrap();
        for (position, v) in value.iter().enumerate() {
            let (r, a) = (axes[0][position / 144], axes[1][position / 12 % 12]);
            let state = [r * a.cos(), r * a.sin(), axes[2][position % 12]];
            let expected = samples.state(state).value;
            assert!((f64::from(*v) - expected).abs() < 1e-5, "{state:?}: {v} {expected}");
        }
    }

    #[test]
    fn cartesian_values_come_back() {
        let grid = CartesianGrid {
            nodes: [9, 7, 8],
            domain_m: [-4.0, 20.0, -10.0, 10.0],
            scheme: Scheme::Upwind,
            precision: Precision::F32,
        };
        let options =
            Options { horizon_s: 0.5, grid: Some(grid), threads: 1, ..Options::default() };
        let solved = solve(game(0.75), &options, &mut |_| ControlFlow::Continue(())).unwrap();
        let again = read(Cursor::new(bytes(&solved.samples, solved.method))).unwrap();
        let ValueFunction::Sampled(again) = again.function else { panic!("sampled") };
        close(&solved.samples, &again);
    }

    #[test]
    fn the_closed_form_comes_back() {
        let options = Options::default();
        let solved = solve(game(0.5), &options, &mut |_| ControlFlow::Continue(())).unwrap();
        let again = read(Cursor::new(bytes(&solved.samples, solved.method))).unwrap();
        assert_eq!((again.function, again.converged), (solved.function, Some(true)));
    }

    #[test]
    fn whether_the_solve_converged_is_stored() {
        let converged = |samples: &SampledValue| {
            let stored = read(Cursor::new(bytes(samples, Method::Polar))).unwrap();
            (stored.converged, stored.function.unsettled_m())
        };
        assert_eq!(converged(&polar()), (Some(true), None));
        assert_eq!(converged(&polar().unsettled(Some(0.25))), (Some(false), Some(0.25)));
        // Older files do not contain it.
        let older = changed_meta(|m| drop(m.as_object_mut().unwrap().remove("converged"))).unwrap();
        assert_eq!((older.converged, older.function.unsettled_m()), (None, None));
    }

    #[test]
    fn a_truncated_file_is_refused() {
        let whole = bytes(&polar(), Method::Polar);
        for end in (0..whole.len()).step_by(97) {
            assert!(read(Cursor::new(&whole[..end])).is_err(), "{end} bytes");
        }
        let mut flipped = whole.clone();
        flipped[2000] ^= 0x10;
        assert!(read(Cursor::new(&flipped)).is_err(), "the check sum tells");
    }

    /// What is read from the archive with one array replaced.
    fn changed(
        name: &str,
        change: impl FnOnce(&mut ZipWriter<Cursor<Vec<u8>>>),
    ) -> Result<Stored, Invalid> {
        let mut from = ZipArchive::new(Cursor::new(bytes(&polar(), Method::Polar))).unwrap();
        let mut to = ZipWriter::new(Cursor::new(Vec::new()));
        for i in 0..from.len() {
            let file = from.by_index_raw(i).unwrap();
            if file.name().unwrap() != format!("{name}.npy") {
                to.raw_copy_file(file).unwrap();
            }
        }
        change(&mut to);
        read(to.finish().unwrap())
    }

    fn with(name: &str, change: impl FnOnce(&mut ZipWriter<Cursor<Vec<u8>>>)) -> Invalid {
        changed(name, change).unwrap_err()
    }

    fn changed_meta(change: impl FnOnce(&mut serde_json::Value)) -> Result<Stored, Invalid> {
        let mut json = serde_json::to_value(meta(&polar(), Method::Polar)).unwrap();
        change(&mut json);
        let text = json.to_string().into_bytes();
        changed("meta", |to| array(to, "meta", &[text.len()], text.iter().copied()).unwrap())
    }

    fn with_meta(change: impl FnOnce(&mut serde_json::Value)) -> Invalid {
        changed_meta(change).unwrap_err()
    }

    #[test]
    fn complaints_name_the_array_or_field() {
        assert_eq!(with("value", |_| ()).field, "value");
        let zeros = |n: usize| std::iter::repeat_n(0.0_f32, n);
        let shape = with("value", |to| array(to, "value", &[17, 12, 11], zeros(17 * 132)).unwrap());
        assert_eq!((shape.field.as_str(), shape.found.as_str()), ("value.shape", "[17, 12, 11]"));
        let flat = with("value", |to| array(to, "value", &[2448], zeros(2448)).unwrap());
        assert_eq!(flat.field, "value.shape");
        let wide = std::iter::repeat_n(0.0_f64, 2448);
        let wide = with("value", |to| array(to, "value", &[17, 12, 12], wide).unwrap());
        assert!(wide.expected.contains("<f4") && wide.found.contains("<f8"), "{wide}");
        let mut nan = vec![0.0_f32; 2448];
        nan[145] = f32::NAN;
        let nan = with("value", |to| array(to, "value", &[17, 12, 12], nan.into_iter()).unwrap());
        assert_eq!(nan.field, "value[1,0,1]");
        let mut lopsided = vec![0.0_f32; 2448];
        lopsided[7 * 12] = 1.0;
        let lopsided =
            with("value", |to| array(to, "value", &[17, 12, 12], lopsided.into_iter()).unwrap());
        assert_eq!(lopsided.field, "value[0,7,0]");
        let axis = with("axis1", |to| array(to, "axis1", &[12], (0..12).map(f64::from)).unwrap());
        assert_eq!(axis.field, "axis1[1]");

        assert_eq!(with_meta(|m| m["format"] = "sidestep-value-npz/2".into()).field, "meta.format");
        assert_eq!(with_meta(|m| m["method"] = "guess".into()).field, "meta.method");
        assert_eq!(with_meta(|m| m["method"] = "exact".into()).field, "meta.method");
        assert_eq!(with_meta(|m| m["horizon"] = 0.into()).field, "meta.horizon");
        assert_eq!(with_meta(|m| m["coordinates"] = "cartesian".into()).field, "meta.coordinates");
        let speed = with_meta(|m| m["game"]["evader"]["speed_mps"] = (-1).into());
        assert_eq!(speed.field, "meta.game.evader.speed_mps");
        let few = with_meta(|m| m["nodes"]["range_nodes"] = 1.into());
        assert_eq!(few.field, "meta.nodes.range_nodes");
        let many = with_meta(|m| {
            m["nodes"]["range_nodes"] = 65536.into();
            m["nodes"]["angle_nodes"] = 65536.into();
        });
        assert_eq!(many.field, "meta.nodes");
        assert!(many.found.contains("MiB"), "{many}");
        assert_eq!(read(Cursor::new(b"no archive")).unwrap_err().field, "");
    }
}
