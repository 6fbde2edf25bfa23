//! A prediction in a robot's loop, state by state.

use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use sidestep::bounds::InputBounds;
use sidestep::invalid::Invalid;
use sidestep::planner::{self, ClearanceSettings, Continuity};
use sidestep::scene::{self, JointState};

use crate::arrays::{Array, Numbers, numbers, states_array, wrong_shape};
use crate::bounds::stacked;
use crate::error::Error;
use crate::function::{SafetyLevels, levels};
use crate::plan::{Asked, proved};
use crate::predictor::Predictor;
use crate::scalars::{real, some_real};
use crate::shfrs::ShfrsSettings;
use crate::vehicles::SceneParameters;

/// Predicts a human in a robot's loop: push each new state, then predict, then ask whether plans are clear. It draws
/// no polygons and keeps its own history; it may be used from several threads, one after the other.
///
/// Parameters
/// ----------
/// model : Predictor
///     Its features look back a fixed number of steps.
/// settings : ShfrsSettings, optional
///     The paper's (Figure 3, left) by default, or those of a `Calibration`.
/// parameters : SceneParameters, optional
///     The paper's by default.
/// safety : SafetyLevels, optional
///     Needed if the vehicles differ and a feature of the model is a safety level.
/// accuracy_m : float
///     How far a clearance may be below the true one, m; 10⁻⁴ to 10.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct OnlinePredictor {
    parameters: scene::SceneParameters,
    online: Mutex<planner::OnlinePredictor>,
}

#[pymethods]
impl OnlinePredictor {
    #[new]
    #[pyo3(signature = (model, settings=None, *, parameters=None, safety=None, accuracy_m=0.02))]
    fn new(
        model: &Predictor,
        settings: Option<ShfrsSettings>,
        parameters: Option<SceneParameters>,
        safety: Option<SafetyLevels>,
        #[pyo3(from_py_with = real)] accuracy_m: f64,
    ) -> Result<Self, Error> {
        let parameters = parameters.unwrap_or_default().0;
        let predictor = model.of_turns()?;
        let safety = levels(predictor.features(), &parameters, safety)?;
        let actions = predictor.classes().len();
        let settings = match settings {
            Some(settings) => settings.bounds(actions)?,
            None => sidestep::shfrs::ShfrsSettings::paper(actions)?.bounds,
        };
        let online = planner::OnlinePredictor::new(predictor.clone(), safety, parameters, settings)
            .map_err(|invalid| invalid.within("model"))?
            .with_clearance(ClearanceSettings::new(accuracy_m)?);
        Ok(Self { parameters, online: Mutex::new(online) })
    }

    /// Appends the state one step after the last one.
    ///
    /// Parameters
    /// ----------
    /// state : array of float64, shape (2, 3)
    ///     The poses (x, y, ψ) of the human and of the robot now, world frame, m, m, rad.
    ///
    /// Returns
    /// -------
    /// bool
    ///     Whether it follows from the states before. If not, because the human moved or turned more than twice as
    ///     much as the vehicle can in a step, they are forgotten.
    fn push(&self, state: &Bound<'_, PyAny>) -> Result<bool, Error> {
        let Numbers { shape, values } = numbers("state", "(2, 3)", state)?;
        let (&[human, robot], [2, 3]) = (values.as_chunks::<3>().0, &shape[..]) else {
            return Err(wrong_shape("state", "(2, 3)", &shape));
        };
        let pushed = JointState { human: human.into(), robot: robot.into() };
        let continuity = state.py().detach(|| self.lock().push(pushed))?;
        Ok(continuity == Continuity::Continues)
    }

    /// Forgets all states.
    fn reset(&self, py: Python<'_>) {
        py.detach(|| self.lock().reset());
    }

    /// The latest states, at most as many as are needed, the present one last, shape (n, 2, 3).
    #[getter]
    fn history<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let history = py.detach(|| self.lock().history().to_vec());
        states_array(py, &history)
    }

    /// How many states a prediction needs.
    #[getter]
    fn states_needed(&self, py: Python<'_>) -> usize {
        py.detach(|| self.lock().states_needed())
    }

    /// Bounds on the human's turn rate from the states so far.
    ///
    /// Returns
    /// -------
    /// lo, hi : array of float64, shape (m, T)
    ///     Lowest and highest turn rate of each step in each set F_1 ⊆ F_2 ⊆ …, rad/s.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If there are fewer states than the features look back.
    fn predict<'py>(&self, py: Python<'py>) -> Result<(Array<'py>, Array<'py>), Error> {
        let sets = py.detach(|| self.lock().predict().map(<[InputBounds]>::to_vec))?;
        stacked(py, sets.iter())
    }

    /// How far a plan that begins now stays clear of where the human may be.
    ///
    /// Parameters
    /// ----------
    /// plan, radius_m, corners, most_speed_mps, most_turn_rate_radps
    ///     As for `Shfrs.clear`.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (m, T)
    ///     As `Shfrs.clear` returns.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If there is no prediction since the last state; and as for `Shfrs.clear`.
    #[pyo3(signature = (plan, radius_m, *, corners=None, most_speed_mps=None, most_turn_rate_radps=None))]
    fn clear<'py>(
        &self,
        plan: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = real)] radius_m: f64,
        corners: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = some_real)] most_speed_mps: Option<f64>,
        #[pyo3(from_py_with = some_real)] most_turn_rate_radps: Option<f64>,
    ) -> Result<Array<'py>, Error> {
        let py = plan.py();
        let asked = Asked { plan, radius_m, corners, most_speed_mps, most_turn_rate_radps };
        let now = py.detach(|| self.lock().history().last().map(|state| state.robot));
        let Some(now) = now else {
            return Err(Invalid::new("history", "at least one state", "none").into());
        };
        let planned = asked.check(now, &self.parameters)?;
        let found = py.detach(|| self.lock().clear(&planned.plan, &planned.footprint).cloned())?;
        Ok(proved(py, &found)?)
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let states = py.detach(|| self.lock().history().len());
        format!("OnlinePredictor(states={states}, states_needed={})", self.states_needed(py))
    }
}

impl OnlinePredictor {
    /// Only while the interpreter is released: whoever holds the lock may be waiting for it.
    fn lock(&self) -> MutexGuard<'_, planner::OnlinePredictor> {
        self.online.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
