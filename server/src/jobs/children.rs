//! Long work in a process of its own: the server's side of it.

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

/// The lowest priority that there is.
pub const LOWEST_PRIORITY: i32 = 19;

/// A child that has said its last word has this long to end.
const ENDING: Duration = Duration::from_secs(5);

/// Most bytes of a child's complaint that are kept.
const LONGEST_COMPLAINT: u64 = 4096;

/// How child processes are started.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Children {
    /// The program; none is this one.
    pub program: Option<PathBuf>,
    /// The most memory of one of them, MiB.
    pub memory_mib: u64,
    /// The threads of one of them.
    pub threads: usize,
    /// Their priority, as for the command nice: [`LOWEST_PRIORITY`], unless nobody collects data.
    pub nice: i32,
}

impl Children {
    /// Starts one. It is killed when it is dropped.
    ///
    /// # Errors
    /// If the system starts no process.
    pub fn start(&self) -> anyhow::Result<Running> {
        let mut command = Command::new(self.program()?);
        command
            .arg(SUBCOMMAND)
            .args(["--memory", &self.memory_mib.to_string()])
            .args(["--threads", &self.threads.to_string()])
            .args(["--nice", &self.nice.to_string()])
            // Neither a key nor anything else that is no business of the child's.
            .env_clear()
            .current_dir("/")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true);
        #[cfg(unix)]
        command
            .arg0("sidestep")
            // Ctrl-C is for the server, which then ends the child.
            .process_group(0);
        let mut process = command.spawn().context("starting a child process")?;
        let stdin = process.stdin.take().context("the child's stdin")?;
        let stdout = process.stdout.take().context("the child's stdout")?;
        let stderr = process.stderr.take().context("the child's stderr")?;
        let complaint = tokio::spawn(complaint(stderr));
        let memory_mib = self.memory_mib;
        Ok(Running { process, stdin, stdout: BufReader::new(stdout), complaint, memory_mib })
    }

    /// This program, even if its file was replaced meanwhile by that of another version.
    fn program(&self) -> anyhow::Result<PathBuf> {
        match &self.program {
            Some(program) => Ok(program.clone()),
            None if cfg!(target_os = "linux") => Ok("/proc/self/exe".into()),
            None => std::env::current_exe().context("this program's file"),
        }
    }
}

/// The beginning of what a child says to stderr.
async fn complaint(mut stderr: impl AsyncRead + Unpin) -> String {
    let mut said = Vec::new();
    let mut beginning = (&mut stderr).take(LONGEST_COMPLAINT);
    // What cannot be read was not said.
    let _ = beginning.read_to_end(&mut said).await;
    let _ = tokio::io::copy(&mut stderr, &mut tokio::io::sink()).await;
    String::from_utf8_lossy(&said).trim_end().to_owned()
}

/// A child process.
#[derive(Debug)]
pub struct Running {
    process: Child,
    stdin: ChildStdin,
    stdout: BufReader<ChildStdout>,
    complaint: JoinHandle<String>,
    memory_mib: u64,
}

/// How a child process ended that was to go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// By itself; the sentence tells an experimenter why.
    Failed(String),
    /// Somebody asked it to end, as the system does with every process when it shuts down.
    Asked,
}

impl Running {
    /// Tells the child.
    ///
    /// # Errors
    /// If it has ended.
    pub async fn tell(&mut self, message: &ToChild, beside: &[u8]) -> io::Result<()> {
        frames::send(&mut self.stdin, message, beside).await
    }

    /// What the child says next, with the bytes beside it.
    ///
    /// # Errors
    /// If it has ended.
    pub async fn hear(&mut self) -> io::Result<(FromChild, Vec<u8>)> {
        frames::receive(&mut self.stdout).await
    }

    /// How a child ended that says no more.
    pub async fn ended(mut self) -> Ended {
        let status = tokio::time::timeout(ENDING, self.process.wait()).await;
        let Ok(Ok(status)) = status else {
            return Ended::Failed("its process said nothing more and did not end".to_owned());
        };
        let complaint = self.complaint.await.unwrap_or_default();
        if !complaint.is_empty() {
            tracing::warn!(%status, complaint, "a child process ended");
        }
        why(status, &complaint, self.memory_mib)
    }
}

/// The sentence for an experimenter.
fn why(status: ExitStatus, complaint: &str, memory_mib: u64) -> Ended {
    const LESS: &str = "ask for fewer sets, shorter grids or paper_only";
    #[cfg(unix)]
    let signal = std::os::unix::process::ExitStatusExt::signal(&status);
    #[cfg(not(unix))]
    let signal = None::<i32>;
    const KILL: i32 = 9;
    // From a terminal, a person or the system.
    const ASKING: [i32; 3] = [1, 2, 15];
    Ended::Failed(match signal {
        Some(signal) if ASKING.contains(&signal) => return Ended::Asked,
        // What Rust says when there is no memory for an allocation, or for the stack of a thread.
        _ if complaint.contains("memory allocation of") => format!(
            "it needs more memory than the {memory_mib} MiB that the server allows; {LESS}, or start the \
             server with a larger --analysis-memory"
        ),
        Some(KILL) => format!(
            "its process was killed, as a system does that is short of memory; {LESS}, or give the \
             machine more memory"
        ),
        _ => format!("its process crashed ({status}); see the server's log"),
    })
}
