//! Time-varying bounds on the human's turn rate (the paper, Definition 1 and
//! Algorithm 1).

mod action_space;
mod algorithm_1;

pub use action_space::ActionSpace;
pub use algorithm_1::{Algorithm1, PredictedBounds, input_bounds};

use crate::invalid::{Invalid, length, positive};
use crate::scene::{JointState, SceneParameters};
use core::fmt;
use serde::{Deserialize, Serialize};

/// Lowest and highest turn rate of each future step (rad/s).
#[derive(Debug, PartialEq)]
pub struct InputBounds {
    lo: Vec<f64>,
    hi: Vec<f64>,
}

impl Clone for InputBounds {
    fn clone(&self) -> Self {
        Self { lo: self.lo.clone(), hi: self.hi.clone() }
    }

    /// Reuses the buffers of `self`.
    fn clone_from(&mut self, other: &Self) {
        self.lo.clone_from(&other.lo);
        self.hi.clone_from(&other.hi);
    }
}

impl InputBounds {
    /// Bounds of `lo.len()` ≥ 1 steps within [`turn_rate.0`, `turn_rate.1`] rad/s.
    ///
    /// # Errors
    /// [`Invalid`] if the lists are empty or differ in length, a bound is not finite or is outside
    /// `turn_rate`, `lo[i] > hi[i]`, or `turn_rate` is not a range.
    pub fn new(lo: Vec<f64>, hi: Vec<f64>, turn_rate: (f64, f64)) -> Result<Self, Invalid> {
        check_range("turn_rate", turn_rate)?;
        if lo.is_empty() {
            return Err(Invalid::new("lo", "at least one step", "none"));
        }
        length("hi", lo.len(), hi.len())?;
        for (i, (&low, &high)) in lo.iter().zip(&hi).enumerate() {
            for (name, bound) in [("lo", low), ("hi", high)] {
                if !(turn_rate.0..=turn_rate.1).contains(&bound) {
                    let range =
                        format!("a turn rate from {} to {} rad/s", turn_rate.0, turn_rate.1);
                    return Err(Invalid::new(format!("{name}[{i}]"), range, bound));
                }
            }
            if low > high {
                let expected = format!("at most hi[{i}] = {high}");
                return Err(Invalid::new(format!("lo[{i}]"), expected, low));
            }
        }
        Ok(Self { lo, hi })
    }

    /// Number of steps, ≥ 1.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.lo.len()
    }

    /// Lowest turn rate of each step (rad/s).
    #[must_use]
    pub fn lo(&self) -> &[f64] {
        &self.lo
    }

    /// Highest turn rate of each step (rad/s).
    #[must_use]
    pub fn hi(&self) -> &[f64] {
        &self.hi
    }
}

/// Checks that a range of turn rates has two finite ends, the lower one first.
fn check_range(field: &str, (low, high): (f64, f64)) -> Result<(), Invalid> {
    if low.is_finite() && high.is_finite() && low <= high {
        return Ok(());
    }
    let expected = "two finite numbers, the lower one first";
    Err(Invalid::new(field, expected, format!("[{low}, {high}]")))
}

/// The learned function G: the probability of each human action, given the joint states so far.
/// It must be deterministic.
pub trait ActionModel {
    /// The actions: turn rates, or bins of a range of turn rates (rad/s). There is at least one.
    fn actions(&self) -> ActionSpace<'_>;

    /// Writes the probability of each action or bin to `out`. `history` contains every joint state since
    /// the beginning of the trial, including predicted states. It ends with the state in which the
    /// action is taken and is never empty.
    fn probabilities(&self, history: &[JointState], out: &mut [f64]);
}

impl<M: ActionModel + ?Sized> ActionModel for &M {
    fn actions(&self) -> ActionSpace<'_> {
        (**self).actions()
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        (**self).probabilities(history, out);
    }
}

/// Speeds and turn rates of both vehicles in roll-outs. Turn rates are ranges (rad/s), which need
/// not be symmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The human's speed (m/s).
    pub human_speed_mps: f64,
    /// Lowest and highest turn rate of the human, u_min and u_max.
    pub human_turn_rate: (f64, f64),
    /// The robot's speed (m/s).
    pub robot_speed_mps: f64,
    /// Lowest and highest turn rate of the robot.
    pub robot_turn_rate: (f64, f64),
    /// Length of a step (s).
    pub step_s: f64,
}

impl Motion {
    /// Checks that speeds and the step are > 0, and that the lower end of each range comes first.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        positive("human_speed_mps", self.human_speed_mps)?;
        check_range("human_turn_rate", self.human_turn_rate)?;
        positive("robot_speed_mps", self.robot_speed_mps)?;
        check_range("robot_turn_rate", self.robot_turn_rate)?;
        positive("step_s", self.step_s)?;
        Ok(())
    }
}

impl From<&SceneParameters> for Motion {
    fn from(parameters: &SceneParameters) -> Self {
        Self {
            human_speed_mps: parameters.human.speed_mps,
            human_turn_rate: parameters.human.turn_range(),
            robot_speed_mps: parameters.robot.speed_mps,
            robot_turn_rate: parameters.robot.turn_range(),
            step_s: parameters.step_s,
        }
    }
}

/// The rule that selects the likely actions.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ActionChoice {
    /// The k most likely actions at each future step, and every action that ties with the k-th.
    TopK(Vec<usize>),
    /// The actions with P(a) ≥ min(τ, max P).
    Adaptive {
        /// The probability threshold τ, in (0, 1].
        tau: f64,
        /// Number of future steps.
        steps: usize,
    },
    /// The turn rates in the shortest interval that holds at least the probability q at each future step,
    /// in (0, 1]. Of several equally short ones, the most probable one, and of several equally probable ones,
    /// all. The other two rules are for [levels](ActionSpace::Levels); this one is also for a range of turn
    /// rates.
    Interval(Vec<f64>),
}

impl ActionChoice {
    /// The rule of a file, which has exactly one of `k`, `tau` and `q`. `k` and `q` have an entry for each of
    /// the `steps` future steps.
    ///
    /// # Errors
    /// [`Invalid`] that names the field if none or several are given, or a list has another length.
    pub fn of_file(
        steps: usize,
        k: Option<&[usize]>,
        tau: Option<f64>,
        q: Option<&[f64]>,
    ) -> Result<Self, Invalid> {
        match (k, tau, q) {
            (Some(_), Some(tau), _) => Err(Invalid::new("tau", "none beside k", tau)),
            (Some(_), None, Some(_)) => Err(Invalid::new("q", "none beside k", "both")),
            (None, Some(_), Some(_)) => Err(Invalid::new("q", "none beside tau", "both")),
            (None, None, None) => {
                Err(Invalid::new("k", "one of k, q and tau (with steps)", "none"))
            }
            (Some(k), None, None) => {
                length("k", steps, k.len())?;
                Ok(Self::TopK(k.to_vec()))
            }
            (None, Some(tau), None) => Ok(Self::Adaptive { tau, steps }),
            (None, None, Some(q)) => {
                length("q", steps, q.len())?;
                Ok(Self::Interval(q.to_vec()))
            }
        }
    }

    /// `k`, `tau` and `q` of a file: the one that [`Self::of_file`] reads as this rule.
    #[must_use]
    pub fn in_file(&self) -> (Option<Vec<usize>>, Option<f64>, Option<Vec<f64>>) {
        match self {
            Self::TopK(k) => (Some(k.clone()), None, None),
            Self::Adaptive { tau, .. } => (None, Some(*tau), None),
            Self::Interval(q) => (None, None, Some(q.clone())),
        }
    }

    /// Number of future steps, T.
    #[must_use]
    pub fn steps(&self) -> usize {
        match self {
            Self::TopK(k) => k.len(),
            Self::Adaptive { steps, .. } => *steps,
            Self::Interval(q) => q.len(),
        }
    }
}

/// Formats the rule as `k = 3 3 2 1 …`, `τ = 0.1` or `q = 0.9 0.8 …`.
impl fmt::Display for ActionChoice {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TopK(k) => {
                out.write_str("k =")?;
                k.iter().try_for_each(|k| write!(out, " {k}"))
            }
            Self::Adaptive { tau, .. } => write!(out, "τ = {tau}"),
            Self::Interval(q) => {
                out.write_str("q =")?;
                q.iter().try_for_each(|q| write!(out, " {q}"))
            }
        }
    }
}

/// The bounds that the human follows in the low and the high roll-out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Rollout {
    /// The bounds of F_1, widened by ε_1, as printed in the paper.
    Paper,
    /// The bounds before widening. Regions are then guaranteed to grow with ε_1.
    Base,
}

impl Rollout {
    /// The name of this choice in files and results.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Base => "base",
        }
    }
}

/// The settings of Algorithm 1.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundsSettings {
    epsilon: Vec<f64>,
    choice: ActionChoice,
    rollout: Rollout,
    actions: usize,
}

/// The turn rate of the paper's human (rad/s), for which the paper's ε are chosen.
const PAPERS_TURN_RATE_RADPS: f64 = 0.5;

/// Scales the paper's widenings ε (rad/s) to a human with this turn rate. The last widening is
/// twice the turn rate and admits every turn.
#[must_use]
pub fn in_proportion(epsilon: &[f64], turn_rate_radps: f64) -> Vec<f64> {
    epsilon.iter().map(|epsilon| epsilon * (turn_rate_radps / PAPERS_TURN_RATE_RADPS)).collect()
}

impl BoundsSettings {
    /// Settings for `epsilon.len()` sets over the steps of `choice`, for a model with `actions`
    /// actions. `epsilon` must be ≥ 0 and ascending (rad/s).
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn new(
        epsilon: Vec<f64>,
        choice: ActionChoice,
        rollout: Rollout,
        actions: usize,
    ) -> Result<Self, Invalid> {
        if actions == 0 {
            return Err(Invalid::new("actions", "at least one action", "none"));
        }
        if epsilon.is_empty() {
            return Err(Invalid::new("epsilon", "at least one set", "none"));
        }
        for (j, &e) in epsilon.iter().enumerate() {
            let least = if j == 0 { 0.0 } else { epsilon[j - 1] };
            if !e.is_finite() || e < least {
                let expected = format!("{least} rad/s or more: the sets are nested");
                return Err(Invalid::new(format!("epsilon[{j}]"), expected, e));
            }
        }
        match &choice {
            ActionChoice::TopK(k) => {
                if k.is_empty() {
                    return Err(Invalid::new("k", "at least one step", "none"));
                }
                if let Some(i) = k.iter().position(|k| !(1..=actions).contains(k)) {
                    let expected = format!("a whole number from 1 to {actions}");
                    return Err(Invalid::new(format!("k[{i}]"), expected, k[i]));
                }
            }
            ActionChoice::Adaptive { tau, steps } => {
                if !(*tau > 0.0 && *tau <= 1.0) {
                    return Err(Invalid::new("tau", "a number in (0, 1]", tau));
                }
                if *steps == 0 {
                    return Err(Invalid::new("steps", "at least 1", steps));
                }
            }
            ActionChoice::Interval(q) => {
                if q.is_empty() {
                    return Err(Invalid::new("q", "at least one step", "none"));
                }
                if let Some(i) = q.iter().position(|q| !(*q > 0.0 && *q <= 1.0)) {
                    return Err(Invalid::new(format!("q[{i}]"), "a number in (0, 1]", q[i]));
                }
            }
        }
        Ok(Self { epsilon, choice, rollout, actions })
    }

    /// The number of future steps, T.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.choice.steps()
    }

    /// The widening of each set (rad/s).
    #[must_use]
    pub fn epsilon(&self) -> &[f64] {
        &self.epsilon
    }

    /// The rule that selects the likely actions.
    #[must_use]
    pub fn choice(&self) -> &ActionChoice {
        &self.choice
    }

    /// The bounds that the human follows in the roll-outs.
    #[must_use]
    pub fn rollout(&self) -> Rollout {
        self.rollout
    }

    /// The number of actions that the model must have, M.
    #[must_use]
    pub fn actions(&self) -> usize {
        self.actions
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complaints_name_the_field() {
        let field = |epsilon: &[f64], choice| {
            BoundsSettings::new(epsilon.to_vec(), choice, Rollout::Base, 3).unwrap_err().field
        };
        assert_eq!(field(&[], ActionChoice::TopK(vec![1])), "epsilon");
        assert_eq!(field(&[0.2, 0.1], ActionChoice::TopK(vec![1])), "epsilon[1]");
        assert_eq!(field(&[-0.1], ActionChoice::TopK(vec![1])), "epsilon[0]");
        assert_eq!(field(&[f64::NAN], ActionChoice::TopK(vec![1])), "epsilon[0]");
        assert_eq!(field(&[0.0, f64::INFINITY], ActionChoice::TopK(vec![1])), "epsilon[1]");
        assert_eq!(field(&[0.0], ActionChoice::TopK(vec![1, 4])), "k[1]");
        assert_eq!(field(&[0.0], ActionChoice::TopK(vec![0])), "k[0]");
        assert_eq!(field(&[0.0], ActionChoice::TopK(vec![])), "k");
        let tau = |tau| field(&[0.0], ActionChoice::Adaptive { tau, steps: 3 });
        assert!([0.0, 1.5, -1.0, f64::NAN].into_iter().all(|t| tau(t) == "tau"));
        assert_eq!(field(&[0.0], ActionChoice::Adaptive { tau: 0.5, steps: 0 }), "steps");
        assert_eq!(field(&[0.0], ActionChoice::Interval(vec![])), "q");
        assert_eq!(field(&[0.0], ActionChoice::Interval(vec![0.9, 1.1])), "q[1]");
        assert_eq!(field(&[0.0], ActionChoice::Interval(vec![f64::NAN])), "q[0]");
        let given = |k: Option<&[usize]>, tau, q: Option<&[f64]>| {
            ActionChoice::of_file(2, k, tau, q).map_err(|invalid| invalid.field)
        };
        assert_eq!(
            given(None, None, Some(&[0.9, 0.8])),
            Ok(ActionChoice::Interval(vec![0.9, 0.8]))
        );
        assert_eq!(given(Some(&[1, 1]), None, Some(&[0.9, 0.8])), Err("q".to_owned()));
        assert_eq!(given(None, Some(0.1), Some(&[0.9, 0.8])), Err("q".to_owned()));
        assert_eq!(given(Some(&[1, 1]), Some(0.1), None), Err("tau".to_owned()));
        assert_eq!(given(None, None, Some(&[0.9])), Err("q".to_owned()));
        assert_eq!(given(None, None, None), Err("k".to_owned()));
        let none = BoundsSettings::new(vec![0.0], ActionChoice::TopK(vec![1]), Rollout::Base, 0);
        assert_eq!(none.unwrap_err().field, "actions");
    }

    #[test]
    fn bounds_are_within_the_turn_rate_and_the_right_way_round() {
        let field = |lo: &[f64], hi: &[f64], turn_rate| {
            InputBounds::new(lo.to_vec(), hi.to_vec(), turn_rate).unwrap_err().field
        };
        let turn = (-0.5, 0.5);
        assert_eq!(field(&[], &[], turn), "lo");
        assert_eq!(field(&[0.0, 0.1], &[0.1], turn), "hi");
        assert_eq!(field(&[0.2], &[0.1], turn), "lo[0]");
        assert_eq!(field(&[0.0], &[f64::NAN], turn), "hi[0]");
        assert_eq!(field(&[-0.6], &[0.1], turn), "lo[0]");
        assert_eq!(field(&[0.0, 0.0], &[0.1, 0.4], (-0.5, 0.3)), "hi[1]");
        assert_eq!(field(&[0.0], &[0.1], (0.5, -0.5)), "turn_rate");
        assert_eq!(field(&[0.0], &[0.1], (f64::NAN, 0.5)), "turn_rate");
        assert!(InputBounds::new(vec![0.1], vec![0.1], (0.1, 0.7)).is_ok());
    }
}
