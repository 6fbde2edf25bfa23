//! Level sets of V_HR and V_RH for the current headings, in the world.

use super::Playback;
use super::curves::to_world;
use super::style::Style;
use crate::chart::{Colour, LegendItem, Pen, colours, number};
use crate::picture::Picture;
use crate::scene::Evader;

/// Paints the set {V_HR ≤ 0} and the other levels of the style. In this set, a robot with its
/// current heading could force a collision.
pub(super) fn human(playback: &mut Playback, style: &Style, picture: &mut Picture) {
    paint(playback, style, Evader::Human, picture);
}

/// Paints the set {V_RH ≤ 0} and the other levels of the style. In this set, a human with their
/// current heading could force a collision.
pub(super) fn robot(playback: &mut Playback, style: &Style, picture: &mut Picture) {
    paint(playback, style, Evader::Robot, picture);
}

pub(super) fn human_legend(playback: &Playback, style: &Style) -> Vec<LegendItem> {
    let inside = "inside, the robot can force a collision";
    legend(playback, style, Evader::Human, "V_HR", inside)
}

pub(super) fn robot_legend(playback: &Playback, style: &Style) -> Vec<LegendItem> {
    let inside = "inside, the human can force a collision";
    legend(playback, style, Evader::Robot, "V_RH", inside)
}

/// If the solve did not converge, its sets prove nothing and are drawn in grey.
fn colour(playback: &Playback, evader: Evader) -> Colour {
    match evader {
        _ if playback.is_doubtful(evader) => colours::MUTED,
        Evader::Human => colours::HUMAN,
        Evader::Robot => colours::ROBOT,
    }
}

/// The line V = 0 is emphasized.
fn pen(colour: Colour, level_m: f64) -> Pen {
    let width = if level_m == 0.0 { 1.75 } else { 1.0 };
    Pen::new(colour, width).dashed(5.0, if level_m == 0.0 { 3.0 } else { 5.0 })
}

fn paint(playback: &mut Playback, style: &Style, evader: Evader, picture: &mut Picture) {
    let colour = colour(playback, evader);
    let Some(safety) = &playback.safety else { return };
    let state = &playback.now.state;
    let place = to_world(evader, state);
    for &level_m in style.levels(evader) {
        let fill = (level_m == 0.0).then(|| colour.at(0.05));
        for curve in playback.curves.of(safety, evader, level_m, state) {
            let corners = curve.iter().map(|&point| place(point));
            picture.polygon(corners, fill, Some(pen(colour, level_m)));
        }
    }
}

fn legend(
    playback: &Playback,
    style: &Style,
    evader: Evader,
    name: &str,
    inside: &str,
) -> Vec<LegendItem> {
    if playback.safety.is_none() {
        return Vec::new();
    }
    let colour = colour(playback, evader);
    let item = |&level_m: &f64| {
        let level = number(level_m).replace('-', "−");
        let mut text = format!("{name} = {level} m");
        if playback.curves.is_nowhere(evader, level_m) {
            text += ": nowhere with these headings";
        } else if level_m == 0.0 {
            text = format!("{text}: {inside}");
        }
        if playback.is_doubtful(evader) {
            text += " (did not converge: draw no conclusion)";
        }
        let fill = (level_m == 0.0).then(|| colour.at(0.05));
        LegendItem::area(&text, fill, Some(pen(colour, level_m)))
    };
    style.levels(evader).iter().map(item).collect()
}
