//! A PostgreSQL server for one test, in a private folder and on a Unix socket. Dropping it removes
//! the server.
//!
//! Requires Debian's package `postgresql`, which `cargo xtask test` installs.

use crate::Database;
use crate::database::psql;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The user `nobody`, who owns the server's files if the tests run as root, because PostgreSQL
/// refuses to run as root.
const NOBODY: u32 = 65_534;

/// The user of the databases.
const USER: &str = "app";

/// Timeout for the server to accept connections.
const PATIENCE: Duration = Duration::from_secs(300);

/// Whether a commit waits for the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fsync {
    /// A commit waits for the disk, as in production.
    On,
    /// A commit does not wait, which is faster. For tests without power cuts.
    Off,
}

/// How a server is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Ends all sessions, rolls back their transactions, and writes all data to the files.
    Fast,
    /// The processes exit immediately without writing. The next start recovers the data.
    Immediate,
    /// Kills the server (SIGKILL), as in a power cut. The next start recovers the data.
    Kill,
}

/// A running or stopped server with its databases.
#[derive(Debug)]
pub struct Cluster {
    folder: TempDir,
    /// Settings for the server's command line. They take precedence over the configuration files.
    pub settings: Vec<String>,
    /// Port in the name of the socket. It is also the TCP port if `settings` enable TCP.
    port: u16,
    running: Option<Child>,
    databases: Cell<usize>,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        self.stop(Stop::Immediate);
    }
}

impl Cluster {
    /// Creates a cluster and starts it.
    ///
    /// # Panics
    /// If PostgreSQL is not installed or does not start.
    #[must_use]
    pub fn start(fsync: Fsync) -> Self {
        let mut cluster = Self::made(fsync);
        cluster.start_again();
        cluster
    }

    /// Like [`Self::start`], but for async tests.
    ///
    /// # Panics
    /// If PostgreSQL is not installed or does not start.
    pub async fn new(fsync: Fsync) -> Self {
        let started = tokio::task::spawn_blocking(move || Self::start(fsync));
        started.await.expect("a cluster")
    }

    /// Like [`Self::start`], but also listens on a TCP port of this machine.
    ///
    /// # Panics
    /// If PostgreSQL is not installed or does not start.
    #[must_use]
    pub fn at_port(port: u16) -> Self {
        let mut cluster = Self::made(Fsync::Off);
        cluster.listen_at(port);
        cluster.start_again();
        cluster
    }

    fn listen_at(&mut self, port: u16) {
        self.settings.push("listen_addresses=127.0.0.1".to_owned());
        self.port = port;
    }

    /// Like [`Self::at_port`], but TCP connections require TLS and a password.
    ///
    /// # Panics
    /// If PostgreSQL is not installed or does not start.
    #[must_use]
    pub fn encrypted(password: &str, port: u16, certificate: &str, key: &str) -> Self {
        let mut cluster = Self::made(Fsync::Off);
        let data = cluster.data();
        for (name, text) in [("server.crt", certificate), ("server.key", key)] {
            std::fs::write(data.join(name), text).expect(name);
            own(&data.join(name));
        }
        let private = std::os::unix::fs::PermissionsExt::from_mode(0o600);
        std::fs::set_permissions(data.join("server.key"), private).expect("a private key");
        let rules = "local all all trust\nhostssl all all 127.0.0.1/32 scram-sha-256\n";
        std::fs::write(data.join("pg_hba.conf"), rules).expect("rules");
        cluster.settings.push("ssl=on".to_owned());
        cluster.listen_at(port);
        cluster.start_again();
        cluster.ask(&format!("ALTER USER {USER} PASSWORD '{password}'"));
        cluster
    }

    /// Starts a standby that follows this cluster, on another port. From then on, this cluster
    /// acknowledges a commit only when the standby has it.
    ///
    /// # Panics
    /// If the standby does not follow.
    #[must_use]
    pub fn standby(&self, port: u16) -> Self {
        let folder = TempDir::new().expect("a folder");
        own(folder.path());
        let mut copy = command("pg_basebackup");
        copy.arg("--host").arg(self.folder()).arg(format!("--port={}", self.port));
        copy.args(["--username", USER, "--no-sync"]);
        copy.args(["--checkpoint=fast", "--write-recovery-conf", "--pgdata"]);
        let copied = copy.arg(folder.path().join("data")).output().expect("pg_basebackup");
        assert!(copied.status.success(), "{}", String::from_utf8_lossy(&copied.stderr));
        let settings = self.settings.clone();
        let mut standby = Self { folder, settings, port, running: None, databases: Cell::new(0) };
        standby.start_again();
        self.ask("ALTER SYSTEM SET synchronous_standby_names = '*'");
        self.ask("SELECT pg_reload_conf()");
        let follows = "SELECT count(*) FROM pg_stat_replication WHERE sync_state = 'sync'";
        let end = Instant::now() + PATIENCE;
        while self.ask(follows) == ["0"] {
            assert!(Instant::now() < end, "the standby does not follow: {}", standby.log());
            std::thread::sleep(Duration::from_millis(20));
        }
        standby
    }

    /// Promotes this standby to primary, and returns when it accepts writes.
    pub fn promote(&self) {
        // The base copy includes the primary's setting, but no standby follows the new primary.
        self.ask("SELECT pg_promote()");
        self.ask("ALTER SYSTEM RESET synchronous_standby_names");
        self.ask("SELECT pg_reload_conf()");
    }

    fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    /// Creates a cluster that is not running yet.
    fn made(fsync: Fsync) -> Self {
        let folder = TempDir::new().expect("a folder");
        own(folder.path());
        let data = folder.path().join("data");
        let mut initdb = command("initdb");
        initdb.arg("--pgdata").arg(&data);
        initdb.args([
            "--auth=trust",
            "--no-sync",
            "--encoding=UTF8",
            "--locale=C",
            "--username",
            USER,
        ]);
        let made = initdb.output().expect("initdb");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let fsync = match fsync {
            Fsync::On => "fsync=on",
            Fsync::Off => "fsync=off",
        };
        let settings = ["listen_addresses=", "max_connections=200", fsync].map(str::to_owned);
        let settings = settings.into();
        Self { folder, settings, port: 5432, running: None, databases: Cell::new(0) }
    }

    /// Starts the server after a stop, and returns when it accepts connections.
    ///
    /// # Panics
    /// If the server is running, or does not start.
    pub fn start_again(&mut self) {
        assert!(self.running.is_none(), "it runs");
        let end = Instant::now() + PATIENCE;
        // Processes of a killed server might still be exiting. Until they have exited, a new server
        // refuses to start.
        while !self.try_start() {
            assert!(Instant::now() < end, "PostgreSQL does not start: {}", self.log());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Starts the server. Returns false if it exits instead of accepting connections.
    fn try_start(&mut self) -> bool {
        let log = std::fs::File::options().create(true).append(true).open(self.log_file());
        let child = command("postgres")
            .arg("-D")
            .arg(self.data())
            .arg("-k")
            .arg(self.folder.path())
            .args(self.settings.iter().flat_map(|setting| ["-c", setting]))
            .arg(format!("--port={}", self.port))
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log.expect("a log"))
            .spawn();
        let mut child = child.expect("postgres");
        let end = Instant::now() + PATIENCE;
        while !self.accepts() {
            if child.try_wait().expect("its state").is_some() {
                return false;
            }
            assert!(Instant::now() < end, "PostgreSQL is not ready: {}", self.log());
            std::thread::sleep(Duration::from_millis(20));
        }
        self.running = Some(child);
        true
    }

    /// Stops the server if it is running, and returns when it has exited.
    ///
    /// # Panics
    /// If the signal cannot be sent.
    pub fn stop(&mut self, how: Stop) {
        let Some(mut child) = self.running.take() else { return };
        let signal = match how {
            Stop::Fast => "-INT",
            Stop::Immediate => "-QUIT",
            Stop::Kill => "-KILL",
        };
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(sent.is_ok_and(|status| status.success()), "kill {signal}");
        child.wait().expect("its end");
    }

    /// Creates an empty database.
    ///
    /// # Panics
    /// If it cannot be created.
    #[must_use]
    pub fn create(&self) -> Database {
        let number = self.databases.replace(self.databases.get() + 1);
        let name = format!("test{number}");
        self.ask(&format!("CREATE DATABASE {name}"));
        Database::Postgres(self.url(&name))
    }

    /// Runs a statement in the database `postgres`, and returns the first column of the result.
    fn ask(&self, statement: &str) -> Vec<String> {
        let mut found = Vec::new();
        psql(&self.url("postgres"), statement, |row| found.push(row[0].to_owned()));
        found
    }

    /// The address of a database.
    #[must_use]
    pub fn url(&self, name: &str) -> String {
        let host = self.folder.path().display();
        format!("postgres:///{name}?host={host}&user={USER}&port={}", self.port)
    }

    /// The folder that contains the socket.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    fn accepts(&self) -> bool {
        let mut ready = Command::new(program("pg_isready"));
        ready.arg("--quiet").arg("--host").arg(self.folder.path()).args(["--username", USER]);
        ready.arg(format!("--port={}", self.port));
        ready.status().is_ok_and(|status| status.success())
    }

    fn log_file(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    /// The server's log.
    fn log(&self) -> String {
        std::fs::read_to_string(self.log_file()).unwrap_or_default()
    }
}

/// A PostgreSQL program, run as a user whom it accepts.
fn command(name: &str) -> Command {
    let program = program(name);
    if !is_root() {
        return Command::new(program);
    }
    let mut command = Command::new("setpriv");
    command.arg(format!("--reuid={NOBODY}")).arg(format!("--regid={NOBODY}"));
    command.arg("--clear-groups").arg(program);
    command
}

/// The path of a program of the newest installed version.
fn program(name: &str) -> PathBuf {
    let versions = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let number = |path: &Path| path.file_name()?.to_str()?.parse::<u32>().ok();
    let newest = versions.map(|entry| entry.path()).max_by_key(|path| number(path));
    let installed = newest.map(|version| version.join("bin").join(name));
    installed.filter(|program| program.is_file()).unwrap_or_else(|| name.into())
}

fn is_root() -> bool {
    std::fs::metadata("/proc/self").is_ok_and(|own| std::os::unix::fs::MetadataExt::uid(&own) == 0)
}

/// Makes the user who runs the server the owner of a folder or file.
fn own(folder: &Path) {
    if is_root() {
        std::os::unix::fs::chown(folder, Some(NOBODY), Some(NOBODY)).expect("a folder of nobody's");
    }
}
