//! `cargo xtask bench`: benchmarks, each against its baseline in the same run.

pub(crate) mod peers;
mod learning;
mod wasm;

use std::process::ExitCode;

use anyhow::Result;

use crate::workspace::{Workspace, answer_of};

/// Run the benchmarks; each prints a ratio against its baseline in the same run.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only those whose name contains this.
    name: Option<String>,
    /// Sooner done, but less exact or less complete.
    #[arg(long)]
    quick: bool,
}

/// One benchmark.
#[derive(Debug, PartialEq)]
struct Bench {
    /// The name to call it by.
    name: &'static str,
    /// What is compared with what.
    what: &'static str,
    /// What runs it.
    runner: Runner,
}

/// What runs a benchmark.
#[derive(Debug, PartialEq)]
enum Runner {
    /// The `[[bench]]` target of that name.
    Target,
    /// [`peers`].
    Peers,
    /// [`learning`].
    Learning,
    /// [`wasm`], these cases.
    Wasm(wasm::Group),
}

/// Every benchmark: one line each.
const BENCHES: &[Bench] = &[
    Bench {
        name: "reachability",
        what: "batch against one state at a time, two threads against one",
        runner: Runner::Target,
    },
    Bench {
        name: "scenes",
        what: "drawing a participant's scenes, against the plain rules",
        runner: Runner::Target,
    },
    Bench {
        name: "shfrs",
        what: "predicted sets as WebAssembly in Chromium and on this machine, against targets",
        runner: Runner::Wasm(wasm::SHFRS),
    },
    Bench {
        name: "learning",
        what: "the paper's comparison against scikit-learn (Python, installed on first use)",
        runner: Runner::Learning,
    },
    Bench {
        name: "features",
        what: "features of a million steps, two threads against one and state by state",
        runner: Runner::Target,
    },
    Bench {
        name: "learn",
        what: "training and inference of each model on real rows",
        runner: Runner::Target,
    },
    Bench {
        name: "learn_svm",
        what: "support vector machines: grids, fits, inference",
        runner: Runner::Target,
    },
    Bench {
        name: "uploads",
        what: "a server under load and killed under load, against SQLite alone",
        runner: Runner::Target,
    },
    Bench {
        name: "peers",
        what: "our solver against hj_reachability (Python, installed on first use)",
        runner: Runner::Peers,
    },
    Bench {
        name: "wasm",
        what: "the solver as WebAssembly in Chromium against the same on this machine",
        runner: Runner::Wasm(wasm::VALUE),
    },
];

/// Runs the chosen benchmarks one after the other; stops at the first that fails.
///
/// # Errors
/// When cargo cannot be started, or figures of our own cannot be had.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let chosen = choose(BENCHES, options.name.as_deref());
    if chosen.is_empty() {
        eprintln!("{}", nothing_to_run(BENCHES, options.name.as_deref()));
        return Ok(ExitCode::from(2));
    }
    for bench in chosen {
        eprintln!("==> {}: {}", bench.name, bench.what);
        let code = match bench.runner {
            Runner::Target => {
                let mut cargo = workspace.compile("bench");
                answer_of(cargo.args(arguments(bench.name, options.quick)))?
            }
            Runner::Peers => peers::run(workspace, options.quick)?,
            Runner::Learning => learning::run(workspace)?,
            // Quick as it is.
            Runner::Wasm(group) => wasm::run(workspace, group)?,
        };
        if code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What cargo is called with for the `[[bench]]` target `name`.
fn arguments(name: &'static str, quick: bool) -> Vec<&'static str> {
    // Criterion's switches. What an earlier run took says little: baselines are in each run.
    let mut arguments = vec!["--bench", name, "--", "--discard-baseline"];
    if quick {
        arguments.push("--quick");
    }
    arguments
}

/// The benchmarks whose name contains `name`; all without one.
fn choose<'a>(benches: &'a [Bench], name: Option<&str>) -> Vec<&'a Bench> {
    let wanted = name.unwrap_or_default();
    let matches = |bench: &&Bench| bench.name.contains(wanted);
    benches.iter().filter(matches).collect()
}

/// Says why no benchmark runs, and which there are.
fn nothing_to_run(benches: &[Bench], name: Option<&str>) -> String {
    let mut message = format!(
        "expected the name of a benchmark, found \"{}\"; there are:",
        name.unwrap_or_default()
    );
    for bench in benches {
        message += &format!("\n  {:20} {}", bench.name, bench.what);
    }
    message
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const TABLE: &[Bench] = &[
        Bench { name: "solve", what: "parallel against one thread", runner: Runner::Target },
        Bench { name: "reach", what: "fast against plain", runner: Runner::Peers },
    ];

    #[test]
    fn a_name_chooses_and_no_name_means_all() {
        assert_eq!(choose(TABLE, None).len(), 2);
        assert_eq!(choose(TABLE, Some("rea")), [&TABLE[1]]);
        assert!(choose(TABLE, Some("walk")).is_empty());
    }

    #[test]
    fn an_unknown_name_is_answered_with_those_there_are() {
        let message = nothing_to_run(TABLE, Some("walk"));
        assert!(message.contains("found \"walk\""), "{message}");
        assert!(message.contains("solve"), "{message}");
    }

    #[test]
    fn a_target_is_called_by_its_name() {
        assert_eq!(arguments("solve", false).join(" "), "--bench solve -- --discard-baseline");
        let quick = arguments("solve", true).join(" ");
        assert!(quick.ends_with(" --quick"), "{quick}");
    }

    #[test]
    fn every_target_of_the_table_has_its_source() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for bench in BENCHES.iter().filter(|bench| bench.runner == Runner::Target) {
            let sources = ["shared", "server"].map(|member| {
                let source = folder.join(member).join("benches").join(bench.name);
                [source.with_extension("rs"), source.join("main.rs")]
            });
            assert!(sources.iter().flatten().any(|source| source.is_file()), "{}", bench.name);
        }
    }
}
