//! A robot's plan: how far it stays clear of where the human may be.

use pyo3::prelude::*;
use sidestep::bounds::InputBounds;
use sidestep::invalid::Invalid;
use sidestep::planner::{
    ClearanceFinder, ClearanceSettings, Clearances, Footprint, HumanFuture, Plan, PlanLimits,
};
use sidestep::scene;
use sidestep::vehicle::Pose;

use crate::arrays::{Array, poses, rows, shaped, wrong_shape};
use crate::error::Error;

/// A plan, as methods take it.
pub(crate) struct Asked<'a, 'py> {
    pub(crate) plan: &'a Bound<'py, PyAny>,
    pub(crate) radius_m: f64,
    pub(crate) corners: Option<&'a Bound<'py, PyAny>>,
    pub(crate) most_speed_mps: Option<f64>,
    pub(crate) most_turn_rate_radps: Option<f64>,
}

/// A plan and the ground that the robot covers.
pub(crate) struct Planned {
    pub(crate) plan: Plan,
    pub(crate) footprint: Footprint,
}

impl Asked<'_, '_> {
    /// The plan of the robot of `parameters`, which is at `now`.
    pub(crate) fn check(
        &self,
        now: Pose,
        parameters: &scene::SceneParameters,
    ) -> Result<Planned, Error> {
        let mut ahead = poses("plan", self.plan)?;
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

/// Restates a complaint about a list of poses, whose first is the present one, in terms of the plan alone.
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
    /// The clearance from each of the sets of a human who is at `now`.
    pub(crate) fn clearances(
        &self,
        now: Pose,
        sets: &[InputBounds],
        parameters: &scene::SceneParameters,
        settings: ClearanceSettings,
    ) -> Result<Clearances, Invalid> {
        let speed_mps = parameters.human.speed_mps;
        let future = HumanFuture { start: now, sets, speed_mps, step_s: parameters.step_s };
        let mut finder = ClearanceFinder::new(settings);
        finder.find(&future, &self.plan, &self.footprint).cloned()
    }
}

/// The proved clearances as an array of shape (m, T).
pub(crate) fn proved<'py>(py: Python<'py>, found: &Clearances) -> PyResult<Array<'py>> {
    let sets = (0..found.sets()).flat_map(|set| found.by_step(set));
    let all = sets.map(|clearance| clearance.at_least_m).collect();
    shaped(py, all, &[found.sets(), found.steps()])
}
