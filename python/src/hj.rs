//! User-defined games on a grid, solved by the Hamilton–Jacobi equation.

use std::ffi::CString;
use std::ops::ControlFlow;

use pyo3::exceptions::{PyFutureWarning, PyUserWarning};
use pyo3::prelude::*;
use sidestep::invalid::Invalid;
use sidestep::reachability::cartesian::{
    self, Direction, Horizon, Kind, Problem, Region, Settings,
};
use sidestep::reachability::{self, AffineArrays, Axis, Progress, Scheme, SolveError};

use crate::arrays::{Numbers, numbers, wrong_shape};
use crate::error::Error;
use crate::function::{named, watched};
use crate::grid::Grid;
use crate::scalars::{self, some_real, some_whole};
use crate::solution::{DIRECTIONS, KINDS, OnGrid, Solution, Solved};
use crate::value::checked;

/// Solves for the states from which a target is reached in a user-defined game ẋ = f0(x) + Gu(x) u + Gd(x) d.
/// Ctrl-C cancels the solve.
///
/// The inputs u minimise V and steer towards the target {V ≤ 0}; the inputs d maximise V. If the control must
/// avoid the target, the control is d and the disturbance is u. V is computed in single precision, by the
/// local Lax–Friedrichs method.
///
/// Parameters
/// ----------
/// grid : Grid
///     A grid with D dimensions.
/// f0 : array of float64 or callable, shape (*nodes, D) or (D,)
///     The velocity without inputs, in the unit of each coordinate per second: one for each node, or one for
///     all nodes. A callable gets `grid.states`, of shape (*nodes, D), and returns such an array.
/// Gu, Gd : array of float64 or callable or None, shape (*nodes, D, m) or (D, m)
///     Effect of a player's m inputs on the velocity. Row i of a matrix belongs to coordinate i. `None` if
///     the player has no inputs.
/// u_box, d_box : array of float64 or None, shape (m, 2)
///     The lowest and the highest value of each input.
/// target : array of float64 or callable, shape (*nodes,)
///     l(x), which is ≤ 0 in the target. V starts as l. Ideally a signed distance, negative inside.
/// times : float or array of float64, shape (nt,)
///     Either the horizon (s), > 0; or the instants (s) at which V is stored, increasing from 0 to the
///     horizon in equal steps. They are times of the march: the time left or, with `direction="forward"`, the
///     time since the start.
/// avoid : array of float64 or callable or None, shape (*nodes,)
///     g(x), which is < 0 in the states to avoid, so that V ≥ -g. Ideally a signed distance, negative inside,
///     like the target. Warns if V becomes so flat that its sign can be wrong, for example if g is an
///     indicator function with a smaller magnitude than the depth of the target.
/// obstacle : array of float64 or callable or None, shape (*nodes,)
///     Deprecated: use `avoid`. `obstacle` has the opposite sign: **positive** inside, as in earlier
///     versions. Warns.
/// kind : {"tube", "set"}
///     Whether a state counts if it reaches the target at any time up to the horizon ("tube"), or only if it
///     does so exactly at the horizon ("set").
/// direction : {"backward", "forward"}
///     Whether to find the states that lead to the target ("backward"), or those that are reached from it
///     ("forward").
/// scheme : {"weno5", "eno3", "eno2", "upwind"}
///     The approximation of the spatial derivatives, and a matching Runge–Kutta method.
/// cfl : float, optional
///     CFL number: the time step as a share of the largest stable time step, in (0, 1]. The default preserves
///     the order of the scheme.
/// tolerance : float, optional
///     Stops as soon as V changes by at most this much per second everywhere. `times` must then be a number,
///     which is the maximum time.
/// threads : int, optional
///     Maximum number of threads; by default the number of processors.
/// progress : callable, optional
///     Called as `progress(done, residual)` about ten times a second, with the share of the steps that are
///     done (0 to 1) and the largest change of V per second (inf where it is not measured). If `progress`
///     raises an exception, the solve stops.
///
/// Returns
/// -------
/// Solution
///
/// Notes
/// -----
/// At every node, V of a tube is between the minimum of l over all nodes and max(l, -g).
///
/// V is unknown beyond the grid and is continued there as described in `Grid`. Where paths leave the grid, V
/// depends on this continuation. `Solution.depends_on_outside` marks all such nodes, and some others. If they
/// matter, use a larger grid.
///
/// Raises
/// ------
/// ValueError
///     If an obstacle covers the whole grid or the whole target, or if V is not finite (numbers too large for
///     single precision). If an array has another shape or dtype or contains a number that is not finite. If
///     a box has its ends in the wrong order, or the instants are not evenly spaced. If the grid needs too
///     much memory or is too small for the scheme.
#[pyfunction]
#[pyo3(signature = (grid, f0, Gu, Gd, u_box, d_box, target, times, *, avoid=None, obstacle=None, kind="tube", direction="backward", scheme="weno5", cfl=None, tolerance=None, threads=None, progress=None))]
#[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
#[allow(non_snake_case, reason = "the names of the field")]
pub(crate) fn hj_solve(
    py: Python<'_>,
    grid: &Bound<'_, Grid>,
    f0: &Bound<'_, PyAny>,
    Gu: Option<&Bound<'_, PyAny>>,
    Gd: Option<&Bound<'_, PyAny>>,
    u_box: Option<&Bound<'_, PyAny>>,
    d_box: Option<&Bound<'_, PyAny>>,
    target: &Bound<'_, PyAny>,
    times: &Bound<'_, PyAny>,
    avoid: Option<&Bound<'_, PyAny>>,
    obstacle: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = scalars::kind)] kind: &str,
    #[pyo3(from_py_with = scalars::direction)] direction: &str,
    #[pyo3(from_py_with = scalars::scheme)] scheme: &str,
    #[pyo3(from_py_with = some_real)] cfl: Option<f64>,
    #[pyo3(from_py_with = some_real)] tolerance: Option<f64>,
    #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> Result<Solution, Error> {
    let (horizon_s, slices) = instants(times)?;
    let scheme = named("scheme", SCHEMES, scheme)?;
    let settings = Settings::new(scheme).with_slices(slices).with_threads(checked(threads)?);
    let usual_cfl = settings.cfl;
    let task = Task {
        f0: Grid::at_nodes(grid, "f0", &[grid.get().axes.len()], f0)?,
        minimiser: inputs(grid, ["Gu", "u_box"], Gu, u_box)?,
        maximiser: inputs(grid, ["Gd", "d_box"], Gd, d_box)?,
        target: Grid::at_nodes(grid, "target", &[], target)?,
        avoid: avoided(grid, avoid, obstacle)?,
        kind: named("kind", KINDS, kind)?,
        direction: named("direction", DIRECTIONS, direction)?,
        horizon: horizon(horizon_s, slices, tolerance)?,
        settings: settings.with_cfl(cfl.unwrap_or(usual_cfl)),
    };
    let axes = &grid.get().axes;
    let solved = watched(py, progress.as_ref(), |report| {
        let solved = match axes[..] {
            [x] => task.solve([x], report),
            [x, y] => task.solve([x, y], report),
            [x, y, z] => task.solve([x, y, z], report),
            [x, y, z, w] => task.solve([x, y, z, w], report),
            _ => Err(Invalid::new("grid", "1 to 4 axes", axes.len()).into()),
        };
        solved.map_err(|error| match error {
            SolveError::Invalid(invalid) => SolveError::Invalid(of_arguments(invalid)),
            ended => ended,
        })
    })?;
    if let Some(shallow) = solved.shallow() {
        let said = CString::new(format!("avoid: {shallow}")).unwrap_or_default();
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &said, 1)?;
    }
    Ok(Solution { grid: grid.get().clone(), solved })
}

const SCHEMES: &[(&str, Scheme, &str)] = &[
    ("weno5", Scheme::Weno5, ""),
    ("eno3", Scheme::Eno3, ""),
    ("eno2", Scheme::Eno2, ""),
    ("upwind", Scheme::Upwind, ""),
];

/// Reads `times`: the horizon (s), and the number of instants to store before it.
fn instants(times: &Bound<'_, PyAny>) -> Result<(f64, usize), Error> {
    let Numbers { shape, values } = numbers("times", "() or (nt,)", times)?;
    let last = match (&shape[..], &values[..]) {
        ([], [horizon_s]) => return Ok((*horizon_s, 0)),
        ([_], [_, .., last]) => *last,
        ([_], _) => {
            let expected = "a number, or at least two instants from 0 on";
            return Err(Invalid::new("times", expected, format!("{} of them", values.len())).into());
        }
        _ => return Err(wrong_shape("times", "() or (nt,)", &shape)),
    };
    let slices = values.len() - 1;
    for (k, &time) in values.iter().enumerate() {
        let even = last * k as f64 / slices as f64;
        // This also rejects a last instant that is not > 0.
        if !(last > 0.0 && (time - even).abs() <= 1e-9 * last) {
            let expected = if last > 0.0 { even.to_string() } else { "a last one > 0".to_owned() };
            let found = if last > 0.0 { time } else { last };
            let expected = format!("{expected}: they rise from 0 in equal steps");
            return Err(Invalid::new(format!("times[{k}]"), expected, found).into());
        }
    }
    Ok((last, slices))
}

/// The condition that ends the march: its duration, or a tolerance and the maximum duration.
fn horizon(horizon_s: f64, slices: usize, tolerance: Option<f64>) -> Result<Horizon, Error> {
    match tolerance {
        None => Ok(Horizon::Finite(horizon_s)),
        Some(tolerance) if !(tolerance > 0.0 && tolerance.is_finite()) => {
            Err(Invalid::new("tolerance", "a finite number > 0", tolerance).into())
        }
        Some(_) if slices > 0 => {
            let expected = "one number together with tolerance: the longest time";
            Err(Invalid::new("times", expected, format!("{} instants", slices + 1)).into())
        }
        Some(tolerance) => Ok(Horizon::Converged { tolerance, longest_s: horizon_s }),
    }
}

/// A player's matrices at all nodes, and the range of each input.
type OfPlayer = (Vec<f64>, Vec<[f64; 2]>);

fn inputs(
    grid: &Bound<'_, Grid>,
    [matrix_name, box_name]: [&str; 2],
    matrix: Option<&Bound<'_, PyAny>>,
    ranges: Option<&Bound<'_, PyAny>>,
) -> Result<OfPlayer, Error> {
    let (matrix, ranges) = match (matrix, ranges) {
        (None, None) => return Ok((Vec::new(), Vec::new())),
        (Some(matrix), Some(ranges)) => (matrix, ranges),
        (None, Some(_)) => {
            let expected = format!("a matrix for each node, with {box_name}");
            return Err(Invalid::new(matrix_name, expected, "None").into());
        }
        (Some(_), None) => {
            let expected = format!("the range of each input, with {matrix_name}");
            return Err(Invalid::new(box_name, expected, "None").into());
        }
    };
    let Numbers { shape, values } = numbers(box_name, "(m, 2)", ranges)?;
    if shape.len() != 2 || shape[0] == 0 || shape[1] != 2 {
        return Err(wrong_shape(box_name, "(m, 2) with m ≥ 1", &shape));
    }
    let ranges = values.as_chunks::<2>().0.to_vec();
    let tail = [grid.get().axes.len(), ranges.len()];
    Ok((Grid::at_nodes(grid, matrix_name, &tail, matrix)?, ranges))
}

/// The function of the states to avoid, and whether it is negative inside.
fn avoided(
    grid: &Bound<'_, Grid>,
    avoid: Option<&Bound<'_, PyAny>>,
    obstacle: Option<&Bound<'_, PyAny>>,
) -> Result<Option<(Vec<f64>, bool)>, Error> {
    match (avoid, obstacle) {
        (None, None) => Ok(None),
        (Some(avoid), None) => Ok(Some((Grid::at_nodes(grid, "avoid", &[], avoid)?, true))),
        (None, Some(obstacle)) => {
            let kind = grid.py().get_type::<PyFutureWarning>();
            PyErr::warn(
                grid.py(),
                &kind,
                c"obstacle: it is taken as positive inside, unlike the target. \
                  Use avoid=-obstacle, which is negative inside, as the target is",
                1,
            )?;
            Ok(Some((Grid::at_nodes(grid, "obstacle", &[], obstacle)?, false)))
        }
        (Some(_), Some(_)) => {
            Err(Invalid::new("obstacle", "None together with avoid", "both of them").into())
        }
    }
}

/// Renames the fields of an error to the names of the Python arguments.
fn of_arguments(mut invalid: Invalid) -> Invalid {
    for (theirs, ours) in [
        ("drift", "f0"),
        ("minimiser.range", "u_box"),
        ("maximiser.range", "d_box"),
        ("minimiser", "Gu"),
        ("maximiser", "Gd"),
        ("horizon_s", "times"),
        ("grid.axes", "grid.axes"),
        ("axes", "grid.axes"),
    ] {
        if let Some(rest) = invalid.field.strip_prefix(theirs) {
            invalid.field = format!("{ours}{rest}");
            break;
        }
    }
    invalid
}

/// A problem to solve, on a grid of any dimension.
struct Task {
    f0: Vec<f64>,
    minimiser: OfPlayer,
    maximiser: OfPlayer,
    target: Vec<f64>,
    /// The function of the states to avoid, and whether it is negative inside.
    avoid: Option<(Vec<f64>, bool)>,
    kind: Kind,
    direction: Direction,
    horizon: Horizon,
    settings: Settings,
}

impl Task {
    fn solve<const D: usize>(
        &self,
        axes: [Axis; D],
        report: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Box<dyn Solved>, SolveError> {
        let grid = reachability::Grid { axes };
        let game = AffineArrays::new(grid, &self.f0)?
            .minimiser(&self.minimiser.0, &self.minimiser.1)?
            .maximiser(&self.maximiser.0, &self.maximiser.1)?;
        let target = |state| at(&grid, &self.target, state);
        let avoid =
            |state| self.avoid.as_ref().map_or(f64::NAN, |(avoid, _)| at(&grid, avoid, state));
        let problem = Problem::new(&game, grid, Region::Static(&target), self.horizon)
            .with_kind(self.kind)
            .with_direction(self.direction);
        let problem = match &self.avoid {
            None => problem,
            Some((_, true)) => problem.with_avoid(Region::Static(&avoid)),
            #[allow(deprecated, reason = "so is the argument")]
            Some((_, false)) => problem.with_obstacle(Region::Static(&avoid)),
        };
        let solution = cartesian::solve::<f32, D, _>(&problem, &self.settings, report)?;
        Ok(Box::new(OnGrid { solution, game: Some(game) }))
    }
}

/// The entry of `values` at the node nearest to `state`.
fn at<const D: usize>(grid: &reachability::Grid<D>, values: &[f64], state: [f64; D]) -> f64 {
    let node = grid.axes.iter().zip(state).fold(0, |position, (axis, coordinate)| {
        let node = ((coordinate - axis.low) / axis.spacing()).round() as usize;
        position * axis.nodes + node.min(axis.nodes - 1)
    });
    values.get(node).copied().unwrap_or(f64::NAN)
}
