//! Families of predicted sets that SHFRS is compared with.
//!
//! Most of them are the reachable set under bounds that are guessed without Algorithm 1 and
//! then widened ([`worst_case`], [`constant_velocity`], [`hold_the_input`],
//! [`learned_disturbance`]: one core, `WidenedInputs`). Two are learned from the positions
//! of recorded futures and know no vehicle model: [`Gaussian`] and [`PerModeEmpirical`].
//! Those end in the worst-case set, so that every family has a level that holds all.

mod swept;
mod widened;
mod empirical;
mod gaussian;

pub use empirical::{Mode, PerModeEmpirical};
pub use gaussian::Gaussian;
pub use widened::{constant_velocity, hold_the_input, learned_disturbance, worst_case};

use super::window::Window;
use crate::math::sin_cos;
use crate::vehicle::dubins::{arc, relative_state};
use crate::vehicle::{Pose, VehicleModel};

/// What the human is taken to do if nothing is predicted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nominal {
    /// Go straight on: constant velocity.
    Straight,
    /// Hold the turn rate of the last step before now; straight if there is none.
    Held,
}

impl Nominal {
    /// The turn rate, rad/s, within what `human` can do.
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

/// The human's poses after each step of the window, seen from the present one.
fn future_seen_from_now(window: &Window<'_>) -> impl Iterator<Item = Pose> {
    let now = window.now().human;
    window.future().iter().map(move |state| Pose::from(relative_state(now, state.human)))
}

/// The poses after each step at a constant turn rate, seen from the start.
fn nominal_poses(human: VehicleModel, turn_rate: f64, steps: usize, step_s: f64) -> Vec<Pose> {
    let origin = Pose::new(0.0, 0.0, 0.0);
    (1..=steps).map(|n| arc(origin, human.speed_mps, turn_rate, n as f64 * step_s)).collect()
}

/// From the frame of `pose` to the frame that `pose` is in, m.
fn place(pose: Pose, [x, y]: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = sin_cos(pose.psi);
    [pose.x + cos * x - sin * y, pose.y + sin * x + cos * y]
}

/// Areas of one level, by what else they depend on: neighbouring windows share them.
#[derive(Clone, Debug, Default)]
struct Areas {
    level: Option<f64>,
    known: Vec<(u64, f64)>,
}

impl Areas {
    /// The area that belongs to `key` at `level`, computed if it is new.
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
