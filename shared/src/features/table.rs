//! The feature table.
//!
//! A feature is one entry of [`FEATURES`]. World-frame differences are human minus robot, by
//! component (the paper's B). The subscript h stands for V_HR (the human's safety level), and r
//! stands for V_RH (the robot's safety level). In the human's body frame, the x-axis points along
//! the human's heading, and the y-axis points to the left.

use crate::math::{cos, hypot, sin, wrap_angle};
use crate::safety::SafetyLevels;
use crate::scene::JointState;
use Compute::{FromGame, FromMotion};

/// One entry of the feature table.
pub struct Feature {
    /// Column name in files.
    pub name: &'static str,
    /// Unit. "1" means a dimensionless number.
    pub unit: &'static str,
    /// Short description.
    pub meaning: &'static str,
    /// The function that computes the feature.
    pub compute: Compute,
}

/// How a feature is computed from the joint states so far. There is one state per step; the last
/// one is the current state.
#[non_exhaustive]
pub enum Compute {
    /// From the states alone.
    FromMotion(fn(&[JointState]) -> f64),
    /// From the states and the game between the vehicles: its speeds and safety levels.
    FromGame(fn(&[JointState], &SafetyLevels) -> f64),
}

impl Feature {
    /// The feature's value in the last state of `history`, which must not be empty.
    #[must_use]
    pub fn value(&self, history: &[JointState], safety: &SafetyLevels) -> f64 {
        match self.compute {
            FromMotion(compute) => compute(history),
            FromGame(compute) => compute(history, safety),
        }
    }
}

/// All features: name, unit, description, and how to compute it.
pub static FEATURES: &[Feature] = &[
    of_motion("abs_dx", "m", "|Δx|, world frame", |h| (now(h).human.x - now(h).robot.x).abs()),
    of_motion("abs_dy", "m", "|Δy|, world frame", |h| (now(h).human.y - now(h).robot.y).abs()),
    of_motion("dpsi", "rad", "human's heading minus the robot's, in (−π, π]", heading_difference),
    of_motion("cos_dpsi", "1", "cosine of the heading difference", |h| cos(heading_difference(h))),
    of_motion("sin_dpsi", "1", "sine of the heading difference", |h| sin(heading_difference(h))),
    of_game("v_h", "m", "V_HR, the human's safety level", |h, v| v.human_level(now(h))),
    of_game("v_r", "m", "V_RH, the robot's safety level", |h, v| v.robot_level(now(h))),
    of_motion("distance", "m", "distance between the vehicles", |h| now(h).distance_m()),
    of_motion("robot_ahead", "m", "robot's position along the human's heading", |h| {
        now(h).robot_seen_by_human()[0]
    }),
    of_motion("robot_left", "m", "robot's position to the left of the human's heading", |h| {
        now(h).robot_seen_by_human()[1]
    }),
    of_game(
        "closest_time",
        "s",
        "time to the closest approach if both drove straight on; 0 if that is past",
        |h, v| closest_approach(h, v).time_s,
    ),
    of_game("closest_distance", "m", "distance at that closest approach", |h, v| {
        hypot(closest_approach(h, v).ahead_m, closest_approach(h, v).left_m)
    }),
    of_game(
        "closest_left",
        "m",
        "robot's position to the left of the human's heading at that closest approach",
        |h, v| closest_approach(h, v).left_m,
    ),
    of_game(
        "dv_h_ahead",
        "m/m",
        "derivative of V_HR as the robot moves along the human's heading",
        |h, v| human_slopes(h, v)[0],
    ),
    of_game(
        "dv_h_left",
        "m/m",
        "derivative of V_HR as the robot moves to the human's left",
        |h, v| human_slopes(h, v)[1],
    ),
    of_game("dv_h_turn", "m/rad", "derivative of V_HR as the robot turns left", |h, v| {
        human_slopes(h, v)[2]
    }),
    of_game(
        "dv_r_ahead",
        "m/m",
        "derivative of V_RH as the human moves along the robot's heading",
        |h, v| robot_slopes(h, v)[0],
    ),
    of_game(
        "dv_r_left",
        "m/m",
        "derivative of V_RH as the human moves to the robot's left",
        |h, v| robot_slopes(h, v)[1],
    ),
    of_game("dv_r_turn", "m/rad", "derivative of V_RH as the human turns left", |h, v| {
        robot_slopes(h, v)[2]
    }),
    of_motion(
        "turned_1",
        "rad",
        "how far the human turned left in the step before; 0 before the first one",
        last_turn,
    ),
    of_motion(
        "turned_2",
        "rad",
        "how far the human turned left in the step before that one",
        |h| turned(h, 1, 2),
    ),
    of_motion("turned_5", "rad", "how far the human turned left in the five steps before", |h| {
        turned(h, 0, 5)
    }),
    of_motion(
        "turned",
        "rad",
        "how far the human turned left since the beginning of the trial",
        |h| h.windows(2).fold(0.0, |sum, of| sum + turn(of[0], of[1])),
    ),
];

const fn of_motion(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    compute: fn(&[JointState]) -> f64,
) -> Feature {
    Feature { name, unit, meaning, compute: FromMotion(compute) }
}

const fn of_game(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    compute: fn(&[JointState], &SafetyLevels) -> f64,
) -> Feature {
    Feature { name, unit, meaning, compute: FromGame(compute) }
}

/// The current state.
fn now(history: &[JointState]) -> &JointState {
    &history[history.len() - 1]
}

/// Gradient of V_HR with respect to the robot's position (ahead and left) and heading, relative to
/// the human.
fn human_slopes(history: &[JointState], safety: &SafetyLevels) -> [f64; 3] {
    safety.human.state(now(history).robot_seen_by_human()).gradient
}

/// Gradient of V_RH with respect to the human's position (ahead and left) and heading, relative to
/// the robot.
fn robot_slopes(history: &[JointState], safety: &SafetyLevels) -> [f64; 3] {
    safety.robot.state(now(history).human_seen_by_robot()).gradient
}

fn heading_difference(history: &[JointState]) -> f64 {
    let state = now(history);
    wrap_angle(state.human.psi - state.robot.psi)
}

/// The human's turn to the left in the previous step (rad), or 0 before the first step.
pub(super) fn last_turn(history: &[JointState]) -> f64 {
    turned(history, 0, 1)
}

/// The human's turn to the left between two states (rad).
fn turn(before: JointState, after: JointState) -> f64 {
    wrap_angle(after.human.psi - before.human.psi)
}

/// The human's turn to the left from `last` steps ago to `first` steps ago (rad). A vehicle turns
/// by less than half a circle per step, so the sum counts full circles.
fn turned(history: &[JointState], first: usize, last: usize) -> f64 {
    let recent = history.iter().rev().skip(first).take(last - first + 1);
    let pairs = recent.clone().zip(recent.skip(1));
    pairs.fold(0.0, |sum, (&after, &before)| sum + turn(before, after))
}

/// The closest approach if both vehicles drive straight on.
struct ClosestApproach {
    /// Time until the closest approach (s), at least 0.
    time_s: f64,
    /// The robot's position in the human's body frame at that time (m).
    ahead_m: f64,
    left_m: f64,
}

/// Vehicles count as side by side if their relative speed is below this share of the sum of their
/// speeds.
const SIDE_BY_SIDE: f64 = 1e-6;

/// The closest approach, with the speeds of the game in which the human evades.
fn closest_approach(history: &[JointState], safety: &SafetyLevels) -> ClosestApproach {
    let game = safety.human.game();
    let [x, y, psi] = now(history).robot_seen_by_human();
    let robot = game.pursuer.speed_mps;
    let (vx, vy) = (robot * cos(psi) - game.evader.speed_mps, robot * sin(psi));
    let square = vx * vx + vy * vy;
    // Vehicles side by side keep their distance, so their closest approach is now. If their
    // relative speed were only a rounding error, the division would give a time of about 10¹⁶ s.
    let least = SIDE_BY_SIDE * (robot + game.evader.speed_mps);
    let time_s = if square > least * least { (-(x * vx + y * vy) / square).max(0.0) } else { 0.0 };
    ClosestApproach { time_s, ahead_m: x + vx * time_s, left_m: y + vy * time_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, SeededRng};
    use crate::scene::SceneParameters;
    use crate::vehicle::{Pose, TurnInput};
    use core::ops::ControlFlow;

    fn safety(parameters: &SceneParameters) -> SafetyLevels {
        SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(())).unwrap()
    }

    fn compute(name: &str, history: &[JointState], safety: &SafetyLevels) -> f64 {
        let feature = FEATURES.iter().find(|feature| feature.name == name).unwrap();
        feature.value(history, safety)
    }

    #[test]
    fn the_table_is_well_formed() {
        for (i, feature) in FEATURES.iter().enumerate() {
            assert!(!feature.unit.is_empty() && !feature.meaning.is_empty());
            assert!(FEATURES[..i].iter().all(|other| other.name != feature.name));
        }
    }

    /// Compares the closest approach with the least distance along densely sampled straight drives.
    #[test]
    fn the_closest_approach_is_the_least_distance_of_straight_drives() {
        let mut parameters = SceneParameters::default();
        parameters.robot.speed_mps = 1.3;
        // Only the speeds matter here.
        let safety = safety(&parameters);
        let mut rng = SeededRng::new(5);
        let mut pose =
            || Pose::new(rng.uniform(-9., 9.), rng.uniform(-9., 9.), rng.uniform(-PI, PI));
        for _ in 0..50 {
            let state = JointState { human: pose(), robot: pose() };
            let at = |t: f64| state.advance(&parameters, TurnInput::Straight, 0.0, t);
            let (t, d) = (0..40_000)
                .map(|i| f64::from(i) * 2e-3)
                .map(|t| (t, at(t).distance_m()))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            let found = compute("closest_distance", &[state], &safety);
            assert!((found - d).abs() < 1e-5, "{state:?}: {found} {d}");
            assert!((compute("closest_time", &[state], &safety) - t).abs() < 2e-2);
            let left = at(compute("closest_time", &[state], &safety)).robot_seen_by_human()[1];
            assert!((compute("closest_left", &[state], &safety) - left).abs() < 1e-9);
        }
    }

    /// After three turns of 0.1 rad, the human drives parallel to a robot whose heading is 0.3 rad,
    /// up to rounding errors.
    #[test]
    fn vehicles_side_by_side_are_closest_now() {
        let parameters = SceneParameters::default();
        let safety = safety(&parameters);
        let robot = Pose::new(4.0, 1.0, 0.3);
        let mut state = JointState { human: Pose::new(0.0, 0.0, 0.0), robot };
        for _ in 0..3 {
            state = state.advance(&parameters, TurnInput::Left, 0.0, 0.2);
            state.robot = robot;
        }
        assert!(state.human.psi != 0.3 && (state.human.psi - 0.3).abs() < 1e-15);
        assert_eq!(compute("closest_time", &[state], &safety), 0.0);
        let apart = compute("closest_distance", &[state], &safety) - state.distance_m();
        assert!(apart.abs() < 1e-12, "{apart}");
    }

    /// Compares the gradients with differences of V along the named axes.
    #[test]
    fn gradients_are_slopes() {
        let safety = safety(&SceneParameters::default());
        let robot = Pose::new(1.0, 2.0, 0.4);
        let human = Pose::new(7.0, 4.5, -2.6);
        let state = JointState { human, robot };
        let h = 1e-6;
        let moved = |pose: Pose, along: f64, by: [f64; 3]| {
            let (s, c) = crate::math::sin_cos(along);
            let (dx, dy) = (by[0] * c - by[1] * s, by[0] * s + by[1] * c);
            Pose { x: pose.x + dx, y: pose.y + dy, psi: pose.psi + by[2] }
        };
        let names = ["ahead", "left", "turn"];
        for (name, by) in names.into_iter().zip([[h, 0., 0.], [0., h, 0.], [0., 0., h]]) {
            let slope = |level: &dyn Fn([f64; 3]) -> f64| {
                (level(by) - level(by.map(|component| -component))) / (2.0 * h)
            };
            let of_human = slope(&|by| {
                let robot = moved(robot, human.psi, by);
                safety.human_level(&JointState { human, robot })
            });
            let found = compute(&format!("dv_h_{name}"), &[state], &safety);
            assert!((found - of_human).abs() < 1e-6, "{name}: {found} {of_human}");
            let of_robot = slope(&|by| {
                let human = moved(human, robot.psi, by);
                safety.robot_level(&JointState { human, robot })
            });
            let found = compute(&format!("dv_r_{name}"), &[state], &safety);
            assert!((found - of_robot).abs() < 1e-6, "{name}: {found} {of_robot}");
        }
    }

    #[test]
    fn turns_are_those_of_the_steps_before() {
        use TurnInput::{Left, Right, Straight};
        let parameters = SceneParameters::default();
        let safety = safety(&parameters);
        let pose = |psi| Pose::new(0.0, 0.0, psi);
        let mut history = vec![JointState { human: pose(3.1), robot: pose(0.0) }];
        let check = |history: &[JointState], expected: [f64; 4]| {
            for (name, steps) in
                ["turned_1", "turned_2", "turned_5", "turned"].into_iter().zip(expected)
            {
                let found = compute(name, history, &safety);
                assert!((found - 0.1 * steps).abs() < 1e-12, "{name}: {found}");
            }
        };
        check(&history, [0.0; 4]);
        for input in [Left, Left, Right, Straight, Left, Left] {
            history.push(now(&history).advance(&parameters, input, 0.0, 0.2));
        }
        check(&history[..2], [1.0, 0.0, 1.0, 1.0]);
        check(&history[..3], [1.0, 1.0, 2.0, 2.0]);
        check(&history[..4], [-1.0, 1.0, 1.0, 1.0]);
        check(&history, [1.0, 1.0, 2.0, 3.0]);
        for _ in 0..100 {
            history.push(now(&history).advance(&parameters, Left, 0.0, 0.2));
        }
        check(&history, [1.0, 1.0, 5.0, 103.0]);
    }
}
