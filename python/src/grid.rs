//! Rectangular grids of one to four dimensions.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyBool;
use sidestep::invalid::Invalid;
use sidestep::reachability::{Axis, Boundary, Grid as OfDimension};

use crate::arrays::{Array, Numbers, count, list, numbers, shaped, wrong_shape};
use crate::error::Error;
use crate::kept::New;
use crate::scalars::wholes;

/// A rectangular grid of one to four dimensions. `hj_solve` computes values on its nodes.
///
/// Parameters
/// ----------
/// lo, hi : array of float64, shape (D,), 1 ≤ D ≤ 4
///     The lower and the upper end of each axis, in the unit of its coordinate.
/// nodes : list of int, D of them, each ≥ 3
///     Number of nodes of each axis, from `lo` to `hi` inclusive. On a periodic axis, `hi` is the same point
///     as `lo`, and the last node is one spacing before `hi`. The spacing must exceed rounding errors.
/// periodic : list of int, or of bool, shape (D,), optional
///     Periodic axes, such as headings: their indices from 0, or a boolean for each axis.
/// constant_ends : list of int, or of bool, shape (D,), optional
///     Axes beyond whose ends V is constant. Beyond all other ends, V is extrapolated linearly with the slope
///     at the end. Its sign is chosen such that V moves away from 0, so that no false target enters from
///     outside.
#[pyclass(frozen, eq, from_py_object, module = "sidestep")]
#[derive(Clone, PartialEq)]
pub(crate) struct Grid {
    pub(crate) axes: Vec<Axis>,
}

/// Maximum number of nodes. More nodes would need more memory than a machine has, because a game stores
/// several arrays per node.
const MOST_NODES: usize = 1 << 28;

#[pymethods]
impl Grid {
    #[new]
    #[pyo3(signature = (lo, hi, nodes, *, periodic=None, constant_ends=None))]
    fn new(
        lo: &Bound<'_, PyAny>,
        hi: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = wholes)] nodes: Vec<i64>,
        periodic: Option<&Bound<'_, PyAny>>,
        constant_ends: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let (lo, hi) = (list("lo", lo)?, list("hi", hi)?);
        if !(1..=4).contains(&lo.len()) {
            return Err(wrong_shape("lo", "(D,) with 1 ≤ D ≤ 4", &[lo.len()]));
        }
        for (name, entries) in [("hi", hi.len()), ("nodes", nodes.len())] {
            if entries != lo.len() {
                let expected = format!("{} entries, as lo has", lo.len());
                return Err(Invalid::new(name, expected, entries).into());
            }
        }
        let mut axes = Vec::with_capacity(lo.len());
        for (d, nodes) in nodes.into_iter().enumerate() {
            let nodes = count(&format!("nodes[{d}]"), 3, nodes)?;
            axes.push(Axis::bounded(lo[d], hi[d], nodes));
        }
        for d in chosen("periodic", periodic, axes.len())? {
            axes[d].boundary = Boundary::Periodic;
        }
        for d in chosen("constant_ends", constant_ends, axes.len())? {
            if axes[d].is_periodic() {
                let found = format!("axis {d}, which is periodic");
                return Err(Invalid::new("constant_ends", "axes with ends", found).into());
            }
            axes[d].boundary = Boundary::Constant;
        }
        Self::of_axes(axes)
    }

    /// The lower end of each axis, shape (D,).
    #[getter]
    fn lo<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.by_axis(py, |axis| axis.low)
    }

    /// The upper end of each axis, shape (D,).
    #[getter]
    fn hi<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.by_axis(py, |axis| axis.high)
    }

    /// The distance between neighbouring nodes of each axis, shape (D,).
    #[getter]
    fn spacing<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        self.by_axis(py, Axis::spacing)
    }

    /// The number of nodes of each axis.
    #[getter]
    pub(crate) fn nodes(&self) -> Vec<usize> {
        self.axes.iter().map(|axis| axis.nodes).collect()
    }

    /// The periodic axes.
    #[getter]
    fn periodic(&self) -> Vec<usize> {
        self.axes_with(Boundary::Periodic)
    }

    /// The axes beyond whose ends V is constant.
    #[getter]
    fn constant_ends(&self) -> Vec<usize> {
        self.axes_with(Boundary::Constant)
    }

    /// The coordinates of the nodes of each axis: D arrays of shape (nodes,).
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Vec<Array<'py>>> {
        self.axes.iter().map(|axis| shaped(py, axis.coordinates(), &[axis.nodes])).collect()
    }

    /// The state at each node, shape (*nodes, D).
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let coordinates: Vec<Vec<f64>> = self.axes.iter().map(Axis::coordinates).collect();
        let mut states = memory("states", self.len() * self.axes.len()).map_err(PyErr::from)?;
        for mut position in 0..self.len() {
            let place = states.len();
            for along in coordinates.iter().rev() {
                states.push(along[position % along.len()]);
                position /= along.len();
            }
            states[place..].reverse();
        }
        shaped(py, states, &self.shape(&[self.axes.len()]))
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<NewArguments<'py>> {
        let named = pyo3::types::PyDict::new(py);
        named.set_item("periodic", self.periodic())?;
        named.set_item("constant_ends", self.constant_ends())?;
        Ok(((self.lo(py)?, self.hi(py)?, self.nodes()), named))
    }

    pub(crate) fn __repr__(&self) -> String {
        let ends = |end: fn(&Axis) -> f64| self.axes.iter().map(end).collect::<Vec<_>>();
        let constant = match &self.constant_ends()[..] {
            [] => String::new(),
            axes => format!(", constant_ends={axes:?}"),
        };
        format!(
            "Grid(lo={:?}, hi={:?}, nodes={:?}, periodic={:?}{constant})",
            ends(|axis| axis.low),
            ends(|axis| axis.high),
            self.nodes(),
            self.periodic()
        )
    }
}

/// Positional and named arguments that recreate a grid.
type NewArguments<'py> = New<'py, (Array<'py>, Array<'py>, Vec<usize>)>;

impl Grid {
    /// Creates a grid of these axes. Checks each axis, and that there are not too many nodes.
    fn of_axes(axes: Vec<Axis>) -> Result<Self, Error> {
        let mut nodes = 1_usize;
        for (d, &axis) in axes.iter().enumerate() {
            OfDimension { axes: [axis] }.check(1).map_err(|invalid| named(invalid, d))?;
            apart(axis, d)?;
            nodes = nodes.saturating_mul(axis.nodes);
        }
        if nodes > MOST_NODES {
            return Err(Invalid::new("nodes", format!("at most {MOST_NODES} in all"), nodes).into());
        }
        Ok(Self { axes })
    }

    fn axes_with(&self, boundary: Boundary) -> Vec<usize> {
        (0..self.axes.len()).filter(|d| self.axes[*d].boundary == boundary).collect()
    }

    /// Number of nodes.
    pub(crate) fn len(&self) -> usize {
        self.axes.iter().map(|axis| axis.nodes).product()
    }

    /// The shape of arrays with `tail` numbers at each node.
    pub(crate) fn shape(&self, tail: &[usize]) -> Vec<usize> {
        [&self.nodes(), tail].concat()
    }

    fn by_axis<'py>(&self, py: Python<'py>, of: impl Fn(&Axis) -> f64) -> PyResult<Array<'py>> {
        shaped(py, self.axes.iter().map(of).collect(), &[self.axes.len()])
    }

    /// Reads numbers at each node, row-major, from an array or from a callable. The callable gets the states
    /// of all nodes. If `tail` is not empty, a single array of shape `tail` is used for every node.
    pub(crate) fn at_nodes(
        slf: &Bound<'_, Self>,
        field: &str,
        tail: &[usize],
        object: &Bound<'_, PyAny>,
    ) -> Result<Vec<f64>, Error> {
        let grid = slf.get();
        let answer;
        let given = if object.is_callable() {
            answer = object.call1((grid.states(slf.py())?,)).map_err(|raised| {
                uncallable(slf.py(), field, &raised).unwrap_or_else(|| raised.into())
            })?;
            &answer
        } else {
            object
        };
        if tail.is_empty() && is_mask(given) {
            let inside = if field == "obstacle" { "1.0, -1.0" } else { "-1.0, 1.0" };
            let expected = format!(
                "numbers, ideally distances; for a mask that is true inside, np.where(mask, {inside})"
            );
            return Err(Invalid::new(field, expected, "booleans").into());
        }
        let whole = grid.shape(tail);
        let listed = |shape: &[usize]| {
            let numbers: Vec<_> = shape.iter().map(ToString::to_string).collect();
            format!("({}{})", numbers.join(", "), if shape.len() == 1 { "," } else { "" })
        };
        let mut expected = listed(&whole);
        if !tail.is_empty() {
            expected = format!("{expected} or {}", listed(tail));
        }
        let Numbers { shape, values } = numbers(field, &expected, given)?;
        if shape == whole {
            Ok(values)
        } else if !tail.is_empty() && shape == tail {
            let mut all = memory(field, values.len() * grid.len())?;
            (0..grid.len()).for_each(|_| all.extend_from_slice(&values));
            Ok(all)
        } else {
            Err(wrong_shape(field, &expected, &shape))
        }
    }
}

/// Whether this is an array or a scalar of booleans.
fn is_mask(array: &Bound<'_, PyAny>) -> bool {
    let kind = array.getattr("dtype").and_then(|of| of.getattr("kind")?.extract::<char>());
    kind.is_ok_and(|kind| kind == 'b')
}

/// The error for a callable that does not accept one argument. In this case none of the callable's code has
/// run, so the exception has no traceback. `None` for exceptions of the callable itself.
fn uncallable(py: Python<'_>, field: &str, raised: &PyErr) -> Option<Error> {
    if !raised.is_instance_of::<PyTypeError>(py) || raised.traceback(py).is_some() {
        return None;
    }
    let expected = "a callable of one argument, the states of all nodes";
    let complaint = Invalid::new(field, expected, raised.value(py));
    Some(PyTypeError::new_err(complaint.to_string()).into())
}

/// The axes that an argument selects, by index or by a boolean for each axis. In Python `True` equals 1, so a
/// list of booleans must be distinguished from a list of indices.
fn chosen(
    field: &str,
    object: Option<&Bound<'_, PyAny>>,
    axes: usize,
) -> Result<Vec<usize>, Error> {
    let Some(object) = object else { return Ok(Vec::new()) };
    let entries: Vec<Bound<'_, PyAny>> = object.extract()?;
    let is_boolean = |entry: &Bound<'_, PyAny>| entry.is_instance_of::<PyBool>() || is_mask(entry);
    let booleans = entries.iter().filter(|entry| is_boolean(entry)).count();
    if booleans > 0 {
        if booleans < entries.len() {
            let expected = "numbers of axes, or a boolean for each axis";
            return Err(Invalid::new(field, expected, "both in one list").into());
        }
        if booleans != axes {
            let expected = format!("{axes} booleans, one for each axis, or numbers of axes");
            return Err(Invalid::new(field, expected, booleans).into());
        }
        let mut named = Vec::new();
        for (d, entry) in entries.iter().enumerate() {
            if entry.is_truthy()? {
                named.push(d);
            }
        }
        return Ok(named);
    }
    let mut named = Vec::new();
    for (i, d) in wholes(object)?.into_iter().enumerate() {
        let Some(d) = usize::try_from(d).ok().filter(|d| *d < axes) else {
            let expected = format!("an axis, from 0 to {}", axes - 1);
            return Err(Invalid::new(format!("{field}[{i}]"), expected, d).into());
        };
        named.push(d);
    }
    Ok(named)
}

/// Allocates memory for `count` numbers of the argument `field`.
fn memory(field: &str, count: usize) -> Result<Vec<f64>, Error> {
    let mut numbers = Vec::new();
    let room = numbers.try_reserve_exact(count);
    let bytes = count * size_of::<f64>();
    let expected = "a grid that fits in memory";
    room.map_err(|_| Invalid::new(field, expected, format!("{bytes} bytes")))?;
    Ok(numbers)
}

/// Rejects an axis with nodes so close together that rounding moves them by more than a thousandth of their
/// spacing.
fn apart(axis: Axis, d: usize) -> Result<(), Invalid> {
    let rounding = f64::EPSILON * axis.low.abs().max(axis.high.abs());
    let least = (1e3 * rounding).max(f64::MIN_POSITIVE);
    if axis.spacing() >= least {
        return Ok(());
    }
    let expected =
        format!("nodes at least {least:e} apart, a thousand times the rounding of their places");
    Err(Invalid::new(format!("hi[{d}]"), expected, format!("{:e}", axis.spacing())))
}

/// Renames the fields of an error about a one-axis grid to the arguments for axis `d`.
fn named(mut invalid: Invalid, d: usize) -> Invalid {
    for (part, argument) in [("low", "lo"), ("high", "hi"), ("nodes", "nodes")] {
        invalid.field =
            invalid.field.replace(&format!("axes[0].{part}"), &format!("{argument}[{d}]"));
    }
    invalid
}
