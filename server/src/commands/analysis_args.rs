//! The flags of `sidestep serve` for long work in child processes.

use crate::jobs::analysis::limits::Limits;
use crate::jobs::children::{Children, LOWEST_PRIORITY};
use std::path::PathBuf;

/// Resource limits of analyses.
#[derive(Clone, Debug, clap::Args)]
pub struct AnalysisArgs {
    /// Threads for analyses [default: all processors but one; all with --demo].
    #[arg(long = "analysis-threads", value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Memory limit of an analysis (MiB).
    ///
    /// The server refuses an analysis that it estimates to need more. An analysis that exceeds the
    /// limit fails, and the server continues.
    #[arg(
        long = "analysis-memory",
        value_name = "MIB",
        default_value_t = 2048,
        value_parser = clap::value_parser!(u64).range(64..=1_048_576)
    )]
    pub memory_mib: u64,
    /// Work limit of an analysis (processor hours).
    ///
    /// The server refuses an analysis that it estimates to need more.
    #[arg(
        long = "analysis-hours",
        value_name = "H",
        default_value = "24",
        value_parser = hours
    )]
    pub hours: f64,
    /// Executable of child processes. `None` means the running executable.
    #[arg(skip)]
    pub program: Option<PathBuf>,
    /// Nice value of child processes.
    #[arg(skip = LOWEST_PRIORITY)]
    pub nice: i32,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours| (0.01..=1e6).contains(hours));
    hours.ok_or_else(|| "expected a number from 0.01 to 1000000".to_owned())
}

impl AnalysisArgs {
    /// The settings for starting child processes. If `all` is true, the default number of threads
    /// is the number of processors; otherwise it is one less.
    #[must_use]
    pub fn children(&self, all: bool) -> Children {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        // Leave one processor for participants.
        let usual = if all { processors } else { (processors - 1).max(1) };
        Children {
            program: self.program.clone(),
            memory_mib: self.memory_mib,
            threads: self.threads.map_or(usual, usize::from),
            nice: self.nice,
        }
    }

    /// Resource limits of an analysis in a child process with these settings.
    #[must_use]
    pub fn limits(&self, children: &Children) -> Limits {
        Limits { memory_mib: self.memory_mib, hours: self.hours, threads: children.threads }
    }
}
