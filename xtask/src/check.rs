//! `cargo xtask check`: what can be said about the code without running it.

use anyhow::Result;

use crate::workspace::{WASM_TARGET, Workspace, stage};

/// Runs the stages, quickest first, and stops at the first that fails.
///
/// All of them use the profile in which tests and client are built afterwards:
/// procedural macros and build scripts (SQLite in C) are then compiled once.
///
/// # Errors
/// Naming the stage that failed.
pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    stage("format", &mut workspace.cargo(["fmt", "--all", "--check"]))?;

    let mut clippy = workspace.cargo(["clippy", "--locked", "--release", "--workspace"]);
    clippy.args(["--all-targets", "--", "--deny", "warnings"]);
    stage("clippy", &mut clippy)?;

    workspace.ensure_wasm_target()?;
    let mut clippy = workspace.cargo(["clippy", "--locked", "--profile", "client"]);
    clippy.args(["--package", "sidestep", "--package", "sidestep-web"]);
    clippy.args(["--target", WASM_TARGET, "--", "--deny", "warnings"]);
    stage("clippy for the browser", &mut clippy)?;

    // Two calls, because the server's program and the library are both called
    // `sidestep`: cargo cannot place both, and the library's pages are to remain.
    for (name, kind) in [("docs of programs", "--bins"), ("docs of libraries", "--lib")] {
        let mut docs = workspace.cargo(["doc", "--locked", "--release", "--workspace", kind]);
        docs.args(["--no-deps", "--document-private-items"]);
        docs.env("RUSTDOCFLAGS", "--deny warnings");
        stage(name, &mut docs)?;
    }
    Ok(())
}
