//! Trajectories of the human and the robot, recorded or simulated.

use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::window;
use sidestep::synthetic::{Keys, SyntheticParticipant};

use crate::arrays::{Array, count, joint_states, list, states_array};
use crate::error::Error;
use crate::scalars::{seed, whole};

/// A trajectory that a person drove: joint states, and the human's turn rates between them.
///
/// Parameters
/// ----------
/// states : array of float64, shape (T + 1, 2, 3), T ≥ 1
///     The poses (x, y, ψ) of the human and of the robot before each step and after the last, in the world
///     frame (m, m, rad).
/// turn_rates : array of float64, shape (T,)
///     The human's turn rate in each step (rad/s, left positive).
#[pyclass(frozen, eq, from_py_object, module = "sidestep")]
#[derive(Clone, PartialEq)]
pub(crate) struct Trajectory(pub(crate) window::Trajectory);

#[pymethods]
impl Trajectory {
    #[new]
    fn new(states: &Bound<'_, PyAny>, turn_rates: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let states = joint_states("states", 2, states)?;
        Ok(Self(window::Trajectory::new(states, list("turn_rates", turn_rates)?)?))
    }

    /// The number of steps T.
    #[getter]
    fn steps(&self) -> usize {
        self.0.steps()
    }

    /// The poses (x, y, ψ) of the human and of the robot before each step and after the last, shape (T + 1, 2, 3).
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        states_array(py, self.0.states())
    }

    /// The human's turn rate in each step (rad/s, left positive), shape (T,).
    #[getter]
    fn turn_rates<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0.turn_rates().to_vec().into_pyarray(py)
    }

    fn __hash__(&self) -> usize {
        self.0.steps()
    }

    fn __getnewargs__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Array<'py>, Bound<'py, PyArray1<f64>>)> {
        Ok((self.states(py)?, self.turn_rates(py)))
    }

    fn __repr__(&self) -> String {
        format!("Trajectory(steps={})", self.0.steps())
    }
}

/// Trials of synthetic participants in scenes of the paper's study, for testing programs.
///
/// The participants follow published models of pedestrians. Results on these trials say nothing about people.
///
/// Parameters
/// ----------
/// participants : int
///     Number of participants, ≥ 1.
/// tasks : int
///     Number of trials of each participant, ≥ 1. A trial has 50 steps of 0.2 s.
/// seed : int
///     Seed for the population, ≥ 0.
///
/// Returns
/// -------
/// list of list of Trajectory
///     The trials of each participant.
#[pyfunction]
#[pyo3(signature = (participants, tasks, *, seed=0))]
pub(crate) fn simulate(
    py: Python<'_>,
    #[pyo3(from_py_with = whole)] participants: i64,
    #[pyo3(from_py_with = whole)] tasks: i64,
    #[pyo3(from_py_with = seed)] seed: u64,
) -> Result<Vec<Vec<Trajectory>>, Error> {
    let (participants, tasks) =
        (count("participants", 1, participants)?, count("tasks", 1, tasks)?);
    let parameters = SceneParameters::default();
    let drive = |number: usize, task: usize| {
        py.check_signals()?;
        let participant = SyntheticParticipant::new(seed, number as u64);
        let (_, drive) = py.detach(|| participant.own_trial(task as u64, Keys::Clock));
        let driven = window::Trajectory::driven(drive.states, &drive.inputs, &parameters);
        Ok(Trajectory(driven?))
    };
    let trials = |number| (0..tasks).map(|task| drive(number, task)).collect();
    (0..participants).map(trials).collect()
}
