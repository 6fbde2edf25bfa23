//! Time and peak memory of a command.

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use std::{fs, thread};

use anyhow::{Context, Result, bail};

/// Elapsed time (s) of a command, and its peak memory (MB) if the operating system reports it.
pub(super) struct Measured {
    pub(super) wall_s: f64,
    pub(super) memory_mb: Option<f64>,
}

impl Measured {
    /// The peak memory as text.
    pub(super) fn memory(&self) -> String {
        self.memory_mb.map_or_else(|| "-".to_owned(), |mb| format!("{mb:.0}"))
    }
}

/// Runs a command with its stdout redirected to `out`.
///
/// # Errors
/// If the command cannot be started or fails.
pub(super) fn measured(command: &mut Command, out: impl Into<Stdio>) -> Result<Measured> {
    let name = command.get_program().display().to_string();
    let start = Instant::now();
    let mut child = command.stdout(out).spawn().with_context(|| format!("cannot start {name}"))?;
    let mut memory_mb = None;
    let status = loop {
        // Linux reports the peak so far, so the last reading before the process ends is kept.
        memory_mb = peak_memory_mb(child.id()).or(memory_mb);
        if let Some(status) = child.try_wait()? {
            break status;
        }
        thread::sleep(Duration::from_millis(5));
    };
    let wall_s = start.elapsed().as_secs_f64();
    if !status.success() {
        bail!("{name} failed: {status}");
    }
    Ok(Measured { wall_s, memory_mb })
}

/// Peak memory of a process so far, as reported by Linux.
fn peak_memory_mb(process: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1024.0)
}
