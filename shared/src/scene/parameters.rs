//! The parameters that all scenes of a study share.

use crate::invalid::{Invalid, positive};
use crate::reachability::PursuitGame;
use crate::vehicle::VehicleModel;
use serde::{Deserialize, Serialize};

/// The parameters that all scenes of a study share: both vehicles, the danger radius and the steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SceneParameters {
    /// The vehicle that the participant steers.
    pub human: VehicleModel,
    /// The vehicle that drives straight to its goal.
    pub robot: VehicleModel,
    /// Danger radius R_c (m).
    pub danger_radius_m: f64,
    /// Length of a step (s).
    pub step_s: f64,
    /// Number of steps of a trial.
    pub steps: usize,
}

impl Default for SceneParameters {
    /// The paper's parameters: v = 2 m/s, ω = 0.5 rad/s, R_c = 3 m, 50 steps of 0.2 s.
    fn default() -> Self {
        let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
        Self { human: vehicle, robot: vehicle, danger_radius_m: 3.0, step_s: 0.2, steps: 50 }
    }
}

impl SceneParameters {
    /// Checks that all parameters are valid.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        self.human.check().map_err(|e| e.within("human"))?;
        self.robot.check().map_err(|e| e.within("robot"))?;
        positive("danger_radius_m", self.danger_radius_m)?;
        positive("step_s", self.step_s)?;
        if !(1..=3000).contains(&self.steps) {
            return Err(Invalid::new("steps", "a whole number from 1 to 3000", self.steps));
        }
        Ok(())
    }

    /// Length of a trial (s).
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }

    /// Distance that the robot drives in a trial (m). The robot's goal is exactly this far ahead of
    /// its start.
    #[must_use]
    pub fn goal_distance_m(&self) -> f64 {
        self.robot.speed_mps * self.duration_s()
    }

    /// The game whose value is the safety level of `evader`. If both vehicles have the same speed
    /// and turn rate, both evaders have the same game.
    #[must_use]
    pub fn game(&self, evader: Evader) -> PursuitGame {
        let (evader, pursuer) = match evader {
            Evader::Human => (self.human, self.robot),
            Evader::Robot => (self.robot, self.human),
        };
        PursuitGame { evader, pursuer, radius_m: self.danger_radius_m }
    }
}

/// The evading vehicle, whose safety level is the value of the game. The other vehicle pursues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evader {
    /// V_HR: the human evades the robot.
    Human,
    /// V_RH: the robot evades the human.
    Robot,
}

impl Evader {
    /// Both vehicles.
    pub const ALL: [Self; 2] = [Self::Human, Self::Robot];

    /// The evader's name in the database.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Human => "human",
            Self::Robot => "robot",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_game_of_each_evader() {
        let mut parameters = SceneParameters::default();
        let [human, robot] = Evader::ALL.map(|evader| parameters.game(evader));
        assert_eq!(human, robot);
        assert!(human.identical());
        parameters.robot.speed_mps = 1.5;
        let [human, robot] = Evader::ALL.map(|evader| parameters.game(evader));
        assert_eq!((human.evader.speed_mps, human.pursuer.speed_mps), (2.0, 1.5));
        assert_eq!((robot.evader, robot.pursuer), (human.pursuer, human.evader));
        assert_eq!((human.radius_m, robot.radius_m), (3.0, 3.0));
    }
}
