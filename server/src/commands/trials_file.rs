//! The tasks in a trials.csv, for commands that learn from them.

use super::CommandError;
use super::game::GameArgs;
use crate::trials_csv::{self, Person};
use sidestep::reachability::Player;
use sidestep::scene::SceneParameters;
use sidestep::trial::Phase;
use sidestep::vehicle::VehicleModel;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// The paper's scene with the vehicles of `game`: the human is the evader.
///
/// # Errors
/// [`CommandError::Input`] naming the flag that is wrong.
pub(super) fn scene(game: GameArgs) -> Result<SceneParameters, CommandError> {
    let game = game.game()?;
    let vehicle = |player: Player| VehicleModel {
        speed_mps: player.speed_mps,
        turn_rate_radps: player.turn_rate_radps,
    };
    Ok(SceneParameters {
        human: vehicle(game.evader),
        robot: vehicle(game.pursuer),
        danger_radius_m: game.radius_m,
        ..SceneParameters::default()
    })
}

/// Everybody in the file with their tasks; who drove none is left out.
///
/// # Errors
/// [`CommandError::Input`] naming the file, the line and what is wrong, or that there is no task.
pub(super) fn tasks(path: &Path, scene: &SceneParameters) -> Result<Vec<Person>, CommandError> {
    let name = path.display();
    let complain = |e: &dyn std::fmt::Display| CommandError::Input(format!("{name}: {e}"));
    let file = File::open(path).map_err(|e| complain(&format!("cannot read: {e}")))?;
    let mut people = trials_csv::read(BufReader::new(file), scene).map_err(|e| complain(&e))?;
    for person in &mut people {
        person.trials.retain(|trial| trial.phase == Phase::Task);
    }
    people.retain(|person| !person.trials.is_empty());
    if people.is_empty() {
        return Err(complain(&"expected at least one task, found none"));
    }
    Ok(people)
}
