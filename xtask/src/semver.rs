//! `cargo xtask semver`: checks whether changes to the library's public interface fit its version
//! number.

use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail};

use crate::workspace::{Workspace, answer_of, output_of};

/// Compare the library's public interface with its interface in an earlier revision, using
/// cargo-semver-checks.
///
/// Reports the changes that need a new major or minor version.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The git revision to compare with [default: the last tag].
    #[arg(long, value_name = "REVISION")]
    since: Option<String>,
}

/// Runs the comparison and returns the exit code of cargo-semver-checks.
///
/// # Errors
/// When cargo-semver-checks is missing, or there is neither a revision nor a tag.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<ExitCode> {
    let mut ask = Command::new("cargo-semver-checks");
    ask.args(["semver-checks", "--version"]).stdout(Stdio::null()).stderr(Stdio::null());
    if !ask.status().is_ok_and(|status| status.success()) {
        bail!(
            "cargo-semver-checks is missing: `cargo install cargo-semver-checks --locked` installs it"
        );
    }
    let since = match &options.since {
        Some(revision) => revision.clone(),
        None => last_tag(workspace)?,
    };
    let mut compare = workspace.beside_cargo("cargo-semver-checks".as_ref());
    compare.args(["semver-checks", "--package", "sidestep", "--baseline-rev", &since]);
    answer_of(&mut compare)
}

fn last_tag(workspace: &Workspace) -> Result<String> {
    let mut describe = Command::new("git");
    describe.args(["describe", "--tags", "--abbrev=0"]).current_dir(workspace.path(""));
    let tag = output_of("git", &mut describe)
        .context("there is no tag to compare with: name a revision, `--since REVISION`")?;
    Ok(tag.trim().to_owned())
}
