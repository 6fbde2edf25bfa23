//! Scenes: what a trial starts from, how its state advances, and how a participant's scenes
//! are drawn.

mod parameters;
mod state;
mod rules;
mod design;

pub use design::{Encounter, generate, generate_with};
pub use parameters::{Evader, SceneParameters};
pub use rules::{EncounterRange, SceneRules, is_admissible};
pub use state::{JointState, Scene, closest_within_step};
