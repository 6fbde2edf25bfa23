//! `cargo xtask wheel`: builds the Python package.

use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use crate::python::environment;
use crate::workspace::{Workspace, stage};

/// Builds the wheel and prints its path.
///
/// # Errors
/// When Python is missing or the build fails.
pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    println!("{}", build(workspace)?.display());
    Ok(())
}

/// Builds the wheel of the Python package, for all supported versions of Python.
///
/// # Errors
/// The errors of [`run`].
pub(crate) fn build(workspace: &Workspace) -> Result<PathBuf> {
    let python = environment(workspace, "wheel-requirements.txt", "wheel")?;
    let folder = workspace.output("wheels");
    // Remove the wheels of other versions, so that exactly one wheel is found below.
    if folder.exists() {
        fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    let mut maturin = workspace.beside_cargo(&python);
    maturin.args(["-m", "maturin", "build", "--release", "--locked", "--quiet"]);
    maturin.arg("--manifest-path").arg(workspace.path("python/Cargo.toml"));
    stage("wheel", maturin.arg("--out").arg(&folder))?;
    let entries =
        fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let wheel = entries.flatten().map(|entry| entry.path());
    match wheel.into_iter().find(|path| path.extension().is_some_and(|end| end == "whl")) {
        Some(wheel) => Ok(wheel),
        None => bail!("maturin left no wheel in {}", folder.display()),
    }
}
