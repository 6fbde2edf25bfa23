//! Settings and calibrations as files: JSON whose first entry names the format and its version.

use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use sidestep::bounds::{ActionChoice, Rollout};
use sidestep::document::from_json;
use sidestep::invalid::Invalid;
use sidestep::predict::PredictorFile;
use sidestep::scene;

use crate::error::Error;
use crate::files::{read, write};

/// Arguments for the constructor when unpickling: the positional ones and the named ones.
pub(crate) type New<'py, T> = (T, Bound<'py, PyDict>);

/// File of prediction settings, in the format of the laboratory's explorer and of `sidestep shfrs
/// --settings`. The file contains settings for drawing polygons only if they differ from the defaults. Only
/// this package can read a file with these settings for drawing.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SettingsFile {
    format: SettingsFormat,
    steps: usize,
    pub(crate) epsilon: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    k: Option<Vec<usize>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    tau: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    q: Option<Vec<f64>>,
    #[serde(default = "base")]
    pub(crate) rollout: Rollout,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) accuracy_m: Option<f64>,
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub(crate) by_step: bool,
}

#[derive(Serialize, Deserialize)]
enum SettingsFormat {
    #[serde(rename = "sidestep-shfrs/1")]
    V1,
}

fn base() -> Rollout {
    Rollout::Base
}

impl SettingsFile {
    /// Creates the file for this choice of actions, with default settings for polygons.
    pub(crate) fn new(epsilon: Vec<f64>, choice: &ActionChoice, rollout: Rollout) -> Self {
        let (format, steps) = (SettingsFormat::V1, choice.steps());
        let (k, tau, q) = choice.in_file();
        Self { format, steps, epsilon, k, tau, q, rollout, accuracy_m: None, by_step: false }
    }

    /// The rule that selects actions.
    pub(crate) fn choice(&self) -> Result<ActionChoice, Invalid> {
        let Self { steps, k, tau, q, .. } = self;
        ActionChoice::of_file(*steps, k.as_deref(), *tau, q.as_deref())
    }
}

/// File of a calibration: the scores, and the settings and the model of the sets.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CalibrationFile {
    pub(crate) format: CalibrationFormat,
    /// The probability that a trajectory stays inside.
    pub(crate) p: f64,
    /// The probability that the calibration may fail. `null` if the guarantee holds on average.
    pub(crate) delta: Option<f64>,
    /// The calibrated ε (rad/s). It follows from the scores.
    pub(crate) epsilon: f64,
    /// The smallest ε of each window (rad/s), increasing.
    pub(crate) scores: Vec<f64>,
    pub(crate) settings: SettingsFile,
    pub(crate) parameters: scene::SceneParameters,
    pub(crate) predictor: PredictorFile,
}

#[derive(Serialize, Deserialize)]
pub(crate) enum CalibrationFormat {
    #[serde(rename = "sidestep-calibration/1")]
    V1,
}

/// Reads a file of the format `T`. Error messages call the file `name`.
pub(crate) fn loaded<T: DeserializeOwned>(name: &str, path: &Path) -> Result<T, Error> {
    let text = String::from_utf8(read(path)?);
    let text = text.map_err(|error| Invalid::new(name, "UTF-8", error))?;
    from_json(&text).map_err(|unread| Error::unread(name, unread))
}

/// Writes a file. Error messages call the file `name`.
pub(crate) fn saved(name: &str, path: &Path, file: &impl Serialize) -> Result<(), Error> {
    let text = serde_json::to_string(file);
    let text = text.map_err(|error| Invalid::new(name, "finite numbers, as in JSON", error))?;
    write(path, text.as_bytes())
}
