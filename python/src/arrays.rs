//! Conversion between NumPy arrays and numbers of the library.
//!
//! An argument can be any object that NumPy converts to an array, with any memory layout. Its numbers must be
//! float64 or convert to float64 without loss. The array is copied, because another Python thread might write
//! to it while the interpreter is released.

use std::f64::consts::TAU;
use std::ffi::CString;

use numpy::{Element, IntoPyArray, PyArray2, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyFloat, PyInt, PyList, PyTuple};
use sidestep::invalid::Invalid;
use sidestep::scene::JointState;
use sidestep::vehicle::Pose;

use crate::error::Error;

pyo3::create_exception!(
    sidestep,
    AngleWarning,
    PyUserWarning,
    "A heading of more than a full turn: it may be in degrees. It is used as radians."
);

/// An array of any shape.
pub(crate) type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Finite numbers in row-major order, and the shape of the array that they came from.
pub(crate) struct Numbers {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

/// Reads an array of finite numbers. `shape` describes the accepted shapes for error messages.
pub(crate) fn numbers(
    field: &str,
    shape: &str,
    object: &Bound<'_, PyAny>,
) -> Result<Numbers, Error> {
    let py = object.py();
    let numpy = py.import("numpy")?;
    let expected = || format!("an array of float64 of shape {shape}");
    // Reject masked entries, because the copy would contain the masked values.
    let masked = object.hasattr("_mask")?
        && numpy.getattr("ma")?.call_method1("is_masked", (object,))?.is_truthy()?;
    if masked {
        let expected = format!("{} without masked entries", expected());
        return Err(Invalid::new(field, expected, "some").into());
    }
    let array = numpy.call_method1("asarray", (object,)).map_err(|raised| {
        // The conversion fails, for example, for lists of different lengths.
        Invalid::new(field, expected(), raised.value(py))
    })?;
    let kind = array.getattr("dtype")?;
    let fits = numpy.call_method1("can_cast", (&kind, "f8", "safe"))?.is_truthy()?;
    // NumPy converts booleans to 0 or 1, even a single boolean among numbers.
    let boolean = kind.getattr("kind")?.extract::<char>()? == 'b';
    if !fits || boolean {
        return Err(Invalid::new(field, expected(), format!("dtype {kind}")).into());
    }
    if has_boolean(object, MOST_AXES)? {
        return Err(Invalid::new(field, expected(), "a boolean").into());
    }
    let array = numpy.call_method1("require", (array, "f8", PyList::new(py, ["C", "A"])?))?;
    let array = array.cast::<PyArrayDyn<f64>>().map_err(PyErr::from)?.readonly();
    let shape = array.shape().to_vec();
    let values = array.as_slice().map_err(|error| Invalid::new(field, expected(), error))?.to_vec();
    if let Some(position) = values.iter().position(|value| !value.is_finite()) {
        let place = place(field, position, &shape);
        return Err(Invalid::new(place, "a finite number", values[position]).into());
    }
    Ok(Numbers { shape, values })
}

/// The largest number of axes of a NumPy array.
const MOST_AXES: usize = 64;

/// Whether an object, or a list nested in it up to this depth, contains a boolean.
fn has_boolean(object: &Bound<'_, PyAny>, depth: usize) -> PyResult<bool> {
    if object.is_instance_of::<PyBool>() {
        return Ok(true);
    }
    // Most entries have one of these types, and the checks below would be slow.
    if object.is_exact_instance_of::<PyFloat>() || object.is_exact_instance_of::<PyInt>() {
        return Ok(false);
    }
    let listed = object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>();
    if !listed || depth == 0 {
        // A NumPy scalar, which can also be a boolean.
        let kind = object.getattr_opt("dtype")?.map(|dtype| dtype.getattr("kind")).transpose()?;
        return Ok(kind.is_some_and(|kind| kind.eq("b").unwrap_or(false)));
    }
    for entry in object.try_iter()? {
        if has_boolean(&entry?, depth - 1)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Warns about the first heading beyond ±2π rad, because it might be in degrees. Every `width`-th number is a
/// heading.
pub(crate) fn warn_of_degrees(
    py: Python<'_>,
    field: &str,
    Numbers { shape, values }: &Numbers,
    width: usize,
) -> PyResult<()> {
    let beyond = |at: &usize| values[*at].abs() > TAU * (1.0 + 1e-9);
    let Some(at) = (width - 1..values.len()).step_by(width).find(beyond) else { return Ok(()) };
    let (place, psi) = (place(field, at, shape), values[at]);
    let radians = psi.to_radians();
    let said = format!(
        "{place}: {psi} is more than a full turn; headings are in radians ({psi}° are {radians:.4})"
    );
    let said = CString::new(said).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<AngleWarning>(), &said, 1)
}

/// Position of an entry in an array, such as `states[17, 1]`.
pub(crate) fn place(field: &str, mut position: usize, shape: &[usize]) -> String {
    let mut index = Vec::with_capacity(shape.len());
    for &length in shape.iter().rev() {
        index.push((position % length).to_string());
        position /= length;
    }
    index.reverse();
    if index.is_empty() { field.to_owned() } else { format!("{field}[{}]", index.join(", ")) }
}

/// Converts a Python integer to a count of at least `least`.
pub(crate) fn count(field: &str, least: usize, number: i64) -> Result<usize, Error> {
    let found = usize::try_from(number).ok().filter(|&found| found >= least);
    found.ok_or_else(|| Invalid::new(field, format!("at least {least}"), number).into())
}

/// The error for an array whose shape is not `expected`.
pub(crate) fn wrong_shape(field: &str, expected: &str, shape: &[usize]) -> Error {
    let listed: Vec<_> = shape.iter().map(ToString::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let found = format!("shape ({}{comma})", listed.join(", "));
    Invalid::new(field, format!("an array of shape {expected}"), found).into()
}

/// Rows of W numbers, from an array of shape (…, W).
pub(crate) struct Rows<const W: usize> {
    /// The array's shape without the last axis.
    pub(crate) shape: Vec<usize>,
    values: Vec<f64>,
}

impl<const W: usize> Rows<W> {
    pub(crate) fn rows(&self) -> &[[f64; W]] {
        self.values.as_chunks().0
    }
}

/// Reads an array of shape (…, W). Rows of three numbers are taken as poses x, y, ψ, and headings beyond ±2π
/// rad cause a warning.
pub(crate) fn rows<const W: usize>(
    field: &str,
    object: &Bound<'_, PyAny>,
) -> Result<Rows<W>, Error> {
    let Numbers { shape, values } = rows_of(field, W, object)?;
    let whole = Numbers { shape: [&shape[..], &[W]].concat(), values };
    if W == 3 {
        warn_of_degrees(object.py(), field, &whole, W)?;
    }
    Ok(Rows { shape, values: whole.values })
}

/// Reads an array of shape (…, width). The returned shape lacks the last axis.
pub(crate) fn rows_of(
    field: &str,
    width: usize,
    object: &Bound<'_, PyAny>,
) -> Result<Numbers, Error> {
    let expected = format!("(…, {width})");
    let Numbers { mut shape, values } = numbers(field, &expected, object)?;
    if shape.last() != Some(&width) {
        return Err(wrong_shape(field, &expected, &shape));
    }
    shape.pop();
    Ok(Numbers { shape, values })
}

/// Checks that the pose's coordinates are at most [`Pose::MOST`] from 0.
fn checked(field: &str, state: Pose) -> Result<Pose, Error> {
    state.check().map_err(|invalid| invalid.within(field))?;
    Ok(state)
}

/// Reads poses x, y, ψ from an array of shape (n, 3).
pub(crate) fn poses(field: &str, object: &Bound<'_, PyAny>) -> Result<Vec<Pose>, Error> {
    let found = rows::<3>(field, object)?;
    match found.shape[..] {
        [_] => {
            let states = found.rows().iter().copied().map(Pose::from).enumerate();
            states.map(|(i, state)| checked(&format!("{field}[{i}]"), state)).collect()
        }
        _ => Err(wrong_shape(field, "(n, 3)", &[&found.shape[..], &[3]].concat())),
    }
}

/// Reads an array of shape (n, width). Returns n, and the numbers in row-major order.
pub(crate) fn matrix(
    field: &str,
    width: usize,
    object: &Bound<'_, PyAny>,
) -> Result<(usize, Vec<f64>), Error> {
    let expected = format!("(n, {width})");
    let Numbers { shape, values } = numbers(field, &expected, object)?;
    match shape[..] {
        [n, found] if found == width => Ok((n, values)),
        _ => Err(wrong_shape(field, &expected, &shape)),
    }
}

/// Reads an array of shape (n,).
pub(crate) fn list(field: &str, object: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
    let Numbers { shape, values } = numbers(field, "(n,)", object)?;
    if shape.len() == 1 { Ok(values) } else { Err(wrong_shape(field, "(n,)", &shape)) }
}

/// Reads a pose x, y, ψ from an array of shape (3,).
pub(crate) fn pose(field: &str, object: &Bound<'_, PyAny>) -> Result<Pose, Error> {
    let found = rows::<3>(field, object)?;
    match (found.rows(), found.shape.is_empty()) {
        (&[state], true) => checked(field, state.into()),
        _ => Err(wrong_shape(field, "(3,)", &[&found.shape[..], &[3]].concat())),
    }
}

/// Reads joint states, the poses of the human and of the robot, from an array of shape (n, 2, 3) with n ≥
/// `least`.
pub(crate) fn joint_states(
    field: &str,
    least: usize,
    object: &Bound<'_, PyAny>,
) -> Result<Vec<JointState>, Error> {
    let expected = format!("(n, 2, 3) with n ≥ {least}");
    let found = numbers(field, &expected, object)?;
    match found.shape[..] {
        [n, 2, 3] if n >= least => {}
        _ => return Err(wrong_shape(field, &expected, &found.shape)),
    }
    warn_of_degrees(object.py(), field, &found, 3)?;
    let values = found.values;
    let pairs = values.as_chunks::<3>().0.as_chunks::<2>().0;
    let states =
        pairs.iter().map(|&[human, robot]| JointState { human: human.into(), robot: robot.into() });
    states
        .enumerate()
        .map(|(i, state)| {
            state.check().map_err(|invalid| invalid.within(&format!("{field}[{i}]")))?;
            Ok(state)
        })
        .collect()
}

/// Makes an array of this shape from row-major `values`. Their number must match the shape.
pub(crate) fn shaped<'py, T: Element>(
    py: Python<'py>,
    values: Vec<T>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    values.into_pyarray(py).reshape(shape)
}

/// Makes an array of shape (n, 2) from points.
pub(crate) fn points<'py>(
    py: Python<'py>,
    points: &[[f64; 2]],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    points.as_flattened().to_vec().into_pyarray(py).reshape([points.len(), 2])
}

/// Makes an array of shape (n, 2, 3) from joint states.
pub(crate) fn states_array<'py>(py: Python<'py>, states: &[JointState]) -> PyResult<Array<'py>> {
    let poses = states.iter().flat_map(|state| [state.human, state.robot]);
    shaped(py, poses.flat_map(<[f64; 3]>::from).collect(), &[states.len(), 2, 3])
}
