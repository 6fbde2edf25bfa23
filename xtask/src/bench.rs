//! `cargo xtask bench`: benchmarks, each against its baseline in the same run.

use std::process::ExitCode;

use anyhow::Result;

use crate::workspace::{Workspace, answer_of};

/// Run the benchmarks; each prints a ratio against its baseline in the same run.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only those whose name contains this.
    name: Option<String>,
}

/// One `[[bench]]` target of a package.
#[derive(Debug, PartialEq)]
#[allow(dead_code, reason = "the table below is still empty")]
struct Bench {
    /// The target's name, and the name to call it by.
    name: &'static str,
    /// The package that has it.
    package: &'static str,
    /// What is compared with what.
    what: &'static str,
}

/// Every benchmark: one line each.
const BENCHES: &[Bench] = &[];

/// Runs the chosen benchmarks one after the other; stops at the first that fails.
///
/// # Errors
/// When cargo cannot be started.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let chosen = choose(BENCHES, options.name.as_deref());
    if chosen.is_empty() {
        eprintln!("{}", nothing_to_run(BENCHES, options.name.as_deref()));
        return Ok(ExitCode::from(2));
    }
    for bench in chosen {
        eprintln!("==> {}: {}", bench.name, bench.what);
        let mut cargo = workspace.cargo(["bench", "--locked"]);
        cargo.args(["--package", bench.package, "--bench", bench.name]);
        let code = answer_of(&mut cargo)?;
        if code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The benchmarks whose name contains `name`; all without one.
fn choose<'a>(benches: &'a [Bench], name: Option<&str>) -> Vec<&'a Bench> {
    let wanted = name.unwrap_or_default();
    let matches = |bench: &&Bench| bench.name.contains(wanted);
    benches.iter().filter(matches).collect()
}

/// Says why no benchmark runs, and which there are.
fn nothing_to_run(benches: &[Bench], name: Option<&str>) -> String {
    if benches.is_empty() {
        return "there are no benchmarks yet: a new one is one line of BENCHES in \
                xtask/src/bench.rs"
            .into();
    }
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
    use super::*;

    const TABLE: &[Bench] = &[
        Bench { name: "solve", package: "sidestep", what: "parallel against one thread" },
        Bench { name: "reach", package: "sidestep", what: "fast against plain" },
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
        assert!(nothing_to_run(&[], None).contains("no benchmarks yet"));
    }
}
