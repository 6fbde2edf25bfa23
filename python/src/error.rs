//! Errors, as Python exceptions.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;
use sidestep::document::Unread;
use sidestep::invalid::Invalid;

/// The reason why a function failed.
pub(crate) enum Error {
    /// An argument is not accepted: a `ValueError`.
    Invalid(Invalid),
    /// An exception raised by Python itself, such as `KeyboardInterrupt`, or by a callable.
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
    /// The error for a document, called `field`, that could not be read.
    pub(crate) fn unread(field: &str, unread: Unread) -> Self {
        match unread {
            Unread::NotJson(what) => Invalid::new(field, "JSON", what).into(),
            Unread::Invalid(invalid) => invalid.within(field).into(),
        }
    }
}
