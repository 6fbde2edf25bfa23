//! Bounds on the probability that the human comes within R_c of the robot in the coming steps.
//!
//! Let S be the score of the window that begins now, that is, the least ε whose sets F_ε(t_i)
//! contain the future trajectory. S_1 … S_n are the scores of the calibration trajectories.
//!
//! * If F_ε(t_i) misses the robot's disc at every step, the human can enter the disc only if S > ε.
//!   For the largest such ε, the upper bound is U = (1 + #{S_i > ε})/(n + 1).
//! * If F_ε(t_i) lies inside the disc at some step, the human can stay out only if S > ε. For the
//!   largest such ε, the lower bound is L = 1 − (1 + #{S_i > ε})/(n + 1) = #{S_i ≤ ε}/(n + 1).
//!
//! # What the bounds guarantee
//! If the current trajectory is exchangeable with the calibration trajectories, the conformal p-value
//! P = (1 + #{S_i ≥ S})/(n + 1) is ≤ α with probability at most α, for any α (Vovk, Gammerman and
//! Shafer 2005). S > ε implies P ≤ (1 + #{S_i > ε})/(n + 1), however ε was chosen. Hence, for every α,
//!
//! * P(the human enters, and U ≤ α) ≤ α and
//! * P(the human stays out, and L ≥ 1 − α) ≤ α.
//!
//! If ε were fixed in advance, U and L would also bound mean frequencies: P(the human enters, and
//! F_ε misses) ≤ E U. But here, ε depends on the scene. If people are harder to predict near the
//! robot, U can be too small there. U is a marginal bound and not a bound for each scene.

use super::guarantee::Unit;
use super::scores::Scores;
use super::widened::widened;
use super::window_sets::Prediction;
use crate::bounds::{ActionChoice, ActionModel, InputBounds, PredictedBounds, Rollout};
use crate::invalid::Invalid;
use crate::math::hypot;
use crate::reach::polygon::signed_distance;
use crate::reach::{PolygonSettings, ReachableSet};
use crate::scene::JointState;
use crate::vehicle::Pose;
use serde::Serialize;

/// Bounds on the probability that the human is within R_c of the robot at the end of at least one of
/// the coming steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DangerBounds {
    /// Lower bound L.
    pub low: f64,
    /// Upper bound U.
    pub high: f64,
    /// The largest calibrated ε (rad/s) whose set lies inside the disc at some step. `None` if not
    /// even the smallest of these sets lies inside the disc.
    pub epsilon_inside: Option<f64>,
    /// The largest calibrated ε (rad/s) whose set misses the disc at every step. `None` if not even
    /// the smallest of these sets misses the disc.
    pub epsilon_missing: Option<f64>,
    /// Steps ahead, T.
    pub steps: usize,
    /// Number of calibration trajectories, n.
    pub calibration: usize,
    /// The guarantee of the bounds in words, to print beside them.
    pub statement: String,
}

/// Upper bound on the distance (m) by which polygons fall short of their sets. They fall short at
/// the rear of sets without straight driving (by 3.7 mm at most in the reference cases of
/// `tests/data`), and along all curves, because their edges are chords.
const DRAWN_TOO_SMALL_M: f64 = 0.004;

/// Computes the bounds from the joint states up to now. `scores` are the scores of calibration
/// trajectories for `choice`, with `base` roll-outs and the prediction's tolerance.
///
/// # Errors
/// [`Invalid`] if the prediction fails, or if the robot's turns depend on the human's actions, so
/// that the robot has more than one future.
pub fn danger_bounds(
    history: &[JointState],
    prediction: &Prediction<'_, impl ActionModel>,
    choice: &ActionChoice,
    scores: &Scores,
) -> Result<DangerBounds, Invalid> {
    let settings = prediction.settings(vec![0.0], choice, Rollout::Base)?;
    let found = prediction.bounds(history, &settings)?;
    let disc = Disc {
        robot: robot_future(&found)?,
        radius_m: prediction.parameters.danger_radius_m,
        slack_m: DRAWN_TOO_SMALL_M + prediction.tolerance.position_m,
        step_m: prediction.parameters.human.speed_mps * prediction.parameters.step_s,
        polygon: PolygonSettings::default(),
    };
    let human = found.low[0].human;
    let parameters = prediction.parameters;
    let set = |epsilon: f64| {
        let bounds: InputBounds = widened(&found.raw, epsilon, prediction.turn_rate())?;
        ReachableSet::new(human, &bounds, parameters.human.speed_mps, parameters.step_s)
    };
    let sorted = scores.sorted();
    let missing = count_while(sorted, |epsilon| Ok(disc.missed_by(&set(epsilon)?)))?;
    let inside = count_while(sorted, |epsilon| Ok(disc.surrounds(&set(epsilon)?)))?;
    // If no drive can enter the disc, or no drive can stay out of it, no statistics are needed.
    let everything = set(prediction.full_range())?;
    let n = sorted.len();
    let of_all = |count: usize| count as f64 / (n + 1) as f64;
    let high = if disc.missed_by(&everything) { 0.0 } else { of_all(1 + n - missing) };
    let low = if disc.surrounds(&everything) { 1.0 } else { of_all(inside) };
    let level = |count: usize| count.checked_sub(1).map(|last| sorted[last]);
    Ok(DangerBounds {
        low,
        high,
        epsilon_inside: level(inside),
        epsilon_missing: level(missing),
        steps: settings.steps(),
        calibration: n,
        statement: statement(n, Unit::Trajectories),
    })
}

/// The meaning of the bounds in words, to print beside them. `calibration` counts trajectories or
/// people ([`Split::parts_of_people`](super::tuning::Split::parts_of_people) draws one trajectory
/// per person).
#[must_use]
pub fn statement(calibration: usize, unit: Unit) -> String {
    let from = unit.calibrating(calibration);
    format!(
        "Marginal bounds from {from}: over scenes exchangeable with these, the human enters where the upper bound \
         is at most α with probability at most α, and stays out where the lower bound is at least 1 − α likewise. \
         They are no guarantee for this one scene."
    )
}

/// The robot's pose after each step.
fn robot_future(found: &PredictedBounds) -> Result<Vec<Pose>, Invalid> {
    let future = |states: &[JointState]| -> Vec<Pose> {
        states[1..].iter().map(|state| state.robot).collect()
    };
    let (low, high) = (future(&found.low), future(&found.high));
    if low == high {
        return Ok(low);
    }
    let expected = "turns that do not depend on the human's actions";
    Err(Invalid::new("robot_action", expected, "different turns in the high and the low roll-out"))
}

/// Counts the scores that satisfy `holds`, by binary search. `sorted` is ascending, and `holds` is
/// true up to some level and false above it.
fn count_while(
    sorted: &[f64],
    holds: impl Fn(f64) -> Result<bool, Invalid>,
) -> Result<usize, Invalid> {
    let (mut yes, mut no) = (0, sorted.len() + 1);
    while no - yes > 1 {
        let middle = usize::midpoint(yes, no);
        if holds(sorted[middle - 1])? {
            yes = middle;
        } else {
            no = middle;
        }
    }
    Ok(yes)
}

/// The danger zone around the robot after each coming step.
struct Disc {
    robot: Vec<Pose>,
    radius_m: f64,
    /// Margin (m) by which sets are enlarged on all sides.
    slack_m: f64,
    /// Distance (m) that the human drives in one step.
    step_m: f64,
    polygon: PolygonSettings,
}

impl Disc {
    /// Whether, at every step, the whole set is outside the disc.
    fn missed_by(&self, set: &ReachableSet) -> bool {
        let outside = self.radius_m + self.slack_m;
        let start = set.start();
        self.robot.iter().enumerate().all(|(i, robot)| {
            let apart = hypot(robot.x - start.x, robot.y - start.y);
            apart > outside + (i + 1) as f64 * self.step_m
                || signed_distance(&set.step_polygon(i + 1, self.polygon), robot.position())
                    > outside
        })
    }

    /// Whether there is a step at which the whole set is inside the disc.
    fn surrounds(&self, set: &ReachableSet) -> bool {
        let inside = self.radius_m - self.slack_m;
        let near = |robot: &Pose, [x, y]: &[f64; 2]| hypot(x - robot.x, y - robot.y) <= inside;
        let start = set.start().position();
        self.robot.iter().enumerate().any(|(i, robot)| {
            // A set far from the disc needs no polygon.
            let reach = (i + 1) as f64 * self.step_m;
            hypot(robot.x - start[0], robot.y - start[1]) <= self.radius_m + reach
                && set.step_polygon(i + 1, self.polygon).iter().all(|vertex| near(robot, vertex))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{PI, SeededRng};
    use crate::scene::SceneParameters;
    use crate::shfrs::testing::{Always, drive_against};
    use crate::shfrs::widened::least_widening;
    use crate::shfrs::window::{Trajectory, Window};
    use crate::vehicle::dubins::arc;

    const STEPS: usize = 10;

    fn choice() -> ActionChoice {
        ActionChoice::TopK(vec![1; STEPS])
    }

    /// A human who mostly drives straight on and sometimes turns for a while, against a robot that
    /// crosses nearby.
    fn scene(rng: &mut SeededRng) -> Trajectory {
        let robot =
            Pose::new(rng.uniform(2.0, 9.0), rng.uniform(-5.0, 5.0), rng.uniform(-3.0, 3.0));
        let (from, turn) = (rng.below(STEPS), [-0.5, 0.0, 0.0, 0.5][rng.below(4)]);
        let upto = from + rng.below(STEPS);
        let rates: Vec<f64> =
            (0..STEPS).map(|i| if (from..upto).contains(&i) { turn } else { 0.0 }).collect();
        drive_against(robot, &rates)
    }

    fn entered(trajectory: &Trajectory) -> bool {
        trajectory.states()[1..]
            .iter()
            .any(|s| hypot(s.human.x - s.robot.x, s.human.y - s.robot.y) <= 3.0)
    }

    fn score(trajectory: &Trajectory, prediction: &Prediction<'_, Always>) -> f64 {
        let window = Window::new(trajectory, 0, STEPS).unwrap();
        let settings = prediction.settings(vec![0.0], &choice(), Rollout::Base).unwrap();
        let base = prediction.bounds(window.history(), &settings).unwrap().raw;
        least_widening(&base, &window, prediction.parameters, prediction.tolerance).unwrap()
    }

    /// For humans who ignore the robot, the bounds hold on average, and both inequalities in the
    /// module's documentation hold for every α.
    #[test]
    fn the_bounds_hold_on_average() {
        let (parameters, model) = (SceneParameters::default(), Always([0.1, 0.8, 0.1]));
        let prediction = Prediction::new(&parameters, &model);
        let mut rng = SeededRng::new(21);
        let (calibrations, scenes) = (40, 25);
        let many = f64::from(calibrations * scenes);
        let (mut low, mut high, mut happened, mut sharp) = (0.0, 0.0, 0.0, 0);
        let alphas = [0.05, 0.1, 0.2, 0.3, 0.5];
        let mut missed = [[0.0; 2]; 5];
        for _ in 0..calibrations {
            let calibration = (0..60).map(|_| score(&scene(&mut rng), &prediction)).collect();
            let scores = Scores::new(calibration).unwrap();
            for _ in 0..scenes {
                let trajectory = scene(&mut rng);
                let now = &trajectory.states()[..1];
                let found = danger_bounds(now, &prediction, &choice(), &scores).unwrap();
                assert!(0.0 <= found.low && found.low <= found.high && found.high <= 1.0);
                let enters = entered(&trajectory);
                low += found.low / many;
                high += found.high / many;
                happened += f64::from(enters) / many;
                sharp += i32::from(found.low > 0.5 || found.high < 0.5);
                for (alpha, missed) in alphas.iter().zip(&mut missed) {
                    missed[0] += f64::from(enters && found.high <= *alpha) / many;
                    missed[1] += f64::from(!enters && found.low >= 1.0 - alpha) / many;
                }
            }
        }
        let error = |p: f64| 3.0 * (p * (1.0 - p) / many).sqrt();
        assert!(low <= happened + error(happened), "{low} {happened} {high}");
        assert!(happened <= high + error(happened), "{low} {happened} {high}");
        assert!(high - low < 0.5 && sharp > 300, "{low} {happened} {high}, {sharp}");
        for (alpha, missed) in alphas.iter().zip(missed) {
            assert!(
                missed.iter().all(|&share| share <= alpha + error(*alpha)),
                "{alpha} {missed:?}"
            );
        }
    }

    #[test]
    fn what_no_drive_can_change_is_certain() {
        let (parameters, model) = (SceneParameters::default(), Always([0.1, 0.8, 0.1]));
        let prediction = Prediction::new(&parameters, &model);
        let scores = Scores::new(vec![0.1; 20]).unwrap();
        let bounds = |x: f64, y: f64, psi: f64| {
            let human = Pose::new(0.0, 0.0, 0.0);
            let now = [JointState { human, robot: Pose::new(x, y, psi) }];
            let found = danger_bounds(&now, &prediction, &choice(), &scores).unwrap();
            (found.low, found.high)
        };
        assert_eq!(bounds(60.0, 0.0, 0.0), (0.0, 0.0));
        assert_eq!(bounds(1.0, 0.0, 0.0), (1.0, 1.0));
        // The vehicles meet if the human drives straight. Whether the human avoids this by turning
        // is open.
        assert_eq!(bounds(4.5, -6.0, 1.57), (20.0 / 21.0, 1.0));
        // The vehicles pass each other. They meet only if the human turns.
        assert_eq!(bounds(9.0, 4.2, PI), (0.0, 1.0 / 21.0));
    }

    #[test]
    fn a_robot_that_reacts_has_no_one_future() {
        let (parameters, model) = (SceneParameters::default(), Always([0.45, 0.1, 0.45]));
        let mut prediction = Prediction::new(&parameters, &model);
        prediction.robot_action = &|states| 0.1 * states[states.len() - 1].human.psi;
        let now = [JointState { human: Pose::new(0.0, 0.0, 0.0), robot: Pose::new(9.0, 0.0, 3.0) }];
        let scores = Scores::new(vec![0.1]).unwrap();
        let complaint = danger_bounds(&now, &prediction, &choice(), &scores).unwrap_err();
        assert_eq!(complaint.field, "robot_action");
        prediction.robot_action = &|_| 0.5;
        let found = danger_bounds(&now, &prediction, &choice(), &scores).unwrap();
        assert_eq!((found.calibration, found.steps), (1, STEPS));
        let end = arc(now[0].robot, 2.0, 0.5, 0.2);
        let settings = prediction.settings(vec![0.0], &choice(), Rollout::Base).unwrap();
        let future = robot_future(&prediction.bounds(&now, &settings).unwrap()).unwrap();
        assert_eq!((future.len(), future[0]), (STEPS, end));
    }
}
