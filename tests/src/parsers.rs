//! All parsers of external input, as functions of arbitrary bytes. A fuzzer (`cargo xtask fuzz`)
//! calls them, and so does the test on all stored inputs. A parser is allowed to reject its input,
//! but it must not panic, hang, or fail to read back its own output.

use crate::Folder;
use clap::Args;
use sidestep::api::{Enrolment, TrialUpload};
use sidestep::document::from_json;
use sidestep::predict::PredictorFile;
use sidestep::reachability::ValueFunction;
use sidestep::scene::{JointState, Scene, SceneParameters};
use sidestep::shfrs::file::PRESETS;
use sidestep::trial_view;
use sidestep::trial_view::source::Source;
use sidestep::value_view;
use sidestep_server::commands::CommandError;
use sidestep_server::commands::bounds::{self, BoundsArgs};
use sidestep_server::commands::reach::{self, ReachArgs};
use sidestep_server::formats::study_toml::{StudyFile, written};
use sidestep_server::formats::trials_csv::{self, Order};
use sidestep_server::formats::{features_csv, npz};
use sidestep_server::http::exports::ExportParams;
use sidestep_server::http::laboratory::PageParams;
use sidestep_server::http::{json, params, people};
use sidestep_server::trial_content::Content;
use std::io::Cursor;
use std::ops::ControlFlow;
use tokio::runtime::Runtime;

/// A parser, called with arbitrary bytes.
pub type Parser = fn(&[u8]);

/// All parsers, by name.
pub const PARSERS: [(&str, Parser); 10] = [
    ("upload", upload),
    ("trials-csv", trials),
    ("features-csv", features),
    ("npz", archive),
    ("value-function", value_function),
    ("predictor", predictor),
    ("study", study),
    ("bounds", bounds),
    ("reach", reach),
    ("query", query),
];

/// The parser with this name.
#[must_use]
pub fn named(name: &str) -> Option<Parser> {
    PARSERS.iter().find(|(one, _)| *one == name).map(|&(_, parser)| parser)
}

/// The body of an upload, including the checks before it is stored.
fn upload(bytes: &[u8]) {
    let _ = json::parse::<Enrolment<serde_json::Value>>(bytes);
    let Ok(upload) = json::parse::<TrialUpload>(bytes) else { return };
    let parameters = SceneParameters::default();
    if upload.check(&parameters).is_err() {
        return;
    }
    let JointState { human, robot } = upload.states[0];
    let scene = Scene::new(&parameters, human, robot);
    let content = Content {
        started_at_ms: Some(upload.started_at_ms),
        key_events: written_as_json(&upload.key_events),
        page_events: Some(written_as_json(&upload.page_events)),
        exposures: Some(upload.exposures),
        display: written_as_json(&upload.display),
        inputs: upload.inputs,
        states: upload.states,
        sampled_at_ms: Some(upload.sampled_at_ms),
    };
    content.flags(&parameters, &scene).expect("what was checked has flags");
}

fn written_as_json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).expect("JSON")
}

/// A file of trials, read by both readers, which must agree. Only the first reader accepts a file
/// in which the trials of a participant are scattered.
fn trials(bytes: &[u8]) {
    let parameters = SceneParameters::default();
    let whole = trials_csv::read(bytes, &parameters);
    let order = trials_csv::check(bytes, &parameters).map(|(order, _)| order);
    if !matches!(order, Ok(Order::Scattered)) {
        assert_eq!(whole.is_ok(), order.is_ok(), "{:?} {:?}", whole.err(), order.err());
    }
    let (Ok(whole), Ok(Order::Together)) = (whole, order) else { return };
    let mut one_by_one = Vec::new();
    let each = trials_csv::each(bytes, &parameters, |person| {
        one_by_one.push(person);
        ControlFlow::Continue(())
    });
    assert!(each.is_ok(), "{each:?}");
    assert_eq!(whole.len(), one_by_one.len());
}

fn features(bytes: &[u8]) {
    let _ = features_csv::read(bytes);
}

fn archive(bytes: &[u8]) {
    let Ok(stored) = npz::read(Cursor::new(bytes)) else { return };
    used(&stored.function);
}

/// An encoded value function, which must survive a round trip.
fn value_function(bytes: &[u8]) {
    let Ok(function) = ValueFunction::decode(bytes) else { return };
    used(&function);
    let again = ValueFunction::decode(&function.encode()).expect("what was encoded");
    assert_eq!(again.encode(), function.encode());
}

/// Checks that a decoded function has a finite value everywhere.
fn used(function: &ValueFunction) {
    for relative in [[0.0, 0.0, 0.0], [3.0, -2.0, 1.0], [-1e3, 1e3, -4.0]] {
        let value = function.value(relative);
        assert!(value.is_finite(), "{relative:?}: {value}");
    }
}

/// A predictor file. The predictor must return probabilities.
fn predictor(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(file) = from_json::<PredictorFile>(text) else { return };
    let Ok(predictor) = file.of_turns() else { return };
    let values = vec![0.25; predictor.features().len()];
    let mut probabilities = vec![0.0; predictor.classes().len()];
    predictor.probabilities_into(&values, &mut probabilities);
    let sum: f64 = probabilities.iter().sum();
    assert!(
        probabilities.iter().all(|p| (0.0..=1.0).contains(p)) && (sum - 1.0).abs() < 1e-9,
        "{probabilities:?}"
    );
}

/// A study file, which must survive a round trip.
fn study(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(file) = StudyFile::of("study.toml".to_owned(), text.to_owned()) else { return };
    let config = file.config();
    let text = written(config).expect("a configuration has a file");
    let again = StudyFile::of("study.toml".to_owned(), text.clone());
    assert!(again.is_ok_and(|again| again.config() == config), "{text}");
}

/// The input document of `sidestep bounds`. The command must answer or reject it.
fn bounds(bytes: &[u8]) {
    answered::<BoundsArgs>(bytes, bounds::run);
}

/// The input document of `sidestep reach`. Inputs with many steps are skipped, because they take
/// seconds, which is too slow for a fuzzer.
fn reach(bytes: &[u8]) {
    let document: serde_json::Value = serde_json::from_slice(bytes).unwrap_or_default();
    let is_long = |set: &serde_json::Value| set["lo"].as_array().is_some_and(|lo| lo.len() > 8);
    if document["sets"].as_array().is_some_and(|sets| sets.len() > 3 || sets.iter().any(is_long)) {
        return;
    }
    answered::<ReachArgs>(bytes, reach::run);
}

/// Runs a command with these bytes as its input file, and with an output file.
fn answered<A: Args>(bytes: &[u8], run: impl AsyncFn(A) -> Result<(), CommandError>) {
    thread_local! {
        static RUNTIME: Runtime = Runtime::new().expect("a runtime");
        static FOLDER: Folder = Folder::default();
    }
    FOLDER.with(|folder| {
        let input = folder.file("input.json", bytes);
        let out = folder.name("out.json");
        let command = A::augment_args(clap::Command::new("sidestep").no_binary_name(true));
        let given = command.get_matches_from(["--input", &input, "--out", &out]);
        let args = A::from_arg_matches(&given).expect("arguments");
        match RUNTIME.with(|runtime| runtime.block_on(run(args))) {
            Ok(()) => {
                serde_json::from_str::<serde_json::Value>(&folder.text("out.json")).expect("JSON");
            }
            Err(CommandError::Input(line)) => assert_eq!(line.lines().count(), 1, "{line}"),
            Err(CommandError::Failure(why)) => panic!("refused as if it were not the input: {why}"),
            Err(CommandError::Unread) => panic!("nobody stopped reading"),
        }
    });
}

/// The query parameters of routes. A query that describes the view of a page must survive a round
/// trip.
fn query(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Ok(uri) = format!("/?{text}").parse() else { return };
    let _ = params::parse::<ExportParams>(&uri);
    let _ = params::parse::<PageParams>(&uri);
    let _ = params::parse::<people::ListParams>(&uri);
    let Ok(pairs) = params::parse::<Vec<(String, String)>>(&uri) else { return };
    let pairs = || pairs.iter().map(|(name, value)| (name.as_str(), value.as_str()));
    let _ = Source::of_query(pairs());
    let mut settings = PRESETS[0].settings(3);
    for (name, value) in pairs() {
        let _ = settings.set(name, value);
    }
    if let Ok(view) = trial_view::view::View::of_query(pairs()) {
        // A link contains only whole milliseconds, so the test compares links instead of views.
        let written = view.query();
        let again = trial_view::view::View::of_query(split(&written));
        assert_eq!(again.map(|again| again.query()), Ok(written));
    }
    let (view, _) = value_view::View::of_query(pairs());
    let again = view.query();
    assert_eq!(value_view::View::of_query(split(&again)), (view, None));
}

fn split(query: &str) -> impl Iterator<Item = (&str, &str)> {
    query.split('&').filter_map(|part| part.split_once('='))
}
