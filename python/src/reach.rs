//! Reachable sets under bounds on the turn rate.

use numpy::{IntoPyArray, PyArray1};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use sidestep::bounds::InputBounds;
use sidestep::invalid::Invalid;
use sidestep::reach::{self, Outline, PolygonSettings, Tolerance, Workspace};
use sidestep::vehicle::{Pose, SpeedRange};

use crate::arrays::{Numbers, count, list, numbers, points, pose, poses, wrong_shape};
use crate::bounds::few_steps;
use crate::error::Error;
use crate::interrupt::each;
use crate::scalars::{real, whole};

/// Every position and every pose that a vehicle can reach under bounds on its turn rate, at a constant speed or
/// with speeds from a range.
///
/// Parameters
/// ----------
/// start : array of float64, shape (3,)
///     The current pose (x, y, ψ) in the world frame (m, m, rad).
/// lo, hi : array of float64, shape (T,), 1 ≤ T ≤ 100
///     Lowest and highest turn rate of each step (rad/s, left positive); at most half a turn per step. Bounds
///     that exclude driving straight by less than 10⁻⁵ rad over all steps are treated as if they allowed it.
/// speed_mps : float, or array of float64, shape (2,) or (T, 2)
///     Speed (m/s), > 0; at most 100 m per step. By default the paper's. Or the lowest (≥ 0) and the highest
///     speed, of all steps or of each step: the vehicle then changes its speed within this range at any time.
/// step_s : float
///     Length of a step (s), > 0. By default the paper's.
#[pyclass(frozen, eq, module = "sidestep")]
#[derive(PartialEq)]
pub(crate) struct ReachableSet {
    pub(crate) set: reach::ReachableSet,
    /// The bounds that define the set.
    pub(crate) bounds: InputBounds,
    pub(crate) step_s: f64,
}

#[pymethods]
impl ReachableSet {
    #[new]
    #[pyo3(
        signature = (start, lo, hi, speed_mps=PAPERS.into(), step_s=0.2),
        text_signature = "(start, lo, hi, speed_mps=2.0, step_s=0.2)"
    )]
    fn new(
        start: &Bound<'_, PyAny>,
        lo: &Bound<'_, PyAny>,
        hi: &Bound<'_, PyAny>,
        speed_mps: Speeds,
        #[pyo3(from_py_with = real)] step_s: f64,
    ) -> Result<Self, Error> {
        let start = pose("start", start)?;
        Self::under(start, list("lo", lo)?, list("hi", hi)?, speed_mps.0, step_s)
    }

    /// The lowest and the highest speed of all steps, or of each step (m/s).
    #[getter]
    fn speed_mps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self.speeds()[..] {
            [[lo, hi]] if lo == hi => lo.into_bound_py_any(py),
            [range] => Ok(range.to_vec().into_pyarray(py).into_any()),
            ref ranges => Ok(points(py, ranges)?.into_any()),
        }
    }

    /// The number of steps T.
    #[getter]
    fn steps(&self) -> usize {
        self.set.steps()
    }

    /// The positions that are reachable at any instant up to the last step, as a polygon.
    ///
    /// Parameters
    /// ----------
    /// accuracy_m : float
    ///     Maximum distance of the edges from the true boundary (m); 10⁻⁶ to 1. Where this accuracy would be
    ///     too expensive (for large turns per step, many steps or high accuracy), the polygon is larger and
    ///     contains the set.
    /// conservative : bool
    ///     Whether the polygon must contain the set. Otherwise it follows the boundary on either side.
    /// return_margin : bool
    ///     Whether to also return the margin.
    ///
    /// Returns
    /// -------
    /// polygon : array of float64, shape (n, 2)
    ///     Vertices (x, y) in the world frame (m), counter-clockwise. The first vertex is not repeated. If
    ///     the bounds leave no choice, the polygon is a strip along the path, and its width is 1/500 of the
    ///     accuracy.
    /// margin_m : float
    ///     Only with `return_margin` (m). If 0, the polygon follows the boundary on either side, except at
    ///     sharp corners, which can stick out by several times the accuracy. Otherwise the polygon was grown
    ///     by this margin so that it contains the set; it is farther outside where it was drawn coarsely. The
    ///     margin is infinite if the polygon is convex, because following the boundary would have been too
    ///     expensive.
    #[pyo3(signature = (*, accuracy_m=1e-3, conservative=false, return_margin=false))]
    fn tube<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = real)] accuracy_m: f64,
        conservative: bool,
        return_margin: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let settings = drawn(accuracy_m, conservative)?;
        let draw =
            |work: &mut Workspace, into: &mut _| self.set.tube_polygon_into(settings, work, into);
        polygon(py, return_margin, draw)
    }

    /// The positions that are reachable after exactly `step` steps, as a polygon.
    ///
    /// Parameters
    /// ----------
    /// step : int
    ///     0 to T.
    /// accuracy_m : float
    ///     As for `tube`.
    /// conservative, return_margin : bool
    ///     As for `tube`.
    ///
    /// Returns
    /// -------
    /// polygon : array of float64, shape (n, 2)
    ///     As for `tube`, but one vertex if only one position is reachable.
    /// margin_m : float
    ///     As for `tube`.
    #[pyo3(signature = (step, *, accuracy_m=1e-3, conservative=false, return_margin=false))]
    fn polygon<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = whole)] step: i64,
        #[pyo3(from_py_with = real)] accuracy_m: f64,
        conservative: bool,
        return_margin: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (step, settings) = (self.step(step)?, drawn(accuracy_m, conservative)?);
        let draw = |work: &mut Workspace, into: &mut _| {
            self.set.step_polygon_into(step, settings, work, into)
        };
        polygon(py, return_margin, draw)
    }

    /// Whether each pose (position and heading) is reachable after exactly `step` steps.
    ///
    /// The result is never false for a pose within the tolerance of a reachable one. For large turns per
    /// step, it can be true for other poses, because a pose counts as reachable unless a limited amount of
    /// work proves that it is outside.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (n, 3)
    ///     Poses (x, y, ψ) in the world frame (m, m, rad).
    /// step : int
    ///     0 to T.
    /// position_m, heading_rad : float
    ///     Tolerance (m and rad), ≥ 0: a pose counts as reachable if it is at most this far from a reachable
    ///     one.
    ///
    /// Returns
    /// -------
    /// array of bool, shape (n,)
    #[pyo3(signature = (states, step, *, position_m=0.005, heading_rad=0.002))]
    fn contains<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = whole)] step: i64,
        #[pyo3(from_py_with = real)] position_m: f64,
        #[pyo3(from_py_with = real)] heading_rad: f64,
    ) -> Result<Bound<'py, PyArray1<bool>>, Error> {
        let py = states.py();
        let states = poses("states", states)?;
        let (step, tolerance) = (self.step(step)?, tolerance(position_m, heading_rad)?);
        let inside = |i: usize| self.set.contains_state(step, states[i], tolerance);
        Ok(each(py, states.len(), inside)?.into_pyarray(py))
    }

    /// Whether a trajectory is inside at each of its steps. Like `contains` for each pose, but all poses
    /// together share one limit on the work.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (t, 3), 1 ≤ t ≤ T
    ///     The poses after steps 1 … t in the world frame (m, m, rad).
    /// position_m, heading_rad : float
    ///     As for `contains`.
    ///
    /// Returns
    /// -------
    /// array of bool, shape (t,)
    #[pyo3(signature = (states, *, position_m=0.005, heading_rad=0.002))]
    fn contains_drive<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = real)] position_m: f64,
        #[pyo3(from_py_with = real)] heading_rad: f64,
    ) -> Result<Bound<'py, PyArray1<bool>>, Error> {
        let py = states.py();
        let states = drive("states", self.set.steps(), states)?;
        let tolerance = tolerance(position_m, heading_rad)?;
        let found = py.detach(|| self.set.contains_states(&states, tolerance));
        Ok(found.into_pyarray(py))
    }

    fn __hash__(&self) -> usize {
        self.set.steps()
    }

    #[allow(clippy::type_complexity, reason = "the arguments of `new`")]
    fn __getnewargs__(&self) -> ([f64; 3], Vec<f64>, Vec<f64>, Vec<[f64; 2]>, f64) {
        let (lo, hi) = (self.bounds.lo().to_vec(), self.bounds.hi().to_vec());
        (self.set.start().into(), lo, hi, self.speeds(), self.step_s)
    }

    fn __repr__(&self) -> String {
        let start: [f64; 3] = self.set.start().into();
        format!("ReachableSet(start={start:?}, steps={})", self.set.steps())
    }
}

impl ReachableSet {
    fn under(
        start: Pose,
        lo: Vec<f64>,
        hi: Vec<f64>,
        speeds: Vec<SpeedRange>,
        step_s: f64,
    ) -> Result<Self, Error> {
        few_steps("lo", lo.len())?;
        let bounds = InputBounds::new(lo, hi, (f64::MIN, f64::MAX))?;
        let set =
            reach::ReachableSet::with_speeds(start, &bounds, speeds, step_s).map_err(named)?;
        Ok(Self { set, bounds, step_s })
    }

    /// Creates the reachable set of a vehicle at `start`.
    pub(crate) fn of(
        start: Pose,
        bounds: InputBounds,
        speed: impl Into<SpeedRange>,
        step_s: f64,
    ) -> Result<Self, Invalid> {
        let set = reach::ReachableSet::new(start, &bounds, speed, step_s)?;
        Ok(Self { set, bounds, step_s })
    }

    /// The lowest and the highest speed of all steps, or of each step (m/s).
    fn speeds(&self) -> Vec<[f64; 2]> {
        self.set.speeds().iter().map(|range| [range.lo_mps(), range.hi_mps()]).collect()
    }

    fn step(&self, step: i64) -> Result<usize, Error> {
        let found = count("step", 0, step)?;
        if found <= self.set.steps() {
            return Ok(found);
        }
        Err(Invalid::new("step", format!("0 to {}", self.set.steps()), step).into())
    }
}

/// The paper's speed (m/s).
const PAPERS: f64 = 2.0;

/// The argument `speed_mps`: a constant speed, or ranges of speeds.
#[derive(Clone)]
pub(crate) struct Speeds(Vec<SpeedRange>);

impl Speeds {
    /// The speeds of an argument that accepts no range for each step.
    pub(crate) fn of_all_steps(self) -> Result<SpeedRange, Error> {
        match self.0[..] {
            [range] => Ok(range),
            ref ranges => Err(wrong_shape("speed_mps", "a number or (2,)", &[ranges.len(), 2])),
        }
    }
}

impl From<f64> for Speeds {
    fn from(speed_mps: f64) -> Self {
        Self(vec![speed_mps.into()])
    }
}

impl<'py> FromPyObject<'_, 'py> for Speeds {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(speed_mps) = real(&object) {
            return Ok(speed_mps.into());
        }
        let Numbers { shape, values } = numbers("speed_mps", "a number, (2,) or (T, 2)", &object)?;
        if !matches!(shape[..], [2] | [_, 2]) || values.is_empty() {
            return Err(wrong_shape("speed_mps", "a number, (2,) or (T, 2)", &shape).into());
        }
        let ranges = values.chunks_exact(2).map(|range| SpeedRange::new(range[0], range[1]));
        let ranges: Result<_, Invalid> = ranges.collect();
        Ok(Self(ranges.map_err(Error::from)?))
    }
}

/// In an error, replaces the library's name of an argument by its name in Python.
fn named(invalid: Invalid) -> Invalid {
    match invalid.field.as_str() {
        "speeds" => Invalid { field: "speed_mps".to_owned(), ..invalid },
        _ => invalid,
    }
}

/// The reachable sets for m sets of bounds, as `bounds` returns them.
///
/// Speed and step length are the paper's unless given, because the bounds do not contain those of their
/// prediction. `Shfrs.sets` and `OnlinePredictor.sets` use the speed and step length of the prediction.
///
/// Parameters
/// ----------
/// start : array of float64, shape (3,)
///     The current pose (x, y, ψ) in the world frame (m, m, rad).
/// lo, hi : array of float64, shape (m, T), 1 ≤ T ≤ 100
///     Lowest and highest turn rate of each step (rad/s, left positive).
/// speed_mps : float, or array of float64, shape (2,) or (T, 2)
///     Speed, or lowest and highest speed (m/s), as for `ReachableSet`. By default the paper's.
/// step_s : float
///     Length of a step (s), > 0. By default the paper's.
///
/// Returns
/// -------
/// list of ReachableSet
///     The m sets.
#[pyfunction]
#[pyo3(
    name = "reach",
    signature = (start, lo, hi, speed_mps=PAPERS.into(), step_s=0.2),
    text_signature = "(start, lo, hi, speed_mps=2.0, step_s=0.2)"
)]
pub(crate) fn reach_all(
    start: &Bound<'_, PyAny>,
    lo: &Bound<'_, PyAny>,
    hi: &Bound<'_, PyAny>,
    speed_mps: Speeds,
    #[pyo3(from_py_with = real)] step_s: f64,
) -> Result<Vec<ReachableSet>, Error> {
    let start = pose("start", start)?;
    let [lo, hi] = [("lo", lo), ("hi", hi)].map(|(name, object)| {
        let found = numbers(name, "(m, T)", object)?;
        if matches!(found.shape[..], [_, steps] if steps > 0) {
            Ok(found)
        } else {
            Err(wrong_shape(name, "(m, T) with T ≥ 1", &found.shape))
        }
    });
    let (lo, hi) = (lo?, hi?);
    if lo.shape != hi.shape {
        return Err(wrong_shape("hi", &format!("{:?} as lo has", lo.shape), &hi.shape));
    }
    let steps = lo.shape[1];
    let sets = lo.values.chunks_exact(steps).zip(hi.values.chunks_exact(steps)).enumerate();
    sets.map(|(j, (lo, hi))| {
        let set = ReachableSet::under(start, lo.to_vec(), hi.to_vec(), speed_mps.0.clone(), step_s);
        set.map_err(|error| match error {
            Error::Invalid(invalid) => invalid.within(&format!("set {j}")).into(),
            raised => raised,
        })
    })
    .collect()
}

/// Reads one to `most` poses, one after each step.
pub(crate) fn drive(
    field: &str,
    most: usize,
    object: &Bound<'_, PyAny>,
) -> Result<Vec<Pose>, Error> {
    let states = poses(field, object)?;
    if !(1..=most).contains(&states.len()) {
        let expected = format!("(t, 3) with 1 ≤ t ≤ {most}");
        return Err(wrong_shape(field, &expected, &[states.len(), 3]));
    }
    Ok(states)
}

/// Draws a polygon and returns it as an array. With `return_margin`, also returns the margin.
fn polygon(
    py: Python<'_>,
    return_margin: bool,
    draw: impl Send + FnOnce(&mut Workspace, &mut Vec<[f64; 2]>) -> Outline,
) -> PyResult<Bound<'_, PyAny>> {
    let mut vertices = Vec::new();
    let outline = py.detach(|| draw(&mut Workspace::default(), &mut vertices));
    let polygon = points(py, &vertices)?;
    if return_margin {
        return (polygon, margin_m(outline)).into_bound_py_any(py);
    }
    Ok(polygon.into_any())
}

/// The margin by which a polygon was grown (m). Infinite for a polygon that does not follow the boundary.
pub(crate) fn margin_m(outline: Outline) -> f64 {
    match outline {
        Outline::Refined { margin_m } => margin_m,
        _ => f64::INFINITY,
    }
}

/// Settings for drawing polygons.
pub(crate) fn drawn(accuracy_m: f64, conservative: bool) -> Result<PolygonSettings, Error> {
    let settings = PolygonSettings::new(accuracy_m, 8)?;
    Ok(if conservative { settings.conservative() } else { settings })
}

pub(crate) fn tolerance(position_m: f64, heading_rad: f64) -> Result<Tolerance, Error> {
    for (name, value) in [("position_m", position_m), ("heading_rad", heading_rad)] {
        if !(value.is_finite() && value >= 0.0) {
            return Err(Invalid::new(name, "a finite number ≥ 0", value).into());
        }
    }
    Ok(Tolerance { position_m, heading_rad })
}
