//! Admissibility of scenes.
//!
//! [`is_admissible`] is the definition. It simulates each escape step by step, like a trial.
//! [`SceneRules`] makes the same decision hundreds of times faster, from the geometry of straight
//! lines and one turn. Where rounding errors could matter, it calls the definition, so that the
//! scenes of a seed stay the same, bit for bit.

use super::assigned::Scene;
use super::parameters::{Evader, SceneParameters};
use super::range::EncounterRange;
use super::state::{JointState, SAMPLES_PER_STEP, closest_within_step};
use crate::math::{hypot, sin_cos};
use crate::reachability::ExactValue;
use crate::vehicle::{Pose, TurnInput};

/// An escape is one turn that starts after the delay and is held for a whole number of seconds,
/// from 1 to this maximum.
const LONGEST_ESCAPE_S: usize = 5;

/// The step in which an escape begins, and the number of steps in a second, which is at least one.
fn escape_steps(parameters: &SceneParameters, range: &EncounterRange) -> (usize, usize) {
    let begin = (range.escape_delay_s / parameters.step_s).ceil() as usize;
    let second = (1.0 / parameters.step_s).round().max(1.0) as usize;
    (begin, second)
}

/// Whether a scene is admissible with a robot that drives straight: it starts outside the danger zone with time to react, the human
/// enters the zone if they do not turn, and the human can escape.
#[must_use]
pub fn is_admissible(parameters: &SceneParameters, range: &EncounterRange, scene: &Scene) -> bool {
    let distance = scene.start().distance_m();
    if distance < range.min_start_distance_m || distance > range.max_start_distance_m {
        return false;
    }
    let radius = parameters.danger_radius_m;
    if closest_with_manoeuvre(parameters, scene, TurnInput::Straight, 0, 0) > radius {
        return false;
    }
    // Drawing scenes must not wait until V_HR is solved numerically. If V_HR has no closed form,
    // only the search for an escape below decides.
    if let Ok(value) = parameters.game(Evader::Human).exact()
        && value.value(scene.start().robot_seen_by_human()) <= 0.0
    {
        return false;
    }
    let (begin, second) = escape_steps(parameters, range);
    (1..=LONGEST_ESCAPE_S).any(|seconds| {
        [TurnInput::Left, TurnInput::Right].into_iter().any(|input| {
            let end = begin.saturating_add(second.saturating_mul(seconds));
            closest_with_manoeuvre(parameters, scene, input, begin, end)
                > radius + range.escape_clearance_m
        })
    })
}

/// Smallest distance (m) if the human turns with `input` from step `begin` to step `end` and
/// otherwise drives straight on.
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
        closest = closest.min(closest_within_step(parameters, state, held, 0.0));
        state = state.advance(parameters, held, 0.0, parameters.step_s);
    }
    closest
}

/// Tolerance relative to the lengths of a scene. It is far above the rounding errors of 3000 steps
/// (about 10⁻¹¹).
const ROUNDING: f64 = 1e-9;

/// The result of comparing all sampled distances of a part of a drive with a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Distances {
    /// All distances are greater than the limit.
    Above,
    /// At least one distance is smaller than the limit.
    Below,
    /// One distance is so close to the limit that rounding errors could change the result.
    Unclear,
}

/// The rules of [`is_admissible`], with precomputed values that all scenes share.
///
/// The rules work in the human's frame at the start (x ahead, y to the left), in which all escapes
/// to one side follow the same path until they end.
#[derive(Clone, Debug)]
pub struct SceneRules<'a> {
    parameters: &'a SceneParameters,
    range: &'a EncounterRange,
    /// V_HR, if it has a closed form.
    value: Option<ExactValue>,
    /// The step in which an escape begins.
    begin: usize,
    /// Number of steps in a second.
    second: usize,
    /// The human at the beginning of each step of a turn to the left.
    turn: Vec<Placed>,
    /// The displacement (ahead and left, m) at each sample within a step of this turn.
    within_step: [[f64; 2]; SAMPLES_PER_STEP + 1],
}

/// A vehicle with the cosine and sine of its heading.
#[derive(Clone, Copy, Debug)]
struct Placed {
    position: [f64; 2],
    heading: [f64; 2],
}

impl Placed {
    fn of(pose: Pose) -> Self {
        let (sin, cos) = sin_cos(pose.psi);
        Self { position: pose.position(), heading: [cos, sin] }
    }

    /// The vehicle's mirror image about the line of the human's initial heading.
    fn mirrored(self) -> Self {
        let ([x, y], [cos, sin]) = (self.position, self.heading);
        Self { position: [x, -y], heading: [cos, -sin] }
    }

    /// The vehicle after it has driven straight for `way_m` metres.
    fn ahead(self, way_m: f64) -> Self {
        let ([x, y], [cos, sin]) = (self.position, self.heading);
        Self { position: [x + way_m * cos, y + way_m * sin], heading: self.heading }
    }
}

impl<'a> SceneRules<'a> {
    /// The rules of a study.
    #[must_use]
    pub fn new(parameters: &'a SceneParameters, range: &'a EncounterRange) -> Self {
        let human = &parameters.human;
        let (begin, second) = escape_steps(parameters, range);
        let begin = begin.min(parameters.steps);
        let turning = second.saturating_mul(LONGEST_ESCAPE_S).min(parameters.steps - begin);
        let start = Pose::new(human.speed_mps * begin as f64 * parameters.step_s, 0.0, 0.0);
        let turned = |from, seconds| human.advance(from, TurnInput::Left, seconds);
        let turn = (0..=turning).map(|step| turned(start, step as f64 * parameters.step_s));
        let within_step = std::array::from_fn(|sample| {
            let share = sample as f64 / SAMPLES_PER_STEP as f64;
            turned(Pose::new(0.0, 0.0, 0.0), share * parameters.step_s).position()
        });
        Self {
            parameters,
            range,
            value: parameters.game(Evader::Human).exact().ok(),
            begin,
            second,
            turn: turn.map(Placed::of).collect(),
            within_step,
        }
    }

    /// The same decision as [`is_admissible`].
    #[must_use]
    pub fn admit(&self, scene: &Scene) -> bool {
        let start = scene.start();
        let distance = start.distance_m();
        let range = self.range;
        if distance < range.min_start_distance_m || distance > range.max_start_distance_m {
            return false;
        }
        let clear = self.judge(&start);
        clear.unwrap_or_else(|| is_admissible(self.parameters, self.range, scene))
    }

    /// The decision for a start at an admissible distance. Returns `None` if rounding errors could
    /// change the decision.
    fn judge(&self, start: &JointState) -> Option<bool> {
        let parameters = self.parameters;
        let relative = start.robot_seen_by_human();
        let human = Placed::of(Pose::new(0.0, 0.0, 0.0));
        let robot = Placed::of(Pose::from(relative));
        let margin = self.rounding_m(start);

        let radius = parameters.danger_radius_m;
        match self.straight([human, robot], parameters.steps, radius, margin) {
            Distances::Above => return Some(false),
            Distances::Below => {}
            Distances::Unclear => return None,
        }
        let limit = radius + self.range.escape_clearance_m;
        match self.straight([human, robot], self.begin, limit, margin) {
            Distances::Above => {}
            Distances::Below => return Some(false),
            Distances::Unclear => return None,
        }
        if self.value.is_some_and(|value| value.value(relative) <= 0.0) {
            return Some(false);
        }
        let robot = robot.ahead(parameters.robot.speed_mps * self.begin_s());
        let sides = [robot, robot.mirrored()].map(|robot| self.escape(robot, limit, margin));
        if sides.contains(&Distances::Above) {
            Some(true)
        } else if sides.contains(&Distances::Unclear) {
            None
        } else {
            Some(false)
        }
    }

    /// Time at which an escape begins (s).
    fn begin_s(&self) -> f64 {
        self.begin as f64 * self.parameters.step_s
    }

    /// Time between two sampled distances (s).
    fn sample_s(&self) -> f64 {
        self.parameters.step_s / SAMPLES_PER_STEP as f64
    }

    /// Bound on the rounding error of a distance, in this type and in [`is_admissible`] (m).
    fn rounding_m(&self, start: &JointState) -> f64 {
        let SceneParameters { human, robot, .. } = self.parameters;
        let duration_s = self.parameters.duration_s();
        let [hx, hy] = start.human.position().map(f64::abs);
        let [rx, ry] = start.robot.position().map(f64::abs);
        let lengths = hx + hy + rx + ry + (human.speed_mps + robot.speed_mps) * duration_s;
        let angles =
            start.human.psi.abs() + start.robot.psi.abs() + human.turn_rate_radps * duration_s;
        ROUNDING * lengths * (1.0 + angles)
    }

    /// Compares the distances with the limit while both vehicles drive straight for `steps` steps.
    /// The squared distance is a parabola, so the closest sample is next to its vertex.
    fn straight(
        &self,
        [human, robot]: [Placed; 2],
        steps: usize,
        limit: f64,
        margin: f64,
    ) -> Distances {
        let [x, y] = difference(robot.position, human.position);
        let way = |placed: Placed, speed: f64| placed.heading.map(|part| speed * part);
        let [wx, wy] = difference(
            way(robot, self.parameters.robot.speed_mps),
            way(human, self.parameters.human.speed_mps),
        );
        let square = wx * wx + wy * wy;
        let vertex_s = if square > 0.0 { -(x * wx + y * wy) / square } else { 0.0 };
        let last = (steps * SAMPLES_PER_STEP) as f64;
        let before = (vertex_s / self.sample_s()).clamp(0.0, last).floor();
        let after = (before + 1.0).min(last);
        let closest = [before, after]
            .map(|sample| sample * self.sample_s())
            .map(|s| hypot(x + s * wx, y + s * wy));
        compare(closest[0].min(closest[1]), limit, margin)
    }

    /// Compares the distances of the best escape to the left with the limit. Returns `Above` if all
    /// distances of one escape are above the limit. `robot` is the robot at the start of the
    /// escape.
    fn escape(&self, robot: Placed, limit: f64, margin: f64) -> Distances {
        let SceneParameters { human, robot: model, .. } = self.parameters;
        let closing_m = (human.speed_mps + model.speed_mps) * self.sample_s();
        let robot_at =
            |sample: usize| robot.ahead(model.speed_mps * sample as f64 * self.sample_s());
        let mut best = Distances::Below;
        let mut sample = 0;
        for seconds in 1..=LONGEST_ESCAPE_S {
            let end = (self.second.saturating_mul(seconds)).min(self.turn.len() - 1);
            while sample <= end * SAMPLES_PER_STEP {
                let [x, y] = difference(robot_at(sample).position, self.turned(sample));
                let distance = hypot(x, y);
                match compare(distance, limit, margin) {
                    Distances::Above => {}
                    // Longer turns pass through this point, too, so they are no better.
                    Distances::Below => return best,
                    Distances::Unclear => return Distances::Unclear,
                }
                // During the next `free` samples, the vehicles cannot come as close as the limit.
                let free = (distance - limit - margin) / closing_m;
                sample = sample.saturating_add((free as usize).max(1));
            }
            let both = [self.turn[end], robot_at(end * SAMPLES_PER_STEP)];
            let left = self.parameters.steps - self.begin - end;
            match self.straight(both, left, limit, margin) {
                Distances::Above => return Distances::Above,
                Distances::Below => {}
                Distances::Unclear => best = Distances::Unclear,
            }
        }
        best
    }

    /// The human's position `sample` samples after the start of the turn to the left.
    fn turned(&self, sample: usize) -> [f64; 2] {
        let Placed { position: [x, y], heading: [cos, sin] } = self.turn[sample / SAMPLES_PER_STEP];
        let [ahead, left] = self.within_step[sample % SAMPLES_PER_STEP];
        [x + cos * ahead - sin * left, y + sin * ahead + cos * left]
    }
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Compares a smallest distance, whose error is at most `margin`, with the limit. Returns `Unclear`
/// for NaN.
fn compare(closest: f64, limit: f64, margin: f64) -> Distances {
    if closest > limit + margin {
        Distances::Above
    } else if closest < limit - margin {
        Distances::Below
    } else {
        Distances::Unclear
    }
}

#[cfg(test)]
mod tests {
    use super::super::encounter::{Encounter, place};
    use super::*;
    use crate::math::SeededRng;
    use crate::vehicle::VehicleModel;

    /// Random vehicles, danger radius and steps.
    fn study(rng: &mut SeededRng) -> SceneParameters {
        let mut vehicle = || VehicleModel {
            speed_mps: rng.uniform(0.5, 4.0),
            turn_rate_radps: rng.uniform(0.05, 2.0),
        };
        let (human, robot) = (vehicle(), vehicle());
        SceneParameters {
            human,
            robot,
            danger_radius_m: rng.uniform(0.5, 4.0),
            step_s: rng.uniform(0.1, 1.3),
            steps: 1 + rng.below(40),
        }
    }

    fn encounter(parameters: &SceneParameters, rng: &mut SeededRng) -> Scene {
        let encounter = Encounter {
            approach_rad: rng.uniform(-3.1, 3.1),
            miss_m: parameters.danger_radius_m * rng.uniform(-1.1, 1.1),
            entry_s: rng.uniform(0.5, 9.0),
        };
        place(parameters, encounter, rng.uniform(-3.1, 3.1))
    }

    #[test]
    fn the_fast_answer_is_the_plain_one() {
        let mut rng = SeededRng::new(3);
        let range = EncounterRange {
            min_start_distance_m: 0.0,
            max_start_distance_m: 60.0,
            ..EncounterRange::default()
        };
        let (mut judged, mut admitted) = (0, 0);
        for _ in 0..60 {
            let parameters = study(&mut rng);
            let rules = SceneRules::new(&parameters, &range);
            for _ in 0..10 {
                let scene = encounter(&parameters, &mut rng);
                let plain = is_admissible(&parameters, &range, &scene);
                assert_eq!(rules.admit(&scene), plain, "{parameters:?} {scene:?}");
                judged += usize::from(rules.judge(&scene.start()).is_some());
                admitted += usize::from(plain);
            }
        }
        assert!(judged >= 599, "{judged}");
        assert!((100..500).contains(&admitted), "{admitted}");
    }

    #[test]
    fn what_rounding_decides_is_left_to_the_plain_rules() {
        let parameters = SceneParameters::default();
        let range = EncounterRange::default();
        let rules = SceneRules::new(&parameters, &range);
        // The human just touches the danger zone, at a sampled instant.
        let encounter = Encounter { approach_rad: 2.0, miss_m: 3.0, entry_s: 5.0 };
        let scene = place(&parameters, encounter, 0.4);
        assert_eq!(rules.judge(&scene.start()), None);
        assert_eq!(rules.admit(&scene), is_admissible(&parameters, &range, &scene));
        let unknown = JointState { human: Pose::from([f64::NAN, 0.0, 0.0]), ..scene.start() };
        assert_eq!(rules.judge(&unknown), None);
    }
}
