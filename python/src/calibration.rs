//! Calibration of ε on recorded trajectories, so that predicted sets contain what people do.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use sidestep::bounds::{BoundsSettings, Rollout};
use sidestep::clearance::{ClearanceSettings, Clearances, CoverageBounds};
use sidestep::invalid::Invalid;
use sidestep::reach::Tolerance;
use sidestep::shfrs::family::Family;
use sidestep::shfrs::guarantee::{Guarantee, Unit};
use sidestep::shfrs::scores::{Scores, ShfrsFamily};
use sidestep::shfrs::window::{Window, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;

use crate::error::Error;
use crate::function::SafetyLevels;
use crate::human::{Arguments, Human, Model};
use crate::kept::{self, CalibrationFile, CalibrationFormat};
use crate::online::OnlinePredictor;
use crate::plan::Asked;
use crate::predictor::Predictor;
use crate::scalars::{real, seed, some_real};
use crate::shfrs::Shfrs;
use crate::shfrs_settings::ShfrsSettings;
use crate::trajectory::Trajectory;
use crate::vehicles::SceneParameters;

/// The calibrated ε and its guarantee.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct Calibration {
    /// By how much F_1 widens the bounds (rad/s).
    #[pyo3(get)]
    epsilon: f64,
    /// The probability p that a trajectory stays inside F_1.
    #[pyo3(get)]
    p: f64,
    /// The probability δ that the calibration may fail. `None` if the guarantee holds on average.
    #[pyo3(get)]
    delta: Option<f64>,
    /// The guarantee in words, with its scope and the number of trajectories.
    #[pyo3(get)]
    statement: String,
    /// Settings with two sets: F_1, and a set that admits every turn rate.
    #[pyo3(get)]
    settings: ShfrsSettings,
    scores: Scores,
    human: Human,
}

/// An upper bound on the probability that the human touches a robot that follows a plan.
#[pyclass(frozen, eq, module = "sidestep")]
#[derive(PartialEq)]
pub(crate) struct CollisionBound {
    /// Upper bound on the probability that the human comes within the footprint at some instant of the plan.
    #[pyo3(get)]
    at_most: f64,
    /// Index, from 0, of the largest set that the plan is clear of. `None` if the plan is clear of no set.
    #[pyo3(get)]
    set: Option<usize>,
    /// A plan is clear of a set if its clearance exceeds this margin (m).
    #[pyo3(get)]
    margin_m: f64,
    /// The meaning and assumptions of the bound, to print beside it.
    #[pyo3(get)]
    statement: String,
}

#[pymethods]
impl CollisionBound {
    /// Creates a bound from its parts.
    #[staticmethod]
    #[pyo3(name = "_of")]
    fn of(at_most: f64, set: Option<usize>, margin_m: f64, statement: String) -> Self {
        Self { at_most, set, margin_m, statement }
    }

    #[allow(clippy::type_complexity, reason = "the parts")]
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (f64, Option<usize>, f64, String))> {
        let Self { at_most, set, margin_m, statement } = slf.get();
        Ok((slf.get_type().getattr("_of")?, (*at_most, *set, *margin_m, statement.clone())))
    }

    fn __hash__(&self) -> usize {
        self.set.map_or(0, |set| set + 1)
    }

    fn __repr__(&self) -> String {
        let set = self.set.map_or("None".to_owned(), |set| set.to_string());
        format!("CollisionBound(at_most={}, set={set}): {}", self.at_most, self.statement)
    }
}

#[pymethods]
impl Calibration {
    /// The score of each window (rad/s), in increasing order. The score is the smallest ε whose set contains
    /// the window. Shape (n,).
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.scores.sorted().to_vec().into_pyarray(py)
    }

    /// Writes the calibration to a JSON file: the scores, the settings, the parameters and the model.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the model is an `ActionModel`, because a file cannot contain a Python function. Use `pickle`
    ///     for such a calibration, if it can pickle the function.
    fn save(&self, path: PathBuf) -> Result<(), Error> {
        let Some(predictor) = self.human.predictor() else {
            let expected =
                "a Predictor, which a file can hold (pickle a calibration of a function)";
            return Err(Invalid::new("model", expected, "an ActionModel").into());
        };
        let file = CalibrationFile {
            format: CalibrationFormat::V1,
            p: self.p,
            delta: self.delta,
            epsilon: self.epsilon,
            scores: self.scores.sorted().to_vec(),
            settings: self.settings.file(),
            parameters: self.human.parameters,
            predictor: predictor.file(),
        };
        kept::saved("calibration", &path, &file)
    }

    /// Reads a calibration that `save` wrote.
    ///
    /// Parameters
    /// ----------
    /// path : path
    /// safety : SafetyLevels, optional
    ///     Required if the vehicles differ and a feature of the model is a safety level, because the file
    ///     does not contain the safety levels.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the file is malformed or has another format version, or if its ε does not match its scores.
    #[staticmethod]
    #[pyo3(signature = (path, *, safety=None))]
    fn load(py: Python<'_>, path: PathBuf, safety: Option<SafetyLevels>) -> Result<Self, Error> {
        let file: CalibrationFile = kept::loaded("calibration", &path)?;
        let within = |invalid: Invalid| invalid.within("calibration");
        file.parameters.check().map_err(|invalid| within(invalid.within("parameters")))?;
        let settings = ShfrsSettings::of_file(&file.settings);
        let settings = settings.map_err(|invalid| within(invalid.within("settings")))?;
        let predictor = Predictor::of_file(file.predictor).map_err(|error| match error {
            Error::Invalid(invalid) => within(invalid).into(),
            raised => raised,
        })?;
        let model = Model::Trained(Bound::new(py, predictor)?);
        let human = Human::new(model, &file.parameters, safety)?;
        let found = Self::new(human, &settings, file.scores, file.p, file.delta).map_err(within)?;
        if found.epsilon != file.epsilon || found.settings != settings {
            let expected = format!("{}, the ε of the scores, for F_1", found.epsilon);
            return Err(within(Invalid::new("epsilon", expected, file.epsilon)).into());
        }
        Ok(found)
    }

    /// Creates a calibration from these scores.
    #[staticmethod]
    #[pyo3(name = "_of")]
    fn of(
        scores: Vec<f64>,
        p: f64,
        delta: Option<f64>,
        settings: &ShfrsSettings,
        human: (Model<'_>, SceneParameters, Option<SafetyLevels>),
    ) -> Result<Self, Error> {
        let (model, parameters, safety) = human;
        let human = Human::new(model, &parameters.0, safety)?;
        Ok(Self::new(human, settings, scores, p, delta)?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Parts<'py>)> {
        let it = slf.get();
        let scores = it.scores.sorted().to_vec();
        let human = it.human.arguments(slf.py());
        let parts = (scores, it.p, it.delta, it.settings.clone(), human);
        Ok((slf.get_type().getattr("_of")?, parts))
    }

    /// Whether both have the same scores, guarantee, settings, model and parameters.
    fn __eq__(&self, other: &Self) -> bool {
        (self.p, self.delta, &self.scores) == (other.p, other.delta, &other.scores)
            && self.settings == other.settings
            && self.human.same(&other.human)
    }

    fn __hash__(&self) -> usize {
        self.scores.len()
    }

    /// An upper bound on the probability that the human touches the robot during a plan.
    ///
    /// Parameters
    /// ----------
    /// prediction : Shfrs or OnlinePredictor
    ///     A current prediction with the calibration's model, parameters and choice of actions, and with
    ///     `base` roll-outs.
    /// plan, radius_m, corners, most_speed_mps, most_turn_rate_radps
    ///     As for `Shfrs.clear`.
    /// accuracy_m : float, optional
    ///     As for `Shfrs.clear`, by default 0.02. Not allowed with an `OnlinePredictor`, which has its own.
    /// delta : float, optional
    ///     Probability, in (0, 1), that any of the bounds of the sets fails. By default the `delta` of the
    ///     calibration.
    ///
    /// Returns
    /// -------
    /// CollisionBound
    ///     Based on the largest set that the plan is clear of by `margin_m`: at most this share of people
    ///     leave that set. The bound is 1 if the plan is clear of no set. All sets that do not admit every
    ///     turn rate share `delta`, so the bound for F_1 can exceed 1 − p.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the sets were predicted with other settings, or if there is no `delta`. If the human's vehicle
    ///     cannot have driven the human's last step, to a millimetre and a milliradian (for example if the
    ///     human stands still), because the calibration had no such trajectory; `assume_vehicle` does not
    ///     change this. Also as for `Shfrs.clear`.
    #[pyo3(signature = (prediction, plan, radius_m, *, delta=None, corners=None, most_speed_mps=None, most_turn_rate_radps=None, accuracy_m=None))]
    #[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
    fn collision<'py>(
        &self,
        prediction: Predicted<'py>,
        plan: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = real)] radius_m: f64,
        #[pyo3(from_py_with = some_real)] delta: Option<f64>,
        corners: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = some_real)] most_speed_mps: Option<f64>,
        #[pyo3(from_py_with = some_real)] most_turn_rate_radps: Option<f64>,
        #[pyo3(from_py_with = some_real)] accuracy_m: Option<f64>,
    ) -> Result<CollisionBound, Error> {
        let predicted = prediction.settings();
        let (choice, own) = (predicted.choice(), self.settings.choice());
        for (same, what, found) in [
            (
                prediction.predicts(&self.human),
                "model and parameters".to_owned(),
                "others".to_owned(),
            ),
            (
                choice == own,
                format!("actions ({own}; see Calibration.settings)"),
                choice.to_string(),
            ),
            (
                predicted.rollout() == Rollout::Base,
                "roll-outs, base".to_owned(),
                "others".to_owned(),
            ),
        ] {
            if !same {
                let expected = format!("sets predicted with the calibration's {what}");
                return Err(Invalid::new("prediction", expected, found).into());
            }
        }
        prediction.check_human(plan.py())?;
        let expected = "a number in (0, 1), since the calibration has none";
        let delta = delta.or(self.delta);
        let delta = delta.ok_or_else(|| Invalid::new("delta", expected, "None"))?;
        let parameters = &self.human.parameters;
        let (steps, tolerance) = (self.settings.steps(), Tolerance::default());
        let bounds = CoverageBounds::of_scores(
            &self.scores,
            predicted.epsilon(),
            delta,
            parameters,
            tolerance,
            steps,
        )?;
        let asked = Asked { plan, radius_m, corners, most_speed_mps, most_turn_rate_radps };
        let found = bounds.collision(&prediction.clearances(plan.py(), &asked, accuracy_m)?)?;
        Ok(CollisionBound {
            at_most: found.at_most,
            set: found.set,
            margin_m: bounds.margin_m(),
            statement: bounds.statement().to_owned(),
        })
    }

    fn __repr__(&self) -> String {
        format!("Calibration(epsilon={}, p={}): {}", self.epsilon, self.p, self.statement)
    }
}

/// Scores, p, δ, the settings, and the arguments of the human model.
type Parts<'py> = (Vec<f64>, f64, Option<f64>, ShfrsSettings, Arguments<'py>);

impl Calibration {
    /// Computes ε and its guarantee from these scores.
    fn new(
        human: Human,
        settings: &ShfrsSettings,
        scores: Vec<f64>,
        p: f64,
        delta: Option<f64>,
    ) -> Result<Self, Invalid> {
        let guarantee = delta.map_or(Guarantee::Conformal, |delta| Guarantee::Pac { delta });
        let scores = Scores::new(scores)?;
        let epsilon = guarantee.level(&scores, p)?;
        let everything = 2.0 * human.parameters.human.turn_rate_radps;
        let settings = settings.with(vec![epsilon, everything.max(epsilon)]);
        let statement = guarantee.statement(p, scores.len(), Unit::Trajectories);
        Ok(Self { epsilon, p, delta, statement, settings, scores, human })
    }
}

/// The prediction that a plan is compared with.
#[derive(FromPyObject)]
pub(crate) enum Predicted<'py> {
    /// Sets that were predicted once.
    Sets(Bound<'py, Shfrs>),
    /// A predictor that runs in a loop.
    Online(Bound<'py, OnlinePredictor>),
}

impl Predicted<'_> {
    fn settings(&self) -> &BoundsSettings {
        match self {
            Self::Sets(sets) => &sets.get().source.settings.bounds,
            Self::Online(online) => &online.get().settings,
        }
    }

    fn predicts(&self, human: &Human) -> bool {
        match self {
            Self::Sets(sets) => sets.get().source.human.same(human),
            Self::Online(online) => online.get().predicts(human),
        }
    }

    /// Checks that the human's vehicle can have driven the last step.
    fn check_human(&self, py: Python<'_>) -> Result<(), Invalid> {
        match self {
            Self::Sets(sets) => sets.get().check_human(),
            Self::Online(online) => online.get().check_human(py),
        }
    }

    fn clearances(
        &self,
        py: Python<'_>,
        asked: &Asked<'_, '_>,
        accuracy_m: Option<f64>,
    ) -> Result<Clearances, Error> {
        match (self, accuracy_m) {
            (Self::Sets(sets), accuracy_m) => {
                let settings = ClearanceSettings::new(accuracy_m.unwrap_or(0.02))?;
                sets.get().clearances(py, asked, settings)
            }
            (Self::Online(online), None) => online.get().clearances(py, asked),
            (Self::Online(_), Some(accuracy_m)) => {
                let expected = "None, as the OnlinePredictor has its own";
                Err(Invalid::new("accuracy_m", expected, accuracy_m).into())
            }
        }
    }
}

/// Rejects fewer windows than the guarantee needs. The error gives the reason `lack` for the missing windows.
fn enough(
    windows: &[Window<'_>],
    trajectories: usize,
    guarantee: Guarantee,
    p: f64,
    lack: &str,
) -> Result<(), Invalid> {
    let (needed, found) = (guarantee.needed(p)?, windows.len());
    if found >= needed {
        return Ok(());
    }
    let with = match guarantee {
        Guarantee::Pac { delta } => format!("delta = {delta}"),
        _ => "no delta".to_owned(),
    };
    let expected = format!("at least {needed} for p = {p} and {with}");
    let without = trajectories - found;
    let why =
        if without == 0 { String::new() } else { format!(": {without} of {trajectories} {lack}") };
    Err(Invalid::new("trajectories", expected, format!("{found}{why}")))
}

/// Calibrates the smallest ε whose sets contain a share p of trajectories, with a guarantee.
///
/// The choice of actions is not calibrated; the command `sidestep shfrs` and Rust's `tune` choose `k` or
/// `tau`. The model must not have been trained on these trajectories; otherwise there is no guarantee.
///
/// Parameters
/// ----------
/// trajectories : list of Trajectory
///     A flat list of independent trajectories. Their people and scenes must be like those to be predicted.
///     In every step the human must move as the human's vehicle of `parameters` can, and turn at the given
///     turn rate, to a millimetre and a milliradian. Tracks of pedestrians do not, and are rejected.
/// model : Predictor or ActionModel
///     Model of the probabilities of the human's actions.
/// settings : ShfrsSettings
///     Choice of actions and number of steps. ε and the kind of roll-outs are ignored; roll-outs are `base`.
/// p : float
///     The required probability, in (0, 1), that a trajectory stays inside.
/// delta : float or None
///     Probability, in (0, 1), that the calibration may fail; by default 0.05. `None` guarantees p on average
///     over calibrations.
/// windows : {"random_one", "avoidance_onset"}
///     The window of each trajectory: T steps from a random step, or T steps from the first turn.
/// seed : int
///     Seed for the random steps, ≥ 0.
/// parameters : SceneParameters, optional
///     By default the paper's.
/// safety : SafetyLevels, optional
///     Required if the vehicles differ and a feature of the model is a safety level.
///
/// Returns
/// -------
/// Calibration
///
/// Raises
/// ------
/// ValueError
///     If there are too few trajectories for the guarantee; the message says how many are needed. If a human
///     did not drive like the vehicle, because no ε gives sets that contain such a trajectory.
#[pyfunction]
#[pyo3(signature = (trajectories, model, settings, *, p=0.9, delta=Some(0.05), windows="random_one", seed=0, parameters=None, safety=None))]
#[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
pub(crate) fn calibrate(
    py: Python<'_>,
    trajectories: Vec<Trajectory>,
    model: Model<'_>,
    settings: &ShfrsSettings,
    #[pyo3(from_py_with = real)] p: f64,
    #[pyo3(from_py_with = some_real)] delta: Option<f64>,
    windows: &str,
    #[pyo3(from_py_with = seed)] seed: u64,
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
    let lack = match chosen {
        WindowChoice::AvoidanceOnset => format!("have no turn with {steps} steps from it on"),
        _ => format!("are shorter than {steps} steps"),
    };
    let windows = chosen.windows(&trajectories, steps).concat();
    enough(&windows, trajectories.len(), guarantee, p, &lack)?;
    for (i, trajectory) in trajectories.iter().enumerate() {
        let fits = trajectory.check(&human.parameters);
        fits.map_err(|invalid| invalid.within(&format!("trajectories[{i}]")))?;
    }
    let mut scores = Vec::with_capacity(windows.len());
    for window in &windows {
        py.check_signals()?;
        scores.push(human.work(py, |learned| {
            let prediction = Prediction::new(&human.parameters, learned);
            ShfrsFamily::new(prediction, settings.choice())?.score(window)
        })?);
    }
    Ok(Calibration::new(human, settings, scores, p, delta)?)
}
