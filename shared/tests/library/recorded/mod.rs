//! The recorded drives of **synthetic** participants (`tests/data/README.md`), and a predictor
//! trained on them. The numbers compare software; they say nothing about people.
#![allow(dead_code, reason = "each test uses some of it")]

use sidestep::dataset::Dataset;
use sidestep::features::FeatureSet;
use sidestep::learn::participant::{Driven, logistic};
use sidestep::math::SeededRng;
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::shfrs::tuning::Sample;
use sidestep::shfrs::window::Trajectory;
use sidestep::vehicle::{Pose, TurnInput};
use std::ops::ControlFlow;

/// Number of tasks of each participant.
pub(crate) const TASKS: usize = 50;

/// Numbers of drives for training a predictor and for calibration. The remaining drives are for the
/// test.
pub(crate) const TRAINING: usize = 160;
pub(crate) const CALIBRATION: usize = 120;

/// The drives of the file: all tasks of the first participant, then all tasks of the second, up to
/// the eighth participant.
pub(crate) fn drives() -> Vec<Driven> {
    let mut reader = csv::Reader::from_reader(&include_bytes!("../../data/trials.csv")[..]);
    let mut drives: Vec<Driven> = Vec::new();
    for row in reader.deserialize() {
        let row: [f64; 11] = row.expect("a row of numbers");
        if row[2] == 0.0 {
            drives.push(Driven::default());
        }
        let (inputs, states) = drives.last_mut().expect("a first step");
        inputs.push(TurnInput::try_from((2.0 * row[10]) as i64).expect("a turn rate"));
        let [human, robot] = [4, 7].map(|i| Pose::new(row[i], row[i + 1], row[i + 2]));
        states.push(JointState { human, robot });
    }
    drives
}

/// The drive as a trajectory. It omits the last input, because no state after this input is
/// recorded.
pub(crate) fn trajectory((inputs, states): &Driven) -> Trajectory {
    let human = SceneParameters::default().human;
    let rates = inputs[..inputs.len() - 1].iter().map(|&input| human.turn_rate(input));
    Trajectory::new(states.clone(), rates.collect()).expect("a trajectory")
}

/// The safety levels of the study.
pub(crate) fn safety() -> SafetyLevels {
    let parameters = SceneParameters::default();
    SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).expect("a closed form")
}

/// Trains a logistic regression on B_hrd.
pub(crate) fn trained<'a>(
    drives: impl IntoIterator<Item = &'a Driven>,
    safety: &SafetyLevels,
) -> Predictor {
    let features = FeatureSet::subset("hrd").expect("a feature set");
    let rows = drives.into_iter().map(|(inputs, states)| (&inputs[..], &states[..]));
    logistic(&Dataset::from_trials(&features, safety, rows)).expect("a fit")
}

/// Splits the drives at random. Each part mixes participants and scenes, so the parts are
/// exchangeable. Also returns a predictor trained on the training part.
pub(crate) fn split(drives: &[Driven], seed: u64, safety: &SafetyLevels) -> (Predictor, Sample) {
    let order = SeededRng::new(seed).permutation(drives.len());
    let (training, rest) = order.split_at(TRAINING);
    let (calibration, test) = rest.split_at(CALIBRATION);
    let part = |part: &[usize]| part.iter().map(|&i| trajectory(&drives[i])).collect();
    let sample =
        Sample { training: part(training), calibration: part(calibration), test: part(test) };
    (trained(training.iter().map(|&i| &drives[i]), safety), sample)
}
