//! Reachable sets under guessed bounds, widened by ε.

use super::Nominal;
use crate::bounds::{
    ActionChoice, ActionModel, BoundsSettings, InputBounds, Rollout, input_bounds,
};
use crate::invalid::Invalid;
use crate::reach::polygon::signed_area;
use crate::reach::{PolygonSettings, ReachableSet};
use crate::scene::SceneParameters;
use crate::shfrs::family::Family;
use crate::shfrs::window::Window;
use crate::vehicle::Pose;

/// F of base bounds that are widened by the level ε, rad/s, and clipped to what the vehicle
/// can do. `base` gives the lowest and highest turn rate of each step of a window, rad/s.
struct WidenedInputs<B> {
    name: &'static str,
    parameters: SceneParameters,
    most: f64,
    base: B,
}

/// Everything the human can reach. One set, whatever the level: coverage 1.
pub fn worst_case(parameters: &SceneParameters) -> impl Family + Send + use<> {
    let rate = parameters.human.turn_rate_radps;
    WidenedInputs {
        name: "worst case",
        parameters: *parameters,
        most: 0.0,
        base: move |window: &Window<'_>| Ok(vec![(-rate, rate); window.steps()]),
    }
}

/// The human goes straight on, give or take ε: a cone about the present velocity.
pub fn constant_velocity(parameters: &SceneParameters) -> impl Family + Send + use<> {
    let rate = parameters.human.turn_rate_radps;
    around(Nominal::Straight, "constant velocity", rate, parameters)
}

/// The human holds the input of the last step, give or take ε.
pub fn hold_the_input(parameters: &SceneParameters) -> impl Family + Send + use<> {
    let rate = parameters.human.turn_rate_radps;
    around(Nominal::Held, "hold the input", 2.0 * rate, parameters)
}

fn around(
    nominal: Nominal,
    name: &'static str,
    most: f64,
    parameters: &SceneParameters,
) -> impl Family + Send + use<> {
    let human = parameters.human;
    let base = move |window: &Window<'_>| {
        let rate = nominal.turn_rate(window, human);
        Ok(vec![(rate, rate); window.steps()])
    };
    WidenedInputs { name, parameters: *parameters, most, base }
}

/// A nominal prediction with a bounded disturbance, after Govindarajan, Driggs-Campbell and
/// Bajcsy, *Data-driven reachability analysis for human-in-the-loop systems* (CDC 2017).
///
/// Taken from there: the human is a nominal model plus a disturbance of its input; the bound
/// of the disturbance is found from recorded drives, as the smallest that the asked accuracy
/// (coverage) allows; the prediction is the forward reachable set.
/// Not taken: their driving scenario and vehicle model, several bounds at once, the second
/// constraint on *risk*, and the level-set computation. Here the nominal model is `model`'s
/// most likely action at each coming step, driven forward on its own predictions (both ways
/// where actions tie), and the one bound is the level ε, rad/s. So it is Algorithm 1 with
/// k = 1: a prediction *after* theirs, no reproduction.
pub fn learned_disturbance<M: ActionModel + Send>(
    parameters: &SceneParameters,
    model: M,
) -> impl Family + Send + use<M> {
    let own = *parameters;
    let base = move |window: &Window<'_>| {
        let choice = ActionChoice::TopK(vec![1; window.steps()]);
        let actions = model.actions().len();
        let settings = BoundsSettings::new(vec![0.0], choice, Rollout::Base, actions)?;
        Ok(input_bounds(window.history(), &own, &model, |_| 0.0, &settings)?.raw)
    };
    let most = 2.0 * parameters.human.turn_rate_radps;
    WidenedInputs { name: "learned disturbance", parameters: *parameters, most, base }
}

impl<B: FnMut(&Window<'_>) -> Result<Vec<(f64, f64)>, Invalid>> WidenedInputs<B> {
    fn widened(&self, base: &[(f64, f64)], epsilon: f64) -> Result<InputBounds, Invalid> {
        let rate = self.parameters.human.turn_rate_radps;
        let lo = base.iter().map(|&(lo, _)| (lo - epsilon).max(-rate)).collect();
        let hi = base.iter().map(|&(_, hi)| (hi + epsilon).min(rate)).collect();
        InputBounds::new(lo, hi, (-rate, rate))
    }
}

impl<B: FnMut(&Window<'_>) -> Result<Vec<(f64, f64)>, Invalid>> Family for WidenedInputs<B> {
    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn most(&self) -> f64 {
        self.most
    }

    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid> {
        let base = (self.base)(window)?;
        let lacking = |(&rate, &(lo, hi)): (&f64, &(f64, f64))| (lo - rate).max(rate - hi);
        let needed = window.turn_rates().iter().zip(&base).map(lacking).fold(0.0, f64::max);
        Ok(needed.min(self.most))
    }

    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
        let base = (self.base)(window)?;
        tube_area(&self.parameters, &self.widened(&base, level)?)
    }
}

/// Area, m², of everything the human can reach within `steps`.
///
/// # Errors
/// [`Invalid`] if there is no step.
pub(super) fn worst_case_area(parameters: &SceneParameters, steps: usize) -> Result<f64, Invalid> {
    let rate = parameters.human.turn_rate_radps;
    let bounds = InputBounds::new(vec![-rate; steps], vec![rate; steps], (-rate, rate))?;
    tube_area(parameters, &bounds)
}

fn tube_area(parameters: &SceneParameters, bounds: &InputBounds) -> Result<f64, Invalid> {
    let SceneParameters { human, step_s, .. } = *parameters;
    let set = ReachableSet::new(Pose::new(0.0, 0.0, 0.0), bounds, human.speed_mps, step_s)?;
    Ok(signed_area(&set.tube_polygon(PolygonSettings::default())))
}
