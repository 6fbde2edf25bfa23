//! Programs on `PATH`, and commands that run other commands.

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The first of these commands found on `PATH`.
pub(crate) fn on_path(commands: &[&str]) -> Option<PathBuf> {
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH")?).collect();
    first_in(&folders, commands)
}

/// The first of these commands found in `folders`.
fn first_in(folders: &[PathBuf], commands: &[&str]) -> Option<PathBuf> {
    let candidates = commands.iter().flat_map(|command| {
        let file = format!("{command}{}", env::consts::EXE_SUFFIX);
        folders.iter().map(move |folder| folder.join(&file))
    });
    candidates.into_iter().find(|path| is_program(path))
}

/// Whether this is the absolute path of a file.
pub(crate) fn is_program(path: &Path) -> bool {
    path.is_absolute() && path.is_file()
}

/// Returns the command `words` with the words of `command` as its last arguments.
pub(crate) fn within(words: &[&OsStr], command: &Command) -> Command {
    let mut outer = Command::new(words[0]);
    outer.args(&words[1..]).arg(command.get_program()).args(command.get_args());
    if let Some(folder) = command.get_current_dir() {
        outer.current_dir(folder);
    }
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => outer.env(name, value),
            None => outer.env_remove(name),
        };
    }
    outer
}

/// Lowers the priority of a command, if `nice` is available.
pub(crate) fn beneath(command: Command) -> Command {
    if on_path(&["nice"]).is_none() {
        return command;
    }
    within(&["nice".as_ref(), "-n".as_ref(), "10".as_ref()], &command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_preferred_in_their_order() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let folders = [folder.to_path_buf(), folder.join("src")];
        let found = first_in(&folders, &["absent", "main.rs", "Cargo.toml"]);
        assert_eq!(found, Some(folder.join("src/main.rs")));
        assert_eq!(first_in(&folders, &["absent"]), None);
    }

    #[test]
    fn the_outer_command_has_the_environment_of_the_inner_one() {
        let mut inner = Command::new("inner");
        inner.arg("a").env("SET", "1").env_remove("REMOVED").current_dir("/w");
        let outer = within(&["outer".as_ref(), "-x".as_ref()], &inner);
        assert_eq!(outer.get_args().collect::<Vec<_>>(), ["-x", "inner", "a"]);
        assert_eq!(outer.get_current_dir(), Some(Path::new("/w")));
        let environment: Vec<_> = outer.get_envs().collect();
        assert_eq!(environment, inner.get_envs().collect::<Vec<_>>());
    }
}
