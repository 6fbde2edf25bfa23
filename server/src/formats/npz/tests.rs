//! Round trips, and errors for invalid files.

use super::*;
use npyz::WriterBuilder;
use sidestep::reachability::npz::{meta, npz};
use sidestep::reachability::{CartesianGrid, Options, Scheme, solve};
use sidestep::reachability::{Nodes, PursuitGame};
use sidestep::vehicle::VehicleModel;
use std::io::{self, Cursor, Write};
use std::ops::ControlFlow;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

fn game(pursuer_turn_rate_radps: f64) -> PursuitGame {
    let evader = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
    let pursuer = VehicleModel { speed_mps: 2.0, turn_rate_radps: pursuer_turn_rate_radps };
    PursuitGame { evader, pursuer, radius_m: 3.0 }
}

fn polar() -> SampledValue {
    let nodes = Nodes::Polar { knee_m: 3.0, range_m: 40.0, range_nodes: 17, angle_nodes: 12 };
    SampledValue::sampled(game(0.75), nodes, |[x, y, psi]| {
        let asymmetric = 0.3 * (psi + 0.4).sin() * y;
        x.hypot(y) - 3.0 - (asymmetric.abs() + 0.1 + 0.1 * psi.cos()) * x.hypot(y) / 40.0
    })
    .unwrap()
}

fn bytes(samples: &SampledValue, method: Method) -> Vec<u8> {
    npz(samples, method)
}

/// Adds a compressed array, like an array that another program wrote.
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
    let grid = CartesianGrid::new([9, 7, 8], [-4.0, 20.0, -10.0, 10.0]).with_scheme(Scheme::Upwind);
    let options = Options::default().with_horizon(0.5).with_grid(grid).with_threads(1);
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
    // Older files do not contain this field.
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

/// Reads the archive with one array replaced.
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
