//! The `sidestep` command as a process: exit codes, output, sudden death.

use crate::server::write_site;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::LazyLock;
#[cfg(unix)]
use std::time::Duration;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt, BufReader, Lines};
use tokio::process::{Child, ChildStdout, Command};

/// The command as users get it, with the client beside it: `SIDESTEP_BIN`.
///
/// # Panics
/// If that is not set.
pub fn binary() -> &'static Path {
    static BINARY: LazyLock<PathBuf> = LazyLock::new(|| {
        let given = std::env::var_os("SIDESTEP_BIN");
        given.expect("SIDESTEP_BIN: run the tests with `cargo xtask test`, which sets it").into()
    });
    &BINARY
}

/// Runs the command to its end.
///
/// # Panics
/// If it cannot be run.
pub async fn sidestep(args: &[&str]) -> Output {
    let mut command = Command::new(binary());
    command.args(args).env_remove("SIDESTEP_ADMIN_KEY");
    command.kill_on_drop(true).output().await.expect("sidestep")
}

/// Runs the command, sends it `signal` (`INT` or `TERM`) as soon as it catches that signal and
/// `is_due` holds, and returns what it said.
///
/// # Panics
/// If the command cannot be run, ends before the signal, or does not end within a minute of it.
#[cfg(unix)]
pub async fn interrupted(args: &[&str], signal: &str, is_due: impl Fn() -> bool) -> Output {
    let mut command = Command::new(binary());
    command.args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).kill_on_drop(true);
    let mut child = command.spawn().expect("sidestep");
    let process = child.id().expect("it has just begun");
    while !(catches(process, signal) && is_due()) {
        let ended = child.try_wait().expect("its state");
        assert!(ended.is_none(), "it ended before the signal: {ended:?}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let kill = format!("kill -{signal} {process}");
    let killed = std::process::Command::new("sh").args(["-c", &kill]).status();
    assert!(killed.is_ok_and(|status| status.success()), "{kill}");
    let output = tokio::time::timeout(Duration::from_secs(60), child.wait_with_output()).await;
    output.expect("it ends").expect("its output")
}

/// Whether a process has a handler for the signal; Linux tells.
#[cfg(unix)]
fn catches(process: u32, signal: &str) -> bool {
    let number = match signal {
        "INT" => 2,
        "TERM" => 15,
        other => panic!("expected INT or TERM, found {other}"),
    };
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
    let mask = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (number - 1) & 1 == 1)
}

/// `sidestep serve` with its own folder; killed when dropped.
pub struct Process {
    /// `http://127.0.0.1:PORT`.
    pub origin: String,
    /// What it said when it was ready.
    pub announcement: Vec<String>,
    child: Child,
    // Kept open: a server whose stdout is gone could not print.
    _stdout: Lines<BufReader<ChildStdout>>,
}

impl Process {
    /// Starts in `folder`, with a database there and further arguments. What it
    /// logs is in the file `log`.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start(folder: &TempDir, further: &[&str]) -> Self {
        Self::launch(Command::new(binary()), folder, further).await
    }

    /// As [`Self::start`], through another program that runs the command that it is given.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start_through(launcher: &[&str], folder: &TempDir) -> Self {
        let mut command = Command::new(launcher[0]);
        command.args(&launcher[1..]).arg(binary());
        Self::launch(command, folder, &[]).await
    }

    async fn launch(mut command: Command, folder: &TempDir, further: &[&str]) -> Self {
        let site = folder.path().join("site");
        write_site(&site);
        let database = format!("sqlite:{}", folder.path().join("sidestep.db").display());
        let mut child = command
            .args(["serve", "--listen", "127.0.0.1:0", "--database", &database])
            .arg("--static")
            .arg(&site)
            .args(further)
            .env_remove("SIDESTEP_ADMIN_KEY")
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(folder.path().join("log")).expect("a log"))
            .kill_on_drop(true)
            .spawn()
            .expect("sidestep serve");
        let stdout = child.stdout.take().expect("its stdout");
        let mut lines = BufReader::new(stdout).lines();
        let mut announcement = Vec::new();
        let origin = loop {
            let line = lines.next_line().await.expect("a line");
            let line = line.expect("a server that becomes ready");
            announcement.push(line.clone());
            if let Some((_, address)) = line.split_once("laboratory    ") {
                break address.trim_end_matches("/lab").to_owned();
            }
        };
        Self { origin, announcement, child, _stdout: lines }
    }

    /// The number of the process.
    ///
    /// # Panics
    /// If it has ended.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id().expect("a running process")
    }

    /// SIGKILL, as a power cut or an operator's last resort would.
    ///
    /// # Panics
    /// If it cannot be killed.
    pub async fn kill(mut self) {
        self.child.kill().await.expect("a kill");
    }
}
