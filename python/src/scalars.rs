//! Conversion of numbers and words from Python. Integers beyond the machine's range are clamped to the
//! nearest machine integer, or to ±infinity for real numbers. The check of the argument then rejects them
//! with an error that names the argument.

use pyo3::exceptions::{PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBool;
use sidestep::invalid::Invalid;

/// Reads a real number.
pub(crate) fn real(object: &Bound<'_, PyAny>) -> PyResult<f64> {
    if object.is_instance_of::<PyBool>() {
        return Err(PyTypeError::new_err("must be real number, not bool"));
    }
    or_largest(object, [f64::NEG_INFINITY, f64::INFINITY])
}

/// Reads the argument `horizon_s`. It can be infinite. An integer that is too large for a float is rejected.
pub(crate) fn horizon(object: &Bound<'_, PyAny>) -> PyResult<f64> {
    let horizon_s = real(object)?;
    if horizon_s.is_infinite() && object.is_instance_of::<pyo3::types::PyInt>() {
        let expected = "a number > 0, or inf";
        let found = "a whole number beyond 10³⁰⁸";
        return Err(PyValueError::new_err(format!(
            "horizon_s: expected {expected}, found {found}"
        )));
    }
    Ok(horizon_s)
}

/// Reads a whole number.
pub(crate) fn whole(object: &Bound<'_, PyAny>) -> PyResult<i64> {
    or_largest(object, [i64::MIN, i64::MAX])
}

/// Reads a real number or None.
pub(crate) fn some_real(object: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    if object.is_none() { Ok(None) } else { real(object).map(Some) }
}

/// Reads a whole number or None.
pub(crate) fn some_whole(object: &Bound<'_, PyAny>) -> PyResult<Option<i64>> {
    if object.is_none() { Ok(None) } else { whole(object).map(Some) }
}

/// Reads a list of whole numbers.
pub(crate) fn wholes(object: &Bound<'_, PyAny>) -> PyResult<Vec<i64>> {
    let entries: Vec<Bound<'_, PyAny>> = object.extract()?;
    entries.iter().map(whole).collect()
}

/// Reads a list of whole numbers or None.
pub(crate) fn some_wholes(object: &Bound<'_, PyAny>) -> PyResult<Option<Vec<i64>>> {
    if object.is_none() { Ok(None) } else { wholes(object).map(Some) }
}

/// Reads the argument `seed`.
pub(crate) fn seed(object: &Bound<'_, PyAny>) -> PyResult<u64> {
    object.extract().map_err(|error: PyErr| {
        if !error.is_instance_of::<PyOverflowError>(object.py()) {
            return error;
        }
        let found = object.str().map(|digits| digits.to_string());
        let found = found.unwrap_or_else(|_| "one of thousands of digits".to_owned());
        let expected = "a whole number from 0 to 18446744073709551615";
        PyValueError::new_err(format!("seed: expected {expected}, found {found}"))
    })
}

/// Reads a number. An integer out of range is clamped to `least` or `largest`.
fn or_largest<'py, T>(object: &Bound<'py, PyAny>, [least, largest]: [T; 2]) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    object.extract().or_else(|error: PyErr| {
        if !error.is_instance_of::<PyOverflowError>(object.py()) {
            return Err(error);
        }
        Ok(if object.lt(0)? { least } else { largest })
    })
}

/// Defines functions that read a string argument, each with the name of its argument. Python's own error for
/// a value that is not a string does not name the argument.
macro_rules! words {
    ($($argument:ident),*) => {$(
        pub(crate) fn $argument<'a>(object: &'a Bound<'_, PyAny>) -> PyResult<&'a str> {
            object.extract().or_else(|_| {
                let field = stringify!($argument);
                let found = object.repr()?;
                Err(PyTypeError::new_err(Invalid::new(field, "a string", found).to_string()))
            })
        }
    )*};
}

words!(accuracy, direction, kind, outside, scheme);
