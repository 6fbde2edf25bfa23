//! All layers of a trial's picture, each in its own file.

use super::Playback;
use super::style::Style;
use super::{avoidance, danger_zone, future, level_set, samples, shade, shfrs, trajectory};
use crate::chart::LegendItem;
use crate::picture::Picture;

/// A layer that can be shown or hidden.
pub struct Layer {
    /// Its name in links.
    pub name: &'static str,
    /// Label of its switch.
    pub label: &'static str,
    /// Subscript of V, if the layer shows levels of a value function.
    pub level: Option<&'static str>,
    /// Its meaning, as a sentence.
    pub meaning: &'static str,
    /// CSS classes of the layer's colour sample, such as `shade human`.
    pub swatch: &'static str,
    /// Whether it is shown by default.
    pub is_usual: bool,
    /// Paints it. The playback provides buffers that are reused from frame to frame.
    pub paint: fn(&mut Playback, &Style, &mut Picture),
    /// Its legend at this moment. Empty if it draws nothing.
    pub legend: fn(&Playback, &Style) -> Vec<LegendItem>,
}

/// Every layer, from the bottom up.
pub static LAYERS: &[Layer] = &[
    Layer {
        name: "shade-hr",
        label: "human’s safety",
        level: None,
        meaning: "V_HR at each place of the robot, with the present headings: the darker, the less safe",
        swatch: "shade human",
        is_usual: false,
        paint: shade::human,
        legend: shade::human_legend,
    },
    Layer {
        name: "shade-rh",
        label: "robot’s safety",
        level: None,
        meaning: "V_RH at each place of the human, with the present headings: the darker, the less safe",
        swatch: "shade robot",
        is_usual: false,
        paint: shade::robot,
        legend: shade::robot_legend,
    },
    Layer {
        name: "v-hr",
        label: "human at risk",
        level: Some("HR"),
        meaning: "If the robot is inside the line V_HR = 0, it can force a collision",
        swatch: "outline human",
        is_usual: true,
        paint: level_set::human,
        legend: level_set::human_legend,
    },
    Layer {
        name: "v-rh",
        label: "robot at risk",
        level: Some("RH"),
        meaning: "If the human is inside the line V_RH = 0, they can force a collision",
        swatch: "outline robot",
        is_usual: true,
        paint: level_set::robot,
        legend: level_set::robot_legend,
    },
    Layer {
        name: "danger-zone",
        label: "danger zone",
        level: None,
        meaning: "Positions closer to the robot than the danger radius",
        swatch: "zone",
        is_usual: true,
        paint: danger_zone::paint,
        legend: danger_zone::legend,
    },
    Layer {
        name: "shfrs",
        label: "predicted sets",
        level: None,
        meaning: "SHFRS: where the human may be in the time ahead, the likeliest inputs inside",
        swatch: "regions",
        is_usual: true,
        paint: shfrs::paint,
        legend: shfrs::legend,
    },
    Layer {
        name: "samples",
        label: "likely futures",
        level: None,
        meaning: "Paths of the human, with inputs drawn at random by the predicted probabilities",
        swatch: "samples",
        is_usual: false,
        paint: samples::paint,
        legend: samples::legend,
    },
    Layer {
        name: "avoidance",
        label: "best avoidance",
        level: None,
        meaning: "The path of a human who turns as V_HR says is best, while the robot drives straight on",
        swatch: "avoidance",
        is_usual: false,
        paint: avoidance::paint,
        legend: avoidance::legend,
    },
    Layer {
        name: "future",
        label: "future",
        level: None,
        meaning: "The path that the human took from here",
        swatch: "future",
        is_usual: true,
        paint: future::paint,
        legend: future::legend,
    },
    Layer {
        name: "trail",
        label: "trail",
        level: None,
        meaning: "The paths of both vehicles so far",
        swatch: "trail",
        is_usual: true,
        paint: trajectory::paint,
        legend: trajectory::legend,
    },
];

/// Index of the layer with this name.
#[must_use]
pub fn place(name: &str) -> Option<usize> {
    LAYERS.iter().position(|layer| layer.name == name)
}
