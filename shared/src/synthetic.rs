//! Synthetic participants: simulated drivers of the study's vehicle, built from published
//! models, for testing software.
//!
//! This is version 1 of the participant model of the project's learning reference. A delayed, noisy
//! leaky accumulator (after Markkula 2014) integrates three input signals from studies of walking
//! people: minimum predicted distance (Olivier et al. 2012), constancy of bearing (Cutting, Vishton
//! and Braren 1995; Ondřej et al. 2010) and a repeller of distance and angle (Fajen and Warren
//! 2003). The model does not use safety levels. Each person's parameters are a modelling choice,
//! not a measurement, so results on synthetic trials say nothing about people.

mod stream;
mod person;
mod encounter;
mod perception;
mod decision;
mod reference;

pub use person::Person;
pub use reference::{REFERENCE_SEED, provenance, recognised};

use crate::recording::{RecordedParticipant, RecordedTrial};
use crate::scene::{JointState, Scene, SceneParameters};
use crate::trial::{Phase, flags};
use crate::vehicle::{Pose, TurnInput, VehicleModel, dubins};
use decision::Decision;
use stream::Stream;

/// When the vehicle responds to the keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keys {
    /// Immediately. Keys may change within steps, so the states cannot be replayed from one input
    /// per step. Headings are not wrapped.
    Free,
    /// At the start of each step, as in the study. The states are exactly those that
    /// [`JointState::advance`] computes.
    Clock,
}

/// A change of the held key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyChange {
    /// Time after the start of the scene (ms).
    pub at_ms: f64,
    /// The input from that time on.
    pub input: TurnInput,
}

/// A synthetic participant's drive of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticDrive {
    /// The key held at the start of each step.
    pub inputs: Vec<TurnInput>,
    /// The states before each step and after the last step.
    pub states: Vec<JointState>,
    /// When each input was sampled, which is at the start of its step (ms after the scene's start).
    pub sampled_at_ms: Vec<f64>,
    /// Every key change, in chronological order. No key is held before the first change.
    pub key_changes: Vec<KeyChange>,
}

/// Interval between updates of perception and decision (s). The interval in use is rounded so that
/// it divides a step evenly.
const TICK_S: f64 = 0.05;

/// Maximum number of ticks in a step. Steps longer than 50 s have longer ticks.
const MAX_TICKS: f64 = 1000.0;

/// One person of the population that a seed generates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SyntheticParticipant {
    seed: u64,
    number: u64,
    /// This person's parameters.
    pub person: Person,
}

impl SyntheticParticipant {
    /// Person `number` (from 0) of `seed`'s population. A person does not depend on the size of the
    /// population.
    #[must_use]
    pub fn new(seed: u64, number: u64) -> Self {
        Self { seed, number, person: Person::draw(&mut Stream::of_person(seed, number)) }
    }

    /// Draws the scene of trial `trial` (from 0) of the paper's study in the same way as the
    /// reference, and simulates this person's drive. With [`Keys::Free`] and seed 20180918, the
    /// result is the reference's drive.
    #[must_use]
    pub fn own_trial(&self, trial: u64, keys: Keys) -> (Scene, SyntheticDrive) {
        let parameters = SceneParameters::default();
        let (scene, stream) = self.own_scene(&parameters, trial);
        let drive = self.drive_on(stream, &parameters, &scene, keys);
        (scene, drive)
    }

    /// The scene of [`Self::own_trial`], and the random stream of the drive.
    fn own_scene(&self, parameters: &SceneParameters, trial: u64) -> (Scene, Stream) {
        let mut stream = Stream::of_trial(self.seed, self.number, trial);
        (encounter::draw(parameters, &mut stream), stream)
    }

    /// The first `tasks` trials of the paper's study ([`Self::own_trial`]), as part of a recording.
    #[must_use]
    pub fn recorded(&self, tasks: u64, keys: Keys) -> RecordedParticipant {
        let parameters = SceneParameters::default();
        let trial = |number| {
            let (scene, drive) = self.own_trial(number, keys);
            let SyntheticDrive { inputs, states, sampled_at_ms, .. } = drive;
            RecordedTrial {
                line: None,
                number,
                phase: Phase::Task,
                attempt: 1,
                trial_id: None,
                flags: flags(&parameters, &scene, &inputs, &states, &sampled_at_ms),
                inputs,
                states,
                started_at_ms: None,
                sampled_at_ms: Some(sampled_at_ms),
                robot: None,
            }
        };
        RecordedParticipant {
            name: self.number.to_string(),
            line: None,
            trials: (0..tasks).map(trial).collect(),
            marked_synthetic: true,
        }
    }

    /// Drives a given scene with the random numbers of this person's trial `trial`.
    #[must_use]
    pub fn drive(
        &self,
        trial: u64,
        parameters: &SceneParameters,
        scene: &Scene,
        keys: Keys,
    ) -> SyntheticDrive {
        let stream = Stream::of_trial(self.seed, self.number, trial);
        self.drive_on(stream, parameters, scene, keys)
    }

    fn drive_on(
        &self,
        stream: Stream,
        parameters: &SceneParameters,
        scene: &Scene,
        keys: Keys,
    ) -> SyntheticDrive {
        let step_ms = 1000.0 * parameters.step_s;
        let ticks = (parameters.step_s / TICK_S).round().clamp(1.0, MAX_TICKS);
        let tick_s = parameters.step_s / ticks;
        let mut decision = Decision::new(self.person, parameters, tick_s, stream);
        let mut drive = SyntheticDrive {
            inputs: Vec::with_capacity(parameters.steps),
            states: Vec::with_capacity(parameters.steps + 1),
            sampled_at_ms: Vec::with_capacity(parameters.steps),
            key_changes: Vec::new(),
        };
        let (mut state, mut key) = (scene.start(), TurnInput::Straight);
        drive.states.push(state);
        for step in 0..parameters.steps {
            let (begin, begin_ms) = (state, step as f64 * step_ms);
            let robot_radps = scene.robot_turn_rate(parameters, &drive.states);
            let mut held = key;
            for tick in 0..ticks as usize {
                let t_s = (step * ticks as usize + tick) as f64 * tick_s;
                let next = decision.key(t_s, &state);
                if next != key {
                    let at_ms = begin_ms + tick as f64 * step_ms / ticks;
                    drive.key_changes.push(KeyChange { at_ms, input: next });
                    key = next;
                }
                if tick == 0 {
                    held = key;
                }
                state = match keys {
                    Keys::Free => advance_unwrapped(parameters, state, key, robot_radps, tick_s),
                    Keys::Clock => {
                        let gone = (tick + 1) as f64 * tick_s;
                        begin.advance(parameters, held, robot_radps, gone)
                    }
                };
            }
            if keys == Keys::Clock {
                // Advances over the whole step in one call, because the sum of its ticks can differ
                // from `step_s` in the last digit.
                state = begin.advance(parameters, held, robot_radps, parameters.step_s);
            }
            drive.inputs.push(held);
            drive.states.push(state);
            drive.sampled_at_ms.push(begin_ms);
        }
        drive
    }
}

/// Like [`JointState::advance`], but without wrapping the headings, as in the reference.
fn advance_unwrapped(
    parameters: &SceneParameters,
    state: JointState,
    input: TurnInput,
    robot_radps: f64,
    seconds: f64,
) -> JointState {
    let along = |vehicle: &VehicleModel, pose: Pose, rate: f64| {
        let arc = dubins::arc(pose, vehicle.speed_mps, rate, seconds);
        Pose { psi: pose.psi + rate * seconds, ..arc }
    };
    JointState {
        human: along(&parameters.human, state.human, parameters.human.turn_rate(input)),
        robot: along(&parameters.robot, state.robot, robot_radps),
    }
}
