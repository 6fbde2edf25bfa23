//! `sidestep simulate`.

mod file;
mod participation;

use super::{CommandError, solving};
use clap::ValueEnum;
use indicatif::ProgressBar;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::synthetic::{self, SyntheticDrive};
use sidestep::trial::flags;
use std::collections::BTreeMap;

/// Let synthetic participants drive: into a file, or through a running server.
///
/// They are computed after published models of people walking, each with a character drawn at
/// random, and never see a safety level. They test software, and say nothing about people.
#[derive(Clone, Debug, clap::Args)]
#[command(after_long_help = OUTPUT)]
pub struct SimulateArgs {
    /// How many people, 1 to 10000.
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=10_000),
        allow_negative_numbers = true
    )]
    participants: u64,
    /// Whole number from 0 to 2^64 - 1 that names the people: the first person of a seed is the
    /// same however many there are.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    seed: u64,
    /// Tasks of each person, 1 to 1000. In a file they are in scenes of the paper's study [default:
    /// 50]; a server's study has its own, of which a person then drives no more than so many and,
    /// if there are more, does not complete [default: all].
    #[arg(
        long,
        value_name = "N",
        value_parser = clap::value_parser!(u64).range(1..=1000),
        allow_negative_numbers = true
    )]
    tasks: Option<u64>,
    /// When the vehicle follows the keys [default: free with --out, as in the project's reference
    /// data; clock with --url].
    #[arg(long, value_name = "WHEN", value_enum)]
    keys: Option<KeysArg>,
    #[command(flatten)]
    destination: Destination,
    /// Name of the server's study in addresses.
    #[arg(long, value_name = "SLUG", default_value = "default", conflicts_with = "out")]
    study: String,
}

/// Where the drives go: one of the two.
#[derive(Clone, Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Destination {
    /// CSV file to write, one row a step: the state before it (m, rad), and the turn rate held
    /// then (rad/s, left is positive); - writes it to stdout, and no summary.
    #[arg(long, value_name = "FILE.csv")]
    out: Option<String>,
    /// Address of a running server, http://HOST:PORT (or without a port): the people enrol there, drive the
    /// scenes of their plans and complete. Only plain http is spoken.
    #[arg(long, value_name = "URL")]
    url: Option<String>,
}

const OUTPUT: &str = "\
Prints one line of JSON: participants, trials, and flags (how many trials have each; {} where \
none has any). With --out also keys, rows and file; with --url also url, study and \
already_stored.

With --keys clock (one input a step, as in the study) states replay exactly from the inputs, and \
have as many digits as bring the same bits back. With --keys free the keys count at once, every \
0.05 s, as in the project's reference data: states do not replay from the inputs, headings are \
not wrapped, numbers have nine significant digits, and lines end with CR LF. A column synthetic \
says that nobody drove; only the reference's own file, of seed 20180918 with free keys, lacks it.

Through a server every person has the external id synthetic-SEED-NUMBER, and the display of every \
trial says \"synthetic\": true. A run that broke off goes on where it stopped when it is started \
again; people who are complete are left alone.";

impl SimulateArgs {
    /// Trials of each person in a file.
    fn trials(&self) -> u64 {
        self.tasks.unwrap_or(50)
    }

    fn keys(&self) -> KeysArg {
        let usual = if self.destination.url.is_some() { KeysArg::Clock } else { KeysArg::Free };
        self.keys.unwrap_or(usual)
    }
}

/// When the vehicle follows the keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum KeysArg {
    /// At the beginning of each step, as in the study.
    Clock,
    /// At once, every 0.05 s; only with --out.
    Free,
}

impl From<KeysArg> for synthetic::Keys {
    fn from(keys: KeysArg) -> Self {
        match keys {
            KeysArg::Clock => Self::Clock,
            KeysArg::Free => Self::Free,
        }
    }
}

/// Simulates and prints what was done.
///
/// # Errors
/// [`CommandError`] for bad flags or an unknown study (input), or what the disk, the network or
/// the server refuse (failure).
pub async fn run(args: SimulateArgs) -> Result<(), CommandError> {
    match (&args.destination.out, &args.destination.url) {
        (Some(out), _) => file::write(&args, out),
        (None, Some(url)) => participation::take_part(&args, url).await,
        (None, None) => {
            Err(CommandError::Input("--out, --url: expected one of them, found none".to_owned()))
        }
    }
}

/// How many trials have each flag, by its word.
#[derive(Debug, Default, serde::Serialize)]
#[serde(transparent)]
struct FlagCounts(BTreeMap<&'static str, u64>);

impl FlagCounts {
    /// Counts what a server is going to see in this drive.
    fn count(&mut self, parameters: &SceneParameters, scene: &Scene, drive: &SyntheticDrive) {
        for flag in flags(parameters, scene, &drive.inputs, &drive.states, &drive.sampled_at_ms) {
            *self.0.entry(flag.word()).or_default() += 1;
        }
    }
}

/// Hidden unless stderr is a terminal; counts trials.
fn bar(trials: u64) -> ProgressBar {
    let template = "simulating [{bar:40}] {pos}/{len} trials  {elapsed_precise}, {eta} left";
    solving::bar(trials, template)
}
