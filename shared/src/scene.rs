//! Scenes: the start of a trial, the motion of its vehicles, and the random scenes of a participant.

mod parameters;
mod state;
mod robot;
mod assigned;
mod encounter;
mod range;
mod rules;
mod strata;
mod design;
mod williams;
mod counterbalanced;

pub use assigned::Scene;
pub use counterbalanced::{StratifiedScene, counterbalanced};
pub use design::{generate, generate_with};
pub use encounter::Encounter;
pub use parameters::{Evader, SceneParameters};
pub use range::EncounterRange;
pub use robot::{RobotPolicy, RobotsVary, Rule, ScriptedTurn};
pub use rules::{SceneRules, is_admissible};
pub use state::{JointState, closest_within_step};
pub use strata::{Coordinate, Strata, Stratification};
pub use williams::{williams_block, williams_order};
