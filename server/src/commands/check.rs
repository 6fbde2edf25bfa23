//! `sidestep check`.

use super::{CommandError, print_json};
use crate::soundness;
use crate::store::{Purpose, Store};

/// Check a database: whether the file is sound, and whether every trial replays as when it was
/// stored.
///
/// Prints a JSON summary; exit code 1 if anything is wrong.
#[derive(Clone, Debug, clap::Args)]
pub struct CheckArgs {
    /// Database: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
}

/// Checks, prints the report, and fails if anything is wrong.
///
/// # Errors
/// [`CommandError::Failure`] if anything is wrong or the check cannot be done.
pub async fn run(args: CheckArgs) -> Result<(), CommandError> {
    let store = Store::open(&args.database, Purpose::Read).await?;
    let report = soundness::report(&store).await?;
    let name = store.name();
    store.close().await;
    print_json(&report)?;
    let faults = report.faults();
    if faults == 0 {
        return Ok(());
    }
    let faults = if faults == 1 { "1 fault".to_owned() } else { format!("{faults} faults") };
    let message = format!("{name}: {faults}; see the report");
    Err(CommandError::Failure(message))
}
