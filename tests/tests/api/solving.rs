//! `solve`, `value` and `plot`: their output and their errors.

use serde_json::Value;
use sidestep::reachability::ExactValue;
#[cfg(unix)]
use sidestep_tests::process::{Said, interrupted};
use sidestep_tests::{Folder, run};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use std::time::Duration;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

async fn prints(args: &[&str]) -> Value {
    run(args).await.only_json()
}

async fn refuses(args: &[&str], words: &[&str]) {
    run(args).await.refused(2, words);
}

/// The header and the values of an array in NumPy's format (version 1).
fn array(file: &Path, name: &str) -> (String, Vec<u8>) {
    let mut archive = ZipArchive::new(std::fs::File::open(file).unwrap()).unwrap();
    let mut bytes = Vec::new();
    archive.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert!((10 + length).is_multiple_of(16), "values are aligned");
    let header = String::from_utf8(bytes[10..10 + length].to_vec()).unwrap();
    assert!(header.ends_with('\n'));
    (header.replace(' ', ""), bytes[10 + length..].to_vec())
}

fn doubles(file: &Path, name: &str, count: usize) -> Vec<f64> {
    let (header, bytes) = array(file, name);
    for part in ["'descr':'<f8'", "'fortran_order':False", &format!("'shape':({count},)")] {
        assert!(header.contains(part), "{part} in {header}");
    }
    bytes.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect()
}

fn values(file: &Path, shape: [usize; 3]) -> Vec<f32> {
    let (header, bytes) = array(file, "value");
    let [a, b, c] = shape;
    for part in ["'descr':'<f4'", "'fortran_order':False", &format!("'shape':({a},{b},{c}")] {
        assert!(header.contains(part), "{part} in {header}");
    }
    assert_eq!(bytes.len(), 4 * a * b * c);
    bytes.chunks_exact(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect()
}

fn meta(file: &Path) -> Value {
    let (header, bytes) = array(file, "meta");
    assert!(header.contains("'descr':'|u1'"), "{header}");
    serde_json::from_slice(&bytes).unwrap()
}

#[tokio::test]
async fn the_closed_form_on_a_polar_grid() {
    let folder = Folder::default();
    let file = folder.path("v.npz");
    let line = prints(&["solve", "--out", &folder.name("v.npz")]).await;
    assert_eq!(line["method"], "exact");
    assert_eq!(line["grid"], serde_json::json!([65, 96, 96]));
    assert_eq!(line["converged_residual"], 0.0);
    assert!(line["steps"] == 0 && line["threads"].as_u64() >= Some(1) && line["wall_s"].is_f64());
    assert!((line["volume"].as_f64().unwrap() - 358.0).abs() < 1.0, "{line}");
    assert_eq!(folder.names(), ["v.npz"]);

    let (ranges, angles) = (doubles(&file, "axis0", 65), doubles(&file, "axis1", 96));
    assert_eq!(angles, doubles(&file, "axis2", 96), "bearings are a full turn");
    assert!((angles[95] - 95.0 / 96.0 * core::f64::consts::TAU).abs() < 1e-12);
    let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
    for (i, v) in values(&file, [65, 96, 96]).into_iter().enumerate() {
        let (r, bearing) = (ranges[i / 9216], angles[i / 96 % 96]);
        let expected = game.value([r * bearing.cos(), r * bearing.sin(), angles[i % 96]]);
        assert!((f64::from(v) - expected).abs() < 2e-5, "{i}: {v} {expected}");
    }
    let meta = meta(&file);
    assert_eq!(meta["coordinates"], "polar");
    assert_eq!(meta["method"], "exact");
    assert_eq!(meta["horizon"], Value::Null);
    assert_eq!(meta["periodic"], serde_json::json!([false, true, true]));
    assert_eq!(meta["game"]["pursuer"]["turn_rate_radps"], 0.5);
    assert!(meta["stored"].as_str().unwrap().contains("metres"));
    assert!(meta["format"].is_string());
}

#[tokio::test]
async fn a_rectangular_grid_of_a_short_game() {
    let folder = Folder::default();
    let file = folder.path("v.npz");
    let solve = |threads: &'static str| {
        let out = folder.name("v.npz");
        async move {
            let grid = ["--grid", "21,11,16", "--domain", "-5,15,-10,10", "--horizon", "1.5"];
            let how = ["--scheme", "eno2", "--precision", "f64", "--threads", threads];
            prints(&[&["solve", "--out", &out][..], &grid, &how].concat()).await
        }
    };
    let line = solve("2").await;
    assert_eq!(line["method"], "cartesian");
    assert_eq!(line["grid"], serde_json::json!([21, 11, 16]));
    assert_eq!(line["threads"], 2);
    assert!(line["steps"].as_u64() > Some(0));
    let (x, y) = (doubles(&file, "axis0", 21), doubles(&file, "axis1", 11));
    assert_eq!((x[0], x[20], y[0], y[10]), (-5.0, 15.0, -10.0, 10.0));
    let first = values(&file, [21, 11, 16]);
    // From five metres behind, with the same heading, the pursuer cannot force a collision.
    let behind = first[5 * 16];
    assert!((behind - 2.0).abs() < 0.3, "{behind}");
    assert_eq!(meta(&file)["horizon"], 1.5);
    let bytes = std::fs::read(&file).unwrap();
    solve("1").await;
    assert_eq!(bytes, std::fs::read(&file).unwrap(), "same input, same bytes");
}

#[tokio::test]
async fn values_of_states() {
    let folder = Folder::default();
    // The columns can be in any order. Extra columns, a byte-order mark, blanks and CR LF line ends
    // are accepted.
    let text = "\u{feff}psi,note,x, y\r\n0.5,a,10,1\r\n3.0,\"b, c\", 5 ,-2e0\r\n-7,,0.1,0.30000000000000004\r\n";
    let states = folder.file("states.csv", text);
    let out = folder.name("values.csv");
    let said = run(&["value", "--states", &states, "--out", &out]).await;
    // −7 rad is a valid heading, but rarely intended.
    let expected = "states.csv: line 4, psi: -7 is more than a full turn; headings are in radians";
    assert!(said.err.contains(expected), "{}", said.err);
    let line = said.json();
    assert_eq!((&line["states"], &line["outside"]), (&3.into(), &0.into()));
    let rows = |out: &str| -> Vec<Vec<f64>> {
        let mut reader = csv::Reader::from_path(out).unwrap();
        let header =
            "x,y,psi,value,dvalue_dx,dvalue_dy,dvalue_dpsi,evader_turn,pursuer_turn,exact,inside";
        assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>().join(","), header);
        let parse = |row: csv::StringRecord| row.iter().map(|f| f.parse().unwrap()).collect();
        reader.records().map(|row| parse(row.unwrap())).collect()
    };
    let game = ExactValue::new(2.0, 0.5, 3.0).unwrap();
    let given = [[10.0, 1.0, 0.5], [5.0, -2.0, 3.0], [0.1, 0.30000000000000004, -7.0]];
    let exact = rows(&out);
    assert_eq!(exact.len(), 3);
    for (row, state) in exact.iter().zip(given) {
        let expected = game.analyze(state);
        let turns = [expected.evader_turn, expected.pursuer_turn, 1.0, 1.0];
        let all = [&state[..], &[expected.value], &expected.gradient, &turns].concat();
        assert_eq!(*row, all, "bit for bit");
    }

    // The closed form read from a file gives exactly the same values.
    let file = folder.name("v.npz");
    prints(&["solve", "--out", &file]).await;
    run(&["value", "--value-function", &file, "--states", &states, "--out", &out]).await.json();
    assert_eq!(rows(&out), exact);

    // A solved function read from its file equals the function solved directly, up to float32
    // rounding.
    let game = ["--pursuer-turn-rate", "0.75", "--accuracy", "draft"];
    run(&[&["value", "--states", &states, "--out", &out][..], &game].concat()).await.json();
    let at_once = rows(&out);
    prints(&[&["solve", "--out", &file][..], &game].concat()).await;
    run(&["value", "--value-function", &file, "--states", &states, "--out", &out]).await.json();
    for (a, b) in at_once.iter().flatten().zip(rows(&out).iter().flatten()) {
        assert!((a - b).abs() < 1e-4, "{a} {b}");
    }
    assert!(at_once.iter().all(|row| row[9] == 0.0));
    let far = folder.file("far.csv", "x,y,psi\n500,0,3\n");
    let line = prints(&["value", "--value-function", &file, "--states", &far, "--out", &out]).await;
    assert_eq!(line["outside"], 1);
    assert!((rows(&out)[0][3] - 480.0).abs() < 20.0);
    assert_eq!(rows(&out)[0][10], 0.0, "not inside");
    // A table without states gives a table without rows.
    let none = folder.file("none.csv", "x,y,psi\n");
    let line = prints(&["value", "--states", &none, "--out", &out]).await;
    assert_eq!((&line["states"], rows(&out).len()), (&0.into(), 0));
}

#[tokio::test]
async fn states_that_are_none() {
    let folder = Folder::default();
    let table: [(&str, &[&str]); 13] = [
        ("x,y,psi\r\n1,2,3\r\n\r\n1,2,3\r\n1,2,b", &["line 5: psi"]),
        ("\n\nx,y,psi\n\n1,2,b\n", &["line 5: psi"]),
        ("", &["line 1", "x", "column"]),
        ("x,y\n1,2\n", &["line 1", "psi", "column", "x,y"]),
        ("x,y,psi,x\n1,2,3,4\n", &["line 1: x", "one column"]),
        ("x,y,psi\n1,2,3\n1,NaN,3\n", &["line 3: y", "finite", "NaN"]),
        ("x,y,psi\n1,2,inf\n", &["line 2: psi", "finite", "inf"]),
        ("x,y,psi\n1,2,1e999\n", &["line 2: psi", "1e999"]),
        ("x,y,psi\n1,2,3\n,2,3\n", &["line 3: x", "\"\""]),
        ("x,y,psi\n1,two,3\n", &["line 2: y", "two"]),
        ("x,y,psi\n1,2,3\n\n1,2\n", &["line 4: row", "3 fields", "found 2"]),
        ("x,y,psi\n1,2,3,4\n", &["line 2: row", "found 4"]),
        ("x,y,psi,a\n1,2,3,\"b\nc\"\n1,2,-,d\n", &["line 4: psi"]),
    ];
    for (text, words) in table {
        let states = folder.file("states.csv", text);
        let out = folder.name("values.csv");
        let words = [words, &["states.csv"]].concat();
        refuses(&["value", "--states", &states, "--out", &out], &words).await;
        assert_eq!(folder.names(), ["states.csv"], "nothing is written: {text}");
    }
    let states = folder.file("states.csv", b"x,y,psi\n1,\xff,3\n");
    let out = folder.name("values.csv");
    refuses(&["value", "--states", &states, "--out", &out], &["line 2", "UTF-8"]).await;
    refuses(&["value", "--states", "missing.csv", "--out", &out], &["missing.csv"]).await;
}

#[tokio::test]
async fn games_and_grids_that_are_none() {
    let folder = Folder::default();
    let out = folder.name("v.npz");
    let table: [(&[&str], &[&str]); 30] = [
        (&["--evader-speed", "0"], &["--evader-speed", "> 0", "found 0"]),
        (&["--evader-speed", "-2"], &["--evader-speed", "found -2"]),
        (&["--evader-turn-rate", "nan"], &["--evader-turn-rate", "NaN"]),
        (&["--pursuer-speed", "inf"], &["--pursuer-speed", "inf"]),
        (&["--pursuer-turn-rate", "-0.5"], &["--pursuer-turn-rate", "-0.5"]),
        (&["--radius", "0"], &["--radius", "found 0"]),
        (&["--radius", "three"], &["--radius", "three"]),
        (&["--horizon", "0"], &["--horizon", "found 0"]),
        (&["--horizon", "-1"], &["--horizon", "found -1"]),
        (&["--horizon", "nan"], &["--horizon", "NaN"]),
        (&["--horizon", "2", "--method", "exact"], &["--horizon", "inf", "polar"]),
        (&["--method", "exact", "--pursuer-speed", "1"], &["--method", "polar or cartesian"]),
        (&["--method", "guess"], &["--method", "guess", "polar"]),
        (&["--accuracy", "perfect"], &["--accuracy", "perfect"]),
        (&["--range", "2", "--method", "polar"], &["--range", "above the radius"]),
        (&["--range", "20", "--method", "cartesian"], &["--range", "cartesian"]),
        (&["--threads", "0"], &["--threads", "found 0"]),
        (&["--grid", "21,21,16"], &["--domain"]),
        (&["--domain", "0,1,0,1"], &["--grid"]),
        (&["--scheme", "weno5"], &["--grid"]),
        (&["--precision", "f64"], &["--grid"]),
        (&["--grid", "21,21", "--domain", "0,1,0,1"], &["--grid", "3 whole numbers"]),
        (&["--grid", "21,21,1.5", "--domain", "0,1,0,1"], &["--grid", "3 whole numbers"]),
        (&["--grid", "21,21,16", "--domain", "0,1,0"], &["--domain", "4 numbers"]),
        (&["--grid", "21,21,16", "--domain", "0,1,1,0"], &["--domain, Y1", "found 0"]),
        (&["--grid", "21,21,16", "--domain", "0,inf,0,1"], &["--domain, X1", "finite"]),
        (&["--grid", "2,21,16", "--domain", "0,1,0,1"], &["--grid, NX", "at least", "found 2"]),
        (&["--grid", "0,0,0", "--domain", "0,1,0,1"], &["--grid, NX", "found 0"]),
        (&["--grid", "70000,9,9", "--domain", "0,1,0,1"], &["--grid", "65536", "70000"]),
        (&["--grid", "1,2,3", "--accuracy", "fine"], &["--accuracy", "--grid"]),
    ];
    for (args, words) in table {
        refuses(&[&["solve", "--out", &out], args].concat(), words).await;
        assert!(folder.names().is_empty(), "{args:?}");
    }
    // Grids that are too large are refused immediately. The message states the memory that they
    // would need.
    for grid in ["4000,4000,4000", "18446744073709551615,18446744073709551615,9"] {
        for method in ["cartesian", "exact"] {
            let args = ["--grid", grid, "--domain", "-9,9,-9,9", "--method", method];
            let args = [&["solve", "--out", &out][..], &args].concat();
            let refused = refuses(&args, &["--grid", "MiB"]);
            tokio::time::timeout(Duration::from_secs(5), refused).await.unwrap();
        }
    }
    let nowhere = "/proc/nowhere/v.npz";
    run(&["solve", "--out", nowhere]).await.refused(1, &[nowhere]);
    refuses(&["solve"], &["--out"]).await;
    for command in ["value", "plot"] {
        let both = [command, "--radius", "2", "--value-function", "v.npz", "--out", "a.svg"];
        refuses(&both, &["--value-function", "cannot be used with", "--radius"]).await;
    }
}

/// The archive with a changed `meta`.
fn with_meta(file: &Path, change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut json = meta(file);
    change(&mut json);
    let text = json.to_string();
    let mut from = ZipArchive::new(std::fs::File::open(file).unwrap()).unwrap();
    let mut to = ZipWriter::new(Cursor::new(Vec::new()));
    for i in 0..from.len() {
        let entry = from.by_index_raw(i).unwrap();
        if entry.name().unwrap() != "meta.npy" {
            to.raw_copy_file(entry).unwrap();
        }
    }
    to.start_file("meta.npy", SimpleFileOptions::default()).unwrap();
    let dict = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({},), }}", text.len());
    let header = format!("{dict:<117}\n");
    to.write_all(b"\x93NUMPY\x01\x00\x76\x00").unwrap();
    to.write_all(header.as_bytes()).unwrap();
    to.write_all(text.as_bytes()).unwrap();
    to.finish().unwrap().into_inner()
}

#[tokio::test]
async fn files_that_are_no_value_function() {
    let folder = Folder::default();
    let good = folder.path("good.npz");
    let game = ["--pursuer-speed", "1.5", "--accuracy", "draft"];
    prints(&[&["solve", "--out", &folder.name("good.npz")][..], &game].concat()).await;
    let states = folder.file("states.csv", "x,y,psi\n1,2,3\n");
    let whole = std::fs::read(&good).unwrap();
    type Change = fn(&mut Value);
    let same: Change = |_| ();
    let mut table: Vec<(Vec<u8>, &[&str])> = vec![
        (Vec::new(), &["NumPy archive"]),
        (b"x,y,psi\n1,2,3\n".to_vec(), &["NumPy archive"]),
        (whole[..whole.len() / 2].to_vec(), &["NumPy archive"]),
        (whole[..whole.len() - 1].to_vec(), &["bad.npz"]),
    ];
    let changes: [(Change, &[&str]); 7] = [
        (|m| m["format"] = "sidestep-value-npz/2".into(), &["meta.format", "/1", "/2"]),
        (|m| m["nodes"]["range_nodes"] = 34.into(), &["axis0.shape", "[34]", "[33]"]),
        (|m| m["nodes"]["angle_nodes"] = 49.into(), &["meta.nodes.angle_nodes", "even"]),
        (|m| m["game"]["radius_m"] = 0.into(), &["meta.game.radius_m", "> 0"]),
        (|m| m["game"] = 1.into(), &["meta.game"]),
        (|m| m["horizon"] = (-1).into(), &["meta.horizon"]),
        (|m| m["method"] = "exact".into(), &["meta.method"]),
    ];
    for (change, words) in changes {
        table.push((with_meta(&good, change), words));
    }
    for (bytes, words) in table {
        let bad = folder.file("bad.npz", bytes);
        let out = folder.name("values.csv");
        let args = ["value", "--value-function", &bad, "--states", &states, "--out", &out];
        refuses(&args, &[words, &["bad.npz"]].concat()).await;
        assert!(!folder.path("values.csv").exists());
    }
    let kept = folder.file("bad.npz", with_meta(&good, same));
    let out = folder.name("values.csv");
    prints(&["value", "--value-function", &kept, "--states", &states, "--out", &out]).await;
}

#[tokio::test]
async fn figures() {
    let folder = Folder::default();
    let svg = folder.name("v.svg");
    prints(&["plot", "--out", &svg, "--psi", "-30,90", "--levels", "-1,0,2"]).await;
    let text = folder.text("v.svg");
    assert!(text.starts_with("<svg ") && text.trim_end().ends_with("</svg>"));
    for word in ["ψ = −30°", "ψ = 90°", "V = −1 m", "V = 2 m", "radius 3 m", "x ahead (m)"]
    {
        assert!(text.contains(word), "{word}");
    }
    assert!(!text.contains("NaN"));
    for (kind, size) in [("slices", [1226, 739]), ("tube", [900, 960])] {
        let png = folder.name("v.png");
        prints(&["plot", "--out", &png, "--kind", kind]).await;
        let picture = image::open(&png).unwrap().into_rgb8();
        assert_eq!(picture.width(), 2 * size[0], "{kind}");
        // Text, curves and surfaces are drawn, so many pixels are dark.
        let dark = picture.pixels().filter(|pixel| pixel.0[1] < 100).count();
        assert!(dark > 5000, "{kind}: {dark}");
        // The title is drawn with the font that is embedded in the program.
        let title = image::imageops::crop_imm(&picture, 40, 40, 900, 70).to_image();
        let ink = title.pixels().filter(|pixel| pixel.0[0] < 80).count();
        assert!(ink > 2000, "{kind}: {ink}");
    }
    let solved = folder.name("v.npz");
    let grid = ["--grid", "25,21,16", "--domain", "-6,12,-9,9", "--scheme", "upwind"];
    prints(&[&["solve", "--out", &solved][..], &grid].concat()).await;
    for kind in ["slices", "tube"] {
        prints(&["plot", "--value-function", &solved, "--kind", kind, "--out", &svg]).await;
        assert!(!folder.text("v.svg").contains("NaN"));
    }
    let table: [(&[&str], &[&str]); 7] = [
        (&["--out", "v.jpg"], &["--out", ".svg", ".png", "v.jpg"]),
        (&["--out", "v"], &["--out", ".svg"]),
        (&["--out", &svg, "--psi", "0,nan"], &["--psi", "NaN"]),
        (&["--out", &svg, "--psi", "north"], &["--psi", "north"]),
        (&["--out", &svg, "--levels", "1,0"], &["--levels", "from the lowest up"]),
        (&["--out", &svg, "--levels", "-3,0"], &["--levels", "-3"]),
        (&["--out", &svg, "--levels", "inf"], &["--levels", "finite"]),
    ];
    for (args, words) in table {
        refuses(&[&["plot"], args].concat(), words).await;
    }
}

#[cfg(unix)]
#[tokio::test]
async fn a_solve_that_is_interrupted_leaves_nothing() {
    let folder = Folder::default();
    let out = folder.name("v.npz");
    for signal in ["INT", "TERM"] {
        // This solve takes minutes.
        let grid = ["solve", "--grid", "301,301,200", "--domain", "-20,20,-20,20"];
        let args = [&grid[..], &["--threads", "1", "--out", &out]].concat();
        let said: Said = interrupted(&args, signal, || true).await.into();
        said.refused(1, &["nothing was written"]);
        assert!(folder.names().is_empty(), "{:?}", folder.names());
    }
}

#[tokio::test]
async fn help_names_defaults_and_units() {
    for (command, words) in [
        ("solve", &["m/s", "rad/s", "[default: 2]", "[default: inf]", "polar", "weno5"][..]),
        ("value", &["dvalue_dpsi", "rad/s", "[default: 3]", "--value-function"]),
        ("plot", &["degrees", ".svg", "slices", "tube", "[default: 0,1,2]"]),
    ] {
        let text = run(&[command, "--help"]).await.out;
        let (_, game) = text.split_once("Game:").unwrap();
        assert!(game.contains("--radius") && !game.contains("--out"), "{game}");
        for word in words {
            assert!(text.contains(word), "{command}: {word} in\n{text}");
        }
    }
}
