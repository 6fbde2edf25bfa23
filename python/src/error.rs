//! Conversion of errors to Python exceptions.

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;
use sidestep::document::Unread;
use sidestep::invalid::Invalid;

/// The reason why a function failed.
pub(crate) enum Error {
    /// An invalid argument. Becomes a `ValueError`.
    Invalid(Invalid),
    /// An exception that Python itself raised, such as `KeyboardInterrupt`, or that a callable
    /// raised.
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
    /// The error for a document that could not be read. `field` names the document.
    pub(crate) fn unread(field: &str, unread: Unread) -> Self {
        match unread {
            Unread::NotJson(what) => Invalid::new(field, "JSON", what).into(),
            Unread::Invalid(invalid) => invalid.within(field).into(),
        }
    }
}
