//! `sidestep features`.

use super::solving::{Interrupt, safety_levels};
use super::trials_file::Faults;
use super::trials_source::TrialsArgs;
use super::{CommandError, print_json, unwritable};
use crate::formats::atomic_file;
use crate::formats::features_csv::{self, WriteError};
use sidestep::features::{FEATURES, Feature};
use sidestep::recording::flagged;
use std::path::PathBuf;

/// Compute the features of predictors for every step of recorded tasks.
///
/// Writes one row for each step, in the order of the trials: participant, trial, step; the paper's
/// features; turn (-1 right, 0, 1 left) and avoid (0 or 1): the input held in the step; the further
/// features. --help lists the features with their units.
///
/// An invalid row, or a step that the vehicles cannot have driven, makes the whole file invalid. The error
/// names the row or step. (`sidestep analyze` excludes only the participant.) With --database, participants
/// excluded from analyses are excluded here too. Prints one line of JSON with the numbers of participants,
/// trials and steps, the exclusions, and the number of flagged trials.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = list())]
pub struct FeaturesArgs {
    #[command(flatten)]
    trials: TrialsArgs,
    /// File to write.
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
}

/// The features, one per line.
fn list() -> String {
    let line = |feature: &Feature| {
        let Feature { name, unit, meaning, .. } = feature;
        format!("  {name:<17} {unit:<6} {meaning}\n")
    };
    format!("Features, in this order:\n{}", FEATURES.iter().map(line).collect::<String>())
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
