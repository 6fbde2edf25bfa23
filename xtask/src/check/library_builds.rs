//! Checks the library the way other projects build it: with fewer features, and with the oldest supported
//! Rust version.

use std::process::{Command, Stdio};

use anyhow::{Context, Result};

use crate::workspace::{WASM_TARGET, Workspace, stage};

/// Sets of features, as arguments for cargo. Builds of the workspace use all features.
const FEATURES: [(&str, &[&str]); 2] = [
    ("no features", &["--no-default-features"]),
    ("learn", &["--no-default-features", "--features=learn"]),
];

/// Lints the library with fewer features, natively and for browsers, and checks it with the oldest supported
/// Rust version.
///
/// # Errors
/// Naming the stage that failed.
pub(super) fn run(workspace: &Workspace) -> Result<()> {
    for (name, features) in FEATURES {
        let mut clippy = workspace.compile_library("clippy");
        clippy.args(features).args(["--", "--deny", "warnings"]);
        stage(&format!("library with {name}"), &mut clippy)?;
    }
    let mut clippy = workspace.compile_library("clippy");
    clippy.args(FEATURES[0].1).args(["--target", WASM_TARGET, "--", "--deny", "warnings"]);
    stage("library with no features for browsers", &mut clippy)?;
    oldest_rust(workspace)
}

/// Checks the library with the Rust version in its `rust-version`. Prints a notice if this toolchain is
/// missing and cannot be installed.
fn oldest_rust(workspace: &Workspace) -> Result<()> {
    let manifest = std::fs::read_to_string(workspace.path("shared/Cargo.toml"))
        .context("shared/Cargo.toml")?;
    let manifest: toml::Table = toml::from_str(&manifest).context("shared/Cargo.toml")?;
    let version = manifest["package"]["rust-version"]
        .as_str()
        .context("shared/Cargo.toml: package.rust-version: expected a version of Rust")?;
    let has = |arguments: &[&str]| {
        let mut rustup = Command::new("rustup");
        rustup.args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
        rustup.status().is_ok_and(|status| status.success())
    };
    let is_here = has(&["run", version, "rustc", "--version"]);
    if !is_here && !has(&["toolchain", "install", version, "--profile", "minimal"]) {
        eprintln!(
            "    Rust {version} not tried: rustup has no such toolchain and cannot install it"
        );
        return Ok(());
    }
    let mut check = Command::new("rustup");
    check.args(["run", version, "cargo", "check", "--locked", "--package", "sidestep", "--lib"]);
    // Use the cargo of the other toolchain, not the one that runs this command.
    check.env_remove("CARGO").current_dir(workspace.path(""));
    stage(&format!("library with Rust {version}"), &mut check).map(drop)
}
