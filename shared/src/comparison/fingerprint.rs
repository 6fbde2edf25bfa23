//! Fingerprints that show whether two machines learn and predict identically, bit for bit.

use super::fit::fit;
use super::models::{Grids, ModelName};
use super::sets::NamedSet;
use super::split::Split;
use crate::dataset::Dataset;
use crate::features::FeatureSet;
use crate::predict::{Predictor, PredictorFile};
use crate::reachability::SolveError;
use crate::safety::SafetyLevels;
use crate::scene::SceneParameters;
use crate::synthetic::{Keys, SyntheticDrive, SyntheticParticipant};
use core::ops::ControlFlow;
use sha2::{Digest, Sha256};

/// Number of training tasks, and number of tasks to predict. Each task has 50 rows.
const TASKS: (u64, u64) = (10, 50);

/// Seed of the synthetic participant.
const SEED: u64 = 20_180_918;

/// Returns the name of each stage of learning, with the SHA-256 of its results. If two machines
/// agree on all hashes, they compute the same features, train the same models of every kind in both
/// experiments, and make the same predictions.
///
/// A synthetic participant drives in two games. The safety levels of the paper's game have a closed
/// form. In the other game, the vehicles are unequal, and the safety levels are solved and sampled.
/// Models are trained with the whole protocol (cross-validation, calibration, refit), on B_hrd and
/// on the set with history. They are written to predictor.json and read back. Then they predict
/// 2,500 states.
///
/// # Errors
/// Never, because games, grids and data are fixed and valid.
pub fn learning_fingerprints() -> Result<Vec<(String, String)>, SolveError> {
    let equal = SceneParameters::default();
    let mut unequal = equal;
    unequal.robot.turn_rate_radps = 0.35;
    let mut found = Vec::new();
    for (levels, parameters) in [("closed form", equal), ("sampled", unequal)] {
        let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
        let all = rows(&safety, &parameters, 0..TASKS.0);
        let others = rows(&safety, &parameters, TASKS.0..TASKS.0 + TASKS.1);
        let mut add = |stage: String, hash: Sha256| {
            found.push((format!("{levels}, {stage}"), hex::encode(hash.finalize())));
        };
        add("features".to_owned(), of_numbers(all.values.iter().chain(&others.values)));
        let papers = NamedSet { name: "hrd".to_owned(), features: FeatureSet::subset("hrd")? };
        for set in [papers, NamedSet::with_history()?] {
            let (data, others) = (all.select(&set.features)?, others.select(&set.features)?);
            for model in ModelName::EVERY.into_iter().filter(|model| model.training().is_some()) {
                let split = Split::grouped(&data);
                let cells = fit(model, &data, &split, &small_grids(), &set.name, 0)?;
                let (mut trained, mut predicted) = (Sha256::new(), Sha256::new());
                for cell in &cells {
                    // Numbers in the text have the shortest form that parses back to the same bits.
                    trained.update(text(cell));
                    predict(&cell.predictor, &others, &mut predicted)?;
                }
                let name = format!("{}, {}", set.name, model.word());
                add(format!("{name}, training"), trained);
                add(format!("{name}, inference"), predicted);
            }
        }
        let turns = others.class_counts().map(|count| count as f64 / others.len() as f64);
        let constant = Predictor::constant(others.features.clone(), vec![-1, 0, 1], turns.into())?;
        let mut predicted = Sha256::new();
        predict(&PredictorFile::from(&constant), &others, &mut predicted)?;
        add("constant, inference".to_owned(), predicted);
    }
    Ok(found)
}

/// All features of these tasks.
fn rows(
    safety: &SafetyLevels,
    parameters: &SceneParameters,
    tasks: core::ops::Range<u64>,
) -> Dataset {
    let person = SyntheticParticipant::new(SEED, 0);
    let drive = |task| {
        let (scene, _) = person.own_trial(task, Keys::Clock);
        person.drive(task, parameters, &scene, Keys::Clock)
    };
    let drives: Vec<SyntheticDrive> = tasks.map(drive).collect();
    let trials = drives.iter().map(|drive| (&drive.inputs[..], &drive.states[..]));
    Dataset::from_trials(&FeatureSet::all(), safety, trials)
}

/// Grids with two values of each hyper-parameter.
fn small_grids() -> Grids {
    Grids {
        rbf_c: vec![1.0, 10.0],
        rbf_gamma: vec![0.03, 0.3],
        linear_c: vec![0.1, 1.0],
        tree_depth: vec![Some(4), None],
        tree_leaf: vec![1, 10],
        logistic_c: vec![0.1, 10.0],
        boosted_depth: vec![2, 3],
    }
}

/// Hashes the class and the probabilities that the file's predictor returns for every row.
fn predict(file: &PredictorFile, rows: &Dataset, hash: &mut Sha256) -> Result<(), SolveError> {
    let read = serde_json::from_str::<PredictorFile>(&text(file));
    let Ok(file) = read else { unreachable!("a predictor.json that was written is read") };
    let predictor = Predictor::try_from(file)?;
    let mut p = vec![0.0; predictor.classes().len()];
    for row in rows.values.chunks_exact(rows.features.len()) {
        predictor.probabilities_into(row, &mut p);
        hash.update(predictor.class(row).to_le_bytes());
        p.iter().for_each(|p| hash.update(p.to_bits().to_le_bytes()));
    }
    Ok(())
}

fn text(value: &impl serde::Serialize) -> String {
    let Ok(text) = serde_json::to_string(value) else {
        unreachable!("numbers, words and lists of them can be written")
    };
    text
}

fn of_numbers<'a>(numbers: impl Iterator<Item = &'a f64>) -> Sha256 {
    let mut hash = Sha256::new();
    numbers.for_each(|number| hash.update(number.to_bits().to_le_bytes()));
    hash
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_stage_has_a_name_and_a_hash_of_its_own() {
        let found = learning_fingerprints().unwrap();
        assert_eq!(found.len(), 2 * (1 + 2 * 5 * 2 + 1));
        let names: HashSet<_> = found.iter().map(|(name, _)| name).collect();
        let hashes: HashSet<_> = found.iter().map(|(_, hash)| hash).collect();
        // The frequencies of the constant predictor do not depend on the safety levels, so one hash
        // repeats.
        assert_eq!((names.len(), hashes.len()), (found.len(), found.len() - 1));
        assert_eq!(found, learning_fingerprints().unwrap());
    }
}
