//! A robot's plan, and its clearance from the positions where the human may be.

use pyo3::prelude::*;
use sidestep::bounds::InputBounds;
use sidestep::clearance::{
    ClearanceFinder, ClearanceSettings, Clearances, Footprint, HumanFuture, Plan, PlanLimits,
};
use sidestep::invalid::{Invalid, positive};
use sidestep::math::PI;
use sidestep::plausibility::Departure;
use sidestep::scene;
use sidestep::vehicle::{Pose, dubins};

use crate::arrays::{Array, Numbers, numbers, place, pose, poses, rows, shaped, wrong_shape};
use crate::error::Error;
use crate::scalars::real;

/// The arguments of a method that describe a plan.
pub(crate) struct Asked<'a, 'py> {
    pub(crate) plan: &'a Bound<'py, PyAny>,
    pub(crate) radius_m: f64,
    pub(crate) corners: Option<&'a Bound<'py, PyAny>>,
    pub(crate) most_speed_mps: Option<f64>,
    pub(crate) most_turn_rate_radps: Option<f64>,
}

/// A plan and the robot's footprint.
pub(crate) struct Planned {
    pub(crate) plan: Plan,
    pub(crate) footprint: Footprint,
}

impl Asked<'_, '_> {
    /// Checks a plan of the robot of `parameters`. The robot is at `now`.
    pub(crate) fn check(
        &self,
        now: Pose,
        parameters: &scene::SceneParameters,
    ) -> Result<Planned, Error> {
        let mut ahead = poses("plan", self.plan)?;
        // A plan that `drive` returned carries the length of its steps.
        let made_for = self.plan.getattr_opt("step_s")?.filter(|step_s| !step_s.is_none());
        if let Some(step_s) = made_for.map(|step_s| real(&step_s)).transpose()?
            && (step_s - parameters.step_s).abs() > 1e-9 * parameters.step_s
        {
            let expected = format!("steps of {} s, those of the prediction", parameters.step_s);
            let found = format!("steps of {step_s} s");
            return Err(Invalid::new("plan", expected, found).into());
        }
        ahead.insert(0, now);
        let robot = parameters.robot;
        let limits = PlanLimits::new(
            self.most_speed_mps.unwrap_or(robot.speed_mps),
            self.most_turn_rate_radps.unwrap_or(robot.turn_rate_radps),
        );
        limits.check()?;
        let steps = ahead.len();
        let plan = Plan::new(ahead, parameters.step_s, limits)
            .map_err(|invalid| of_array(invalid, steps))?;
        let footprint = match self.corners {
            None => Footprint::disc(self.radius_m)?,
            Some(corners) => {
                let corners = rows::<2>("corners", corners)?;
                if corners.shape.len() != 1 {
                    let shape = [&corners.shape[..], &[2]].concat();
                    return Err(wrong_shape("corners", "(n, 2)", &shape));
                }
                let hull = Footprint::polygon(corners.rows());
                let named = |name: &'static str| {
                    move |mut invalid: Invalid| {
                        invalid.field = invalid.field.replacen("points", name, 1);
                        invalid.field = invalid.field.replacen("margin_m", "radius_m", 1);
                        invalid
                    }
                };
                hull.map_err(named("corners"))?.grown(self.radius_m).map_err(named("corners"))?
            }
        };
        Ok(Planned { plan, footprint })
    }
}

/// Renames the fields of an error. The library's list of poses starts with the current pose, but the argument
/// `plan` does not contain it.
fn of_array(mut invalid: Invalid, poses: usize) -> Invalid {
    for i in (0..poses).rev() {
        let theirs = format!("poses[{i}]");
        let ours = match i.checked_sub(1) {
            Some(step) => format!("plan[{step}]"),
            None => "the present pose".to_owned(),
        };
        invalid.field = invalid.field.replace(&theirs, &ours);
        invalid.expected = invalid.expected.replace(&theirs, &ours);
    }
    if invalid.field == "poses" {
        invalid.field = "plan".to_owned();
    }
    invalid
}

impl Planned {
    /// The clearance from each set of a human at `now`. `departed` describes a last step that the vehicle
    /// cannot have driven.
    pub(crate) fn clearances(
        &self,
        now: Pose,
        sets: &[InputBounds],
        parameters: &scene::SceneParameters,
        settings: ClearanceSettings,
        departed: Option<Departure>,
    ) -> Result<Clearances, Invalid> {
        let speed = parameters.human.speed_mps.into();
        let future = HumanFuture { start: now, sets, speed, step_s: parameters.step_s };
        let mut finder = ClearanceFinder::new(settings);
        finder.find_unless(departed, &future, &self.plan, &self.footprint).cloned()
    }
}

/// The proven clearances as an array of shape (m, T).
pub(crate) fn proved<'py>(py: Python<'py>, found: &Clearances) -> PyResult<Array<'py>> {
    let sets = (0..found.sets()).flat_map(|set| found.by_step(set));
    let all = sets.map(|clearance| clearance.at_least_m).collect();
    shaped(py, all, &[found.sets(), found.steps()])
}

/// The plan of a robot that holds a speed and a turn rate in each step. `sidestep.drive` adds the length of
/// the steps to the plan.
///
/// Parameters
/// ----------
/// start : array of float64, shape (3,)
///     The robot's current pose (x, y, ψ) in the world frame (m, m, rad).
/// speed_mps : float, or array of float64 of the shape of `turn_rates`
///     Speed in each step (m/s); negative to drive backward.
/// turn_rates : array of float64, shape (…, T), T ≥ 1
///     Turn rate in each step (rad/s, left positive); at most half a turn per step. `clear` rejects exactly
///     half a turn.
/// step_s : float
///     Length of a step (s), > 0. Must be that of the prediction's parameters.
///
/// Returns
/// -------
/// array of float64, shape (…, T, 3)
///     The poses (x, y, ψ) after steps 1 … T in the world frame (m, m, rad), with ψ in (−π, π]. The current
///     pose is not included.
#[pyfunction]
#[pyo3(name = "drive")]
pub(crate) fn drive_all<'py>(
    start: &Bound<'py, PyAny>,
    speed_mps: &Bound<'py, PyAny>,
    turn_rates: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = real)] step_s: f64,
) -> Result<Array<'py>, Error> {
    let py = start.py();
    let start = pose("start", start)?;
    let step_s = positive("step_s", step_s)?;
    let Numbers { shape, values: rates } = numbers("turn_rates", "(…, T)", turn_rates)?;
    let steps = shape.last().copied().filter(|&steps| steps > 0);
    let steps = steps.ok_or_else(|| wrong_shape("turn_rates", "(…, T) with T ≥ 1", &shape))?;
    let speeds = numbers("speed_mps", "of turn_rates, or a number", speed_mps)?;
    let speeds = match speeds.values[..] {
        [speed] if speeds.shape.is_empty() => vec![speed; rates.len()],
        _ if speeds.shape == shape => speeds.values,
        _ => {
            let expected = format!("{shape:?} as turn_rates, or a number");
            return Err(wrong_shape("speed_mps", &expected, &speeds.shape));
        }
    };
    let mut found = Vec::with_capacity(3 * rates.len());
    let mut at = start;
    for (i, (&speed, &rate)) in speeds.iter().zip(&rates).enumerate() {
        if i % steps == 0 {
            at = start;
        }
        if (rate * step_s).abs() > PI {
            let expected = format!("at most half a turn in a step of {step_s} s");
            return Err(Invalid::new(place("turn_rates", i, &shape), expected, rate).into());
        }
        at = dubins::arc(at, speed, rate, step_s);
        at.check().map_err(|invalid| {
            invalid.within(&format!("the pose after {}", place("turn_rates", i, &shape)))
        })?;
        found.extend([at.x, at.y, at.psi]);
    }
    Ok(shaped(py, found, &[&shape[..], &[3]].concat())?)
}

/// The largest set that a plan is clear of in every step. The plan is then also clear of all smaller sets.
///
/// Parameters
/// ----------
/// clearances : array of float64, shape (m, T)
///     As returned by `Shfrs.clear` and `OnlinePredictor.clear` (m): for each set, smallest first, and each
///     step. −∞ means not clear of any set.
/// margin_m : float
///     A plan is clear of a set if its clearance exceeds this margin (m), ≥ 0.
///
/// Returns
/// -------
/// int or None
///     Index of the set from 0, as in `Shfrs.sets`. `None` if the plan is not clear of the smallest set.
#[pyfunction]
#[pyo3(signature = (clearances, margin_m=0.0))]
pub(crate) fn largest_clear(
    clearances: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = real)] margin_m: f64,
) -> Result<Option<usize>, Error> {
    let Numbers { shape, values } = clearances_or_nothing(clearances)?;
    let steps = match shape[..] {
        [_, steps] if steps > 0 => steps,
        _ => return Err(wrong_shape("clearances", "(m, T) with T ≥ 1", &shape)),
    };
    if !(margin_m.is_finite() && margin_m >= 0.0) {
        return Err(Invalid::new("margin_m", "a finite number ≥ 0", margin_m).into());
    }
    let clear = |set: &[f64]| set.iter().all(|&clearance_m| clearance_m > margin_m);
    Ok(values.chunks_exact(steps).rposition(clear))
}

/// Reads clearances, which can be −∞.
fn clearances_or_nothing(clearances: &Bound<'_, PyAny>) -> Result<Numbers, Error> {
    let numpy = clearances.py().import("numpy")?;
    // Replace −∞ by a finite number. Anything that is not an array of numbers is rejected below.
    let bounded = numpy.call_method1("maximum", (clearances, f64::MIN));
    numbers("clearances", "(m, T)", bounded.as_ref().unwrap_or(clearances))
}
