//! Prediction in a robot's control loop, one state at a time.

use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use sidestep::bounds::{BoundsSettings, InputBounds};
use sidestep::clearance::{self, ClearanceSettings, Clearances, Continuity, NextSteps};
use sidestep::invalid::Invalid;
use sidestep::scene::{self, JointState};
use sidestep::shfrs;

use crate::arrays::{Array, joint_states, numbers, states_array, warn_of_degrees, wrong_shape};
use crate::bounds::stacked;
use crate::error::Error;
use crate::function::{SafetyLevels, levels};
use crate::human::{Human, Model};
use crate::kept::New;
use crate::plan::{Asked, proved};
use crate::predictor::Predictor;
use crate::reach::{ReachableSet, Speeds};
use crate::scalars::{real, some_real};
use crate::shfrs_settings::{ShfrsSettings, usual};
use crate::vehicles::SceneParameters;

/// Predicts a human in a robot's control loop. In each cycle, push the new state, predict, then check whether
/// plans are clear. The predictor draws no polygons and stores its own history. Several threads may use it;
/// their calls are serialized.
///
/// Parameters
/// ----------
/// model : Predictor
///     Its features must look back a fixed number of steps. For an `ActionModel` use `ShfrsPredictor`.
/// settings : ShfrsSettings, optional
///     For example those of a `Calibration`. The default is that of `ShfrsPredictor`.
/// parameters : SceneParameters, optional
///     By default the paper's.
/// safety : SafetyLevels, optional
///     Required if the vehicles differ and a feature of the model is a safety level.
/// speed_mps : float, or array of float64, shape (2,), optional
///     The speed (m/s) with which the human drives on, or the lowest and the highest speed if it can change at
///     any time, as people on foot do. By default the speed of the parameters. Sets, clearances and
///     `departure` allow these speeds. Features, roll-outs and `Calibration.collision` use the speed of the
///     parameters.
/// accuracy_m : float
///     Error bound of clearances: how far a clearance may be below the true value (m); 10⁻⁴ to 10.
/// assume_vehicle : bool
///     Whether clearances assume that the human continues to drive like the vehicle of the parameters, even
///     after a step that this vehicle cannot have driven (`departure`). Clearances can then be positive for a
///     human who stands in the way.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct OnlinePredictor {
    model: Py<Predictor>,
    pub(crate) settings: BoundsSettings,
    parameters: scene::SceneParameters,
    safety: Option<SafetyLevels>,
    accuracy_m: f64,
    assume_vehicle: bool,
    online: Mutex<clearance::OnlinePredictor>,
}

#[pymethods]
impl OnlinePredictor {
    #[new]
    #[pyo3(signature = (model, settings=None, *, parameters=None, safety=None, speed_mps=None, accuracy_m=0.02, assume_vehicle=false))]
    fn new(
        model: Model<'_>,
        settings: Option<ShfrsSettings>,
        parameters: Option<SceneParameters>,
        safety: Option<SafetyLevels>,
        speed_mps: Option<Speeds>,
        #[pyo3(from_py_with = real)] accuracy_m: f64,
        assume_vehicle: bool,
    ) -> Result<Self, Error> {
        let Model::Trained(model) = model else {
            let expected = "a Predictor; use ShfrsPredictor for an ActionModel";
            return Err(Invalid::new("model", expected, "an ActionModel").into());
        };
        let parameters = parameters.unwrap_or_default().0;
        let predictor = model.get().of_turns()?;
        let levels = levels(predictor.features(), &parameters, safety.clone())?;
        let actions = predictor.classes().len();
        let settings = match settings {
            Some(settings) => settings.bounds(actions)?,
            None => usual(actions, &parameters)?.bounds,
        };
        let kept = settings.clone();
        let speed = match speed_mps {
            Some(speeds) => speeds.of_all_steps()?,
            None => parameters.human.speed_mps.into(),
        };
        let next = if assume_vehicle { NextSteps::AssumeVehicle } else { NextSteps::LikeLast };
        let online = clearance::OnlinePredictor::new(predictor.clone(), levels, parameters, kept)
            .map_err(|invalid| invalid.within("model"))?
            .with_clearance(ClearanceSettings::new(accuracy_m)?)
            .with_next_steps(next)
            .with_speed(speed)?;
        let (model, online) = (model.unbind(), Mutex::new(online));
        Ok(Self { model, settings, parameters, safety, accuracy_m, assume_vehicle, online })
    }

    /// Appends the state one step after the last one. The length of a step is `step_s` of the parameters. If
    /// you missed a state, call `reset` and start over.
    ///
    /// Sets assume that the human continues at the speed of the parameters (or of `speed_mps`) and within its
    /// turn rate. They prove nothing about a human who moves slower or faster. So if the human's vehicle
    /// cannot have driven the last step, to a millimetre and a milliradian, `departure` gives the
    /// measurement, `clear` returns −∞ until the next step, and `Calibration.collision` raises an error.
    /// Positions with more noise than that need `assume_vehicle`.
    ///
    /// Parameters
    /// ----------
    /// state : array of float64, shape (2, 3)
    ///     The current poses (x, y, ψ) of the human and of the robot in the world frame (m, m, rad).
    ///
    /// Returns
    /// -------
    /// bool
    ///     Whether the human's vehicle can have driven the step from the last state. If not, `departure`
    ///     gives the reason. If the human moved or turned more than twice as much as the vehicle can in a
    ///     step, the earlier states are discarded. With `assume_vehicle`, False is returned only in this
    ///     case.
    fn push(&self, state: &Bound<'_, PyAny>) -> Result<bool, Error> {
        let found = numbers("state", "(2, 3)", state)?;
        let (&[human, robot], [2, 3]) = (found.values.as_chunks::<3>().0, &found.shape[..]) else {
            return Err(wrong_shape("state", "(2, 3)", &found.shape));
        };
        warn_of_degrees(state.py(), "state", &found, 3)?;
        let pushed = JointState { human: human.into(), robot: robot.into() };
        let continuity = state.py().detach(|| self.lock().push(pushed))?;
        Ok(continuity == Continuity::Continues)
    }

    /// Why the sets say nothing about the human's next steps, in words and with the measurement: the human's
    /// vehicle of the parameters cannot have driven the last step, to a millimetre and a milliradian. `None`
    /// if it can, if only one state is known, or with `assume_vehicle`.
    #[getter]
    fn departure(&self, py: Python<'_>) -> Option<String> {
        py.detach(|| self.lock().departure()).map(|found| found.to_string())
    }

    /// Discards all states.
    fn reset(&self, py: Python<'_>) {
        py.detach(|| self.lock().reset());
    }

    /// The latest states, at most as many as a prediction needs, with the current state last. Shape (n, 2,
    /// 3).
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let history = py.detach(|| self.lock().history().to_vec());
        states_array(py, &history)
    }

    /// Number of states that a prediction needs.
    #[getter]
    fn states_needed(&self, py: Python<'_>) -> usize {
        py.detach(|| self.lock().states_needed())
    }

    /// Bounds on the human's turn rate, predicted from the states so far. They assume a human who drives like
    /// the vehicle; see `departure`.
    ///
    /// Returns
    /// -------
    /// lo, hi : array of float64, shape (m, T)
    ///     Lowest and highest turn rate (rad/s) of each step in each set F_1 ⊆ F_2 ⊆ …
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If there are fewer states than the features need.
    fn predict<'py>(&self, py: Python<'py>) -> Result<(Array<'py>, Array<'py>), Error> {
        let sets = py.detach(|| self.lock().predict().map(<[InputBounds]>::to_vec))?;
        stacked(py, sets.iter())
    }

    /// Predicts like `predict`, and returns the reachable sets under these bounds. They start from the
    /// human's last pose and use the human's speeds and the step length of the parameters.
    ///
    /// Returns
    /// -------
    /// list of ReachableSet
    ///     The m sets F_1 ⊆ F_2 ⊆ …
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As for `predict`.
    fn sets(&self, py: Python<'_>) -> Result<Vec<ReachableSet>, Error> {
        let (now, speed, sets) = py.detach(|| {
            let mut online = self.lock();
            let sets = online.predict()?.to_vec();
            present(&online).map(|now| (now.human, online.speed(), sets))
        })?;
        let step_s = self.parameters.step_s;
        let set = |bounds| ReachableSet::of(now, bounds, speed, step_s);
        Ok(sets.into_iter().map(set).collect::<Result<_, _>>()?)
    }

    /// The clearance between a plan that starts now and the positions where the human may be.
    ///
    /// Parameters
    /// ----------
    /// plan, radius_m, corners, most_speed_mps, most_turn_rate_radps
    ///     As for `Shfrs.clear`.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (m, T)
    ///     As `Shfrs.clear` returns: −∞ throughout if `departure` is not `None`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If there was no prediction since the last state. Also as for `Shfrs.clear`.
    #[pyo3(signature = (plan, radius_m, *, corners=None, most_speed_mps=None, most_turn_rate_radps=None))]
    fn clear<'py>(
        &self,
        plan: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = real)] radius_m: f64,
        corners: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = some_real)] most_speed_mps: Option<f64>,
        #[pyo3(from_py_with = some_real)] most_turn_rate_radps: Option<f64>,
    ) -> Result<Array<'py>, Error> {
        let asked = Asked { plan, radius_m, corners, most_speed_mps, most_turn_rate_radps };
        Ok(proved(plan.py(), &self.clearances(plan.py(), &asked)?)?)
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<New<'py, (Py<Predictor>, ShfrsSettings)>> {
        let named = PyDict::new(py);
        named.set_item("parameters", SceneParameters(self.parameters))?;
        named.set_item("safety", self.safety.clone())?;
        let speed = py.detach(|| self.lock().speed());
        named.set_item("speed_mps", [speed.lo_mps(), speed.hi_mps()])?;
        named.set_item("accuracy_m", self.accuracy_m)?;
        named.set_item("assume_vehicle", self.assume_vehicle)?;
        let settings = ShfrsSettings::of(&shfrs::ShfrsSettings::new(self.settings.clone()));
        Ok(((self.model.clone_ref(py), settings), named))
    }

    /// The states to push again after unpickling, and whether a prediction has run since the last state.
    fn __getstate__<'py>(&self, py: Python<'py>) -> PyResult<(Array<'py>, bool)> {
        let (states, predicted) = py.detach(|| {
            let online = self.lock();
            let mut states = online.history().to_vec();
            // The predictor also stores the human's pose one step before the history. The robot's pose at
            // that step does not matter.
            if let ([only], Some(human)) = (&states[..], online.before()) {
                states.insert(0, JointState { human, ..*only });
            }
            (states, online.is_predicted())
        });
        Ok((states_array(py, &states)?, predicted))
    }

    fn __setstate__(&self, py: Python<'_>, state: (Bound<'_, PyAny>, bool)) -> Result<(), Error> {
        let (states, predicted) = state;
        let states = joint_states("states", 0, &states)?;
        Ok(py.detach(|| {
            let mut online = self.lock();
            online.reset();
            for state in states {
                online.push(state)?;
            }
            if predicted { online.predict().map(drop) } else { Ok(()) }
        })?)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let states = py.detach(|| self.lock().history().len());
        format!("OnlinePredictor(states={states}, states_needed={})", self.states_needed(py))
    }
}

impl OnlinePredictor {
    /// The clearance of a plan from each set.
    pub(crate) fn clearances(
        &self,
        py: Python<'_>,
        asked: &Asked<'_, '_>,
    ) -> Result<Clearances, Error> {
        let now = py.detach(|| present(&self.lock()))?;
        let planned = asked.check(now.robot, &self.parameters)?;
        let clear = || self.lock().clear(&planned.plan, &planned.footprint).cloned();
        Ok(py.detach(clear)?)
    }

    /// Checks that the human's vehicle can have driven the last step.
    pub(crate) fn check_human(&self, py: Python<'_>) -> Result<(), Invalid> {
        py.detach(|| self.lock().check_human())
    }

    /// Whether this predictor predicts the given human.
    pub(crate) fn predicts(&self, human: &Human) -> bool {
        human.predicted_by(self.model.get(), &self.parameters)
    }

    /// Locks the predictor. Call this only while the interpreter is released, because a thread that holds the
    /// lock might be waiting for the interpreter.
    fn lock(&self) -> MutexGuard<'_, clearance::OnlinePredictor> {
        self.online.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The last state pushed.
fn present(online: &clearance::OnlinePredictor) -> Result<JointState, Invalid> {
    let last = online.history().last().copied();
    last.ok_or_else(|| Invalid::new("history", "at least one state", "none"))
}
