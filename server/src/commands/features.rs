//! `sidestep features`.

use super::solving::{Interrupt, safety_levels};
use super::trials_file::Faults;
use super::trials_source::TrialsArgs;
use super::{CommandError, print_json, unwritable};
use crate::formats::atomic_file;
use crate::formats::features_csv::{self, WriteError};
use sidestep::recording::flagged;
use std::path::PathBuf;

/// Compute the features of predictors for every step of recorded tasks.
///
/// Writes one row for each step, in the order of the trials: participant, trial, step; abs_dx,
/// abs_dy (m), dpsi (rad), cos_dpsi, sin_dpsi: human minus robot in the world frame; v_h, v_r (m):
/// the safety levels; distance (m); turn (-1 right, 0, 1 left) and avoid (0 or 1): the input held
/// in the step. The further features follow: robot_ahead, robot_left (m): the robot in the human's
/// frame; closest_time (s), closest_distance, closest_left (m): the closest approach if both drove
/// straight on; dv_h_ahead, dv_h_left (m/m), dv_h_turn (m/rad), dv_r_ahead, dv_r_left, dv_r_turn:
/// the gradients of the safety levels; turned_1, turned_2, turned_5, turned (rad): the angle by
/// which the human turned left in the last step, in the step before it, in the last five steps and
/// since the trial began.
///
/// An invalid row, or a step that the vehicles cannot have driven, makes the whole file invalid. The error
/// names the row or step. (`sidestep analyze` excludes only the participant.) With --database, participants
/// excluded from analyses are excluded here too. Prints one line of JSON with the numbers of participants,
/// trials and steps, the exclusions, and the number of flagged trials.
#[derive(Clone, Debug, clap::Args)]
pub struct FeaturesArgs {
    #[command(flatten)]
    trials: TrialsArgs,
    /// File to write.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
}

/// Reads the trials, computes the features, and writes the whole file or nothing.
///
/// # Errors
/// [`CommandError`] for a bad flag or line (input), or a file that cannot be written (failure).
pub async fn run(args: FeaturesArgs) -> Result<(), CommandError> {
    atomic_file::check(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let recording = args.trials.recording(Faults::Refuse).await?;
    let (scene, people) = (recording.scene, recording.participants);
    let interrupt = Interrupt::listen();
    let safety = safety_levels(&scene, &interrupt).await?;
    let written = atomic_file::write_private(&args.out, &interrupt.token, |out| {
        features_csv::write(out, &people, &safety)
    });
    interrupt.check()?;
    written.map_err(|error| match error {
        WriteError::Disk(error) => unwritable(&args.out, &error),
        WriteError::Trials(error) => {
            CommandError::Input(format!("{}: {error}", args.trials.name()))
        }
    })?;
    let trials = people.iter().flat_map(|person| &person.trials);
    print_json(&serde_json::json!({
        "participants": people.len(),
        "trials": trials.clone().count(),
        "steps": trials.map(|trial| trial.inputs.len()).sum::<usize>(),
        "excluded": recording.exclusions,
        "flagged": flagged(&people),
        "file": args.out,
    }))
}
