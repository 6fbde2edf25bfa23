//! `sidestep check`.

use super::{CommandError, failed, print_json};
use crate::database_check;
use crate::store::{Purpose, Store};

/// Check that a database is sound and that every trial replays as stored.
///
/// Continues after damage. Prints a JSON report of every fault with its location. If there are
/// faults, the exit code is 1 and the last line on stderr says what to do.
#[derive(Clone, Debug, clap::Args)]
pub struct CheckArgs {
    /// Database: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
}

/// Checks, prints the report, and fails if there are faults.
///
/// # Errors
/// [`CommandError::Failure`] if there are faults or the check cannot be completed.
pub async fn run(args: CheckArgs) -> Result<(), CommandError> {
    let store = Store::open(&args.database, Purpose::Read).await?;
    let report = database_check::report(&store).await?;
    let (name, is_server) = (store.name(), store.is_shared());
    store.close().await;
    let printed = print_json(&report);
    let faults = report.faults();
    if faults == 0 {
        return printed;
    }
    let faults = if faults == 1 { "1 fault".to_owned() } else { format!("{faults} faults") };
    let file = args.database.strip_prefix("sqlite:").filter(|_| !is_server);
    let next = match (file, report.damage.is_empty()) {
        (Some(file), false) => format!(
            "stop the server, keep this file with its -wal, and restore a backup with 'sidestep restore', or save what \
             can be read with 'sidestep salvage --from {file} --database sqlite:NEW'"
        ),
        (None, false) => "restore a backup with 'sidestep restore'".to_owned(),
        (_, true) => "restore a backup with 'sidestep restore', or go on without these trials: 'sidestep export' marks \
                      them"
            .to_owned(),
    };
    failed(printed, format!("{name}: {faults}; see the report; {next}"))
}
