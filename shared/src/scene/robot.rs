//! The rule that moves the robot.
//!
//! [`RobotPolicy::turn_rate`] is the only place that decides how the robot turns. A rule is a pure
//! function of the states so far, so the page that shows a scene, the server that replays it and a
//! synthetic participant get the same robot, bit for bit.

use super::parameters::{Evader, SceneParameters};
use super::state::JointState;
use crate::invalid::{Invalid, positive};
use crate::math::{PI, atan2, sin_cos, wrap_angle};
use crate::vehicle::{Pose, TurnInput, dubins};
use serde::{Deserialize, Serialize};

/// The rules that a robot can follow. Each word is used in study files and on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// The robot of the paper: drives straight to its goal and ignores the human.
    #[default]
    Straight,
    /// Steers to each of `way_points_m` in turn, then to its goal, and ignores the human.
    WayPoints,
    /// Turns at the rates of `turns`, then drives straight, and ignores the human.
    Script,
    /// Steers to its goal as long as no turn of the human in the next step can bring V_RH down to
    /// `threshold_m`. Otherwise it takes the turn after which V_RH is greatest in the worst case.
    Evades,
}

impl Rule {
    /// All rules.
    pub const ALL: [Self; 4] = [Self::Straight, Self::WayPoints, Self::Script, Self::Evades];

    /// The word in study files and in JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::WayPoints => "way_points",
            Self::Script => "script",
            Self::Evades => "evades",
        }
    }
}

/// A robot that a study's participants meet: its name, its rule and the settings of this rule.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotPolicy {
    /// Name in exports and reports: 1 to 40 lower-case letters, digits, hyphens and underscores.
    pub name: String,
    /// The rule. Default: `straight`.
    #[serde(default)]
    pub rule: Rule,
    /// Points (m) that the rule `way_points` steers to: 1 to 8 pairs, ahead and to the left of the
    /// robot's start. Each point is farther ahead than the one before it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub way_points_m: Vec<[f64; 2]>,
    /// Turn rates of the rule `script`, in the order of time: 1 to 50.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub turns: Vec<ScriptedTurn>,
    /// V_RH (m) that the rule `evades` keeps above, if it can: more than −R_c, at most 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub threshold_m: Option<f64>,
}

/// A part of a script.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ScriptedTurn {
    /// Time after the start of the scene (s) at which the next part begins. A part ends with the
    /// step in which this time falls.
    pub until_s: f64,
    /// Turn rate (rad/s), positive to the left.
    pub turn_rate_radps: f64,
}

/// How a study with several robots divides them among its participants and scenes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum RobotsVary {
    /// Each participant meets every robot, in the same number of scenes of a phase (or one more).
    #[default]
    Within,
    /// Each participant meets one robot. Participants in the order of their places meet the robots
    /// in turn.
    Between,
}

impl RobotsVary {
    /// Both ways.
    pub const ALL: [Self; 2] = [Self::Within, Self::Between];

    /// The word in study files and in JSON.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Within => "within",
            Self::Between => "between",
        }
    }

    /// Index of the robot, of `robots` robots, in a scene with this approach stratum of the
    /// participant at `place`.
    ///
    /// Within participants, the robots alternate over the approach strata, and the next participant
    /// meets the next robot in each stratum. So every participant meets every robot equally often,
    /// and of as many participants in a row as there are robots, each meets another robot in a
    /// stratum. The strata have random labels, so the order of the robots is random.
    #[must_use]
    pub fn robot(self, robots: usize, place: u64, approach_stratum: usize) -> usize {
        let turn = match self {
            Self::Within => place.wrapping_add(approach_stratum as u64),
            Self::Between => place,
        };
        (turn % robots.max(1) as u64) as usize
    }
}

/// Longest name of a robot (characters).
const MAX_NAME: usize = 40;
/// Most way points, and most parts of a script.
const MAX_WAY_POINTS: usize = 8;
const MAX_TURNS: usize = 50;
/// Greatest threshold of V_RH (m).
const MAX_THRESHOLD_M: f64 = 100.0;

impl RobotPolicy {
    /// The robot of a study that names none: it drives straight.
    #[must_use]
    pub fn straight() -> Self {
        Self { name: Rule::Straight.word().to_owned(), ..Self::default() }
    }

    /// Whether the robot can leave the straight line to its goal.
    #[must_use]
    pub fn may_turn(&self) -> bool {
        self.rule != Rule::Straight
    }

    /// Whether the robot's motion depends on the human.
    #[must_use]
    pub fn reacts(&self) -> bool {
        self.rule == Rule::Evades
    }

    /// Checks the name, the settings of the rule, and that these vehicles can follow the rule.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self, parameters: &SceneParameters) -> Result<(), Invalid> {
        let is_name = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || "-_".contains(c);
        if !(1..=MAX_NAME).contains(&self.name.len()) || !self.name.chars().all(is_name) {
            let expected =
                format!("1 to {MAX_NAME} lower-case letters, digits, hyphens and underscores");
            return Err(Invalid::new("name", expected, format!("{:?}", self.name)));
        }
        if self.name == Rule::Straight.word() && self.may_turn() {
            let expected = "another name, since straight names robots that drive straight";
            return Err(Invalid::new("name", expected, format!("rule = {:?}", self.rule.word())));
        }
        let turned_rad = parameters.robot.turn_rate_radps * parameters.step_s;
        if self.may_turn() && turned_rad >= PI {
            let expected = "straight, unless the robot turns by less than π rad in a step";
            let found = format!("{}, and {turned_rad} rad", self.rule.word());
            return Err(Invalid::new("rule", expected, found));
        }
        let given = [
            ("way_points_m", Rule::WayPoints, !self.way_points_m.is_empty()),
            ("turns", Rule::Script, !self.turns.is_empty()),
            ("threshold_m", Rule::Evades, self.threshold_m.is_some()),
        ];
        for (field, rule, is_given) in given {
            if is_given && self.rule != rule {
                let expected = format!("no such setting unless rule = \"{}\"", rule.word());
                return Err(Invalid::new(
                    field,
                    expected,
                    format!("rule = {:?}", self.rule.word()),
                ));
            }
            if !is_given && self.rule == rule {
                let expected = format!("a value, which rule = \"{}\" needs", rule.word());
                return Err(Invalid::new(field, expected, "none"));
            }
        }
        self.check_way_points(parameters)?;
        self.check_turns(parameters)?;
        let Some(threshold_m) = self.threshold_m else { return Ok(()) };
        let least = -parameters.danger_radius_m;
        if !(threshold_m > least && threshold_m <= MAX_THRESHOLD_M) {
            let expected = format!("more than {least} (V_RH is never less), at most 100");
            return Err(Invalid::new("threshold_m", expected, format!("{threshold_m:?}")));
        }
        // The page evaluates V_RH itself, in every step, with the same bits as the server.
        parameters.game(Evader::Robot).exact().map(|_| ()).map_err(|_| {
            let [human, robot] = [parameters.human, parameters.robot]
                .map(|it| format!("{} m/s, {} rad/s", it.speed_mps, it.turn_rate_radps));
            let expected = "another rule, or a human and a robot with the same speed and turn \
                            rate, for which V_RH has a closed form";
            Invalid::new("rule", expected, format!("evades with {human} and {robot}"))
        })
    }

    fn check_way_points(&self, parameters: &SceneParameters) -> Result<(), Invalid> {
        if self.way_points_m.len() > MAX_WAY_POINTS {
            let expected = format!("at most {MAX_WAY_POINTS} points");
            return Err(Invalid::new("way_points_m", expected, self.way_points_m.len()));
        }
        let far_m = parameters.goal_distance_m();
        let mut before = 0.0;
        for (i, &[ahead, left]) in self.way_points_m.iter().enumerate() {
            if !(ahead > before && ahead < far_m) {
                let expected = format!("more than {before} and less than {far_m}, the goal");
                let field = format!("way_points_m[{i}][0]");
                return Err(Invalid::new(field, expected, format!("{ahead:?}")));
            }
            if left.is_nan() || left.abs() > far_m {
                let expected = format!("a number from -{far_m} to {far_m}");
                let field = format!("way_points_m[{i}][1]");
                return Err(Invalid::new(field, expected, format!("{left:?}")));
            }
            before = ahead;
        }
        Ok(())
    }

    fn check_turns(&self, parameters: &SceneParameters) -> Result<(), Invalid> {
        if self.turns.len() > MAX_TURNS {
            let expected = format!("at most {MAX_TURNS} parts");
            return Err(Invalid::new("turns", expected, self.turns.len()));
        }
        let mut before = 0.0;
        for (i, turn) in self.turns.iter().enumerate() {
            let field = |name: &str| format!("turns[{i}].{name}");
            positive(&field("until_s"), turn.until_s)?;
            if turn.until_s <= before {
                let expected = format!("more than {before}, the end of the part before");
                return Err(Invalid::new(field("until_s"), expected, turn.until_s));
            }
            let most = parameters.robot.turn_rate_radps;
            if turn.turn_rate_radps.is_nan() || turn.turn_rate_radps.abs() > most {
                let expected = format!("a number from -{most} to {most}");
                let found = format!("{:?}", turn.turn_rate_radps);
                return Err(Invalid::new(field("turn_rate_radps"), expected, found));
            }
            before = turn.until_s;
        }
        Ok(())
    }

    /// The robot's turn rate (rad/s) in the step that begins in the last of `states`, the states
    /// from the start of the scene on. Zero without states. `start` is the robot at the start.
    #[must_use]
    pub fn turn_rate(
        &self,
        parameters: &SceneParameters,
        start: Pose,
        goal: [f64; 2],
        states: &[JointState],
    ) -> f64 {
        let Some(now) = states.last() else { return 0.0 };
        match self.rule {
            Rule::Straight => 0.0,
            Rule::WayPoints => towards(parameters, now.robot, self.target(start, goal, now.robot)),
            Rule::Script => {
                let begun_s = (states.len() - 1) as f64 * parameters.step_s;
                // A part that ends with the step before must not last longer by a rounding error.
                let is_left =
                    |turn: &&ScriptedTurn| turn.until_s - begun_s > 1e-9 * parameters.step_s;
                self.turns.iter().find(is_left).map_or(0.0, |turn| turn.turn_rate_radps)
            }
            Rule::Evades => self.evading(parameters, goal, now),
        }
    }

    /// The first way point that is farther ahead than the robot, otherwise the goal.
    fn target(&self, start: Pose, goal: [f64; 2], robot: Pose) -> [f64; 2] {
        let (sin, cos) = sin_cos(start.psi);
        let driven_m = (robot.x - start.x) * cos + (robot.y - start.y) * sin;
        let next = self.way_points_m.iter().find(|[ahead, _]| *ahead > driven_m);
        next.map_or(goal, |&[ahead, left]| {
            let [x, y] = start.position();
            [x + ahead * cos - left * sin, y + ahead * sin + left * cos]
        })
    }

    /// The turn rate of the rule `evades`.
    fn evading(&self, parameters: &SceneParameters, goal: [f64; 2], now: &JointState) -> f64 {
        let (Ok(value), Some(threshold_m)) =
            (parameters.game(Evader::Robot).exact(), self.threshold_m)
        else {
            return 0.0;
        };
        let step_s = parameters.step_s;
        let humans = TurnInput::ALL.map(|input| parameters.human.advance(now.human, input, step_s));
        // V_RH (m) at the end of the step in the worst case.
        let worst = |turn_rate: f64| {
            let speed = parameters.robot.speed_mps;
            let robot = dubins::arc(now.robot, speed, turn_rate, step_s);
            let level = |human: Pose| value.value(dubins::relative_state(robot, human));
            humans.into_iter().map(level).fold(f64::INFINITY, f64::min)
        };
        let to_goal = towards(parameters, now.robot, goal);
        let most = parameters.robot.turn_rate_radps;
        let mut best = (worst(to_goal), to_goal);
        if best.0 > threshold_m {
            return to_goal;
        }
        // The turn towards the goal comes first, so it wins among equals.
        for turn_rate in [0.0, most, -most] {
            let level = worst(turn_rate);
            if level > best.0 {
                best = (level, turn_rate);
            }
        }
        best.1
    }
}

/// The turn rate (rad/s) with which the robot faces `target` at the end of the step, if it can.
/// Zero if the target is less than a step ahead or behind it: the robot passes its goal.
fn towards(parameters: &SceneParameters, robot: Pose, [x, y]: [f64; 2]) -> f64 {
    let [dx, dy] = [x - robot.x, y - robot.y];
    let (sin, cos) = sin_cos(robot.psi);
    let step_m = parameters.robot.speed_mps * parameters.step_s;
    if dx * cos + dy * sin < step_m {
        return 0.0;
    }
    let most = parameters.robot.turn_rate_radps;
    let wanted = wrap_angle(atan2(dy, dx) - robot.psi) / parameters.step_s;
    wanted.max(-most).min(most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{SeededRng, hypot};
    use crate::scene::{EncounterRange, Scene, generate};
    use crate::trial::{simulate, verify};

    fn policy(rule: Rule) -> RobotPolicy {
        let mut policy = RobotPolicy { name: "it".to_owned(), rule, ..RobotPolicy::default() };
        match rule {
            Rule::Straight => {}
            Rule::WayPoints => policy.way_points_m = vec![[6.0, 1.5], [13.0, -1.0]],
            Rule::Script => {
                policy.turns = vec![
                    ScriptedTurn { until_s: 1.0, turn_rate_radps: 0.25 },
                    ScriptedTurn { until_s: 3.1, turn_rate_radps: -0.5 },
                ];
            }
            Rule::Evades => policy.threshold_m = Some(1.0),
        }
        policy
    }

    fn scenes(rule: Rule, count: usize) -> Vec<Scene> {
        let parameters = SceneParameters::default();
        let drawn = generate(&parameters, &EncounterRange::default(), count, 11).unwrap();
        let with = |(scene, _)| Scene { policy: Some(Box::new(policy(rule))), ..scene };
        drawn.into_iter().map(with).collect()
    }

    fn inputs(rng: &mut SeededRng) -> Vec<TurnInput> {
        let mut held = TurnInput::Straight;
        let next = |_| {
            if rng.below(5) == 0 {
                held = TurnInput::ALL[rng.below(3)];
            }
            held
        };
        (0..50).map(next).collect()
    }

    #[test]
    fn the_straight_rule_is_no_rule_to_the_bit() {
        let (parameters, mut rng) = (SceneParameters::default(), SeededRng::new(1));
        for scene in scenes(Rule::Straight, 20) {
            let inputs = inputs(&mut rng);
            let without = Scene { policy: None, ..scene.clone() };
            let states = simulate(&parameters, &scene, &inputs);
            assert!(verify(&parameters, &without, &inputs, &states).exact);
        }
    }

    #[test]
    fn a_drive_of_any_rule_replays_and_keeps_the_robots_limits() {
        let (parameters, mut rng) = (SceneParameters::default(), SeededRng::new(2));
        let most = parameters.robot.turn_rate_radps * parameters.step_s + 1e-12;
        for rule in Rule::ALL {
            for scene in scenes(rule, 20) {
                let inputs = inputs(&mut rng);
                let states = simulate(&parameters, &scene, &inputs);
                assert!(verify(&parameters, &scene, &inputs, &states).exact, "{rule:?}");
                let turned = |pair: &[JointState]| pair[0].robot_turned(&pair[1]).abs();
                assert!(states.windows(2).all(|pair| turned(pair) <= most), "{rule:?}");
                let other = Scene { policy: Some(Box::new(policy(Rule::Script))), ..scene };
                let exact = verify(&parameters, &other, &inputs, &states).exact;
                assert_eq!(exact, rule == Rule::Script, "{rule:?}");
            }
        }
    }

    #[test]
    fn way_points_are_passed_in_turn_and_then_the_goal() {
        let parameters = SceneParameters::default();
        let robot = Pose::new(1.0, -2.0, 2.2);
        let scene = Scene {
            policy: Some(Box::new(policy(Rule::WayPoints))),
            ..Scene::new(&parameters, Pose::new(40.0, 0.0, 0.0), robot)
        };
        // The detour takes longer than the trial of a robot that drives straight.
        let states = simulate(&parameters, &scene, &[TurnInput::Straight; 53]);
        let (sin, cos) = sin_cos(robot.psi);
        let nearest = |[ahead, left]: [f64; 2]| {
            let [x, y] = [robot.x + ahead * cos - left * sin, robot.y + ahead * sin + left * cos];
            let apart = states.iter().map(|state| hypot(state.robot.x - x, state.robot.y - y));
            apart.fold(f64::INFINITY, f64::min)
        };
        // A step is 0.4 m long, so a state is at most 0.2 m from a point on the path.
        assert!(nearest([6.0, 1.5]) < 0.25, "{}", nearest([6.0, 1.5]));
        assert!(nearest([13.0, -1.0]) < 0.25, "{}", nearest([13.0, -1.0]));
        assert!(nearest([20.0, 0.0]) < 0.25, "{}", nearest([20.0, 0.0]));
    }

    #[test]
    fn a_script_turns_in_its_steps() {
        let parameters = SceneParameters::default();
        let scene = &scenes(Rule::Script, 1)[0];
        let states = simulate(&parameters, scene, &[TurnInput::Left; 50]);
        let rates: Vec<f64> = states
            .windows(2)
            .map(|pair| pair[0].robot_turned(&pair[1]) / parameters.step_s)
            .collect();
        let expected = |step: usize| match step {
            0..5 => 0.25,
            5..16 => -0.5,
            _ => 0.0,
        };
        assert!(rates.iter().enumerate().all(|(i, rate)| (rate - expected(i)).abs() < 1e-9));
    }

    /// V_RH is the value of the game in which the robot evades. So a robot that turns as the rule
    /// says keeps out of the danger zone whatever the human does, up to the length of a step.
    #[test]
    fn a_robot_that_evades_is_not_caught() {
        let parameters = SceneParameters::default();
        let value = parameters.game(Evader::Robot).exact().unwrap();
        let (mut turned, mut straight_caught) = (0, 0);
        for scene in scenes(Rule::Evades, 60) {
            // The human pursues: each input brings V_RH down as far as it can.
            let pursue = |scene: &Scene| {
                let mut states = vec![scene.start()];
                for _ in 0..50 {
                    let now = states[states.len() - 1];
                    let robot_radps = scene.robot_turn_rate(&parameters, &states);
                    let after = |input| now.advance(&parameters, input, robot_radps, 0.2);
                    let level = |state: &JointState| value.value(state.human_seen_by_robot());
                    let states_after = TurnInput::ALL.map(after);
                    let worst =
                        states_after.into_iter().min_by(|a, b| level(a).total_cmp(&level(b)));
                    states.push(worst.unwrap());
                }
                states
            };
            let closest = |states: &[JointState]| {
                states.iter().map(JointState::distance_m).fold(f64::INFINITY, f64::min)
            };
            let level = value.value(scene.start().human_seen_by_robot());
            if level <= 0.3 {
                continue;
            }
            let states = pursue(&scene);
            // Decisions in steps instead of at every instant cost less than 0.3 m.
            assert!(closest(&states) > 3.0 + level.min(1.0) - 0.3, "{} {level}", closest(&states));
            let psi = scene.robot.psi;
            turned += usize::from(states.iter().any(|s| wrap_angle(s.robot.psi - psi).abs() > 0.1));
            let straight = Scene { policy: None, ..scene };
            straight_caught += usize::from(closest(&pursue(&straight)) < 3.0);
        }
        assert!(turned > 20 && straight_caught > 20, "{turned} {straight_caught}");
    }

    #[test]
    fn a_robot_that_evades_returns_to_its_goal() {
        let parameters = SceneParameters { steps: 70, ..SceneParameters::default() };
        // The human comes head-on and drives straight past. The goal is 28 m ahead.
        let scene = Scene {
            policy: Some(Box::new(policy(Rule::Evades))),
            ..Scene::new(&parameters, Pose::new(24.0, 1.0, PI), Pose::new(0.0, 0.0, 0.0))
        };
        // The detour takes longer than the trial of a robot that drives straight.
        let states = simulate(&parameters, &scene, &[TurnInput::Straight; 80]);
        let aside = states.iter().map(|state| state.robot.y.abs()).fold(0.0, f64::max);
        let nearest = states
            .iter()
            .map(|state| hypot(state.robot.x - scene.goal[0], state.robot.y - scene.goal[1]))
            .fold(f64::INFINITY, f64::min);
        assert!(aside > 0.3 && nearest < 0.25, "{aside} m aside, {nearest} m from the goal");
    }

    #[test]
    fn complaints_name_the_setting() {
        let parameters = SceneParameters::default();
        for rule in Rule::ALL {
            assert_eq!(policy(rule).check(&parameters), Ok(()));
        }
        let refused = |rule, change: fn(&mut RobotPolicy)| {
            let mut policy = policy(rule);
            change(&mut policy);
            policy.check(&parameters).unwrap_err().to_string()
        };
        let starts = |said: String, field: &str| assert!(said.starts_with(field), "{said}");
        starts(refused(Rule::Straight, |it| it.name = "A b".into()), "name: expected 1 to 40");
        starts(refused(Rule::Straight, |it| it.threshold_m = Some(1.0)), "threshold_m: ");
        starts(refused(Rule::Evades, |it| it.threshold_m = None), "threshold_m: ");
        starts(
            refused(Rule::Evades, |it| it.threshold_m = Some(-3.0)),
            "threshold_m: expected more",
        );
        starts(refused(Rule::Evades, |it| it.threshold_m = Some(f64::NAN)), "threshold_m: ");
        starts(refused(Rule::WayPoints, |it| it.way_points_m.clear()), "way_points_m: ");
        starts(refused(Rule::WayPoints, |it| it.way_points_m[1][0] = 5.0), "way_points_m[1][0]: ");
        starts(refused(Rule::WayPoints, |it| it.way_points_m[1][0] = 20.0), "way_points_m[1][0]: ");
        starts(refused(Rule::WayPoints, |it| it.way_points_m[0][1] = 1e9), "way_points_m[0][1]: ");
        starts(refused(Rule::Script, |it| it.turns[1].until_s = 1.0), "turns[1].until_s: ");
        starts(
            refused(Rule::Script, |it| it.turns[0].turn_rate_radps = 0.6),
            "turns[0].turn_rate_radps: expected a number from -0.5 to 0.5, found 0.6",
        );
        starts(refused(Rule::Script, |it| it.name = "straight".into()), "name: expected another");
        let mut spins = parameters;
        spins.robot.turn_rate_radps = 16.0;
        let said = policy(Rule::Script).check(&spins).unwrap_err().to_string();
        assert!(said.starts_with("rule: expected straight"), "{said}");
        let mut unequal = parameters;
        unequal.robot.speed_mps = 1.5;
        let said = policy(Rule::Evades).check(&unequal).unwrap_err().to_string();
        assert!(said.contains("closed form") && said.contains("1.5 m/s"), "{said}");
    }

    #[test]
    fn robots_are_divided_evenly() {
        for robots in 1..5 {
            for place in 0..20 {
                let mut met = vec![0; robots];
                (0..robots * 3).for_each(|stratum| {
                    met[RobotsVary::Within.robot(robots, place, stratum)] += 1;
                });
                assert!(met.iter().all(|&times| times == 3), "{met:?}");
                let between = RobotsVary::Between.robot(robots, place, 7);
                assert_eq!(between, place as usize % robots);
            }
            // In a stratum, as many participants as there are robots meet different robots.
            for stratum in 0..7 {
                let met = (0..robots as u64).map(|p| RobotsVary::Within.robot(robots, p, stratum));
                let mut met: Vec<usize> = met.collect();
                met.sort_unstable();
                assert!(met.into_iter().eq(0..robots));
            }
        }
    }
}
