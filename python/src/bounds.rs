//! Algorithm 1: bounds on the human's turn rate.

use pyo3::prelude::*;
use sidestep::bounds::{ActionChoice, BoundsSettings, InputBounds, Rollout, input_bounds};
use sidestep::invalid::Invalid;
use sidestep::shfrs::file::MOST_STEPS;

use crate::arrays::{Array, count, joint_states, list, shaped};
use crate::error::Error;
use crate::function::SafetyLevels;
use crate::human::{Human, Model};
use crate::scalars::{some_real, some_whole, some_wholes};
use crate::vehicles::SceneParameters;

/// Bounds on the human's turn rate for each future step and each set, by Algorithm 1.
///
/// Parameters
/// ----------
/// history : array of float64, shape (n, 2, 3), n ≥ 1
///     Joint states from the start of the trial to now, one per step: the poses (x, y, ψ) of the human and of
///     the robot in the world frame (m, m, rad).
/// model : Predictor or ActionModel
///     Model of the probabilities of the human's actions.
/// epsilon : array of float64, shape (m,)
///     By how much each set widens the bounds (rad/s); ≥ 0 and ascending.
/// k : list of int, optional
///     How many of the most probable actions count at each future step. Actions that tie with the last of
///     these also count.
/// tau, steps : float and int, optional
///     Instead of `k`: a probability threshold in (0, 1], and the number of future steps. An action counts if
///     its probability is at least min(tau, the largest probability).
/// q : array of float64, shape (T,), optional
///     Instead of `k`: at each future step, the turn rates in the shortest interval with at least this
///     probability count, in (0, 1]. Only `q` is possible for an `ActionModel` with `bins`.
/// rollout : {"base", "paper"}
///     Which bounds the simulations within Algorithm 1 follow: the bounds before widening by ε ("base"), or
///     the bounds of F_1 ("paper").
/// parameters : SceneParameters, optional
///     By default the paper's.
/// safety : SafetyLevels, optional
///     Required if the vehicles differ and a feature of the model is a safety level.
///
/// Returns
/// -------
/// lo, hi : array of float64, shape (m, T)
///     Lowest and highest turn rate (rad/s, left positive).
#[pyfunction]
#[pyo3(signature = (history, model, epsilon, k=None, *, tau=None, steps=None, q=None, rollout="base", parameters=None, safety=None))]
#[allow(clippy::too_many_arguments, reason = "most are optional, and Python names them")]
pub(crate) fn bounds<'py>(
    history: &Bound<'py, PyAny>,
    model: Model<'py>,
    epsilon: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = some_wholes)] k: Option<Vec<i64>>,
    #[pyo3(from_py_with = some_real)] tau: Option<f64>,
    #[pyo3(from_py_with = some_whole)] steps: Option<i64>,
    q: Option<&Bound<'py, PyAny>>,
    rollout: &str,
    parameters: Option<SceneParameters>,
    safety: Option<SafetyLevels>,
) -> Result<(Array<'py>, Array<'py>), Error> {
    let py = history.py();
    let history = joint_states("history", 1, history)?;
    let epsilon = list("epsilon", epsilon)?;
    let parameters = parameters.unwrap_or_default().0;
    let human = Human::new(model, &parameters, safety)?;
    let choice = choice(k, tau, q, steps)?;
    let settings = BoundsSettings::new(epsilon, choice, rolled_out(rollout)?, human.actions())?;
    let found = human
        .work(py, |learned| input_bounds(&history, &parameters, learned, |_| 0.0, &settings))?;
    stacked(py, found.sets.iter())
}

/// Stacks the bounds of m sets of T steps into two arrays of shape (m, T).
pub(crate) fn stacked<'py, 'a>(
    py: Python<'py>,
    sets: impl Iterator<Item = &'a InputBounds> + Clone,
) -> Result<(Array<'py>, Array<'py>), Error> {
    let shape = [sets.clone().count(), sets.clone().next().map_or(0, InputBounds::steps)];
    let lo = sets.clone().flat_map(InputBounds::lo).copied().collect();
    let hi = sets.flat_map(InputBounds::hi).copied().collect();
    Ok((shaped(py, lo, &shape)?, shaped(py, hi, &shape)?))
}

/// The rule that selects actions: `k`, `q`, or `tau` together with a number of `steps`.
pub(crate) fn choice(
    k: Option<Vec<i64>>,
    tau: Option<f64>,
    q: Option<&Bound<'_, PyAny>>,
    steps: Option<i64>,
) -> Result<ActionChoice, Error> {
    let steps = steps.map(|steps| count("steps", 1, steps)).transpose()?;
    let each = |(i, k)| count(&format!("k[{i}]"), 1, k);
    let k = k.map(|k| k.into_iter().enumerate().map(each).collect::<Result<Vec<_>, _>>());
    let (k, q) = (k.transpose()?, q.map(|q| list("q", q)).transpose()?);
    let listed = [k.as_ref().map(|k| ("k", k.len())), q.as_ref().map(|q| ("q", q.len()))];
    let found = listed.into_iter().flatten().next();
    if let (Some((name, length)), Some(steps)) = (found, steps)
        && steps != length
    {
        let expected = format!("{length} as {name} has, or None");
        return Err(Invalid::new("steps", expected, steps).into());
    }
    let Some(steps) = found.map(|(_, length)| length).or(steps).or(tau.is_none().then_some(1))
    else {
        return Err(Invalid::new("steps", "the number of coming steps, with tau", "None").into());
    };
    let choice = ActionChoice::of_file(steps, k.as_deref(), tau, q.as_deref())?;
    few_steps("steps", choice.steps())?;
    Ok(choice)
}

/// Rejects more than [`MOST_STEPS`] steps.
pub(crate) fn few_steps(field: &str, steps: usize) -> Result<(), Error> {
    if steps <= MOST_STEPS {
        return Ok(());
    }
    Err(Invalid::new(field, format!("at most {MOST_STEPS} steps"), steps).into())
}

/// Parses the argument `rollout`.
pub(crate) fn rolled_out(word: &str) -> Result<Rollout, Error> {
    let known = [Rollout::Base, Rollout::Paper];
    let found = known.into_iter().find(|rollout| rollout.word() == word);
    found.ok_or_else(|| Invalid::new("rollout", "base or paper", word).into())
}
