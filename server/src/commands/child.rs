//! `sidestep child`: what a server starts for long work. It is not for people, so no help lists it.

use super::CommandError;
use crate::jobs::child;

/// Does one task that a server gives through stdin, with a low priority and a limit of memory.
#[derive(Clone, Debug, clap::Args)]
pub struct ChildArgs {
    /// Most memory, MiB.
    #[arg(long, value_name = "MIB")]
    memory: u64,
    /// Threads.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Priority, from 0, the usual one, to 19, the lowest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(i32).range(0..=19))]
    nice: i32,
}

/// Works until the task is done or the server is gone. It needs no runtime, whose threads would start with
/// the usual priority.
///
/// # Errors
/// [`CommandError`] if it cannot begin, or the server is gone.
pub fn run(args: &ChildArgs) -> Result<(), CommandError> {
    child::run(args.memory, usize::from(args.threads), args.nice).map_err(CommandError::failure)
}
