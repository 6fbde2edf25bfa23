//! Bands of V around a vehicle, for the current headings.

use super::Playback;
use super::curves::to_world;
use super::style::Style;
use crate::chart::{Colour, LegendItem, colours};
use crate::picture::Picture;
use crate::scene::Evader;

/// Levels at the edges of the bands (m), from the outermost band inwards.
const BANDS_M: [f64; 6] = [4.0, 3.0, 2.0, 1.0, 0.0, -1.0];
/// Opacity of each band. Inner bands are painted over outer bands, so their opacities accumulate.
const OPACITY: f64 = 0.075;

/// Paints V_HR for each position of a robot with its current heading.
pub(super) fn human(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    paint(playback, Evader::Human, colours::HUMAN, picture);
}

/// Paints V_RH for each position of a human with their current heading.
pub(super) fn robot(playback: &mut Playback, _: &Style, picture: &mut Picture) {
    paint(playback, Evader::Robot, colours::ROBOT, picture);
}

pub(super) fn human_legend(playback: &Playback, _: &Style) -> Vec<LegendItem> {
    legend(playback, "V_HR if the robot were here", colours::HUMAN)
}

pub(super) fn robot_legend(playback: &Playback, _: &Style) -> Vec<LegendItem> {
    legend(playback, "V_RH if the human were here", colours::ROBOT)
}

fn legend(playback: &Playback, what: &str, colour: Colour) -> Vec<LegendItem> {
    let text = format!("{what}: each darker tone is 1 m less, from 4 m to −1 m");
    let item = LegendItem::area(&text, Some(colour.at(4.0 * OPACITY)), None);
    playback.safety().map(|_| item).into_iter().collect()
}

fn paint(playback: &mut Playback, evader: Evader, colour: Colour, picture: &mut Picture) {
    let Some(safety) = &playback.safety else { return };
    let state = &playback.now.state;
    let place = to_world(evader, state);
    let colour = if playback.is_doubtful(evader) { colours::MUTED } else { colour };
    for level_m in BANDS_M {
        for curve in playback.curves.of(safety, evader, level_m, state) {
            picture.polygon(
                curve.iter().map(|&point| place(point)),
                Some(colour.at(OPACITY)),
                None,
            );
        }
    }
}
