//! The server's side of long work in a child process.

use super::frames::{self, FromChild, ToChild};
use anyhow::Context;
use std::io;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncReadExt, BufReader};
use tokio::process::{Child, ChildStdin, ChildStdout, Command};
use tokio::task::JoinHandle;

/// The subcommand of a child process.
pub const SUBCOMMAND: &str = "child";

/// The lowest possible priority.
pub const LOWEST_PRIORITY: i32 = 19;

/// Grace period for a child process to exit after its last message.
const ENDING: Duration = Duration::from_secs(5);

/// Maximum number of bytes of a child's stderr that are kept.
const LONGEST_COMPLAINT: u64 = 4096;

/// Settings of child processes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Children {
    /// The program. By default, it is the running program.
    pub program: Option<PathBuf>,
    /// Memory limit per process (MiB).
    pub memory_mib: u64,
    /// Number of threads per process.
    pub threads: usize,
    /// The nice value of the processes. By default, a server uses [`LOWEST_PRIORITY`].
    pub nice: i32,
}

impl Children {
    /// Starts a child process. It is killed on drop.
    ///
    /// # Errors
    /// If the process cannot be started.
    pub fn start(&self) -> anyhow::Result<Running> {
        let mut command = Command::new(self.program()?);
        command
            .arg(SUBCOMMAND)
            .args(["--memory", &self.memory_mib.to_string()])
            .args(["--threads", &self.threads.to_string()])
            .args(["--nice", &self.nice.to_string()])
            // The child gets no key and no other environment variable.
            .env_clear()
            .current_dir("/")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true);
        #[cfg(unix)]
        command
            .arg0("sidestep")
            // The child gets its own process group, so Ctrl-C reaches only the server. The server ends
            // the child.
            .process_group(0);
        let mut process = command.spawn().context("starting a child process")?;
        let stdin = process.stdin.take().context("the child's stdin")?;
        let stdout = process.stdout.take().context("the child's stdout")?;
        let stderr = process.stderr.take().context("the child's stderr")?;
        let complaint = tokio::spawn(complaint(stderr));
        let memory_mib = self.memory_mib;
        Ok(Running { process, stdin, stdout: BufReader::new(stdout), complaint, memory_mib })
    }

    /// The running program, even if its file was replaced by another version.
    fn program(&self) -> anyhow::Result<PathBuf> {
        match &self.program {
            Some(program) => Ok(program.clone()),
            None if cfg!(target_os = "linux") => Ok("/proc/self/exe".into()),
            None => std::env::current_exe().context("this program's file"),
        }
    }
}

/// The first bytes of a child's stderr. Reads and discards the rest.
async fn complaint(mut stderr: impl AsyncRead + Unpin) -> String {
    let mut said = Vec::new();
    let mut beginning = (&mut stderr).take(LONGEST_COMPLAINT);
    // If reading fails, return the text that was read before.
    let _ = beginning.read_to_end(&mut said).await;
    let _ = tokio::io::copy(&mut stderr, &mut tokio::io::sink()).await;
    String::from_utf8_lossy(&said).trim_end().to_owned()
}

/// A running child process.
#[derive(Debug)]
pub struct Running {
    process: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    complaint: JoinHandle<String>,
    memory_mib: u64,
}

/// The reason why a child process ended early.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The child failed. The sentence explains the reason to an experimenter.
    Failed(String),
    /// The child received a termination signal. At a shutdown, the system sends such a signal to every
    /// process.
    Asked,
}

impl Running {
    /// Sends a message to the child.
    ///
    /// # Errors
    /// If the child has ended.
    pub async fn tell(&mut self, message: &ToChild, beside: &[u8]) -> io::Result<()> {
        frames::send(&mut self.stdin, message, beside).await
    }

    /// The child's next message, with its attachment.
    ///
    /// # Errors
    /// If the child has ended.
    pub async fn hear(&mut self) -> io::Result<(FromChild, Vec<u8>)> {
        frames::receive(&mut self.stdout).await
    }

    /// Waits until the child exits after its last message, and returns why it ended.
    pub async fn ended(mut self) -> Ended {
        let status = tokio::time::timeout(ENDING, self.process.wait()).await;
        let Ok(Ok(status)) = status else {
            return Ended::Failed("its process stopped responding and did not exit".to_owned());
        };
        let complaint = self.complaint.await.unwrap_or_default();
        if !complaint.is_empty() {
            tracing::warn!(%status, complaint, "a child process ended");
        }
        why(status, &complaint, self.memory_mib)
    }
}

/// The reason for the end of a child, in a sentence for experimenters.
fn why(status: ExitStatus, complaint: &str, memory_mib: u64) -> Ended {
    const LESS: &str = "request fewer sets, shorter grids or paper_only";
    #[cfg(unix)]
    let signal = std::os::unix::process::ExitStatusExt::signal(&status);
    #[cfg(not(unix))]
    let signal = None::<i32>;
    const KILL: i32 = 9;
    // Signals that a terminal, a user or the system sends.
    const ASKING: [i32; 3] = [1, 2, 15];
    Ended::Failed(match signal {
        Some(signal) if ASKING.contains(&signal) => return Ended::Asked,
        // Rust prints this message if it cannot allocate memory, for example for a thread's stack.
        _ if complaint.contains("memory allocation of") => format!(
            "it needs more memory than the {memory_mib} MiB that the server allows; {LESS}, or start the \
             server with a larger --analysis-memory"
        ),
        Some(KILL) => format!(
            "its process was killed, probably because the system is short of memory; {LESS}, or give the \
             machine more memory"
        ),
        _ => format!("its process crashed ({status}); see the server's log"),
    })
}
