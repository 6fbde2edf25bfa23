//! A task for a solver, and its solution.

use serde::{Deserialize, Serialize};
use sidestep::reachability::{
    Accuracy, Method, Options, Progress, PursuitGame, SolveError, ValueFunction, npz, solve,
};
use std::ops::ControlFlow;

/// A value function to compute.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// The game.
    pub game: PursuitGame,
    /// The method of solution. `None` for the best method.
    #[serde(default)]
    pub method: Option<Method>,
    /// The horizon (s). `None` for the converged value, because JSON has no infinity.
    #[serde(default)]
    pub horizon_s: Option<f64>,
    /// Accuracy of the grid. `None` for the accuracy that studies use.
    #[serde(default)]
    pub accuracy: Option<Accuracy>,
    /// Whether to return the NumPy archive that `sidestep solve` writes, instead of the server's
    /// format.
    #[serde(default)]
    pub as_archive: bool,
}

impl From<PursuitGame> for Task {
    /// A task that solves the game as a server does for its studies.
    fn from(game: PursuitGame) -> Self {
        Self { game, method: None, horizon_s: None, accuracy: None, as_archive: false }
    }
}

impl Task {
    /// Solves the game. Returns bytes in the server's format, or a NumPy archive.
    ///
    /// # Errors
    /// [`SolveError`] for a task that cannot be solved as stated, or if `progress` cancels it.
    pub fn solved(
        self,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Vec<u8>, SolveError> {
        let usual = Options::default();
        let options = usual
            .with_method(self.method)
            .with_horizon(self.horizon_s.unwrap_or(f64::INFINITY))
            .with_accuracy(self.accuracy.unwrap_or(usual.accuracy));
        if self.as_archive {
            let solved = solve(self.game, &options, progress)?;
            return Ok(npz::npz(&solved.samples, solved.method));
        }
        if options.method_for(&self.game)? == Method::Exact {
            return Ok(ValueFunction::Exact(self.game.exact()?).encode());
        }
        Ok(solve(self.game, &options, progress)?.function.encode())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sidestep::safety::value_function;
    use sidestep::scene::{Evader, SceneParameters};

    fn solved(task: Task) -> Result<Vec<u8>, SolveError> {
        task.solved(&mut |_| ControlFlow::Continue(()))
    }

    #[test]
    fn a_game_alone_is_solved_as_servers_do() {
        let mut parameters = SceneParameters::default();
        for rate in [0.5, 0.35] {
            parameters.robot.turn_rate_radps = rate;
            let game = parameters.game(Evader::Human);
            let theirs = value_function(game, &mut |_| ControlFlow::Continue(())).unwrap();
            assert_eq!(solved(game.into()).unwrap(), theirs.encode());
            // The task makes a round trip through JSON, with its defaults left out.
            let text = format!(r#"{{"game":{}}}"#, serde_json::to_string(&game).unwrap());
            assert_eq!(serde_json::from_str::<Task>(&text).unwrap(), game.into());
        }
    }

    #[test]
    fn an_archive_is_that_of_the_command_line() {
        for rate in [0.5, 0.35] {
            let mut parameters = SceneParameters::default();
            parameters.robot.turn_rate_radps = rate;
            let game = parameters.game(Evader::Human);
            let draft = Some(Accuracy::Draft);
            let task = Task { accuracy: draft, as_archive: true, ..game.into() };
            let options = Options::default().with_accuracy(Accuracy::Draft);
            let theirs = solve(game, &options, &mut |_| ControlFlow::Continue(())).unwrap();
            assert_eq!(solved(task).unwrap(), npz::npz(&theirs.samples, theirs.method));
        }
    }

    #[test]
    fn a_task_says_how() {
        let game = SceneParameters::default().game(Evader::Human);
        let draft = Task { accuracy: Some(Accuracy::Draft), ..game.into() };
        let polar = solved(Task { method: Some(Method::Polar), ..draft }).unwrap();
        assert!(matches!(ValueFunction::decode(&polar).unwrap(), ValueFunction::Sampled(_)));
        let short = ValueFunction::decode(&solved(Task { horizon_s: Some(0.5), ..draft }).unwrap());
        let ValueFunction::Sampled(short) = short.unwrap() else { panic!("a grid") };
        assert_eq!(short.horizon_s(), 0.5);
        let never = solved(Task { method: Some(Method::Exact), horizon_s: Some(0.5), ..draft });
        assert!(never.unwrap_err().to_string().contains("inf with method exact"));
    }
}
