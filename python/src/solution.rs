//! Solutions on a grid: the value function V as a function of state and time.

mod on_grid;

use std::borrow::Cow;
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyString};
use sidestep::invalid::Invalid;
use sidestep::reachability::AffineArrays;
use sidestep::reachability::cartesian::{self, Direction, Kind};

use crate::arrays::{Array, Numbers, rows_of, shaped};
use crate::error::Error;
use crate::files::{read, write};
use crate::function::named;
use crate::grid::Grid;
use crate::scalars::{self, real, some_real, some_whole};
use crate::value::checked;

use self::on_grid::{Asked, GameArrays, Instant};
pub(crate) use self::on_grid::{OnGrid, Solved};

/// Values at the nodes.
type Values<'py> = Bound<'py, numpy::PyArrayDyn<f32>>;

/// Result of `hj_solve`: V at the nodes and, by interpolation, at any state within the grid.
///
/// Between nodes, V is linear along each axis, plus a parabola whose curvature is the smaller of the second
/// differences at the two ends of an edge. Between stored instants, V is linear in time. Outside the grid, V
/// is unknown: a state there raises an error or, on request, gives NaN.
#[pyclass(frozen, module = "sidestep")]
pub(crate) struct Solution {
    pub(crate) grid: Grid,
    pub(crate) solved: Box<dyn Solved>,
}

#[pymethods]
impl Solution {
    /// The grid.
    #[getter]
    fn grid(&self) -> Grid {
        self.grid.clone()
    }

    /// The stored instants as times of the march (s), shape (nt,): the time left or, in a forward solution,
    /// the time since the start. The last instant is the horizon.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let times = self.solved.times_s();
        let shape = [times.len()];
        shaped(py, times, &shape)
    }

    /// V at each stored instant and node, float32, shape (nt, *nodes).
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Values<'py>> {
        let instants = self.solved.times_s().len();
        let shape = [&[instants], &self.grid.nodes()[..]].concat();
        shaped(py, self.solved.values(), &shape)
    }

    /// Direction of time, "backward" or "forward".
    #[getter]
    fn direction(&self) -> &'static str {
        word(DIRECTIONS, self.solved.march().0)
    }

    /// Whether the solution is a "tube" or a "set".
    #[getter]
    fn kind(&self) -> &'static str {
        word(KINDS, self.solved.march().1)
    }

    /// Number of time steps.
    #[getter]
    fn steps(&self) -> usize {
        self.solved.march().2
    }

    /// The largest change of V per second at the end. It is near 0 if V has settled. It says nothing about
    /// accuracy.
    #[getter]
    fn residual(&self) -> f64 {
        self.solved.march().3
    }

    /// V at many states.
    ///
    /// Parameters
    /// ----------
    /// states : array of float64, shape (…, D)
    ///     States within the grid. Along periodic axes, any real number is allowed.
    /// tau_s : float, optional
    ///     The time of the march (s), as in `times`; by default the horizon.
    /// outside : {"raise", "nan"}
    ///     Whether a state outside the grid raises an error or gives NaN.
    /// threads : int, optional
    ///     Maximum number of threads; by default the number of processors.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (…,)
    ///     V. If V ≤ 0, the state belongs to the tube or set.
    #[pyo3(signature = (states, *, tau_s=None, outside="raise", threads=None))]
    fn value<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = some_real)] tau_s: Option<f64>,
        #[pyo3(from_py_with = scalars::outside)] outside: &str,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<Array<'py>, Error> {
        let instant = tau_s.map_or(Instant::End, Instant::At);
        let (py, asked) = (states.py(), self.asked(states, instant, outside, threads)?);
        let found = self.solved.samples(py, &asked, false)?;
        Ok(shaped(py, found, &asked.shape)?)
    }

    /// The gradient of V at many states.
    ///
    /// Parameters
    /// ----------
    /// states, tau_s, outside, threads
    ///     As for `value`.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (…, D)
    ///     ∂V/∂x_d, in the unit of V per unit of coordinate d; one-sided where V has a kink.
    #[pyo3(signature = (states, *, tau_s=None, outside="raise", threads=None))]
    fn gradient<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = some_real)] tau_s: Option<f64>,
        #[pyo3(from_py_with = scalars::outside)] outside: &str,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<Array<'py>, Error> {
        let instant = tau_s.map_or(Instant::End, Instant::At);
        let (py, asked) = (states.py(), self.asked(states, instant, outside, threads)?);
        let found = self.solved.samples(py, &asked, true)?;
        Ok(shaped(py, found, &[&asked.shape[..], &[self.grid.axes.len()]].concat())?)
    }

    /// Optimal inputs at many states, from the gradient of V: what both players do at that state and time.
    /// With `direction="forward"`, what they did when they arrived there.
    ///
    /// Parameters
    /// ----------
    /// states, outside, threads
    ///     As for `value`.
    /// tau_s : float or "first", optional
    ///     As for `value`. "first" stands for the first of `times` at which each state belongs to the tube
    ///     (the horizon if it never does). V is flat inside a tube long before the horizon, so that the
    ///     inputs at the horizon follow rounding errors.
    ///
    /// Returns
    /// -------
    /// u : array of float64, shape (…, m)
    ///     Inputs of the player who minimises V.
    /// d : array of float64, shape (…, k)
    ///     Inputs of the player who maximises V. An input without effect is the middle of its range.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As for `value`, and with "first" as for `time_to_reach`. Also for a loaded solution, because its
    ///     file does not contain the game.
    #[pyo3(signature = (states, *, tau_s=None, outside="raise", threads=None))]
    fn inputs<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        tau_s: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = scalars::outside)] outside: &str,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<(Array<'py>, Array<'py>), Error> {
        let instant = match tau_s {
            None => Instant::End,
            Some(word) if word.is_instance_of::<PyString>() => {
                let word: String = word.extract()?;
                if word != "first" {
                    return Err(Invalid::new("tau_s", "a number, or \"first\"", word).into());
                }
                Instant::First
            }
            Some(tau_s) => Instant::At(real(tau_s)?),
        };
        let (py, asked) = (states.py(), self.asked(states, instant, outside, threads)?);
        let [(u, m), (d, k)] = self.solved.inputs(py, &asked)?;
        let wide = |width: usize| [&asked.shape[..], &[width]].concat();
        Ok((shaped(py, u, &wide(m))?, shaped(py, d, &wide(k))?))
    }

    /// The first time of the march at which states belong to the tube. In a backward solution, it is the time
    /// that a state needs to reach the target. In a forward solution, it is the time after which the state is
    /// reached.
    ///
    /// Parameters
    /// ----------
    /// states, threads
    ///     As for `value`.
    /// outside : {"nan", "raise"}
    ///     Whether a state outside the grid gives NaN or raises an error.
    ///
    /// Returns
    /// -------
    /// array of float64, shape (…,)
    ///     The time (s). 0 in the target, inf where the horizon is too short. V is linear between the
    ///     instants of `times`.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As for `value`. Also for a set, which is not a tube, and if `times` was one number.
    #[pyo3(signature = (states, *, outside="nan", threads=None))]
    fn time_to_reach<'py>(
        &self,
        states: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = scalars::outside)] outside: &str,
        #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    ) -> Result<Array<'py>, Error> {
        let (py, asked) = (states.py(), self.asked(states, Instant::First, outside, threads)?);
        let found = self.solved.first_times(py, &asked)?;
        Ok(shaped(py, found, &asked.shape)?)
    }

    /// Where V may depend on values beyond the ends of the grid.
    ///
    /// A node is marked if a path from it can leave the grid within the time marched. This assumes that each
    /// coordinate changes as fast as anywhere on the grid at that coordinate, for any inputs and **in either
    /// direction**. The relevant paths may leave much later or never, for example beside an end from which
    /// everything moves away. So more nodes are marked than depend on outside values. Where the result is
    /// False, a larger grid gives the same V.
    ///
    /// Parameters
    /// ----------
    /// tau_s : float, optional
    ///     The time of the march (s); by default the horizon.
    ///
    /// Returns
    /// -------
    /// array of bool, shape (*nodes,)
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the time is not between 0 and the horizon, or for a file of an earlier version, which lacks
    ///     this information.
    #[pyo3(signature = (*, tau_s=None))]
    fn depends_on_outside<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = some_real)] tau_s: Option<f64>,
    ) -> Result<Bound<'py, numpy::PyArrayDyn<bool>>, Error> {
        let marked = self.solved.depends_on_outside(tau_s)?;
        Ok(shaped(py, marked, &self.grid.nodes())?)
    }

    /// Writes V to an .npz file, which `load`, `numpy.load` and the Rust library can read. The file does not
    /// contain the game. `pickle` also stores the game.
    fn save(&self, py: Python<'_>, path: PathBuf) -> Result<(), Error> {
        py.detach(|| write(&path, &self.solved.npz()?))
    }

    /// Reads a solution from a file that `save` wrote.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the file is not a solution in single precision, is truncated, damaged or larger than 4 GiB, has
    ///     another format version, or has a `tau` or an axis that does not match `meta`.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> Result<Self, Error> {
        py.detach(|| {
            let bytes = read(&path)?;
            let mut answer = loaded::<1>(&bytes);
            // The number of axes is known only from the file, so try each number.
            for next in [loaded::<2>, loaded::<3>, loaded::<4>] {
                if !answer.as_ref().is_err_and(|invalid| invalid.field == "meta.axes") {
                    break;
                }
                answer = next(&bytes);
            }
            Ok(answer.map_err(|invalid| invalid.within("solution"))?)
        })
    }

    /// Creates a solution from the bytes of a file and, if given, the arrays of its game.
    #[staticmethod]
    #[pyo3(name = "_of")]
    fn of(py: Python<'_>, bytes: Cow<'_, [u8]>, game: Option<GameArrays>) -> Result<Self, Error> {
        py.detach(|| {
            let mut answer = decoded::<1>(&bytes, game.as_ref());
            for next in [decoded::<2>, decoded::<3>, decoded::<4>] {
                if !answer.as_ref().is_err_and(|invalid| invalid.field == "meta.axes") {
                    break;
                }
                answer = next(&bytes, game.as_ref());
            }
            Ok(answer.map_err(|invalid| invalid.within("solution"))?)
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Result<(Bound<'py, PyAny>, Kept<'py>), Error> {
        let solved = &slf.get().solved;
        let bytes = PyBytes::new(slf.py(), &solved.npz()?);
        Ok((slf.get_type().getattr("_of")?, (bytes, solved.game())))
    }

    /// Whether the values and the nodes are the same and, if both have a game, the games as well.
    fn __eq__(&self, other: &Self) -> Result<bool, Error> {
        let same = self.grid == other.grid && self.solved.march() == other.solved.march();
        let games = self.solved.game().zip(other.solved.game());
        Ok(same
            && self.solved.npz()? == other.solved.npz()?
            && games.is_none_or(|(one, other)| one == other))
    }

    fn __hash__(&self) -> usize {
        self.grid.len()
    }

    fn __repr__(&self) -> String {
        let horizon_s = self.solved.times_s().last().copied().unwrap_or_default();
        format!(
            "Solution({}, direction={:?}, kind={:?}, horizon_s={horizon_s})",
            self.grid.__repr__(),
            self.direction(),
            self.kind()
        )
    }
}

impl Solution {
    fn asked(
        &self,
        states: &Bound<'_, PyAny>,
        instant: Instant,
        outside: &str,
        threads: Option<i64>,
    ) -> Result<Asked, Error> {
        let is_refused = named("outside", &[("raise", true, ""), ("nan", false, "")], outside)?;
        let Numbers { shape, values } = rows_of("states", self.grid.axes.len(), states)?;
        Ok(Asked { shape, states: values, instant, is_refused, threads: checked(threads)? })
    }
}

/// The bytes of a file, and the game.
type Kept<'py> = (Bound<'py, PyBytes>, Option<GameArrays>);

fn loaded<const D: usize>(bytes: &[u8]) -> Result<Solution, Invalid> {
    decoded::<D>(bytes, None)
}

fn decoded<const D: usize>(bytes: &[u8], game: Option<&GameArrays>) -> Result<Solution, Invalid> {
    let solution = cartesian::Solution::<f32, D>::from_npz(bytes)?;
    let grid = Grid { axes: solution.grid.axes.to_vec() };
    let of_arrays = |(u, d, rates): &GameArrays| {
        AffineArrays::of_rates(solution.grid, u.clone(), d.clone(), rates)
    };
    let game = game.map(of_arrays).transpose()?;
    Ok(Solution { grid, solved: Box::new(OnGrid { solution, game }) })
}

/// The word for an entry of a table.
fn word<T: PartialEq + Copy>(table: &[(&'static str, T, &str)], entry: T) -> &'static str {
    table.iter().find(|(_, other, _)| *other == entry).map_or("", |(word, ..)| word)
}

pub(crate) const KINDS: &[(&str, Kind, &str)] = &[("tube", Kind::Tube, ""), ("set", Kind::Set, "")];
pub(crate) const DIRECTIONS: &[(&str, Direction, &str)] =
    &[("backward", Direction::Backward, ""), ("forward", Direction::Forward, "")];
