//! Safety levels: how safe the human and the robot are from each other in a joint state. Each level
//! is the value (m) of the game in which one vehicle evades and the other pursues. If it is ≤ 0,
//! the pursuer can force a collision.

mod quality;

pub use quality::{LevelQuality, SafetyQuality};

use crate::reachability::{Options, Progress, PursuitGame, SolveError, ValueFunction, solve};
use crate::scene::{Evader, JointState, SceneParameters};
use core::ops::ControlFlow;

/// The value function of `game`: the closed form if there is one, otherwise a numerical solution.
/// Server and browser use the same settings, so they compute the same bytes.
///
/// # Errors
/// [`SolveError`] if the game cannot be solved, or if `progress` cancels the solve.
pub fn value_function(
    game: PursuitGame,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<ValueFunction, SolveError> {
    if let Ok(exact) = game.exact() {
        return Ok(ValueFunction::Exact(exact));
    }
    solve(game, &Options::default(), progress).map(|solved| solved.function)
}

/// The value functions for the safety levels of both vehicles.
#[derive(Clone, Debug, PartialEq)]
pub struct SafetyLevels {
    /// V_HR: the human evades; its argument is the robot's pose in the human's frame.
    pub human: ValueFunction,
    /// V_RH: the robot evades; its argument is the human's pose in the robot's frame.
    pub robot: ValueFunction,
}

impl SafetyLevels {
    /// Solves both games of these vehicles, or only one game if the two games are equal.
    ///
    /// # Errors
    /// The errors of [`value_function`].
    pub fn solve(
        parameters: &SceneParameters,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Self, SolveError> {
        let [game_h, game_r] = Evader::ALL.map(|evader| parameters.game(evader));
        let human = value_function(game_h, progress)?;
        let robot =
            if game_r == game_h { human.clone() } else { value_function(game_r, progress)? };
        Ok(Self { human, robot })
    }

    /// The value function of the game in which `evader` evades.
    #[must_use]
    pub fn of(&self, evader: Evader) -> &ValueFunction {
        match evader {
            Evader::Human => &self.human,
            Evader::Robot => &self.robot,
        }
    }

    /// V_HR of a state (m).
    #[must_use]
    pub fn human_level(&self, state: &JointState) -> f64 {
        self.human.value(state.robot_seen_by_human())
    }

    /// V_RH of a state (m).
    #[must_use]
    pub fn robot_level(&self, state: &JointState) -> f64 {
        self.robot.value(state.human_seen_by_robot())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solved(parameters: &SceneParameters) -> SafetyLevels {
        SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn equal_vehicles_share_the_closed_form() {
        let safety = solved(&SceneParameters::default());
        assert_eq!(safety.human, safety.robot);
        assert!(matches!(safety.human, ValueFunction::Exact(_)));
    }

    #[test]
    fn different_vehicles_have_a_function_each() {
        let mut parameters = SceneParameters::default();
        parameters.robot.turn_rate_radps = 0.35;
        let safety = solved(&parameters);
        for evader in Evader::ALL {
            assert_eq!(safety.of(evader).game(), parameters.game(evader));
        }
        assert_ne!(safety.human.id(), safety.robot.id());
        let stopped = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Break(()));
        assert_eq!(stopped, Err(SolveError::Cancelled));
    }

    #[test]
    fn a_slower_robot_is_less_dangerous() {
        let level = |parameters: &SceneParameters| {
            let game = parameters.game(Evader::Human);
            let function = value_function(game, &mut |_| ControlFlow::Continue(())).unwrap();
            function.value([6.0, 0.5, core::f64::consts::PI])
        };
        let mut parameters = SceneParameters::default();
        let equal = level(&parameters);
        parameters.robot.speed_mps = 1.5;
        assert!(level(&parameters) > equal + 0.1);
    }
}
