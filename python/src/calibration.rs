//! The level ε at which sets hold what people do, from recorded trajectories.

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use sidestep::invalid::Invalid;
use sidestep::shfrs::family::Family;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::prediction::Prediction;
use sidestep::shfrs::scores::{Scores, ShfrsFamily};
use sidestep::shfrs::window::WindowChoice;

use crate::error::Error;
use crate::function::SafetyLevels;
use crate::human::{Human, Model};
use crate::shfrs::ShfrsSettings;
use crate::trajectory::Trajectory;
use crate::vehicles::SceneParameters;

/// The level ε at which sets hold what people do, and what is guaranteed of it.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct Calibration {
    /// By how much F_1 widens the bounds, rad/s.
    #[pyo3(get)]
    epsilon: f64,
    /// The probability p that a trajectory stays inside F_1.
    #[pyo3(get)]
    p: f64,
    /// How often the calibration may fail, δ; `None` for a guarantee on average.
    #[pyo3(get)]
    delta: Option<f64>,
    /// The guarantee in words, with its scope and the number of trajectories.
    #[pyo3(get)]
    statement: String,
    /// Settings with two sets: F_1, and one that admits everything.
    #[pyo3(get)]
    settings: ShfrsSettings,
    scores: Scores,
}

#[pymethods]
impl Calibration {
    /// The score of each window, rising, rad/s: the least ε whose set contains it. Shape (n,).
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.scores.sorted().to_vec().into_pyarray(py)
    }

    fn __repr__(&self) -> String {
        format!("Calibration(epsilon={}, p={}): {}", self.epsilon, self.p, self.statement)
    }
}

/// The least ε whose sets hold a share p of trajectories, with a guarantee.
///
/// The model must not have been trained on these trajectories; otherwise there is no guarantee.
///
/// Parameters
/// ----------
/// trajectories : list of Trajectory
///     Independent ones: what exchangeable people did in exchangeable scenes.
/// model : Predictor or ActionModel
///     How likely each action of the human is.
/// settings : ShfrsSettings
///     Which actions count, over how many steps. Its ε do not matter, and roll-outs are `base`.
/// p : float
///     Probability in (0, 1) that a trajectory stays inside.
/// delta : float or None
///     How often the calibration may fail, in (0, 1); `None` guarantees p on average over calibrations.
/// windows : {"random_one", "avoidance_onset"}
///     Which part of each trajectory counts: T steps from a random step, or from the first turn.
/// seed : int
///     Of the random steps, ≥ 0.
/// parameters : SceneParameters, optional
///     The paper's by default.
/// safety : SafetyLevels, optional
///     Needed if the vehicles differ and a feature of the model is a safety level.
///
/// Returns
/// -------
/// Calibration
///
/// Raises
/// ------
/// ValueError
///     If there are too few trajectories for the guarantee; it says how many are needed.
#[pyfunction]
#[pyo3(signature = (trajectories, model, settings, *, p=0.9, delta=Some(0.05), windows="random_one", seed=0, parameters=None, safety=None))]
#[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
pub(crate) fn calibrate(
    py: Python<'_>,
    trajectories: Vec<Trajectory>,
    model: Model<'_>,
    settings: &ShfrsSettings,
    p: f64,
    delta: Option<f64>,
    windows: &str,
    seed: u64,
    parameters: Option<SceneParameters>,
    safety: Option<SafetyLevels>,
) -> Result<Calibration, Error> {
    let chosen = [WindowChoice::RandomOne { seed }, WindowChoice::AvoidanceOnset];
    let chosen = chosen.into_iter().find(|chosen| chosen.word() == windows);
    let chosen =
        chosen.ok_or_else(|| Invalid::new("windows", "random_one or avoidance_onset", windows))?;
    let guarantee = delta.map_or(Guarantee::Conformal, |delta| Guarantee::Pac { delta });
    let human = Human::new(model, &parameters.unwrap_or_default().0, safety)?;

    let trajectories: Vec<_> = trajectories.into_iter().map(|of| of.0).collect();
    let steps = settings.steps();
    let windows = chosen.windows(&trajectories, steps).concat();
    guarantee.enough(windows.len(), p)?;
    let mut scores = Vec::with_capacity(windows.len());
    for window in &windows {
        py.check_signals()?;
        scores.push(human.work(py, |learned| {
            let prediction = Prediction::new(&human.parameters, learned);
            ShfrsFamily::new(prediction, settings.choice())?.score(window)
        })?);
    }
    let scores = Scores::new(scores)?;
    let epsilon = guarantee.level(&scores, p)?;
    let everything = 2.0 * human.parameters.human.turn_rate_radps;
    Ok(Calibration {
        epsilon,
        p,
        delta,
        statement: guarantee.statement(p, scores.len()),
        settings: settings.with(vec![epsilon, everything.max(epsilon)]),
        scores,
    })
}
