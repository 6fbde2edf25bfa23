//! `sidestep simulate`.

mod file;
pub(super) mod volunteer;
mod participation;

use super::{CommandError, Words, one_of, solving};
use indicatif::ProgressBar;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::synthetic::{Keys, SyntheticDrive};
use sidestep::trial::flags;
use std::collections::BTreeMap;

/// Simulate synthetic participants, into a file or through a running server.
///
/// Each participant follows published models of walking people with randomly drawn parameters, and never
/// uses a safety level. Synthetic participants test the software and are not evidence about people.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = OUTPUT)]
pub struct SimulateArgs {
    /// Number of participants, 1 to 10000.
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=10_000),
        allow_negative_numbers = true
    )]
    participants: u64,
    /// Seed: a whole number from 0 to 2^64 - 1.
    ///
    /// Participant n of a seed does not depend on --participants.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    seed: u64,
    /// Tasks of each participant, 1 to 1000 [default: 50 with --out, all with --url].
    ///
    /// With --out the scenes are the scenes of the paper's study. With --url the server's study has
    /// its own scenes. A participant who drives only some of them does not complete the study.
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=1000),
        allow_negative_numbers = true
    )]
    tasks: Option<u64>,
    /// When a new input takes effect [default: free with --out, clock with --url].
    ///
    /// The project's reference data were made with free.
    #[arg(long, value_name = "WHEN", value_parser = one_of(KEYS))]
    keys: Option<Keys>,
    #[command(flatten)]
    destination: Destination,
    /// Name of the server's study in URLs.
    #[arg(long, value_name = "SLUG", default_value = "default", conflicts_with = "out")]
    study: String,
}

/// The destination of the trials. Exactly one must be given.
#[derive(Clone, Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Destination {
    /// CSV file to write, one row per step; - writes to stdout, without the summary.
    ///
    /// A row has the state before the step (m, rad) and the turn rate during the step (rad/s;
    /// positive to the left).
    #[arg(long, value_name = "FILE.csv")]
    out: Option<String>,
    /// URL of a running server: http://HOST:PORT or https://HOST.
    ///
    /// The participants enrol there, drive the scenes of their plans and complete.
    #[arg(long, value_name = "URL")]
    url: Option<String>,
}

const OUTPUT: &str = "\
Prints one line of JSON: participants, trials, and flags (how many trials have each; {} \
if there are none). With --out also keys, rows and file; with --url also url, study and \
already_stored.

With --keys clock (one input a step, as in the study) states replay exactly from the inputs, and \
numbers have enough digits to parse to the same bits. With --keys free the keys count at once, every \
0.05 s, as in the project's reference data: states do not replay from the inputs, headings are \
not wrapped, numbers have nine significant digits, and lines end with CR LF. A column synthetic \
says that nobody drove; only the reference's own file, of seed 20180918 with free keys, lacks it.

Through a server every person has the external id synthetic-SEED-NUMBER, and the display of every \
trial says \"synthetic\": true. Starting an interrupted run again resumes it; people who are \
complete are skipped.";

impl SimulateArgs {
    /// Number of trials of each participant in a file.
    fn trials(&self) -> u64 {
        self.tasks.unwrap_or(50)
    }

    fn keys(&self) -> Keys {
        let usual = if self.destination.url.is_some() { Keys::Clock } else { Keys::Free };
        self.keys.unwrap_or(usual)
    }
}

const KEYS: Words<Keys> = &[
    ("clock", Keys::Clock, "At the beginning of each step, as in the study"),
    ("free", Keys::Free, "At once, every 0.05 s; only with --out"),
];

/// Runs the simulation and prints a summary.
///
/// # Errors
/// [`CommandError`] for bad flags or an unknown study (input), or an error of the disk, the network
/// or the server (failure).
pub async fn run(args: SimulateArgs) -> Result<(), CommandError> {
    match (&args.destination.out, &args.destination.url) {
        (Some(out), _) => file::write(&args, out),
        (None, Some(url)) => participation::take_part(&args, url).await,
        (None, None) => {
            Err(CommandError::Input("--out, --url: expected one of them, found none".to_owned()))
        }
    }
}

/// The number of trials with each flag. The key is the word for the flag.
#[derive(Debug, Default, serde::Serialize)]
#[serde(transparent)]
struct FlagCounts(BTreeMap<&'static str, u64>);

impl FlagCounts {
    /// Counts the flags that a server would give to this trial.
    fn count(&mut self, parameters: &SceneParameters, scene: &Scene, drive: &SyntheticDrive) {
        for flag in flags(parameters, scene, &drive.inputs, &drive.states, &drive.sampled_at_ms) {
            *self.0.entry(flag.word()).or_default() += 1;
        }
    }
}

/// A progress bar for the trials, hidden unless stderr is a terminal.
fn bar(trials: u64) -> ProgressBar {
    let template = "simulating [{bar:40}] {pos}/{len} trials  {elapsed_precise}, {eta} left";
    solving::bar(trials, template)
}
