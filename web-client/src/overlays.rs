//! What can be laid over a scene: one layer a file, one line a layer in
//! [`LAYERS`], painted in that order.

pub mod danger_zone;
pub mod future;
pub mod level_set;
pub mod shfrs;
pub mod stage;
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
    /// Word of the switch.
    pub name: &'static str,
    /// What the switch says, and its subscript.
    pub label: (&'static str, &'static str, &'static str),
    /// What it tells, for a tooltip.
    pub meaning: &'static str,
    /// Whether it is shown at first.
    pub shown: bool,
    /// What it draws.
    pub shapes: fn(&Moment<'_>) -> Vec<Shape>,
}

/// Every layer, from the bottom up.
pub static LAYERS: &[Layer] = &[
    Layer {
        name: "v-hr",
        label: ("V", "HR", " = 0"),
        meaning: "From a robot inside this line, at its heading, the human cannot escape for certain",
        shown: true,
        shapes: level_set::human,
    },
    Layer {
        name: "v-rh",
        label: ("V", "RH", " = 0"),
        meaning: "From a human inside this line, at their heading, the robot could not escape for certain",
        shown: true,
        shapes: level_set::robot,
    },
    Layer {
        name: "danger-zone",
        label: ("danger zone", "", ""),
        meaning: "Positions closer to the robot than the danger radius",
        shown: true,
        shapes: danger_zone::shapes,
    },
    Layer {
        name: "shfrs",
        label: ("SHFRS", "", ""),
        meaning: "Where the human may be within the next two seconds",
        shown: true,
        shapes: shfrs::shapes,
    },
    Layer {
        name: "future",
        label: ("future", "", ""),
        meaning: "Where the human really went",
        shown: true,
        shapes: future::shapes,
    },
    Layer {
        name: "trail",
        label: ("trail", "", ""),
        meaning: "Where both have come from",
        shown: true,
        shapes: trajectory::shapes,
    },
];
