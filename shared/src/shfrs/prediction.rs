//! What sets are predicted with, and the bounds that Algorithm 1 finds by it.

use super::window::Window;
use crate::bounds::{
    ActionChoice, ActionModel, BoundsSettings, PredictedBounds, Rollout, input_bounds,
};
use crate::invalid::Invalid;
use crate::reach::Tolerance;
use crate::scene::{JointState, SceneParameters};

/// The vehicles, the learned function G, and what the robot is going to do.
pub struct Prediction<'a, M> {
    /// What the vehicles can do.
    pub parameters: &'a SceneParameters,
    /// How likely each action of the human is.
    pub model: &'a M,
    /// The robot's turn rate, rad/s, from the states so far (getRobotAction).
    pub robot_action: &'a (dyn Fn(&[JointState]) -> f64 + Sync),
    /// How far from a set a recorded state may lie and still count as inside.
    pub tolerance: Tolerance,
}

impl<M> Clone for Prediction<'_, M> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<M> Copy for Prediction<'_, M> {}

impl<'a, M: ActionModel> Prediction<'a, M> {
    /// With a robot that drives straight on, and the tolerance that is usual.
    pub fn new(parameters: &'a SceneParameters, model: &'a M) -> Self {
        Self { parameters, model, robot_action: &|_| 0.0, tolerance: Tolerance::default() }
    }

    /// Lowest and highest turn rate of the human, rad/s.
    #[must_use]
    pub fn turn_rate(&self) -> (f64, f64) {
        let rate = self.parameters.human.turn_rate_radps;
        (-rate, rate)
    }

    /// Difference between the highest and the lowest turn rate, rad/s: widened by so much,
    /// any bounds admit every turn rate.
    #[must_use]
    pub fn full_range(&self) -> f64 {
        let (least, most) = self.turn_rate();
        most - least
    }

    /// Settings of Algorithm 1 for this model.
    ///
    /// # Errors
    /// As of [`BoundsSettings::new`].
    pub fn settings(
        &self,
        epsilon: Vec<f64>,
        choice: &ActionChoice,
        rollout: Rollout,
    ) -> Result<BoundsSettings, Invalid> {
        BoundsSettings::new(epsilon, choice.clone(), rollout, self.model.actions().len())
    }

    /// Algorithm 1 from what is known after `history`.
    ///
    /// # Errors
    /// As of [`input_bounds`].
    pub fn bounds(
        &self,
        history: &[JointState],
        settings: &BoundsSettings,
    ) -> Result<PredictedBounds, Invalid> {
        input_bounds(history, self.parameters, self.model, self.robot_action, settings)
    }
}

/// Accepts a window that is as long as the prediction.
///
/// # Errors
/// [`Invalid`] for any other.
pub(super) fn same_steps(window: &Window<'_>, steps: usize) -> Result<(), Invalid> {
    if window.steps() == steps {
        Ok(())
    } else {
        Err(Invalid::new("window", format!("{steps} steps"), format!("{} steps", window.steps())))
    }
}
