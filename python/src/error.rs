//! What went wrong, as Python's exceptions.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;
use sidestep::document::Unread;
use sidestep::invalid::Invalid;

/// Why a function has no result.
pub(crate) enum Error {
    /// An argument is not accepted: a `ValueError`.
    Invalid(Invalid),
    /// Python itself raised an exception, such as `KeyboardInterrupt` or one of a callable.
    Raised(PyErr),
}

impl From<Invalid> for Error {
    fn from(invalid: Invalid) -> Self {
        Self::Invalid(invalid)
    }
}

impl From<PyErr> for Error {
    fn from(raised: PyErr) -> Self {
        Self::Raised(raised)
    }
}

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Invalid(invalid) => PyValueError::new_err(invalid.to_string()),
            Error::Raised(raised) => raised,
        }
    }
}

impl Error {
    /// A document, called `field`, that could not be read.
    pub(crate) fn unread(field: &str, unread: Unread) -> Self {
        match unread {
            Unread::NotJson(what) => Invalid::new(field, "JSON", what).into(),
            Unread::Invalid(invalid) => invalid.within(field).into(),
        }
    }
}
