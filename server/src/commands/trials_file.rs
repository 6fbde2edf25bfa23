//! The tasks in a trials.csv, for commands that learn from them.

use super::CommandError;
use super::game::GameArgs;
use crate::trials_csv::{self, Contents, Person};
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
    let mut people = trials_csv::read(open(path)?, scene).map_err(|e| complaint(path, &e))?;
    only_tasks(&mut people);
    people.retain(|person| !person.trials.is_empty());
    if people.is_empty() {
        return Err(complaint(path, &NO_TASK));
    }
    Ok(people)
}

/// The same where faults of one person are no others': who drove no task is there without any, and
/// who has a wrong row is a fault.
///
/// # Errors
/// [`CommandError::Input`] naming the file, the line and what is wrong where it cannot be told
/// whose the rows are or everybody's are wrong, or that there is no task.
pub(super) fn each_ones_tasks(
    path: &Path,
    scene: &SceneParameters,
) -> Result<Contents, CommandError> {
    let mut contents =
        trials_csv::read_each(open(path)?, scene).map_err(|e| complaint(path, &e))?;
    if let ([], [first, others @ ..]) = (&contents.people[..], &contents.faults[..]) {
        let others = match others.len() {
            0 => String::new(),
            n => format!(" (and there are faults of {n} more, so that nobody is left)"),
        };
        return Err(complaint(path, &format!("{}{others}", first.error)));
    }
    only_tasks(&mut contents.people);
    if contents.people.iter().all(|person| person.trials.is_empty()) {
        return Err(complaint(path, &NO_TASK));
    }
    Ok(contents)
}

const NO_TASK: &str = "expected at least one task, found none";

fn only_tasks(people: &mut [Person]) {
    for person in people {
        person.trials.retain(|trial| trial.phase == Phase::Task);
    }
}

fn open(path: &Path) -> Result<BufReader<File>, CommandError> {
    let file = File::open(path).map_err(|e| complaint(path, &format!("cannot read: {e}")))?;
    Ok(BufReader::new(file))
}

fn complaint(path: &Path, what: &dyn std::fmt::Display) -> CommandError {
    CommandError::Input(format!("{}: {what}", path.display()))
}
