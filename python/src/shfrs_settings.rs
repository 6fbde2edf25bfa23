//! Settings for predicted sets.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sidestep::bounds::{ActionChoice, BoundsSettings, Rollout, in_proportion};
use sidestep::invalid::{Invalid, positive};
use sidestep::reach::PolygonSettings;
use sidestep::scene;
use sidestep::shfrs;
use sidestep::shfrs::file::{MOST_STEPS, PRESETS};

use crate::arrays::list;
use crate::bounds::{choice, rolled_out};
use crate::error::Error;
use crate::kept::{self, New, SettingsFile};
use crate::reach::drawn;
use crate::scalars::{real, some_real, some_whole, some_wholes};

/// Settings for predicting and drawing sets.
///
/// `calibrate` finds ε for a given choice of actions. The command `sidestep shfrs` and Rust's `tune` tune the
/// choice itself, `k` or `tau`.
///
/// Parameters
/// ----------
/// epsilon : array of float64, shape (m,)
///     By how much each set widens the bounds (rad/s); ≥ 0 and ascending. A last value of twice the human's
///     turn rate admits every turn rate.
/// k : list of int, optional
///     How many of the most probable actions count at each future step. Actions that tie with the last of
///     these also count.
/// tau, steps : float and int, optional
///     Instead of `k`: a probability threshold in (0, 1], and the number of future steps. An action counts if
///     its probability is at least min(tau, the largest probability).
/// q : array of float64, shape (T,), optional
///     Instead of `k`: at each future step, the turn rates in the shortest interval with at least this
///     probability count, in (0, 1]. Of several equally short intervals, the most probable one counts, or all
///     that are equally probable. Only `q` is possible for an `ActionModel` with `bins`.
/// rollout : {"base", "paper"}
///     Which bounds the simulations within Algorithm 1 follow: the bounds before widening by ε ("base"), or
///     the bounds of F_1 ("paper").
/// accuracy_m : float
///     Accuracy of the polygons (m); 10⁻⁶ to 1.
/// by_step : bool
///     Whether to also draw the positions after each step, in addition to the tube.
#[pyclass(frozen, eq, from_py_object, module = "sidestep")]
#[derive(Clone, PartialEq)]
pub(crate) struct ShfrsSettings {
    epsilon: Vec<f64>,
    choice: ActionChoice,
    rollout: Rollout,
    accuracy_m: f64,
    by_step: bool,
}

#[pymethods]
impl ShfrsSettings {
    #[new]
    #[pyo3(signature = (epsilon, k=None, *, tau=None, steps=None, q=None, rollout="base", accuracy_m=1e-3, by_step=false))]
    #[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
    fn new(
        epsilon: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = some_wholes)] k: Option<Vec<i64>>,
        #[pyo3(from_py_with = some_real)] tau: Option<f64>,
        #[pyo3(from_py_with = some_whole)] steps: Option<i64>,
        q: Option<&Bound<'_, PyAny>>,
        rollout: &str,
        #[pyo3(from_py_with = real)] accuracy_m: f64,
        by_step: bool,
    ) -> Result<Self, Error> {
        let (epsilon, choice) = (list("epsilon", epsilon)?, choice(k, tau, q, steps)?);
        drawn(accuracy_m, false)?;
        let settings = Self { epsilon, choice, rollout: rolled_out(rollout)?, accuracy_m, by_step };
        // The number of actions is unknown here and does not limit k.
        settings.bounds(usize::MAX)?;
        Ok(settings)
    }

    /// The paper's settings of Figure 3, for three actions and ten steps. In the left part, two actions count
    /// in the first two steps and one action in the later steps, with ε = 0, 0.15, 0.25, 0.4 and 1 rad/s.
    ///
    /// Parameters
    /// ----------
    /// figure : {"left", "middle", "right"}
    ///     Part of the figure.
    /// turn_rate_radps : float
    ///     The human's turn rate (rad/s), > 0; by default the paper's. ε is proportional to it, so that the
    ///     last ε is twice the turn rate and admits every turn rate.
    /// by_step : bool
    ///     Whether to also draw the positions after each step.
    ///
    /// Returns
    /// -------
    /// ShfrsSettings
    #[staticmethod]
    #[pyo3(signature = (figure="left", *, turn_rate_radps=0.5, by_step=false))]
    fn paper(
        figure: &str,
        #[pyo3(from_py_with = real)] turn_rate_radps: f64,
        by_step: bool,
    ) -> Result<Self, Error> {
        let turn_rate_radps = positive("turn_rate_radps", turn_rate_radps)?;
        if turn_rate_radps > 1e300 {
            let expected = "at most 1e300 rad/s";
            return Err(Invalid::new("turn_rate_radps", expected, turn_rate_radps).into());
        }
        let preset =
            PRESETS.iter().find(|preset| preset.name.ends_with(figure) && !figure.is_empty());
        let preset =
            preset.ok_or_else(|| Invalid::new("figure", "left, middle or right", figure))?;
        let bounds = preset.settings(3).settings(3)?;
        Ok(Self {
            epsilon: in_proportion(bounds.epsilon(), turn_rate_radps),
            choice: bounds.choice().clone(),
            rollout: bounds.rollout(),
            accuracy_m: USUAL_ACCURACY_M,
            by_step,
        })
    }

    /// By how much each set widens the bounds (rad/s).
    #[getter]
    fn epsilon<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.epsilon.clone().into_pyarray(py)
    }

    /// How many of the most probable actions count at each future step. `None` with `tau` or `q`.
    #[getter]
    fn k(&self) -> Option<Vec<usize>> {
        self.choice.in_file().0
    }

    /// The probability threshold for actions, as in the parameter `tau`. `None` with `k` or `q`.
    #[getter]
    fn tau(&self) -> Option<f64> {
        self.choice.in_file().1
    }

    /// The probability of the shortest interval of turn rates at each future step. `None` with `k` or `tau`.
    #[getter]
    fn q(&self) -> Option<Vec<f64>> {
        self.choice.in_file().2
    }

    /// Number of future steps, T.
    #[getter]
    pub(crate) fn steps(&self) -> usize {
        self.choice.steps()
    }

    /// Which bounds the roll-outs follow, `base` or `paper`.
    #[getter]
    fn rollout(&self) -> &'static str {
        self.rollout.word()
    }

    /// Writes the settings as JSON. The laboratory's explorer and `sidestep shfrs --settings` can read the
    /// file, unless `accuracy_m` or `by_step` differs from its default, or there are more than ten sets.
    fn save(&self, path: PathBuf) -> Result<(), Error> {
        kept::saved("settings", &path, &self.file())
    }

    /// Reads settings that `save` or the laboratory's explorer wrote.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the file is malformed, has invalid values, or has another format version.
    #[staticmethod]
    fn load(path: PathBuf) -> Result<Self, Error> {
        let file: SettingsFile = kept::loaded("settings", &path)?;
        Ok(Self::of_file(&file).map_err(|invalid| invalid.within("settings"))?)
    }

    fn __hash__(&self) -> usize {
        self.steps()
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<New<'py, (Bound<'py, PyArray1<f64>>,)>> {
        let named = PyDict::new(py);
        named.set_item("k", self.k())?;
        named.set_item("tau", self.tau())?;
        named.set_item("q", self.q())?;
        named.set_item("steps", self.steps())?;
        named.set_item("rollout", self.rollout())?;
        named.set_item("accuracy_m", self.accuracy_m)?;
        named.set_item("by_step", self.by_step)?;
        Ok(((self.epsilon(py),), named))
    }

    fn __repr__(&self) -> String {
        format!(
            "ShfrsSettings(epsilon={:?}, {}, steps={})",
            self.epsilon,
            self.choice,
            self.steps()
        )
    }
}

impl ShfrsSettings {
    pub(crate) fn bounds(&self, actions: usize) -> Result<BoundsSettings, Invalid> {
        BoundsSettings::new(self.epsilon.clone(), self.choice.clone(), self.rollout, actions)
    }

    /// The library's settings for a model with this number of actions.
    pub(crate) fn of_prediction(&self, actions: usize) -> Result<shfrs::ShfrsSettings, Error> {
        Ok(shfrs::ShfrsSettings::new(self.bounds(actions)?)
            .with_polygon(drawn(self.accuracy_m, false)?)
            .with_by_step(self.by_step))
    }

    /// Creates settings from the library's settings of a prediction.
    pub(crate) fn of(settings: &shfrs::ShfrsSettings) -> Self {
        let bounds = &settings.bounds;
        Self {
            epsilon: bounds.epsilon().to_vec(),
            choice: bounds.choice().clone(),
            rollout: bounds.rollout(),
            accuracy_m: settings.polygon.accuracy_m(),
            by_step: settings.by_step,
        }
    }

    /// The content of the settings' file.
    pub(crate) fn file(&self) -> SettingsFile {
        let mut file = SettingsFile::new(self.epsilon.clone(), &self.choice, self.rollout);
        file.accuracy_m = (self.accuracy_m != USUAL_ACCURACY_M).then_some(self.accuracy_m);
        file.by_step = self.by_step;
        file
    }

    /// Creates settings from the content of a file.
    pub(crate) fn of_file(file: &SettingsFile) -> Result<Self, Invalid> {
        let choice = file.choice()?;
        if choice.steps() > MOST_STEPS {
            let expected = format!("at most {MOST_STEPS} steps");
            return Err(Invalid::new("steps", expected, choice.steps()));
        }
        let accuracy_m = file.accuracy_m.unwrap_or(USUAL_ACCURACY_M);
        PolygonSettings::new(accuracy_m, 8)?;
        let (rollout, by_step) = (file.rollout, file.by_step);
        let settings = Self { epsilon: file.epsilon.clone(), choice, rollout, accuracy_m, by_step };
        settings.bounds(usize::MAX)?;
        Ok(settings)
    }

    pub(crate) fn choice(&self) -> &ActionChoice {
        &self.choice
    }

    /// The same settings, but with these ε and with `base` roll-outs.
    pub(crate) fn with(&self, epsilon: Vec<f64>) -> Self {
        Self { epsilon, rollout: Rollout::Base, ..self.clone() }
    }
}

/// Default accuracy of polygons (m).
const USUAL_ACCURACY_M: f64 = 1e-3;

/// The paper's settings, for a model with this number of actions and for the human of these parameters.
pub(crate) fn usual(
    actions: usize,
    parameters: &scene::SceneParameters,
) -> Result<shfrs::ShfrsSettings, Invalid> {
    let paper = shfrs::ShfrsSettings::paper(actions)?;
    let bounds = &paper.bounds;
    let epsilon = in_proportion(bounds.epsilon(), parameters.human.turn_rate_radps);
    let bounds = BoundsSettings::new(epsilon, bounds.choice().clone(), bounds.rollout(), actions)?;
    Ok(paper.with_bounds(bounds))
}
