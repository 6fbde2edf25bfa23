//! Scenes: what a trial starts from, and how its state advances.

use crate::invalid::{Invalid, positive};
use crate::math::{PI, SeededRng, TAU, hypot, sin_cos, wrap_angle};
use crate::reachability::PursuitGame;
use crate::vehicle::dubins::relative_state;
use crate::vehicle::{Pose, TurnInput, VehicleModel};
use serde::{Deserialize, Serialize};

/// What every scene of a study has in common: both vehicles, the danger radius
/// and the clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneParameters {
    /// The vehicle that the participant steers.
    pub human: VehicleModel,
    /// The vehicle that drives straight to its goal.
    pub robot: VehicleModel,
    /// Danger radius R_c, m.
    pub danger_radius_m: f64,
    /// Length of a step, s.
    pub step_s: f64,
    /// Steps of a trial.
    pub steps: usize,
}

impl Default for SceneParameters {
    /// The paper's: v = 2 m/s, ω = 0.5 rad/s, R_c = 3 m, 50 steps of 0.2 s.
    fn default() -> Self {
        let vehicle = VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 };
        Self { human: vehicle, robot: vehicle, danger_radius_m: 3.0, step_s: 0.2, steps: 50 }
    }
}

impl SceneParameters {
    /// Accepts parameters that make sense.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        self.human.check().map_err(|e| e.within("human"))?;
        self.robot.check().map_err(|e| e.within("robot"))?;
        positive("danger_radius_m", self.danger_radius_m)?;
        positive("step_s", self.step_s)?;
        if !(1..=3000).contains(&self.steps) {
            return Err(Invalid::new("steps", "a whole number from 1 to 3000", self.steps));
        }
        Ok(())
    }

    /// Length of a trial, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.steps as f64 * self.step_s
    }

    /// How far the robot drives in a trial: its goal is exactly this far ahead, m.
    #[must_use]
    pub fn goal_distance_m(&self) -> f64 {
        self.robot.speed_mps * self.duration_s()
    }

    /// The game whose value is the safety level of `evader`. Vehicles that can do the
    /// same play the same game in both roles.
    #[must_use]
    pub fn game(&self, evader: Evader) -> PursuitGame {
        let (evader, pursuer) = match evader {
            Evader::Human => (self.human, self.robot),
            Evader::Robot => (self.robot, self.human),
        };
        PursuitGame { evader, pursuer, radius_m: self.danger_radius_m }
    }
}

/// Whose safety level it is: that vehicle evades, the other one pursues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evader {
    /// V_HR: the human evades the robot.
    Human,
    /// V_RH: the robot evades the human.
    Robot,
}

impl Evader {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Human, Self::Robot];

    /// Its word in the database.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Human => "human",
            Self::Robot => "robot",
        }
    }
}

/// Where both vehicles are at one instant. On the wire:
/// `{"human": [x, y, psi], "robot": [x, y, psi]}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointState {
    /// The human's vehicle.
    pub human: Pose,
    /// The robot.
    pub robot: Pose,
}

impl JointState {
    /// The state after `seconds` with the human holding `input`; the robot never turns.
    #[must_use]
    pub fn advance(&self, parameters: &SceneParameters, input: TurnInput, seconds: f64) -> Self {
        Self {
            human: parameters.human.advance(self.human, input, seconds),
            robot: parameters.robot.advance(self.robot, TurnInput::Straight, seconds),
        }
    }

    /// Distance between the vehicles, m.
    #[must_use]
    pub fn distance_m(&self) -> f64 {
        hypot(self.human.x - self.robot.x, self.human.y - self.robot.y)
    }

    /// The robot's pose in the human's frame: the argument of V_HR (human evades).
    #[must_use]
    pub fn robot_seen_by_human(&self) -> [f64; 3] {
        relative_state(self.human, self.robot)
    }

    /// The human's pose in the robot's frame: the argument of V_RH (robot evades).
    #[must_use]
    pub fn human_seen_by_robot(&self) -> [f64; 3] {
        relative_state(self.robot, self.human)
    }

    /// Accepts a state of six finite numbers.
    ///
    /// # Errors
    /// [`Invalid`] naming the coordinate.
    pub fn check(&self) -> Result<(), Invalid> {
        self.human.check().map_err(|e| e.within("human"))?;
        self.robot.check().map_err(|e| e.within("robot"))
    }
}

/// What a trial starts from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The human's vehicle at the start.
    pub human: Pose,
    /// The robot at the start, heading straight to its goal.
    pub robot: Pose,
    /// The robot's goal, which it reaches as the trial ends, m.
    pub goal: [f64; 2],
}

impl Scene {
    /// A scene whose goal lies where this robot will be at the end.
    #[must_use]
    pub fn new(parameters: &SceneParameters, human: Pose, robot: Pose) -> Self {
        let (sin, cos) = sin_cos(robot.psi);
        let ahead = parameters.goal_distance_m();
        Self { human, robot, goal: [robot.x + ahead * cos, robot.y + ahead * sin] }
    }

    /// The state before the first step.
    #[must_use]
    pub fn start(&self) -> JointState {
        JointState { human: self.human, robot: self.robot }
    }
}

/// Smallest distance within a step, m.
///
/// Sampled 20 times a step, which for vehicles of a few m/s is within 0.1 mm of
/// the continuous minimum wherever that is near the danger radius.
#[must_use]
pub fn closest_within_step(
    parameters: &SceneParameters,
    state: JointState,
    input: TurnInput,
) -> f64 {
    const SAMPLES: u32 = 20;
    (0..=SAMPLES)
        .map(|i| f64::from(i) / f64::from(SAMPLES) * parameters.step_s)
        .map(|s| state.advance(parameters, input, s).distance_m())
        .fold(f64::INFINITY, f64::min)
}

/// The coordinates along which scenes are spread evenly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Encounter {
    /// Human's heading less the robot's, rad in (−π, π].
    pub approach_rad: f64,
    /// Signed distance of closest approach if nobody turns, m.
    pub miss_m: f64,
    /// Time at which the distance falls to R_c if nobody turns, s.
    pub entry_s: f64,
}

/// Bounds within which encounters are drawn. A closing speed that is too small
/// (nearly parallel headings) would need starts that are far apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncounterRange {
    /// Least |approach angle|, rad.
    pub min_approach_rad: f64,
    /// Greatest |miss distance| as a share of R_c.
    pub max_miss_share: f64,
    /// Least time to the danger zone, s.
    pub min_entry_s: f64,
    /// Greatest time to the danger zone, s.
    pub max_entry_s: f64,
    /// Least and greatest distance at the start, m.
    pub start_distance_m: (f64, f64),
    /// By how much an escape must clear the danger zone, m.
    pub escape_clearance_m: f64,
    /// Before this time an escape does not begin, s: a person needs to react.
    pub escape_delay_s: f64,
}

impl Default for EncounterRange {
    fn default() -> Self {
        Self {
            min_approach_rad: 0.35,
            max_miss_share: 0.85,
            min_entry_s: 2.0,
            max_entry_s: 8.0,
            start_distance_m: (7.0, 24.0),
            escape_clearance_m: 0.3,
            escape_delay_s: 1.0,
        }
    }
}

/// The scene of an encounter, centred on the origin and turned by `turn_rad`.
fn place(parameters: &SceneParameters, encounter: Encounter, turn_rad: f64) -> Scene {
    let robot_heading = turn_rad;
    let human_heading = wrap_angle(turn_rad + encounter.approach_rad);
    let (rs, rc) = sin_cos(robot_heading);
    let (hs, hc) = sin_cos(human_heading);
    // The robot's velocity relative to the human's.
    let wx = parameters.robot.speed_mps * rc - parameters.human.speed_mps * hc;
    let wy = parameters.robot.speed_mps * rs - parameters.human.speed_mps * hs;
    let w = hypot(wx, wy);
    let radius = parameters.danger_radius_m;
    let half_chord = (radius * radius - encounter.miss_m * encounter.miss_m).max(0.0).sqrt();
    let closest_s = encounter.entry_s + half_chord / w;
    // Robot's start relative to the human's: the miss vector, taken back along w.
    let dx = -encounter.miss_m * wy / w - wx * closest_s;
    let dy = encounter.miss_m * wx / w - wy * closest_s;
    // Centre the box around both straight paths, so that all of it can be seen.
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

/// Smallest distance, m, when the human turns with `input` from `begin` to `end`
/// (steps) and otherwise drives straight.
fn closest_with_manoeuvre(
    parameters: &SceneParameters,
    scene: &Scene,
    input: TurnInput,
    begin: usize,
    end: usize,
) -> f64 {
    let mut state = scene.start();
    let mut closest = state.distance_m();
    for step in 0..parameters.steps {
        let held = if (begin..end).contains(&step) { input } else { TurnInput::Straight };
        closest = closest.min(closest_within_step(parameters, state, held));
        state = state.advance(parameters, held, parameters.step_s);
    }
    closest
}

/// Whether a scene keeps the study's rules: it starts outside the danger zone
/// with time to react, runs into it if nobody turns, and can be escaped from.
#[must_use]
pub fn is_admissible(parameters: &SceneParameters, range: &EncounterRange, scene: &Scene) -> bool {
    let distance = scene.start().distance_m();
    if distance < range.start_distance_m.0 || distance > range.start_distance_m.1 {
        return false;
    }
    let radius = parameters.danger_radius_m;
    if closest_with_manoeuvre(parameters, scene, TurnInput::Straight, 0, 0) > radius {
        return false;
    }
    // Where it takes a solve, the escape below has to do: drawing scenes waits for nothing.
    if let Ok(value) = parameters.game(Evader::Human).exact()
        && value.value(scene.start().robot_seen_by_human()) <= 0.0
    {
        return false;
    }
    let begin = (range.escape_delay_s / parameters.step_s).ceil() as usize;
    let second = (1.0 / parameters.step_s).round().max(1.0) as usize;
    (1..=5).any(|seconds| {
        [TurnInput::Left, TurnInput::Right].into_iter().any(|input| {
            let end = begin + seconds * second;
            closest_with_manoeuvre(parameters, scene, input, begin, end)
                > radius + range.escape_clearance_m
        })
    })
}

/// `count` scenes from a seed, spread evenly over approach angle, miss distance
/// and entry time: a Latin hypercube, in which each of the three coordinates
/// falls once into each of `count` equal strata. Where a cell of the hypercube
/// has no admissible scene (say, a head-on encounter two seconds away), the
/// approach stratum is kept and the other two are drawn anew.
///
/// The same seed gives the same scenes everywhere.
///
/// # Errors
/// [`Invalid`] if no admissible scene is found for some stratum, which means
/// that the parameters leave the human no escape.
pub fn generate(
    parameters: &SceneParameters,
    range: &EncounterRange,
    count: usize,
    seed: u64,
) -> Result<Vec<(Scene, Encounter)>, Invalid> {
    const TRIES_IN_CELL: usize = 40;
    const TRIES: usize = 4000;
    let mut rng = SeededRng::new(seed);
    let approach = rng.permutation(count);
    let miss = rng.permutation(count);
    let entry = rng.permutation(count);
    let stratum = |rng: &mut SeededRng, cell: usize| (cell as f64 + rng.unit()) / count as f64;
    let max_miss = range.max_miss_share * parameters.danger_radius_m;
    (0..count)
        .map(|i| {
            for attempt in 0..TRIES {
                let in_cell = attempt < TRIES_IN_CELL;
                let a = stratum(&mut rng, approach[i]);
                let m = if in_cell { stratum(&mut rng, miss[i]) } else { rng.unit() };
                let e = if in_cell { stratum(&mut rng, entry[i]) } else { rng.unit() };
                let encounter = Encounter {
                    approach_rad: approach_angle(range, a),
                    miss_m: max_miss * (2.0 * m - 1.0),
                    entry_s: range.min_entry_s + (range.max_entry_s - range.min_entry_s) * e,
                };
                let scene = place(parameters, encounter, wrap_angle(rng.uniform(0.0, TAU)));
                if is_admissible(parameters, range, &scene) {
                    return Ok((scene, encounter));
                }
            }
            Err(Invalid::new(
                "parameters",
                "vehicles and a danger radius that leave the human an escape",
                format!("no admissible scene in {TRIES} draws"),
            ))
        })
        .collect()
}

/// Maps [0, 1) to the approach angles whose size is at least the least one.
fn approach_angle(range: &EncounterRange, share: f64) -> f64 {
    let signed = 2.0 * share - 1.0;
    let size = range.min_approach_rad + (PI - range.min_approach_rad) * signed.abs();
    if signed < 0.0 { -size } else { size }
}

/// The encounter that a scene turns out to be, for reports of a design.
#[must_use]
pub fn encounter_of(parameters: &SceneParameters, scene: &Scene) -> Option<Encounter> {
    let (rs, rc) = sin_cos(scene.robot.psi);
    let (hs, hc) = sin_cos(scene.human.psi);
    let wx = parameters.robot.speed_mps * rc - parameters.human.speed_mps * hc;
    let wy = parameters.robot.speed_mps * rs - parameters.human.speed_mps * hs;
    let w = hypot(wx, wy);
    let (dx, dy) = (scene.robot.x - scene.human.x, scene.robot.y - scene.human.y);
    let miss_m = (wx * dy - wy * dx) / w;
    let radius = parameters.danger_radius_m;
    if w < 1e-9 || miss_m.abs() > radius {
        return None;
    }
    let entry_s = (-(dx * wx + dy * wy) / w - (radius * radius - miss_m * miss_m).sqrt()) / w;
    Some(Encounter { approach_rad: wrap_angle(scene.human.psi - scene.robot.psi), miss_m, entry_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenes(count: usize, seed: u64) -> Vec<(Scene, Encounter)> {
        generate(&SceneParameters::default(), &EncounterRange::default(), count, seed).unwrap()
    }

    #[test]
    fn the_robot_reaches_its_goal_as_the_trial_ends() {
        let parameters = SceneParameters::default();
        for (scene, _) in scenes(20, 1) {
            let start = scene.robot.position();
            assert!(
                (hypot(scene.goal[0] - start[0], scene.goal[1] - start[1]) - 20.0).abs() < 1e-12
            );
            let end = (0..50)
                .fold(scene.start(), |state, _| state.advance(&parameters, TurnInput::Right, 0.2));
            assert!(hypot(end.robot.x - scene.goal[0], end.robot.y - scene.goal[1]) < 1e-12);
        }
    }

    #[test]
    fn scenes_keep_the_rules() {
        let parameters = SceneParameters::default();
        let value = parameters.game(Evader::Human).exact().unwrap();
        for (scene, planned) in scenes(150, 20_180_918) {
            let start = scene.start();
            assert!(start.distance_m() > 3.0);
            assert!(value.value(start.robot_seen_by_human()) > 0.0);
            // Nobody turns: not in the zone for two seconds, in it within ten.
            let mut state = start;
            let mut entry = None;
            for tick in 0..10_000 {
                if state.distance_m() <= 3.0 {
                    entry = Some(f64::from(tick) * 1e-3);
                    break;
                }
                state = state.advance(&parameters, TurnInput::Straight, 1e-3);
            }
            let entry = entry.expect("the human must have to avoid the robot");
            assert!((2.0..=8.01).contains(&entry), "{entry}");
            assert!((entry - planned.entry_s).abs() < 2e-3, "{entry} {planned:?}");
            let seen = encounter_of(&parameters, &scene).unwrap();
            assert!((seen.miss_m - planned.miss_m).abs() < 1e-9);
            assert!((seen.entry_s - planned.entry_s).abs() < 1e-9);
        }
    }

    #[test]
    fn encounters_are_spread_evenly() {
        let design = scenes(240, 3);
        let mut counts = [[0; 8]; 3];
        for (_, e) in &design {
            let angle = (e.approach_rad + PI) / TAU;
            let shares = [angle, (e.miss_m / 2.55 + 1.0) / 2.0, (e.entry_s - 2.0) / 6.0];
            for (coordinate, share) in shares.into_iter().enumerate() {
                counts[coordinate][((share * 8.0) as usize).min(7)] += 1;
            }
        }
        // Approach angles are exactly stratified but for the gap around parallel headings.
        assert!(counts[0].iter().all(|&n| (18..=36).contains(&n)), "{counts:?}");
        // The other two are stratified where the cell admits a scene.
        assert!(counts[1].iter().all(|&n| n >= 15), "{counts:?}");
        assert!(counts[2].iter().skip(1).all(|&n| n >= 15), "{counts:?}");
    }

    #[test]
    fn a_seed_names_its_scenes() {
        assert_eq!(scenes(5, 9), scenes(5, 9));
        assert_ne!(scenes(5, 9), scenes(5, 10));
    }

    #[test]
    fn the_game_of_each_evader() {
        let mut parameters = SceneParameters::default();
        let [human, robot] = Evader::ALL.map(|evader| parameters.game(evader));
        assert_eq!(human, robot);
        assert!(human.identical());
        parameters.robot.speed_mps = 1.5;
        let [human, robot] = Evader::ALL.map(|evader| parameters.game(evader));
        assert_eq!((human.evader.speed_mps, human.pursuer.speed_mps), (2.0, 1.5));
        assert_eq!((robot.evader, robot.pursuer), (human.pursuer, human.evader));
        assert_eq!((human.radius_m, robot.radius_m), (3.0, 3.0));
    }

    #[test]
    fn hopeless_parameters_are_refused() {
        let parameters = SceneParameters { danger_radius_m: 30.0, ..SceneParameters::default() };
        assert!(generate(&parameters, &EncounterRange::default(), 1, 0).is_err());
    }
}
