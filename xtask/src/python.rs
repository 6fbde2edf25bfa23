//! Python environments with packages, for tests and comparisons.

use std::path::PathBuf;
use std::process::Command;
use std::{env, fs};

use anyhow::{Context, Result};

use crate::workspace::{Workspace, stage};

/// Environment variable with the path of the Python that creates environments.
pub(crate) const PYTHON: &str = "SIDESTEP_PYTHON";

/// Returns the Python interpreter of the environment `name`, which has the packages in `requirements` (a file
/// in `tests/peers`). Creates the environment on first use and again when the requirements change.
pub(crate) fn environment(
    workspace: &Workspace,
    requirements: &str,
    name: &str,
) -> Result<PathBuf> {
    prepared(workspace, requirements, name).context(
        "a Python environment needs python3 (3.11 or newer, with venv; Debian: apt-get install \
         python3 python3-venv) and access to PyPI",
    )
}

fn prepared(workspace: &Workspace, requirements: &str, name: &str) -> Result<PathBuf> {
    let requirements = workspace.path("tests/peers").join(requirements);
    let folder = workspace.output("peers").join(name);
    // This copy of the requirements is written after the installation, so that an incomplete
    // environment is never used.
    let installed = folder.join("requirements.txt");
    let program = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
    let interpreter = folder.join(program);
    let wanted = fs::read(&requirements)
        .with_context(|| format!("cannot read {}", requirements.display()))?;
    if fs::read(&installed).is_ok_and(|found| found == wanted) && interpreter.is_file() {
        return Ok(interpreter);
    }

    let python = env::var_os(PYTHON).unwrap_or_else(|| "python3".into());
    let mut create = Command::new(python);
    stage("Python environment", create.args(["-m", "venv", "--clear"]).arg(&folder))
        .with_context(|| format!("set {PYTHON} to another Python if this one does not work"))?;
    let mut install = Command::new(&interpreter);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    stage("pip install", install.arg("--requirement").arg(&requirements))?;
    fs::write(&installed, wanted)
        .with_context(|| format!("cannot write {}", installed.display()))?;
    Ok(interpreter)
}
