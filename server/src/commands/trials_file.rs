//! The tasks in a trials.csv, for commands that learn from them.

use super::CommandError;
use super::game::GameArgs;
use super::solving::flagged;
use crate::formats::trials_csv::{self, Contents, FileTrial, Person};
use sidestep::invalid::Invalid;
use sidestep::math::{hypot, sinc};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::trial::Phase;
use sidestep::vehicle::{Pose, VehicleModel};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What the trials of a file were driven with: the human is the evader.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    game: GameArgs,
    /// Length of a step, s.
    #[arg(long, help_heading = "Trials", value_name = "S", default_value_t = 0.2)]
    #[arg(allow_negative_numbers = true)]
    step: f64,
    /// Steps of a trial.
    #[arg(long, help_heading = "Trials", value_name = "N", default_value_t = 50)]
    trial_steps: usize,
}

impl SceneArgs {
    /// The scene's parameters.
    ///
    /// # Errors
    /// [`CommandError::Input`] naming the flag that is wrong.
    pub(super) fn scene(self) -> Result<SceneParameters, CommandError> {
        let game = self.game.game()?;
        let scene = SceneParameters {
            human: game.evader,
            robot: game.pursuer,
            danger_radius_m: game.radius_m,
            step_s: self.step,
            steps: self.trial_steps,
        };
        scene.check().map_err(|invalid| {
            let field = match invalid.field.as_str() {
                "step_s" => "step",
                "steps" => "trial-steps",
                other => other,
            };
            flagged(Invalid { field: field.to_owned(), ..invalid })
        })?;
        Ok(scene)
    }
}

/// Accepts trials whose vehicles are as fast as those of the scene: from others safety levels
/// would be computed that nobody was in.
fn as_fast(people: &[Person], scene: &SceneParameters) -> Result<(), String> {
    type Vehicle = (&'static str, fn(&JointState) -> Pose, VehicleModel);
    let vehicles: [Vehicle; 2] = [
        ("evader", |state| state.human, scene.human),
        ("pursuer", |state| state.robot, scene.robot),
    ];
    for (role, pose, vehicle) in vehicles {
        // The state after the last step is the scene's own.
        let recorded = |trial: &FileTrial| {
            let states = &trial.states[..trial.inputs.len()];
            states.windows(2).map(|s| distance(pose(&s[0]), pose(&s[1]))).collect::<Vec<f64>>()
        };
        let trials = people.iter().flat_map(|person| &person.trials);
        let mut moved: Vec<f64> = trials.flat_map(recorded).collect();
        moved.sort_by(f64::total_cmp);
        let Some(&median) = moved.get(moved.len() / 2) else { continue };
        // Whoever turns all the time moves along a chord.
        let half = 0.5 * vehicle.turn_rate_radps * scene.step_s;
        let straight = vehicle.speed_mps * scene.step_s;
        let turning = straight * sinc(half).abs();
        if !(0.99 * turning..=1.01 * straight).contains(&median) {
            let who = if role == "evader" { "the human" } else { "the robot" };
            let speed = median / scene.step_s;
            return Err(format!(
                "expected {who} to move {straight:.4} m in a step (--{role}-speed {}), found a \
                 median of {median:.4} m: --{role}-speed {speed:.4} fits these trials. How fast it \
                 may turn is not seen here, but safety levels depend on it: give \
                 --{role}-turn-rate too where that is not {} rad/s",
                vehicle.speed_mps, vehicle.turn_rate_radps
            ));
        }
    }
    Ok(())
}

fn distance(from: Pose, to: Pose) -> f64 {
    hypot(to.x - from.x, to.y - from.y)
}

/// Everybody in the file with their tasks; who drove none is left out.
///
/// # Errors
/// [`CommandError::Input`] naming the file, the line and what is wrong, or that there is no task.
pub(super) fn tasks(path: &Path, scene: &SceneParameters) -> Result<Vec<Person>, CommandError> {
    let mut people = trials_csv::read(open(path)?, scene).map_err(|e| complaint(path, &e))?;
    as_fast(&people, scene).map_err(|e| complaint(path, &e))?;
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
    as_fast(&contents.people, scene).map_err(|e| complaint(path, &e))?;
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
