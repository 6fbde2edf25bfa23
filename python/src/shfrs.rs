//! Stochastic human forward reachable sets (SHFRS).

use std::sync::{Arc, Mutex};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sidestep::bounds::InputBounds;
use sidestep::clearance::{ClearanceSettings, Clearances};
use sidestep::invalid::Invalid;
use sidestep::plausibility::{Departure, check_step, departure};
use sidestep::reach::ReachableSet as Reachable;
use sidestep::scene::JointState;
use sidestep::shfrs;
use sidestep::shfrs::baselines::worst_case_area_m2;
use sidestep::shfrs::widened::tube_area_m2;

use crate::arrays::{Array, joint_states, numbers, points, states_array, wrong_shape};
use crate::bounds::stacked;
use crate::error::Error;
use crate::function::SafetyLevels;
use crate::human::{Human, Model};
use crate::interrupt::{Watch, each};
use crate::kept::New;
use crate::plan::{Asked, proved};
use crate::reach::{ReachableSet, drive, margin_m, tolerance};
use crate::scalars::{real, some_real};
use crate::shfrs_settings::{ShfrsSettings, usual};
use crate::vehicles::SceneParameters;

/// Nested forward reachable sets F_1 ⊆ F_2 ⊆ … of the human, predicted from the states so far.
///
/// They assume that the human continues at the speed of the parameters and within its turn rate. They prove
/// nothing about a human who stands still, or moves slower or faster. If the last step was like that,
/// `departure` says so and `clear` returns −∞.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct Shfrs {
    pub(crate) found: shfrs::Shfrs,
    reachable: Vec<Reachable>,
    /// The last state.
    now: JointState,
    before: Option<JointState>,
    pub(crate) source: Arc<Source>,
}

/// The model and the settings that a prediction used.
pub(crate) struct Source {
    pub(crate) human: Human,
    pub(crate) settings: shfrs::ShfrsSettings,
    assume_vehicle: bool,
}

#[pymethods]
impl Shfrs {
    /// By how much each set widens the bounds (rad/s), shape (m,).
    #[getter]
    fn epsilon<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.found.sets.iter().map(|set| set.epsilon).collect::<Vec<_>>().into_pyarray(py)
    }

    /// Lowest turn rate of each step in each set (rad/s), shape (m, T).
    #[getter]
    fn lo<'py>(&self, py: Python<'py>) -> Result<Array<'py>, Error> {
        Ok(stacked(py, self.bounds())?.0)
    }

    /// Highest turn rate of each step in each set (rad/s), shape (m, T).
    #[getter]
    fn hi<'py>(&self, py: Python<'py>) -> Result<Array<'py>, Error> {
        Ok(stacked(py, self.bounds())?.1)
    }

    /// The tube of each set, which contains every position reachable within the future steps: m polygons of
    /// shape (n, 2) in the world frame (m), counter-clockwise.
    #[getter]
    fn tubes<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        self.found.sets.iter().map(|set| points(py, &set.tube)).collect()
    }

    /// By how much each tube was grown so that it contains its set (m), shape (m,), as returned by
    /// `ReachableSet.tube`. 0 if the tube follows the boundary; infinite if it is a convex polygon around the
    /// set.
    #[getter]
    fn margins_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let margins = self.found.sets.iter().map(|set| margin_m(set.tube_outline));
        margins.collect::<Vec<_>>().into_pyarray(py)
    }

    /// Area of each tube (m²), shape (m,).
    #[getter]
    fn areas_m2<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.found.sets.iter().map(|set| set.area_m2).collect::<Vec<_>>().into_pyarray(py)
    }

    /// The area of each set as a share of the worst-case area, shape (m,), at most 1. The worst case is
    /// everything that the human's vehicle can reach, so a set with a share near 1 says no more than the
    /// vehicle does. `areas_m2` has the areas of the polygons, which differ from the sets by their accuracy.
    #[getter]
    fn shares_of_worst_case<'py>(
        &self,
        py: Python<'py>,
    ) -> Result<Bound<'py, PyArray1<f64>>, Error> {
        let Source { human, settings, .. } = &*self.source;
        let worst = worst_case_area_m2(&human.parameters, settings.bounds.steps())?;
        // Compute both areas by the same rule. With polygon areas, tighter bounds could seem to have a larger
        // area, within the accuracy.
        let share = |set: &shfrs::NestedSet| {
            Ok((tube_area_m2(&set.bounds, &human.parameters)? / worst).min(1.0))
        };
        let shares: Result<Vec<_>, Invalid> = self.found.sets.iter().map(share).collect();
        Ok(shares?.into_pyarray(py))
    }

    /// For each set, the positions after exactly 1 … T steps: m lists of T polygons. Empty lists without
    /// `by_step`.
    #[getter]
    fn step_polygons<'py>(&self, py: Python<'py>) -> PyResult<Vec<Vec<Bound<'py, PyArray2<f64>>>>> {
        let of = |set: &shfrs::NestedSet| set.steps.iter().map(|step| points(py, step)).collect();
        self.found.sets.iter().map(of).collect()
    }

    /// By how much each of `step_polygons` was grown (m), as in `margins_m`. Shape (m, T), or (m, 0) without
    /// `by_step`.
    #[getter]
    fn step_margins_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let sets = &self.found.sets;
        let steps = sets.first().map_or(0, |set| set.step_outlines.len());
        let margins = sets.iter().flat_map(|set| &set.step_outlines).map(|each| margin_m(*each));
        margins.collect::<Vec<_>>().into_pyarray(py).reshape([sets.len(), steps])
    }

    /// Why the sets say nothing about the human's next steps, in words and with the measurement: the human's
    /// vehicle of the parameters cannot have driven the last step of the history, to a millimetre and a
    /// milliradian. `None` if it can, if the history has only one state, or with `assume_vehicle`.
    #[getter]
    fn departure(&self) -> Option<String> {
        self.departed().map(|found| found.to_string())
    }

    /// The m reachable sets, to draw other polygons and to test poses.
    #[getter]
    fn sets(&self) -> Vec<ReachableSet> {
        let step_s = self.step_s();
        let sets = self.reachable.iter().zip(self.bounds());
        sets.map(|(set, bounds)| ReachableSet { set: set.clone(), bounds: bounds.clone(), step_s })
            .collect()
    }

    /// Whether a trajectory is inside each set at every one of its steps. A pose that is undecided after a
    /// limited amount of work counts as outside, so that shares of contained trajectories are never too
    /// large.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (t, 3), 1 ≤ t ≤ T
    ///     The human's poses after steps 1 … t in the world frame (m, m, rad).
    /// position_m, heading_rad : float
    ///     Tolerance (m and rad), ≥ 0: a pose counts as reachable if it is at most this far from a reachable
    ///     one.
    ///
    /// Returns
    /// -------
    /// array of bool, shape (m,)
    #[pyo3(signature = (states, *, position_m=0.005, heading_rad=0.002))]
    fn contains<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = real)] position_m: f64,
        #[pyo3(from_py_with = real)] heading_rad: f64,
    ) -> Result<Bound<'py, PyArray1<bool>>, Error> {
        let py = states.py();
        let steps = self.reachable.first().map_or(0, Reachable::steps);
        let states = drive("states", steps, states)?;
        let tolerance = tolerance(position_m, heading_rad)?;
        let inside = |j: usize| self.reachable[j].contains_trajectory(&states, None, tolerance);
        Ok(each(py, self.reachable.len(), inside)?.into_pyarray(py))
    }

    /// The clearance between a plan of the robot that starts now and the positions where the human may be. It
    /// holds at every instant, not only at the ends of steps. It is proven for a human at the speed of the
    /// parameters, for all turn rates within the bounds of the set.
    ///
    /// Between two poses the robot holds its speed and its turn rate. If your robot deviates from that, add
    /// the deviation to `radius_m`. The human is a point, so also add a radius for the body.
    ///
    /// Parameters
    /// ----------
    /// plan : array of float64, shape (T, 3)
    ///     The robot's poses (x, y, ψ) after steps 1 … T in the world frame (m, m, rad), as returned by
    ///     `drive`. The current pose is not included; it is the robot's pose in the last state of the
    ///     history. (Rust's `Plan` starts with the current pose.)
    /// radius_m : float
    ///     Radius of a disc around the robot's position (m), 0 to 10⁴. With `corners`, how far the robot
    ///     extends beyond them.
    /// corners : array of float64, shape (n, 2), optional
    ///     Corners of the robot in its own frame (m): x ahead, y to the left. Their convex hull counts.
    /// most_speed_mps, most_turn_rate_radps : float, optional
    ///     Limits of the robot (m/s and rad/s), > 0. A plan that exceeds them is rejected as a jump. By
    ///     default the speed and turn rate of the robot of the parameters.
    /// accuracy_m : float
    ///     How far a clearance of up to 2 m may be below the true value (m); 10⁻⁴ to 10. It can be lower
    ///     still where the search is cut short, for large turns per step or over tens of steps.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (m, T)
    ///     For each set and step, a lower bound on the distance (m) from the robot to any human who drives
    ///     within the set. If it is ≤ 0, they may touch; the magnitude of a negative value has no meaning. −∞
    ///     throughout if the vehicle cannot have driven the human's last step; `departure` gives the reason.
    ///     Pass the result to `largest_clear`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the plan has another shape than (T, 3), jumps (the message says where), or was made by `drive`
    ///     for another step length.
    #[pyo3(signature = (plan, radius_m, *, corners=None, most_speed_mps=None, most_turn_rate_radps=None, accuracy_m=0.02))]
    fn clear<'py>(
        &self,
        plan: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = real)] radius_m: f64,
        corners: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = some_real)] most_speed_mps: Option<f64>,
        #[pyo3(from_py_with = some_real)] most_turn_rate_radps: Option<f64>,
        #[pyo3(from_py_with = real)] accuracy_m: f64,
    ) -> Result<Array<'py>, Error> {
        let asked = Asked { plan, radius_m, corners, most_speed_mps, most_turn_rate_radps };
        let found = self.clearances(plan.py(), &asked, ClearanceSettings::new(accuracy_m)?)?;
        Ok(proved(plan.py(), &found)?)
    }

    fn __len__(&self) -> usize {
        self.found.sets.len()
    }

    /// Whether the sets are equal and were predicted from the same states with the same model and settings.
    fn __eq__(&self, other: &Self) -> bool {
        self.found == other.found
            && (self.now, self.before) == (other.now, other.before)
            && self.source.settings == other.source.settings
            && self.source.assume_vehicle == other.source.assume_vehicle
            && self.source.human.same(&other.source.human)
    }

    fn __hash__(&self) -> usize {
        self.found.sets.len()
    }

    /// The sets that `predictor` predicted after these one or two last states, given their bounds of shape
    /// (m, T).
    #[staticmethod]
    #[pyo3(name = "_of")]
    fn of(
        predictor: &Bound<'_, ShfrsPredictor>,
        states: &Bound<'_, PyAny>,
        lo: &Bound<'_, PyAny>,
        hi: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let source = Arc::clone(&predictor.get().source);
        let states = joint_states("states", 1, states)?;
        let [lo, hi] = [("lo", lo), ("hi", hi)].map(|(name, object)| {
            let found = numbers(name, "(m, T)", object)?;
            match found.shape[..] {
                [_, steps] if steps > 0 => Ok((steps, found.values)),
                _ => Err(wrong_shape(name, "(m, T) with T ≥ 1", &found.shape)),
            }
        });
        let ((steps, lo), (_, hi)) = (lo?, hi?);
        let rows = lo.chunks(steps).zip(hi.chunks(steps));
        let bounds =
            rows.map(|(lo, hi)| InputBounds::new(lo.to_vec(), hi.to_vec(), (f64::MIN, f64::MAX)));
        let bounds = bounds.collect::<Result<Vec<_>, _>>()?;
        let (now, before) = (states[states.len() - 1], states.len().checked_sub(2));
        let parameters = &source.human.parameters;
        let (speed_mps, step_s) = (parameters.human.speed_mps, parameters.step_s);
        let found = shfrs::Shfrs::redrawn(now.human, &bounds, speed_mps, step_s, &source.settings)?;
        let set = |bounds| Reachable::new(now.human, bounds, speed_mps, step_s);
        let reachable = bounds.iter().map(set).collect::<Result<_, _>>()?;
        Ok(Self { found, reachable, now, before: before.map(|at| states[at]), source })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<(Bound<'py, PyAny>, Drawn<'py>), Error> {
        let (py, sets) = (slf.py(), slf.get());
        let source = Arc::clone(&sets.source);
        let predictor = Bound::new(py, ShfrsPredictor { source, frames: Mutex::default() })?;
        let states: Vec<_> = sets.before.into_iter().chain([sets.now]).collect();
        let (lo, hi) = (sets.lo(py)?, sets.hi(py)?);
        let made = (predictor, states_array(py, &states)?, lo, hi);
        Ok((slf.get_type().getattr("_of")?, made))
    }

    fn __repr__(&self) -> String {
        let areas: Vec<_> =
            self.found.sets.iter().map(|set| format!("{:.2}", set.area_m2)).collect();
        format!("Shfrs(areas_m2=[{}])", areas.join(", "))
    }
}

/// The predictor, the last states and the bounds that recreate the sets.
type Drawn<'py> = (Bound<'py, ShfrsPredictor>, Array<'py>, Array<'py>, Array<'py>);

impl Shfrs {
    /// The clearance of a plan from each set.
    pub(crate) fn clearances(
        &self,
        py: Python<'_>,
        asked: &Asked<'_, '_>,
        settings: ClearanceSettings,
    ) -> Result<Clearances, Error> {
        let parameters = &self.source.human.parameters;
        let planned = asked.check(self.now.robot, parameters)?;
        let sets: Vec<InputBounds> = self.bounds().cloned().collect();
        let departed = self.departed();
        let find = || planned.clearances(self.now.human, &sets, parameters, settings, departed);
        Ok(py.detach(find)?)
    }

    /// How the last step departs from the motion of the vehicle. `None` if it does not.
    fn departed(&self) -> Option<Departure> {
        let before = self.before.filter(|_| !self.source.assume_vehicle)?;
        departure(&self.source.human.parameters, before.human, self.now.human)
    }

    fn step_s(&self) -> f64 {
        self.source.human.parameters.step_s
    }

    /// Checks that the human's vehicle can have driven the last step.
    pub(crate) fn check_human(&self) -> Result<(), Invalid> {
        let Some(before) = self.before else { return Ok(()) };
        check_step(&self.source.human.parameters, before.human, self.now.human)
            .map_err(|invalid| invalid.within("history[-1].human"))
    }

    fn bounds(&self) -> impl Iterator<Item = &InputBounds> + Clone {
        self.found.sets.iter().map(|set| &set.bounds)
    }
}

/// Predicts sets online, one frame at a time. The robot is assumed to drive straight ahead.
///
/// Parameters
/// ----------
/// model : Predictor or ActionModel
///     Model of the probabilities of the human's actions.
/// settings : ShfrsSettings, optional
///     By default the paper's (`ShfrsSettings.paper`): ten steps of `step_s`, with ε in proportion to the
///     human's turn rate.
/// parameters : SceneParameters, optional
///     By default the paper's.
/// safety : SafetyLevels, optional
///     Required if the vehicles differ and a feature of the model is a safety level.
/// assume_vehicle : bool
///     Whether clearances assume that the human continues to drive like the vehicle of the parameters, even
///     after a step that this vehicle cannot have driven (`Shfrs.departure`). Clearances can then be positive
///     for a human who stands in the way.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct ShfrsPredictor {
    source: Arc<Source>,
    /// Buffers, which serve one prediction at a time.
    frames: Mutex<shfrs::ShfrsPredictor>,
}

#[pymethods]
impl ShfrsPredictor {
    #[new]
    #[pyo3(signature = (model, settings=None, *, parameters=None, safety=None, assume_vehicle=false))]
    fn new(
        model: Model<'_>,
        settings: Option<ShfrsSettings>,
        parameters: Option<SceneParameters>,
        safety: Option<SafetyLevels>,
        assume_vehicle: bool,
    ) -> Result<Self, Error> {
        let human = Human::new(model, &parameters.unwrap_or_default().0, safety)?;
        let settings = match settings {
            None => usual(human.actions(), &human.parameters)?,
            Some(given) => given.of_prediction(human.actions())?,
        };
        let source = Arc::new(Source { human, settings, assume_vehicle });
        Ok(Self { source, frames: Mutex::default() })
    }

    fn __getnewargs_ex__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<New<'py, (Bound<'py, PyAny>, ShfrsSettings)>> {
        let (model, parameters, safety) = self.source.human.arguments(py);
        let named = PyDict::new(py);
        named.set_item("parameters", parameters)?;
        named.set_item("safety", safety)?;
        named.set_item("assume_vehicle", self.source.assume_vehicle)?;
        Ok(((model, ShfrsSettings::of(&self.source.settings)), named))
    }

    /// Predicts the sets from the states so far.
    ///
    /// Parameters
    /// ----------
    /// history : array of float64, shape (n, 2, 3), n ≥ 1
    ///     Joint states from the start of the trial to now, one per step: the poses (x, y, ψ) of the human
    ///     and of the robot in the world frame (m, m, rad).
    ///
    /// Returns
    /// -------
    /// Shfrs
    fn predict(&self, history: &Bound<'_, PyAny>) -> Result<Shfrs, Error> {
        let py = history.py();
        let history = joint_states("history", 1, history)?;
        let Source { human, settings, .. } = &*self.source;
        let parameters = &human.parameters;
        let mut watch = Watch::new();
        let predicted = human.work(py, |learned| {
            // The buffers can be in use: another thread might be predicting, or a Python function might start
            // a prediction while it is called for another prediction.
            let mut other = shfrs::ShfrsPredictor::default();
            let mut kept = self.frames.try_lock().ok();
            let frames = kept.as_deref_mut().unwrap_or(&mut other);
            let goes_on = &mut || watch.look();
            let found =
                frames.predict_while(&history, parameters, learned, settings, goes_on)?.cloned();
            drop(kept);
            let Some(found) = found else { return Ok(None) };
            let now = history[history.len() - 1];
            let before = history.len().checked_sub(2).map(|place| history[place]);
            let (speed_mps, step_s) = (parameters.human.speed_mps, parameters.step_s);
            let set =
                |set: &shfrs::NestedSet| Reachable::new(now.human, &set.bounds, speed_mps, step_s);
            let reachable = found.sets.iter().map(set).collect::<Result<_, _>>()?;
            Ok(Some(Shfrs { found, reachable, now, before, source: Arc::clone(&self.source) }))
        })?;
        watch.end()?;
        let expected = "a prediction that goes on";
        Ok(predicted.ok_or_else(|| Invalid::new("prediction", expected, "one that ended"))?)
    }
}
