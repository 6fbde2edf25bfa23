//! The paths that the vehicles took up to this moment.

use super::Playback;
use super::style::Style;
use crate::chart::{Colour, LegendItem, Pen, colours};
use crate::picture::Picture;
use crate::scene::JointState;

/// Paints a line behind each vehicle.
pub(super) fn paint(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    let states = &playback.history;
    let mut line = |colour: Colour, position: fn(&JointState) -> [f64; 2]| {
        picture.polyline(states.iter().map(position), Pen::new(colour, 2.0));
    };
    line(colours::ROBOT, |state| state.robot.position());
    line(colours::HUMAN, |state| state.human.position());
}

pub(super) fn legend(_: &Playback, _: &Style) -> Vec<LegendItem> {
    vec![LegendItem::line("path so far", Some(Pen::new(colours::HUMAN, 2.0)), None)]
}
