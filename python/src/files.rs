//! File access whose errors are Python exceptions.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use pyo3::PyErr;
use pyo3::exceptions::PyOSError;
use sidestep::invalid::Invalid;

use crate::error::Error;

/// Maximum number of bytes read from a file. A NumPy archive without extensions is never longer.
const MOST_BYTES: u64 = 1 << 32;

/// Reads a file of at most 4 GiB. Rejects devices and pipes, because they may be endless.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let about = fs::metadata(path).map_err(|error| raised(&error, path))?;
    if !about.is_file() && !about.is_dir() {
        let found = format!("a device or a pipe, {}", path.display());
        return Err(Invalid::new("path", "a file", found).into());
    }
    let too_long = |found: u64| {
        let expected = format!("a file of at most {MOST_BYTES} bytes");
        Err(Invalid::new("path", expected, format!("{found} or more in {}", path.display())).into())
    };
    if about.len() > MOST_BYTES {
        return too_long(about.len());
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    let file = File::open(path).map_err(|error| raised(&error, path))?;
    // The file may have grown since its length was read.
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|error| raised(&error, path))?;
    if bytes.len() as u64 > MOST_BYTES { too_long(bytes.len() as u64) } else { Ok(bytes) }
}

/// Writes a file and replaces its content.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(path, bytes).map_err(|error| raised(&error, path))
}

/// An `OSError` that names the file. Python selects the subclass, such as `FileNotFoundError`, by the error
/// number.
fn raised(error: &io::Error, path: &Path) -> Error {
    let path = path.display().to_string();
    let raised: PyErr = match error.raw_os_error() {
        Some(number) => PyOSError::new_err((number, error.kind().to_string(), path)),
        None => PyOSError::new_err(format!("{path}: {error}")),
    };
    raised.into()
}
