//! The reference's scenes, drawn by rejection sampling. Studies use the scenes of [`crate::scene`].

use super::stream::Stream;
use crate::math::{PI, hypot, sin_cos};
use crate::scene::{JointState, Scene, SceneParameters};
use crate::vehicle::{Pose, TurnInput};

/// Interval between distance checks (s).
const LOOK_S: f64 = 0.05;

/// Draws the next admissible scene.
pub(super) fn draw(parameters: &SceneParameters, stream: &mut Stream) -> Scene {
    loop {
        let drawn = Drawn::next(stream);
        if let Some(scene) = drawn.scene(parameters) {
            return scene;
        }
    }
}

/// A proposed scene. The random numbers are drawn in the order of the fields.
struct Drawn {
    /// The robot's heading (rad).
    robot_psi: f64,
    /// The human's heading minus the robot's heading (rad).
    approach_rad: f64,
    /// Time of the closest approach if nobody turns (s).
    closest_s: f64,
    /// Signed distance at the closest approach (m).
    miss_m: f64,
    /// The robot's position halfway to its goal (m).
    centre: [f64; 2],
}

impl Drawn {
    fn next(stream: &mut Stream) -> Self {
        Self {
            robot_psi: stream.uniform(-PI, PI),
            approach_rad: stream.uniform(-PI, PI),
            closest_s: stream.uniform(3.0, 8.0),
            miss_m: stream.uniform(-2.5, 2.5),
            centre: [stream.uniform(-3.0, 3.0), stream.uniform(-3.0, 3.0)],
        }
    }

    /// Returns the scene, or `None` if it is rejected. In rejected scenes, the vehicles start too
    /// close, too far apart or nearly parallel, or the human reaches the danger zone too early,
    /// misses it without turning or cannot escape it.
    fn scene(&self, parameters: &SceneParameters) -> Option<Scene> {
        let radius = parameters.danger_radius_m;
        let human_psi = self.robot_psi + self.approach_rad;
        let (robot_sin, robot_cos) = sin_cos(self.robot_psi);
        let (human_sin, human_cos) = sin_cos(human_psi);
        let (v_robot, v_human) = (parameters.robot.speed_mps, parameters.human.speed_mps);
        let w =
            [v_robot * robot_cos - v_human * human_cos, v_robot * robot_sin - v_human * human_sin];
        let closing = hypot(w[0], w[1]);
        // The robot's start relative to the human's start: the offset at the closest approach, moved
        // back in time with the relative velocity w.
        let apart = [
            -self.miss_m * w[1] / closing - w[0] * self.closest_s,
            self.miss_m * w[0] / closing - w[1] * self.closest_s,
        ];
        let half_chord_s = (radius * radius - self.miss_m * self.miss_m).sqrt() / closing;
        let admitted = self.approach_rad.abs() >= 0.35
            && (7.0..=24.0).contains(&hypot(apart[0], apart[1]))
            && self.closest_s - half_chord_s >= 2.0;
        if !admitted {
            return None;
        }
        let half_way = 0.5 * parameters.goal_distance_m();
        let robot = Pose::new(
            self.centre[0] - half_way * robot_cos,
            self.centre[1] - half_way * robot_sin,
            self.robot_psi,
        );
        let human = Pose::new(robot.x - apart[0], robot.y - apart[1], human_psi);
        let scene = Scene::new(parameters, human, robot);
        let closest = |input, hold_s| closest(parameters, &scene, input, hold_s);
        let escapes = || {
            let holds = [1.0, 2.0, 3.0, 4.0, 5.0];
            let sides = [TurnInput::Left, TurnInput::Right];
            sides.iter().any(|&side| holds.iter().any(|&s| closest(side, s) > radius + 0.3))
        };
        (closest(TurnInput::Straight, 0.0) <= radius - 0.05 && escapes()).then_some(scene)
    }
}

/// Smallest distance (m) if the human starts to hold `input` after 1 s, for `hold_s` seconds, and
/// otherwise drives straight on.
fn closest(parameters: &SceneParameters, scene: &Scene, input: TurnInput, hold_s: f64) -> f64 {
    let ticks = |seconds: f64| (seconds / LOOK_S).round() as usize;
    let held = ticks(1.0)..ticks(1.0 + hold_s);
    let mut state: JointState = scene.start();
    let mut closest = state.distance_m();
    for tick in 0..ticks(parameters.duration_s()) {
        let input = if held.contains(&tick) { input } else { TurnInput::Straight };
        state = state.advance(parameters, input, 0.0, LOOK_S);
        closest = closest.min(state.distance_m());
    }
    closest
}
