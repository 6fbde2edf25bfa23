//! `cargo xtask search`: runs the property tests with random seeds.
//!
//! The test suite draws the same cases in every run (`.cargo/config.toml`), so that it fails only
//! if the code has changed. This command draws new cases.

use std::collections::BTreeSet;
use std::fs;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use crate::workspace::{Workspace, answer_of, stage};

/// Run property tests with random seeds until one fails or the time is up.
///
/// The command prints the seed and the smallest failing case. Proptest also writes the case to a
/// `.proptest-regressions` file. Commit that file, or turn the case into a separate test.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Run only the property tests whose name contains this text.
    name: Option<String>,
    /// Time limit, in minutes.
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
}

/// Runs the search. The exit code is 1 if a case fails, and 2 if no property test has a matching
/// name.
///
/// # Errors
/// When the sources cannot be read or the tests cannot be built.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let mut all = Vec::new();
    for folder in ["shared/src", "shared/tests", "server/src"] {
        collect(&workspace.path(folder), &mut all)?;
    }
    let wanted = options.name.as_deref().unwrap_or_default();
    let chosen: Vec<_> = all.iter().filter(|one| one.name.contains(wanted)).collect();
    if chosen.is_empty() {
        eprintln!("expected the name of a property test, found \"{wanted}\"; there are:");
        all.iter().for_each(|one| eprintln!("  {}", one.name));
        return Ok(ExitCode::from(2));
    }
    let targets: BTreeSet<_> = chosen.iter().flat_map(|one| &one.target).collect();
    let tests = || {
        let mut cargo = workspace.compile("test");
        cargo.arg("--quiet").args(&targets);
        cargo
    };
    stage("property tests", tests().arg("--no-run"))?;

    let begun = Instant::now();
    let limit = Duration::try_from_secs_f64(60.0 * options.minutes)
        .context("--minutes: expected a number of minutes ≥ 0")?;
    let mut seeds = 0_u64;
    while begun.elapsed() < limit {
        let seed = RandomState::new().build_hasher().finish();
        let mut run = tests();
        run.env("PROPTEST_RNG_SEED", seed.to_string()).arg("--");
        let code = answer_of(run.args(chosen.iter().map(|one| &one.name)))?;
        if code != ExitCode::SUCCESS {
            eprintln!("found with PROPTEST_RNG_SEED={seed}: the smallest failing case is above");
            return Ok(ExitCode::FAILURE);
        }
        seeds += 1;
    }
    eprintln!("{seeds} seeds, {} property tests, no find", chosen.len());
    Ok(ExitCode::SUCCESS)
}

/// A property test.
#[derive(Debug, PartialEq)]
struct Property {
    name: String,
    /// The arguments of `cargo test` that select the test's executable.
    target: Vec<String>,
}

/// Adds the property tests of all files below `folder`.
fn collect(folder: &Path, found: &mut Vec<Property>) -> Result<()> {
    let cannot_read = || format!("cannot read {}", folder.display());
    for entry in fs::read_dir(folder).with_context(cannot_read)? {
        let path = entry.with_context(cannot_read)?.path();
        if path.is_dir() {
            collect(&path, found)?;
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path)
                .with_context(|| format!("cannot read {}", path.display()))?;
            let target = target_of(&path);
            found.extend(names(&text).map(|name| Property { name, target: target.clone() }));
        }
    }
    Ok(())
}

/// The cargo target that contains a source file: the library, or a file or folder of `tests/`.
fn target_of(path: &Path) -> Vec<String> {
    let parts: Vec<_> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    match parts.iter().rposition(|part| part == "tests") {
        Some(at) if at + 1 < parts.len() => {
            vec!["--test".to_owned(), parts[at + 1].trim_end_matches(".rs").to_owned()]
        }
        _ => vec!["--lib".to_owned()],
    }
}

/// The names of the functions in `proptest!` blocks. A `proptest!` block must be the last item of
/// its module.
fn names(text: &str) -> impl Iterator<Item = String> + '_ {
    let blocks = text.split("proptest! {").skip(1);
    let functions = blocks.flat_map(|block| block.split("#[test]").skip(1));
    functions.filter_map(|test| {
        let name = test.trim_start().strip_prefix("fn ")?;
        Some(name.split('(').next()?.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_functions_of_the_macro_are_property_tests() {
        let text = "#[test]\nfn plain() {}\nproptest! {\n  #![proptest_config(c)]\n  #[test]\n  \
                    fn first(x in 0..1) {}\n\n  #[test]\n  fn second((a, b) in pairs()) {}\n}\n";
        assert_eq!(names(text).collect::<Vec<_>>(), ["first", "second"]);
    }

    #[test]
    fn a_file_is_in_the_executable_that_cargo_makes_of_it() {
        assert_eq!(target_of(Path::new("/a/shared/src/math.rs")), ["--lib"]);
        assert_eq!(target_of(Path::new("/a/shared/tests/reach.rs")), ["--test", "reach"]);
        assert_eq!(
            target_of(Path::new("/a/shared/tests/library/learn_tree.rs")),
            ["--test", "library"]
        );
    }

    #[test]
    fn the_librarys_property_tests_are_found() {
        let mut found = Vec::new();
        let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/tests");
        collect(&tests, &mut found).expect("the tests");
        let named = |name: &str| found.iter().any(|one| one.name == name);
        assert!(named("no_admissible_input_leaves_the_polygons"), "{found:?}");
    }
}
