//! The test programs that cargo compiles.

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::workspace::{Workspace, output_of};

/// A compiled test program.
pub(super) struct Program {
    /// The folder of the program's package, in which the program runs.
    folder: PathBuf,
    /// Its name in cargo: a file or folder of `tests/`, or a library.
    pub(super) name: String,
    executable: PathBuf,
}

impl Program {
    /// The name of the package's folder.
    pub(super) fn package(&self) -> String {
        self.folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns a command that runs the program as `cargo test` does.
    pub(super) fn call(&self) -> Command {
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command
    }
}

/// Cargo's message about an artifact, which is newly compiled or was up to date.
#[derive(Deserialize)]
struct Artifact {
    manifest_path: PathBuf,
    target: Target,
    profile: Profile,
    executable: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
}

#[derive(Deserialize)]
struct Profile {
    test: bool,
}

/// Compiles every test program.
///
/// # Errors
/// If compiling fails.
pub(super) fn compile(workspace: &Workspace) -> Result<Vec<Program>> {
    eprintln!("==> test programs");
    // Without a selection of targets, cargo would also compile every example. With `--bins`, it would also
    // compile programs without tests.
    let mut cargo = workspace.compile("test");
    cargo.args(["--tests", "--no-run", "--message-format=json-render-diagnostics"]);
    let programs = read(&output_of("test programs", &mut cargo)?)?;
    eprintln!("    {} programs", programs.len());
    Ok(programs)
}

/// Finds the test programs in cargo's messages, which have one line each.
fn read(messages: &str) -> Result<Vec<Program>> {
    let mut found = Vec::new();
    for line in messages.lines().filter(|line| line.contains(r#""reason":"compiler-artifact""#)) {
        let artifact: Artifact = serde_json::from_str(line).context("what cargo compiled")?;
        let Artifact { mut manifest_path, target, profile, executable } = artifact;
        if let (true, Some(executable)) = (profile.test, executable) {
            manifest_path.pop();
            found.push(Program { folder: manifest_path, name: target.name, executable });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_programs_are_those_with_a_harness() {
        let message = |name: &str, test: bool, executable: &str| {
            format!(
                r#"{{"reason":"compiler-artifact","package_id":"x","manifest_path":"/w/tests/Cargo.toml",
                "target":{{"kind":["test"],"name":"{name}"}},"profile":{{"opt_level":"1","test":{test}}},
                "executable":{executable},"fresh":true}}"#
            )
            .replace('\n', "")
        };
        let messages = [
            message("sidestep", false, "\"/t/sidestep\""),
            message("api", true, "\"/t/api-1f\""),
            message("sidestep", true, "null"),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
        ];
        let found = read(&messages.join("\n")).expect("programs");
        let [api] = &found[..] else { panic!("{} programs", found.len()) };
        assert_eq!((api.package().as_str(), api.name.as_str()), ("tests", "api"));
        let call = api.call();
        assert_eq!(call.get_current_dir(), Some(std::path::Path::new("/w/tests")));
        assert_eq!(call.get_program(), "/t/api-1f");
    }
}
