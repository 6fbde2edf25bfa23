//! The danger zone.

use super::Playback;
use super::style::Style;
use crate::chart::{LegendItem, Pen, colours, number};
use crate::picture::{Picture, stage};

/// The disc of radius R_c around the robot.
pub(super) fn paint(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    let radius_m = playback.recorded.parameters.danger_radius_m;
    picture.push(stage::danger_zone(playback.now.state.robot, radius_m));
}

pub(super) fn legend(playback: &Playback, _: &Style) -> Vec<LegendItem> {
    let radius = number(playback.recorded.parameters.danger_radius_m);
    let text = format!("danger zone: closer to the robot than {radius} m");
    vec![LegendItem::disc(&text, Some(colours::ROBOT.at(0.07)), Pen::new(colours::ROBOT, 1.0))]
}
