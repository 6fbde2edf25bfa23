//! `sidestep child`: the process that a server starts for long work. It is hidden from the help.

use super::CommandError;
use crate::jobs::child;

/// Run one task that the server sends on stdin, at low priority and with limited memory.
#[derive(Clone, Debug, clap::Args)]
pub struct ChildArgs {
    /// Memory limit (MiB).
    #[arg(long, value_name = "MIB")]
    memory: u64,
    /// Number of threads.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Nice value, from 0 (normal priority) to 19 (lowest).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i32).range(0..=19))]
    nice: i32,
}

/// Runs the task until it is done or the server is gone. Does not start an async runtime, because the
/// threads of a runtime would start with normal priority.
///
/// # Errors
/// [`CommandError`] if the work cannot start, or the server is gone.
pub fn run(args: &ChildArgs) -> Result<(), CommandError> {
    child::run(args.memory, usize::from(args.threads), args.nice).map_err(CommandError::failure)
}
