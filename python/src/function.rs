//! Value functions as objects: solving, evaluation and files.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::reachability::{
    self, ACCURACIES, CurveSettings, METHODS, Method, Nodes, Options, Progress, SolveError,
};
use sidestep::safety;
use sidestep::scene::{self, Evader};

use crate::arrays::{Array, Numbers, points, warn_of_degrees};
use crate::error::Error;
use crate::files::{read, write};
use crate::interrupt::Watch;
use crate::scalars::{self, horizon, real, some_real, some_whole};
use crate::value::{States, checked, state_of, value_of};
use crate::vehicles::{PursuitGame, SceneParameters};

/// The value function V of a game at any relative state, created by `solve`.
#[pyclass(frozen, eq, from_py_object, module = "sidestep")]
#[derive(Clone, PartialEq)]
pub(crate) struct ValueFunction(pub(crate) reachability::ValueFunction);

#[pymethods]
impl ValueFunction {
    /// V at many states.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (…, 3)
    ///     The pursuer's poses (x, y, ψ) in the evader's frame (m, m, rad).
    /// threads : int, optional
    ///     Maximum number of threads; by default the number of processors.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (…,)
    ///     V (m). If V ≤ 0, the pursuer can force a collision.
    #[pyo3(signature = (states, *, threads=None))]
    fn value<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<Array<'py>, Error> {
        value_of(states, &self.0, threads)
    }

    /// V, its gradient and the optimal turns at many states.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (…, 3)
    ///     The pursuer's poses (x, y, ψ) in the evader's frame (m, m, rad).
    /// threads : int, optional
    ///     Maximum number of threads; by default the number of processors.
    ///
    /// Returns
    /// -------
    /// value : array of float64, shape (…,)
    ///     V (m).
    /// gradient : array of float64, shape (…, 3)
    ///     (∂V/∂x, ∂V/∂y, ∂V/∂ψ) in m/m, m/m and m/rad; one-sided where V has a kink.
    /// turns : array of float64, shape (…, 2)
    ///     Optimal turn rates of the evader and of the pursuer (rad/s, left positive).
    /// inside : array of bool, shape (…,)
    ///     Whether the state is inside the solved grid, `domain`. Outside, V is an estimate and may be metres
    ///     too large: it is the range less the radius, plus the deficit at the nearest point of the grid's
    ///     boundary. In that case, solve with a larger `range_m`. Inside, V is the grid's value. For a faster
    ///     pursuer, a larger grid may give other values, see `solve`.
    #[pyo3(signature = (states, *, threads=None))]
    fn state<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<States<'py>, Error> {
        state_of(states, &self.0, threads)
    }

    /// The gradient of V at many states.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (…, 3)
    ///     The pursuer's poses (x, y, ψ) in the evader's frame (m, m, rad).
    /// threads : int, optional
    ///     Maximum number of threads; by default the number of processors.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (…, 3)
    ///     (∂V/∂x, ∂V/∂y, ∂V/∂ψ) in m/m, m/m and m/rad; one-sided where V has a kink.
    #[pyo3(signature = (states, *, threads=None))]
    fn gradient<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<Array<'py>, Error> {
        Ok(state_of(states, &self.0, threads)?.1)
    }

    /// The sublevel set {V ≤ level} at one relative heading, as polygons.
    ///
    /// Parameters
    /// ----------
    /// psi : float
    ///     The pursuer's heading relative to the evader's (rad).
    /// level : float
    ///     The level (m). Must be above −R: at or below −R the set is at most the point where both vehicles
    ///     are.
    /// flatness_m : float
    ///     For the closed form: maximum distance between the curve and an edge (m), at least 10⁻⁶ R. A curve
    ///     hundreds of radii long may exceed it, because a polygon has at most a few thousand points.
    /// spacing_m : float
    ///     For a solved grid: maximum distance between neighbouring points (m), at least 10⁻³ R.
    ///
    /// Returns
    /// -------
    /// list of array of float64, shape (n, 2)
    ///     Closed polygons (x, y) in the evader's frame (m), with the set on their left. The first vertex is
    ///     not repeated. The list is empty if the set is empty. A set that extends beyond the grid, `domain`,
    ///     is closed along the grid's edge.
    #[pyo3(signature = (psi, level=0.0, *, flatness_m=0.01, spacing_m=0.15))]
    fn level_curves<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = real)] psi: f64,
        #[pyo3(from_py_with = real)] level: f64,
        #[pyo3(from_py_with = real)] flatness_m: f64,
        #[pyo3(from_py_with = real)] spacing_m: f64,
    ) -> Result<Vec<Bound<'py, PyArray2<f64>>>, Error> {
        warn_of_degrees(py, "psi", &Numbers { shape: Vec::new(), values: vec![psi] }, 1)?;
        let radius_m = self.0.game().radius_m;
        for (name, fine, least) in
            [("flatness_m", flatness_m, 1e-6 * radius_m), ("spacing_m", spacing_m, 1e-3 * radius_m)]
        {
            if !(fine.is_finite() && fine >= least) {
                return Err(Invalid::new(name, format!("a number ≥ {least} m"), fine).into());
            }
        }
        let settings = CurveSettings::default().with_flatness(flatness_m).with_spacing(spacing_m);
        let curves = py.detach(|| self.0.level_curves(psi, level, settings))?;
        Ok(curves.iter().map(|curve| points(py, curve)).collect::<PyResult<_>>()?)
    }

    /// The game.
    #[getter]
    fn game(&self) -> PursuitGame {
        PursuitGame(self.0.game())
    }

    /// Whether V is the closed form.
    #[getter]
    fn exact(&self) -> bool {
        matches!(self.0, reachability::ValueFunction::Exact(_))
    }

    /// Duration of the game (s). Infinite for the converged value.
    #[getter]
    fn horizon_s(&self) -> f64 {
        match &self.0 {
            reachability::ValueFunction::Exact(_) => f64::INFINITY,
            reachability::ValueFunction::Sampled(sampled) => sampled.horizon_s(),
        }
    }

    /// How much V still changed (m) when the solver stopped without converging. `None` if it converged or the
    /// horizon is finite. This is not an error bound: the difference from the converged value is unknown, and
    /// in a chase it can be much larger. For a faster pursuer V also depends on the range of the grid, see
    /// `solve`.
    #[getter]
    fn unsettled_m(&self) -> Option<f64> {
        self.0.unsettled_m()
    }

    /// Extent of the solver's grid: the lowest and the highest value of its coordinates (m).
    ///
    /// In the evader's frame: `{"range": (0.0, …)}` in polar coordinates, and `{"x": (…, …), "y": (…, …)}`
    /// for a rectangular grid. Headings cover the full circle. `None` for the closed form, which is valid
    /// everywhere.
    #[getter]
    fn domain(&self) -> Option<BTreeMap<&'static str, (f64, f64)>> {
        let reachability::ValueFunction::Sampled(sampled) = &self.0 else {
            return None;
        };
        Some(match sampled.nodes() {
            Nodes::Polar { range_m, .. } => BTreeMap::from([("range", (0.0, range_m))]),
            Nodes::Cartesian { x, y, .. } => {
                BTreeMap::from([("x", (x.low, x.high)), ("y", (y.low, y.high))])
            }
        })
    }

    /// Writes the function to a file, which `load`, the command `sidestep` and the laboratory can read.
    ///
    /// `load` returns an equal function (`==`). With `rounded`, the values on the nodes of a solved grid are
    /// rounded to a millimetre (for a radius of about 3 m), and the file is a third as large. Saving a
    /// rounded function again does not change it. The closed form is never rounded.
    ///
    /// Parameters
    /// ----------
    /// path : path
    /// rounded : bool
    ///     Whether to round, as the laboratory's files do.
    #[pyo3(signature = (path, *, rounded=false))]
    fn save(&self, py: Python<'_>, path: PathBuf, rounded: bool) -> Result<(), Error> {
        let function = &self.0;
        py.detach(|| {
            let bytes =
                if rounded { function.encode_with_checksum() } else { function.encode_unrounded() };
            write(&path, &bytes)
        })
    }

    /// Reads a function from a file that `save` wrote.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the file is not a value function, is truncated, damaged or larger than 4 GiB, or has another
    ///     format version.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> Result<Self, Error> {
        py.detach(|| Self::from_bytes(&read(&path)?))
    }

    /// Restores a function from the bytes that `__reduce__` returned.
    #[staticmethod]
    #[pyo3(name = "_from_bytes")]
    fn unpickled(bytes: Cow<'_, [u8]>) -> Result<Self, Error> {
        Self::from_bytes(&bytes)
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = PyBytes::new(slf.py(), &slf.get().0.encode_unrounded());
        Ok((slf.get_type().getattr("_from_bytes")?, (bytes,)))
    }

    /// Returns itself, because it is immutable.
    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    /// Returns itself, because it is immutable.
    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    fn __repr__(&self) -> String {
        format!("ValueFunction({}, horizon_s={})", self.game().__repr__(), self.horizon_s())
    }
}

impl ValueFunction {
    fn from_bytes(bytes: &[u8]) -> Result<Self, Error> {
        // The file's header is a JSON object.
        if bytes.first() != Some(&b'{') {
            let expected = "a file of `ValueFunction.save`";
            return Err(Invalid::new("value function", expected, "other bytes").into());
        }
        let named = |invalid: Invalid| {
            let already = invalid.field.starts_with("value function");
            if already { invalid } else { invalid.within("value function") }
        };
        Ok(Self(reachability::ValueFunction::decode(bytes).map_err(named)?))
    }
}

/// Solves for the value function of a game. Ctrl-C cancels the solve.
///
/// The grid is bounded. For a finite horizon, it just covers the states where V is at most half the radius.
/// Outside, V is an estimate that may be metres too large (`ValueFunction.state`). `range_m` sets another
/// extent.
///
/// Without a horizon, a faster pursuer may win chases that lead beyond the edge of the grid. The solver
/// counts such a chase as an escape. V is then metres too large at its initial state and along the chase,
/// although `inside` is true and `unsettled_m` is small or `None`. Solve again with twice the `range_m` and a
/// finer `accuracy`. Where V changes by more than you can tolerate, the range was too small.
///
/// Parameters
/// ----------
/// game : PursuitGame
/// horizon_s : float
///     Duration of the game (s), > 0. The default, infinity, gives the converged value.
/// method : {"exact", "polar", "cartesian"}, optional
///     By default the best one: the closed form for identical vehicles and an infinite horizon, otherwise
///     polar coordinates.
/// accuracy : {"draft", "standard", "fine"}
///     Determines the number of nodes of the grid.
/// range_m : float, optional
///     The maximum range of the polar method (m), above the radius. `ValueFunction.domain` shows the default.
///     A larger range has the same number of nodes, with a larger spacing.
/// threads : int, optional
///     Maximum number of threads for a finite horizon or the Cartesian method; by default the number of
///     processors.
/// progress : callable, optional
///     Called as `progress(done, residual)` about ten times a second, with the share of the steps that are
///     done (0 to 1) and the largest change of V per second. For a finite horizon, the residual says nothing
///     about accuracy. If `progress` raises an exception, the solve stops.
///
/// Returns
/// -------
/// ValueFunction
#[pyfunction]
#[pyo3(signature = (game, horizon_s=f64::INFINITY, method=None, *, accuracy="standard", range_m=None, threads=None, progress=None))]
#[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
pub(crate) fn solve(
    py: Python<'_>,
    game: &PursuitGame,
    #[pyo3(from_py_with = horizon)] horizon_s: f64,
    method: Option<&str>,
    #[pyo3(from_py_with = scalars::accuracy)] accuracy: &str,
    #[pyo3(from_py_with = some_real)] range_m: Option<f64>,
    #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> Result<ValueFunction, Error> {
    let options = Options::default()
        .with_method(method.map(|method| named("method", METHODS, method)).transpose()?)
        .with_accuracy(named("accuracy", ACCURACIES, accuracy)?)
        .with_horizon(horizon_s)
        .with_range(range_m)
        .with_threads(checked(threads)?);
    let game = game.0;
    let chosen = options.method_for(&game)?;
    if let (Some(range_m), Method::Exact | Method::Cartesian) = (range_m, chosen) {
        let expected = format!("None with the method {}, or the method polar", chosen.name());
        return Err(Invalid::new("range_m", expected, range_m).into());
    }
    let solved =
        watched(py, progress.as_ref(), |report| reachability::solve(game, &options, report))?;
    Ok(ValueFunction(solved.function))
}

/// The value functions for the safety levels of both vehicles of a scene.
///
/// Parameters
/// ----------
/// parameters : SceneParameters
///     If the vehicles differ, both games are solved, which takes several seconds. Ctrl-C cancels the solve.
/// progress : callable, optional
///     As for `solve`, for one game after the other.
#[pyclass(frozen, eq, from_py_object, module = "sidestep")]
#[derive(Clone, PartialEq)]
pub(crate) struct SafetyLevels(pub(crate) safety::SafetyLevels);

#[pymethods]
impl SafetyLevels {
    #[new]
    #[pyo3(signature = (parameters, *, progress=None))]
    fn new(
        py: Python<'_>,
        parameters: &SceneParameters,
        progress: Option<Py<PyAny>>,
    ) -> Result<Self, Error> {
        let parameters = parameters.0;
        let solve = |report: &mut Report<'_>| safety::SafetyLevels::solve(&parameters, report);
        watched(py, progress.as_ref(), solve).map(Self)
    }

    /// Creates safety levels from these two functions.
    #[staticmethod]
    #[pyo3(name = "_of")]
    fn of(human: ValueFunction, robot: ValueFunction) -> Self {
        Self(safety::SafetyLevels { human: human.0, robot: robot.0 })
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (ValueFunction, ValueFunction))> {
        Ok((slf.get_type().getattr("_of")?, (slf.get().human(), slf.get().robot())))
    }

    /// V_HR, in which the human evades. Its states are the robot's poses in the human's frame.
    #[getter]
    fn human(&self) -> ValueFunction {
        ValueFunction(self.0.human.clone())
    }

    /// V_RH, in which the robot evades. Its states are the human's poses in the robot's frame.
    #[getter]
    fn robot(&self) -> ValueFunction {
        ValueFunction(self.0.robot.clone())
    }
}

/// The safety levels that `features` need in a scene with these parameters. Checks that `given` fits them.
pub(crate) fn levels(
    features: &FeatureSet,
    parameters: &scene::SceneParameters,
    given: Option<SafetyLevels>,
) -> Result<safety::SafetyLevels, Error> {
    if let Some(SafetyLevels(given)) = given {
        let right =
            Evader::ALL.iter().all(|&evader| given.of(evader).game() == parameters.game(evader));
        if right {
            return Ok(given);
        }
        let found = "those of other parameters";
        return Err(Invalid::new("safety", "the safety levels of `parameters`", found).into());
    }
    let identical = parameters.game(Evader::Human).identical();
    let needed = features.of_game().filter(|_| !identical);
    if let Some(feature) = needed {
        let expected = format!(
            "SafetyLevels(parameters), since the feature {} needs them and the vehicles differ",
            feature.name
        );
        return Err(Invalid::new("safety", expected, "None").into());
    }
    // If no feature needs a safety level, any levels will do, so use the levels of two robots. If
    // the vehicles are identical, these are the levels of the scene.
    let alike = scene::SceneParameters { human: parameters.robot, ..*parameters };
    let exact = alike.game(Evader::Human).exact()?;
    let function = reachability::ValueFunction::Exact(exact);
    Ok(safety::SafetyLevels { human: function.clone(), robot: function })
}

/// Callback for a solver's progress.
pub(crate) type Report<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

/// Runs a solver while the interpreter is released, and calls `progress` at intervals. Stops if the user
/// presses Ctrl-C or `progress` raises an exception.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    solver: impl FnOnce(&mut Report<'_>) -> Result<T, SolveError> + Send,
) -> Result<T, Error> {
    if let Some(progress) = progress.map(|progress| progress.bind(py))
        && !progress.is_callable()
    {
        return Err(Invalid::new("progress", "a callable, or None", progress.get_type()).into());
    }
    let mut watch = Watch::new();
    let solved = py.detach(|| {
        solver(&mut |report: Progress| {
            watch.tell(|py| {
                progress.map_or(Ok(()), |progress| {
                    progress.call1(py, (report.done, report.residual)).map(drop)
                })
            })
        })
    });
    watch.end()?;
    match solved {
        Ok(solved) => Ok(solved),
        Err(SolveError::Invalid(invalid)) => Err(invalid.into()),
        Err(ended) => Err(Invalid::new("progress", "a solve that goes on", ended).into()),
    }
}

/// Looks up a word in a table.
pub(crate) fn named<T: Copy>(
    field: &str,
    table: &[(&str, T, &str)],
    word: &str,
) -> Result<T, Error> {
    let found = table.iter().find(|(name, ..)| *name == word).map(|&(_, entry, _)| entry);
    found.ok_or_else(|| {
        let names: Vec<_> = table.iter().map(|(name, ..)| *name).collect();
        Invalid::new(field, format!("one of {}", names.join(", ")), word).into()
    })
}
