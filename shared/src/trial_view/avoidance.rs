//! The path of a human who avoids the robot optimally.

use super::Playback;
use super::style::Style;
use crate::chart::{LegendItem, Pen, colours};
use crate::picture::Picture;
use crate::vehicle::dubins::arc;

/// Number of parts into which the path divides each step, because the optimal turn rate can change
/// within a step.
const PARTS: usize = 4;

pub(super) fn pen() -> Pen {
    Pen::new(colours::SERIES[2], 2.0).dashed(7.0, 3.0)
}

/// Paints the path. The human turns optimally against the worst-case robot, according to the
/// gradient of V_HR. The robot drives straight on, as in the study.
pub(super) fn paint(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    let Some(safety) = &playback.safety else { return };
    let parameters = &playback.recorded.parameters;
    let (steps, seconds) = (playback.steps_ahead(), parameters.step_s / PARTS as f64);
    let mut state = playback.now.state;
    let path = (0..steps * PARTS).map(|_| {
        let turn = safety.human.state(state.robot_seen_by_human()).evader_turn;
        let turn = if turn.is_finite() { turn } else { 0.0 };
        state.human = arc(state.human, parameters.human.speed_mps, turn, seconds);
        state.robot = arc(state.robot, parameters.robot.speed_mps, 0.0, seconds);
        state.human.position()
    });
    picture.polyline([playback.now.state.human.position()].into_iter().chain(path), pen());
}

pub(super) fn legend(playback: &Playback, _: &Style) -> Vec<LegendItem> {
    let item = LegendItem::line("best avoidance by V_HR, robot straight on", Some(pen()), None);
    playback.safety().map(|_| item).into_iter().collect()
}
