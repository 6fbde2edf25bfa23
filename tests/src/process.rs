//! The `sidestep` command as a process: exit codes, output and signals.

use crate::server::write_site;
use crate::{Address, Database, Folder};
use serde_json::Value;
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::LazyLock;
#[cfg(unix)]
use std::time::Duration;
use tokio::io::{AsyncBufReadExt, BufReader, Lines};
use tokio::process::{Child, ChildStdout, Command};

/// The path of the installed command, from `SIDESTEP_BIN`. The site of the client is beside the
/// command.
///
/// # Panics
/// If `SIDESTEP_BIN` is not set.
pub fn binary() -> &'static Path {
    static BINARY: LazyLock<PathBuf> = LazyLock::new(|| {
        let given = std::env::var_os("SIDESTEP_BIN");
        given.expect("SIDESTEP_BIN: run the tests with `cargo xtask test`, which sets it").into()
    });
    &BINARY
}

/// Runs the command to completion.
///
/// # Panics
/// If it cannot be run.
pub async fn sidestep(args: &[&str]) -> Output {
    let mut command = Command::new(binary());
    command.args(args).env_remove("SIDESTEP_ADMIN_KEY");
    command.kill_on_drop(true).output().await.expect("sidestep")
}

/// The output and exit code of a command.
#[derive(Debug)]
pub struct Said {
    /// Exit code. `None` if a signal ended the process.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl From<Output> for Said {
    fn from(Output { status, stdout, stderr }: Output) -> Self {
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        Self { code: status.code(), out: text(stdout), err: text(stderr) }
    }
}

impl Said {
    /// The result of a successful command: one line of JSON on stdout.
    ///
    /// # Panics
    /// If the command failed, or printed anything else on stdout.
    pub fn json(&self) -> Value {
        assert_eq!(self.code, Some(0), "{}", self.err);
        assert_eq!(self.out.trim_end().lines().count(), 1, "{}", self.out);
        serde_json::from_str(&self.out).expect("JSON")
    }

    /// Like [`Self::json`], but also checks that stderr is empty.
    ///
    /// # Panics
    /// If stderr is not empty, or as for [`Self::json`].
    pub fn only_json(&self) -> Value {
        assert_eq!(self.err, "", "no bar and no warning");
        self.json()
    }

    /// Checks that the command exited with this code, printed no result, and reported an error in
    /// one line that contains all these words. (Errors about flags can have more lines.)
    ///
    /// # Panics
    /// If it did not.
    pub fn refused(&self, code: i32, words: &[&str]) {
        assert_eq!((self.code, self.out.as_str()), (Some(code), ""), "{}", self.err);
        let lines = self.err.trim_end().lines().count();
        assert!(lines == 1 || self.err.starts_with("error: "), "{}", self.err);
        for word in words {
            assert!(self.err.contains(word), "{word} in {}", self.err);
        }
    }
}

/// Runs the command to completion and returns its output.
///
/// # Panics
/// If it cannot be run, or its output is not UTF-8.
pub async fn run(args: &[&str]) -> Said {
    sidestep(args).await.into()
}

/// Runs the command, and sends it `signal` (`INT` or `TERM`) as soon as it handles this signal and
/// `is_due` returns true. Returns the output.
///
/// # Panics
/// If the command cannot be run, exits before the signal, or does not exit within five minutes
/// after the signal.
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
    let output = tokio::time::timeout(Duration::from_secs(300), child.wait_with_output()).await;
    output.expect("it ends").expect("its output")
}

/// Whether a process handles the signal, according to Linux.
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

/// `sidestep serve` as a process. Dropping it kills the process.
pub struct Process {
    /// The lines that the server printed before it was ready.
    pub announcement: Vec<String>,
    address: Address,
    child: Child,
    // Kept open, because the server could not print to a closed stdout.
    stdout: Lines<BufReader<ChildStdout>>,
}

impl Deref for Process {
    type Target = Address;

    fn deref(&self) -> &Address {
        &self.address
    }
}

impl Process {
    /// Starts a server with the database `sidestep.db` in `folder`. Its log is the file `log` in
    /// `folder`.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start(folder: &Folder) -> Self {
        Self::start_through(&["env"], folder, &folder.database("sidestep.db")).await
    }

    /// Like [`Self::start`], but with another database. `launcher` is the program that starts the
    /// server, by running its arguments as a command.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start_through(launcher: &[&str], folder: &Folder, database: &str) -> Self {
        Self::launch(launcher, folder, &["--database", database]).await
    }

    /// Like [`Self::start`], but with the demonstration.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start_demo(folder: &Folder) -> Self {
        let database = folder.database("sidestep.db");
        Self::launch(&["env"], folder, &["--demo", "--database", &database]).await
    }

    /// Like [`Self::start`], but with this SQLite or PostgreSQL database.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start_on(folder: &Folder, database: &Database) -> Self {
        let started = Self::try_start_on(folder, database).await;
        started.unwrap_or_else(|log| panic!("a server that becomes ready: {log}"))
    }

    /// Like [`Self::start_on`], but with further arguments.
    ///
    /// # Panics
    /// If it does not become ready.
    pub async fn start_with(folder: &Folder, database: &Database, args: &[&str]) -> Self {
        Self::launch(&["env"], folder, &[&["--database", &database.url()], args].concat()).await
    }

    /// Like [`Self::start_on`], but returns an error if the server exits before it is ready.
    ///
    /// # Errors
    /// The server's log.
    pub async fn try_start_on(folder: &Folder, database: &Database) -> Result<Self, String> {
        Self::try_launch(&["env"], folder, &["--database", &database.url()]).await
    }

    async fn launch(launcher: &[&str], folder: &Folder, args: &[&str]) -> Self {
        let started = Self::try_launch(launcher, folder, args).await;
        started.unwrap_or_else(|log| panic!("a server that becomes ready: {log}"))
    }

    async fn try_launch(launcher: &[&str], folder: &Folder, args: &[&str]) -> Result<Self, String> {
        let site = folder.path("site");
        write_site(&site);
        let mut child = Command::new(launcher[0])
            .args(&launcher[1..])
            .arg(binary())
            .args(["serve", "--listen", "127.0.0.1:0", "--static"])
            .arg(&site)
            .args(args)
            .env_remove("SIDESTEP_ADMIN_KEY")
            // The default, as for users: one log line per request.
            .env_remove("RUST_LOG")
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(folder.path("log")).expect("a log"))
            .kill_on_drop(true)
            .spawn()
            .expect("sidestep serve");
        let stdout = child.stdout.take().expect("its stdout");
        let mut lines = BufReader::new(stdout).lines();
        let mut announcement = Vec::new();
        let origin = loop {
            let Some(line) = lines.next_line().await.expect("a line") else {
                return Err(folder.text("log"));
            };
            announcement.push(line.clone());
            if let Some((_, address)) = line.split_once("laboratory    ") {
                break address.trim_end_matches("/lab").to_owned();
            }
        };
        Ok(Self { announcement, address: Address::new(origin), child, stdout: lines })
    }

    /// The process id.
    ///
    /// # Panics
    /// If it has exited.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id().expect("a running process")
    }

    /// The experimenter's key, which the server creates and prints at its first start.
    ///
    /// # Panics
    /// If the server prints no key.
    pub async fn key(&mut self) -> String {
        loop {
            if let Some((_, key)) = self.says().await.split_once("#key=") {
                return key.to_owned();
            }
        }
    }

    /// The next line of stdout.
    ///
    /// # Panics
    /// If stdout ends.
    pub async fn says(&mut self) -> String {
        self.stdout.next_line().await.expect("a line").expect("a running server")
    }

    /// Sends SIGTERM, as a service manager does, and waits until the process has exited.
    ///
    /// # Panics
    /// If the signal cannot be sent.
    pub async fn stop(mut self) {
        let id = self.id().to_string();
        let sent = Command::new("kill").args(["-TERM", &id]).status().await;
        assert!(sent.expect("kill").success(), "process {id} cannot be stopped");
        self.child.wait().await.expect("an end");
    }

    /// Sends SIGKILL, which ends the process as abruptly as a power cut.
    ///
    /// # Panics
    /// If it cannot be killed.
    pub async fn kill(mut self) {
        self.child.kill().await.expect("a kill");
    }
}
