//! Files that appear whole or not at all.

use crate::support::private;
use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use tempfile::NamedTempFile;
use tokio_util::sync::CancellationToken;

/// Checks that a file can be written at `path`, so that an error is found before a long computation.
///
/// # Errors
/// The error of the disk.
pub fn check(path: &Path) -> io::Result<()> {
    if path.is_dir() {
        return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
    }
    // A rename would replace a device, a pipe or a link.
    if path.symlink_metadata().is_ok_and(|found| !found.is_file()) {
        let kind = io::ErrorKind::InvalidInput;
        return Err(io::Error::new(kind, "it exists and is not a regular file"));
    }
    beside(path, 0o600).map(drop)
}

/// Writes a temporary file in the same folder, and renames it to `path` once it is fully on disk.
///
/// # Errors
/// The error of the disk, or a cancellation through `cancel`. In both cases the temporary file is
/// deleted and `path` is unchanged.
pub fn write<E: From<io::Error>>(
    path: &Path,
    cancel: &CancellationToken,
    content: impl FnOnce(&mut dyn WriteSeek) -> Result<(), E>,
) -> Result<(), E> {
    // Use the default permissions of a new file.
    write_with(path, 0o666, cancel, content)
}

/// Like [`write()`], but only this user can read the file.
///
/// # Errors
/// The errors of [`write()`].
pub fn write_private<E: From<io::Error>>(
    path: &Path,
    cancel: &CancellationToken,
    content: impl FnOnce(&mut dyn WriteSeek) -> Result<(), E>,
) -> Result<(), E> {
    write_with(path, 0o600, cancel, content)
}

fn write_with<E: From<io::Error>>(
    path: &Path,
    mode: u32,
    cancel: &CancellationToken,
    content: impl FnOnce(&mut dyn WriteSeek) -> Result<(), E>,
) -> Result<(), E> {
    check(path)?;
    let (mut file, _lock) = beside(path, mode)?;
    let mut out = BufWriter::new(Cancellable { out: file.as_file_mut(), cancel });
    content(&mut out)?;
    out.flush()?;
    drop(out);
    file.as_file().sync_all()?;
    if cancel.is_cancelled() {
        return Err(stopped().into());
    }
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// A writer for archives.
pub trait WriteSeek: Write + io::Seek {}

impl<T: Write + io::Seek> WriteSeek for T {}

/// Creates a temporary file, with a lock that prevents other processes from deleting it.
fn beside(path: &Path, mode: u32) -> io::Result<(NamedTempFile, File)> {
    const PREFIX: &str = ".sidestep-part-";
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        // Otherwise the error would name the temporary file.
        let said = format!("there is no folder {}", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, said));
    }
    private::sweep(PREFIX, folder);
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).permissions(Permissions::from_mode(mode));
    loop {
        let file = builder.tempfile_in(folder)?;
        if let Some(lock) = private::claim(file.as_file().try_clone()?, file.path())? {
            return Ok((file, lock));
        }
    }
}

struct Cancellable<'a, W> {
    out: W,
    cancel: &'a CancellationToken,
}

impl<W: Write> Write for Cancellable<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.cancel.is_cancelled() { Err(stopped()) } else { self.out.write(bytes) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl<W: io::Seek> io::Seek for Cancellable<'_, W> {
    fn seek(&mut self, position: io::SeekFrom) -> io::Result<u64> {
        self.out.seek(position)
    }
}

fn stopped() -> io::Error {
    io::Error::other("stopped")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let cancel = CancellationToken::new();
        write::<io::Error>(&path, &cancel, |out| out.write_all(b"first")).unwrap();
        let broken = write::<io::Error>(&path, &cancel, |out| {
            out.write_all(b"second")?;
            Err(io::Error::other("broken"))
        });
        assert!(broken.is_err());
        let stopped = write::<io::Error>(&path, &cancel, |out| {
            cancel.cancel();
            out.write_all(b"third")
        });
        assert!(stopped.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        assert_eq!(names(folder.path()), ["file"]);
        assert!(check(folder.path()).is_err() && check(&path).is_ok());
        assert!(check(&folder.path().join("no").join("file")).is_err());
        assert_eq!(names(folder.path()), ["file"]);
    }
}
