//! Files and folders that are readable only by this user, even before their first byte is written.

use std::fs::{DirBuilder, File, Metadata, OpenOptions, TryLockError};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;
use tempfile::TempDir;

/// Creates a file for writing. Only this user can read it.
///
/// # Errors
/// If the file cannot be created or already exists.
pub(crate) fn new_file(path: &Path) -> io::Result<File> {
    OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)
}

/// Creates a folder and its parents, if they do not exist. Only this user can access the new folders.
///
/// # Errors
/// If the folder cannot be created.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// A folder for unfinished work. It is deleted when this value is dropped. If the program was
/// killed, the next program that creates such a folder in the same place deletes it.
#[derive(Debug)]
pub(crate) struct Unfinished {
    folder: TempDir,
    /// Locked while this process uses the folder.
    _lock: File,
}

impl Unfinished {
    /// Creates a folder whose name begins with `prefix`. Deletes the folders that killed programs
    /// left behind.
    ///
    /// # Errors
    /// If the folder cannot be created.
    pub(crate) fn within(prefix: &str, parent: &Path) -> io::Result<Self> {
        if !parent.is_dir() {
            // Otherwise the error would name the temporary folder.
            let said = format!("there is no folder {}", parent.display());
            return Err(io::Error::new(io::ErrorKind::NotFound, said));
        }
        sweep(prefix, parent);
        loop {
            let folder = temporary_folder(prefix, parent)?;
            match File::open(folder.path()).and_then(|open| claim(open, folder.path())) {
                Ok(Some(lock)) => return Ok(Self { folder, _lock: lock }),
                Ok(None) => {}
                // Before this process locked the folder, another process took it for a leftover and
                // deleted it.
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
    }

    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Locks a file or folder that was just created, so that no process takes it for a leftover. Returns
/// `None` if another process deleted it first.
pub(crate) fn claim(open: File, path: &Path) -> io::Result<Option<File>> {
    if let Err(TryLockError::WouldBlock) = open.try_lock() {
        return Ok(None);
    }
    // If the file system has no locks, `sweep` deletes nothing, so a lock is not necessary.
    let own = open.metadata()?;
    let is_there = |found: Metadata| (found.dev(), found.ino()) == (own.dev(), own.ino());
    Ok(path.symlink_metadata().is_ok_and(is_there).then_some(open))
}

/// Deletes the files and folders with this prefix that no process has locked.
pub(crate) fn sweep(prefix: &str, parent: &Path) {
    for entry in std::fs::read_dir(parent).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with(prefix) {
            continue;
        }
        let Ok(kind) = entry.file_type() else { continue };
        let path = entry.path();
        let lock = if kind.is_symlink() { None } else { File::open(&path).ok() };
        if let Some(lock) = lock
            && lock.try_lock().is_ok()
        {
            // Ignore errors, because a file that cannot be deleted belongs to another user.
            let _ = match kind.is_dir() {
                true => std::fs::remove_dir_all(&path),
                false => std::fs::remove_file(&path),
            };
        }
    }
}

/// Creates a folder whose name begins with `prefix`. It is deleted when it is dropped.
///
/// # Errors
/// If the folder cannot be created.
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

    #[test]
    fn what_nobody_uses_is_deleted_and_nothing_else() {
        let parent = TempDir::new().unwrap();
        let at = |name: &str| parent.path().join(name);
        let used = Unfinished::within("of-us-", parent.path()).unwrap();
        std::fs::write(used.path().join("copy"), "").unwrap();
        std::fs::create_dir_all(at("of-us-1/below")).unwrap();
        for name in ["of-us-2", "of-others", "target"] {
            std::fs::write(at(name), "").unwrap();
        }
        std::os::unix::fs::symlink(at("target"), at("of-us-3")).unwrap();
        let next = Unfinished::within("of-us-", parent.path()).unwrap();
        assert!(used.path().join("copy").exists() && next.path() != used.path());
        let left = |name: &str| at(name).symlink_metadata().is_ok();
        assert_eq!(["of-us-1", "of-us-2"].map(left), [false; 2]);
        assert_eq!(["of-others", "target", "of-us-3"].map(left), [true; 3]);
        let path = used.path().to_owned();
        drop(used);
        assert!(!path.exists());
    }
}
