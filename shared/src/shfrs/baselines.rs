//! Baselines: families of predicted sets to compare with SHFRS.
//!
//! Four families are reachable sets under simple bounds that are widened by the level
//! ([`worst_case`], [`constant_velocity`], [`hold_the_input`] and [`learned_disturbance`]; all use
//! `WidenedInputs`). Two families, [`Gaussian`] and [`PerModeEmpirical`], are learned from recorded
//! futures. Their largest set is the worst-case set, which is a reachable set; their smaller sets
//! are not. So every family has a level whose set contains every window.

mod swept;
mod simple_bounds;
mod empirical;
mod gaussian;
mod empirical_sets;

pub use empirical::{Mode, PerModeEmpirical};
pub use empirical_sets::{EmpiricalFamily, EmpiricalSet, EmpiricalSets, Fitted};
pub use gaussian::Gaussian;
pub use simple_bounds::{
    WORST_CASE, constant_velocity, hold_the_input, learned_disturbance, worst_case,
    worst_case_area_m2,
};

use super::family::Family;
use super::window::Window;
use crate::invalid::Invalid;
use crate::math::sin_cos;
use crate::vehicle::dubins::{arc, relative_state};
use crate::vehicle::{Pose, VehicleModel};

/// The assumed behaviour of the human.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Nominal {
    /// Drives straight on: constant velocity.
    Straight,
    /// Holds the turn rate of the last step, or drives straight if there is no last step.
    Held,
}

impl Nominal {
    /// The assumed turn rate (rad/s), clamped to the range of `human`.
    fn turn_rate(self, window: &Window<'_>, human: VehicleModel) -> f64 {
        match self {
            Self::Straight => 0.0,
            Self::Held => {
                let most = human.turn_rate_radps;
                window.past_turn_rates().last().map_or(0.0, |rate| rate.clamp(-most, most))
            }
        }
    }
}

/// A family learned from recorded futures. Its set after each step is convex.
trait LearnedFamily: Family {
    /// [`Family::score`].
    fn least_level(&self, window: &Window<'_>) -> Result<f64, Invalid>;

    /// For each step, the set of positions at `level`, as the vertices of a convex polygon in the
    /// frame of the human at the window's start (m). Returns `None` at the largest level, whose set
    /// is the worst-case set.
    fn step_sets(&self, window: &Window<'_>, level: f64) -> Option<Vec<Vec<[f64; 2]>>>;
}

/// The human's pose after each step of the window, relative to the current pose.
fn future_seen_from_now(window: &Window<'_>) -> impl Iterator<Item = Pose> {
    let now = window.now().human;
    window.future().iter().map(move |state| Pose::from(relative_state(now, state.human)))
}

/// The pose after each step at a constant turn rate, relative to the start.
fn nominal_poses(human: VehicleModel, turn_rate: f64, steps: usize, step_s: f64) -> Vec<Pose> {
    let origin = Pose::new(0.0, 0.0, 0.0);
    (1..=steps).map(|n| arc(origin, human.speed_mps, turn_rate, n as f64 * step_s)).collect()
}

/// Transforms a position (m) from the frame of `pose` to the frame in which `pose` is given.
fn place(pose: Pose, [x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = sin_cos(pose.psi);
    [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y]
}

/// Cache of areas at one level. Apart from the level, an area depends on one parameter, which is
/// the key. Many windows share its value.
#[derive(Clone, Debug, Default)]
struct Areas {
    level: Option<f64>,
    known: Vec<(u64, f64)>,
}

impl Areas {
    /// The area for `key` at `level`, computed on first use.
    fn get(&mut self, level: f64, key: u64, compute: impl FnOnce() -> f64) -> f64 {
        if self.level != Some(level) {
            self.level = Some(level);
            self.known.clear();
        }
        if let Some(&(_, area)) = self.known.iter().find(|(known, _)| *known == key) {
            return area;
        }
        let area = compute();
        self.known.push((key, area));
        area
    }
}
