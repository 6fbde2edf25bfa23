//! `cargo xtask test`: runs all tests, and installs what they need.

mod lanes;
mod programs;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::{env, fs, thread};

use anyhow::{Context, Result, bail};

use self::lanes::Part;
use self::programs::Program;
use crate::build;
use crate::command::{is_program, on_path, within};
use crate::python::{PYTHON, environment};
use crate::site::bundle;
use crate::wheel;
use crate::workspace::{Runs, Workspace, answer_of, both, stage};

/// Run all tests, after installing their prerequisites where possible.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Store the servers' databases in a temporary PostgreSQL cluster instead of files.
    #[arg(long)]
    postgres: bool,
    /// Test only the Python package.
    #[arg(long, conflicts_with_all = ["postgres", "arguments"])]
    python: bool,
    /// Also run `cargo xtask check`, in parallel with the tests that mostly wait.
    #[arg(long, conflicts_with_all = ["python", "arguments"])]
    check: bool,
    /// Arguments for `cargo test`, as in `-- --test browser`.
    #[arg(last = true)]
    arguments: Vec<OsString>,
}

/// Files of browser tests that run on both kinds of database. Their pages write every kind of row and show
/// the changes of other clients. The other files test only the browser.
const ON_BOTH: [&str; 2] = ["studies", "scenes"];

/// API tests of commands that use no database. They run only once.
const WITHOUT_DATABASE: [&str; 8] = [
    "analyze::the_comparison_is_that_of_scikit_learn",
    "analyze_input::",
    "design::",
    "features::",
    "help::",
    "prediction::",
    "shfrs::",
    "solving::",
];

/// Test programs that mostly wait, besides `browser` and `api`.
const WAITING: [&str; 2] = ["faults", "webassembly"];

/// Environment variable with Chromium's path, for the tests. A value that the user has set is used
/// unchanged.
pub(crate) const VARIABLE: &str = "SIDESTEP_CHROMIUM";

/// Commands that start Chromium, in order of preference. Chromium's headless shell takes a quarter
/// less time. It is not in the list, because it has no back/forward cache, which browsers have.
const COMMANDS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Debian's packages for Chromium.
const PACKAGES: [&str; 2] = ["chromium", "fonts-dejavu-core"];

/// Prepares, builds and tests. Passes the output of the tests through and returns their exit code.
///
/// # Errors
/// When a prerequisite is missing and cannot be installed, or the build fails.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    if options.python {
        build::server(workspace)?;
        return python_package(workspace);
    }
    if find_chromium()?.is_none() {
        install(&PACKAGES, how_to_install)?;
    }
    let chromium = chromium()?;
    if !has_surroundings() {
        install(&SURROUNDINGS, how_to_install_surroundings)?;
    }
    let readers = readers(workspace)?;
    let is_whole = options.arguments.is_empty();
    let pages = || {
        // For a whole run, `compile` builds the server in parallel with the client.
        build::run(workspace, &build::Options { client_only: is_whole })?;
        let page = |(variable, example)| Ok((variable, example_page(workspace, example)?));
        PAGES.iter().copied().map(page).collect::<Result<Vec<_>>>()
    };
    let compile = || {
        let mut programs = Vec::new();
        if is_whole {
            build::server(workspace)?;
            programs = programs::compile(workspace)?;
        }
        stage("cluster", workspace.compile("build").args(["--example", CLUSTER]))?;
        Ok(programs)
    };
    let (mut needs, programs) = both(pages, compile)?;
    needs.push((VARIABLE, chromium));
    needs.push((READERS, readers));
    needs.push(("SIDESTEP_BIN", workspace.server()));
    let cluster = workspace.example(CLUSTER);
    if is_whole {
        return whole(workspace, options, &programs, &cluster, &needs);
    }
    eprintln!("==> tests");
    let mut tests = workspace.compile("test");
    tests.args(&options.arguments).envs(needs);
    if options.postgres {
        tests = within(&[cluster.as_os_str()], &tests);
    }
    answer_of(&mut tests)
}

/// Runs everything in two lanes. One lane has the tests with servers and browsers, which mostly wait for each
/// other. The other lane has the computations.
fn whole(
    workspace: &Workspace,
    options: &Options,
    programs: &[Program],
    cluster: &Path,
    needs: &[(&str, PathBuf)],
) -> Result<ExitCode> {
    let call = |program: &Program, arguments: &[&str], on_postgres: bool| {
        let mut call = program.call();
        call.args(arguments).envs(needs.iter().map(|(name, value)| (name, value)));
        let name = format!("{}/{}", program.package(), program.name);
        match on_postgres {
            true => Part::new(name + " on PostgreSQL", within(&[cluster.as_os_str()], &call)),
            false => Part::new(name, call),
        }
    };
    let named = |package: &str, name: &str| {
        let found = programs.iter().find(|it| it.package() == package && it.name == name);
        found.with_context(|| format!("cargo compiled no tests {name} of {package}"))
    };
    let (browser, api) = (named("tests", "browser")?, named("tests", "api")?);
    let threads = thread::available_parallelism().map_or(1, usize::from).max(AT_ONCE).to_string();
    let threads = ["--test-threads", &threads];
    // The servers' use of the database is tested on SQLite files and on PostgreSQL. On files, tests that need
    // PostgreSQL are ignored.
    let [studies, scenes] = ON_BOTH.map(|file| format!("{file}::"));
    let skipped = WITHOUT_DATABASE.map(|of| ["--skip", of]).concat();
    let on_both = [&threads[..], &[&studies, &scenes]].concat();
    let on_postgres = [&threads[..], &["--include-ignored"], &skipped].concat();
    let all: &[&str] =
        if options.postgres { &[&threads[..], &["--include-ignored"]].concat() } else { &threads };
    let mut waiting =
        vec![call(browser, &threads, options.postgres), call(api, all, options.postgres)];
    if !options.postgres {
        waiting.push(call(browser, &on_both, true));
        waiting.push(call(api, &on_postgres, true));
        waiting.push(call(named("server", "sidestep_server")?, &["store::"], true));
    }
    let mut computing = Vec::new();
    for program in programs.iter().filter(|it| !["browser", "api"].contains(&&it.name[..])) {
        let lane = if WAITING.contains(&&program.name[..]) { &mut waiting } else { &mut computing };
        lane.push(call(program, &[], options.postgres));
    }
    let own = env::current_exe().context("this program")?;
    let command = |argument: &[&str]| {
        let mut command = Command::new(&own);
        command.args(argument);
        command
    };
    computing.push(Part::new("tests of the Python package", command(&["test", "--python"])));
    let mut doc = workspace.compile("test");
    doc.arg("--doc");
    computing.push(Part::new("examples in the documentation", doc));
    if options.check {
        computing.push(Part::new("check", command(&["check"])));
    }
    lanes::run(waiting, computing, &workspace.output("tests"))
}

/// Minimum number of tests with servers and browsers that run at the same time. It applies even
/// with few processors, because these tests mostly wait for scenes, for each other and for disks.
const AT_ONCE: usize = 4;

/// Installs the Python package into an environment and runs its tests, which also run the server.
fn python_package(workspace: &Workspace) -> Result<ExitCode> {
    let python = tested_python(workspace)?;
    let wheel = wheel::build(workspace)?;
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]);
    stage("pip install", install.arg("--force-reinstall").arg(wheel))?;
    eprintln!("==> tests of the Python package");
    let mut tests = Command::new(&python);
    tests.args(["-m", "pytest"]).current_dir(workspace.path("python"));
    tests.env("SIDESTEP_BIN", workspace.server());
    answer_of(tests.arg("-o").arg(format!("cache_dir={}", workspace.output("pytest").display())))
}

/// The example that runs a command with its own PostgreSQL cluster.
const CLUSTER: &str = "with_postgres";

/// Examples of the client that tests open as pages (computations in WebAssembly, and every kind of form
/// field). Each pair is the environment variable with the page's path, and the example's name.
const PAGES: &[(&str, &str)] =
    &[("SIDESTEP_FINGERPRINT_PAGE", "fingerprint"), ("SIDESTEP_FORMS_PAGE", "forms")];

/// Builds an example and writes a page that contains it.
fn example_page(workspace: &Workspace, example: &'static str) -> Result<PathBuf> {
    let mut build = workspace.compile_for_browsers("build", Runs::InPage);
    stage(example, build.args(["--example", example]))?;
    let compiled = workspace.compiled_client(&format!("examples/{example}"));
    let text = bundle(example, &compiled)?.page()?;
    let folder = workspace.output("browser-pages");
    let path = folder.join(example).with_extension("html");
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(&path, text))
        .with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}

/// The path of an installed Chromium.
///
/// # Errors
/// If Chromium is missing (with instructions for installing it), or if the environment variable is wrong.
pub(crate) fn chromium() -> Result<PathBuf> {
    find_chromium()?.with_context(how_to_install)
}

/// The path of Chromium; `None` if it must be installed.
fn find_chromium() -> Result<Option<PathBuf>> {
    let Some(path) = env::var_os(VARIABLE).map(PathBuf::from) else {
        return Ok(on_path(&COMMANDS));
    };
    if !path.is_absolute() || !path.is_file() {
        bail!(
            "{VARIABLE} is \"{}\", expected the absolute path of Chromium: correct or unset it",
            path.display()
        );
    }
    Ok(Some(path))
}

/// Installs packages with apt, if that works without a prompt.
fn install(packages: &[&str], otherwise: fn() -> String) -> Result<()> {
    if on_path(&["apt-get"]).is_none() || !is_root() {
        bail!(otherwise());
    }
    let apt = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        command.env("DEBIAN_FRONTEND", "noninteractive").args(arguments);
        command
    };
    stage("apt-get update", &mut apt(&["update", "--quiet"]))?;
    let install = ["install", "--quiet", "--yes", "--no-install-recommends"];
    stage("apt-get install", apt(&install).args(packages))?;
    Ok(())
}

/// Debian's packages for tests of the server: PostgreSQL (tests start their own PostgreSQL servers), a fake
/// clock, and the proxies of `docs/deploy`.
const SURROUNDINGS: [&str; 4] = ["postgresql", "libfaketime", "nginx", "haproxy"];

/// Whether all [`SURROUNDINGS`] are installed.
fn has_surroundings() -> bool {
    // Debian installs servers in /usr/sbin, which is only on root's PATH.
    let has = |program: &str| {
        on_path(&[program]).is_some() || Path::new("/usr/sbin").join(program).is_file()
    };
    (has_in("/usr/lib/postgresql", "bin/initdb") || has("initdb"))
        && has_in("/usr/lib", "faketime/libfaketime.so.1")
        && has("nginx")
        && has("haproxy")
}

/// Whether a sub-folder of `folder` contains `file`. Debian has one sub-folder per version of PostgreSQL and,
/// for libraries, one per architecture.
fn has_in(folder: &str, file: &str) -> bool {
    let inside = fs::read_dir(folder).into_iter().flatten().flatten();
    inside.map(|entry| entry.path().join(file)).any(|path| is_program(&path))
}

fn how_to_install_surroundings() -> String {
    format!(
        "PostgreSQL, libfaketime, nginx and HAProxy are needed: install them (Debian, Ubuntu: apt-get install {})",
        SURROUNDINGS.join(" ")
    )
}

/// Environment variable with the path of a Python that has the packages for reading exports.
const READERS: &str = "SIDESTEP_READERS";

/// Debian's packages for Python and its virtual environments.
const PYTHON_PACKAGES: [&str; 2] = ["python3", "python3-venv"];

/// The Python for [`READERS`]: an environment with pandas, polars and pyarrow from PyPI.
fn readers(workspace: &Workspace) -> Result<PathBuf> {
    installed(workspace, "readers-requirements.txt", "readers")
}

/// A Python with everything that the tests of the Python package need, except the package itself.
fn tested_python(workspace: &Workspace) -> Result<PathBuf> {
    installed(workspace, "python-requirements.txt", "python")
}

/// Creates an environment, and installs Python first if necessary.
fn installed(workspace: &Workspace, requirements: &str, name: &str) -> Result<PathBuf> {
    let made = || environment(workspace, requirements, name);
    let found = env::var_os(PYTHON).is_some() || on_path(&["python3"]).is_some();
    if let Some(Ok(python)) = found.then(made) {
        return Ok(python);
    }
    // Python is missing or cannot create environments. On Debian, creating them needs python3-venv.
    install(&PYTHON_PACKAGES, how_to_install_python)?;
    made()
}

fn how_to_install_python() -> String {
    format!(
        "Python 3.11 or newer is needed: install it (Debian, Ubuntu: apt-get install {}) or set \
         {PYTHON} to its path",
        PYTHON_PACKAGES.join(" ")
    )
}

/// Instructions for installing Chromium, if this command cannot install it.
fn how_to_install() -> String {
    format!(
        "Chromium is needed: install it (Debian, Ubuntu: apt-get install {}) or set {VARIABLE} to \
         its path",
        PACKAGES.join(" ")
    )
}

/// Whether this user is root and can install packages without a prompt.
fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_says_what_to_install() {
        let message = how_to_install();
        assert!(message.contains("apt-get install chromium fonts-dejavu-core"), "{message}");
        assert!(message.contains("set SIDESTEP_CHROMIUM"), "{message}");
    }

    #[test]
    fn the_message_says_what_surrounds_a_server() {
        let message = how_to_install_surroundings();
        assert!(
            message.contains("apt-get install postgresql libfaketime nginx haproxy"),
            "{message}"
        );
    }

    /// If a file were missing, its test filter would match nothing, and the run would still pass.
    #[test]
    fn the_browser_tests_of_both_databases_are_there() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/tests/browser");
        for file in ON_BOTH {
            let text = fs::read_to_string(folder.join(file).with_extension("rs")).expect(file);
            assert!(text.contains("#[tokio::test"), "{file}");
        }
    }

    #[test]
    fn a_file_is_found_in_any_of_the_folders() {
        let folder = env!("CARGO_MANIFEST_DIR");
        assert!(has_in(folder, "main.rs") && !has_in(folder, "absent.rs"));
    }
}
