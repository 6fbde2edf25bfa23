//! Every model can be fitted to any driver: random drivers, drivers whose rules features separate
//! perfectly, drivers who rarely turn, and drivers with few tasks.

// Clippy permits `unwrap` in `#[test]` functions. Helpers outside them are also test code.
#![allow(clippy::unwrap_used)]

use sidestep::comparison::fit::fit;
use sidestep::comparison::models::{Grids, ModelName};
use sidestep::comparison::sets::NamedSet;
use sidestep::comparison::split::Split;
use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::math::SeededRng;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{EncounterRange, JointState, SceneParameters, generate};
use sidestep::trial::simulate;
use sidestep::vehicle::TurnInput;
use std::ops::ControlFlow;

#[derive(Clone, Copy, Debug)]
enum Driver {
    /// Holds a random key for up to six steps.
    Random,
    /// Drives straight while the robot is far away, and otherwise turns away from the robot's side.
    Rule,
    /// Turns in one step of fifty.
    Rare,
    /// Turns away from the robot's side while the robot is ahead, with an occasional random input.
    Mixed,
}

impl Driver {
    const ALL: [Self; 4] = [Self::Random, Self::Rule, Self::Rare, Self::Mixed];

    /// An input, and the number of steps for which it is held.
    fn input(self, state: &JointState, rng: &mut SeededRng) -> (TurnInput, usize) {
        let [ahead, left, _] = state.robot_seen_by_human();
        let away = if left > 0.0 { TurnInput::Right } else { TurnInput::Left };
        match self {
            Self::Random => (TurnInput::ALL[rng.below(3)], 1 + rng.below(6)),
            Self::Rule if state.distance_m() > 6.0 => (TurnInput::Straight, 1),
            Self::Rule => (away, 1),
            Self::Rare if rng.below(50) > 0 => (TurnInput::Straight, 1),
            Self::Rare => (TurnInput::ALL[2 * rng.below(2)], 1),
            Self::Mixed if rng.below(20) == 0 => (TurnInput::ALL[rng.below(3)], 1),
            Self::Mixed if ahead < 2.0 => (TurnInput::Straight, 1),
            Self::Mixed => (away, 1),
        }
    }
}

fn drives(driver: Driver, tasks: usize, seed: u64, safety: &SafetyLevels) -> Dataset {
    let parameters = SceneParameters::default();
    let mut rng = SeededRng::new(seed);
    let scenes = generate(&parameters, &EncounterRange::default(), tasks, seed).unwrap();
    let drive = |(scene, _): &(sidestep::scene::Scene, _)| {
        let mut states = vec![scene.start()];
        let mut inputs = Vec::new();
        while inputs.len() < 50 {
            let (input, steps) = driver.input(states.last().unwrap(), &mut rng);
            inputs.resize((inputs.len() + steps).min(50), input);
            states = simulate(&parameters, scene, &inputs);
        }
        (inputs, states)
    };
    let drives: Vec<_> = scenes.iter().map(drive).collect();
    let trials = drives.iter().map(|(inputs, states)| (&inputs[..], &states[..]));
    Dataset::from_trials(&FeatureSet::all(), safety, trials)
}

/// Fits `models` on `sets` to every kind of driver, for each of these seeds.
fn fitted(seeds: impl IntoIterator<Item = u64>, models: &[ModelName], sets: &[NamedSet]) {
    let parameters = SceneParameters::default();
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
    for seed in seeds {
        for driver in Driver::ALL {
            let data = drives(driver, [8, 5, 14][seed as usize % 3], seed, &safety);
            let split = Split::grouped(&data);
            let kinds = |straight: bool| {
                split
                    .training
                    .iter()
                    .any(|&row| (data.labels[row] == TurnInput::Straight) == straight)
            };
            if !kinds(true) || !kinds(false) {
                continue;
            }
            for set in sets {
                let data = data.select(&set.features).unwrap();
                for &model in models {
                    let cells = fit(model, &data, &split, &Grids::default(), &set.name, 0);
                    let context = || format!("seed {seed}, {driver:?}, {model:?} on {}", set.name);
                    let cells = cells.unwrap_or_else(|error| panic!("{}: {error}", context()));
                    for cell in cells {
                        let p = &cell.test.probabilities;
                        assert!(p.iter().all(|p| (0.0..=1.0).contains(p)), "{}", context());
                    }
                }
            }
        }
    }
}

#[test]
fn every_model_is_fitted_whoever_drives() {
    let all = NamedSet { name: "all".to_owned(), features: FeatureSet::all() };
    let papers = NamedSet::papers().unwrap().swap_remove(0);
    let [body, _] = NamedSet::with_body_frame().unwrap().try_into().unwrap();
    let models: Vec<_> =
        ModelName::EVERY.into_iter().filter(|model| *model != ModelName::Svm).collect();
    fitted(0..3, &models, &[papers, body, all]);
}

/// For each of these seeds, an interior-point solver of linear SVMs cycles if it applies the full
/// correction in every step.
#[test]
fn every_linear_svm_is_fitted_whoever_drives() {
    let mut sets = NamedSet::papers().unwrap();
    sets.extend(NamedSet::with_body_frame().unwrap());
    sets.push(NamedSet::with_history().unwrap());
    fitted([36, 48, 60, 81, 105, 127, 136, 140, 146, 149, 151], &[ModelName::SvmLinear], &sets);
}
