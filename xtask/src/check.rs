//! `cargo xtask check`: checks the code and its dependencies without running it.

mod dependencies;
mod library_builds;

use anyhow::Result;

use crate::site::ENTRIES;
use crate::workspace::{Runs, Workspace, stage};

/// Runs the stages, fastest first, and stops at the first that fails.
///
/// # Errors
/// Naming the stage that failed.
pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    stage("format", workspace.format().arg("--check"))?;
    dependencies::run(workspace)?;

    let mut clippy = workspace.compile("clippy");
    stage("clippy", clippy.args(["--all-targets", "--", "--deny", "warnings"]))?;

    workspace.ensure_wasm_target()?;
    let mut clippy = workspace.compile_for_browsers("clippy", Runs::InPage);
    clippy.args(ENTRIES.iter().flat_map(|(entry, _)| ["--bin", entry]));
    stage("clippy for browsers", clippy.args(["--", "--deny", "warnings"]))?;

    library_builds::run(workspace)?;

    // The server's program and the library are both called `sidestep`, so their pages have the same
    // paths. The library comes last, in a separate call, so that its pages remain.
    for (name, kind) in [("docs of programs", "--bins"), ("docs of libraries", "--lib")] {
        let mut docs = workspace.compile("doc");
        docs.args([kind, "--no-deps", "--document-private-items"]);
        docs.env("RUSTDOCFLAGS", "--deny warnings");
        stage(name, &mut docs)?;
    }
    Ok(())
}
