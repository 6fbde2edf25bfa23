//! Reads the tasks in a trials.csv as a recording, for commands that learn from them.

use super::game::GameArgs;
use super::solving::flagged;
use super::{CommandError, table_file};
use crate::formats::csv_lines::{LineError, Records};
use crate::formats::trials_csv::{self, Contents, ParticipantFault};
use sidestep::invalid::Invalid;
use sidestep::math::{PI, atan2, hypot, sinc, wrap_angle};
use sidestep::plausibility;
use sidestep::recording::{Exclusion, Origin, RecordedParticipant, RecordedTrial, Recording};
use sidestep::scene::{JointState, SceneParameters};
use sidestep::synthetic;
use sidestep::trial::Flag;
use sidestep::vehicle::{Pose, VehicleModel};
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

/// The vehicles and steps of a file's trials. The human is the evader.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(super) struct SceneArgs {
    #[command(flatten)]
    game: GameArgs,
    /// Length of a step (s).
    #[arg(long, help_heading = "Trials", value_name = "S", default_value_t = 0.2)]
    #[arg(allow_negative_numbers = true)]
    step: f64,
    /// Number of steps of a trial.
    #[arg(long, help_heading = "Trials", value_name = "N", default_value_t = 50)]
    trial_steps: usize,
}

impl SceneArgs {
    /// The parameters of the scene.
    ///
    /// # Errors
    /// [`CommandError::Input`] naming the invalid flag.
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

/// One of the two vehicles in the recorded states: its name in messages, its role in flags, the
/// column of its heading, its pose, and its model.
struct Driven {
    who: &'static str,
    role: &'static str,
    heading: &'static str,
    pose: fn(&JointState) -> Pose,
    vehicle: VehicleModel,
}

/// Checks that the scene's vehicles can have driven the recorded states. Otherwise, safety levels
/// would be computed for states that never occurred.
fn check_motion(people: &[RecordedParticipant], scene: &SceneParameters) -> Result<(), String> {
    let vehicles = [
        Driven {
            who: "the human",
            role: "evader",
            heading: "hpsi",
            pose: |state| state.human,
            vehicle: scene.human,
        },
        Driven {
            who: "the robot",
            role: "pursuer",
            heading: "rpsi",
            pose: |state| state.robot,
            vehicle: scene.robot,
        },
    ];
    for driven in vehicles {
        // Use only recorded states. The state after the last step is computed.
        let recorded = |trial: &RecordedTrial| {
            let states = &trial.states[..trial.inputs.len()];
            let poses = states.windows(2).map(|s| ((driven.pose)(&s[0]), (driven.pose)(&s[1])));
            poses.collect::<Vec<_>>()
        };
        let trials = people.iter().flat_map(|person| &person.trials);
        let steps: Vec<(Pose, Pose)> = trials.flat_map(recorded).collect();
        driven.check_speed(&steps, scene.step_s)?;
        driven.check_headings(&steps, scene.step_s)?;
    }
    Ok(())
}

impl Driven {
    /// Checks that the median distance per step fits the vehicle's speed.
    fn check_speed(&self, steps: &[(Pose, Pose)], step_s: f64) -> Result<(), String> {
        let mut moved: Vec<f64> =
            steps.iter().map(|(from, to)| hypot(to.x - from.x, to.y - from.y)).collect();
        moved.sort_by(f64::total_cmp);
        let Some(&median) = moved.get(moved.len() / 2) else { return Ok(()) };
        // If a vehicle turns during the whole step, its displacement is a chord.
        let half = 0.5 * self.vehicle.turn_rate_radps * step_s;
        let straight = self.vehicle.speed_mps * step_s;
        let turning = straight * sinc(half).abs();
        if (0.99 * turning..=1.01 * straight).contains(&median) {
            return Ok(());
        }
        let Self { who, role, vehicle, .. } = self;
        let speed = median / step_s;
        Err(format!(
            "expected {who} to move {straight:.4} m in a step (--{role}-speed {}), found a median \
             of {median:.4} m: --{role}-speed {speed:.4} fits these trials. The trials do not show \
             the largest turn rate, on which safety levels depend: give --{role}-turn-rate too \
             unless it is {} rad/s",
            vehicle.speed_mps, vehicle.turn_rate_radps
        ))
    }

    /// Checks that headings point in the direction of motion. Only this check detects headings in
    /// degrees.
    fn check_headings(&self, steps: &[(Pose, Pose)], step_s: f64) -> Result<(), String> {
        let most = 0.5 * self.vehicle.turn_rate_radps * step_s + HEADING_TOLERANCE_RAD;
        let off = |scale: f64| {
            let is_off = |(from, to): &&(Pose, Pose)| {
                let direction = atan2(to.y - from.y, to.x - from.x);
                wrap_angle(direction - scale * from.psi).abs() > most
            };
            steps.iter().filter(is_off).count()
        };
        let most_off = steps.len() / 20;
        let found = off(1.0);
        if found <= most_off {
            return Ok(());
        }
        let Self { who, heading, .. } = self;
        let hint = match off(PI / 180.0) <= most_off {
            true => "; the headings are in degrees: give radians",
            false => "",
        };
        Err(format!(
            "{heading}: expected headings in radians, counter-clockwise from +x, that point where \
             {who} moves, found {found} of {} steps in which they do not{hint}",
            steps.len()
        ))
    }
}

/// Tolerance of a heading, in addition to half of the largest turn in a step.
const HEADING_TOLERANCE_RAD: f64 = 0.05;

/// How faulty rows and trials are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Faults {
    /// The participant is excluded.
    Exclude,
    /// The whole file is refused.
    Refuse,
}

/// Returns one participant of the file, with all trials as recorded.
///
/// # Errors
/// [`CommandError::Input`] naming the file, if a row or trial of this participant is invalid (with
/// its line), if the vehicles cannot have driven the trials, or if the participant does not exist.
/// A fault of another participant is not an error.
pub(super) fn participant(
    path: &Path,
    scene: &SceneParameters,
    name: &str,
) -> Result<RecordedParticipant, CommandError> {
    let Contents { mut participants, faults, .. } = read_each(path, scene)?;
    if let Some(fault) = faults.iter().find(|fault| fault.participant == name) {
        return Err(faulty(path, &fault.error));
    }
    participants.retain(|person| person.name == name);
    check_motion(&participants, scene).map_err(|e| complaint(path, &e))?;
    participants.pop().ok_or_else(|| {
        complaint(path, &format!("--participant: no participant of the file is called {name:?}"))
    })
}

/// The tasks of the participants in the file. With [`Faults::Exclude`], participants without a task
/// are kept. Trials that do not replay from their inputs are flagged.
///
/// # Errors
/// [`CommandError::Input`] naming the file, the line and the fault, if a row cannot be assigned to a
/// participant, if there is a fault and `wanted` is [`Faults::Refuse`], if every participant has a
/// fault, or if there is no task.
pub(super) fn recording(
    path: &Path,
    scene: &SceneParameters,
    wanted: Faults,
) -> Result<Recording, CommandError> {
    let Contents { mut participants, faults, .. } = read_each(path, scene)?;
    check_motion(&participants, scene).map_err(|e| complaint(path, &e))?;
    let exclusion = |ParticipantFault { participant, error }: ParticipantFault| {
        Exclusion::of_fault(&participant, &error.into())
    };
    participants.iter_mut().for_each(RecordedParticipant::keep_tasks);
    participants.iter_mut().for_each(RecordedParticipant::keep_one_attempt);
    let reasons = excluded_beside(path)?;
    let experimenters = participants.extract_if(.., |person| reasons.contains_key(&person.name));
    let excluded: Vec<Exclusion> = experimenters
        .map(|person| Exclusion::by_experimenter(&person.name, &reasons[&person.name]))
        .collect();
    let origin = Origin::File(table_file::name(path));
    let provenance = synthetic::provenance(origin, &participants);
    let mut recording =
        Recording { provenance, scene: *scene, participants, exclusions: Vec::new() };
    let hints: Vec<&str> = faults.iter().map(|fault| hint(&fault.error)).collect();
    recording.exclusions = faults.into_iter().map(exclusion).collect();
    plausibility::exclude_impossible(&mut recording);
    let Recording { participants, exclusions, .. } = &mut recording;
    // An exclusion by an experimenter is not a fault of the file.
    let excluded_only = participants.is_empty() && exclusions.is_empty();
    if let Some(first) = excluded.first().filter(|_| excluded_only) {
        let expected = "expected at least one participant with tasks, found none else";
        return Err(complaint(path, &format!("{first}; {expected}")));
    }
    let nobody = participants.is_empty();
    if let Some(first) = exclusions.first().filter(|_| nobody || wanted == Faults::Refuse) {
        let others = match exclusions.len() - 1 {
            n @ 1.. if nobody => format!("; {n} more have faults too, so that nobody is left"),
            _ => String::new(),
        };
        let hint = hints.first().unwrap_or(&"");
        return Err(complaint(path, &format!("{}{hint}{others}", first.why())));
    }
    exclusions.splice(..0, excluded);
    // Keep participants without a task for analyses, which report them.
    participants.retain(|person| wanted == Faults::Exclude || !person.trials.is_empty());
    if participants.iter().all(|person| person.trials.is_empty()) {
        return Err(complaint(path, &"expected at least one task, found none"));
    }
    for trial in participants.iter_mut().flat_map(|person| &mut person.trials) {
        if !trial.flags.contains(&Flag::ReplayMismatch) && !plausibility::replays(scene, trial) {
            trial.flags.push(Flag::ReplayMismatch);
        }
    }
    Ok(recording)
}

/// The participants whom an experimenter excluded, with the reasons. They are read from the table
/// of participants that an export writes beside the steps.
pub(super) fn excluded_beside(path: &Path) -> Result<HashMap<String, String>, CommandError> {
    let table = path.with_file_name("participants.csv");
    if path.file_name().is_none_or(|name| name != "steps.csv") || !table.is_file() {
        return Ok(HashMap::new());
    }
    let unreadable = |error: LineError| complaint(&table, &error);
    let (mut rows, header) = Records::of(open(&table)?).map_err(unreadable)?;
    let column = |name: &str| header.iter().position(|known| known == name);
    let (Some(name), Some(reason)) = (column("participant"), column("exclusion_reason")) else {
        return Ok(HashMap::new());
    };
    let mut excluded = HashMap::new();
    while let Some((_, row)) = rows.read().map_err(unreadable)? {
        if !row[reason].is_empty() {
            excluded.insert(row[name].to_owned(), row[reason].to_owned());
        }
    }
    table_file::tell(&table, rows.dialect());
    Ok(excluded)
}

/// The participants of the file. Reports an unusual dialect on stderr.
fn read_each(path: &Path, scene: &SceneParameters) -> Result<Contents, CommandError> {
    let contents = trials_csv::read_each(open(path)?, scene).map_err(|e| faulty(path, &e))?;
    table_file::tell(path, contents.dialect);
    Ok(contents)
}

fn open(path: &Path) -> Result<Box<dyn Read + Send>, CommandError> {
    table_file::open(path).map_err(|e| complaint(path, &format!("cannot read: {e}")))
}

fn complaint(path: &Path, what: &dyn std::fmt::Display) -> CommandError {
    CommandError::Input(format!("{}: {what}", table_file::name(path)))
}

fn faulty(path: &Path, error: &LineError) -> CommandError {
    complaint(path, &format!("{error}{}", hint(error)))
}

/// Names the flag that might be wrong if the file itself is correct.
fn hint(error: &LineError) -> &'static str {
    match error.what.field.as_str() {
        "omega" => "; --evader-turn-rate sets the human's turn rate",
        "t" => "; --step sets the length of a step",
        _ => "",
    }
}
