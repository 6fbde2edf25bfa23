//! `bounds` and `reach`: their output and their errors.

use serde_json::{Value, json};
use sidestep_tests::process::{Said, binary};
use sidestep_tests::{Folder, run};
use std::process::Stdio;
use tokio::io::AsyncWriteExt;

/// Runs a command with a document as its input, and returns the output.
async fn said_of(command: &str, document: &str) -> Said {
    let folder = Folder::default();
    run(&[command, "--input", &folder.file("given.json", document)]).await
}

async fn answer(command: &str, document: &Value) -> Value {
    said_of(command, &document.to_string()).await.only_json()
}

/// What the parser expects as a kind of model: the kinds of the table, in its order.
fn kinds() -> String {
    let table = include_str!("../../../shared/src/predict.rs");
    let named = table.split("/// `\"kind\": \"").skip(1);
    let names: Vec<_> = named.map(|rest| rest.split('"').next().unwrap()).collect();
    let (last, others) = names.split_last().unwrap();
    format!("expected {} or {last}", others.join(", "))
}

/// Checks that a command rejects the document with one line that names the file and contains these
/// words.
async fn refused(command: &str, document: &str, words: &str) {
    said_of(command, document).await.refused(2, &["given.json: ", words]);
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The maximum absolute difference between corresponding numbers of two lists.
fn apart(a: &Value, b: &Value) -> f64 {
    let (a, b) = (numbers(a), numbers(b));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn area_of(polygon: &Value) -> f64 {
    let points: Vec<Vec<f64>> = polygon.as_array().unwrap().iter().map(numbers).collect();
    let next = points.iter().cycle().skip(1);
    0.5 * points.iter().zip(next).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum::<f64>()
}

#[tokio::test]
async fn reach_answers_every_reference_case() {
    let file = include_str!("../../../shared/tests/data/shfrs_vectors.json");
    let vectors: Value = serde_json::from_str(file).unwrap();
    let cases = vectors["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 12);
    for case in cases {
        let given = case["queries"].as_array().unwrap();
        let queries: Vec<Value> =
            given.iter().map(|q| json!({ "step": q["step"], "state": q["state"] })).collect();
        let document = json!({
            "speed": vectors["v"], "dt": vectors["dt"],
            "turn_rate": [vectors["w_min"], vectors["w_max"]],
            "initial": case["x0"],
            "sets": [{ "lo": case["lo"], "hi": case["hi"], "queries": queries }],
            "tolerance": { "position": 1e-3, "heading": 1e-3 },
        });
        let found = answer("reach", &document).await;
        let found = &found["sets"][0];
        let id = &case["id"];
        // The tolerances that belong to the reference file.
        let share = match (case["zero_in_all"].as_bool().unwrap(), case["T"] == 25) {
            (true, _) => 1e-3,
            (false, true) => 1e-2,
            (false, false) => 5e-3,
        };
        let check = |what: &str, found: &Value, expected: &Value| {
            let area = expected["area"].as_f64().unwrap();
            let excess = found["area"].as_f64().unwrap() - area;
            let tolerance = 2e-4 + share * area;
            // For this case, the reference approximates the rear boundary by chords. They lie up to
            // 1.4 mm behind the true boundary, where nothing is reachable
            // (`shared/tests/reach/reference.rs` has the exact boundary). The chords are at most as
            // long as two sides of the box.
            let [x0, y0, x1, y1] = numbers(&expected["bbox"])[..] else { panic!("a box") };
            let chords = if id == 4 { 1.4e-3 * (x1 - x0 + y1 - y0) } else { 0.0 };
            assert!(
                -tolerance - chords <= excess && excess <= tolerance,
                "case {id} {what}: {excess} m² more than {area}"
            );
            assert!(apart(&found["bbox"], &expected["bbox"]) <= 1e-3, "case {id} {what}");
            let drawn = area_of(&found["polygon"]);
            assert!((drawn - found["area"].as_f64().unwrap()).abs() < 1e-9, "case {id} {what}");
        };
        let (steps, expected) = (&found["steps"], case["steps"].as_array().unwrap());
        assert_eq!(steps.as_array().unwrap().len(), expected.len());
        for (i, expected) in expected.iter().enumerate() {
            assert_eq!(steps[i]["step"], expected["i"]);
            let t = 0.2 * (i + 1) as f64;
            assert!((steps[i]["t"].as_f64().unwrap() - t).abs() < 1e-12);
            check(&format!("step {}", i + 1), &steps[i], expected);
        }
        check("tube", &found["tube"], &case["tube"]);
        for (q, expected) in given.iter().enumerate() {
            let found = &found["queries"][q];
            assert_eq!(found["planar"], expected["planar_in"], "case {id} query {q}");
            if !expected["full_in"].is_null() {
                assert_eq!(found["full"], expected["full_in"], "case {id} query {q}");
            }
        }
    }
}

fn reach() -> Value {
    json!({
        "speed": 2, "dt": 0.2, "turn_rate": [-0.5, 0.5], "initial": [1, 2, 0.5],
        "sets": [{ "lo": [-0.5, -0.5], "hi": [0.5, 0.5],
                   "queries": [{ "step": 1, "state": [1.35, 2.19, 0.5] }] }],
    })
}

#[tokio::test]
async fn reach_reads_stdin_and_writes_files() {
    let folder = Folder::default();
    let mut child = tokio::process::Command::new(binary())
        .args(["reach", "--input", "-", "--out", &folder.name("sets.json")])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(reach().to_string().as_bytes()).await.unwrap();
    drop(stdin);
    let line = Said::from(child.wait_with_output().await.unwrap()).json();
    let written = folder.text("sets.json");
    assert_eq!(line["bytes"].as_u64(), Some(written.len() as u64));
    let written: Value = serde_json::from_str(&written).unwrap();
    assert_eq!(written, answer("reach", &reach()).await);
    assert_eq!(written["sets"][0]["queries"][0], json!({ "planar": true, "full": true }));
}

#[tokio::test]
async fn conservative_polygons_are_a_little_larger() {
    let mut document = reach();
    let exact = answer("reach", &document).await;
    document["conservative"] = json!(true);
    let outer = answer("reach", &document).await;
    for part in ["/sets/0/tube/area", "/sets/0/steps/0/area", "/sets/0/steps/1/area"] {
        let area = |answer: &Value| answer.pointer(part).unwrap().as_f64().unwrap();
        let excess = area(&outer) - area(&exact);
        assert!(excess > 0.0 && excess < 0.01, "{part}: {excess} m²");
    }
    assert_eq!(outer["sets"][0]["queries"], exact["sets"][0]["queries"]);
}

/// A vehicle that changes its speed reaches what each constant speed reaches, and more.
#[tokio::test]
async fn a_range_of_speeds_reaches_more() {
    // After 0.45 m and after 0.05 m of driving straight, and with a heading that is 1 rad off.
    let mut document = reach();
    document["sets"][0]["queries"] = json!([
        { "step": 1, "state": [1.3949, 2.2157, 0.5] },
        { "step": 1, "state": [1.0439, 2.0240, 0.5] },
        { "step": 1, "state": [1.3949, 2.2157, 1.5] },
    ]);
    let constant = answer("reach", &document).await;
    document["speed"] = json!([0.5, 2.5]);
    let chosen = answer("reach", &document).await;
    let found = |answer: &Value, which: &str| -> Vec<bool> {
        (0..3).map(|q| answer["sets"][0]["queries"][q][which].as_bool().unwrap()).collect()
    };
    assert_eq!(found(&constant, "planar"), [false, false, false]);
    assert_eq!(found(&chosen, "planar"), [true, false, true]);
    assert_eq!(found(&chosen, "full"), [true, false, false]);
    let area = |answer: &Value| answer["sets"][0]["tube"]["area"].as_f64().unwrap();
    assert!(area(&chosen) > area(&constant), "{} {}", area(&chosen), area(&constant));
    document["speed"] = json!([2, 2]);
    assert_eq!(answer("reach", &document).await, constant);
}

#[tokio::test]
async fn an_uncertain_start_reaches_more() {
    // Three states: 0.2 m beyond the end of driving straight, the end of driving straight with a
    // heading that is 0.4 rad off, and an unreachable state.
    let mut document = reach();
    document["sets"][0]["queries"] = json!([
        { "step": 1, "state": [1.526, 2.288, 0.5] },
        { "step": 1, "state": [1.2486, 2.3133, 0.9] },
        { "step": 1, "state": [1.35, 2.19, 2.0] },
    ]);
    let exact = answer("reach", &document).await;
    let full = |answer: &Value| -> Vec<bool> {
        (0..3).map(|q| answer["sets"][0]["queries"][q]["full"].as_bool().unwrap()).collect()
    };
    let area = |answer: &Value| answer["sets"][0]["tube"]["area"].as_f64().unwrap();
    assert_eq!(full(&exact), [false, false, false]);
    for (start, inside) in [
        (json!({ "disc": 0.25 }), [true, false, false]),
        (json!({ "box": [0.25, 0.01] }), [true, false, false]),
        (json!({ "box": [0.01, 0.25] }), [false, false, false]),
        (json!({ "heading": 0.4 }), [false, true, false]),
        (json!({ "disc": 0.25, "heading": 0.4 }), [true, true, false]),
    ] {
        document["start"] = start;
        let found = answer("reach", &document).await;
        assert_eq!(full(&found), inside, "{}", document["start"]);
        assert!(area(&found) > area(&exact));
    }
    for (start, words) in [
        (json!({ "disc": -1 }), "start.disc: expected"),
        (json!({ "disc": 1e200 }), "start.disc: expected a number from 0 to 10000"),
        (json!({ "box": [1, -1] }), "start.box[1]: expected"),
        (json!({ "heading": 4 }), "start.heading: expected 0 to π rad"),
        (json!({ "disc": 1, "box": [1, 1] }), "start: expected a disc or a box"),
    ] {
        document["start"] = start;
        refused("reach", &document.to_string(), words).await;
    }
}

#[tokio::test]
async fn reach_names_what_is_wrong() {
    let long = json!({ "lo": vec![0.0; 301], "hi": vec![0.1; 301] });
    for (pointer, value, words) in [
        ("/sets/0/hi/1", json!(0.6), "sets[0].hi[1]: expected a turn rate from"),
        ("/sets/0/hi/1", json!("x"), "sets[0].hi[1]: expected a number, found \"x\""),
        (
            "/sets/0",
            json!({ "lo": [0, 0.2], "hi": [0, 0.1] }),
            "sets[0].lo[1]: expected at most hi[1] = 0.1",
        ),
        ("/sets/0/lo", json!([]), "sets[0].lo: expected at least one step"),
        ("/sets/0/lo", json!([0]), "sets[0].hi: expected 1 entries, found 2"),
        ("/sets", json!([]), "sets: expected at least one set"),
        ("/turn_rate", json!([0.5, -0.5]), "turn_rate: expected"),
        ("/turn_rate", json!([-90, 90]), "turn_rate: expected at most half a turn"),
        ("/speed", json!(0), "speed: expected a finite number > 0, found 0"),
        ("/speed", json!("2"), "speed: expected a number or [lowest, highest], found \"2\""),
        ("/speed", json!([1, 2, 3]), "speed"),
        (
            "/speed",
            json!([2, 1]),
            "speed: expected two finite speeds ≥ 0, the lower one first, found [2, 1]",
        ),
        ("/speed", json!([0, 0]), "speed: expected a finite number > 0, found 0"),
        // Values that are too large for any picture, or for double precision.
        ("/speed", json!(1e30), "speed: expected a speed that makes steps of 100 m"),
        ("/initial", json!([1e14, 0, 0]), "initial.x: expected a number from -1000000"),
        ("/initial", json!([0, 0, 1e25]), "initial.psi: expected a number from -1000000"),
        ("/initial", json!([0, 0, 1e5]), "initial"),
        ("/sets/0", long, "sets[0].lo: expected at most 300 steps, found 301"),
        ("/dt", json!(-1), "dt: expected"),
        ("/initial", json!([0, 0]), "initial"),
        (
            "/sets/0/queries/0/step",
            json!(3),
            "sets[0].queries[0].step: expected a step from 0 to 2",
        ),
        ("/sets/0/queries/0/step", json!(-1), "sets[0].queries[0].step: expected"),
    ] {
        let mut document = reach();
        *document.pointer_mut(pointer).unwrap() = value;
        refused("reach", &document.to_string(), words).await;
    }
    for (name, value, words) in [
        ("tolerance", json!({ "position": -1, "heading": 0 }), "tolerance.position: expected"),
        ("accuracy", json!(0), "accuracy: expected"),
        ("acuracy", json!(1), "acuracy"),
    ] {
        let mut document = reach();
        document[name] = value;
        refused("reach", &document.to_string(), words).await;
    }
    for (text, words) in [
        ("{\"speed\": NaN}", "not JSON"),
        ("{}", "speed: expected a value, found nothing"),
        (&"[".repeat(100_000)[..], "not JSON"),
        ("[2, 0.2]", "expected an object"),
    ] {
        refused("reach", text, words).await;
    }
    let nowhere = "/nowhere/reach.json";
    run(&["reach", "--input", nowhere]).await.refused(2, &[nowhere]);
}

fn bounds() -> Value {
    json!({
        "human": [-6, 0, 0], "robot": [6, 1, 3.1],
        "predictor": { "format": "sidestep-predictor/1", "kind": "constant",
                       "features": ["distance"], "classes": [-1, 0, 1],
                       "probabilities": [0.5, 0.3, 0.2] },
        "epsilon": [0, 0.15, 1], "k": [2, 1], "rollout": "paper",
        "speed": 2, "dt": 0.2, "turn_rate": [-0.5, 0.5],
    })
}

#[tokio::test]
async fn bounds_are_those_of_algorithm_1() {
    let found = answer("bounds", &bounds()).await;
    assert_eq!(found["raw"], json!([[-0.5, 0.0], [-0.5, -0.5]]));
    assert_eq!(found["lo"], json!([[-0.5, -0.5], [-0.5, -0.5], [-0.5, -0.5]]));
    assert_eq!(found["hi"], json!([[0.0, -0.5], [0.15, -0.35], [0.5, 0.5]]));
    assert_eq!(found["human_low"].as_array().unwrap().len(), 3);
    assert!(
        apart(&found["human_low"][2], &json!([-5.205_322_676_8, -0.079_733_688_6, -0.2])) < 1e-9
    );
    assert!(apart(&found["human_high"][1], &json!([-5.6, 0, 0])) < 1e-12);
}

#[tokio::test]
async fn bounds_with_other_actions_an_adaptive_set_and_unequal_vehicles() {
    let mut document = bounds();
    document.as_object_mut().unwrap().remove("k");
    document["tau"] = json!(0.2);
    document["steps"] = json!(3);
    document["turn_rate"] = json!([-0.3, 0.8]);
    document["predictor"]["classes"] = json!([0, 1, 2, 3]);
    document["predictor"]["actions"] = json!([-0.3, 0.1, 0.4, 0.8]);
    document["predictor"]["probabilities"] = json!([0.1, 0.3, 0.5, 0.1]);
    let found = answer("bounds", &document).await;
    assert_eq!(found["raw"], json!([[0.1, 0.4], [0.1, 0.4], [0.1, 0.4]]));
    assert_eq!(found["hi"][2], json!([0.8, 0.8, 0.8]));
    // The shortest interval with 0.6 is from 0.1 to 0.4. With 0.9 two are equally short and probable, and both
    // count.
    let mut shortest = document.clone();
    shortest.as_object_mut().unwrap().remove("tau");
    shortest["q"] = json!([0.4, 0.6, 0.9]);
    let found = answer("bounds", &shortest).await;
    assert_eq!(found["raw"], json!([[0.4, 0.4], [0.1, 0.4], [-0.3, 0.8]]));
    shortest["q"] = json!([0.4, 1.2, 0.9]);
    refused("bounds", &shortest.to_string(), "q[1]: expected a number in (0, 1], found 1.2").await;
    // Only features that use value functions need vehicles for which a value function exists.
    document["predictor"]["features"] = json!(["distance", "v_r"]);
    refused("bounds", &document.to_string(), "turn_rate: expected the same to both sides").await;
    // A constant predictor needs no features at all.
    let mut document = bounds();
    document["predictor"]["features"] = json!([]);
    assert_eq!(answer("bounds", &document).await, answer("bounds", &bounds()).await);
    document["predictor"]["features"] = json!(["v_h"]);
    document["robot_turn_rate"] = json!(0.35);
    assert_eq!(answer("bounds", &document).await["raw"], json!([[-0.5, 0.0], [-0.5, -0.5]]));
}

#[tokio::test]
async fn bounds_names_what_is_wrong() {
    // A model that only predicts whether a person turns does not predict the direction, so only
    // experiment 1 is accepted.
    let whether = |experiment: u8| {
        let mut predictor = bounds()["predictor"].clone();
        predictor["experiment"] = json!(experiment);
        predictor
    };
    let mut document = bounds();
    document["predictor"] = whether(1);
    assert_eq!(answer("bounds", &document).await, answer("bounds", &bounds()).await);
    let kind = format!("predictor.kind: {}", kinds());
    let kind = &kind[..];
    for (pointer, value, words) in [
        ("/epsilon", json!([0.2, 0.1]), "epsilon[1]: expected 0.2 rad/s or more"),
        ("/epsilon", json!([]), "epsilon: expected at least one set"),
        ("/k", json!([1, 4]), "k[1]: expected a whole number from 1 to 3, found 4"),
        ("/k", json!([0]), "k[0]: expected"),
        ("/k", json!([]), "k: expected at least one step"),
        ("/k", json!([-1]), "k[0]: expected"),
        ("/k", Value::Null, "k: expected one of k, q and tau (with steps), found none"),
        ("/tau", json!(0.1), "tau: expected none beside k"),
        ("/q", json!([0.9, 0.9]), "q: expected none beside k"),
        ("/steps", json!(5), "steps: expected 2"),
        ("/rollout", json!("printed"), "rollout: expected paper or base"),
        ("/speed", json!(-2), "speed: expected"),
        ("/turn_rate", json!([0.5, -0.5]), "turn_rate: expected"),
        ("/turn_rate", json!([0.1, 0.5]), "predictor.classes[1]: expected"),
        ("/human", json!([0, "x", 0]), "human[1]: expected a number"),
        ("/predictor", whether(2), "predictor.experiment: expected 1, a model"),
        ("/speeed", json!(2), "speeed"),
        ("/predictor/kind", json!("oracle"), kind),
        ("/predictor/classes", json!([-2, 0, 1]), "predictor.classes[0]: expected -1"),
        ("/predictor/actions", json!([-0.5, 0.0, 0.7]), "predictor.actions[2]: expected"),
        ("/predictor/probabilities", json!([1, 1, 1]), "predictor.probabilities"),
        ("/predictor/features", json!(["age"]), "predictor.features[0]: expected"),
    ] {
        let mut document = bounds();
        let (object, field) = pointer.rsplit_once('/').unwrap();
        document.pointer_mut(object).unwrap()[field] = value;
        refused("bounds", &document.to_string(), words).await;
    }
}

/// The output of `bounds` for a document and, if given, a predictor in a file of its own.
async fn bounds_with(document: &Value, predictor: Option<&Value>) -> Said {
    let folder = Folder::default();
    let given = folder.file("given.json", document.to_string());
    let beside = predictor.map(|predictor| folder.file("beside.json", predictor.to_string()));
    let mut args = vec!["bounds", "--input", &given];
    args.extend(beside.iter().flat_map(|beside| ["--predictor", beside]));
    run(&args).await
}

/// Splits a document into the document without its predictor, and the predictor.
fn parted(mut document: Value) -> (Value, Value) {
    let predictor = document.as_object_mut().unwrap().remove("predictor").unwrap();
    (document, predictor)
}

#[tokio::test]
async fn a_predictor_beside_the_document_says_the_same_as_one_in_it() {
    let mut document = bounds();
    document["predictor"] = json!({
        "format": "sidestep-predictor/1", "kind": "logistic", "features": ["distance", "v_h"],
        "mean": [10, 1], "scale": [2, 1], "classes": [-1, 0, 1],
        "coefficients": [[-0.3, 1], [1, 0], [0, -1]], "intercepts": [0, 0.5, 0],
    });
    let within = answer("bounds", &document).await;
    let (document, predictor) = parted(document);
    assert_eq!(bounds_with(&document, Some(&predictor)).await.only_json(), within);
}

#[tokio::test]
async fn there_is_one_predictor() {
    let (alone, predictor) = parted(bounds());
    let refuses = async |document: &Value, predictor: Option<&Value>, words: &str| {
        bounds_with(document, predictor).await.refused(2, &[words]);
    };
    let one = "given.json: predictor: expected a predictor here or in --predictor FILE.json";
    refuses(&bounds(), Some(&predictor), &format!("{one}, found both")).await;
    refuses(&alone, None, &format!("{one}, found neither")).await;
    // Errors in the predictor name the predictor's file.
    let with = |name: &str, value: Value| {
        let mut predictor = predictor.clone();
        predictor[name] = value;
        predictor
    };
    let which = "beside.json: experiment: expected 1, a model of the turn direction";
    refuses(&alone, Some(&with("experiment", json!(2))), which).await;
    let kind = format!("beside.json: kind: {}", kinds());
    let kind = &kind[..];
    refuses(&alone, Some(&with("kind", json!("oracle"))), kind).await;
    let class = "beside.json: classes[0]: expected -1";
    refuses(&alone, Some(&with("classes", json!([-2, 0, 1]))), class).await;
    let rate = "beside.json: actions[2]: expected a turn rate";
    refuses(&alone, Some(&with("actions", json!([-0.5, 0, 0.7]))), rate).await;
    refuses(&alone, Some(&json!([1])), "beside.json: expected an object").await;
    // Errors in the document name the document.
    let mut document = alone.clone();
    document["speed"] = json!(-2);
    refuses(&document, Some(&predictor), "given.json: speed: expected").await;
    // The path of a file is not a predictor.
    let mut path = alone.clone();
    path["predictor"] = json!("model.json");
    let object = "given.json: predictor: expected an object, {…}, as in a predictor.json, \
                  found \"model.json\"";
    refuses(&path, None, object).await;

    let folder = Folder::default();
    let given = folder.file("given.json", alone.to_string());
    for (input, predictor, words) in [
        (&given[..], "/nowhere/model.json", "/nowhere/model.json: cannot read: "),
        ("-", "-", "--predictor and --input cannot both read stdin"),
    ] {
        let args = ["bounds", "--input", input, "--predictor", predictor];
        run(&args).await.refused(2, &[words]);
    }
}

#[tokio::test]
async fn regions_are_drawn_with_a_predictor_beside_the_document() {
    let folder = Folder::default();
    let draw = async |document: &Value, further: &[&str]| {
        let input = folder.file("bounds.json", document.to_string());
        let out = folder.name("regions.svg");
        let args = ["plot", "--kind", "regions", "--input", &input, "--out", &out];
        run(&[&args, further].concat()).await.json();
        folder.text("regions.svg")
    };
    let within = draw(&bounds(), &[]).await;
    let (document, predictor) = parted(bounds());
    let model = folder.file("model.json", predictor.to_string());
    assert!(draw(&document, &["--predictor", &model]).await == within);
    // Panels share their axes, so documents with different axes are rejected.
    let mut other = bounds();
    (other["k"], other["dt"]) = (json!([1]), json!(0.5));
    let first = folder.file("bounds.json", bounds().to_string());
    let second = folder.file("other.json", other.to_string());
    let out = folder.name("both.svg");
    let inputs = ["--input", &first, "--input", &second, "--out", &out];
    let words = "other.json: expected 2 steps of 0.2 s and 3 sets, as in the first --input, \
                 found 1 steps of 0.5 s and 3 sets";
    run(&[&["plot", "--kind", "regions"], &inputs[..]].concat()).await.refused(2, &[words]);
    let words = "--predictor: expected only with --kind regions or replay";
    run(&["plot", "--predictor", &model, "--out", &out]).await.refused(2, &[words]);
}
