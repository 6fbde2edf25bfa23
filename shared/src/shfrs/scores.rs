//! SHFRS as a nested family, and sorted scores.

use super::family::Family;
use super::widened::{least_widening, tube_area_m2, widened};
use super::window::{Trajectory, Window, WindowChoice};
use super::window_sets::{Prediction, same_steps};
use crate::bounds::{ActionChoice, ActionModel, BoundsSettings, Rollout};
use crate::invalid::Invalid;

/// Prefix of the names of the SHFRS families.
pub(super) const SHFRS: &str = "SHFRS";

/// The sets F(ε) for one choice of actions, with `base` roll-outs. The level is ε (rad/s). The
/// largest level is the full range of turn rates, and its set contains every trajectory.
pub struct ShfrsFamily<'a, M> {
    prediction: Prediction<'a, M>,
    base: BoundsSettings,
}

impl<'a, M: ActionModel> ShfrsFamily<'a, M> {
    /// The family of `choice`.
    ///
    /// # Errors
    /// The errors of [`BoundsSettings::new`].
    pub fn new(prediction: Prediction<'a, M>, choice: &ActionChoice) -> Result<Self, Invalid> {
        Ok(Self { prediction, base: prediction.settings(vec![0.0], choice, Rollout::Base)? })
    }

    /// The bounds (rad/s) of each step of a window, before widening.
    ///
    /// # Errors
    /// [`Invalid`] if the window does not have the family's number of steps, or Algorithm 1 fails.
    pub fn base_bounds(&self, window: &Window<'_>) -> Result<Vec<(f64, f64)>, Invalid> {
        same_steps(window, self.base.steps())?;
        Ok(self.prediction.bounds(window.history(), &self.base)?.raw)
    }
}

impl<M: ActionModel> Family for ShfrsFamily<'_, M> {
    fn name(&self) -> String {
        format!("{SHFRS}, {}", self.base.choice())
    }

    fn most(&self) -> f64 {
        self.prediction.full_range()
    }

    fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid> {
        let Prediction { parameters, tolerance, .. } = self.prediction;
        least_widening(&self.base_bounds(window)?, window, parameters, tolerance)
    }

    fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
        let bounds = widened(&self.base_bounds(window)?, level, self.prediction.turn_rate())?;
        tube_area_m2(&bounds, self.prediction.parameters)
    }
}

/// The scores of independent trajectories, one score per trajectory, ascending. Never empty.
#[derive(Clone, Debug, PartialEq)]
pub struct Scores(Vec<f64>);

impl Scores {
    /// Sorts `scores`, which can be in any order. All must be finite and ≥ 0.
    ///
    /// # Errors
    /// [`Invalid`] if the list is empty, or a score is negative or not finite.
    pub fn new(mut scores: Vec<f64>) -> Result<Self, Invalid> {
        if scores.is_empty() {
            return Err(Invalid::new("scores", "at least one", "none"));
        }
        if let Some(i) = scores.iter().position(|score| !(score.is_finite() && *score >= 0.0)) {
            let expected = "a finite number ≥ 0";
            return Err(Invalid::new(format!("scores[{i}]"), expected, scores[i]));
        }
        scores.sort_by(f64::total_cmp);
        Ok(Self(scores))
    }

    /// The scores of `trajectories` in `family`. Trajectories without a window are omitted.
    ///
    /// # Errors
    /// [`Invalid`] if `choice` takes several windows from a trajectory, no trajectory has a window, or
    /// the prediction fails.
    pub fn of(
        family: &mut impl Family,
        trajectories: &[Trajectory],
        choice: WindowChoice,
        steps: usize,
    ) -> Result<Self, Invalid> {
        single(choice)?;
        let windows = choice.windows(trajectories, steps);
        let scores = windows.iter().flatten().map(|window| family.score(window));
        Self::new(scores.collect::<Result<_, _>>()?)
    }

    /// The number of scores, n ≥ 1.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "there is always one")]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The scores, ascending.
    #[must_use]
    pub fn sorted(&self) -> &[f64] {
        &self.0
    }

    /// The `rank`-th smallest score, for a rank from 1 to n.
    ///
    /// # Panics
    /// If the rank is not in this range.
    #[must_use]
    pub fn ranked(&self, rank: usize) -> f64 {
        self.0[rank - 1]
    }
}

/// Checks that the choice takes at most one window per trajectory, so that windows are independent.
///
/// # Errors
/// [`Invalid`] for a choice with several windows per trajectory.
pub fn single(choice: WindowChoice) -> Result<(), Invalid> {
    if choice.is_single() {
        return Ok(());
    }
    let expected = "one window in each trajectory (random_one or avoidance_onset): windows of \
                    one trajectory are not independent";
    Err(Invalid::new("window_choice", expected, choice.word()))
}
