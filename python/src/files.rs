//! Files, with Python's exceptions.

use std::fs;
use std::io;
use std::path::Path;

use pyo3::PyErr;
use pyo3::exceptions::PyOSError;

use crate::error::Error;

/// The bytes of a file.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, Error> {
    fs::read(path).map_err(|error| raised(&error, path))
}

/// Writes a whole file.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    fs::write(path, bytes).map_err(|error| raised(&error, path))
}

/// An `OSError` that names the file; Python makes it a `FileNotFoundError` and the like by its number.
fn raised(error: &io::Error, path: &Path) -> Error {
    let path = path.display().to_string();
    let raised: PyErr = match error.raw_os_error() {
        Some(number) => PyOSError::new_err((number, error.kind().to_string(), path)),
        None => PyOSError::new_err(format!("{path}: {error}")),
    };
    raised.into()
}
