//! Synthetic participants, compared with the reference's file and checked against the study's
//! rules.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use sidestep::math::wrap_angle;
use sidestep::scene::{EncounterRange, Scene, SceneParameters, generate};
use sidestep::synthetic::{Keys, SyntheticDrive, SyntheticParticipant};
use sidestep::trial::{flags, simulate};
use sidestep::vehicle::TurnInput;

/// The seed of `tests/data/trials.csv`.
const SEED: u64 = 20_180_918;

/// Rounds a number to the nine significant digits of the file.
fn printed(number: f64) -> f64 {
    format!("{number:.8e}").parse().unwrap()
}

#[test]
fn every_row_of_the_reference() {
    let mut reader = csv::Reader::from_reader(&include_bytes!("../data/trials.csv")[..]);
    let mut rows = reader.deserialize();
    for participant in 0..8 {
        let person = SyntheticParticipant::new(SEED, participant);
        for trial in 0..50 {
            let (scene, drive) = person.own_trial(trial, Keys::Free);
            assert_eq!(drive.states[0], scene.start());
            for (step, (input, state)) in drive.inputs.iter().zip(&drive.states).enumerate() {
                let (h, r) = (state.human, state.robot);
                let turn_rate = 0.5 * f64::from(input.sign());
                let state = [h.x, h.y, h.psi, r.x, r.y, r.psi].map(printed);
                let row: (u64, u64, usize, f64, [f64; 6], f64) = rows.next().unwrap().unwrap();
                let t = printed(0.2 * step as f64);
                assert_eq!(row, (participant, trial, step, t, state, turn_rate));
            }
        }
    }
    assert!(rows.next().is_none());
}

/// The input that the keys select at time `t_ms`.
fn keys_at(drive: &SyntheticDrive, t_ms: f64) -> TurnInput {
    let before = drive.key_changes.iter().take_while(|change| change.at_ms <= t_ms);
    before.last().map_or(TurnInput::Straight, |change| change.input)
}

fn is_a_trial_of_the_study(parameters: &SceneParameters, scene: &Scene, drive: &SyntheticDrive) {
    let SyntheticDrive { inputs, states, sampled_at_ms, key_changes } = drive;
    assert_eq!(inputs.len(), parameters.steps);
    assert_eq!(*states, simulate(parameters, scene, inputs));
    assert_eq!(flags(parameters, scene, inputs, states, sampled_at_ms), []);
    for (&input, &at_ms) in inputs.iter().zip(sampled_at_ms) {
        assert_eq!(input, keys_at(drive, at_ms), "at {at_ms} ms");
    }
    assert!(key_changes.windows(2).all(|pair| pair[0].at_ms < pair[1].at_ms));
    assert!(key_changes.windows(2).all(|pair| pair[0].input != pair[1].input));
}

#[test]
fn drives_on_the_clock_are_trials_of_the_study() {
    let parameters = SceneParameters::default();
    let scenes = generate(&parameters, &EncounterRange::default(), 30, 4).unwrap();
    for participant in 0..4 {
        let person = SyntheticParticipant::new(7, participant);
        for (trial, (scene, _)) in (0..).zip(&scenes) {
            let drive = person.drive(trial, &parameters, scene, Keys::Clock);
            is_a_trial_of_the_study(&parameters, scene, &drive);
            let (scene, drive) = person.own_trial(trial, Keys::Clock);
            is_a_trial_of_the_study(&parameters, &scene, &drive);
        }
    }
}

#[test]
fn studies_of_other_vehicles_and_clocks() {
    let parameters = |step_s, steps| {
        let mut parameters = SceneParameters { step_s, steps, ..SceneParameters::default() };
        parameters.robot.speed_mps = 1.5;
        parameters
    };
    for parameters in [parameters(0.1, 100), parameters(0.03, 300), parameters(0.5, 20)] {
        let scenes = generate(&parameters, &EncounterRange::default(), 5, 4).unwrap();
        let mut turns = 0;
        for (trial, (scene, _)) in (0..).zip(&scenes) {
            let drive =
                SyntheticParticipant::new(1, 0).drive(trial, &parameters, scene, Keys::Clock);
            is_a_trial_of_the_study(&parameters, scene, &drive);
            turns += drive.inputs.iter().filter(|&&input| input != TurnInput::Straight).count();
        }
        assert!(turns > 0);
    }
}

/// Compares keys that act immediately with keys that act at the clock of the study. The scenes are
/// the same, and the behaviour is similar. In the reference, 58 to 72 % of the steps are without a
/// key, and the human enters the danger zone in 15.5 % of the trials.
#[test]
fn the_clock_changes_little() {
    let parameters = SceneParameters::default();
    let measure = |keys| {
        let (mut straight, mut entered, mut trials) = (0, 0, 0.0);
        for participant in 0..8 {
            let person = SyntheticParticipant::new(SEED, participant);
            for trial in 0..50 {
                let (_, drive) = person.own_trial(trial, keys);
                straight += drive.inputs.iter().filter(|&&i| i == TurnInput::Straight).count();
                let near =
                    |s: &sidestep::scene::JointState| s.distance_m() < parameters.danger_radius_m;
                entered += usize::from(drive.states.iter().any(near));
                trials += 1.0;
            }
        }
        (straight as f64 / (50.0 * trials), entered as f64 / trials)
    };
    let (free, clock) = (measure(Keys::Free), measure(Keys::Clock));
    assert!((0.58..0.72).contains(&free.0) && (0.10..0.20).contains(&free.1), "{free:?}");
    assert!((free.0 - clock.0).abs() < 0.03 && (free.1 - clock.1).abs() < 0.05, "{clock:?}");
}

#[test]
fn a_seed_names_its_people() {
    let trial = |seed, number| SyntheticParticipant::new(seed, number).own_trial(3, Keys::Clock);
    assert_eq!(trial(1, 2), trial(1, 2));
    assert_ne!(trial(1, 2).0, trial(1, 3).0);
    assert_ne!(trial(1, 2).0, trial(2, 2).0);
    assert_ne!(SyntheticParticipant::new(1, 2).person, SyntheticParticipant::new(1, 3).person);
    let person = SyntheticParticipant::new(u64::MAX, u64::MAX).person;
    assert!((person.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
}

/// If both vehicles are at the same position, the bearing is undefined. Nevertheless, all states
/// must be finite.
#[test]
fn nothing_becomes_infinite() {
    let parameters = SceneParameters::default();
    let drawn = generate(&parameters, &EncounterRange::default(), 1, 5).unwrap();
    let mut scene = drawn[0].0.clone();
    scene.robot = scene.human;
    let person = SyntheticParticipant::new(1, 0);
    for turned in [0.0, 0.3, 3.0] {
        scene.robot.psi = wrap_angle(scene.human.psi + turned);
        let drive = person.drive(0, &parameters, &scene, Keys::Clock);
        assert!(drive.states.iter().all(|state| state.check().is_ok()));
        is_a_trial_of_the_study(&parameters, &scene, &drive);
    }
}
