//! Likely futures: paths whose inputs are drawn from the predicted probabilities.

use super::style::Style;
use super::{Learned, Method, Playback, probabilities};
use crate::chart::{LegendItem, Pen, colours};
use crate::math::SeededRng;
use crate::picture::Picture;
use crate::shfrs::PredictedHuman;
use crate::vehicle::TurnInput;

/// Number of paths.
const PATHS: u64 = 16;

pub(super) fn pen() -> Pen {
    Pen::new(colours::HUMAN.at(0.4), 1.25)
}

/// Paints paths of the human from the current position. The robot drives straight on, as in the
/// study. The same moment always has the same paths, and the paths change little from moment to
/// moment.
pub(super) fn paint(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    let steps = playback.steps_ahead();
    let Playback { recorded, method, safety, history, now, .. } = playback;
    let (Some(Method::Learned(learned)), Some(safety)) = (method, safety) else { return };
    let parameters = &recorded.parameters;
    let human = PredictedHuman::new(&learned.predictor, safety, parameters);
    let Ok(human) = human else { return };
    let seen = history.len();
    for seed in 0..PATHS {
        let mut rng = SeededRng::new(seed);
        let mut state = now.state;
        let path = (0..steps).map(|_| {
            let input = drawn(&human, learned, history, rng.unit());
            state = state.advance(parameters, input, 0.0, parameters.step_s);
            history.push(state);
            state.human.position()
        });
        picture.polyline([now.state.human.position()].into_iter().chain(path), pen());
        history.truncate(seen);
    }
}

/// The input at a quantile (0 to 1) of the predicted distribution.
fn drawn(
    human: &PredictedHuman<'_>,
    learned: &Learned,
    history: &[crate::scene::JointState],
    place: f64,
) -> TurnInput {
    let mut left = place;
    for (input, p) in probabilities(human, learned, history) {
        if left < p {
            return input;
        }
        left -= p;
    }
    TurnInput::Straight
}

pub(super) fn legend(playback: &Playback, _: &Style) -> Vec<LegendItem> {
    let text = format!("{PATHS} likely futures, drawn by the predicted probabilities");
    let item = LegendItem::line(&text, Some(pen()), None);
    playback.probabilities.map(|_| item).into_iter().collect()
}
