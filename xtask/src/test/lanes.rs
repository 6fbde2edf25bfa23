//! Runs two lanes of tests in parallel. One lane mostly waits, for example for a page to paint or a server to
//! start, while the other computes.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use std::{iter, thread};

use anyhow::{Context, Result};

use crate::command::beneath;
use crate::workspace::cannot_start;

/// A named command of a lane.
pub(super) struct Part {
    name: String,
    command: Command,
}

impl Part {
    pub(super) fn new(name: impl Into<String>, command: Command) -> Self {
        Self { name: name.into(), command }
    }
}

/// Number of lines at the end of a failed part's output that are printed again after all parts have run. They
/// are enough to show the names of the failed tests.
const SHOWN_AGAIN: usize = 30;

/// Polling interval for new output of a part.
const LOOK: Duration = Duration::from_millis(200);

/// Runs both lanes in parallel. Each lane runs its parts in order, even if some fail. When the first lane has
/// ended, the parts of the second lane run two at a time. Prints the output of the first lane immediately, and
/// the output of each part of the second lane when that part ends. Also stores all output in `folder`.
///
/// # Errors
/// If a part cannot be started or its output cannot be stored.
pub(super) fn run(waiting: Vec<Part>, computing: Vec<Part>, folder: &Path) -> Result<ExitCode> {
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let computing =
        computing.into_iter().map(|part| Part { command: beneath(part.command), ..part });
    let computing = Mutex::new(computing);
    let next = || computing.lock().unwrap_or_else(PoisonError::into_inner).next();
    let failed = thread::scope(|scope| {
        let beside = scope.spawn(|| lane(iter::from_fn(next), folder, false));
        let mut failed = lane(waiting.into_iter(), folder, true)?;
        failed.extend(lane(iter::from_fn(next), folder, false)?);
        let beside = beside.join().map_err(|_| anyhow::anyhow!("a lane of tests panicked"))?;
        failed.extend(beside?);
        anyhow::Ok(failed)
    })?;
    for (name, said) in &failed {
        eprintln!("\n==> failed: {name}\n{}", end_of(said, SHOWN_AGAIN));
    }
    if failed.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    let names: Vec<_> = failed.iter().map(|(name, _)| &name[..]).collect();
    eprintln!("\nfailed: {}; their full output is in {}", names.join(", "), folder.display());
    Ok(ExitCode::FAILURE)
}

/// Runs one lane and returns the name and the output of each failed part.
fn lane(
    parts: impl Iterator<Item = Part>,
    folder: &Path,
    at_once: bool,
) -> Result<Vec<(String, String)>> {
    let mut failed = Vec::new();
    for Part { name, mut command } in parts {
        eprintln!("==> {name}");
        let begun = Instant::now();
        let log = folder.join(name.replace([' ', '/'], "-")).with_extension("log");
        let succeeded = run_one(&mut command, &log, at_once)?;
        let said = said(&log)?;
        if !at_once {
            print(said.as_bytes())?;
        }
        let how = if succeeded { "" } else { "failed after " };
        eprintln!("    {name}: {how}{:.1} s", begun.elapsed().as_secs_f64());
        if !succeeded {
            failed.push((name, said));
        }
    }
    Ok(failed)
}

/// Runs a command and returns whether it succeeds. The output goes to a file and not to a pipe, because an
/// orphaned child process could keep a pipe open.
fn run_one(command: &mut Command, log: &Path, at_once: bool) -> Result<bool> {
    let cannot_write = || format!("cannot write {}", log.display());
    let out = File::create(log).with_context(cannot_write)?;
    let errors = out.try_clone().with_context(cannot_write)?;
    let mut shown = File::open(log).with_context(cannot_write)?;
    command.stdin(Stdio::null()).stdout(out).stderr(errors);
    let mut child = command.spawn().with_context(|| cannot_start(command))?;
    loop {
        let status = child.try_wait().context("waiting for a process")?;
        if at_once {
            let mut more = Vec::new();
            shown.read_to_end(&mut more).context("what a process says")?;
            print(&more)?;
        }
        if let Some(status) = status {
            return Ok(status.success());
        }
        thread::sleep(LOOK);
    }
}

fn said(log: &Path) -> Result<String> {
    let bytes = fs::read(log).with_context(|| format!("cannot read {}", log.display()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Prints a piece of output while stdout is locked, so that the lanes' lines do not interleave.
fn print(piece: &[u8]) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(piece).and_then(|()| out.flush()).context("standard output")
}

/// The last lines of a text.
fn end_of(text: &str, lines: usize) -> &str {
    let text = text.trim_end();
    let begin = text.rmatch_indices('\n').nth(lines - 1).map_or(0, |(at, _)| at + 1);
    &text[begin..]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(name: &str, argument: &str) -> Part {
        let mut command = Command::new("rustc");
        command.arg(argument);
        Part::new(name, command)
    }

    #[test]
    fn all_parts_of_both_lanes_run_even_if_some_fail() {
        let folder = tempfile::tempdir().expect("a folder");
        let waiting = vec![part("no such thing", "--no-such-flag"), part("the first", "--version")];
        let computing = vec![part("a/second", "--version")];
        let code = run(waiting, computing, folder.path()).expect("both lanes");
        assert_eq!(code, ExitCode::FAILURE);
        let said = |name: &str| said(&folder.path().join(name)).expect(name);
        assert!(said("no-such-thing.log").contains("no-such-flag"));
        assert!(said("the-first.log").starts_with("rustc "));
        assert!(said("a-second.log").starts_with("rustc "));
        let well = run(vec![part("x", "--version")], Vec::new(), folder.path());
        assert_eq!(well.expect("a lane"), ExitCode::SUCCESS);
    }

    #[test]
    fn the_end_of_a_text_is_its_last_lines() {
        assert_eq!(end_of("a\nb\nc\n\n", 2), "b\nc");
        assert_eq!(end_of("a\n", 2), "a");
    }
}
