//! The value function of a game at many states.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use sidestep::invalid::Invalid;
use sidestep::reachability::{ValueFunction, ValueState, default_threads};
use sidestep::vehicle::dubins;

use crate::arrays::{Array, count, rows, shaped, wrong_shape};
use crate::error::Error;
use crate::interrupt::Watch;
use crate::scalars::some_whole;
use crate::vehicles::PursuitGame;

/// V, its gradient, the optimal turn rates of both players, and whether the state is inside the solved grid.
pub(crate) type States<'py> = (Array<'py>, Array<'py>, Array<'py>, Bound<'py, PyArrayDyn<bool>>);

/// V at many states, by the closed form for a game of two identical vehicles.
///
/// Parameters
/// ----------
/// states : array of float64, shape (…, 3)
///     The pursuer's poses (x, y, ψ) in the evader's frame (m, m, rad): x ahead, y to the left. ψ may be any
///     real number.
/// game : PursuitGame
///     A game with identical vehicles. Other games need `solve`.
/// threads : int, optional
///     Maximum number of threads; by default the number of processors.
///
/// Returns
/// -------
/// array of float64, shape (…,)
///     V (m): the minimum distance under optimal play, less the radius. If V ≤ 0, the pursuer can force a
///     collision.
///
/// Raises
/// ------
/// ValueError
///     If the vehicles differ, or if `states` has another shape or dtype or contains a number that is not
///     finite.
#[pyfunction]
#[pyo3(signature = (states, game, *, threads=None))]
pub(crate) fn value<'py>(
    states: &Bound<'py, PyAny>,
    game: &PursuitGame,
    #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
) -> Result<Array<'py>, Error> {
    value_of(states, &closed_form(game)?, threads)
}

/// V, its gradient and the optimal turns at many states, by the closed form for a game of two identical
/// vehicles.
///
/// Parameters
/// ----------
/// states : array of float64, shape (…, 3)
///     As for `value`.
/// game : PursuitGame
///     A game with identical vehicles. Other games need `solve`.
/// threads : int, optional
///     Maximum number of threads; by default the number of processors.
///
/// Returns
/// -------
/// value : array of float64, shape (…,)
///     V (m).
/// gradient : array of float64, shape (…, 3)
///     (∂V/∂x, ∂V/∂y, ∂V/∂ψ) in m/m, m/m and m/rad; one-sided where V has a kink.
/// turns : array of float64, shape (…, 2)
///     Optimal turn rates of the evader and of the pursuer (rad/s, left positive). Where V does not depend on
///     a turn rate, it is 0 or either extreme of the vehicle.
/// inside : array of bool, shape (…,)
///     Whether the state is inside the solved grid. Always true for the closed form.
///
/// Raises
/// ------
/// ValueError
///     As for `value`.
#[pyfunction]
#[pyo3(signature = (states, game, *, threads=None))]
pub(crate) fn state<'py>(
    states: &Bound<'py, PyAny>,
    game: &PursuitGame,
    #[pyo3(from_py_with = some_whole)] threads: Option<i64>,
) -> Result<States<'py>, Error> {
    state_of(states, &closed_form(game)?, threads)
}

/// The pursuer's poses in the evader's frame, which are the states of a game.
///
/// Parameters
/// ----------
/// evader, pursuer : array of float64, shape (…, 3), of the same shape
///     Poses (x, y, ψ) in the world frame (m, m, rad).
///
/// Returns
/// -------
/// array of float64, shape (…, 3)
///     x ahead and y to the left (m), and ψ in (−π, π] (rad).
#[pyfunction]
#[pyo3(signature = (evader, pursuer))]
pub(crate) fn relative_state<'py>(
    evader: &Bound<'py, PyAny>,
    pursuer: &Bound<'py, PyAny>,
) -> Result<Array<'py>, Error> {
    let py = evader.py();
    let (evader, pursuer) = (rows::<3>("evader", evader)?, rows::<3>("pursuer", pursuer)?);
    let shape = [&evader.shape[..], &[3]].concat();
    if pursuer.shape != evader.shape {
        let expected = format!("{shape:?} as evader");
        return Err(wrong_shape("pursuer", &expected, &[&pursuer.shape[..], &[3]].concat()));
    }
    let pairs = evader.rows().iter().zip(pursuer.rows());
    let seen: Vec<f64> = pairs
        .flat_map(|(&evader, &pursuer)| dubins::relative_state(evader.into(), pursuer.into()))
        .collect();
    if let Some(place) = seen.iter().position(|number| !number.is_finite()) {
        let expected = "a pose less than 10³⁰⁸ m from the evader's";
        let found = format!("{:?}", pursuer.rows()[place / 3]);
        return Err(Invalid::new(format!("pursuer[{}]", place / 3), expected, found).into());
    }
    Ok(shaped(py, seen, &shape)?)
}

fn closed_form(game: &PursuitGame) -> Result<ValueFunction, Error> {
    if !game.0.identical() {
        let expected = "an evader and a pursuer with the same speed and turn rate, or `solve(game)` for others";
        return Err(Invalid::new("game", expected, game.__repr__()).into());
    }
    Ok(ValueFunction::Exact(game.0.exact()?))
}

/// V of `function` at states of shape (…, 3).
pub(crate) fn value_of<'py>(
    states: &Bound<'py, PyAny>,
    function: &ValueFunction,
    threads: Option<i64>,
) -> Result<Array<'py>, Error> {
    let py = states.py();
    let states = rows("states", states)?;
    let threads = checked(threads)?;
    let values = in_parts(py, states.rows(), threads, 0.0, |_, states, values| match function {
        ValueFunction::Exact(exact) => exact.values_into(states, values),
        ValueFunction::Sampled(sampled) => {
            for (value, &state) in values.iter_mut().zip(states) {
                *value = sampled.state(state).value;
            }
            Ok(())
        }
    })?;
    Ok(shaped(py, values, &states.shape)?)
}

/// V, gradient, optimal turns and `inside` of `function` at states of shape (…, 3).
pub(crate) fn state_of<'py>(
    states: &Bound<'py, PyAny>,
    function: &ValueFunction,
    threads: Option<i64>,
) -> Result<States<'py>, Error> {
    let py = states.py();
    let states = rows("states", states)?;
    let threads = checked(threads)?;
    let found = in_parts(py, states.rows(), threads, None, |_, states, found| {
        for (found, &state) in found.iter_mut().zip(states) {
            *found = Some(function.state(state));
        }
        Ok(())
    })?;
    let found: Vec<ValueState> = found.into_iter().flatten().collect();
    let column = |of: &dyn Fn(&ValueState) -> f64| found.iter().map(of).collect();
    let wide = |width: usize| [&states.shape[..], &[width]].concat();
    let gradient = found.iter().flat_map(|state| state.gradient).collect();
    let turns = found.iter().flat_map(|state| [state.evader_turn, state.pursuer_turn]).collect();
    let inside: Vec<bool> = found.iter().map(|state| state.inside).collect();
    Ok((
        shaped(py, column(&|state| state.value), &states.shape)?,
        shaped(py, gradient, &wide(3))?,
        shaped(py, turns, &wide(2))?,
        shaped(py, inside, &states.shape)?,
    ))
}

/// Validates the number of threads.
pub(crate) fn checked(threads: Option<i64>) -> Result<usize, Error> {
    threads.map_or_else(|| Ok(default_threads()), |threads| count("threads", 1, threads))
}

/// Minimum number of states per thread. Computing fewer states takes less time than starting a thread.
const STATES_OF_A_THREAD: usize = 4096;

/// Number of states in a part. A thread computes one part after the other.
const STATES_AT_ONCE: usize = 1024;

/// Computes one result for each state. Every result is `unseen` at first. `work` gets the index of the first
/// state of a part, the states of the part, and their results to fill in. It runs on at most `threads`
/// threads while the interpreter is released. Ctrl-C cancels the computation.
pub(crate) fn in_parts<S: Sync, T: Send + Clone>(
    py: Python<'_>,
    states: &[S],
    threads: usize,
    unseen: T,
    work: impl Fn(usize, &[S], &mut [T]) -> Result<(), Invalid> + Sync,
) -> Result<Vec<T>, Error> {
    let threads = threads.min(states.len() / STATES_OF_A_THREAD + 1).min(default_threads());
    let mut watch = Watch::new();
    let found = py.detach(|| {
        let mut found = vec![unseen; states.len()];
        let parts = states.chunks(STATES_AT_ONCE).zip(found.chunks_mut(STATES_AT_ONCE));
        let parts = Mutex::new(parts.enumerate());
        let (ended, first) = (AtomicBool::new(false), Mutex::new(None));
        let one = || {
            let next = parts.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((i, (states, found))) = next.filter(|_| !ended.load(Ordering::Relaxed)) else {
                return ControlFlow::Break(());
            };
            if let Err(invalid) = work(i * STATES_AT_ONCE, states, found) {
                ended.store(true, Ordering::Relaxed);
                // Threads take the parts in order, so nearly every earlier part is complete or in progress,
                // and its error, if any, is usually found. Keep the error of the earliest part.
                let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
                if first.as_ref().is_none_or(|(other, _)| i < *other) {
                    *first = Some((i, invalid));
                }
            }
            ControlFlow::Continue(())
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(|| while one().is_continue() {});
            }
            while one().is_continue() {
                if watch.look().is_break() {
                    ended.store(true, Ordering::Relaxed);
                }
            }
        });
        match first.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some((_, invalid)) => Err(invalid),
            None => Ok(found),
        }
    });
    watch.end()?;
    Ok(found?)
}
