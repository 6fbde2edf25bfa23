//! The server as a process.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Instant;

use anyhow::{Context, bail};
use tokio::io::{AsyncBufReadExt, BufReader, Lines};
use tokio::process::{Child, ChildStdout, Command};

/// `sidestep serve`; killed when dropped.
pub(crate) struct Server {
    pub(crate) address: SocketAddr,
    /// Its process.
    pub(crate) id: u32,
    /// From its start until it said that it was ready, ms.
    pub(crate) ready_ms: f64,
    child: Child,
    // Kept open: a server whose stdout is gone could not print.
    _stdout: Lines<BufReader<ChildStdout>>,
}

/// The database in `folder`.
pub(crate) fn database(folder: &Path) -> PathBuf {
    folder.join("sidestep.db")
}

impl Server {
    /// Starts on the database in `folder`. What it logs is in the file `log` there.
    pub(crate) async fn start(folder: &Path) -> anyhow::Result<Self> {
        let site = folder.join("site");
        std::fs::create_dir_all(site.join("assets"))?;
        for page in ["index", "participant", "lab"] {
            std::fs::write(site.join(page).with_extension("html"), "<!doctype html>")?;
        }
        let binary = std::env::var_os("SIDESTEP_BIN")
            .unwrap_or_else(|| env!("CARGO_BIN_EXE_sidestep").into());
        let begin = Instant::now();
        let mut child = Command::new(binary)
            .args(["serve", "--listen", "127.0.0.1:0", "--database"])
            .arg(format!("sqlite:{}", database(folder).display()))
            .arg("--static")
            .arg(&site)
            // As users have it: a line of the log for each request.
            .env_remove("RUST_LOG")
            .env_remove("SIDESTEP_ADMIN_KEY")
            .stdout(Stdio::piped())
            .stderr(std::fs::File::create(folder.join("log"))?)
            .kill_on_drop(true)
            .spawn()
            .context("cannot start the server")?;
        let mut stdout = BufReader::new(child.stdout.take().context("its stdout")?).lines();
        while let Some(line) = stdout.next_line().await? {
            if let Some((_, address)) = line.split_once("laboratory    http://") {
                return Ok(Self {
                    address: address.trim_end_matches("/lab").parse()?,
                    id: child.id().context("a process that runs")?,
                    ready_ms: 1e3 * begin.elapsed().as_secs_f64(),
                    child,
                    _stdout: stdout,
                });
            }
        }
        let log = std::fs::read_to_string(folder.join("log"))?;
        bail!("the server did not become ready: {}", log.trim_end())
    }

    /// SIGKILL.
    pub(crate) async fn kill(mut self) -> anyhow::Result<()> {
        self.child.kill().await.context("cannot kill the server")
    }
}

/// What a process has used, as Linux counts it; elsewhere nothing is known.
pub(crate) struct Usage {
    /// Of all its threads, s.
    pub(crate) cpu_s: f64,
    /// In memory now and at most, MB.
    memory_mb: [f64; 2],
}

impl Usage {
    pub(crate) fn of(process: u32) -> anyhow::Result<Self> {
        if !cfg!(target_os = "linux") {
            return Ok(Self { cpu_s: f64::NAN, memory_mb: [f64::NAN; 2] });
        }
        /// Of the clock that processes are shown; Linux has no other.
        const TICKS_PER_S: f64 = 100.0;
        let read = |name| {
            let path = format!("/proc/{process}/{name}");
            std::fs::read_to_string(&path).context(path)
        };
        let stat = read("stat")?;
        // The name of the program, in brackets, may hold spaces.
        let (_, fields) = stat.rsplit_once(')').context("fields")?;
        let ticks = fields.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
        let ticks: f64 = ticks.sum::<Result<f64, _>>()?;
        let status = read("status")?;
        let kilobytes = |field: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(field))?;
            line.split_whitespace().next()?.parse::<f64>().ok()
        };
        let memory = ["VmRSS:", "VmHWM:"].map(|field| kilobytes(field).unwrap_or(f64::NAN));
        Ok(Self { cpu_s: ticks / TICKS_PER_S, memory_mb: memory.map(|kb| kb / 1024.0) })
    }

    /// CPU since another look; memory now.
    pub(crate) fn since(&self, before: &Self) -> Self {
        Self { cpu_s: self.cpu_s - before.cpu_s, memory_mb: self.memory_mb }
    }

    /// On average over that time.
    pub(crate) fn shown(&self, seconds: f64) -> String {
        let [now, most] = self.memory_mb;
        format!("{:.2} cores, {now:.0} MB (≤ {most:.0})", self.cpu_s / seconds)
    }
}
