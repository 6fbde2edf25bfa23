//! A person's perception of the robot, and the resulting input signal of the decision.

use super::person::Person;
use crate::math::{asin, atan2, exp, hypot, sin_cos, wrap_angle};
use crate::scene::{JointState, SceneParameters};

/// The geometry that a person sees, under the assumption that both vehicles drive straight on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sight {
    /// Distance between the vehicles (m).
    pub(super) distance_m: f64,
    /// Time to the closest approach (s); negative after it.
    pub(super) closest_s: f64,
    /// Distance at the closest approach (m), or the current distance if this approach is over.
    pub(super) predicted_m: f64,
    /// Rate of change of the robot's bearing in the world (rad/s).
    pub(super) bearing_rate_radps: f64,
    /// Speed of the robot relative to the human (m/s).
    pub(super) closing_mps: f64,
    /// Direction of the robot relative to the human's heading (rad), positive to the left.
    pub(super) bearing_rad: f64,
}

impl Sight {
    /// The view of a human whose heading is changed by `turned_rad`.
    pub(super) fn of(parameters: &SceneParameters, state: &JointState, turned_rad: f64) -> Self {
        let (human, robot) = (state.human, state.robot);
        let heading = human.psi + turned_rad;
        let (human_sin, human_cos) = sin_cos(heading);
        let (robot_sin, robot_cos) = sin_cos(robot.psi);
        let (v_human, v_robot) = (parameters.human.speed_mps, parameters.robot.speed_mps);
        let (rx, ry) = (robot.x - human.x, robot.y - human.y);
        let (wx, wy) =
            (v_robot * robot_cos - v_human * human_cos, v_robot * robot_sin - v_human * human_sin);
        let distance_m = hypot(rx, ry);
        let closing_mps = hypot(wx, wy);
        let cross = rx * wy - ry * wx;
        let ahead = closing_mps > 1e-6;
        let closest_s =
            if ahead { -(rx * wx + ry * wy) / (closing_mps * closing_mps) } else { 0.0 };
        Self {
            distance_m,
            closest_s,
            predicted_m: if closest_s > 0.0 { cross.abs() / closing_mps } else { distance_m },
            // At distance zero, the bearing is undefined, so any finite rate is acceptable.
            bearing_rate_radps: cross / (distance_m * distance_m).max(1e-12),
            closing_mps,
            bearing_rad: wrap_angle(atan2(ry, rx) - heading),
        }
    }
}

/// 1/(1 + e⁻ˣ).
pub(super) fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + exp(-x))
}

/// What the person concludes from the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Percept {
    /// Predicted smallest distance (m), including the error of the perceived headings.
    pub(super) predicted_m: f64,
    /// Input signal of the decision, in [0, 1]: the urge to turn.
    pub(super) drive: f64,
}

impl Percept {
    /// `noise` holds two standard normal numbers, for the errors of perceived times and headings.
    pub(super) fn of(person: &Person, radius_m: f64, sight: &Sight, noise: [f64; 2]) -> Self {
        let stretch = exp(person.time_noise * noise[0]);
        let heading_error = person.heading_noise_rad * noise[1];
        let time_s = sight.closest_s.max(0.05) * stretch;
        let sideways_m = heading_error * sight.closing_mps * sight.closest_s.max(0.0);
        let predicted_m = (sight.predicted_m + sideways_m).abs();
        let soon = logistic((person.horizon_s - time_s) / (0.15 * person.horizon_s));
        let approaching = if sight.closest_s > 0.0 { soon } else { 0.0 };

        let lacking_m = radius_m + person.margin_m - predicted_m;
        let distance = approaching * logistic(lacking_m / 0.35);

        let threshold = person.bearing_threshold / (time_s * time_s.sqrt());
        let rate = (sight.bearing_rate_radps + 0.5 * heading_error).abs();
        let bearing = approaching * logistic((threshold - rate) / (0.15 * threshold + 0.01));

        let disc_rad = asin((radius_m / sight.distance_m).min(1.0));
        let off_rad = (sight.bearing_rad.abs() - disc_rad).max(0.0);
        let gap_m = (sight.distance_m - radius_m).max(0.0);
        let repeller = person.repeller_gain
            * exp(-person.repeller_angle_decay * off_rad)
            * exp(-person.repeller_distance_decay * gap_m * stretch);

        let [first, second, third] = person.weights;
        let drive = first * distance + second * bearing + third * repeller.min(1.0);
        Self { predicted_m, drive }
    }
}
