//! `cargo xtask serve`: builds everything, then replaces itself with the server.

use std::ffi::OsString;
use std::process::{Command, ExitCode};

use anyhow::Result;

use crate::build;
use crate::workspace::{Workspace, cannot_start};

/// Build client and server (release), then start `sidestep serve`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Arguments for `sidestep serve`, as in `-- --listen 127.0.0.1:9000`.
    #[arg(last = true)]
    arguments: Vec<OsString>,
}

/// Builds and serves. Returns only if the server cannot be started or, on systems where a process
/// cannot be replaced, when the server has ended.
///
/// # Errors
/// When the build fails or the server cannot be started.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    build::run(workspace, &build::Options::default())?;
    let mut server = Command::new(workspace.server());
    server.arg("serve").args(&options.arguments);
    become_process(&mut server)
}

/// Replaces this process with the server, so that the server itself receives signals and returns
/// the exit code.
#[cfg(unix)]
fn become_process(command: &mut Command) -> Result<ExitCode> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(anyhow::Error::new(error).context(cannot_start(command)))
}

/// Runs the server until it ends, on systems where a process cannot be replaced.
#[cfg(not(unix))]
fn become_process(command: &mut Command) -> Result<ExitCode> {
    crate::workspace::answer_of(command)
}
