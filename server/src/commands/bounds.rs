//! `sidestep bounds`.

use super::CommandError;
use super::json_file::JsonArgs;
use super::prediction::{Prediction, PredictorArgs};
use serde::Serialize;
use sidestep::bounds::{InputBounds, PredictedBounds};
use sidestep::scene::JointState;
use sidestep::vehicle::Pose;

/// Predict bounds on the human's turn rate for the coming steps (Algorithm 1).
///
/// The input, in m, s and rad, with headings counter-clockwise from +x, is
/// {"human": [x, y, psi], "robot": [x, y, psi],
/// "predictor": {… a predictor.json, which docs/predictor.md describes},
/// "epsilon": [rad/s, one for each set, ascending],
/// "k": [one for each step], "q": [one for each step] or "tau": 0.1 with "steps": T,
/// "rollout": "paper" or "base", "speed": 2, "dt": 0.2, "turn_rate": [-0.5, 0.5]}.
///
/// With "k", the k most likely turn rates count at each step. With "tau", all with at least this
/// probability. With "q", those in the shortest interval with at least this probability.
///
/// The robot is assumed to drive straight on. Fields with a default or another source are
/// "predictor", if --predictor names a file; "robot_speed" (default: the human's),
/// "robot_turn_rate" (default: the human's highest) and "danger_radius" (default: 3), which only
/// features of the game use (v_h, v_r, dv_…, closest_…); "history": [{"human": [x, y, psi],
/// "robot": […]}, …], the states of the preceding steps, which only features of the past use
/// (turned_…; 0 without a history).
///
/// The predictor's classes mean -1 (lowest turn rate), 0 (straight) and 1 (highest), unless
/// it has "actions": [rad/s, one for each class, ascending].
///
/// The answer, for F sets and T steps, is {"lo": […], "hi": […]}, F lists of T turn rates in rad/s;
/// "raw": [T pairs [lo, hi]], the bounds before widening; "human_low" and "human_high": [T + 1
/// poses [x, y, psi]], the human's poses from now on at the lowest and at the highest rates.
#[derive(Clone, Debug, clap::Args)]
pub struct BoundsArgs {
    #[command(flatten)]
    files: JsonArgs,
    #[command(flatten)]
    predictor: PredictorArgs,
}

#[derive(Serialize)]
struct Answer<'a> {
    lo: Vec<&'a [f64]>,
    hi: Vec<&'a [f64]>,
    raw: &'a [(f64, f64)],
    human_low: Vec<Pose>,
    human_high: Vec<Pose>,
}

/// Reads the document, runs Algorithm 1 and writes the answer.
///
/// [`CommandError`] for an invalid document, naming the field (input), or if the answer cannot be
/// written (failure).
pub async fn run(args: BoundsArgs) -> Result<(), CommandError> {
    args.files.check_out()?;
    let document = args.files.document();
    let beside = args.predictor.read([document])?;
    let Prediction { bounds, .. } = Prediction::of(document, beside.as_ref()).await?;
    args.files.answer(&Answer::from(&bounds))
}

impl<'a> From<&'a PredictedBounds> for Answer<'a> {
    fn from(found: &'a PredictedBounds) -> Self {
        let human = |states: &[JointState]| states.iter().map(|state| state.human).collect();
        Self {
            lo: found.sets.iter().map(InputBounds::lo).collect(),
            hi: found.sets.iter().map(InputBounds::hi).collect(),
            raw: &found.raw,
            human_low: human(&found.low),
            human_high: human(&found.high),
        }
    }
}
