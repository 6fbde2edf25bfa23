//! Robots that follow rules. Only the page of studies with such robots has this code: the code of the
//! rules and of their JSON would be a quarter of the page of other studies.

use crate::drive::RobotTurnRate;
use crate::json;
use serde::de::{Deserialize, Deserializer, IgnoredAny};
use sidestep::api::Progress;
use sidestep::scene::SceneParameters;

/// The rules of the robots in a participant's plan.
pub(super) trait Rules {
    /// The robot in the scene of this trial. `None` if it has no rule.
    fn robot(&self, trial_id: &str, parameters: SceneParameters) -> Option<RobotTurnRate>;

    /// The rule of this robot as JSON, for the simulator.
    fn told(&self, trial_id: &str) -> Option<String>;
}

/// Reads the rules from the server's report of the progress.
pub(super) type ReadRules = fn(&[u8]) -> Option<Box<dyn Rules>>;

/// Reads the rules of the plan in the server's report.
pub(super) fn read(report: &[u8]) -> Option<Box<dyn Rules>> {
    json::read::<Progress>(report).map(|progress| Box::new(progress) as Box<dyn Rules>)
}

impl Rules for Progress {
    fn robot(&self, trial_id: &str, parameters: SceneParameters) -> Option<RobotTurnRate> {
        let (_, planned) = self.plan.scenes().find(|(_, planned)| planned.trial_id == trial_id)?;
        let scene = planned.scene();
        scene.policy.as_ref()?;
        Some(Box::new(move |states| scene.robot_turn_rate(&parameters, states)))
    }

    fn told(&self, trial_id: &str) -> Option<String> {
        let (_, planned) = self.plan.scenes().find(|(_, planned)| planned.trial_id == trial_id)?;
        planned.policy.as_ref().map(json::write)
    }
}

/// A rule that the page does not read.
#[derive(Clone, Debug)]
pub(super) struct Unread;

impl<'de> Deserialize<'de> for Unread {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        IgnoredAny::deserialize(from).map(|_| Self)
    }
}
