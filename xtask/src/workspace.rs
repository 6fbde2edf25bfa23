//! Paths of the workspace and its build output, and commands that run in it.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

/// The folder of the client's builds in cargo's output folder. Cargo locks its output folder, so a
/// separate folder allows compiling the client in parallel with other code.
const CLIENT: &str = "client";

/// The target triple for browsers.
pub(crate) const WASM_TARGET: &str = "wasm32-unknown-unknown";

/// Where a program of the web client runs, which decides how it is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Runs {
    /// In a page, which does not appear until the program is loaded. Optimized for size.
    InPage,
    /// In a worker that computes for a page. Optimized for speed.
    InWorker,
}

/// The folders that every command uses.
pub(crate) struct Workspace {
    /// The folder of the workspace's `Cargo.toml`.
    root: PathBuf,
    /// Cargo's output folder, which the environment or cargo's configuration can set.
    target: PathBuf,
}

impl Workspace {
    /// Locates the workspace. Works from any working directory.
    ///
    /// # Errors
    /// When cargo cannot read the workspace, or `Cargo.lock` is out of date.
    pub(crate) fn locate() -> Result<Self> {
        let own_folder = env::var_os("CARGO_MANIFEST_DIR")
            .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
        let root = own_folder
            .parent()
            .context("xtask must be in a folder of the workspace: start it as `cargo xtask`")?
            .to_path_buf();

        let mut metadata = cargo_in(&root);
        metadata.args(["metadata", "--locked", "--no-deps", "--format-version=1"]);
        let output =
            metadata.stderr(Stdio::inherit()).output().with_context(|| cannot_start(&metadata))?;
        if !output.status.success() {
            bail!(
                "cargo cannot read the workspace in {} ({}): see its message above",
                root.display(),
                output.status
            );
        }
        let metadata: serde_json::Value = serde_json::from_slice(&output.stdout)
            .context("`cargo metadata` did not return JSON: check which cargo is on PATH")?;
        let target = metadata["target_directory"]
            .as_str()
            .context("`cargo metadata` names no target_directory: check which cargo is on PATH")?
            .into();
        Ok(Self { root, target })
    }

    /// A file or folder of the repository.
    pub(crate) fn path(&self, relative: &str) -> PathBuf {
        self.root.join(relative)
    }

    /// The path of the wasm file that cargo compiles from `entry` of the web client.
    pub(crate) fn compiled_client(&self, entry: &str) -> PathBuf {
        let compiled = self.output(CLIENT).join(WASM_TARGET).join("release");
        compiled.join(entry).with_extension("wasm")
    }

    /// The folder of the served site.
    pub(crate) fn site(&self) -> PathBuf {
        self.target.join("release").join("site")
    }

    /// The server's executable.
    pub(crate) fn server(&self) -> PathBuf {
        self.target.join("release").join(format!("sidestep{}", env::consts::EXE_SUFFIX))
    }

    /// The executable of an example.
    pub(crate) fn example(&self, name: &str) -> PathBuf {
        let file = format!("{name}{}", env::consts::EXE_SUFFIX);
        self.target.join("release").join("examples").join(file)
    }

    /// A folder within cargo's output folder, for the files of an xtask command.
    pub(crate) fn output(&self, name: &str) -> PathBuf {
        self.target.join(name)
    }

    /// Returns a call of a cargo command that compiles, such as `build` or `test`.
    ///
    /// Every call selects all workspace members and the same profile. Cargo then resolves the same dependency
    /// features for all calls and compiles no dependency twice.
    pub(crate) fn compile(&self, command: &str) -> Command {
        let mut cargo = cargo_in(&self.root);
        cargo.args([command, "--locked", "--profile", "release", "--workspace"]);
        cargo
    }

    /// Returns a call of a cargo command that compiles only the library. The caller adds the arguments that
    /// select features.
    pub(crate) fn compile_library(&self, command: &str) -> Command {
        let mut cargo = cargo_in(&self.root);
        cargo.args([command, "--locked", "--profile", "release", "--package", "sidestep", "--lib"]);
        cargo
    }

    /// Like [`Self::compile`], but for browsers, with the settings of `.cargo/client.toml` and, for a worker,
    /// also of `.cargo/worker.toml`.
    pub(crate) fn compile_for_browsers(&self, command: &str, runs: Runs) -> Command {
        let mut cargo = self.compile(command);
        cargo.arg("--target-dir").arg(self.output(CLIENT));
        cargo.args(["--target", WASM_TARGET, "--config"]).arg(self.path(".cargo/client.toml"));
        if runs == Runs::InWorker {
            cargo.arg("--config").arg(self.path(".cargo/worker.toml"));
        }
        cargo.arg("--config").arg(without_paths(&self.root));
        cargo
    }

    /// A call of a program that itself calls cargo, with the same output folder.
    pub(crate) fn beside_cargo(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        command.current_dir(&self.root).env("CARGO_TARGET_DIR", &self.target);
        command
    }

    /// Returns a call of `cargo metadata` for the packages of all builds.
    pub(crate) fn metadata(&self) -> Command {
        let mut cargo = cargo_in(&self.root);
        cargo.args(["metadata", "--locked", "--format-version=1"]);
        cargo
    }

    /// Returns a call of `cargo fmt` for all workspace members.
    pub(crate) fn format(&self) -> Command {
        let mut cargo = cargo_in(&self.root);
        cargo.args(["fmt", "--all"]);
        cargo
    }

    /// Adds the standard library for browsers to the toolchain if it is missing, because rustup does not
    /// always do so automatically.
    ///
    /// # Errors
    /// When the standard library is missing, and rustup is also missing or cannot add it.
    pub(crate) fn ensure_wasm_target(&self) -> Result<()> {
        let mut ask = Command::new(env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        ask.args(["--print", "target-libdir", "--target", WASM_TARGET]).current_dir(&self.root);
        let output = ask.output().with_context(|| cannot_start(&ask))?;
        let folder = String::from_utf8_lossy(&output.stdout);
        if output.status.success() && Path::new(folder.trim()).is_dir() {
            return Ok(());
        }
        let mut add = Command::new("rustup");
        add.args(["target", "add", WASM_TARGET]).current_dir(&self.root);
        stage("wasm target", &mut add).with_context(|| {
            format!("the Rust toolchain needs the target {WASM_TARGET}: install it and try again")
        })?;
        Ok(())
    }
}

/// Settings that remove the paths of this machine from the client's panic messages. This makes the
/// client smaller, and identical on every build machine.
fn without_paths(root: &Path) -> String {
    let home = || env::home_dir().unwrap_or_default().join(".cargo");
    let sources = env::var_os("CARGO_HOME").map_or_else(home, PathBuf::from).join("registry/src");
    let flag = |path: &Path| format!("{:?}", format!("--remap-path-prefix={}=", path.display()));
    format!("target.{WASM_TARGET}.rustflags = [{}, {}]", flag(&sources), flag(root))
}

/// Returns a call of the cargo that started this program.
fn cargo_in(folder: &Path) -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(folder);
    // Remove cargo's variables about the package `xtask`. Some build scripts depend on such
    // variables. Cargo would recompile these scripts and their dependents whenever a direct call of
    // cargo follows a call from this program, or the reverse.
    for (name, _) in env::vars_os() {
        let text = name.to_string_lossy();
        if text.starts_with("CARGO_PKG_") || text.starts_with("CARGO_MANIFEST_") {
            command.env_remove(name);
        }
    }
    command
}

/// Polling interval of a running stage, and interval between two lines that show its progress.
const LOOK: Duration = Duration::from_millis(50);
const SHOW: Duration = Duration::from_secs(30);

/// Runs both closures in parallel, because one compilation leaves one of two cores idle for much of the time.
///
/// # Errors
/// The error of `one`, which is also printed immediately, or else the error of `other`.
pub(crate) fn both<A, B: Send>(
    one: impl FnOnce() -> Result<A>,
    other: impl FnOnce() -> Result<B> + Send,
) -> Result<(A, B)> {
    let (one, other) = thread::scope(|scope| {
        let other = scope.spawn(other);
        let one = one();
        if let Err(error) = &one {
            eprintln!("{error:#}");
        }
        (one, other.join())
    });
    let other = other.map_err(|_| anyhow::anyhow!("a build panicked"))?;
    Ok((one?, other?))
}

/// Prints the name of a stage, runs its command and returns its duration.
///
/// # Errors
/// When the command cannot be started or fails. The error names the stage.
pub(crate) fn stage(name: &str, command: &mut Command) -> Result<Duration> {
    eprintln!("==> {name}");
    let start = Instant::now();
    let mut child = command.stdin(Stdio::null()).spawn().with_context(|| cannot_start(command))?;
    let mut shown_at = start;
    let status = loop {
        let waiting = || format!("waiting for stage \"{name}\"");
        if let Some(status) = child.try_wait().with_context(waiting)? {
            break status;
        }
        thread::sleep(LOOK);
        if shown_at.elapsed() > SHOW {
            shown_at = Instant::now();
            eprintln!("    {name}: {} s so far", start.elapsed().as_secs());
        }
    };
    let took = start.elapsed();
    if !status.success() {
        bail!(
            "stage \"{name}\" failed after {:.1} s ({status}): {}",
            took.as_secs_f64(),
            shown(command)
        );
    }
    eprintln!("    {name}: {:.1} s", took.as_secs_f64());
    Ok(took)
}

/// Runs a command, passes its output through and returns its exit code.
///
/// # Errors
/// When the command cannot be started.
pub(crate) fn answer_of(command: &mut Command) -> Result<ExitCode> {
    let status = status(command)?;
    // A process that was killed by a signal has no exit code.
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(code.map_or(ExitCode::FAILURE, ExitCode::from))
}

/// Runs a command and returns its stdout; stderr is inherited.
///
/// # Errors
/// When the command cannot be started or fails, or its output is not UTF-8. The error names `what`.
pub(crate) fn output_of(what: &str, command: &mut Command) -> Result<String> {
    command.stdin(Stdio::null()).stderr(Stdio::inherit());
    let output = command.output().with_context(|| cannot_start(command))?;
    if !output.status.success() {
        bail!("{what} failed ({}): {}", output.status, shown(command));
    }
    String::from_utf8(output.stdout).with_context(|| format!("{what} printed no UTF-8"))
}

/// Runs a command until it ends, without terminal input.
fn status(command: &mut Command) -> Result<ExitStatus> {
    command.stdin(Stdio::null()).status().with_context(|| cannot_start(command))
}

/// The error message for a program that cannot be started.
pub(crate) fn cannot_start(command: &Command) -> String {
    format!(
        "cannot start `{}`: check that it is installed and on PATH",
        command.get_program().to_string_lossy()
    )
}

/// Formats a command as it would be typed in a shell.
fn shown(command: &Command) -> String {
    let program = Path::new(command.get_program());
    let words = std::iter::once(program.file_stem().unwrap_or(program.as_os_str()))
        .chain(command.get_args())
        .map(|word| word.to_string_lossy());
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::hash::{DefaultHasher, Hash, Hasher};

    use super::*;

    /// Identifiers of the dependencies that a call of cargo compiles. An identifier depends on the package,
    /// target, features and settings of a dependency and, recursively, of its own dependencies.
    fn dependencies(cargo: &mut Command) -> BTreeSet<String> {
        // Stable cargo prints its unit graph only if this variable is set.
        cargo.args(["-Zunstable-options", "--unit-graph"]).env("RUSTC_BOOTSTRAP", "1");
        let graph = output_of("cargo", cargo).expect("a plan");
        let graph: serde_json::Value = serde_json::from_str(&graph).expect("JSON");
        let units = graph["units"].as_array().expect("units");
        let mut names = vec![None; units.len()];
        (0..units.len())
            .filter(|&at| !units[at]["pkg_id"].as_str().expect("an id").starts_with("path+"))
            .map(|at| identity(units, at, &mut names))
            .collect()
    }

    fn identity(units: &[serde_json::Value], at: usize, known: &mut [Option<String>]) -> String {
        if let Some(known) = &known[at] {
            return known.clone();
        }
        let unit = &units[at];
        let needed = unit["dependencies"].as_array().expect("a list").iter().map(|one| {
            let at = one["index"].as_u64().expect("an index") as usize;
            identity(units, at, known)
        });
        let mut needed: Vec<String> = needed.collect();
        needed.sort();
        let mut profile = unit["profile"].clone();
        profile["name"] = serde_json::Value::Null;
        let own = [&unit["target"], &profile, &unit["platform"], &unit["features"]];
        let mut hasher = DefaultHasher::new();
        (own.map(ToString::to_string), needed).hash(&mut hasher);
        let package = unit["pkg_id"].as_str().expect("an id").rsplit('/').next();
        let package = package.expect("a last part");
        let name = format!("{package} {} {:x}", unit["mode"], hasher.finish());
        known[at] = Some(name.clone());
        name
    }

    #[test]
    fn no_command_compiles_a_dependency_that_another_compiled_otherwise() {
        let workspace = Workspace::locate().expect("the workspace");
        let plan = |command: &str, further: &[&str]| {
            dependencies(workspace.compile(command).args(further))
        };
        let mut own = cargo_in(&workspace.root);
        let calls = [
            ("cargo xtask", dependencies(own.args(["build", "--release", "--bin", "xtask"]))),
            ("the server", plan("build", &["--bin", "sidestep"])),
            ("a benchmark", plan("bench", &["--bench", "learn"])),
            ("an example", plan("build", &["--example", "speed"])),
        ];
        let tests = plan("test", &["--lib", "--bins", "--tests"]);
        for (call, needed) in calls {
            let other: Vec<_> = needed.difference(&tests).collect();
            assert!(other.is_empty(), "{call} and the tests need other variants of {other:?}");
        }
        let client = |runs| {
            dependencies(workspace.compile_for_browsers("build", runs).args(["--bin", "solver"]))
        };
        assert_eq!(client(Runs::InWorker), client(Runs::InPage));
        let linted = plan("check", &["--all-targets"]);
        let documented = plan("doc", &["--lib", "--no-deps"]);
        let other: Vec<_> = documented.difference(&linted).collect();
        assert!(other.is_empty(), "docs and lints need other variants of {other:?}");
    }

    #[test]
    fn a_failed_stage_is_named() {
        let mut command = Command::new("rustc");
        command.arg("--no-such-flag").stderr(Stdio::null());
        let error = stage("no such thing", &mut command).expect_err("rustc must refuse this");
        let message = error.to_string();
        assert!(message.contains("\"no such thing\""), "{message}");
        assert!(message.contains("rustc --no-such-flag"), "{message}");
    }

    #[test]
    fn what_a_command_prints_is_its_output_unless_it_fails() {
        let output = output_of("the compiler", Command::new("rustc").arg("--version"));
        assert!(output.expect("rustc is here").starts_with("rustc "));
        let error = output_of("the compiler", Command::new("rustc").arg("--no-such-flag"))
            .expect_err("rustc must refuse this");
        assert!(error.to_string().starts_with("the compiler failed"), "{error}");
    }

    #[test]
    fn a_missing_program_is_named() {
        let error = stage("x", &mut Command::new("no-such-program-here"))
            .expect_err("there is no such program");
        assert!(error.to_string().contains("`no-such-program-here`"));
    }
}
