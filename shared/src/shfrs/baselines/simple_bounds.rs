//! Reachable sets under simple bounds, widened by ε.

use super::Nominal;
use crate::bounds::{ActionChoice, ActionModel, BoundsSettings, Rollout, input_bounds};
use crate::invalid::Invalid;
use crate::reach::Tolerance;
use crate::scene::SceneParameters;
use crate::shfrs::family::Family;
use crate::shfrs::widened::{least_widening, tube_area_m2, widened};
use crate::shfrs::window::Window;

/// Reachable sets under base bounds that are widened by the level ε (rad/s), but not beyond the
/// vehicle's turn rates. `base` returns the lowest and highest turn rate (rad/s) of each step of a
/// window.
struct WidenedInputs<B> {
    name: &'static str,
    parameters: SceneParameters,
    most: f64,
    base: B,
}

/// The name of the family of [`worst_case`].
pub const WORST_CASE: &str = "worst case";

/// All positions that the human can reach. Every level has this set, and its coverage is 1.
pub fn worst_case(parameters: &SceneParameters) -> impl Family + Send + use<> {
    let range = parameters.human.turn_range();
    let base = move |window: &Window<'_>| Ok(vec![range; window.steps()]);
    WidenedInputs { name: WORST_CASE, parameters: *parameters, most: 0.0, base }
}

/// The human drives straight, with a turn rate within ±ε. The set is a cone around the current
/// velocity.
pub fn constant_velocity(parameters: &SceneParameters) -> impl Family + Send + use<> {
    let rate = parameters.human.turn_rate_radps;
    around(Nominal::Straight, "constant velocity", rate, parameters)
}

/// The human holds the turn rate of the last step, to within ±ε.
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
/// As in that paper, the human is a nominal model plus a disturbance of its input. The bound on the
/// disturbance is the smallest bound that gives the required accuracy (coverage) on recorded
/// drives. The prediction is the forward reachable set. This family is not a reproduction of the
/// paper. It omits the paper's driving scenario and vehicle model, several simultaneous bounds, the
/// second constraint on *risk*, and the level-set computation. Here, the nominal model is the most
/// likely action of `model` at each coming step, rolled out on its own predictions (in both
/// directions if actions tie). The single bound is the level ε (rad/s). The family is therefore
/// Algorithm 1 with k = 1.
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

impl<B: FnMut(&Window<'_>) -> Result<Vec<(f64, f64)>, Invalid>> Family for WidenedInputs<B> {
    fn name(&self) -> String {
        self.name.to_owned()
    }

    fn most(&self) -> f64 {
        self.most
    }

    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid> {
        let base = (self.base)(window)?;
        least_widening(&base, window, &self.parameters, Tolerance::default())
    }

    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
        let base = (self.base)(window)?;
        let bounds = widened(&base, level, self.parameters.human.turn_range())?;
        tube_area_m2(&bounds, &self.parameters)
    }
}

/// Area (m²) of all positions that the human can reach within `steps`. The areas of other sets are
/// compared with this area, because a set that is equally large contains no more information than the
/// vehicle model.
///
/// # Errors
/// [`Invalid`] if there are no steps.
pub fn worst_case_area_m2(parameters: &SceneParameters, steps: usize) -> Result<f64, Invalid> {
    let range = parameters.human.turn_range();
    tube_area_m2(&widened(&vec![range; steps], 0.0, range)?, parameters)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shfrs::testing::{Always, drive};

    /// Score and area at `level` after one step to the left, for a drive that continues with the
    /// turn rate `rest`.
    fn check(mut family: impl Family, rest: f64, level: f64) -> (f64, f64) {
        let mut rates = vec![rest; 11];
        rates[0] = 0.5;
        let drive = drive(&rates);
        let window = Window::new(&drive, 1, 10).unwrap();
        let score = family.score(&window).unwrap();
        assert!((0.0..=family.most()).contains(&score));
        (score, family.area_m2(&window, level).unwrap())
    }

    /// The set of all turn rates has an area of 16/3 m². Areas are proportional to the width of the
    /// bounds wherever straight driving is admissible.
    #[test]
    fn each_family_is_about_its_own_guess() {
        let parameters = &SceneParameters::default();
        let whole = 16.0 / 3.0;
        let near = |(score, area): (f64, f64), expected: (f64, f64)| {
            // Membership has a tolerance of 5 mm, so slightly less widening suffices.
            assert!(score <= expected.0 && expected.0 - score < 0.02, "{score} {expected:?}");
            assert!((area - expected.1).abs() < 1e-3, "{area} {expected:?}");
        };
        near(check(worst_case(parameters), -0.5, 0.0), (0.0, whole));
        near(check(constant_velocity(parameters), 0.0, 0.2), (0.0, 0.4 * whole));
        near(check(constant_velocity(parameters), -0.5, 0.0), (0.5, 0.0));
        near(check(hold_the_input(parameters), 0.5, 0.5), (0.0, 0.5 * whole));
        near(check(hold_the_input(parameters), -0.5, 1.0), (1.0, whole));
        let right = || learned_disturbance(parameters, Always([0.5, 0.3, 0.2]));
        near(check(right(), -0.5, 0.75), (0.0, 0.75 * whole));
        near(check(right(), 0.0, 0.0), (0.5, 0.0));
        // If actions tie, the bounds include both directions.
        let torn = learned_disturbance(parameters, Always([0.4, 0.2, 0.4]));
        near(check(torn, 0.3, 0.0), (0.0, whole));
    }
}
