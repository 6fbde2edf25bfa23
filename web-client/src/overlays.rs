//! What can be laid over a scene: one layer a file, one line a layer in
//! [`LAYERS`], painted in that order.

pub mod stage;
pub mod danger_zone;
pub mod level_set;
pub mod shfrs;
pub mod future;
pub mod trajectory;

use crate::shape::Shape;
use sidestep::api::TrialDetail;
use sidestep::safety::SafetyLevels;
use sidestep::scene::JointState;
use sidestep::shfrs::Shfrs;

/// One moment of a trial with all that is known of it.
pub struct Moment<'a> {
    /// The trial.
    pub trial: &'a TrialDetail,
    /// The step that the moment lies in; the number of steps at the end.
    pub step: usize,
    /// Where the vehicles are.
    pub state: JointState,
    /// Where safety levels are read from, once it is there.
    pub safety: Option<&'a SafetyLevels>,
    /// The predicted sets, once there is a predictor.
    pub shfrs: Option<&'a Shfrs>,
    /// Whether these are shown for each step instead of for the whole time ahead.
    pub by_step: bool,
}

/// Something that can be shown or hidden.
pub struct Layer {
    /// Name of its switch for tests.
    pub name: &'static str,
    /// What the switch calls it.
    pub label: &'static str,
    /// Subscript of V where the layer is the set {V ≤ 0}.
    pub level: Option<&'static str>,
    /// What it tells, for a tooltip.
    pub meaning: &'static str,
    /// Style class of the colour that it is drawn in.
    pub swatch: &'static str,
    /// What it draws.
    pub shapes: fn(&Moment<'_>) -> Vec<Shape>,
}

/// Every layer, from the bottom up.
pub static LAYERS: &[Layer] = &[
    Layer {
        name: "v-hr",
        label: "human at risk",
        level: Some("HR"),
        meaning: "If the robot is inside this line, it can force a collision",
        swatch: "outline human",
        shapes: level_set::human,
    },
    Layer {
        name: "v-rh",
        label: "robot at risk",
        level: Some("RH"),
        meaning: "If the human is inside this line, they can force a collision",
        swatch: "outline robot",
        shapes: level_set::robot,
    },
    Layer {
        name: "danger-zone",
        label: "danger zone",
        level: None,
        meaning: "Positions closer to the robot than the danger radius",
        swatch: "zone",
        shapes: danger_zone::shapes,
    },
    Layer {
        name: "shfrs",
        label: "predicted sets",
        level: None,
        meaning: "SHFRS: where the human may be within the next two seconds",
        swatch: "regions",
        shapes: shfrs::shapes,
    },
    Layer {
        name: "future",
        label: "future",
        level: None,
        meaning: "The path that the human took from here",
        swatch: "future",
        shapes: future::shapes,
    },
    Layer {
        name: "trail",
        label: "trail",
        level: None,
        meaning: "The paths of both vehicles so far",
        swatch: "trail",
        shapes: trajectory::shapes,
    },
];
