//! Trials: a driven scene, its replay, its outcome and its flags.

#[cfg(feature = "study")]
mod fingerprint;
mod flag;
mod record;

use crate::math::{hypot, wrap_angle};
use crate::scene::{JointState, Scene, SceneParameters, closest_within_step};
use crate::vehicle::TurnInput;
#[cfg(feature = "study")]
pub use fingerprint::simulation_fingerprint;
pub use flag::Flag;
pub use record::{FASTEST_PRESSES, LAST_MS, Record, RecordedKey, is_right_clock};
use serde::{Deserialize, Serialize};

/// The part of a study that a scene belongs to. Only tasks are analysed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Getting used to the keys and the vehicle.
    Familiarisation,
    /// Scenes like the tasks, but not analysed.
    Practice,
    /// The analysed scenes.
    Task,
}

impl Phase {
    /// Every phase, in the order of a study.
    pub const ALL: [Self; 3] = [Self::Familiarisation, Self::Practice, Self::Task];

    /// The word in files, rows and on the wire.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Familiarisation => "familiarisation",
            Self::Practice => "practice",
            Self::Task => "task",
        }
    }

    /// The phase with this word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|phase| phase.word() == word)
    }
}

/// Simulates `inputs` in `scene`. Returns the states before each step and after the last step, one
/// more than inputs.
#[must_use]
pub fn simulate(
    parameters: &SceneParameters,
    scene: &Scene,
    inputs: &[TurnInput],
) -> Vec<JointState> {
    let mut states = Vec::with_capacity(inputs.len() + 1);
    let mut state = scene.start();
    states.push(state);
    for &input in inputs {
        let robot_radps = scene.robot_turn_rate(parameters, &states);
        state = state.advance(parameters, input, robot_radps, parameters.step_s);
        states.push(state);
    }
    states
}

/// A comparison of recorded states with the states replayed from the inputs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Replay {
    /// Whether all numbers agree bit for bit.
    pub exact: bool,
    /// Index of the first state that differs, if any.
    pub first_difference: Option<usize>,
    /// Largest distance between a recorded and a replayed position (m).
    pub max_position_error_m: f64,
    /// Largest difference between a recorded and a replayed heading (rad).
    pub max_heading_error_rad: f64,
}

/// Replays `inputs` in `scene` and compares the result with the recorded `states`.
#[must_use]
pub fn verify(
    parameters: &SceneParameters,
    scene: &Scene,
    inputs: &[TurnInput],
    states: &[JointState],
) -> Replay {
    compare(&simulate(parameters, scene, inputs), states)
}

/// Compares `replayed` states with the recorded `states`.
pub(crate) fn compare(replayed: &[JointState], states: &[JointState]) -> Replay {
    let bits =
        |s: &JointState| [s.human, s.robot].map(|pose| <[f64; 3]>::from(pose).map(f64::to_bits));
    let first_difference = (0..replayed.len().max(states.len()))
        .find(|&i| replayed.get(i).map(bits) != states.get(i).map(bits));
    let poses =
        replayed.iter().zip(states).flat_map(|(a, b)| [(a.human, b.human), (a.robot, b.robot)]);
    let (mut position, mut heading) = (0.0f64, 0.0f64);
    for (a, b) in poses {
        position = position.max(hypot(a.x - b.x, a.y - b.y));
        heading = heading.max(wrap_angle(a.psi - b.psi).abs());
    }
    Replay {
        exact: first_difference.is_none(),
        first_difference,
        max_position_error_m: position,
        max_heading_error_rad: heading,
    }
}

/// The outcome of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Outcome {
    /// Smallest distance between the vehicles (m).
    pub closest_m: f64,
    /// First step in which the human was in the danger zone, if any.
    pub first_step_in_danger: Option<usize>,
    /// First and last step in which the human turned, if any.
    pub avoidance: Option<(usize, usize)>,
}

/// Upper bound on the rounding error of a distance between coordinates of at most
/// [`Pose::MOST`](crate::vehicle::Pose::MOST) (m).
const ROUNDING_M: f64 = 1e-6;

/// The outcome of `inputs` along `states`. There is one more state than inputs. Within a step, the
/// robot turns evenly from one state to the next.
#[must_use]
pub fn outcome(
    parameters: &SceneParameters,
    inputs: &[TurnInput],
    states: &[JointState],
) -> Outcome {
    outcome_with(parameters, inputs, states, |state, next| {
        state.robot_turned(next) / parameters.step_s
    })
}

/// Like [`outcome`], but as if the robot drove straight within each step. This was the outcome of
/// recorded states before robots could turn.
#[must_use]
pub fn outcome_of_straight_robot(
    parameters: &SceneParameters,
    inputs: &[TurnInput],
    states: &[JointState],
) -> Outcome {
    outcome_with(parameters, inputs, states, |_, _| 0.0)
}

/// The outcome if the robot's turn rate (rad/s) between two states is `robot_radps`.
fn outcome_with(
    parameters: &SceneParameters,
    inputs: &[TurnInput],
    states: &[JointState],
    robot_radps: impl Fn(&JointState, &JointState) -> f64,
) -> Outcome {
    let start_m = states.first().map_or(f64::INFINITY, JointState::distance_m);
    // Skip steps that begin farther away than `far_m`, which are most steps of a trial. A step can
    // reduce the distance by at most `nearer_m`, so such a step can neither contain the minimum nor
    // enter the danger zone.
    let within = || states.iter().zip(inputs);
    let far_m = if cfg!(target_arch = "wasm32") {
        // The client computes few outcomes, so small code is more important than speed.
        f64::INFINITY
    } else {
        let least_m = within().map(|(state, _)| state.distance_m()).fold(start_m, f64::min);
        let speed_mps = parameters.human.speed_mps.abs() + parameters.robot.speed_mps.abs();
        let nearer_m = speed_mps * parameters.step_s + ROUNDING_M;
        least_m.max(parameters.danger_radius_m) + nearer_m
    };
    let (mut closest_m, mut first_step_in_danger) = (start_m, None);
    for (step, (&state, &input)) in within().enumerate() {
        if state.distance_m() > far_m {
            continue;
        }
        let turned = states.get(step + 1).map_or(0.0, |next| robot_radps(&state, next));
        let closest = closest_within_step(parameters, state, input, turned);
        closest_m = closest_m.min(closest);
        if closest <= parameters.danger_radius_m && first_step_in_danger.is_none() {
            first_step_in_danger = Some(step);
        }
    }
    let turns = |input: &TurnInput| *input != TurnInput::Straight;
    let avoidance = inputs.iter().position(turns).zip(inputs.iter().rposition(turns));
    Outcome { closest_m, first_step_in_danger, avoidance }
}

/// If an input was sampled more than this late (ms), the trial is flagged as interrupted.
pub const INTERRUPTED_MS: f64 = 100.0;

/// A median frame rate below this is flagged (Hz).
pub const LOW_FRAME_RATE_HZ: f64 = 30.0;

/// An event of the page during a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PageEventKind {
    /// The window lost the keyboard focus.
    FocusLost,
    /// The window regained the keyboard focus.
    FocusGained,
    /// The tab was hidden.
    Hidden,
    /// The tab became visible again.
    Shown,
    /// The window's size or the page's zoom changed.
    Resized,
    /// The page left full-screen mode.
    FullscreenLeft,
    /// The page entered full-screen mode.
    FullscreenEntered,
}

/// An event of the page during a scene, with its time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PageEvent {
    /// Time after the scene's start (ms).
    pub t_ms: f64,
    /// Type of the event.
    pub kind: PageEventKind,
}

/// The flags from the page's record of a trial. `exposures` is the number of times that the scene
/// was shown, including the recorded showing; `frame_gap_median_ms` is the median time between
/// frames, if known.
#[must_use]
pub fn page_flags(
    parameters: &SceneParameters,
    sampled_at_ms: &[f64],
    exposures: u32,
    page_events: &[PageEvent],
    frame_gap_median_ms: Option<f64>,
) -> Vec<Flag> {
    let seen = |kinds: &[PageEventKind]| {
        page_events.iter().any(|event| event.t_ms >= 0.0 && kinds.contains(&event.kind))
    };
    let step_ms = parameters.step_s * 1000.0;
    let late = sampled_at_ms.iter().enumerate().map(|(step, at)| at - step as f64 * step_ms);
    let latest = late.fold(0.0, f64::max);
    let stalled = latest > INTERRUPTED_MS;
    let unfocused = seen(&[PageEventKind::FocusLost, PageEventKind::Hidden]);
    let shown_before = exposures > 1;
    [
        (latest > LATE_SAMPLE_MS, Flag::LateSample),
        (stalled || unfocused || shown_before, Flag::Interrupted),
        (unfocused, Flag::FocusLost),
        (shown_before, Flag::ShownBefore),
        (seen(&[PageEventKind::Resized]), Flag::Resized),
        (seen(&[PageEventKind::FullscreenLeft]), Flag::LeftFullscreen),
        (
            frame_gap_median_ms.is_some_and(|gap| gap > 1000.0 / LOW_FRAME_RATE_HZ),
            Flag::LowFrameRate,
        ),
    ]
    .into_iter()
    .filter_map(|(seen, flag)| seen.then_some(flag))
    .collect()
}

/// If the time at which an input was sampled differs from its due time by more than this (ms), the
/// trial is flagged. Both times are relative to the scene's start if the page recorded it, otherwise
/// to the first sample.
pub const LATE_SAMPLE_MS: f64 = 50.0;

/// The flags of a trial in the assigned `scene`.
#[must_use]
pub fn flags(
    parameters: &SceneParameters,
    scene: &Scene,
    inputs: &[TurnInput],
    states: &[JointState],
    sampled_at_ms: &[f64],
) -> Vec<Flag> {
    let start_differs = states.first() != Some(&scene.start());
    let recorded_start = states.first().copied().unwrap_or_else(|| scene.start());
    let driven = scene.starting_at(recorded_start);
    let replay_differs = !verify(parameters, &driven, inputs, states).exact;
    let origin = sampled_at_ms.first().copied().unwrap_or(0.0);
    let late = sampled_at_ms.iter().enumerate().any(|(step, at)| {
        let due = step as f64 * parameters.step_s * 1000.0;
        (at - origin - due).abs() > LATE_SAMPLE_MS
    });
    [
        (start_differs, Flag::StartMismatch),
        (replay_differs, Flag::ReplayMismatch),
        (late, Flag::LateSample),
    ]
    .into_iter()
    .filter_map(|(seen, flag)| seen.then_some(flag))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::SeededRng;
    use crate::scene::{EncounterRange, generate};
    use crate::vehicle::Pose;

    fn driven() -> (SceneParameters, Scene, Vec<TurnInput>, Vec<JointState>) {
        let parameters = SceneParameters::default();
        let drawn = generate(&parameters, &EncounterRange::default(), 1, 5).unwrap();
        let scene = drawn[0].0.clone();
        let mut inputs = vec![TurnInput::Straight; 50];
        inputs[10..30].fill(TurnInput::Left);
        let states = simulate(&parameters, &scene, &inputs);
        (parameters, scene, inputs, states)
    }

    fn on_time() -> Vec<f64> {
        (0..50).map(|step| f64::from(step) * 200.0 + 3.0).collect()
    }

    #[test]
    fn what_interrupts_a_trial_is_flagged() {
        use PageEventKind::{FocusLost, FullscreenLeft, Resized};
        let parameters = SceneParameters::default();
        let due: Vec<f64> = (0..50).map(|step| f64::from(step) * 200.0).collect();
        let mut stalled = due.clone();
        stalled[49] += 101.0;
        let at = |t_ms, kind| PageEvent { t_ms, kind };
        let check = |sampled: &[f64], exposures, events: &[PageEvent], gap, expected: &[Flag]| {
            assert_eq!(page_flags(&parameters, sampled, exposures, events, gap), expected);
        };
        check(&due, 1, &[], Some(16.7), &[]);
        check(&stalled, 1, &[], None, &[Flag::LateSample, Flag::Interrupted]);
        // Sample 20 is late relative to the scene's start, but only by 30 ms more than the first
        // sample.
        let mut late = due.clone();
        late[0] += 30.0;
        late[20] += 60.0;
        check(&late, 1, &[], None, &[Flag::LateSample]);
        check(&due, 2, &[], None, &[Flag::Interrupted, Flag::ShownBefore]);
        check(&due, 1, &[at(3.0, FocusLost)], None, &[Flag::Interrupted, Flag::FocusLost]);
        check(&due, 1, &[at(-3.0, FocusLost)], None, &[]);
        let seen = [at(3.0, Resized), at(4.0, FullscreenLeft)];
        let expected = [Flag::Resized, Flag::LeftFullscreen, Flag::LowFrameRate];
        check(&due, 1, &seen, Some(50.0), &expected);
    }

    #[test]
    fn an_honest_recording_replays_exactly() {
        let (parameters, scene, inputs, states) = driven();
        let replay = verify(&parameters, &scene, &inputs, &states);
        assert!(replay.exact);
        assert_eq!(replay.max_position_error_m, 0.0);
        assert_eq!(flags(&parameters, &scene, &inputs, &states, &on_time()), []);
        assert_eq!(outcome(&parameters, &inputs, &states).avoidance, Some((10, 29)));
    }

    #[test]
    fn a_changed_bit_is_noticed() {
        let (parameters, scene, inputs, mut states) = driven();
        states[17].human.x = f64::from_bits(states[17].human.x.to_bits() + 1);
        let replay = verify(&parameters, &scene, &inputs, &states);
        assert_eq!(replay.first_difference, Some(17));
        assert_eq!(
            flags(&parameters, &scene, &inputs, &states, &on_time()),
            [Flag::ReplayMismatch]
        );
    }

    #[test]
    fn another_start_and_late_samples_are_flagged() {
        let (parameters, scene, inputs, _) = driven();
        let mut start = scene.start();
        start.human.x += 1.0;
        let states = simulate(&parameters, &scene.starting_at(start), &inputs);
        let mut sampled = on_time();
        sampled[20] += 60.0;
        assert_eq!(
            flags(&parameters, &scene, &inputs, &states, &sampled),
            [Flag::StartMismatch, Flag::LateSample]
        );
    }

    #[test]
    fn states_survive_json_bit_for_bit() {
        let (_, _, _, states) = driven();
        let text = serde_json::to_string(&states).unwrap();
        assert_eq!(serde_json::from_str::<Vec<JointState>>(&text).unwrap(), states);
    }

    /// The reference implementation, which samples every step.
    fn plain_outcome(
        parameters: &SceneParameters,
        inputs: &[TurnInput],
        states: &[JointState],
    ) -> (f64, Option<usize>) {
        let steps = states.windows(2).zip(inputs);
        let closest_in = |(pair, &input): (&[JointState], &TurnInput)| {
            let robot_radps = pair[0].robot_turned(&pair[1]) / parameters.step_s;
            closest_within_step(parameters, pair[0], input, robot_radps)
        };
        let closest: Vec<f64> = steps.map(closest_in).collect();
        let least = closest.iter().copied().fold(states[0].distance_m(), f64::min);
        (least, closest.iter().position(|closest| *closest <= parameters.danger_radius_m))
    }

    #[test]
    fn steps_that_are_left_out_change_no_outcome() {
        let mut rng = SeededRng::new(3);
        for case in 0..2000 {
            let speed_mps = [2.0, 0.3, 40.0][case % 3];
            let mut parameters = SceneParameters::default();
            parameters.human.speed_mps = speed_mps;
            parameters.danger_radius_m = rng.uniform(0.1, 12.0);
            let far = if case % 5 == 0 { 1e6 } else { 0.0 };
            let mut pose = || {
                let [x, y] = [(); 2].map(|()| far + rng.uniform(-15.0, 15.0));
                Pose::new(x, y, rng.uniform(-4.0, 4.0))
            };
            let start = JointState { human: pose(), robot: pose() };
            let inputs: Vec<_> = (0..50).map(|_| TurnInput::ALL[rng.below(3)]).collect();
            let scene = Scene::new(&parameters, start.human, start.robot);
            let mut states = simulate(&parameters, &scene, &inputs);
            if case % 4 == 0 {
                // States of a file need not follow from its inputs.
                states[rng.below(51)].human.x += rng.uniform(-20.0, 20.0);
            }
            let found = outcome(&parameters, &inputs, &states);
            let found = (found.closest_m, found.first_step_in_danger);
            assert_eq!(found, plain_outcome(&parameters, &inputs, &states), "{case}");
        }
        let parameters = SceneParameters::default();
        assert_eq!(outcome(&parameters, &[], &[]).closest_m, f64::INFINITY);
    }

    #[test]
    fn driving_on_enters_the_danger_zone() {
        let (parameters, scene, ..) = driven();
        let inputs = vec![TurnInput::Straight; 50];
        let states = simulate(&parameters, &scene, &inputs);
        let outcome = outcome(&parameters, &inputs, &states);
        assert!(outcome.closest_m <= 3.0);
        assert!(outcome.first_step_in_danger.unwrap() >= 9);
        assert_eq!(outcome.avoidance, None);
    }
}
