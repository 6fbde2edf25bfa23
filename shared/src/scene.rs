//! Scenes: the start of a trial, the motion of its vehicles, and the random scenes of a participant.

mod parameters;
mod state;
mod range;
mod rules;
mod design;

pub use design::{Encounter, generate, generate_with};
pub use parameters::{Evader, SceneParameters};
pub use range::EncounterRange;
pub use rules::{SceneRules, is_admissible};
pub use state::{JointState, Scene, closest_within_step};
