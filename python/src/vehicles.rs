//! Vehicles, the pursuit game of two vehicles, and the parameters of a scene.

use pyo3::prelude::*;
use sidestep::reachability;
use sidestep::scene;
use sidestep::vehicle;

use crate::arrays::count;
use crate::error::Error;
use crate::scalars::{real, whole};

/// A Dubins car, with constant speed and bounded turn rate.
///
/// Parameters
/// ----------
/// speed_mps : float
///     Speed v (m/s), > 0.
/// turn_rate_radps : float
///     Maximum turn rate ω (rad/s), > 0, to either side.
#[pyclass(frozen, eq, hash, from_py_object, module = "sidestep")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct VehicleModel(pub(crate) vehicle::VehicleModel);

/// Hashes the bits. Equal numbers have equal bits here, because they are finite and > 0.
impl std::hash::Hash for VehicleModel {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        (self.0.speed_mps.to_bits(), self.0.turn_rate_radps.to_bits()).hash(state);
    }
}

#[pymethods]
impl VehicleModel {
    #[new]
    fn new(
        #[pyo3(from_py_with = real)] speed_mps: f64,
        #[pyo3(from_py_with = real)] turn_rate_radps: f64,
    ) -> Result<Self, Error> {
        let model = vehicle::VehicleModel { speed_mps, turn_rate_radps };
        model.check()?;
        Ok(Self(model))
    }

    /// Speed v (m/s).
    #[getter]
    fn speed_mps(&self) -> f64 {
        self.0.speed_mps
    }

    /// Maximum turn rate ω (rad/s).
    #[getter]
    fn turn_rate_radps(&self) -> f64 {
        self.0.turn_rate_radps
    }

    fn __getnewargs__(&self) -> (f64, f64) {
        (self.0.speed_mps, self.0.turn_rate_radps)
    }

    pub(crate) fn __repr__(&self) -> String {
        let vehicle::VehicleModel { speed_mps, turn_rate_radps } = self.0;
        format!("VehicleModel(speed_mps={speed_mps}, turn_rate_radps={turn_rate_radps})")
    }
}

/// A pursuit game: an evader, a pursuer, and the range at which the evader is caught.
///
/// The evader maximises the minimum distance, and the pursuer minimises it. A state is the pursuer's pose (x,
/// y, ψ) in the evader's frame: x ahead and y to the left (m), and the pursuer's heading ψ relative to the
/// evader's (rad, counter-clockwise).
///
/// Parameters
/// ----------
/// evader, pursuer : VehicleModel
/// radius_m : float
///     Danger radius R (m), > 0.
#[pyclass(frozen, eq, hash, from_py_object, module = "sidestep")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct PursuitGame(pub(crate) reachability::PursuitGame);

impl std::hash::Hash for PursuitGame {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        let reachability::PursuitGame { evader, pursuer, radius_m } = self.0;
        (VehicleModel(evader), VehicleModel(pursuer), radius_m.to_bits()).hash(state);
    }
}

#[pymethods]
impl PursuitGame {
    #[new]
    fn new(
        evader: VehicleModel,
        pursuer: VehicleModel,
        #[pyo3(from_py_with = real)] radius_m: f64,
    ) -> Result<Self, Error> {
        let game = reachability::PursuitGame { evader: evader.0, pursuer: pursuer.0, radius_m };
        Ok(Self(game.check()?))
    }

    /// The vehicle that evades.
    #[getter]
    fn evader(&self) -> VehicleModel {
        VehicleModel(self.0.evader)
    }

    /// The vehicle that pursues.
    #[getter]
    fn pursuer(&self) -> VehicleModel {
        VehicleModel(self.0.pursuer)
    }

    /// Danger radius R (m).
    #[getter]
    fn radius_m(&self) -> f64 {
        self.0.radius_m
    }

    /// Whether both vehicles have the same speed and turn rate, so that V has a closed form.
    #[getter]
    fn identical(&self) -> bool {
        self.0.identical()
    }

    fn __getnewargs__(&self) -> (VehicleModel, VehicleModel, f64) {
        (self.evader(), self.pursuer(), self.0.radius_m)
    }

    pub(crate) fn __repr__(&self) -> String {
        let [evader, pursuer] = [self.evader(), self.pursuer()].map(|model| model.__repr__());
        format!("PursuitGame(evader={evader}, pursuer={pursuer}, radius_m={})", self.0.radius_m)
    }
}

/// The parameters of a scene: both vehicles, the danger radius and the steps. The defaults are the paper's.
///
/// Parameters
/// ----------
/// human, robot : VehicleModel, optional
///     By default 2 m/s and 0.5 rad/s.
/// danger_radius_m : float
///     Danger radius R_c (m), > 0.
/// step_s : float
///     Length of a step (s), > 0.
/// steps : int
///     Number of steps of a trial, 1 to 3000. Predictions do not depend on it.
#[pyclass(frozen, eq, from_py_object, module = "sidestep")]
#[derive(Clone, Copy, Default, PartialEq)]
pub(crate) struct SceneParameters(pub(crate) scene::SceneParameters);

#[pymethods]
impl SceneParameters {
    #[new]
    #[pyo3(signature = (human=None, robot=None, danger_radius_m=3.0, step_s=0.2, steps=50))]
    fn new(
        human: Option<VehicleModel>,
        robot: Option<VehicleModel>,
        #[pyo3(from_py_with = real)] danger_radius_m: f64,
        #[pyo3(from_py_with = real)] step_s: f64,
        #[pyo3(from_py_with = whole)] steps: i64,
    ) -> Result<Self, Error> {
        let steps = count("steps", 1, steps)?;
        let usual = scene::SceneParameters::default();
        let model = |given: Option<VehicleModel>, usual| given.map_or(usual, |given| given.0);
        let (human, robot) = (model(human, usual.human), model(robot, usual.robot));
        let parameters = scene::SceneParameters { human, robot, danger_radius_m, step_s, steps };
        parameters.check()?;
        Ok(Self(parameters))
    }

    /// The vehicle of the human.
    #[getter]
    fn human(&self) -> VehicleModel {
        VehicleModel(self.0.human)
    }

    /// The vehicle of the robot.
    #[getter]
    fn robot(&self) -> VehicleModel {
        VehicleModel(self.0.robot)
    }

    /// Danger radius R_c (m).
    #[getter]
    fn danger_radius_m(&self) -> f64 {
        self.0.danger_radius_m
    }

    /// Length of a step (s).
    #[getter]
    fn step_s(&self) -> f64 {
        self.0.step_s
    }

    /// Number of steps of a trial.
    #[getter]
    fn steps(&self) -> usize {
        self.0.steps
    }

    fn __getnewargs__(&self) -> (VehicleModel, VehicleModel, f64, f64, usize) {
        let scene::SceneParameters { danger_radius_m, step_s, steps, .. } = self.0;
        (self.human(), self.robot(), danger_radius_m, step_s, steps)
    }

    pub(crate) fn __repr__(&self) -> String {
        let [human, robot] = [self.human(), self.robot()].map(|model| model.__repr__());
        let scene::SceneParameters { danger_radius_m, step_s, steps, .. } = self.0;
        format!(
            "SceneParameters(human={human}, robot={robot}, danger_radius_m={danger_radius_m}, \
             step_s={step_s}, steps={steps})"
        )
    }
}
