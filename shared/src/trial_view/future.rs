//! The recorded paths of the vehicles after this moment.

use super::Playback;
use super::style::Style;
use crate::chart::{LegendItem, Pen, colours};
use crate::picture::Picture;

fn human() -> Pen {
    Pen::new(colours::TEXT, 2.0).dashed(2.0, 3.0)
}

/// Paints a dotted line ahead of the human, and a fainter one ahead of the robot.
pub(super) fn paint(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    let (state, states) = (playback.now.state, &playback.recorded.states);
    let ahead = states.get(playback.now.step + 1..).unwrap_or_default();
    let path = || [state].into_iter().chain(ahead.iter().copied());
    let robot = Pen::new(colours::ROBOT, 1.0).dashed(1.0, 4.0);
    picture.polyline(path().map(|state| state.robot.position()), robot);
    picture.polyline(path().map(|state| state.human.position()), human());
}

pub(super) fn legend(playback: &Playback, _: &Style) -> Vec<LegendItem> {
    let is_known = playback.now.step < playback.recorded.inputs.len();
    let item = || LegendItem::line("what the human did next", Some(human()), None);
    is_known.then(item).into_iter().collect()
}
