//! The inputs of a prediction, and the bounds that Algorithm 1 computes from them.

use super::window::Window;
use crate::bounds::{
    ActionChoice, ActionModel, BoundsSettings, PredictedBounds, Rollout, input_bounds,
};
use crate::invalid::Invalid;
use crate::reach::Tolerance;
use crate::scene::{JointState, SceneParameters};

/// The inputs of a prediction: the vehicles, the learned function G, and the robot's future.
pub struct Prediction<'a, M> {
    /// The motion of the vehicles.
    pub parameters: &'a SceneParameters,
    /// The probability of each action of the human.
    pub model: &'a M,
    /// Returns the robot's turn rate (rad/s) for the states so far (getRobotAction).
    pub robot_action: &'a (dyn Fn(&[JointState]) -> f64 + Sync),
    /// Largest distance from a set at which a recorded state counts as inside.
    pub tolerance: Tolerance,
}

impl<M> Clone for Prediction<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Prediction<'_, M> {}

impl<'a, M: ActionModel> Prediction<'a, M> {
    /// A prediction with a robot that drives straight on, and the default tolerance.
    pub fn new(parameters: &'a SceneParameters, model: &'a M) -> Self {
        Self { parameters, model, robot_action: &|_| 0.0, tolerance: Tolerance::default() }
    }

    /// Lowest and highest turn rate of the human (rad/s).
    #[must_use]
    pub fn turn_rate(&self) -> (f64, f64) {
        self.parameters.human.turn_range()
    }

    /// Difference between the highest and the lowest turn rate (rad/s). Bounds widened by this
    /// difference admit every turn rate.
    #[must_use]
    pub fn full_range(&self) -> f64 {
        2.0 * self.parameters.human.turn_rate_radps
    }

    /// Number of the model's actions.
    #[must_use]
    pub fn actions(&self) -> usize {
        self.model.actions().len()
    }

    /// Settings of Algorithm 1 for this model.
    ///
    /// # Errors
    /// The errors of [`BoundsSettings::new`].
    pub fn settings(
        &self,
        epsilon: Vec<f64>,
        choice: &ActionChoice,
        rollout: Rollout,
    ) -> Result<BoundsSettings, Invalid> {
        BoundsSettings::new(epsilon, choice.clone(), rollout, self.actions())
    }

    /// Runs Algorithm 1 for the states in `history`, the last of which is the current one.
    ///
    /// # Errors
    /// The errors of [`input_bounds`].
    pub fn bounds(
        &self,
        history: &[JointState],
        settings: &BoundsSettings,
    ) -> Result<PredictedBounds, Invalid> {
        input_bounds(history, self.parameters, self.model, self.robot_action, settings)
    }
}

/// Checks that the window has `steps` steps.
///
/// # Errors
/// [`Invalid`] if the window has another number of steps.
pub(super) fn same_steps(window: &Window<'_>, steps: usize) -> Result<(), Invalid> {
    if window.steps() == steps {
        Ok(())
    } else {
        Err(Invalid::new("window", format!("{steps} steps"), format!("{} steps", window.steps())))
    }
}
