//! Converts a calibration into a bound on the probability of a collision.
//!
//! If a plan is clear of F_j, the human can touch the robot only if the human's trajectory leaves F_j.
//! Let c_j be a lower bound on the share of trajectories that stay inside F_j, and let F_J be the
//! largest set that the plan is clear of. The bound is U = 1 − c_J, or U = 1 if the plan is clear of no
//! set. J depends on the scene, but the bound is valid for every α, because the sets are nested: U ≤ α
//! holds only if the plan is clear of the smallest set with 1 − c_j ≤ α. Hence P(touch, and U ≤ α) ≤ α.
//!
//! # Between the recorded states
//! Calibration tests the recorded state after each step, within a tolerance. Every instant is at most
//! half a step (τ/2) away from a recorded state. Suppose that the human drives at the constant speed v
//! with turn rates in the vehicle's range. The distance to a trajectory of the set is then at most the
//! position tolerance, plus vτ/2 times the heading tolerance, plus v(τ/2)²/2 times the width of the
//! turn-rate range. A plan must keep this margin.

use super::interval::Clearances;
use crate::invalid::{Invalid, length};
use crate::reach::{Tolerance, nearly_zero};
use crate::scene::SceneParameters;
use crate::shfrs::scores::Scores;
use crate::shfrs::tuning::Tuned;
use crate::stats::{beta_quantile, open_probability};

/// For each set, an upper bound on the share of trajectories that leave the set, together with a
/// statement of the assumptions.
///
/// ```
/// use sidestep::clearance::CoverageBounds;
/// use sidestep::reach::Tolerance;
/// use sidestep::scene::SceneParameters;
/// use sidestep::shfrs::scores::Scores;
///
/// // Of 200 calibration trajectories, 180 need no widening, and 20 need a widening of 0.3 rad/s.
/// let scores = Scores::new([vec![0.0; 180], vec![0.3; 20]].concat())?;
/// let parameters = SceneParameters::default();
/// let (epsilon, delta, tolerance) = ([0.0, 0.4, 1.0], 0.05, Tolerance::default());
/// let bounds = CoverageBounds::of_scores(&scores, &epsilon, delta, &parameters, tolerance, 10)?;
/// let [first, second, all] = bounds.outside() else { unreachable!() };
/// assert!(0.1 < *first && *first < 0.16 && *second < 0.03 && *all == 0.0);
/// println!("{}", bounds.statement());
/// # Ok::<(), sidestep::invalid::Invalid>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CoverageBounds {
    /// One bound per set, from the smallest set to the largest. The bounds descend.
    outside: Vec<f64>,
    margin_m: f64,
    statement: String,
}

/// A bound on the probability of a collision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CollisionBound {
    /// Upper bound on the probability that the human enters the footprint at some instant of the
    /// plan: see [`CoverageBounds::statement`].
    pub at_most: f64,
    /// Index of the set whose coverage gives the bound; `None` if the plan is clear of no set.
    pub set: Option<usize>,
}

/// The assumptions of every bound.
const ASSUMED: &str = "This holds on average over windows drawn like those of the \
    calibration, of people who drive like its vehicle, at its speed and within its turn rates, and who \
    react to the robot's plan as they did to the robot there; for a plan that is chosen without knowing \
    the future. It is no guarantee for a single scene or person, and the probabilities of several plans \
    of a drive add up.";

impl CoverageBounds {
    /// The bounds that `tuned` guarantees for the prediction of
    /// [`OnlinePredictor::tuned`](super::OnlinePredictor::tuned) with the same `further` widenings
    /// (rad/s). The first set has the tuned choice of actions, roll-outs and ε, and the larger sets
    /// contain it. For a set that admits every turn rate, the bound is 0, because no trajectory leaves
    /// it. `parameters` must be the parameters of the tuning.
    ///
    /// # Errors
    /// [`Invalid`] if the further widenings do not ascend from the tuned ε.
    pub fn of_tuned(
        tuned: &Tuned,
        further: &[f64],
        parameters: &SceneParameters,
    ) -> Result<Self, Invalid> {
        rising("further", tuned.epsilon, further)?;
        let tolerance =
            Tolerance { position_m: tuned.tolerance_m, heading_rad: tuned.tolerance_rad };
        let margin_m = margin_m(parameters, tolerance, tuned.steps);
        let share = 1.0 - tuned.p;
        let statement = format!(
            "{} A plan that stays more than {margin_m:.3} m away from every position in the set is \
             touched by the human with probability at most {share:.4}. {ASSUMED}",
            tuned.statement
        );
        let full = everything(parameters);
        let outside = |&level: &f64| if level >= full { 0.0 } else { share };
        let outside = [&[tuned.epsilon], further].concat().iter().map(outside).collect();
        Ok(Self { outside, margin_m, statement })
    }

    /// The bounds that hold for all sets simultaneously with confidence 1 − `delta`. Each is a
    /// Clopper–Pearson bound, with δ divided by the number of sets that do not admit every turn rate.
    /// For a set that admits every turn rate, the bound is 0, because no trajectory leaves it. `scores`
    /// are the scores of calibration trajectories, computed with the prediction's choice of actions,
    /// `base` roll-outs and `tolerance`. `epsilon` are the sets' widenings (rad/s), ascending.
    ///
    /// # Errors
    /// [`Invalid`] if there is no set, the widenings are not ascending, or δ is not in (0, 1).
    pub fn of_scores(
        scores: &Scores,
        epsilon: &[f64],
        delta: f64,
        parameters: &SceneParameters,
        tolerance: Tolerance,
        steps: usize,
    ) -> Result<Self, Invalid> {
        open_probability("delta", delta)?;
        if epsilon.is_empty() {
            return Err(Invalid::new("epsilon", "at least one set", "none"));
        }
        rising("epsilon", 0.0, epsilon)?;
        let n = scores.len();
        let full = everything(parameters);
        let uncertain = epsilon.iter().filter(|&&level| level < full).count();
        let outside = |&level: &f64| {
            if level >= full {
                return 0.0;
            }
            let inside = scores.sorted().partition_point(|&score| score <= level);
            let tail = delta / uncertain as f64;
            match inside {
                0 => 1.0,
                _ => 1.0 - beta_quantile(tail, inside as f64, (n - inside + 1) as f64),
            }
        };
        let margin_m = margin_m(parameters, tolerance, steps);
        let statement = format!(
            "With confidence {} in the calibration with {n} trajectories: a plan that stays more than \
             {margin_m:.3} m away from every position in a set is touched by the human with at most the \
             probability given for the set. {ASSUMED}",
            1.0 - delta
        );
        Ok(Self { outside: epsilon.iter().map(outside).collect(), margin_m, statement })
    }

    /// For each set, the bound on the share of trajectories that leave it.
    #[must_use]
    pub fn outside(&self) -> &[f64] {
        &self.outside
    }

    /// The margin (m). A set's bound holds for a plan whose clearance from the set exceeds this margin.
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        self.margin_m
    }

    /// A text that states the meaning and the assumptions of the bounds, to print next to them.
    #[must_use]
    pub fn statement(&self) -> &str {
        &self.statement
    }

    /// The bound for a plan with these clearances from the calibrated sets. It holds for a human
    /// who drives like the vehicle of the parameters;
    /// [`OnlinePredictor::check_human`](super::OnlinePredictor::check_human) checks the last step.
    ///
    /// # Errors
    /// [`Invalid`] if the number of sets differs.
    pub fn collision(&self, clearances: &Clearances) -> Result<CollisionBound, Invalid> {
        length("clearances", self.outside.len(), clearances.sets())?;
        let set = clearances.largest_clear(self.margin_m);
        Ok(CollisionBound { at_most: set.map_or(1.0, |set| self.outside[set]), set })
    }
}

/// The widening (rad/s) that admits every turn rate.
fn everything(parameters: &SceneParameters) -> f64 {
    2.0 * parameters.human.turn_rate_radps
}

/// Checks that widenings (rad/s) ascend from `least`.
fn rising(field: &str, mut least: f64, epsilon: &[f64]) -> Result<(), Invalid> {
    for (j, &level) in epsilon.iter().enumerate() {
        if !level.is_finite() || level < least {
            let expected = format!("{least} rad/s or more: the sets are nested");
            return Err(Invalid::new(format!("{field}[{j}]"), expected, level));
        }
        least = level;
    }
    Ok(())
}

/// The largest possible distance (m) of a trajectory from a set, between recorded states that are
/// inside the set.
fn margin_m(parameters: &SceneParameters, tolerance: Tolerance, steps: usize) -> f64 {
    let (v, half_s) = (parameters.human.speed_mps, 0.5 * parameters.step_s);
    let range = 2.0 * parameters.human.turn_rate_radps;
    // The membership test treats bounds that almost admit straight driving as if they admitted it.
    let ahead_s = steps as f64 * parameters.step_s;
    let nearly = 0.5 * v * nearly_zero(ahead_s) * ahead_s * ahead_s;
    tolerance.position_m + v * half_s * (tolerance.heading_rad + 0.5 * range * half_s) + nearly
}
