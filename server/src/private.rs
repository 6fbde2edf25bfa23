//! Files and folders that only this user can read, from before their first byte.

use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;
use tempfile::TempDir;

/// A new file that is written.
///
/// # Errors
/// If it cannot be created, or exists already.
pub(crate) fn new_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

/// Makes a folder where there is none, with those above it.
///
/// # Errors
/// If it cannot be made.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// A folder that is deleted when it is dropped. Its name begins with `prefix`.
///
/// # Errors
/// If it cannot be made.
pub(crate) fn temporary_folder(prefix: &str, parent: &Path) -> io::Result<TempDir> {
    let private = std::fs::Permissions::from_mode(0o700);
    tempfile::Builder::new().prefix(prefix).permissions(private).tempdir_in(parent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_else_can_read() {
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let folder = temporary_folder("private-", &std::env::temp_dir()).unwrap();
        assert_eq!(mode(folder.path()), 0o700);
        let file = folder.path().join("file");
        drop(new_file(&file).unwrap());
        assert_eq!(mode(&file), 0o600);
        assert_eq!(new_file(&file).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        let below = folder.path().join("a/b");
        make_folder(&below).unwrap();
        make_folder(&below).unwrap();
        assert_eq!(mode(&below), 0o700);
    }
}
