//! `cargo xtask bench`: runs benchmarks. Each is compared with a baseline from the same run.

pub(crate) mod peers;
mod process;
mod learning;
mod files;
mod wasm;

use std::ffi::OsString;
use std::process::ExitCode;

use anyhow::Result;

use crate::python::environment;
use crate::workspace::{Workspace, answer_of, stage};

/// Run the benchmarks. Each prints a ratio against a baseline that is measured in the same run.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Name of the benchmark, or a part of the name of one or several benchmarks.
    name: Option<String>,
    /// Run faster, but less exactly or less completely.
    #[arg(long)]
    quick: bool,
    /// Arguments for the benchmark, as in `load -- --people 10000`; `load -- --help` lists them.
    #[arg(last = true)]
    arguments: Vec<OsString>,
}

/// Every benchmark, with its name and description.
const BENCHES: &[(&str, &str)] = &[
    ("reachability", "batch against one state at a time, two threads against one"),
    ("reach", "worst-case times of polygons and membership, in six classes of hard bounds"),
    ("scenes", "drawing a participant's scenes, against the plain rules"),
    ("shfrs", "predicted sets as WebAssembly in Chromium and on this machine, against targets"),
    ("playback", "frames of a replay as WebAssembly in Chromium and on this machine, by layers"),
    ("learning", "the paper's comparison against scikit-learn (Python, installed on first use)"),
    ("files", "import and export of a million steps, against sqlite3 with one table"),
    ("features", "features of a million steps, two threads against one and state by state"),
    ("planner", "a robot's cycle at 10 Hz: five sets over ten steps and a plan's clearance"),
    ("learn", "training and inference of each model on real rows"),
    ("learn_svm", "support vector machines: grids, fits, inference"),
    ("load", "thousands of participants, against SQLite alone and oTree (Python, from PyPI)"),
    ("capacity", "servers of other sizes, simulated from measurements of `load` on one machine"),
    ("faults", "repeated kills and power failures of a server: no data may be lost"),
    ("peers", "our solver against hj_reachability (Python, installed on first use)"),
    ("wasm", "the solver as WebAssembly in Chromium against the same on this machine"),
];

/// Runs the chosen benchmarks in sequence and stops at the first that fails.
///
/// # Errors
/// When cargo cannot be started or the Sidestep side of a benchmark fails.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let chosen = choose(options.name.as_deref());
    if chosen.is_empty() {
        eprintln!("{}", nothing_to_run(options.name.as_deref()));
        return Ok(ExitCode::from(2));
    }
    for (name, what) in chosen {
        eprintln!("==> {name}: {what}");
        let code = match name {
            "peers" => peers::run(workspace, options.quick, &options.arguments)?,
            "learning" => learning::run(workspace)?,
            "files" => files::run(workspace, options.quick)?,
            // `shfrs`, `playback` and `wasm` have no quick mode.
            "shfrs" => wasm::run(workspace, &[wasm::SHFRS, wasm::EVALUATION])?,
            "playback" => wasm::run(workspace, &[wasm::PLAYBACK])?,
            "wasm" => wasm::run(workspace, &[wasm::SOLVE, wasm::VALUE])?,
            target => run_target(workspace, target, options)?,
        };
        if code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the `[[bench]]` target `name`.
fn run_target(workspace: &Workspace, name: &'static str, options: &Options) -> Result<ExitCode> {
    if ["load", "faults"].contains(&name) {
        stage("server", workspace.compile("build").args(["--bin", "sidestep"]))?;
    }
    let mut cargo = workspace.compile("bench");
    if name == "load" {
        match environment(workspace, "otree-requirements.txt", "otree") {
            Ok(python) => drop(cargo.env("SIDESTEP_OTREE", python.with_file_name("otree"))),
            Err(error) => eprintln!("oTree is not measured: {error:#}"),
        }
    }
    cargo.args(arguments(name, options.quick)).args(&options.arguments);
    answer_of(cargo.env("SIDESTEP_BIN", workspace.server()))
}

/// The arguments of `cargo` for the target `name`.
fn arguments(name: &'static str, quick: bool) -> Vec<&'static str> {
    // Criterion's options. They turn off comparisons with earlier runs, because each run measures
    // its own baselines.
    let mut arguments = vec!["--bench", name, "--", "--discard-baseline"];
    if quick {
        arguments.push("--quick");
    }
    arguments
}

/// Returns the benchmark called `name` or, if there is none, all benchmarks whose names contain
/// `name`. Returns all benchmarks if `name` is `None`.
fn choose(name: Option<&str>) -> Vec<(&'static str, &'static str)> {
    let wanted = name.unwrap_or_default();
    let of = |fits: fn(&str, &str) -> bool| -> Vec<_> {
        BENCHES.iter().copied().filter(|(name, _)| fits(name, wanted)).collect()
    };
    let exact = of(|name, wanted| name == wanted);
    if exact.is_empty() { of(|name, wanted| name.contains(wanted)) } else { exact }
}

/// The error message if no benchmark matches, with a list of all benchmarks.
fn nothing_to_run(name: Option<&str>) -> String {
    let mut message = format!(
        "expected the name of a benchmark, found \"{}\"; there are:",
        name.unwrap_or_default()
    );
    for (name, what) in BENCHES {
        message += &format!("\n  {name:20} {what}");
    }
    message
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_name_chooses_and_no_name_means_all() {
        assert_eq!(choose(None).len(), BENCHES.len());
        assert_eq!(choose(Some("eatures")), [BENCHES[7]]);
        assert_eq!(choose(Some("reach")), [BENCHES[1]]);
        assert_eq!(choose(Some("learn_")), [BENCHES[10]]);
        assert!(choose(Some("walk")).is_empty());
    }

    #[test]
    fn an_unknown_name_is_answered_with_those_there_are() {
        let message = nothing_to_run(Some("walk"));
        assert!(message.contains("found \"walk\"") && message.contains("learn_svm"), "{message}");
    }

    #[test]
    fn a_target_is_called_by_its_name() {
        assert_eq!(arguments("solve", false).join(" "), "--bench solve -- --discard-baseline");
        let quick = arguments("solve", true).join(" ");
        assert!(quick.ends_with(" --quick"), "{quick}");
    }

    #[test]
    fn every_benchmark_has_its_source() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for (name, _) in BENCHES {
            let target = ["shared/benches", "tests/benches"].into_iter().any(|benches| {
                let source = folder.join(benches).join(name);
                source.with_extension("rs").is_file() || source.join("main.rs").is_file()
            });
            let own = ["shfrs", "playback", "learning", "files", "peers", "wasm"].contains(name);
            assert!(target != own, "{name}");
        }
    }
}
