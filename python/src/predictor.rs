//! Trained models and their features.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use sidestep::document::from_json;
use sidestep::features::{FEATURES, FeatureSet};
use sidestep::invalid::Invalid;
use sidestep::predict::{self, PredictorFile};

use crate::arrays::{Array, joint_states, list, matrix, shaped};
use crate::error::Error;
use crate::files::{read, write};
use crate::function::{SafetyLevels, levels};
use crate::interrupt::each;
use crate::scalars::wholes;
use crate::vehicles::SceneParameters;

/// A trained model with its features. It predicts a probability for each class.
///
/// `Predictor.load` reads a predictor.json that `sidestep analyze` or `save` wrote. `sidestep.from_sklearn`
/// converts an estimator. `Predictor.constant` makes a predictor without features.
#[pyclass(frozen, eq, module = "sidestep")]
#[derive(PartialEq)]
pub(crate) struct Predictor {
    pub(crate) predictor: predict::Predictor,
    /// Number of the experiment, which determines the meaning of the classes, if the file states it.
    experiment: Option<u8>,
}

#[pymethods]
impl Predictor {
    /// Reads a predictor.json.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the file is malformed, has an unknown feature or kind, or has another format version.
    #[staticmethod]
    fn load(path: PathBuf) -> Result<Self, Error> {
        let text = String::from_utf8(read(&path)?);
        Self::from_json(&text.map_err(|error| Invalid::new("predictor", "UTF-8", error))?)
    }

    /// Parses the text of a predictor.json.
    #[staticmethod]
    fn from_json(text: &str) -> Result<Self, Error> {
        Self::of_file(from_json(text).map_err(|unread| Error::unread("predictor", unread))?)
    }

    /// A predictor with constant probabilities, which do not depend on the state.
    ///
    /// Parameters
    /// ----------
    /// classes : list of int
    ///     Increasing, −128 to 127: −1 right, 0 straight, 1 left. Other classes need `actions`.
    /// probabilities : array of float64, shape (classes,)
    ///     The probability of each class, 0 to 1. They must sum to 1.
    /// actions : array of float64, shape (classes,), optional
    ///     The turn rate of each class (rad/s, left positive), increasing. By default each class times the
    ///     human's turn rate.
    ///
    /// Returns
    /// -------
    /// Predictor
    #[staticmethod]
    #[pyo3(signature = (classes, probabilities, *, actions=None))]
    fn constant(
        #[pyo3(from_py_with = wholes)] classes: Vec<i64>,
        probabilities: &Bound<'_, PyAny>,
        actions: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let small = |(i, class): (usize, i64)| {
            let expected = "a whole number from -128 to 127";
            i8::try_from(class).map_err(|_| Invalid::new(format!("classes[{i}]"), expected, class))
        };
        let classes = classes.into_iter().enumerate().map(small).collect::<Result<_, _>>()?;
        let probabilities = list("probabilities", probabilities)?;
        let mut predictor =
            predict::Predictor::constant(FeatureSet::none(), classes, probabilities)?;
        if let Some(actions) = actions {
            predictor = predictor.with_actions(list("actions", actions)?)?;
        }
        // Reject a predictor that a file could not contain.
        let predictor = PredictorFile::from(&predictor).try_into()?;
        Ok(Self { predictor, experiment: None })
    }

    /// Writes a predictor.json.
    fn save(&self, path: PathBuf) -> Result<(), Error> {
        write(&path, self.to_json()?.as_bytes())
    }

    /// The text of a predictor.json.
    fn to_json(&self) -> Result<String, Error> {
        serde_json::to_string(&self.file())
            .map_err(|error| Invalid::new("predictor", "finite numbers, as in JSON", error).into())
    }

    /// The names of the features, in the order of the columns.
    #[getter]
    fn features(&self) -> Vec<String> {
        self.predictor.features().clone().into()
    }

    /// The classes, increasing: −1 right, 0 straight, 1 left.
    #[getter]
    fn classes(&self) -> Vec<i64> {
        self.predictor.classes().iter().copied().map(i64::from).collect()
    }

    /// The turn rate of each class (rad/s, left positive), if given. Otherwise the turn rate is the class
    /// (−1, 0 or 1) times the turn rate of the human of the parameters.
    #[getter]
    fn actions(&self) -> Option<Vec<f64>> {
        self.predictor.actions().map(<[f64]>::to_vec)
    }

    /// The experiment, which determines the meaning of the classes, if the file states it. 1: the direction
    /// of a turn. 2: whether the human avoids.
    #[getter]
    fn experiment(&self) -> Option<u8> {
        self.experiment
    }

    /// The probability of each class.
    ///
    /// Parameters
    /// ----------
    /// rows : array of float64, shape (n, features)
    ///     Raw features, not standardised, in the order of `features`.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (n, classes)
    fn proba<'py>(&self, rows: &Bound<'py, PyAny>) -> Result<Array<'py>, Error> {
        let py = rows.py();
        let (width, classes) = (self.predictor.features().len(), self.predictor.classes().len());
        let (n, rows) = feature_rows(width, rows)?;
        let mut found = vec![0.0; n * classes];
        let mut out = found.chunks_exact_mut(classes);
        each(py, n, |i| {
            if let Some(out) = out.next() {
                self.predictor.probabilities_into(&rows[i * width..(i + 1) * width], out);
            }
        })?;
        Ok(shaped(py, found, &[n, classes])?)
    }

    /// The predicted class of each row: the most probable class, or the lowest of them if several tie. For
    /// support vector machines, it is the class with the most votes.
    ///
    /// Parameters
    /// ----------
    /// rows : array of float64, shape (n, features)
    ///     As for `proba`.
    ///
    /// Returns
    /// -------
    /// array of int64, shape (n,)
    fn predict<'py>(&self, rows: &Bound<'py, PyAny>) -> Result<Bound<'py, PyArray1<i64>>, Error> {
        let py = rows.py();
        let width = self.predictor.features().len();
        let (n, rows) = feature_rows(width, rows)?;
        let class = |i: usize| i64::from(self.predictor.class(&rows[i * width..(i + 1) * width]));
        Ok(each(py, n, class)?.into_pyarray(py))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<(Bound<'py, PyAny>, (String,)), Error> {
        Ok((slf.get_type().getattr("from_json")?, (slf.get().to_json()?,)))
    }

    fn __repr__(&self) -> String {
        format!("Predictor(features={:?}, classes={:?})", self.features(), self.classes())
    }
}

impl Predictor {
    /// Creates the predictor of a file.
    pub(crate) fn of_file(file: PredictorFile) -> Result<Self, Error> {
        let experiment = file.experiment;
        if let Some(other) = experiment.filter(|number| !(1..=2).contains(number)) {
            let expected = "1, the direction of a turn, 2, whether the human avoids, or none";
            return Err(Invalid::new("predictor.experiment", expected, other).into());
        }
        let predictor = file.try_into().map_err(|invalid: Invalid| invalid.within("predictor"))?;
        Ok(Self { predictor, experiment })
    }

    /// The content of the predictor's file.
    pub(crate) fn file(&self) -> PredictorFile {
        PredictorFile { experiment: self.experiment, ..PredictorFile::from(&self.predictor) }
    }

    /// Returns the predictor, or an error if its classes are not turn directions.
    pub(crate) fn of_turns(&self) -> Result<&predict::Predictor, Error> {
        if self.experiment == Some(2) {
            let found = "experiment 2, a model of avoidance";
            return Err(Invalid::new("model", "a model of the turn direction", found).into());
        }
        Ok(&self.predictor)
    }
}

/// Features of the joint states of a trial, one row for each state.
///
/// Parameters
/// ----------
/// history : array of float64, shape (n, 2, 3), n ≥ 1
///     Joint states from the start of the trial, one per step: the poses (x, y, ψ) of the human and of the
///     robot in the world frame (m, m, rad).
/// names : list of str
///     Names of features, from `FEATURES`.
/// parameters : SceneParameters, optional
///     By default the paper's.
/// safety : SafetyLevels, optional
///     Required if the vehicles differ and a feature is a safety level.
///
/// Returns
/// -------
/// array of float64, shape (n, names)
///     Row i depends only on the states up to i. `FEATURES` has the units and meanings.
#[pyfunction]
#[pyo3(signature = (history, names, *, parameters=None, safety=None))]
pub(crate) fn features<'py>(
    history: &Bound<'py, PyAny>,
    names: Vec<String>,
    parameters: Option<SceneParameters>,
    safety: Option<SafetyLevels>,
) -> Result<Array<'py>, Error> {
    let py = history.py();
    let history = joint_states("history", 1, history)?;
    let set = FeatureSet::of(&names).map_err(|mut invalid| {
        invalid.field = invalid.field.replacen("features", "names", 1);
        invalid
    })?;
    let safety = levels(&set, &parameters.unwrap_or_default().0, safety)?;
    let width = set.len();
    let mut rows = vec![0.0; history.len() * width];
    let (mut left, mut before) = (rows.chunks_exact_mut(width), None::<&mut [f64]>);
    each(py, history.len(), |i| {
        if let Some(row) = left.next() {
            set.compute_after(before.as_deref(), &history[..=i], &safety, row);
            before = Some(row);
        }
    })?;
    Ok(shaped(py, rows, &[history.len(), width])?)
}

/// The name, unit and meaning of every feature.
pub(crate) fn feature_table() -> Vec<(&'static str, &'static str, &'static str)> {
    FEATURES.iter().map(|feature| (feature.name, feature.unit, feature.meaning)).collect()
}

/// Reads rows of features, and checks that they are small enough for finite scores.
fn feature_rows(width: usize, rows: &Bound<'_, PyAny>) -> Result<(usize, Vec<f64>), Error> {
    let (n, rows) = matrix("rows", width, rows)?;
    if let Some(place) = rows.iter().position(|value| value.abs() > MOST_FEATURE) {
        let expected = format!("a number from -{MOST_FEATURE:e} to {MOST_FEATURE:e}");
        let field = format!("rows[{}, {}]", place / width, place % width);
        return Err(Invalid::new(field, expected, format!("{:e}", rows[place])).into());
    }
    Ok((n, rows))
}

/// Maximum magnitude of a feature. The scores of larger features could overflow.
const MOST_FEATURE: f64 = 1e100;
