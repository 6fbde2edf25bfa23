//! The recorded drives of synthetic people (`tests/data/trials.csv`), and a predictor of them.

use std::error::Error;

use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::math::SeededRng;
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::tuning::Sample;
use sidestep::shfrs::window::Trajectory;
use sidestep::training::{Driven, logistic};
use sidestep::vehicle::{Pose, TurnInput};

/// Drives of a predictor's training and of a calibration; the rest is for the test.
pub(crate) const TRAINING: usize = 160;
pub(crate) const CALIBRATION: usize = 120;

/// The drives of the file, 50 of each of eight participants.
pub(crate) fn drives() -> Result<Vec<Driven>, Box<dyn Error>> {
    let mut reader = csv::Reader::from_reader(&include_bytes!("../../tests/data/trials.csv")[..]);
    let mut drives: Vec<Driven> = Vec::new();
    for row in reader.deserialize() {
        let row: [f64; 11] = row?;
        if row[2] == 0.0 {
            drives.push(Driven::default());
        }
        let (inputs, states) = drives.last_mut().ok_or("a drive that has no first step")?;
        inputs.push(TurnInput::try_from((2.0 * row[10]) as i64)?);
        let [human, robot] = [4, 7].map(|i| Pose::new(row[i], row[i + 1], row[i + 2]));
        states.push(JointState { human, robot });
    }
    Ok(drives)
}

/// The drive as a trajectory: its last input leads to no recorded state.
fn trajectory(
    (inputs, states): &Driven,
    parameters: &SceneParameters,
) -> Result<Trajectory, Box<dyn Error>> {
    let rates = inputs[..inputs.len() - 1].iter().map(|&input| parameters.human.turn_rate(input));
    Ok(Trajectory::new(states.clone(), rates.collect())?)
}

/// Drives parted at random: people and scenes are mixed in each part, so that the parts are
/// exchangeable. And a logistic regression on B_hrd, trained on the training part.
pub(crate) fn split(
    drives: &[Driven],
    seed: u64,
    safety: &SafetyLevels,
    parameters: &SceneParameters,
) -> Result<(Predictor, Sample), Box<dyn Error>> {
    let order = SeededRng::new(seed).permutation(drives.len());
    let (training, rest) = order.split_at(TRAINING);
    let (calibration, test) = rest.split_at(CALIBRATION);
    let part = |part: &[usize]| -> Result<Vec<Trajectory>, Box<dyn Error>> {
        part.iter().map(|&i| trajectory(&drives[i], parameters)).collect()
    };
    let sample =
        Sample { training: part(training)?, calibration: part(calibration)?, test: part(test)? };
    let features = FeatureSet::subset("hrd")?;
    let rows = training.iter().map(|&i| (&drives[i].0[..], &drives[i].1[..]));
    let data = Dataset::from_trials(&features, safety, rows);
    Ok((logistic(&data)?, sample))
}
