//! Encounters: the course of a scene if neither vehicle turns.

use super::assigned::Scene;
use super::parameters::SceneParameters;
use crate::invalid::Invalid;
use crate::math::{hypot, sin_cos, wrap_angle};
use crate::vehicle::Pose;

/// The coordinates of an encounter, over which scenes are evenly spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encounter {
    /// Human's heading minus the robot's heading (rad), in (−π, π].
    pub approach_rad: f64,
    /// Signed distance of closest approach if neither vehicle turns (m).
    pub miss_m: f64,
    /// Time at which the distance falls to R_c if neither vehicle turns (s).
    pub entry_s: f64,
}

/// The scene of an encounter, centred on the origin and rotated by `turn_rad`.
pub(super) fn place(parameters: &SceneParameters, encounter: Encounter, turn_rad: f64) -> Scene {
    let robot_heading = turn_rad;
    let human_heading = wrap_angle(turn_rad + encounter.approach_rad);
    let (rs, rc) = sin_cos(robot_heading);
    let (hs, hc) = sin_cos(human_heading);
    // The robot's velocity relative to the human's velocity.
    let wx = parameters.robot.speed_mps * rc - parameters.human.speed_mps * hc;
    let wy = parameters.robot.speed_mps * rs - parameters.human.speed_mps * hs;
    let w = hypot(wx, wy);
    let radius = parameters.danger_radius_m;
    let half_chord = (radius * radius - encounter.miss_m * encounter.miss_m).max(0.0).sqrt();
    let closest_s = encounter.entry_s + half_chord / w;
    // The robot's start relative to the human's start: the miss vector, moved back along w.
    let dx = -encounter.miss_m * wy / w - wx * closest_s;
    let dy = encounter.miss_m * wx / w - wy * closest_s;
    // Centres the box around both straight paths, so that the canvas shows the complete paths.
    let ahead_h = parameters.human.speed_mps * parameters.duration_s();
    let ahead_r = parameters.goal_distance_m();
    let centre = |a: [f64; 4]| {
        let low = a.iter().copied().fold(f64::INFINITY, f64::min);
        let high = a.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        0.5 * (low + high)
    };
    let cx = centre([0.0, ahead_h * hc, dx, dx + ahead_r * rc]);
    let cy = centre([0.0, ahead_h * hs, dy, dy + ahead_r * rs]);
    let human = Pose::new(-cx, -cy, human_heading);
    Scene::new(parameters, human, Pose::new(dx - cx, dy - cy, robot_heading))
}

/// The error if none of `draws` draws is admissible.
pub(super) fn no_scene(draws: usize) -> Invalid {
    Invalid::new(
        "parameters",
        "vehicles, a danger radius and a duration (steps × step_s) with scenes that begin safe, \
         would end in danger without steering, and leave the human an escape",
        format!("none in {draws} draws"),
    )
}
